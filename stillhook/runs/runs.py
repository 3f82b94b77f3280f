"""`Runs`: what several seeds of one question say together.

    Series.run(seed) ... --> Runs --> summary, extremes, worst --> table, figures, folder

The runs differ in their seed alone: case, controller and scenario are the same.
`stillhook.runs.simulation` makes them, `stillhook.runs.table` and `stillhook.runs.report` say what
came of them.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import overload

import numpy as np

from models.basics import InputError
from models.case import Case
from models.operation import Scenario
from models.run import ERROR, ExtremeEstimate, Run, Summary, extreme_over_seeds

from ..text import count, duration, number, scale

EXTREMES: Mapping[str, tuple[str, bool]] = {
    "payload up": (ERROR, False),
    "payload down": (ERROR, True),
    "rope tension": ("rope.tension", False),
}
"""Most probable extremes by name: of which signal, and whether its minimum."""

TRIPS = ("overspeed", "stroke", "rope-out", "rope-in", "encoder")
"""Kinds of events in which the brake ends the controller's work (`models.simulation.trips`)."""

MAIN: Mapping[str, str] = {
    "payload rms": "payload",
    "error before touch-down rms": "error before touchdown",
    "tracking error rms": "payload's error",
}
"""What tells controllers apart, by name: of a payload that stays, that lands, that is moved."""

FINER_SNAP = "snap load on more masses"
"""Quantity of the run with the largest snap load: that load on as many masses as there may be."""

_EVENTS_SHOWN = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs(Sequence[Run]):
    """Runs of one case, controller and scenario that differ in their seed alone."""

    runs: tuple[Run, ...]  #: The runs, at least one.
    scenario: Scenario  #: What was asked of them.
    #: Size of the payload's error beyond which lock counted as lost [m]; None: not watched.
    lock_limit: float | None = None

    def __post_init__(self) -> None:
        """Check that there is a run."""
        if not self.runs:
            raise InputError("runs: at least one run is wanted, got none")

    @overload
    def __getitem__(self, index: int) -> Run: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Run, ...]: ...
    def __getitem__(self, index: int | slice) -> Run | tuple[Run, ...]:
        """Return a run by its place, from 0."""
        return self.runs[index]

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.runs)

    @property
    def case(self) -> Case:
        """The case, as it is in the scenario."""
        return self.runs[0].case

    @property
    def controller(self) -> str:
        """Name of the controller."""
        return self.runs[0].controller

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds, in the order of the runs."""
        return tuple(run.seed for run in self.runs)

    @property
    def completed(self) -> bool:
        """Whether every run went to its end."""
        return all(run.completed for run in self.runs)

    @property
    def stays(self) -> bool:
        """Whether the payload is held in one place all the time, and nothing fails."""
        return stays(self.scenario)

    @property
    def judged(self) -> tuple[Run, ...]:
        """The runs that count: all, but those that Ctrl-C cut short if there are others."""
        whole = tuple(run for run in self.runs if run.status != "interrupted")
        return whole or self.runs

    @cached_property
    def summary(self) -> Summary:
        """Means of all quantities and shares of all mishaps, with their 95 % intervals."""
        return Summary.of(self.judged)

    @cached_property
    def extremes(self) -> Mapping[str, ExtremeEstimate]:
        """Most probable extremes in the exposure time of the case, by name.

        ``runs.extremes["payload up"]``; the names are those of `EXTREMES`.  Where there are too few
        data the estimate is NaN and its status says why.  Empty where the payload is moved or
        something fails: then no part of a run is like another.
        """
        sound = [run for run in self.judged if run.status != "diverged"]
        if not self.stays or not sound:
            return {}
        duration = self.case.limits.exposure_time
        return {
            name: extreme_over_seeds(sound, signal, minimum=minimum, duration=duration)
            for name, (signal, minimum) in EXTREMES.items()
        }

    @property
    def tripped(self) -> int:
        """In how many of the judged runs the brake ended the controller's work."""
        return sum(any(event.kind in TRIPS for event in run.events) for run in self.judged)

    @property
    def worst(self) -> Run:
        """The run with the largest error of those that still have their traces, if any has."""
        shown = [run for run in self.runs if run.time.size] or list(self.runs)
        return max(shown, key=_badness)

    def __str__(self) -> str:
        """Return the runs as a small tree."""
        lines = [headline_of(self), *tree(self)]
        for run in self.runs:
            told = [f"seed {run.seed}: at {event}" for event in run.events[:_EVENTS_SHOWN]]
            lines += told if len(self) == 1 or run.status != "completed" else []
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


