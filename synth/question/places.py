"""Places on a curve that moves with its parameters: peaks and crossings between known points.

A descent needs them at every step, and needs each only so well that what is read there is right:
at a peak to second order of the place, at a crossing after one more step of Newton's.  So they are
looked for where interpolation says, a few calls with all of them at once; `synth.loop.margins`
finds the same places to the last digit.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.basics import BoolArray, FloatArray

Curve = Callable[[FloatArray], FloatArray]

SHIFT = 1e-6  # relative, of a frequency, of differences
_CLOSER = (0.3, 0.05, 0.01)  # width of parabolas about a peak, over its neighbours' distance
_STEPS = 2  # Newton's, towards a crossing


def peaks(curve: Curve, omega: FloatArray, values: FloatArray, above: float) -> FloatArray:
    """Return where a curve has its peaks above a value, from its values at `omega`, (c,)."""
    inner = values[1:-1]
    top = (inner >= values[:-2]) & (inner >= values[2:]) & (inner > above)
    at = np.flatnonzero(top) + 1
    if not at.size:
        return np.zeros(0)
    low, high = omega[at - 1], omega[at + 1]
    nodes, found = omega[at + _BESIDE], values[at + _BESIDE]
    for share in _CLOSER:
        middle = np.clip(_vertex(nodes, found), low, high)
        nodes = middle + 0.5 * share * (high - low) * _BESIDE
        found = curve(nodes.ravel()).reshape(nodes.shape)
    return np.clip(_vertex(nodes, found), low, high)


def crossings(
    curve: Curve, omega: FloatArray, values: FloatArray, among: BoolArray | None = None
) -> FloatArray:
    """Return where a curve changes its sign, from its values at `omega`, (c,).

    Of the changes only those count that have an end among the places where `among` is true.
    """
    # Zero counts as positive, so that a crossing that falls on a known point is seen once.
    changed = (values[:-1] >= 0.0) != (values[1:] >= 0.0)
    at = np.flatnonzero(changed if among is None else changed & (among[:-1] | among[1:]))
    low, high = omega[at], omega[at + 1]
    place = low + (high - low) * values[at] / (values[at] - values[at + 1])
    for _ in range(_STEPS if at.size else 0):
        ends = curve(beside(place)).reshape(2, -1)
        rate = (ends[0] - ends[1]) / (2.0 * SHIFT * place)
        step = -0.5 * (ends[0] + ends[1]) / np.where(rate == 0.0, np.inf, rate)
        place = np.clip(place + step, low, high)
    return place


def beside(omega: FloatArray) -> FloatArray:
    """Return the frequencies above, then those below some by a hair, (2 k,)."""
    return np.concatenate([omega * (1.0 + SHIFT), omega * (1.0 - SHIFT)])


_BESIDE = np.array([[-1], [0], [1]])


def _vertex(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the vertex of parabolas through three points each, (3, c)."""
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    slope = left + bend * (x[1] - x[0])
    return np.asarray(x[1] - 0.5 * slope / np.where(bend < 0.0, bend, -np.inf))
