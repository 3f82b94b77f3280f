"""Landing a module within 4 cm: what each controller does on the bundled case `landing`.

The scenario of the same name holds the module 7.5 m above the seabed, lowers it to 5 m, holds it
there and sets it down with rope to spare.

    python docs/make/landing.py

designs the linear controllers (`docs/data/landing_designs.csv`), simulates all of them
(`docs/data/landing.csv`, a row for each run) and has `landing_page.py` write the page.  With
``--quick`` the stored designs are simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
from stored import docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models.basics import Interval, mean_interval
from models.sensing import Controller
from synth.controllers.feed_forward import lead_of
from synth.question import controller_for

DATA = Path(__file__).resolve().parents[1] / "data"
CSV = DATA / "landing.csv"
DESIGNS = DATA / "landing_designs.csv"

TOLERANCE = 0.04  # University of Agder, MAS409 [m]
SEEDS = 20
FEWER = {"nonlinear-mpc": 8}  # of what takes long
SETTLED = 10.0  # after the set-point has come to rest, before the payload counts as held [s]

PERFECT_MRU: Mapping[str, object] = {
    "sensors.mru.noise_floor": 0.0,
    "sensors.mru.noise_fraction": 0.0,
    "sensors.mru.delay": 0.0,
    "sensors.mru.heave_filter_period": None,
}
GOOD_MRU: Mapping[str, object] = {
    "sensors.mru.noise_floor": "1 cm",
    "sensors.mru.noise_fraction": 0.01,
}
DRIFTING_MRU: Mapping[str, object] = {
    "sensors.mru.noise_floor": 0.0,
    "sensors.mru.noise_fraction": 0.0,
    "sensors.mru.drift": "5 cm",
}
PERFECT_PAYLOAD: Mapping[str, object] = {
    "sensors.payload.bandwidth": "perfect",
    "sensors.payload.acceleration_noise": 0.0,
    "sensors.payload.velocity_noise": 0.0,
    "sensors.payload.displacement_noise": 0.0,
    "sensors.telemetry.delay": 0.0,
}

Row = dict[str, str | float]
Maker = Callable[[sh.Case], Controller]


def design_rows(case: sh.Case) -> list[dict[str, str]]:
    """Return a row for each structure of `sh.optimise_gains`, the one that it answers with last."""
    answer = sh.optimise_gains(case)
    return [
        {
            "structure": design.structure,
            "ok": "yes" if design.ok else "no",
            "payload_rms": f"{design.payload_rms:.6g}",
            "parameters": ";".join(f"{k}={v!r}" for k, v in design.parameters.items()),
            "status": design.status,
        }
        for design in (*answer.alternatives, answer)
    ]


@cache
def designs(path: Path = DESIGNS) -> Mapping[str, Mapping[str, float]]:
    """Return the stored parameters by structure."""
    return {row["structure"]: parameters_of(row) for row in read_rows(path)}


def parameters_of(row: Mapping[str, str]) -> dict[str, float]:
    """Return the parameters of a stored design."""
    pairs = (item.partition("=") for item in row["parameters"].split(";"))
    return {name: float(value) for name, _, value in pairs}


def _designed(structure: str, case: sh.Case) -> Controller:
    # Made for the case as it was designed for: other sensors do not change the controller.
    made_for = sh.load_case("landing")
    return sh.LinearFeedback(case, controller_for(made_for, structure, designs()[structure]))


def _share(share: float, *, lead: bool = False) -> Maker:
    return lambda case: sh.VelocityFeedForward(
        case, share=share, lead=lead_of(case) if lead else 0.0
    )


# The controllers, and what is asked of each to see what limits it: changes of the case, and who.
CONTROLLERS: Mapping[str, tuple[Mapping[str, object], Maker]] = {
    "mpc": ({}, sh.LinearMPC),
    "nonlinear-mpc": ({}, sh.NonlinearMPC),
    "combined": ({}, partial(_designed, "combined")),
    "drum-feedback": ({}, partial(_designed, "drum-feedback")),
    "payload-feedback-rolloff": ({}, partial(_designed, "payload-feedback-rolloff")),
    "payload-feedback": ({}, partial(_designed, "payload-feedback")),
    "feed-forward, designed": ({}, partial(_designed, "feed-forward")),
    "feed-forward": ({}, _share(0.9)),
    "feed-forward-lead": ({}, _share(0.9, lead=True)),
    "constant-tension": ({}, sh.ConstantTension),
    "lowered without compensation": ({}, _share(0.0)),
    "none": ({}, sh.BrakeOn),
}
LIMITS: Mapping[str, tuple[Mapping[str, object], Maker]] = {
    "mpc-ar": ({}, partial(sh.LinearMPC, predictor="ar")),
    "combined, perfect MRU": (PERFECT_MRU, partial(_designed, "combined")),
    "combined, perfect payload sensors": (PERFECT_PAYLOAD, partial(_designed, "combined")),
    "payload-feedback-rolloff, perfect payload sensors": (
        PERFECT_PAYLOAD,
        partial(_designed, "payload-feedback-rolloff"),
    ),
    "feed-forward of 0.9, perfect MRU": (PERFECT_MRU, _share(0.9)),
    "feed-forward of 1": ({}, _share(1.0)),
    "feed-forward of 1, perfect MRU": (PERFECT_MRU, _share(1.0)),
    "feed-forward of 1 with lead, perfect MRU": (PERFECT_MRU, _share(1.0, lead=True)),
    "feed-forward of 1, MRU of 1 cm": (GOOD_MRU, _share(1.0)),
    "feed-forward of 1, MRU that drifts by 5 cm": (DRIFTING_MRU, _share(1.0)),
}
# Who is landed with the other touch-down phases too, and without: `mpc, touchdown none`.
_OTHERS = (", touchdown none", ", touchdown tension")
PHASES = tuple(
    f"{name}{other}"
    for name in ("mpc", "nonlinear-mpc", "combined", "feed-forward")
    for other in _OTHERS
)


@cache
def made(name: str) -> tuple[sh.Case, Controller]:
    """Return the case and the controller of a row."""
    changes, maker = {**CONTROLLERS, **LIMITS}[name]
    case = sh.load_case("landing").replace(changes)
    return case, maker(case)


def runs_of(name: str, seeds: int | Sequence[int]) -> sh.Runs:
    """Return the runs of a row's controller, with their traces."""
    own, _, mode = name.partition(", touchdown ")
    options = {"touchdown": mode} if mode else {}
    return sh.simulate(*made(own), scenario="landing", seeds=seeds, options=options)


