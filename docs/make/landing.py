"""Landing a module within 4 cm: what each controller does on the bundled case `landing`.

The scenario of the same name holds the module 7.5 m above the seabed, lowers it to 5 m, holds it
there and sets it down with half a metre of rope to spare.

    python docs/make/landing.py

writes `docs/landing.md`, `docs/data/landing.csv` with a row for each run, and
`docs/images/landing.svg`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from stored import docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models.basics import Interval, mean_interval
from models.sensing import Controller
from synth.controllers.feed_forward import lead_of

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "data" / "landing.csv"
PAGE = ROOT / "docs" / "landing.md"
FIGURE = ROOT / "docs" / "images" / "landing.svg"

TOLERANCE = 0.04  # University of Agder, MAS409 [m]
SEEDS = 20
SETTLED = 10.0  # after the set-point has come to rest, before the payload counts as held [s]
SCENARIO_PAYS_OUT = 8.0  # to the seabed and half a metre more [m]
BOUNCE = 10.0  # after touchdown, in which a bounce counts [s]
#: The law of the rope's damping that the page was made with.
LAW: Mapping[str, object] = {"rope.damping_law": "kelvin-voigt"}
# What `optimise_gains` finds for the case with payload feedback; a slow test asks it again.
GAINS = {"A": 1.0, "a": 98.31, "a1": 156.6, "a2": 1993.0}

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
PERFECT_PAYLOAD: Mapping[str, object] = {
    "sensors.payload.bandwidth": "perfect",
    "sensors.payload.acceleration_noise": 0.0,
    "sensors.payload.velocity_noise": 0.0,
    "sensors.payload.displacement_noise": 0.0,
    "sensors.telemetry.delay": 0.0,
}

Row = dict[str, str | float]
Maker = Callable[[sh.Case], Controller]


def _share(share: float, *, lead: bool = False) -> Maker:
    return lambda case: sh.VelocityFeedForward(
        case, share=share, lead=lead_of(case) if lead else 0.0
    )


def _feedback(case: sh.Case) -> Controller:
    return sh.LinearFeedback(case, GAINS)


# The controllers, and what is asked of each to see what limits it: changes of the case, and who.
CONTROLLERS: Mapping[str, tuple[Mapping[str, object], Maker]] = {
    "feedback": ({}, _feedback),
    "feed-forward": ({}, _share(0.9)),
    "feed-forward-lead": ({}, _share(0.9, lead=True)),
    "constant-tension": ({}, sh.ConstantTension),
    "lowered without compensation": ({}, _share(0.0)),
    "none": ({}, sh.BrakeOn),
}
LIMITS: Mapping[str, tuple[Mapping[str, object], Maker]] = {
    "feedback, perfect sensors": (PERFECT_PAYLOAD, _feedback),
    "feed-forward of 0.9, perfect MRU": (PERFECT_MRU, _share(0.9)),
    "feed-forward of 1": ({}, _share(1.0)),
    "feed-forward of 1, perfect MRU": (PERFECT_MRU, _share(1.0)),
    "feed-forward of 1 with lead, perfect MRU": (PERFECT_MRU, _share(1.0, lead=True)),
    "feed-forward of 1, MRU of 1 cm": (GOOD_MRU, _share(1.0)),
}


def runs_of(name: str, seeds: int | Sequence[int]) -> sh.Runs:
    """Return the runs of a row's controller, with their traces."""
    changes, maker = {**CONTROLLERS, **LIMITS}[name]
    case = sh.load_case("landing").replace({**LAW, **changes})
    return sh.simulate(case, maker(case), scenario="landing", seeds=seeds)


