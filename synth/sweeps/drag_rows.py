"""Drag that agrees with each loop's own response, for many loops at once.

C = q sqrt(8/pi) sigma_v(C), by the secant rule on logarithms, as `synth.robust.plant_stack` does.
More drag means less motion, so that the right side falls; where a loop is unstable it is given
more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.basics import FloatArray, IndexArray

Velocity = Callable[[IndexArray, FloatArray], FloatArray]

_ROUNDS = 60
_AGREE = 3e-13  # of the logarithm of C
_CLOSE = 1e-10  # ... and what will do
_STEP = 1.5  # of it, at most


def agreeing_drag(
    quadratic: FloatArray,
    start: float,
    velocity: Velocity,
) -> FloatArray:
    """Return C of each loop, (n,) [N s/m]; infinite where none agrees.

    Parameters
    ----------
    quadratic
        q of the drag force q |v| v of each, (n,) [N s2/m2].
    start
        About where to begin [N s/m].
    velocity
        rms of the payload's velocity of loops `rows` with drag C, (m,); infinite if unstable.
    """
    slope = quadratic * np.sqrt(8.0 / np.pi)
    x = np.full(quadratic.size, np.log(max(start, 1.0)))
    found = np.where(quadratic > 0.0, np.inf, 0.0)
    left, right = np.full_like(x, -np.inf), np.full_like(x, np.inf)
    before, gap_before = np.full_like(x, np.nan), np.full_like(x, np.nan)
    rows = np.flatnonzero(quadratic > 0.0)
    for _ in range(_ROUNDS):
        if not rows.size:
            break
        sigma = velocity(rows, np.exp(x[rows]))
        sound = np.isfinite(sigma)
        with np.errstate(divide="ignore"):
            gap = np.where(sound, np.log(np.maximum(slope[rows] * sigma, 1e-300)) - x[rows], _STEP)
        done = np.abs(gap) < _AGREE
        found[rows[done]] = np.exp(x[rows[done]])
        # The gap falls with x: its sign says on which side the answer lies.
        left[rows] = np.where(gap > 0.0, x[rows], left[rows])
        right[rows] = np.where(gap > 0.0, right[rows], x[rows])
        with np.errstate(all="ignore"):
            rise = (gap - gap_before[rows]) / (x[rows] - before[rows])
        rise = np.where(np.isfinite(rise) & sound, np.clip(rise, -3.0, -0.3), -1.5)
        before[rows], gap_before[rows] = x[rows], np.where(sound, gap, np.nan)
        step = np.clip(-gap / rise, -_STEP, _STEP)
        ahead = x[rows] + step
        outside = (ahead <= left[rows]) | (ahead >= right[rows])
        middle = 0.5 * (left[rows] + right[rows])
        ahead = np.where(outside & np.isfinite(middle), middle, ahead)
        x[rows] = ahead
        narrow = right[rows] - left[rows] < _AGREE
        found[rows[narrow & ~done]] = np.exp(right[rows[narrow & ~done]])
        # Rounding may keep the last digits from agreeing.
        close = np.abs(gap) < _CLOSE
        found[rows[close & ~done]] = np.exp(before[rows[close & ~done]])
        rows = rows[~(done | narrow)]
    return found
