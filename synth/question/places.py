"""Places on curves that move with their parameters: peaks and crossings between known points.

A descent needs them at every step, and needs each only so well that what is read there is right:
at a peak to second order of the place, at a crossing after one more step of Newton's.  So they are
looked for where interpolation says, a few calls with all places of all curves at once;
`synth.loop.margins` finds the same places to the last digit.
"""

from collections.abc import Callable, Generator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import BoolArray, ComplexArray, FloatArray

from ..limits import Size
from ..loop import value_of

IntArray = npt.NDArray[np.intp]

#: Asks for curves at frequencies [rad/s], (c,), each on one of several, and is told it there; the
#: last asked for are the places.
Search = Generator[tuple[FloatArray, IntArray], ComplexArray, None]

_SHIFT = 1e-6  # relative, of a frequency, of differences
_NODES = 7  # known points that interpolation takes
_SHARES = np.linspace(0.0, 1.0, 33)[:, None]  # of an interval, where it is looked at
_ROUNDS = 4
_FORETOLD = 1e-7  # relative error of interpolation at a peak that counts as none
_HAIR = 1e-4  # of the distance of known points: a last step of Newton's towards a crossing
_BESIDE = np.array([[-1], [0], [1]])


def together(
    searches: Sequence[Search],
    curves: Callable[[FloatArray, IntArray, Sequence[slice]], Sequence[Any]],
) -> list[tuple[FloatArray, Any] | None]:
    """Return the places that searches find, and what their curves are there, with slopes.

    From frequencies of all, on which curve they are, and which of them are whose, to the curves.
    """
    found: list[tuple[FloatArray, Any] | None] = [None] * len(searches)
    with np.errstate(all="ignore"):  # interpolation may break down
        asked = {k: wish for k, search in enumerate(searches) if (wish := next(search, None))}
    while asked:
        sizes = [asked[k][0].size if k in asked else 0 for k in range(len(searches))]
        cuts = [slice(*pair) for pair in pairwise(np.cumsum([0, *sizes]).tolist())]
        at, on = (np.concatenate(parts) for parts in zip(*asked.values(), strict=True))
        told = curves(at, on, cuts)
        for k, (places, _) in [*asked.items()]:
            found[k] = places, told[k]
            try:
                with np.errstate(all="ignore"):
                    asked[k] = searches[k].send(value_of(told[k]))
            except StopIteration:
                del asked[k]
    return found


def peaks(omega: FloatArray, values: ComplexArray, size: Size, above: float) -> Search:
    """Look for the peaks of sizes above a value, from curves, (curves, k), at `omega`."""
    sizes = np.array([size(omega, each) for each in values])
    inner = sizes[:, 1:-1]
    top = (inner >= sizes[:, :-2]) & (inner >= sizes[:, 2:]) & (inner > above)
    on, at = np.nonzero(top)
    if not at.size:
        return
    nodes, known = _about(omega, values, on, at + 1)
    each, place, right = np.arange(at.size), omega[at + 1], np.zeros(at.size, np.bool_)
    for _ in range(_ROUNDS):
        ends, terms = (omega[at], omega[at + 2]), _fraction(nodes, known)
        for _ in range(2):
            fine = ends[0] + (ends[1] - ends[0]) * _SHARES
            guess = _interpolated(nodes, terms, fine)
            depth = 1.0 / size(fine.ravel(), guess.ravel()).reshape(fine.shape) ** 2
            depth = np.where(np.isfinite(depth), depth, np.inf)
            least = depth.argmin(axis=0)
            near = np.minimum(np.maximum(least, 1), _SHARES.size - 2) + _BESIDE
            ends = fine[near[0], each], fine[near[2], each]
        vertex, height = _vertex(fine[near, each], depth[near, each])
        sound = np.isfinite(height)
        vertex = np.where(sound, vertex, fine[least, each])
        place = np.where(right, place, vertex)
        foretold = np.where(sound, height, depth[least, each]) ** -0.5
        told = yield place, on
        right |= np.abs(size(place, told) - foretold) <= _FORETOLD * foretold
        if right.all():
            break
        nodes, known = np.vstack([nodes, place]), np.vstack([known, told])