def headline_of(runs: Runs) -> str:
    """Return what was simulated, and how it ended."""
    what = f"{runs.case.name}, {runs.controller}, {runs.scenario.name}"
    lasting = duration(runs[0].duration)
    return f"{what}: {count(len(runs), 'run')} of {lasting}, {_outcome(runs)}"


def main_quantity(compared: Sequence[Runs]) -> str:
    """Return the name of the quantity that tells controllers apart, a standard deviation [m]."""
    stays, lands, moves = MAIN
    if compared[0].stays:
        return stays
    landed = any(lands in runs.summary.means and runs.summary[lands].count for runs in compared)
    return lands if landed else moves


def tree(runs: Runs) -> list[str]:
    """Return the lines that stand under the headline."""

    def told(name: str) -> str:
        found = runs.summary.means.get(name)
        if found is None or not found.count or math.isnan(found.mean):
            return ""
        factor, unit = scale(found.unit, found.mean)
        text = f"{number(found.mean / factor)} {unit}".strip()
        if math.isnan(found.low) or math.isnan(found.high):
            return text
        return f"{text} ({number(found.low / factor)} to {number(found.high / factor)})"

    main = main_quantity([runs])
    lines = []
    if told(main):
        residual = f", residual {told('residual')} of the hook's motion" if told("residual") else ""
        lines.append(f"{MAIN[main]} {told(main)} rms{residual}")
    for name, label in (("lost lock", "lock lost"), ("slack", "slack rope")):
        share = runs.summary.shares.get(name)
        if share is not None and share.count:
            lines.append(f"{label} in {share.count} of {count(share.total, 'run')}")
    if runs.tripped:
        lines.append(f"ended by the brake: {runs.tripped} of {count(len(runs.judged), 'run')}")
    for name, label in (("touch-down speed", "touchdown speed"), ("snap load", "snap load")):
        if told(name):
            lines.append(f"{label} {told(name)}")
    lines += [event.text for run in runs for event in run.events if event.kind == "snap"]
    if told("motor torque rms"):
        largest = told("motor torque largest")
        lines.append(f"motor torque {told('motor torque rms')} rms, {largest} at most")
    fallbacks = sum(sum(run.timings.fallbacks.values()) for run in runs)
    if fallbacks:
        lines.append(f"{count(fallbacks, 'command')} of the controller could not be used")
    spent: dict[str, float] = {}
    for run in runs:
        for status, samples in run.timings.statuses.items():
            spent[status] = spent.get(status, 0.0) + samples * run.sample_time
    if spent:
        told_of = ", ".join(f"{status} for {duration(time)}" for status, time in spent.items())
        lines.append(f"the controller was {told_of}")
    return [*lines, speed_of(runs)]


def speed_of(runs: Runs) -> str:
    """Return how fast the runs were."""
    wall = sum(run.timings.wall_seconds for run in runs)
    simulated = sum(run.statistics.end for run in runs if math.isfinite(run.statistics.end))
    how = "compiled" if runs[0].compiled else "not compiled"
    return f"{how}, {number(simulated / max(wall, 1e-9), 2)} times real time"


def _outcome(runs: Runs) -> str:
    """Return how many runs completed, diverged or were interrupted."""
    if runs.completed:
        return "all completed" if len(runs) > 1 else "completed"
    found = Counter(run.status for run in runs)
    return ", ".join(f"{n} {status}" for status, n in found.items())


def stays(scenario: Scenario) -> bool:
    """Return whether the payload is held in one place from start to end, and nothing fails."""
    return not (
        scenario.profile.moves
        or scenario.surroundings is not None
        or scenario.disengage_at is not None
        or scenario.enabled is not None
        or scenario.parameter_changes
        or scenario.brake_trips
        or scenario.worst_trip is not None
        or scenario.telemetry_outages
        or scenario.sensor_failures
        or scenario.stuck_readings
        or scenario.mru_outages
        or scenario.telemetry_delays
        or scenario.mru_biases
    )


def keep_worst(runs: Sequence[Run]) -> list[Run]:
    """Return the runs, the worst of them alone with its time traces: those are what is large."""
    worst = max(range(len(runs)), key=lambda i: _badness(runs[i]), default=0)
    return [run if i == worst else _without_traces(run) for i, run in enumerate(runs)]


def _badness(run: Run) -> float:
    """Return the largest error [m]; one that diverged is worse than any other."""
    found = run.statistics.quantities.get("tracking error largest")
    value = math.nan if found is None else found.value
    return math.inf if run.status == "diverged" else (-1.0 if math.isnan(value) else value)


def _without_traces(run: Run) -> Run:
    if not run.time.size:
        return run
    return replace(run, time=np.zeros(0), values=np.zeros((0, len(run.signals))))
