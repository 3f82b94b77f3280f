"""What the load and the rope do once something fails, in numbers: of a run, of several seeds.

    Run, moment --> Seen ... --> FirstSeconds, Afterwards --> severity

Two windows are looked at: the first 5 s, and from then to a minute after the end of the failure.
The same windows of the undisturbed load and of the load with the drum held say how bad that is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import BoolArray, FloatArray
from models.run import Event, Run

from .runs import TRIPS
from .window import error_of

FIRST = 5.0  #: Length of the first window [s].
AFTER = 60.0  #: Time after the end of a failure that still counts as its consequence [s].
SAME = 1.2  #: Up to so many times as much as undisturbed is no effect.
SLACK = 1.0  #: Tension at or below which a rope is slack [N].
SEVERITIES = ("none", "minor", "major", "critical")
"""Classes of severity, see `FailureMode.severity`."""

MISHAPS = {
    "slack": "the rope slack",
    "overloaded": "the rope beyond its limit",
    "lost_lock": "lock lost",
    "tripped": "stopped by the brake",
    "diverged": "diverged",
}
"""What is critical if it happens in more seeds than undisturbed, by the name of its count."""


@dataclass(frozen=True, kw_only=True)
class FirstSeconds:
    """The first 5 s after a failure, the worst of the seeds."""

    largest: float  #: Largest distance of the load from its place [m].
    speed: float  #: Largest speed of the load [m/s].
    #: Largest and least tension of what the load hangs on, at its end of the rope [N].
    load_tension_largest: float
    load_tension_least: float
    drum_tension_largest: float  #: Largest and least tension of the rope at the drum [N].
    drum_tension_least: float
    slack: int  #: In how many seeds the rope went slack somewhere.


@dataclass(frozen=True, kw_only=True)
class Afterwards:
    """From the fifth second after a failure to a minute after its end; the worst of the seeds."""

    rms: float  #: Rms distance of the load from its place, over all seeds [m].
    largest: float  #: The largest [m].
    load_tension_largest: float  #: Largest tension at the load's end of the rope [N].
    drum_tension_largest: float  #: Largest tension at the drum [N].
    # In how many seeds, from the failure on:
    slack: int  #: The rope went slack.
    overloaded: int  #: The tension at the drum was above the case's limit, if it has one.
    #: Lock was lost: with the controller fully engaged the load was beyond the lock limit of
    #: `stillhook.simulate`, and farther from its place than the drum held leaves it at any time.
    lost_lock: int
    tripped: int  #: The brake ended the controller's work: overspeed, stroke, rope out or in.
    diverged: int  #: The run diverged.


@dataclass(frozen=True, kw_only=True)
class Reference:
    """What a load does of which nothing fails, in the same seas."""

    rms: float  #: Mean over the seeds of the rms distance from its place, of whole runs [m].
    largest: float  #: The largest of whole runs [m].
    #: The same windows as those of the failures.
    first: FirstSeconds
    after: Afterwards


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What is kept of one run."""

    rms: float  #: Of the whole run, from settling on [m].
    largest: float  #: Likewise [m].
    #: Largest distance from its place after the moment, the controller fully engaged [m].
    farthest: float
    first: FirstSeconds
    after: Afterwards  #: Lock is judged later, when the motion with the drum held is known.

    @classmethod
    def of(cls, run: Run, moment: float, lasting: float) -> Seen:
        """Look at a run from a moment on [s]; of what a diverged run does not have, NaN."""
        begins, ends = moment + FIRST, moment + lasting + AFTER
        first = (run.time > moment) & (run.time <= begins)
        after = (run.time > begins) & (run.time <= ends)
        # A load on its brake, or that has just been let go, swings as it likes.
        engaged = (run.time > moment) & (run["engaged"] >= 1.0)
        error, limit = error_of(run), run.case.limits.rope_tension_peak
        load, drum = run["rope.lower_tension"], run["rope.tension"]
        slack, most = run["rope.minimum_tension"] <= SLACK, math.inf if limit is None else limit
        with np.errstate(over="ignore", invalid="ignore"):  # a run that diverges
            rms = math.sqrt(np.mean(error[after] ** 2)) if after.any() else math.nan
        return cls(
            rms=run.statistics.value("tracking error rms"),
            largest=run.statistics.value("tracking error largest"),
            farthest=_most(np.abs(error), engaged),
            first=FirstSeconds(
                largest=_most(np.abs(error), first),
                speed=_most(np.abs(run["payload.velocity"]), first),
                load_tension_largest=_most(load, first),
                load_tension_least=-_most(-load, first),
                drum_tension_largest=_most(drum, first),
                drum_tension_least=-_most(-drum, first),
                slack=int(slack[first].any()),
            ),
            after=Afterwards(
                rms=rms,
                largest=_most(np.abs(error), after),
                load_tension_largest=_most(load, after),
                drum_tension_largest=_most(drum, after),
                slack=int(slack[first | after].any()),
                overloaded=int(drum[first | after].max(initial=0.0) > most),
                lost_lock=0,
                tripped=int(bool(trips_of(run, moment))),
                diverged=int(run.status == "diverged"),
            ),
        )


