"""Places on a curve that moves with its parameters: peaks and crossings between known points.

A descent needs them at every step, and needs each only so well that what is read there is right:
at a peak to second order of the place, at a crossing after one more step of Newton's.  So they are
looked for where interpolation says, a few calls with all places of all curves at once;
`synth.loop.margins` finds the same places to the last digit.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from models.basics import BoolArray, FloatArray

#: Asks for a curve at frequencies [rad/s], (k,), and is told it there; returns places on it, (c,).
Search = Generator[FloatArray, FloatArray, FloatArray]

SHIFT = 1e-6  # relative, of a frequency, of differences
_CLOSER = (0.3, 0.05, 0.01)  # width of parabolas about a peak, over its neighbours' distance
_FORETOLD = 1e-6  # relative error of a parabola at its vertex that the next makes as good as none
_STEPS = 2  # Newton's, towards a crossing


def together(
    searches: Sequence[Search], curves: Callable[[FloatArray, Sequence[int]], list[FloatArray]]
) -> list[FloatArray]:
    """Return what searches find, from frequencies of all and how many are whose to their curves."""
    found = [np.zeros(0)] * len(searches)
    asked: dict[int, FloatArray] = {}

    def go_on(k: int, told: FloatArray | None) -> None:
        try:
            asked[k] = next(searches[k]) if told is None else searches[k].send(told)
        except StopIteration as done:
            found[k] = done.value
            asked.pop(k, None)

    for k in range(len(searches)):
        go_on(k, None)
    while asked:
        sizes = [asked[k].size if k in asked else 0 for k in range(len(searches))]
        told = curves(np.concatenate([*asked.values()]), sizes)
        for k in list(asked):
            go_on(k, told[k])
    return found


def peaks(omega: FloatArray, values: FloatArray, above: float) -> Search:
    """Look for the peaks of a curve above a value, from its values at `omega`."""
    inner = values[1:-1]
    top = (inner >= values[:-2]) & (inner >= values[2:]) & (inner > above)
    at = np.flatnonzero(top) + 1
    if not at.size:
        return np.zeros(0)
    low, high = omega[at - 1], omega[at + 1]
    nodes, found = omega[at + _BESIDE], values[at + _BESIDE]
    for share in _CLOSER:
        vertex, foretold = _vertex(nodes, found)
        middle = np.clip(vertex, low, high)
        nodes = middle + 0.5 * share * (high - low) * _BESIDE
        found = (yield nodes.ravel()).reshape(nodes.shape)
        if np.all(np.abs(found[1] - foretold) <= _FORETOLD * found[1]):
            break
    return np.clip(_vertex(nodes, found)[0], low, high)


def crossings(omega: FloatArray, values: FloatArray, among: BoolArray | None = None) -> Search:
    """Look for where a curve changes its sign, from its values at `omega`.

    Of the changes only those count that have an end among the places where `among` is true.
    """
    # Zero counts as positive, so that a crossing that falls on a known point is seen once.
    changed = (values[:-1] >= 0.0) != (values[1:] >= 0.0)
    at = np.flatnonzero(changed if among is None else changed & (among[:-1] | among[1:]))
    low, high = omega[at], omega[at + 1]
    place = low + (high - low) * values[at] / (values[at] - values[at + 1])
    for _ in range(_STEPS if at.size else 0):
        ends = (yield beside(place)).reshape(2, -1)
        rate = (ends[0] - ends[1]) / (2.0 * SHIFT * place)
        step = -0.5 * (ends[0] + ends[1]) / np.where(rate == 0.0, np.inf, rate)
        place = np.clip(place + step, low, high)
    return place


def beside(omega: FloatArray) -> FloatArray:
    """Return the frequencies above, then those below some by a hair, (2 k,)."""
    return np.concatenate([omega * (1.0 + SHIFT), omega * (1.0 - SHIFT)])


_BESIDE = np.array([[-1], [0], [1]])


def _vertex(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return place and height of the vertex of parabolas through three points each, (3, c)."""
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    slope = left + bend * (x[1] - x[0])
    step = -0.5 * slope / np.where(bend < 0.0, bend, -np.inf)
    return x[1] + step, y[1] + 0.5 * slope * step
