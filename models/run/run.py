"""The result of a simulated run (`Run`): signals by name with units, events, statistics.

The last room in the data's way of `models`: the simulation fills it, `models/run/metrics.py`
compares several over seeds, `models/run/files.py` writes it to files.  The time traces are
decimated to what is worth looking at; the statistics come from every sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, residual_text
from ..casefile import suggestion
from .summary import Statistics

if TYPE_CHECKING:
    from ..case import Case


# Events printed with a run: the first few say what went wrong.
_EVENTS_SHOWN = 6


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened in a run."""

    time: float  #: When [s].
    kind: str  #: One word for programs, such as "slack" or "brake".
    text: str  #: The sentence that a user reads.

    def __str__(self) -> str:
        """Return the time and the sentence."""
        return f"{self.time:.6g} s: {self.text}"


@dataclass(frozen=True, kw_only=True)
class Timings:
    """How fast a run was."""

    wall_seconds: float  #: Time it took [s].
    steps: int  #: Integration steps.
    real_time_factor: float  #: Simulated time over wall time.
    #: Wall time of one step of a controller in Python [s]; NaN for one compiled into the loop.
    controller_median: float = math.nan
    controller_p99: float = math.nan
    controller_max: float = math.nan
    #: How often something had to be replaced (a late controller, a NaN), by its name.
    fallbacks: Mapping[str, int] = field(default_factory=dict)
    #: In how many samples the controller was not as usual, by its status.
    statuses: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the mappings read-only."""
        for name in ("fallbacks", "statuses"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @classmethod
    def of(
        cls,
        *,
        wall_seconds: float,
        steps: int,
        duration: float,
        controller_seconds: npt.ArrayLike = (),
        fallbacks: Mapping[str, int] | None = None,
        statuses: Mapping[str, int] | None = None,
    ) -> Timings:
        """Return the timings of a run of `duration` [s], from the time of each controller step."""
        wall = max(wall_seconds, 1e-9)  # a clock can stand still over a very short run
        seconds = np.asarray(controller_seconds, dtype=np.float64)
        median, p99 = np.quantile(seconds, (0.5, 0.99)) if seconds.size else (math.nan, math.nan)
        return cls(
            wall_seconds=wall_seconds,
            steps=steps,
            real_time_factor=duration / wall,
            controller_median=float(median),
            controller_p99=float(p99),
            controller_max=float(seconds.max()) if seconds.size else math.nan,
            fallbacks=fallbacks or {},
            statuses=statuses or {},
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A simulated run."""

    case: Case  #: What was simulated.
    controller: str  #: Name of the controller.
    scenario: str  #: Name of the scenario.
    seed: int
    sample_time: float  #: The controller's sample time [s].
    step: float  #: The integration step [s].
    duration: float  #: Simulated time asked for [s]; the run ends earlier if it did not complete.
    compiled: bool  #: Whether the loop ran as compiled C.
    signals: tuple[str, ...]  #: Names of the columns of `values`.
    units: Mapping[str, str]
    time: FloatArray  #: Times from zero (n,) [s], taken and not copied, like the values.
    values: FloatArray  #: The signals at those times (n, signals).
    statistics: Statistics  #: Statistics of every sample, not only of those in `values`.
    events: tuple[Event, ...] = ()  #: What happened, in the order of time.
    status: str = "completed"  #: "completed", "diverged", "interrupted" or another single word.
    message: str = ""  #: The sentence to read.
    timings: Timings  #: How fast it was.

    def __post_init__(self) -> None:
        """Make everything read-only."""
        for name in ("time", "values"):
            view = np.asarray(getattr(self, name), dtype=np.float64).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)
        object.__setattr__(self, "signals", tuple(self.signals))
        object.__setattr__(self, "events", tuple(self.events))
        units = {name: self.units.get(name, "") for name in self.signals}
        object.__setattr__(self, "units", MappingProxyType(units))

    @property
    def completed(self) -> bool:
        """Whether the run went to its end."""
        return self.status == "completed"

    def __contains__(self, name: object) -> bool:
        """Return whether there is a signal of that name."""
        return name in self.signals

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal (n,) by its name; an `InputError` names the closest there are."""
        if name not in self.signals:
            raise InputError(f"run: no signal {name!r}; {suggestion(name, self.signals)}")
        column: FloatArray = self.values[:, self.signals.index(name)]
        return column

    def __str__(self) -> str:
        """Return the run as a small tree."""
        told = self.status + (f" ({self.message})" if self.message else "")
        how = "compiled" if self.compiled else "not compiled"
        lines = [
            f"Run of {self.case.name}, {self.controller}, {self.scenario}, seed {self.seed}: "
            f"{told}",
            f"{len(self.signals)} signals, {self.time.size} times to "
            f"{self.time[-1] if self.time.size else 0.0:.6g} of {self.duration:.6g} s",
            f"step {1e3 * self.step:.4g} ms, sample {1e3 * self.sample_time:.4g} ms, {how}, "
            f"{self.timings.real_time_factor:.4g} times real time",
            *_said(self.statistics),
            *(str(event) for event in self.events[:_EVENTS_SHOWN]),
        ]
        if len(self.events) > _EVENTS_SHOWN:
            lines.append(f"and {len(self.events) - _EVENTS_SHOWN} more events")
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


def _said(statistics: Statistics) -> Sequence[str]:
    """One line of what matters most."""
    found = {name: q.value for name, q in statistics.quantities.items()}
    parts = []
    if "payload rms" in found:
        parts.append(f"payload {1e3 * found['payload rms']:.4g} mm rms")
    if "hook rms" in found:
        parts.append(f"hook {1e3 * found['hook rms']:.4g} mm rms")
    if "residual" in found:
        parts.append(residual_text(0.01 * found["residual"]))
    return [", ".join(parts)] if parts else []