def _most(values: FloatArray, among: BoolArray) -> float:
    return float(values[among].max()) if among.any() else math.nan


def _worst(values: Iterable[float]) -> float:
    """Return the largest; what a diverged run does not have is left to the others."""
    found = [value for value in values if not math.isnan(value)]
    return max(found, default=math.nan)


def first_of(seen: Sequence[FirstSeconds]) -> FirstSeconds:
    """Return the worst of the first seconds of several seeds."""
    return FirstSeconds(
        largest=_worst(each.largest for each in seen),
        speed=_worst(each.speed for each in seen),
        load_tension_largest=_worst(each.load_tension_largest for each in seen),
        load_tension_least=-_worst(-each.load_tension_least for each in seen),
        drum_tension_largest=_worst(each.drum_tension_largest for each in seen),
        drum_tension_least=-_worst(-each.drum_tension_least for each in seen),
        slack=sum(each.slack for each in seen),
    )


def after_of(runs: Sequence[Seen], lost_beyond: float) -> Afterwards:
    """Return what came after in several seeds; beyond a distance [m] lock is lost."""
    seen = [run.after for run in runs]
    squares = [each.rms**2 for each in seen if not math.isnan(each.rms)]
    return Afterwards(
        rms=math.sqrt(sum(squares) / len(squares)) if squares else math.nan,
        largest=_worst(each.largest for each in seen),
        load_tension_largest=_worst(each.load_tension_largest for each in seen),
        drum_tension_largest=_worst(each.drum_tension_largest for each in seen),
        slack=sum(each.slack for each in seen),
        overloaded=sum(each.overloaded for each in seen),
        lost_lock=sum(run.farthest > lost_beyond for run in runs),
        tripped=sum(each.tripped for each in seen),
        diverged=sum(each.diverged for each in seen),
    )


def severity_of(
    first: FirstSeconds, after: Afterwards, undisturbed: Reference, held: Reference
) -> str:
    """Return the class of a failure, one of `SEVERITIES` (`FailureMode.severity` has the rule)."""
    usual = undisturbed.after
    for name in MISHAPS:
        if getattr(after, name) > getattr(usual, name):
            return "critical"
    sizes = first.largest, after.largest, after.rms
    calm = undisturbed.first.largest, usual.largest, usual.rms
    on_brake = held.first.largest, held.after.largest, held.after.rms
    if all(size <= SAME * like for size, like in zip(sizes, calm, strict=True)):
        return "none"
    bounds = (max(SAME * like, brake) for like, brake in zip(calm, on_brake, strict=True))
    within = all(size <= bound for size, bound in zip(sizes, bounds, strict=True))
    return "minor" if within else "major"


def trips_of(run: Run, moment: float) -> list[Event]:
    """Return trips of the brake after a moment [s]; that of a lost encoder is what is asked for."""
    return [
        event
        for event in run.events
        if event.kind in TRIPS and event.kind != "encoder" and event.time >= moment
    ]