def rows_of(name: str, seeds: int | Sequence[int]) -> list[Row]:
    """Return a row for each seed, in SI units; NaN is what did not happen.

    ``within`` is the share of the time in which the payload is held that it is within the
    tolerance, ``rms`` and ``largest`` are of its error then, ``bounce`` how high it leaves the
    seabed within 10 s of touching it, ``snap_load`` the largest tension after slack.
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
    touch = found.value("touch-down at")
    after = (run.time > touch) & (run.time <= touch + BOUNCE)
    gap = run["contact.gap"][after]
    return {
        "within": float(np.mean(np.abs(error) <= TOLERANCE)),
        "rms": float(np.sqrt(np.mean(error**2))),
        "largest": float(np.abs(error).max()),
        "touchdown_speed": found.value("touch-down speed"),
        "bounce": float(gap.max(initial=0.0)) if gap.size else math.nan,
        "slack_events": found.value("slack events"),
        "snap_load": found.value("snap load"),
        "least_haul": float(run["drum.haul"].min()),
    }


def study(tell: Callable[[str], None] = lambda text: None, seeds: int = SEEDS) -> list[Row]:
    """Return all rows."""
    rows = []
    for name in (*CONTROLLERS, *LIMITS):
        rows += rows_of(name, seeds)
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


def _table(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in body)])


def _text(found: Interval, scale: float, digits: int = 0) -> str:
    if not found.count:
        return "-"
    mean, low, high = (f"{scale * v:.{digits}f}" for v in (found.mean, found.low, found.high))
    return f"{mean} ({low} to {high})"


def _inside(rows: Sequence[Row], name: str) -> str:
    largest = values(rows, name, "largest")
    return f"{sum(v <= TOLERANCE for v in largest)} of {len(largest)}"


def held_table(rows: Sequence[Row], names: Iterable[str]) -> str:
    """Return how still the payload is held, as Markdown."""
    head = ["controller", "time within 4 cm [%]", "rms [mm]", "largest [mm]", "never beyond 4 cm"]
    return _table(
        head,
        (
            [
                name,
                _text(mean(rows, name, "within"), 100.0),
                _text(mean(rows, name, "rms"), 1e3, 1),
                _text(mean(rows, name, "largest"), 1e3),
                _inside(rows, name),
            ]
            for name in names
        ),
    )


def landed_table(rows: Sequence[Row]) -> str:
    """Return how the payload lands, as Markdown."""
    head = ["controller", "touchdown speed [mm/s]", "fastest [mm/s]", "off again [mm]"]
    head += ["slack events", "runs with a snap", "largest snap load [kN]"]
    body = []
    for name in CONTROLLERS:
        snaps = [v for v in values(rows, name, "snap_load") if not math.isnan(v)]
        speeds = [v for v in values(rows, name, "touchdown_speed") if not math.isnan(v)]
        if not speeds:
            continue
        body.append(
            [
                name,
                _text(mean(rows, name, "touchdown_speed"), 1e3),
                f"{1e3 * max(speeds):.0f}",
                _text(mean(rows, name, "bounce"), 1e3),
                f"{mean(rows, name, 'slack_events').mean:.1f}",
                f"{len(snaps)} of {SEEDS}",
                f"{max(snaps) / 1e3:.0f}" if snaps else "-",
            ]
        )
    return _table(head, body)


def page(rows: Sequence[Row]) -> str:
    """Return the page of the documentation."""

    def mm(name: str, number: str = "rms") -> str:
        return f"{1e3 * mean(rows, name, number).mean:.0f} mm"

    paid_out = -mean(rows, "feedback", "least_haul").mean - SCENARIO_PAYS_OUT
    leads = _inside(rows, "feed-forward of 1 with lead, perfect MRU")
    met = [name for name in CONTROLLERS if max(values(rows, name, "largest")) <= TOLERANCE]
    verdict = (
        "**None of them keeps within 4 cm** while it holds the module."
        if not met
        else f"Within 4 cm all the time: {', '.join(met)}."
    )
    return f"""# Landing a module within 4 cm

Written by `docs/make/landing.py`; `docs/data/landing.csv` has a row for each run.

The bundled case `landing` sets a module of 12 t down on the seabed at 350 m, in $H_s$ = 1.7 m and
waves of 10 s; its positioning is wanted within 4 cm. The job is that of a crane assignment of the
University of Agder (MAS409); vessel, rope and winch are ours, and so is what is measured:
the payload's motion up to 20 Hz, 20 ms late and with noise; the hook's by a motion reference
unit (MRU) of 5 cm. The scenario holds the module 7.5 m above the seabed for a minute,
lowers it to 5 m, holds it for another minute and sets it down. The rope's damping is Kelvin and
Voigt's here (`rope.damping_law`).

```python
import stillhook as sh

case = sh.load_case("landing")
runs = sh.simulate(case, "feed-forward", scenario="landing", seeds=2)
print(runs)
```

Below are all controllers, {SEEDS} seeds each, the feedback with the gains that
`sh.optimise_gains(case, "payload-feedback")` finds: means over the seeds, with their 95 %
intervals. *Lowered without compensation* is a feed-forward with a share of zero.

## Holding it above the seabed

Counted while the set-point rests, from {SETTLED:.0f} s on: some hundred seconds of each run.
The closed brake (`none`) is asked to stay at 7.5 m.

{held_table(rows, CONTROLLERS)}

