r"""Unstable poles, peak of |S| and calming drag of many loops at once, by their phase.

The function `closed` has the loop's poles as its zeros and no pole in the right half plane.  Up
the imaginary axis from 0 to iR its phase changes by so much, along the arc from R to iR by so
much, and the difference is pi for every zero that the two enclose with the real axis, its mirror
image counted with it (argument principle; Nyquist 1932).  R is so large that the loop gain is
small on the arc and, by the maximum principle, beyond it.

All loops begin with the same kind of grid, eight points for each axial mode of the rope; where
phase or size jumps between neighbours, the interval is halved, for all loops in one call, as
`synth.verify.winding.trace` does for one.  So delays, waves and light damping are followed exactly;
a phase that cannot be followed means a pole on the axis, and counts as unstable.

From which linear drag on a loop is stable (`calming_drag`): the characteristic function is affine
in the drag, closed = c0 + C c1, so a pole is on the axis at i omega for the C that makes it zero
there, C = -c0/c1, wherever that is real and positive.  The largest of them is the boundary: with
more drag no pole is on the axis any more, and with drag without end the payload stands still and
the loop is open, which is stable.  All but a slow drift: where closed(0) is not above zero, a real
pole is in the right half plane whatever the drag.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from models.basics import BoolArray, ComplexArray, FloatArray, IndexArray

from .chain import ChainLoops, abs2

Follow = Callable[[IndexArray, ComplexArray], ComplexArray]

_TURN, _GROWTH = 0.5, 1.0  # largest steps of phase [rad] and of the logarithm of the size
_PER_DECADE, _PER_MODE = 24, 8
_LOW = 1e-4  # first frequency above zero [rad/s]
_ARC = 49
_ROUNDS = 46  # of halving: then the interval is a rounding error wide
_SMALL = 0.5  # loop gain on the arc
_STEP = 64  # loops at once
_GOLDEN = 0.5 * (3.0 - 5.0**0.5)
_SOUGHT = 4  # light poles of one loop
_NEAR = 1.5  # local minima up to so much above the least are looked into
_CALMING_ROUNDS = 50  # of halving, where a pole is on the axis


class Loops(Protocol):
    """What is needed of a stack of loops."""

    def __len__(self) -> int: ...

    @property
    def masses(self) -> int:
        """Masses along the rope."""
        ...

    @property
    def mode_spacing(self) -> FloatArray:
        """Distance of the rope's modes [rad/s], (n,) or (1,)."""
        ...

    def responses(self, rows: IndexArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return closed and open characteristic functions, (m, k) each."""
        ...


def count_unstable(loops: Loops, rows: IndexArray | None = None) -> IndexArray:
    """Return how many poles each loop has in the right half plane; -1 where one is on the axis.

    Parameters
    ----------
    loops
        The loops.
    rows
        Which of them; all if left out.
    """
    chosen = np.arange(len(loops)) if rows is None else rows
    found = np.empty(chosen.size, dtype=np.intp)
    for at in range(0, chosen.size, _STEP):
        part = chosen[at : at + _STEP]
        found[at : at + _STEP] = _count(loops, part)
    return found


def peak_sensitivity(loops: Loops, rows: IndexArray | None = None) -> FloatArray:
    """Return M_s = max 1/|1 + L| of each loop, stable or not, (m,)."""
    chosen = np.arange(len(loops)) if rows is None else rows
    found = np.empty(chosen.size)
    for at in range(0, chosen.size, _STEP):
        part = chosen[at : at + _STEP]
        found[at : at + _STEP] = _peaks(loops, part)
    return found


def light_poles(loops: Loops, row: int) -> ComplexArray:
    """Return the poles of one loop that its |1 + L| is least near, the upper half [1/s].

    Newton's rule from the lowest minima along the imaginary axis.
    """
    rows = np.array([row])
    omega = _grid(loops, rows, _radius(loops, rows))[0, 1:]
    closed, free = loops.responses(rows, _imaginary(omega))
    size = (abs2(closed) / abs2(free))[0]
    inner = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
    start = inner[np.argsort(size[inner])[:_SOUGHT]]
    s = _imaginary(omega[start])
    for _ in range(40):
        step = 1e-6 * np.abs(s)
        ends = loops.responses(rows, np.concatenate([s, s + step, s - step]))[0][0]
        here, above, below = np.split(ends, 3)
        with np.errstate(all="ignore"):
            move = here * 2.0 * step / (above - below)
        move = np.where(np.isfinite(move), move, 0.0)
        s = s - move * np.minimum(1.0, 0.3 * np.abs(s) / np.maximum(np.abs(move), 1e-300))
    found = s[np.abs(move) < 1e-6 * np.abs(s)]
    return np.asarray(found, dtype=np.complex128)


def frequencies(loops: Loops, rows: IndexArray) -> FloatArray:
    """Return frequencies of each loop between which little happens, (m, k) [rad/s], ascending."""
    return _grid(loops, rows, _radius(loops, rows))[:, 1:]


def _count(loops: Loops, rows: IndexArray) -> IndexArray:
    radius = _radius(loops, rows)

    def closed(at: IndexArray, s: ComplexArray) -> ComplexArray:
        return loops.responses(at, s)[0]

    # The first quadrant's contour: up the imaginary axis, and along the arc from the real one, on
    # which `closed` is real and its phase takes no part.
    axis = _follow(closed, rows, _imaginary(_grid(loops, rows, radius)))
    angle = np.linspace(0.0, 0.5 * np.pi, _ARC)
    points = np.asarray(radius[:, None] * np.exp(1j * angle), dtype=np.complex128)
    arc = _follow(closed, rows, points, around=True)
    zeros = (arc - axis) / np.pi
    with np.errstate(invalid="ignore"):
        count = np.where(np.abs(zeros - np.round(zeros)) < 0.05, np.round(zeros), -1.0)
    return count.astype(np.intp)


def _radius(loops: Loops, rows: IndexArray) -> FloatArray:
    """Return a radius of each loop on which, and beyond, the loop gain is small, (m,) [1/s]."""
    angle = np.exp(1j * np.linspace(0.0, 0.5 * np.pi, 13))
    beyond = 1j * np.geomspace(1.0, 30.0, 25)[1:]
    directions = np.concatenate([angle, beyond])
    spacing = np.broadcast_to(loops.mode_spacing, (len(loops),))[rows]
    radius = np.maximum(100.0, 2.0 * spacing * loops.masses)
    open_still = np.ones(rows.size, dtype=bool)
    for _ in range(30):
        at = np.flatnonzero(open_still)
        with np.errstate(over="ignore", invalid="ignore"):
            closed, free = loops.responses(rows[at], radius[at, None] * directions)
            gain = np.abs(closed / free - 1.0).max(axis=1)
        open_still[at] = ~(gain < _SMALL)
        if not open_still.any():
            break
        radius[open_still] *= 2.0
    return radius


def _grid(loops: Loops, rows: IndexArray, radius: FloatArray) -> FloatArray:
    """Return frequencies from 0 to the radius, (m, k) [rad/s]: by decades, and by modes."""
    decades = np.log10(radius / _LOW)
    count = int(_PER_DECADE * decades.max()) + 2
    slow = _LOW * 10.0 ** (decades[:, None] * np.linspace(0.0, 1.0, count))
    spacing = np.broadcast_to(loops.mode_spacing, (len(loops),))[rows]
    steps = np.arange(1.0, _PER_MODE * loops.masses + 1.0) / _PER_MODE
    modes = np.minimum(spacing[:, None] * steps, radius[:, None])
    both = np.sort(np.concatenate([slow, modes], axis=1), axis=1)
    return np.asarray(np.concatenate([np.zeros((rows.size, 1)), both], axis=1))


def _imaginary(omega: FloatArray) -> ComplexArray:
    return np.asarray(1j * omega, dtype=np.complex128)


def _follow(
    function: Follow, rows: IndexArray, points: ComplexArray, *, around: bool = False
) -> FloatArray:
    """Return by how much the phase of each loop's function changes along its points, (m,) [rad].

    NaN where it cannot be followed.  `around` halves intervals along an arc about the origin.
    """
    values = function(rows, points)
    turn, smooth = _steps(values[:, :-1], values[:, 1:])
    total = np.asarray(np.where(smooth, turn, 0.0).sum(axis=1), dtype=np.float64)
    # All intervals of all loops that are not smooth are halved in one call, until none is left.
    loop, k = np.nonzero(~smooth)
    a, b = points[loop, k], points[loop, k + 1]
    va, vb = values[loop, k], values[loop, k + 1]
    for _ in range(_ROUNDS):
        if not loop.size:
            return total
        middle = _middle(a, b, around)
        vm = function(rows[loop], middle[:, None])[:, 0]
        loop = np.concatenate([loop, loop])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        va, vb = np.concatenate([va, vm]), np.concatenate([vm, vb])
        turn, smooth = _steps(va, vb)
        np.add.at(total, loop[smooth], turn[smooth])
        rest = ~smooth
        loop, a, b, va, vb = loop[rest], a[rest], b[rest], va[rest], vb[rest]
    total[loop] = np.nan
    return total


def _middle(a: ComplexArray, b: ComplexArray, around: bool) -> ComplexArray:
    middle = 0.5 * (a + b)
    return np.asarray(middle * (np.abs(a) / np.abs(middle)) if around else middle)


def _steps(one: ComplexArray, other: ComplexArray) -> tuple[FloatArray, BoolArray]:
    """Return the phase step between neighbours, and whether phase and size are followed."""
    with np.errstate(all="ignore"):
        ratio = other / one
        turn = np.angle(ratio)
        growth = np.abs(np.log(np.abs(ratio)))
    smooth = (np.abs(turn) <= _TURN) & (growth <= _GROWTH)
    same = one == other  # coinciding points
    return np.where(same, 0.0, turn), smooth | same


def _peaks(loops: Loops, rows: IndexArray) -> FloatArray:
    omega = _grid(loops, rows, _radius(loops, rows))[:, 1:]
    closed, free = loops.responses(rows, _imaginary(omega))
    m, k = omega.shape
    every = [(np.repeat(np.arange(m), k), omega.ravel(), (abs2(closed) / abs2(free)).ravel())]
    smooth = _steps(closed[:, :-1], closed[:, 1:])[1] & _steps(free[:, :-1], free[:, 1:])[1]
    loop, at = np.nonzero(~smooth)
    a, b = omega[loop, at], omega[loop, at + 1]
    ends = [closed[loop, at], closed[loop, at + 1], free[loop, at], free[loop, at + 1]]
    for _ in range(_ROUNDS):
        if not loop.size:
            break
        middle = 0.5 * (a + b)
        here = [v[:, 0] for v in loops.responses(rows[loop], _imaginary(middle[:, None]))]
        with np.errstate(all="ignore"):
            every.append((loop, middle, abs2(here[0]) / abs2(here[1])))
        loop = np.concatenate([loop, loop])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        ends = [
            np.concatenate([ends[0], here[0]]),
            np.concatenate([here[0], ends[1]]),
            np.concatenate([ends[2], here[1]]),
            np.concatenate([here[1], ends[3]]),
        ]
        rest = ~(_steps(ends[0], ends[1])[1] & _steps(ends[2], ends[3])[1])
        rest &= (b - a) > 1e-12 * b
        loop, a, b = loop[rest], a[rest], b[rest]
        ends = [v[rest] for v in ends]
    return _least(loops, rows, *(np.concatenate(column) for column in zip(*every, strict=True)))


def _least(
    loops: Loops, rows: IndexArray, loop: IndexArray, omega: FloatArray, size: FloatArray
) -> FloatArray:
    """Return 1/min|1 + L| from points (loop, omega, |1 + L|^2), the lowest minima refined."""
    size = np.where(np.isfinite(size), size, np.inf)
    order = np.lexsort((omega, loop))
    loop, omega, size = loop[order], omega[order], size[order]
    best = np.full(rows.size, np.inf)
    np.minimum.at(best, loop, size)
    same = loop[1:] == loop[:-1]
    lower_left = np.append(True, ~same | (size[1:] <= size[:-1]))
    lower_right = np.append(~same | (size[:-1] <= size[1:]), True)
    at = np.flatnonzero(lower_left & lower_right & (size <= _NEAR**2 * best[loop]))
    left, right = np.maximum(at - 1, 0), np.minimum(at + 1, loop.size - 1)
    low = np.where(loop[left] == loop[at], omega[left], omega[at])
    high = np.where(loop[right] == loop[at], omega[right], omega[at])
    owner = loop[at]

    def value(w: FloatArray) -> FloatArray:
        closed, free = loops.responses(rows[owner], _imaginary(w[:, None]))
        with np.errstate(all="ignore"):
            found = (abs2(closed) / abs2(free))[:, 0]
        return np.where(np.isfinite(found), found, np.inf)

    # Golden section on arrays, a bracket for each minimum: SciPy's would do them one by one.
    x1, x2 = low + _GOLDEN * (high - low), high - _GOLDEN * (high - low)
    f1, f2 = value(x1), value(x2)
    for _ in range(24):
        down = f1 <= f2
        high, low = np.where(down, x2, high), np.where(down, low, x1)
        fresh = np.where(down, low + _GOLDEN * (high - low), high - _GOLDEN * (high - low))
        seen = value(fresh)
        x1, x2 = np.where(down, fresh, x2), np.where(down, x1, fresh)
        f1, f2 = np.where(down, seen, f2), np.where(down, f1, seen)
    np.minimum.at(best, owner, np.minimum(f1, f2))
    return np.asarray(1.0 / np.sqrt(best))


def calming_drag(loops: ChainLoops) -> FloatArray:
    """Return the drag beyond which each loop is stable, (n,) [N s/m]; 0 if it needs none.

    Infinite where no drag makes it so.
    """
    found = np.zeros(len(loops))
    bare, unit = loops.with_drag(np.zeros(1)), loops.scale
    more = loops.with_drag(np.array([unit]))

    def parts(rows: IndexArray, omega: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Im(c0 conj c1), zero where C is real, and that C."""
        s = np.asarray(1j * omega, dtype=np.complex128)
        c0 = bare.responses(rows, s)[0]
        c1 = (more.responses(rows, s)[0] - c0) / unit
        both = c0 * c1.conj()
        with np.errstate(all="ignore"):
            return np.asarray(both.imag), np.asarray(-both.real / abs2(c1))

    for at in range(0, len(loops), _STEP):
        rows = np.arange(at, min(at + _STEP, len(loops)))
        omega = frequencies(bare, rows)
        turn, C = parts(rows, omega)
        change = (turn[:, :-1] > 0.0) != (turn[:, 1:] > 0.0)
        # Only what might beat the others: C hardly changes within an interval.
        change &= np.maximum(C[:, :-1], C[:, 1:]) > 0.0
        loop, k = np.nonzero(change)
        low, high = omega[loop, k], omega[loop, k + 1]
        left = turn[loop, k] > 0.0
        for _ in range(_CALMING_ROUNDS):
            if not loop.size:
                break
            middle = 0.5 * (low + high)
            same = (parts(rows[loop], middle[:, None])[0][:, 0] > 0.0) == left
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        if loop.size:
            value = parts(rows[loop], high[:, None])[1][:, 0]
            np.maximum.at(found, rows[loop], np.where(np.isfinite(value), value, 0.0))
        drift = bare.responses(rows, np.zeros(1, dtype=np.complex128))[0][:, 0].real
        found[rows[drift <= 0.0]] = np.inf
    return found
