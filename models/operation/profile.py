"""Set-point profiles of the payload, made of moves from rest to rest.

Moves have a limited speed and acceleration.  Each starts at its own time, from rest to rest; moves
that overlap add up.  `models.operation.scenario` is made of these.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, check_range


@dataclass(frozen=True, kw_only=True)
class Move:
    """A move from rest to rest with a trapezoidal speed profile."""

    start: float  #: When it begins [s].
    distance: float  #: How far, up positive [m].
    speed: float  #: Highest speed [m/s]; a short move does not reach it.
    acceleration: float  #: Acceleration at the start, deceleration at the end [m/s2].

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
