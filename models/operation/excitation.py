r"""Motions over time, of the hook and of whatever else moves by itself.

A `MotionSource` says where a motion comes from: a spectrum, a sine or nothing (this file), a
measured record (`models.operation.record_file`), six degrees of freedom
(`models.operation.six_dof`).  Asked for a duration and a time step it gives a `Motion`, which is
read in blocks: 24 hours at 5 ms would be 17 million rows, and nobody needs them all at once.

Displacement, velocity and acceleration are consistent: between equally spaced nodes the
displacement is the polynomial of fifth degree that has the displacements, velocities and
accelerations of both nodes (quintic Hermite interpolation), and the other two are its derivatives.
For a harmonic its error is at most (omega Delta)^6/46080 of the amplitude, so the nodes' distance
Delta follows from the spectrum alone, and the motion is the same at every step of the integrator.

A random motion longer than three hours and ten minutes would take memory in proportion, so it is
made of records of an hour, each of which fades into the next over ten minutes: the one times the
cosine, the other times the sine of an angle that grows from 0 to 90 degrees.  The sum of two
independent Gaussian motions with the same spectrum is then Gaussian again and keeps its variance
all the way; ten minutes are so long against the waves that the velocity does too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_range
from ..case import Case
from ..hook import HookMotion
from ..sea import SHORTEST
from .hermite import MotionBlock, interpolated

HOOK = None  #: Purpose of a random motion that is drawn with the run's own seed.
SECOND_BODY, SURFACE = 4, 5
"""Purposes of motions in waves of their own; `models.sensing.draws` has 1 to 3 and 7 to 9."""

# What the interpolation may add to a random motion, as a standard deviation.  A hundredth of it
# would take nodes twice as close, and of a motion held to 60 rad/s millions of them.
_ERROR = 1e-7  # [m]

# All of them divide five seconds: then `HookMotion.record` draws the same waves with each.
_NODE_STEPS = (0.1, 0.05, 0.04, 0.025, 0.02, 0.0125, 0.01, 0.00625, 0.005)  # [s]
_PIECE, _FADE = 3600.0, 600.0  # [s]
_LONGEST_ALONE = 11400.0  # [s]

# Purpose of the seeds of all pieces but the first; 1 to 5 are taken by noise and other bodies.
_LATER_PIECE = 6


def seed_for(seed: int, *purpose: int) -> int:
    """Return the seed for one purpose of a run, independent of those for all others.

    A purpose is numbers above zero: numpy fills short seeds up with zeros.
    """
    return int(np.random.SeedSequence([seed, *purpose]).generate_state(1, np.uint64)[0])


class LongRecord:
    """The nodes of a random motion of any duration [s], drawn when they are read.

    Their distance `step` [s] divides five seconds; the seeds of later pieces follow from that of
    the first.
    """

    last: int
    """Index of the last node, at the duration or less than a step beyond it."""

    def __init__(self, hook: HookMotion, duration: float, step: float, seed: int) -> None:
        self._hook, self._step, self._seed = hook, step, seed
        self.last = math.ceil(duration / step - 1e-9)
        self._stride, self._fade = round((_PIECE - _FADE) / step), round(_FADE / step)
        self._alone = self.last * step <= _LONGEST_ALONE
        # Two pieces at hand are enough to read on from one into the next.
        self._piece = lru_cache(maxsize=2)(self._draw)

    def __call__(self, start: int, count: int) -> FloatArray:
        """Return nodes (count, 3)."""
        if self._alone:
            return self._piece(0)[start : start + count]
        length = self._stride + self._fade
        result = np.zeros((count, 3))
        for piece in range(
            max(0, start - self._fade) // self._stride, (start + count - 1) // self._stride + 1
        ):
            begin = piece * self._stride
            low, high = max(start, begin), min(start + count, begin + length)
            if low >= high:
                continue
            at = np.arange(low - begin, high - begin)
            part = self._piece(piece)[low - begin : high - begin]
            part = self._faded(part, at - self._stride, 0.0)
            if piece > 0:
                part = self._faded(part, at, -0.5 * math.pi)
            result[low - start : high - start] += part
        return result

    def _faded(self, part: FloatArray, clock: npt.NDArray[np.int64], phase: float) -> FloatArray:
        """Return nodes times the cosine of an angle that grows by 90 degrees from clock zero on."""
        # The angle itself starts and ends smoothly, so that the velocity has no jump.
        grown = _smooth(clock / self._fade, self._fade * self._step)
        turned, first, second = (0.5 * math.pi * part for part in grown)
        cosine, sine = np.cos(phase + turned), np.sin(phase + turned)
        shares = cosine, -sine * first, -cosine * first**2 - sine * second
        return np.stack(_times((part[:, 0], part[:, 1], part[:, 2]), shares), axis=1)

    def _draw(self, piece: int) -> FloatArray:
        seed = seed_for(self._seed, _LATER_PIECE, piece) if piece else self._seed
        duration = self.last * self._step if self._alone else _PIECE
        record = self._hook.record(duration, step=self._step, seed=seed)
        return np.stack([record.displacement, record.velocity, record.acceleration], axis=1)


class MotionSource(Protocol):
    """Where a motion comes from."""

    @property
    def description(self) -> str:
        """What it is, in a few words."""
        ...

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the motion over a duration [s] at a time step [s].

        Raises InputError if it does not last that long, or cannot be that fine.
        """
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A vertical motion, up positive, that is read in blocks."""

    source: str  #: What it is, in a few words.
    duration: float  #: From the first row to the last [s].
    step: float  #: Time from row to row [s].
    #: Gives displacement, velocity and acceleration at `count` rows from row `start` on.
    evaluate: Callable[[int, int], MotionBlock]

    @property
    def rows(self) -> int:
        """Number of rows; the last is at `duration` or less than a step before it."""
        return math.floor(self.duration / self.step * (1.0 + 1e-12) + 1e-9) + 1

    def block(self, start: int, count: int) -> MotionBlock:
        """Return so many rows (count,) [SI] from one on, the same whatever was read before.

        Raises InputError if the motion does not have these rows.
        """
        if start < 0 or count < 0 or start + count > self.rows:
            raise InputError(
                f"motion ({self.source}): has rows 0 to {self.rows - 1}, asked for rows {start} "
                f"to {start + count - 1}"
            )
        return self.evaluate(start, count)

    def time(self, start: int, count: int) -> FloatArray:
        """Return the times of rows (count,) [s]."""
        return self.step * np.arange(start, start + count, dtype=np.float64)

    def eased(self, duration: float) -> Motion:
        """Return the motion growing smoothly out of rest over a duration [s].

        It is multiplied by 10 r^3 - 15 r^4 + 6 r^5 of r = time/duration; velocity and
        acceleration are the derivatives of the product.  A run that starts at rest then starts
        without a jerk.
        """
        if duration <= 0.0:
            return self

        def evaluate(start: int, count: int) -> MotionBlock:
            block = self.evaluate(start, count)
            if start * self.step >= duration:
                return block
            return _times(block, _smooth(self.time(start, count) / duration, duration))

        return replace(self, evaluate=evaluate)


@dataclass(frozen=True, kw_only=True)
class SineMotion:
    """A sine, z = amplitude sin(2 pi t/period + phase)."""

    amplitude: float  #: Amplitude [m], of 0 to 100 m.
    period: float  #: Period [s], of 0.5 s, as those of seas, to 1000 s.
    phase: float = 0.0  #: Phase at the start [rad].

    def __post_init__(self) -> None:
        check_range("sine motion", "amplitude", self.amplitude, low=0.0, high=100.0, unit="m")
        check_range("sine motion", "period", self.period, low=SHORTEST, high=1e3, unit="s")
        check_range("sine motion", "phase", self.phase, unit="rad")

    @property
    def description(self) -> str:
        """What it is."""
        return f"sine of {self.amplitude:g} m and {self.period:g} s"

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the sine, exact at every row; the seed plays no part."""
        del seed
        omega = 2.0 * math.pi / self.period

        def evaluate(start: int, count: int) -> MotionBlock:
            turns = step * np.arange(start, start + count, dtype=np.float64) / self.period
            angle = 2.0 * math.pi * (turns % 1.0) + self.phase
            sine, cosine = self.amplitude * np.sin(angle), self.amplitude * np.cos(angle)
            return sine, omega * cosine, -(omega**2) * sine

        return Motion(source=self.description, duration=duration, step=step, evaluate=evaluate)


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectrumMotion:
    """A random motion drawn from a spectrum: the hook's in a sea, or another body's.

    Up to three hours and ten minutes it is `HookMotion.record` of the same duration and seed,
    interpolated to 1e-7 m; beyond that `LongRecord` joins records of an hour.  Without a `purpose`
    it is drawn with the run's own seed: bodies with the same purpose in the same sea meet the same
    waves.  `SECOND_BODY` and `SURFACE` draw waves of their own.
    """

    hook: HookMotion
    purpose: int | None = HOOK

    @classmethod
    def from_case(cls, case: Case) -> SpectrumMotion:
        """Return the motion of a case's hook."""
        return cls(hook=HookMotion.from_case(case))

    @property
    def description(self) -> str:
        """What it is."""
        sea = self.hook.sea
        period = 2.0 * math.pi / sea.peak_frequency
        return f"{sea.kind} sea, H_s {sea.significant_height:g} m, T_p {period:.3g} s"

    @cached_property
    def node_step(self) -> float:
        """Distance of the nodes between which the record is interpolated [s]."""
        nodes = self.hook.quadrature
        density = self.hook.density(nodes.omega)
        for step in _NODE_STEPS:
            # Far beyond its range the bound is too large; the interpolant itself never is.
            error = np.minimum((nodes.omega * step) ** 6 / 46080.0, 2.0)
            if nodes.integrate(density * error**2) <= _ERROR**2:
                return step
        return _NODE_STEPS[-1]

    def motion(self, duration: float, step: float, seed: int) -> Motion:
        """Return the motion; a block of it is only computed when it is read."""
        own = seed if self.purpose is None else seed_for(seed, self.purpose)
        pieces = LongRecord(self.hook, duration, self.node_step, own)
        return Motion(
            source=self.description,
            duration=duration,
            step=step,
            evaluate=interpolated(pieces, pieces.last, self.node_step, step),
        )


def _smooth(r: FloatArray, duration: float) -> MotionBlock:
    """Return 10 r^3 - 15 r^4 + 6 r^5 of r = time/duration, held outside [0, 1], and its rates."""
    r = np.clip(r, 0.0, 1.0)
    share = r**3 * (10.0 - 15.0 * r + 6.0 * r**2)
    rate = 30.0 * (r * (1.0 - r)) ** 2 / duration
    return share, rate, 60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / duration**2


def _times(motion: MotionBlock, share: MotionBlock) -> MotionBlock:
    """Return the product of a motion and a share that changes in time, and its derivatives."""
    (z, v, a), (s, rate, change) = motion, share
    return s * z, s * v + rate * z, s * a + 2.0 * rate * v + change * z
