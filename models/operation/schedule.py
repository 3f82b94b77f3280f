"""A scenario as rows over time: set-points, brake and engagement, one row for each control sample.

Every number depends on its own time alone, so it does not matter in which pieces a long run is
cut.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..basics import FloatArray
from .scenario import Scenario

# A sample that falls on the start or the end of something by intention should not miss it by the
# rounding of `index * sample_time`.
_ROUNDING = 1e-9  # of a sample


@dataclass(frozen=True, kw_only=True, eq=False)
class ScheduleBlock:
    """Rows of a schedule."""

    time: FloatArray  #: Times from the start of the run (n,) [s].
    #: Displacement, velocity and acceleration asked of the payload (n, 3) [m, m/s, m/s2].
    reference: FloatArray
    #: 1 where the controller is enabled, where it is reset, where encoder and where load cell give
    #: numbers (n, 4).
    switches: FloatArray
    #: Share of the controller's command that reaches the drive, beyond the static hold (n,) [-].
    engage: FloatArray
    brake: FloatArray  #: 1 while the brake is on (n,).


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """A scenario at a sample time [s].

    A planned disengagement ramps the command out and then sets the brake; a brake trip does both
    at once, and when it ends the controller is ramped in again.
    """

    scenario: Scenario
    sample_time: float

    def block(self, start: int, count: int) -> ScheduleBlock:
        """Return rows `start` to `start + count`, the same whatever was asked before."""
        scenario = self.scenario
        time = self.sample_time * np.arange(start, start + count, dtype=np.float64)
        clock = time + _ROUNDING * self.sample_time
        last = math.inf if scenario.disengage_at is None else scenario.disengage_at
        # When the controller was engaged last, and whether the brake has been tripped.
        since = np.full(count, scenario.warm_up)
        tripped = np.zeros(count, dtype=np.bool_)
        for begin, end in scenario.brake_trips:
            tripped |= (clock >= begin) & (clock < end)
            since = np.where(clock >= end, np.maximum(since, end), since)
        braked = tripped | (clock < since) | (clock >= last + scenario.ramp) | (since > last)
        leaving = _ramp(clock - last, scenario.ramp) if math.isfinite(last) else np.zeros(count)
        engage = np.minimum(_ramp(clock - since, scenario.ramp), 1.0 - leaving)
        return ScheduleBlock(
            time=time,
            reference=scenario.profile.at(time),
            switches=self._switches(clock),
            engage=np.where(braked, 0.0, engage),
            brake=braked.astype(np.float64),
        )

    def _switches(self, clock: FloatArray) -> FloatArray:
        """Return enable, reset, encoder and load cell (n, 4); a reset lasts for a sample."""
        enabled, T = self.scenario.enabled, self.sample_time
        enable, reset = np.full(len(clock), enabled is None), np.zeros(len(clock), dtype=np.bool_)
        for begin, end in enabled or ():
            enable |= (clock >= begin) & (clock < end)
        for at in self.scenario.resets:
            reset |= (clock >= at) & (clock < at + T)
        there = [np.ones(len(clock), dtype=np.bool_) for _ in range(2)]
        outages = self.scenario.encoder_outages, self.scenario.load_cell_outages
        for valid, periods in zip(there, outages, strict=True):
            for begin, end in periods:
                valid &= (clock < begin) | (clock >= end)
        return np.column_stack((enable, reset, *there)).astype(np.float64)

    @property
    def breaks(self) -> tuple[int, ...]:
        """Rows before which parameters change: a chunk of the run must end there."""
        return tuple(sorted({self._row(time) for time in self.scenario.parameter_changes}))

    def parameters_at(self, row: int) -> dict[str, float]:
        """Return the parameters that are not at their own values in a row, by name."""
        result: dict[str, float] = {}
        for time, changes in sorted(self.scenario.parameter_changes.items()):
            if self._row(time) > row:
                break
            for name, value in changes.items():
                if value is None:
                    result.pop(name, None)
                else:
                    result[name] = value
        return result

    def _row(self, time: float) -> int:
        return max(0, math.ceil(time / self.sample_time - _ROUNDING))


def _ramp(clock: FloatArray, duration: float) -> FloatArray:
    """Return (1 - cos)/2 from 0 at the start to 1 at `duration` [s]; a step if that is 0."""
    if duration <= 0.0:
        return (clock >= 0.0).astype(np.float64)
    result: FloatArray = 0.5 * (1.0 - np.cos(np.pi * np.clip(clock / duration, 0.0, 1.0)))
    return result
