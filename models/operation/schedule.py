"""When things happen in a run: set-points, brake, engagement and faults as arrays over time.

A scenario (`models.operation.scenario`) says what is asked; here its moves and periods become the
rows of numbers that the simulation reads, one row for each control sample.  Every number depends on
its own time alone, so it does not matter in which pieces a long run is cut.

Set-points are moves with limited speed and acceleration.  Each starts at its own time, from rest to
rest; moves that overlap add up.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_range

if TYPE_CHECKING:
    from .scenario import Scenario


Period = tuple[float, float]
"""Start (included) and end (not included) of a period of time [s]."""

# A sample that falls on the start or the end of something by intention should not miss it by the
# rounding of `index * sample_time`.
_ROUNDING = 1e-9  # of a sample


@dataclass(frozen=True, kw_only=True)
class Move:
    """A move from rest to rest with a trapezoidal speed profile.

    Attributes
    ----------
    start
        When it begins [s].
    distance
        How far, up positive [m].
    speed
        Highest speed [m/s]; a short move does not reach it.
    acceleration
        Acceleration at the start, deceleration at the end [m/s2].
    """

    start: float
    distance: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        check_range("move", "start", self.start, low=0.0, unit="s")
        check_range("move", "distance", self.distance, unit="m")
        check_range("move", "speed", self.speed, low=0.0, unit="m/s", open_low=True)
        check_range("move", "acceleration", self.acceleration, low=0.0, unit="m/s2", open_low=True)

    @property
    def _phases(self) -> tuple[float, float]:
        """Duration of the acceleration and of the constant speed [s]."""
        length = abs(self.distance)
        rise = min(self.speed / self.acceleration, math.sqrt(length / self.acceleration))
        top = self.acceleration * rise
        return rise, (max(0.0, length / top - rise) if top > 0.0 else 0.0)

    @property
    def end(self) -> float:
        """When it has come to rest [s]."""
        rise, steady = self._phases
        return self.start + 2.0 * rise + steady

    def at(self, time: npt.ArrayLike) -> FloatArray:
        """Return displacement [m], velocity [m/s] and acceleration [m/s2] at times (n,), (n, 3)."""
        rise, steady = self._phases
        times = np.asarray(time, dtype=np.float64)
        clock = times - self.start
        sign, a = math.copysign(1.0, self.distance), self.acceleration
        # Time spent so far in each of the three phases.
        first = np.clip(clock, 0.0, rise)
        second = np.clip(clock - rise, 0.0, steady)
        third = np.clip(clock - rise - steady, 0.0, rise)
        top = a * rise
        displacement = 0.5 * a * first**2 + top * second + top * third - 0.5 * a * third**2
        velocity = a * (first - third)
        rising = (clock >= 0.0) & (clock < rise)
        falling = (clock >= rise + steady) & (clock < 2.0 * rise + steady)
        acceleration = a * (rising.astype(np.float64) - falling)
        # At the end all of the distance has been covered, whatever the rounding on the way.
        done = times >= self.end
        displacement = np.where(done, abs(self.distance), displacement)
        velocity = np.where(done, 0.0, velocity)
        return sign * np.stack([displacement, velocity, acceleration], axis=-1)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """What the operator asks of the payload: the sum of some moves; none of them is to hold."""

    moves: tuple[Move, ...] = ()

    @property
    def end(self) -> float:
        """When the last move has come to rest [s]."""
        return max((move.end for move in self.moves), default=0.0)

    def at(self, time: npt.ArrayLike) -> FloatArray:
        """Return displacement [m], velocity [m/s] and acceleration [m/s2] at times (n,), (n, 3)."""
        times = np.asarray(time, dtype=np.float64)
        result = np.zeros((*times.shape, 3))
        for move in self.moves:
            result += move.at(times)
        return result


@dataclass(frozen=True, kw_only=True, eq=False)
class ScheduleBlock:
    """Rows of a schedule.

    Attributes
    ----------
    time
        Times from the start of the run (n,) [s].
    reference
        Displacement, velocity and acceleration asked of the payload (n, 3) [m, m/s, m/s2].
    engage
        Share of the controller's command that reaches the drive, beyond the static hold (n,) [-].
    brake
        1 while the brake is on (n,).
    """

    time: FloatArray
    reference: FloatArray
    engage: FloatArray
    brake: FloatArray


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """A scenario at a sample time.

    A planned disengagement ramps the command out and then sets the brake; a brake trip does both
    at once, and when it ends the controller is ramped in again.

    Attributes
    ----------
    scenario
        What is asked.
    sample_time
        Time from row to row [s].
    """

    scenario: Scenario
    sample_time: float

    def __post_init__(self) -> None:
        check_range("schedule", "sample_time", self.sample_time, low=0.0, unit="s", open_low=True)

    def block(self, start: int, count: int) -> ScheduleBlock:
        """Return rows `start` to `start + count`, the same whatever was asked before."""
        scenario = self.scenario
        time = self.sample_time * np.arange(start, start + count, dtype=np.float64)
        clock = time + _ROUNDING * self.sample_time
        last = math.inf if scenario.disengage_at is None else scenario.disengage_at
        # When the controller was engaged last, and whether the brake has been tripped.
        since = np.full(count, scenario.warm_up)
        tripped = _outside(clock, scenario.brake_trips) == 0.0
        for _, end in scenario.brake_trips:
            since = np.where(clock >= end, np.maximum(since, end), since)
        braked = tripped | (clock < since) | (clock >= last + scenario.ramp) | (since > last)
        leaving = _ramp(clock - last, scenario.ramp) if math.isfinite(last) else np.zeros(count)
        engage = np.minimum(_ramp(clock - since, scenario.ramp), 1.0 - leaving)
        return ScheduleBlock(
            time=time,
            reference=scenario.profile.at(time),
            engage=np.where(braked, 0.0, engage),
            brake=braked.astype(np.float64),
        )

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


def events(scenario: Scenario) -> tuple[tuple[float, str, str], ...]:
    """Return what the scenario does, as time [s], kind and sentence, in order of time."""
    found: list[tuple[float, str, str]] = []
    if scenario.warm_up > 0.0:
        found.append((scenario.warm_up, "engaged", "the brake opens and the controller engages"))
    if scenario.disengage_at is not None:
        found.append((scenario.disengage_at, "disengaged", "the controller ramps out"))
    for kind, what, periods in (
        ("brake", "the brake trips", scenario.brake_trips),
        ("telemetry", "the link from the payload is lost", scenario.telemetry_outages),
        ("sensor", "the payload's sensor gives no numbers", scenario.sensor_failures),
        ("mru", "the motion reference unit gives no numbers", scenario.mru_outages),
    ):
        found += [(start, kind, f"{what} until {end:g} s") for start, end in periods]
    for start, end, extra in scenario.telemetry_delays:
        text = f"the link from the payload is late by {extra:.4g} s more until {end:g} s"
        found.append((start, "telemetry", text))
    for start, end, heave, rate in scenario.mru_biases:
        off = f"{heave:.4g} m and {rate:.4g} m/s"
        text = f"the motion reference unit is off by {off} until {end:g} s"
        found.append((start, "mru", text))
    for move in scenario.profile.moves:
        verb = "raise" if move.distance > 0.0 else "lower"
        text = f"{verb} by {abs(move.distance):g} m at {move.speed:.3g} m/s"
        found.append((move.start, "reference", text))
    for time, changes in scenario.parameter_changes.items():
        parts = [
            f"{name} is {'as before' if value is None else f'{value:.4g} from now on'}"
            for name, value in changes.items()
        ]
        found.append((time, "parameter", ", ".join(parts)))
    return tuple(sorted(found))


def check_periods(owner: str, name: str, periods: Sequence[Period]) -> tuple[Period, ...]:
    """Return periods in order of time.

    Raises
    ------
    InputError
        If one ends before it starts, or two overlap.
    """
    checked = []
    for start, end in periods:
        check_range(owner, f"start of {name}", start, low=0.0, unit="s")
        if not end > start:
            raise InputError(
                f"{owner}: {name} must end after they start, got {start:g} s to {end:g} s"
            )
        checked.append((float(start), float(end)))
    checked.sort()
    for before, after in itertools.pairwise(checked):
        if after[0] < before[1]:
            raise InputError(
                f"{owner}: {name} must not overlap, got {before[0]:g} s to {before[1]:g} s and "
                f"{after[0]:g} s to {after[1]:g} s"
            )
    return tuple(checked)


def _ramp(clock: FloatArray, duration: float) -> FloatArray:
    """Return (1 - cos)/2 from 0 at the start to 1 at `duration` [s]; a step if that is 0."""
    if duration <= 0.0:
        return (clock >= 0.0).astype(np.float64)
    result: FloatArray = 0.5 * (1.0 - np.cos(np.pi * np.clip(clock / duration, 0.0, 1.0)))
    return result


def _outside(clock: FloatArray, periods: Sequence[Period]) -> FloatArray:
    result = np.ones(clock.shape)
    for start, end in periods:
        result[(clock >= start) & (clock < end)] = 0.0
    return result
