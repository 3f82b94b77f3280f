r"""Unstable poles, peak of |S| and calming drag of many loops at once, by their phase.

The function `closed` has the loop's poles as its zeros and no pole in the right half plane.  Up
the imaginary axis from 0 to iR its phase changes by so much, along the arc from R to iR by so
much, and the difference is pi for every zero that the two enclose with the real axis, its mirror
image counted with it (argument principle; Nyquist 1932).  R is so large that the loop gain is
small on the arc and, by the maximum principle, beyond it.

All loops begin on one grid, eight points for each axial mode of the rope; where phase or size
of `closed`, and of `open` where M_s is wanted, jumps between neighbours, the interval is halved,
for all loops in one call, as `synth.verify.winding.trace` does for one.  So delays, waves and light
damping are followed exactly; a phase that cannot be followed means a pole on the axis, and counts
as unstable.  M_s is the largest |open/closed| of the same points, its place refined.

From which linear drag on a loop is stable (`calming_drag`): the characteristic function is affine
in the drag, closed = c0 + C c1, so a pole is on the axis at i omega for the C that makes it zero
there, C = -c0/c1, wherever that is real and positive.  The largest of them is the boundary: with
more drag no pole is on the axis any more, and with drag without end the payload stands still and
the loop is open, which is stable.  All but a slow drift: where closed(0) is not above zero, a real
pole is in the right half plane whatever the drag.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import elementwise

from models.basics import BoolArray, ComplexArray, FloatArray, IndexArray

from .chain import ChainLoops, abs2

_TURN, _GROWTH = 0.5, np.exp(2.0)  # largest steps of phase [rad] and of the size's square
_PER_DECADE, _PER_MODE = 24, 8
_LOW = 1e-4  # first frequency above zero [rad/s]
_ZERO = 1e-12 + 0.0j  # just right of a pole at zero [1/s]
_ARC = 25
_ROUNDS = 46  # of halving: then the interval is a rounding error wide
_NARROW = 1e-12  # ... or where size alone cannot be followed
_SMALL = 0.5  # loop gain on the arc
_STEP = 512  # loops at once
_VERTICES = 12  # of parabolas through the lowest points of a minimum
_SOUGHT = 4  # light poles of one loop
_NEAR = 1.5  # local minima up to so much above the least are looked into


class _Path(NamedTuple):
    """What following loops along points gave.

    `turn` is by how much the phase of `closed` changes for each loop, (m,) [rad], NaN where it
    cannot be followed; `loop`, `s` and `size` are all points looked at, and |closed/open|^2
    there; `before` and `after` say which points are beside each.
    """

    turn: FloatArray
    loop: IndexArray
    s: ComplexArray
    size: FloatArray
    before: IndexArray
    after: IndexArray


def survey(
    loops: ChainLoops, rows: IndexArray | None = None, *, peaks: bool = True
) -> tuple[IndexArray, FloatArray]:
    """Return how many poles loops have in the right half plane, and their M_s, (m,) each.

    The count is -1 where a pole is on the axis; M_s = max 1/|1 + L| is that of any loop, stable or
    not.  It is of some `rows` of the loops, by default all.  Without `peaks` M_s is NaN, and what
    stands in its way need not be followed.
    """
    chosen = np.arange(len(loops)) if rows is None else rows
    count = np.empty(chosen.size, dtype=np.intp)
    found = np.full(chosen.size, np.nan)
    for at in range(0, chosen.size, _STEP):
        part = slice(at, at + _STEP)
        count[part], found[part] = _surveyed(loops, chosen[part], peaks)
    return count, found


def light_poles(loops: ChainLoops, row: int) -> ComplexArray:
    """Return the poles of one loop that its |1 + L| is least near, the upper half [1/s].

    Newton's rule from the lowest minima along the imaginary axis.
    """
    rows = np.array([row])
    omega = frequencies(loops, rows)
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


def frequencies(loops: ChainLoops, rows: IndexArray) -> FloatArray:
    """Return frequencies of some loops between which little happens, (k,) [rad/s], ascending."""
    return _grid(loops, rows, _radius(loops, rows))


def _surveyed(loops: ChainLoops, rows: IndexArray, peaks: bool) -> tuple[IndexArray, FloatArray]:
    # The first quadrant's contour: up the imaginary axis, and along the arc from the real one, on
    # which `closed` is real and its phase takes no part.
    radius = _radius(loops, rows)
    axis = np.append(_ZERO, _imaginary(_grid(loops, rows, radius)))
    turn = np.linspace(0.0, 0.5 * np.pi, _ARC)
    up = _follow(loops, rows, axis, both=peaks)
    arc = _follow(loops, rows, radius * np.exp(1j * turn), around=True)
    zeros = (arc.turn - up.turn) / np.pi
    with np.errstate(invalid="ignore"):
        count = np.where(np.abs(zeros - np.round(zeros)) < 0.05, np.round(zeros), -1.0)
    highest = _highest(loops, rows, up) if peaks else np.full(rows.size, np.nan)
    return count.astype(np.intp), highest


def _radius(loops: ChainLoops, rows: IndexArray) -> float:
    """Return a radius on which, and beyond, the gains of some loops are small [1/s]."""
    directions = np.exp(1j * np.linspace(0.0, 0.5 * np.pi, 9))
    directions = np.append(directions, 1j * np.geomspace(1.0, 30.0, 13)[1:])
    spacing = float(np.max(loops.mode_spacing))
    radius = max(100.0, 2.0 * spacing * loops.masses, 2.0 * loops.law.swiftest)
    large = rows
    for _ in range(30):
        with np.errstate(over="ignore", invalid="ignore"):
            closed, free = loops.responses(large, np.asarray(radius * directions))
            gain = np.abs(closed / free - 1.0).max(axis=1)
        large = large[~(gain < _SMALL)]
        if not large.size:
            break
        radius *= 2.0
    return radius


def _grid(loops: ChainLoops, rows: IndexArray, radius: float) -> FloatArray:
    """Return frequencies up to the radius, (k,) [rad/s]: by decades, and by modes."""
    count = int(_PER_DECADE * np.log10(radius / _LOW)) + 2
    spacing = np.broadcast_to(loops.mode_spacing, (len(loops),))[rows]
    step = float(spacing.min()) / _PER_MODE
    last = min(loops.masses * float(spacing.max()), radius)
    modes = np.arange(step, last + step, step)
    return np.unique([*np.geomspace(_LOW, radius, count), *modes[modes < radius]])


def _imaginary(omega: FloatArray) -> ComplexArray:
    return np.asarray(1j * omega, dtype=np.complex128)


def _follow(
    loops: ChainLoops,
    rows: IndexArray,
    points: ComplexArray,
    *,
    both: bool = False,
    around: bool = False,
) -> _Path:
    """Follow `closed` of each loop along points, (k,), and `open` too if `both`.

    `around` halves intervals along an arc about the origin.
    """
    every = np.arange(rows.size * points.size)
    seen = [(every // points.size, np.tile(points, rows.size), every - 1, every + 1)]
    marks = np.stack([_marks(v) for v in loops.responses(rows, points)], axis=1)
    sizes = [(marks[1, 0] / marks[1, 1]).ravel()]
    turn, smooth = _steps(marks[..., :-1], marks[..., 1:])
    total = np.where(smooth[0], turn, 0.0).sum(axis=1)
    # All intervals of all loops that are not smooth are halved in one call, until none is left.
    loop, k = np.nonzero(~(smooth[0] & smooth[1]) if both else ~smooth[0])
    due = ~smooth[0, loop, k]  # whether their turn is yet to be counted
    ends = np.stack([loop * points.size + k, loop * points.size + k + 1])
    a, b, at_a, at_b = points[k], points[k + 1], marks[..., loop, k], marks[..., loop, k + 1]
    beside, count = [], every.size
    for _ in range(_ROUNDS):
        if not loop.size:
            break
        middle = 0.5 * (a + b)
        if around:
            middle *= np.abs(a) / np.abs(middle)
        here = [_marks(v[:, 0]) for v in loops.responses(rows[loop], middle[:, None])]
        at_middle, own = np.stack(here, axis=1), count + np.arange(loop.size)
        count += loop.size
        seen.append((loop, middle, *ends))
        sizes.append(at_middle[1, 0] / at_middle[1, 1])
        loop, due = np.concatenate([loop, loop]), np.concatenate([due, due])
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        at_a = np.concatenate([at_a, at_middle], axis=-1)
        at_b = np.concatenate([at_middle, at_b], axis=-1)
        ends = np.stack([np.append(ends[0], own), np.append(own, ends[1])])
        turn, smooth = _steps(at_a, at_b)
        counted = due & smooth[0]
        np.add.at(total, loop[counted], turn[counted])
        due &= ~smooth[0]
        wide = np.abs(b - a) > _NARROW * np.abs(b)
        rest = due | (~smooth[1] & wide) if both else due
        beside.append(ends[:, ~rest])
        loop, due, a, b, ends = loop[rest], due[rest], a[rest], b[rest], ends[:, rest]
        at_a, at_b = at_a[..., rest], at_b[..., rest]
    total[loop[due]] = np.nan
    loop, s, before, after = (np.concatenate(column) for column in zip(*seen, strict=True))
    for one, other in [*beside, ends]:
        after[one], before[other] = other, one
    return _Path(total, loop, s, np.concatenate(sizes), before, after)


def _marks(values: ComplexArray) -> FloatArray:
    """Return phases and squared sizes of values, (2, ..)."""
    return np.stack([np.arctan2(values.imag, values.real), abs2(values)])


def _steps(one: FloatArray, other: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the phase step of the first function between neighbours, and what is followed.

    Both are of marks (2, functions, ..); a function is followed where phase and size hardly move.
    """
    with np.errstate(all="ignore"):
        turn = other[0] - one[0]
        turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        growth = other[1] / one[1]
        smooth = (np.abs(turn) <= _TURN) & (growth <= _GROWTH) & (growth >= 1.0 / _GROWTH)
    return turn[0], smooth