![How far the module is from where it should be](images/landing.svg)

{verdict}
The feedback comes closest. What stands in the way:

{held_table(rows, LIMITS)}

* *Feedback* is limited by its own loop. In its design the sensitivity peak and the lower gain
  margin bind ($M_s$ = 2, half the gain), because of the rope's axial modes. Better sensors do not
  help: with perfect ones the module moves as much, and the margin is gone. Without the 20 ms
  $M_s$ would be 5.1: the delay keeps those modes out of the loop.
* *Feed-forward* is limited by what it is told.
  A share of 0.9 leaves a tenth of the hook's motion:
  {mm("feed-forward of 0.9, perfect MRU")} with a perfect MRU.
  An MRU of 5 cm passes its error on to the module: {mm("feed-forward of 1")} at a share of 1,
  against {mm("feed-forward of 1, perfect MRU")} with a perfect one.
  With the lead that makes up for the drum's lag too,
  {mm("feed-forward of 1 with lead, perfect MRU")}, that keeps within 4 cm in {leads} runs.
  A very good MRU of 1 cm is not enough.
  `feed-forward-lead` gains nothing here, as the MRU's heave filter, of 200 s, is ahead already.
* *Constant tension* does nothing for a module that is to stay in its place.

Both together, the hook's motion fed forward and the payload's fed back, are what this job asks
for.

## Setting it down

{landed_table(rows)}

The set-point goes down at 160 mm/s. *Off again* is how far the module leaves the seabed within
{BOUNCE:.0f} s of touching it: it bounces a little, or the next wave lifts it. Slack comes with the
half metre of rope that is paid out on top; a second slack event is the hook taking the rope up
again, and the snap load is what follows.

Payload feedback has to be switched off at touchdown. It does not know of the seabed and goes on
lowering a module that cannot go lower: it pays out {paid_out:.0f} m of rope more than it is asked
to before it is disengaged, ten seconds later.
"""


def figure(kind: str = "svg", seed: int = 0) -> bytes:
    """Return the figure of the page as a file of a kind, `svg` or `png`."""
    from stillhook.text import AFTER, BEFORE, DRUM, REFERENCE, new_figure, picture, styled

    shown = {"feedback": AFTER, "feed-forward": DRUM, "lowered without compensation": BEFORE}
    with styled():
        drawn = new_figure(9.0, 3.8)
        holding, landing = drawn.subplots(1, 2)
        for name, colour in reversed(shown.items()):
            (run,) = runs_of(name, [seed])
            error = 1e3 * (run["payload.displacement"] - run["reference.displacement"])
            kept = (run.time >= 75.0) & (run.time <= 133.0)
            if colour != BEFORE:  # that is ten times as much
                holding.plot(run.time[kept][::5], error[kept][::5], color=colour, lw=1.3)
            near = (run.time >= 150.0) & (run.time <= 176.0)
            landing.plot(run.time[near], run["contact.gap"][near], color=colour, lw=1.3, label=name)
        for edge in (-1e3 * TOLERANCE, 1e3 * TOLERANCE):
            holding.axhline(edge, color=REFERENCE, lw=0.8, ls="--")
        holding.set(xlabel="time [s]", ylabel="error [mm]", title="Held 5 m above the seabed")
        holding.annotate(
            "4 cm", (75.0, 1e3 * TOLERANCE), (0.0, 3.0), textcoords="offset points", fontsize=9.0
        )
        landing.axhline(0.0, color=REFERENCE, lw=0.8)
        landing.set(xlabel="time [s]", ylabel="above the seabed [m]", title="Set down")
        drawn.legend(loc="outside lower center", ncols=len(shown))
    return picture(drawn, kind)


def write(rows: Sequence[Row], path: Path = CSV) -> None:
    """Write the data file."""
    told = ({k: v if isinstance(v, str) else f"{v:.6g}" for k, v in row.items()} for row in rows)
    write_rows(path, list(rows[0]), told, "SI units; nan is what did not happen.")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study; write the data file, the figure and the page."""
    quick = study_parser(__doc__).parse_args(argv).quick
    docs = docs_folder(quick)
    path = docs / "data" / CSV.name
    write(study(lambda text: print(text, flush=True), 2 if quick else SEEDS), path)
    (docs / "images" / FIGURE.name).write_bytes(figure())
    # From what was stored, so that page and data cannot differ in a rounded digit.
    (docs / PAGE.name).write_text(page(load(path)), encoding="utf-8")


if __name__ == "__main__":
    main()
