"""A random motion of any length, drawn piece by piece.

Up to three hours and ten minutes it is `HookMotion.record` itself.  A longer one would take memory
in proportion, so it is made of records of an hour, each of which fades into the next over ten
minutes: the one times the cosine, the other times the sine of an angle that grows from 0 to 90
degrees.  The sum of two independent Gaussian motions with the same spectrum is then Gaussian again
and keeps its variance all the way; ten minutes are so long against the waves that the velocity
does too.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray
from ..hook import HookMotion

_PIECE, _FADE = 3600.0, 600.0  # [s]
_LONGEST_ALONE = 11400.0  # [s]

# Purpose of the seeds of all pieces but the first; 1 to 5 are taken by noise and other bodies.
_LATER_PIECE = 6


def seed_for(seed: int, *purpose: int) -> int:
    """Return the seed for one purpose of a run, independent of those for all others.

    Parameters
    ----------
    seed
        Seed of the run.
    *purpose
        Numbers above zero: numpy fills short seeds up with zeros.
    """
    return int(np.random.SeedSequence([seed, *purpose]).generate_state(1, np.uint64)[0])


class LongRecord:
    """The nodes of a random motion of any length, drawn when they are read.

    Parameters
    ----------
    hook
        The spectrum.
    duration
        Length [s].
    step
        Distance of the nodes [s]; divides five seconds.
    seed
        Seed of the first piece, from which those of the others follow.
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
        u = np.clip(clock / self._fade, 0.0, 1.0)
        rate = 0.5 * math.pi / (self._fade * self._step)
        # The angle itself starts and ends smoothly, so that the velocity has no jump.
        angle = phase + 0.5 * math.pi * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        first = rate * 30.0 * (u * (1.0 - u)) ** 2
        second = rate * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (self._fade * self._step)
        cosine, sine = np.cos(angle), np.sin(angle)
        share, share_rate = cosine, -sine * first
        share_change = -cosine * first**2 - sine * second
        z, v, a = part.T
        return np.stack(
            [
                share * z,
                share * v + share_rate * z,
                share * a + 2.0 * share_rate * v + share_change * z,
            ],
            axis=1,
        )

    def _draw(self, piece: int) -> FloatArray:
        seed = seed_for(self._seed, _LATER_PIECE, piece) if piece else self._seed
        duration = self.last * self._step if self._alone else _PIECE
        record = self._hook.record(duration, step=self._step, seed=seed)
        return np.stack([record.displacement, record.velocity, record.acceleration], axis=1)
