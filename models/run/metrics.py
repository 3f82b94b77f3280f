"""Several runs of one question with different seeds: means, shares and rates with their intervals.

One run is one sample.  `Summary.of` takes runs (or their statistics) that differ in the seed alone
and says of every quantity how well its mean is known, of every mishap how often it happens, and
how long it takes until lock is lost.  The intervals are those of `models/basics/intervals.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ..basics import (
    FallTime,
    InputError,
    Interval,
    Share,
    attenuation,
    fall_time,
    mean_interval,
    share,
)
from ..casefile import suggestion
from .run import Run
from .summary import Statistics


@dataclass(frozen=True, kw_only=True, eq=False)
class Summary:
    """What several seeds say together."""

    count: int  #: Number of runs.
    confidence: float  #: Of every interval, such as 0.95.
    #: Mean and interval by the name of each row of :meth:`Statistics.table`.
    means: Mapping[str, Interval]
    #: How often "lost lock", "slack", "touched", and "not completed" where runs were given.
    shares: Mapping[str, Share]
    fall_time: FallTime | None  #: Time until lock is lost; None where nobody watched.

    def __post_init__(self) -> None:
        """Make the mappings read-only."""
        for name in ("means", "shares"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @classmethod
    def of(
        cls,
        runs: Sequence[Run | Statistics],
        *,
        held: Sequence[Run | Statistics] | None = None,
        confidence: float = 0.95,
    ) -> Summary:
        """Return the summary of runs, or of their statistics, that differ in their seed alone.

        `held` are the same seeds with the drum held, in the same order: adds the residual against
        them.

        Raises InputError if there is no run, or those with the drum held are not as many.
        """
        if not runs:
            raise InputError("summary of runs: at least one run is wanted, got none")
        found = [_statistics(run) for run in runs]
        columns: dict[str, list[float]] = {}
        units: dict[str, str] = {}
        for statistics in found:
            for name, value, unit in statistics.table():
                columns.setdefault(name, []).append(value)
                units[name] = unit
        if held is not None:
            if len(held) != len(found):
                raise InputError(
                    f"summary of runs: there must be as many with the drum held as runs, "
                    f"{len(found)}, got {len(held)}"
                )
            ratios = [
                after.value("payload rms") / _statistics(before).value("payload rms")
                for after, before in zip(found, held, strict=True)
            ]
            columns["residual held"] = [100.0 * ratio for ratio in ratios]
            columns["attenuation held"] = [attenuation(ratio) for ratio in ratios]
            units |= {"residual held": "%", "attenuation held": "dB"}
        happened = {
            "lost lock": _happened(found, "lost lock at"),
            "slack": _happened(found, "first slack at"),
            "touched": _happened(found, "touch-down at"),
            "not completed": [not run.completed for run in runs if isinstance(run, Run)],
        }
        watched = [s for s in found if "lost lock at" in s.quantities]
        return cls(
            count=len(found),
            confidence=confidence,
            means={
                name: mean_interval(values, unit=units[name], confidence=confidence)
                for name, values in columns.items()
            },
            shares={
                name: share(sum(yes), len(yes), confidence=confidence)
                for name, yes in happened.items()
                if yes
            },
            fall_time=_fall_time(watched, confidence) if watched else None,
        )

    def __getitem__(self, name: str) -> Interval:
        """Return mean and interval of a quantity; an `InputError` names the closest there are."""
        if name not in self.means:
            near = suggestion(name, list(self.means))
            raise InputError(f"summary of runs: no quantity {name!r}; {near}")
        return self.means[name]

    def table(self) -> tuple[tuple[str, float, float, float, str], ...]:
        """Return rows of quantity, mean, low and high end of the interval, and unit."""
        rows = [(name, m.mean, m.low, m.high, m.unit) for name, m in self.means.items() if m.count]
        for name, s in self.shares.items():
            rows.append((f"share of runs: {name}", 1e2 * s.value, 1e2 * s.low, 1e2 * s.high, "%"))
        if self.fall_time is not None:
            rows.append(("mean time to loss of lock", *self.fall_time.mean, "s"))
        return tuple(rows)


def _statistics(run: Run | Statistics) -> Statistics:
    return run if isinstance(run, Statistics) else run.statistics


def _happened(found: Sequence[Statistics], name: str) -> list[bool]:
    return [not math.isnan(s.value(name)) for s in found if name in s.quantities]


def _fall_time(found: Sequence[Statistics], confidence: float) -> FallTime:
    """Lock is watched from the first sample counted on."""
    times, fell = [], []
    for s in found:
        at = s.value("lost lock at")
        fell.append(not math.isnan(at))
        times.append(at - (s.end + s.sample_time - s.duration) if fell[-1] else s.duration)
    return fall_time(np.maximum(times, 0.0), fell, confidence=confidence)
