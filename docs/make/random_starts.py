"""A thousand random starts on each case: where they end, and whether any answer is unstable.

    nice -n 19 python docs/make/random_starts.py [--starts N]

Gains are drawn over signs, crossovers and decades, and those whose loop is stable are starts of the
solver: no screening by cost, no guesses, no polishing.  Every answer that it accepts (converged,
stable by the optimiser's own test, limits kept on its nodes) is checked by code that it does not
use: the winding number of the return difference with the exact delays.  Writes
`docs/data/random_starts.csv`, a row for each start, and `docs/images/random_starts.svg`.

Exit code 1 if an accepted answer is unstable.
"""

from __future__ import annotations

import os

# Before NumPy is loaded: one thread for matrices of twenty rows.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from stored import docs_folder, read_rows, study_parser, write_rows

from models import PhysicsWarning, load_case
from models.basics import one_thread
from synth.loop import closed_loop_poles, with_elements
from synth.question import Problem, pose
from synth.search import Solution, briskest, settle, start_coefficients
from synth.search.starts import crossover_grid
from synth.verify import LawMatrices, winding_of_plant

FloatArray = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "random_starts.csv"
FIGURE = ROOT / "docs" / "images" / "random_starts.svg"
#: Questions by what tables call them.  At 2000 m the rope's drive can follow no sea in which the
#: payload's drag still damps the rope, so its limits are reported there, and kept at 300 m.  Deep
#: down three gains break their limits wherever they start, and are rolled off.
_GAINS, _ROLLED = "payload-feedback", "payload-feedback-rolloff"
QUESTIONS: Mapping[str, tuple[str, str, Mapping[str, object]]] = {
    "thesis-1975": ("thesis-1975", _GAINS, {}),
    "thesis-1975-rope, 2000 m": ("thesis-1975-rope", _ROLLED, {"limits.drive": "report"}),
    "thesis-1975-rope, 300 m, H_s 0.1 m": (
        "thesis-1975-rope",
        _GAINS,
        {"rope.length": 300.0, "sea.significant_height": 0.1},
    ),
    "subsea-crane": ("subsea-crane", _ROLLED, {}),
}
REACHED = 0.02  # of the log cost: first answers leak about as much between their nodes
_BATCH = 2000


@dataclass(frozen=True, kw_only=True)
class Row:
    """One start: cost in m rms (nan if not accepted), right half-plane poles by winding number."""

    question: str
    start: int
    cost: float
    accepted: bool
    unstable: int
    iterations: int
    seconds: float


def drawn(problem: Problem, count: int, seed: int) -> tuple[list[FloatArray], int]:
    """Return stable random gains, and how many had to be drawn for them."""
    rng = np.random.default_rng(seed)
    omega = crossover_grid(problem)
    yu = problem.plant.response_at((1e-3 + 1j) * omega).yu
    (drag,) = start_coefficients(problem)
    found: list[FloatArray] = []
    total = 0
    while len(found) < count:
        points = problem.law.draw(rng.random((_BATCH, problem.law.dimensions)), omega, yu)
        for point in points:
            total += 1
            if problem.stable(point, drag):
                found.append(point)
                if len(found) == count:
                    break
    return found, total


def unstable_poles(problem: Problem, solved: Solution) -> int:
    """Return the unstable poles of an answer's loop by its winding number, delays exact."""
    plant = with_elements(problem.plant, problem.elements, solved.coefficient)
    controller = problem.law.controller([float(v) for v in solved.values])
    marks = closed_loop_poles(plant.without_delays(8), controller)
    marks = marks[np.abs(marks) > 0.0]
    winding = winding_of_plant(plant, LawMatrices.of(controller, plant), marks)
    return 0 if winding.stable else max(1, winding.unstable)


def rows_of(name: str, count: int, seed: int = 1) -> tuple[list[Row], int]:
    """Return the rows of a question, and how many gains were drawn."""
    bundled, structure, changes = QUESTIONS[name]
    problem = pose(load_case(bundled).replace(dict(changes)), structure).problem
    with one_thread():
        begins, total = drawn(problem, count, seed)
        reference, drags = briskest(problem, begins), start_coefficients(problem)
        rows = []
        for k, begin in enumerate(begins):
            began = time.process_time()
            solved = settle(problem, begin, drags, reference=reference, exact=True)
            stable = problem.stable(solved.values, solved.coefficient)
            accepted = bool(solved.converged and stable)
            rows.append(
                Row(
                    question=name,
                    start=k,
                    cost=math.exp(solved.objective) if accepted else math.nan,
                    accepted=accepted,
                    unstable=unstable_poles(problem, solved) if accepted else 0,
                    iterations=solved.iterations,
                    seconds=time.process_time() - began,
                )
            )
    return rows, total


