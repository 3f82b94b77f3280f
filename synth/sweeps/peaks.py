"""The peak of |S| of spring loops, from polynomials: near their poles and on a common grid.

|1 + L| = |closed| / |open| is smooth but for wells at the poles of the closed loop and walls at
those of the open one.  So it is looked at on a common grid and around the poles of both, and the
lowest places of each loop are zoomed in on.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray

from .kernel import SpringLoops

Index = npt.NDArray[np.intp]

_COMMON = 64
_STEP = 1024  # loops at once
_NEAR = np.array([-3.0, -1.5, -0.7, -0.3, 0.0, 0.3, 0.7, 1.5, 3.0])
_ZOOM = np.array([-0.75, -0.45, -0.2, 0.2, 0.45, 0.75])
_ROUNDS = 9
_SHRINK = 0.3
_CANDIDATES = 3


def spring_peaks(loops: SpringLoops, rows: Index) -> FloatArray:
    """Return M_s = max 1/|1 + L| of some loops, (m,)."""
    found = np.empty(rows.size)
    for at in range(0, rows.size, _STEP):
        part = rows[at : at + _STEP]
        found[at : at + _STEP] = _peaks(loops, part)
    return found


def _peaks(loops: SpringLoops, rows: Index) -> FloatArray:
    poles = [loops.poles(rows, closed=closed) for closed in (True, False)]
    sizes = np.abs(np.concatenate(poles, axis=1))
    sizes = np.where(sizes > 1e-9 * sizes.max(axis=1, keepdims=True), sizes, np.nan)
    low, high = 0.05 * np.nanmin(sizes, axis=1), 20.0 * np.nanmax(sizes, axis=1)
    share = np.linspace(0.0, 1.0, _COMMON)
    ratio = np.log(high / low)[:, None]
    common = low[:, None] * np.exp(ratio * share)
    at = [common]
    width = [common * ratio / (_COMMON - 1)]
    for some in poles:
        upper = _upper(some)
        damping = np.minimum(np.abs(upper.real), 0.3 * np.abs(upper.imag)) + 1e-12
        near = np.abs(upper.imag)[:, :, None] + damping[:, :, None] * _NEAR
        at.append(np.maximum(near, 1e-9).reshape(rows.size, -1))
        wide = np.broadcast_to(damping[:, :, None], near.shape)
        width.append(wide.reshape(rows.size, -1))
    omega, reach = np.concatenate(at, axis=1), np.concatenate(width, axis=1)
    size = loops.distance(rows, omega)
    chosen = np.argpartition(size, _CANDIDATES, axis=1)[:, :_CANDIDATES]
    # The lowest of the common grid as well: a wide well may lie beside a narrow one.
    chosen = np.concatenate([chosen, np.argmin(size[:, :_COMMON], axis=1)[:, None]], axis=1)
    line = np.arange(rows.size)[:, None]
    best, where, span = size[line, chosen], omega[line, chosen], reach[line, chosen]
    pick = np.arange(chosen.size)
    for _ in range(_ROUNDS):
        around = np.maximum(where[:, :, None] + span[:, :, None] * _ZOOM, 1e-9)
        seen = loops.distance(rows, around.reshape(rows.size, -1)).reshape(-1, _ZOOM.size)
        k = np.argmin(seen, axis=1)
        least = seen[pick, k].reshape(best.shape)
        better = least < best
        where = np.where(better, around.reshape(-1, _ZOOM.size)[pick, k].reshape(best.shape), where)
        best = np.where(better, least, best)
        span = _SHRINK * span
    # Towards infinity |S| tends to one.
    return np.asarray(np.maximum(1.0 / np.sqrt(best.min(axis=1)), 1.0))


def _upper(poles: ComplexArray) -> ComplexArray:
    """Return the half of the poles with the largest imaginary parts, pairs counted once."""
    order = np.argsort(-poles.imag, axis=1)
    half = (poles.shape[1] + 1) // 2
    return np.take_along_axis(poles, order[:, :half], axis=1)