def _highest(loops: ChainLoops, rows: IndexArray, path: _Path) -> FloatArray:
    """Return 1/min|1 + L| of each loop from the points of a path, the lowest minima refined."""
    omega = path.s.imag
    size = np.where(np.isfinite(path.size) & (path.s.real == 0.0), path.size, np.inf)
    best = np.full(rows.size, np.inf)
    np.minimum.at(best, path.loop, size)
    inner = np.flatnonzero((omega > 0.0) & (size <= _NEAR**2 * best[path.loop]))
    inner = inner[path.after[inner] < path.loop.size]
    left, right = path.before[inner], path.after[inner]
    least = (size[left] >= size[inner]) & (size[right] >= size[inner])
    least &= (path.loop[left] == path.loop[right]) & (omega[left] > 0.0)
    at, left, right = inner[least], left[least], right[least]
    owner = path.loop[at]
    a, b, c = (omega[k] for k in (left, at, right))
    fa, fb, fc = (size[k] for k in (left, at, right))
    # The vertex of the parabola through three points; where there is none, and every third time,
    # the longer side is halved.  SciPy's own, on arrays, makes a survey a fifth slower.
    for turn in range(_VERTICES):
        with np.errstate(all="ignore"):
            one, other = (b - a) * (fb - fc), (b - c) * (fb - fa)
            fresh = b - 0.5 * ((b - a) * one - (b - c) * other) / (one - other)
            halves = np.where(c - b > b - a, 0.5 * (b + c), 0.5 * (a + b))
            sound = (fresh > a) & (fresh < c) & (fresh != b) & (turn % 3 != 2)
            fresh = np.where(sound, fresh, halves)
            closed, free = loops.responses(rows[owner], _imaginary(fresh[:, None]))
            seen = (abs2(closed) / abs2(free))[:, 0]
        lower, below = seen < fb, fresh < b
        # What lies higher becomes the end on its side of what lies lower.
        low, high = np.where(lower, fresh, b), np.where(lower, b, fresh)
        f_low, f_high = np.where(lower, seen, fb), np.where(lower, fb, seen)
        below = below != lower
        a, fa = np.where(below, high, a), np.where(below, f_high, fa)
        c, fc = np.where(below, c, high), np.where(below, fc, f_high)
        b, fb = low, f_low
    np.minimum.at(best, owner, fb)
    return np.asarray(1.0 / np.sqrt(best))


def calming_drag(loops: ChainLoops) -> FloatArray:
    """Return the drag beyond which each loop is stable, (n,) [N s/m]; 0 if it needs none.

    Infinite where no drag makes it so.
    """
    found = np.zeros(len(loops))
    bare = loops.with_drag(np.zeros(1))

    def parts(rows: IndexArray, omega: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Im(c0 conj c1), zero where C is real, and that C."""
        c0, c1 = loops.of_drag(rows, _imaginary(omega))
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
        if loop.size:

            def apart(w: FloatArray, own: FloatArray) -> FloatArray:
                return parts(own.astype(np.intp), w[:, None])[0][:, 0]

            ends = omega[k], omega[k + 1]
            edge = elementwise.find_root(apart, ends, args=(rows[loop].astype(np.float64),))
            value = parts(rows[loop], np.asarray(edge.x)[:, None])[1][:, 0]
            np.maximum.at(found, rows[loop], np.where(np.isfinite(value), value, 0.0))
        drift = bare.responses(rows, np.array([_ZERO]))[0][:, 0].real
        found[rows[drift <= 0.0]] = np.inf
    return found
