"""How fast robust design is, and what it buys: `python docs/make/robust.py [--quick]`.

Four questions: 27 scenarios minimax, in seconds a start; what one set of gains costs each of those
scenarios, designed for the worst, for the mean or for the regret; Pareto fronts of 100 points,
timed; and how far each structure on the crane is from the bound.  Unless ``--quick``, the answers
go to `docs/data/robust.csv`, `pareto.csv` and `structure_bounds.csv`, and `robust_figures.py`
draws them.  (`random_starts.py` asks whether an accepted design can be unstable.)
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread for matrices of twenty rows.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from robust_figures import write
from stored import docs_folder, study_parser, write_rows

from models import load_case
from models.basics import PhysicsWarning, one_thread
from models.sensing import aboard
from synth.bound import bound_for
from synth.design import optimise_gains
from synth.question import FamilyProblem
from synth.robust import Family, optimise_robust
from synth.robust.family_plants import FamilyPlants
from synth.robust.worst_case import draw_check
from synth.search import begin_points, briskest, search, settle, start_coefficients
from synth.sizing import pareto_front
from synth.structures import structure_names

DATA = Path(__file__).resolve().parents[2] / "docs" / "data"
SEAS = ((1.5, 7.0), (2.4, 8.5), (3.5, 10.0))
VARY = {"depth": [1000.0, 1500.0, 2000.0], "payload": [20e3, 36844.0, 50e3]}
OBJECTIVES = ("worst", "mean", "regret")
FRONTS = ("torque", "max_sensitivity", "delay_margin")
REACHED = 1e-3  # of the log cost on the same nodes

Row = Mapping[str, object]


def family() -> Family:
    """Return the family: nine plants in three seas."""
    return Family.of(load_case("thesis-1975"), VARY, SEAS)


def minimax(starts: int, draws: int) -> None:
    """Say how long a start with 27 scenarios takes, and what random draws say of the answer."""
    plants = FamilyPlants(family())
    members = tuple(plants.scenario(m) for m in plants.family.grid())
    problem = FamilyProblem(scenarios=members)
    with one_thread():
        begins = begin_points(problem, 3 * starts, 0)
        reference, drags = briskest(problem, begins), start_coefficients(problem)
        seconds, ends = [], []
        for begin in begins:
            began = time.perf_counter()
            solved = settle(problem, begin, drags, reference=reference)
            seconds.append(time.perf_counter() - began)
            good = solved.converged and problem.stable(solved.values, solved.coefficients)
            ends.append(solved.objective if good else np.inf)
        reached = int(np.sum(np.array(ends) < min(ends) + REACHED))
        print(
            f"27 scenarios: a start: median {np.median(seconds):.2f} s, "
            f"longest {max(seconds):.2f} s; {int(np.isfinite(ends).sum())} of {len(ends)} "
            f"converged, {reached} at the best"
        )
        began = time.perf_counter()
        found = search(problem, starts, 0)
        assert found.solved is not None
        print(
            f"  whole search: {time.perf_counter() - began:.1f} s, worst "
            f"{1e3 * found.solved.costs.max():.1f} mm, excess {found.excess:.1e}"
        )
        began = time.perf_counter()
        check = draw_check(plants, [float(v) for v in found.solved.values], draws)
        print(f"  {check}; {time.perf_counter() - began:.1f} s")


def objectives(starts: int, draws: int) -> list[Row]:
    """Return each scenario's payload rms [m] with gains for the worst, the mean, the regret."""
    rows: list[Row] = []
    for objective in OBJECTIVES:
        began = time.process_time()
        case = load_case("thesis-1975").replace({"limits.drive": "report"})
        asked = Family.of(case, VARY, SEAS)
        design = optimise_robust(case, asked, objective, starts=starts, draws=draws)
        print(
            f"{objective}: {'ok' if design.ok else design.status}; worst "
            f"{1e3 * design.worst.design.payload_rms:.1f} mm, mean {1e3 * design.mean_rms:.1f} mm; "
            f"{time.process_time() - began:.0f} s"
        )
        rows += [
            {
                "objective": objective,
                "ok": "yes" if design.ok else "no",
                "scenario": scenario.name,
                "payload_rms": scenario.design.payload_rms,
                "payload_rms_before": scenario.design.payload_rms_before,
                "best_rms": scenario.best_rms if scenario.best_rms is not None else "",
                "max_sensitivity": scenario.margins.max_sensitivity,
            }
            for scenario in design.scenarios
        ]
    return rows


def fronts(points: int) -> list[Row]:
    """Return the points of the fronts, and say how long they took."""
    rows: list[Row] = []
    for against in FRONTS:
        began, used = time.perf_counter(), time.process_time()
        found = pareto_front(load_case("thesis-1975"), against, points=points)
        passed, asked = found.verified
        print(
            f"front against {against}: {len(found.points)} of {points} points in "
            f"{time.perf_counter() - began:.1f} s ({time.process_time() - used:.1f} s of "
            f"processor time), {passed} of {asked} checked"
        )
        for point in found.points:
            rows.append(
                {
                    "against": against,
                    "unit": found.unit,
                    "bound": point.bound,
                    "value": point.value,
                    "payload_rms": point.payload_rms,
                    "max_sensitivity": point.max_sensitivity,
                    "torque_rms": point.torque_rms,
                    "knee": "yes" if point is found.knee else "no",
                    **{name: point.parameters[name] for name in ("a", "a1", "a2")},
                }
            )
    return rows


def bounds(starts: int) -> list[Row]:
    """Return each structure on the crane beside the bound with the sensors that it hears."""
    rows: list[Row] = []
    case = load_case("subsea-crane")
    for name in structure_names():
        design = optimise_gains(case, name, starts=starts)
        if design.margins is None:
            print(f"{name}: {design.status}")
            continue
        own, every = bound_for(design), bound_for(design, measurements=aboard(case))
        print(f"{name}: {1e3 * design.payload_rms:.4g} mm, {own.factor:.3g} times the bound")
        rows.append(
            {
                "structure": name,
                "ok": "yes" if design.ok else "no",
                "payload_rms": design.payload_rms,
                "on_the_bound_s_terms": own.rms,
                "bound_same_sensors": own.free.value,
                "bound_all_sensors": every.free.value,
                "exact_sensors": " ".join(own.exact),
            }
        )
    return rows


def store(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV in SI units."""
    told = ({k: f"{v:.8g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    write_rows(path, list(rows[0]), told)


def main(arguments: Sequence[str] | None = None) -> int:
    """Ask the questions."""
    parser = study_parser(__doc__)
    parser.add_argument("--only", default="", help="minimax, objectives, fronts or bounds")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore", PhysicsWarning)
    quick = given.quick
    docs = docs_folder(quick)
    if quick and not given.only:
        given.only = "objectives"
    if given.only in ("", "minimax"):
        minimax(2 if quick else 8, 500 if quick else 10_000)
    stored = {
        "objectives": (
            "robust.csv",
            lambda: objectives(2 if quick else 24, 500 if quick else 2000),
        ),
        "fronts": ("pareto.csv", lambda: fronts(10 if quick else 100)),
        "bounds": ("structure_bounds.csv", lambda: bounds(1 if quick else 8)),
    }
    for question, (name, answer) in stored.items():
        if given.only in ("", question):
            store(docs / "data" / name, answer())
    write(docs)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