def crossings(
    omega: FloatArray,
    gains: ComplexArray,
    height: Callable[[ComplexArray], FloatArray],
    among: BoolArray | None = None,
) -> Search:
    """Look for where a height of curves changes its sign, from gains, (curves, k), at `omega`.

    Of the changes only those count that have an end among the places where `among` is true.  Each
    place is asked for as two, the frequencies above, then those below some by a hair, of 1 + gain.
    """
    values = height(gains)
    # Zero counts as positive, so that a crossing that falls on a known point is seen once.
    changed = (values[:, :-1] >= 0.0) != (values[:, 1:] >= 0.0)
    on, at = np.nonzero(changed if among is None else changed & (among[:, :-1] | among[:, 1:]))
    if not at.size:
        return
    low, high, rising = omega[at], omega[at + 1], values[on, at] < 0.0
    nodes, known = _about(omega, gains, on, at)
    terms = _fraction(nodes, known)
    ends, each = (low, high), np.arange(at.size)
    for _ in range(2):
        fine = ends[0] + (ends[1] - ends[0]) * _SHARES
        heights = height(_interpolated(nodes, terms, fine))
        beyond = (heights[1:] >= 0.0) == rising
        beyond[-1] = True
        last = beyond.argmax(axis=0)
        ends = fine[last, each], fine[last + 1, each]
    first, then = heights[last, each], heights[last + 1, each]
    place = ends[0] + (ends[1] - ends[0]) * first / (first - then)
    for _ in range(_ROUNDS):
        place = np.where((place >= low) & (place <= high), place, 0.5 * (low + high))
        pair = np.concatenate([place * (1.0 + _SHIFT), place * (1.0 - _SHIFT)])
        above, below = height((yield pair, np.tile(on, 2)) - 1.0).reshape(2, -1)
        there, rate = 0.5 * (above + below), (above - below) / (2.0 * _SHIFT * place)
        if np.all(np.abs(there) <= _HAIR * np.abs(rate) * (omega[at + 1] - omega[at])):
            break
        passed = (there >= 0.0) == rising
        low, high = np.where(passed, low, place), np.where(passed, place, high)
        place = place - there / rate


def _about(
    omega: FloatArray, values: ComplexArray, on: IntArray, at: IntArray
) -> tuple[FloatArray, ComplexArray]:
    """Return the known points about some, (n, c), and what the curves are there."""
    count = min(_NODES, omega.size)
    near = np.clip(at - count // 2, 0, omega.size - count) + np.arange(count)[:, None]
    return omega[near], values[on, near]


def _fraction(nodes: FloatArray, known: ComplexArray) -> ComplexArray:
    """Return Thiele's continued fractions, (n, c), of curves known at nodes, (n, c)."""
    terms = np.array(known, np.complex128)
    for k in range(1, len(terms)):
        terms[k:] = (nodes[k:] - nodes[k - 1]) / (terms[k:] - terms[k - 1])
    return terms


def _interpolated(nodes: FloatArray, terms: ComplexArray, at: FloatArray) -> ComplexArray:
    """Return curves, (..., c), as rational functions: by `_fraction`, which follows a resonance.

    There is no number where it breaks down.
    """
    found = np.broadcast_to(terms[-1], at.shape)
    for k in reversed(range(len(terms) - 1)):
        found = terms[k] + (at - nodes[k]) / found
    return np.asarray(found)


def _vertex(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where parabolas through three points each, (3, c), are least between them, and it."""
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    slope = left + bend * (x[1] - x[0])
    step = -0.5 * slope / np.where(bend > 0.0, bend, np.inf)
    step = np.minimum(np.maximum(step, x[0] - x[1]), x[2] - x[1])
    return x[1] + step, y[1] + (slope + bend * step) * step