def seeds_of(name: str) -> int:
    """Return how many seeds a row's controller meets."""
    return FEWER.get(name.partition(", touchdown ")[0], SEEDS)


def rows_of(name: str, seeds: int | Sequence[int]) -> list[Row]:
    """Return a row for each seed, in SI units; NaN is what did not happen.

    ``within`` is the share of the time in which the payload is held that it is within the
    tolerance, ``rms`` and ``largest`` are of its error then, ``minute_before`` is the rms of the
    error in the minute before touchdown.  ``bounce`` and ``lifted`` say how
    high it is above the seabed after touchdown, until the controller is disengaged and from then
    on, ``touchdowns`` how often it comes down, ``hardest`` how fast at most.  ``snap_load`` is the
    largest tension after slack, ``end_haul`` minus the rope that is out in the end.
    """
    runs = runs_of(name, seeds)
    return [{"controller": name, "seed": run.seed} | numbers(run, runs.scenario) for run in runs]


def held(run: sh.Run, scenario: sh.Scenario) -> np.ndarray:
    """Return the samples at which the payload is held above the seabed."""
    down, touch = scenario.profile.moves
    t = run.time
    first = (t >= scenario.warm_up + scenario.ramp + SETTLED) & (t < down.start)
    return first | ((t >= down.end + SETTLED) & (t < touch.start))


def numbers(run: sh.Run, scenario: sh.Scenario) -> dict[str, float]:
    """Return the numbers of one run."""
    error = run["payload.displacement"] - run["reference.displacement"]
    if run.controller == "none":  # a closed brake is asked to stay
        error = run["payload.displacement"]
    error = error[held(run, scenario)]
    found = run.statistics
    landed = run.time > found.value("touch-down at")
    until = math.inf if scenario.disengage_at is None else scenario.disengage_at
    engaged = run.time <= until
    return {
        "within": float(np.mean(np.abs(error) <= TOLERANCE)),
        "rms": float(np.sqrt(np.mean(error**2))),
        "largest": float(np.abs(error).max()),
        "minute_before": minute_before(run),
        "touchdown_speed": found.value("touch-down speed"),
        "bounce": _highest(run["contact.gap"][landed & engaged]),
        "lifted": _highest(run["contact.gap"][landed & ~engaged]),
        "touchdowns": found.value("touch-downs"),
        "hardest": found.value("hardest touch-down"),
        "slack_events": found.value("slack events"),
        "snap_load": found.value("snap load"),
        "end_haul": float(run["drum.haul"][-1]),
    }


def minute_before(run: sh.Run) -> float:
    """Return the rms of the payload's error in the minute before touchdown [m]."""
    error = run["payload.displacement"] - run["reference.displacement"]
    at = run.statistics.value("touch-down at")
    near = (run.time < at) & (run.time >= at - 60.0)
    return float(np.sqrt(np.mean(error[near] ** 2))) if near.any() else math.nan


def _highest(gap: np.ndarray) -> float:
    return float(gap.max(initial=0.0)) if gap.size else math.nan


def study(tell: Callable[[str], None] = lambda text: None, most: int = SEEDS) -> list[Row]:
    """Return all rows, of at most so many seeds."""
    rows = []
    for name in (*CONTROLLERS, *LIMITS, *PHASES):
        rows += rows_of(name, min(most, seeds_of(name)))
        tell(f"{name}: {1e3 * mean(rows, name, 'rms').mean:.1f} mm")
    return rows


def load(path: Path = CSV) -> list[Row]:
    """Return the rows that are stored in `docs/data/landing.csv`."""
    return [
        {k: v if k == "controller" else float(v) for k, v in row.items()} for row in read_rows(path)
    ]


def values(rows: Iterable[Row], controller: str, number: str) -> list[float]:
    """Return a number of all runs of a controller."""
    found = [float(row[number]) for row in rows if row["controller"] == controller]
    if not found:
        raise KeyError(f"no row of {controller!r}")
    return found


def mean(rows: Iterable[Row], controller: str, number: str) -> Interval:
    """Return the mean over seeds with its 95 % interval."""
    return mean_interval(values(rows, controller, number))


def write(rows: Sequence[Row], path: Path = CSV) -> None:
    """Write the data file."""
    told = ({k: v if isinstance(v, str) else f"{v:.6g}" for k, v in row.items()} for row in rows)
    write_rows(path, list(rows[0]), told, "SI units; nan is what did not happen.")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, write its data files, then the page."""
    import landing_page

    quick = study_parser(__doc__).parse_args(argv).quick
    data = docs_folder(quick) / "data"
    if not quick:
        found = design_rows(sh.load_case("landing"))
        write_rows(DESIGNS, list(found[0]), found, "SI units; the answer is the last.")
        designs.cache_clear()
    write(study(lambda text: print(text, flush=True), 2 if quick else SEEDS), data / CSV.name)
    landing_page.main(argv)


if __name__ == "__main__":
    import landing  # by name, so that the page's script finds what was made

    landing.main()