def summary(rows: Sequence[Row]) -> str:
    """Return what the starts of one question did, as a sentence."""
    costs = [row.cost for row in rows if row.accepted]
    best = min(costs, default=math.inf)
    reached = sum(math.log(cost / best) < REACHED for cost in costs)
    unstable = sum(row.unstable > 0 for row in rows)
    seconds = np.median([row.seconds for row in rows])
    return (
        f"{rows[0].question}: {len(costs)} of {len(rows)} accepted, {unstable} of them unstable; "
        f"{reached} ({100.0 * reached / len(rows):.1f} %) within 2 % of {1e3 * best:.4g} mm; "
        f"{seconds:.2f} s a start (median)"
    )


def read(path: Path = CSV) -> list[Row]:
    """Return the stored rows."""
    return [
        Row(
            question=entry["question"],
            start=int(entry["start"]),
            cost=float(entry["cost"]),
            accepted=entry["accepted"] == "yes",
            unstable=int(entry["unstable"]),
            iterations=int(entry["iterations"]),
            seconds=float(entry["seconds"]),
        )
        for entry in read_rows(path)
    ]


def write(rows: Sequence[Row], path: Path = CSV) -> None:
    """Write the rows."""
    told = [
        {
            "question": row.question,
            "start": row.start,
            "cost": f"{row.cost:.6g}",
            "accepted": "yes" if row.accepted else "no",
            "unstable": row.unstable,
            "iterations": row.iterations,
            "seconds": f"{row.seconds:.3g}",
        }
        for row in rows
    ]
    write_rows(path, list(told[0]), told)


def figure(rows: Sequence[Row], kind: str = "svg") -> bytes:
    """Return the sorted final costs of each question as a picture."""
    from stillhook.text import AFTER, BEFORE, new_figure, picture, styled, typeset

    names = list(dict.fromkeys(row.question for row in rows))
    with styled():
        sheet = new_figure(8.4, 5.4)
        panels = np.atleast_1d(sheet.subplots(2, 2)).ravel()
        for axes, name in zip(panels, names, strict=False):
            own = [row for row in rows if row.question == name]
            costs = np.sort([1e3 * row.cost for row in own if row.accepted])
            share = 100.0 * np.arange(1, costs.size + 1) / len(own)
            best = float(np.sum(np.log(costs / costs[0]) < REACHED))
            axes.step(share, costs, where="pre", color=AFTER)
            axes.axvspan(100.0 * costs.size / len(own), 100.0, color=BEFORE, alpha=0.15, lw=0)
            low, high = costs[0] / 1.5, max(costs[-1] * 1.5, costs[0] * 4.0)
            axes.set_yscale("log")
            ticks = [m * 10.0**k for k in range(-2, 5) for m in (1, 2, 5)]
            shown = [tick for tick in ticks if low <= tick <= high]
            axes.set_yticks(shown, [f"{tick:g}" for tick in shown])
            axes.set_yticks([], minor=True)
            axes.set(xlim=(0.0, 100.0), ylim=(low, high))
            axes.set_title(
                typeset(f"{name}: {100.0 * best / len(own):.0f} % at the best"), fontsize=9.5
            )
        sheet.supxlabel("starts, sorted [%]; shaded: no answer accepted", fontsize=9.5)
        sheet.supylabel("payload after the first pass [mm rms]", fontsize=9.5)
    return picture(sheet, kind)


def main(argv: Sequence[str] | None = None) -> int:
    """Run all questions, or some; return 1 if an accepted answer is unstable."""
    parser = study_parser(__doc__)
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--draw", action="store_true", help="only draw what is stored")
    parser.add_argument("--only", default="", help="part of the name of a question")
    given = parser.parse_args(argv)
    docs = docs_folder(given.quick)
    path, picture = docs / "data" / CSV.name, docs / "images" / FIGURE.name
    if given.draw:
        picture.write_bytes(figure(read()))
        return 0
    known = read(path) if path.exists() and given.only else []
    rows = []
    for name in QUESTIONS:
        if given.only not in name:
            rows += [row for row in known if row.question == name]
            continue
        found, total = rows_of(name, 10 if given.quick else given.starts)
        print(f"{summary(found)}; {total} gains drawn for {len(found)} stable ones", flush=True)
        rows += found
    write(rows, path)
    picture.write_bytes(figure(rows))
    return int(any(row.unstable for row in rows))


if __name__ == "__main__":
    warnings.simplefilter("ignore", PhysicsWarning)
    raise SystemExit(main())
