"""Stability margins of a loop from its frequency response, refined until grid-free.

Every margin here is that of a loop that is stable at its nominal gain and delay; whether it
is, `synth.loop.assess` asks of the poles.  Peaks are found on a grid and refined by zooming,
crossings by bisection, so that no figure depends on the grid's spacing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import BoolArray, ComplexArray, FloatArray

LoopGain = Callable[[FloatArray], ComplexArray]
"""From frequencies [rad/s], (k,), to L there, (k,), or that of n loops, (n, k)."""

_NOTHING = 1e-9  # |L| below which neither a peak nor a crossing matters to any margin
_CLOSE, _MOST_STEPS = 1e-14, 60  # relative width of a bracket that is a point; steps towards it
_ZOOM = np.linspace(0.0, 1.0, 17)
_ROUNDS = 7  # each zooms by a factor of eight: 8^7 is 2e6
_NEARER = 0.5  # share of a least height on the grid below which there may be zeros beside it
_LEVEL = 1e-12  # relative depth of a minimum below which it is none
_FORETOLD = 1e-11  # relative error of a parabola that the next round makes as good as exact
_ROUNDING = 1e-15  # relative, of a value


@dataclass(frozen=True, kw_only=True, eq=False)
class Margins:
    """Margins of a stable loop; for several loops, of the worst one.

    Attributes
    ----------
    max_sensitivity
        M_s, the peak of |1/(1+L)|, at `peak` [rad/s].
    gain
        Factor by which the gain may grow; infinity if without bound.
    gain_down
        Factor to which the gain may fall; 0 if all the way.
    phase
        Phase margin, the least at any crossover [rad]; infinity without a crossover.
    delay
        Further delay that makes the loop unstable [s]; infinity without a crossover.
    disk
        Balanced disk margin alpha, 1/max|S - 1/2| (Seiler, Packard and Gahinet 2020, skew 0).
    crossovers, real_axis_crossings
        Where |L| = 1 and where L crosses the negative real axis [rad/s].
    """

    max_sensitivity: float
    peak: float
    gain: float
    gain_down: float
    phase: float
    delay: float
    disk: float
    crossovers: FloatArray
    real_axis_crossings: FloatArray

    def __str__(self) -> str:
        """Return the figures as a small tree."""
        return (
            f"Margins\n├ M_s {self.max_sensitivity:.3f} at {self.peak:.3g} rad/s\n"
            f"├ gain x {self.gain_down:.3g} .. {self.gain:.3g}\n"
            f"├ phase {np.degrees(self.phase):.1f} deg\n"
            f"├ delay {self.delay * 1e3:.1f} ms\n└ disk {self.disk:.3f}"
        )


def loop_margins(
    loops: LoopGain,
    grid: FloatArray,
    gains: ComplexArray,
    minima: Sequence[Sequence[tuple[FloatArray, FloatArray]]] | None = None,
) -> Margins:
    """Return the margins of `loops`(omega) -> L, known as `gains` on a grid [rad/s].

    L is (k,), or (n, k) of n loops, of which the worst of each figure is told.  `minima` are their
    `least_distances`, where they are known already.
    """
    gains = np.atleast_2d(gains)
    count, known = len(gains), minima or least_distances(loops, grid, gains)

    def heights(at: ComplexArray) -> FloatArray:
        return np.concatenate([np.abs(at) - 1.0, at.imag])

    turns = _turns(grid, heights(gains))
    grid, order = np.unique(np.append(grid, turns), return_index=True)
    gains = np.concatenate([gains, np.atleast_2d(loops(turns))], axis=1)[:, order]
    felt = np.abs(gains) > _NOTHING
    among = np.concatenate([np.ones_like(felt), felt])
    places = _crossings(lambda w: heights(np.atleast_2d(loops(w))), grid, heights(gains), among)
    for i in range(count):
        places[count + i] = np.append(places[count + i], grid[[0, -1]][level_ends(gains[i])])
    # All loops where any of them is asked for.
    ends = np.cumsum([at.size for at in places])
    there = np.split(np.atleast_2d(loops(np.concatenate(places))), ends[:-1], axis=1)
    return worst_margins(
        [
            _margins(known[i], places[i], there[i][i], places[count + i], there[count + i][i].real)
            for i in range(count)
        ]
    )


def _margins(
    minima: Sequence[tuple[FloatArray, FloatArray]],
    crossovers: FloatArray,
    on_circle: ComplexArray,
    axis: FloatArray,
    on_axis: FloatArray,
) -> Margins:
    """Return the margins of a loop: L at its crossovers and where it meets the real axis."""
    (peak_at, distance), (_, disk) = minima
    turn = np.angle(-on_circle)  # angle beyond -180 deg
    negative = on_axis < 0.0
    above, below = on_axis[negative & (on_axis > -1.0)], on_axis[negative & (on_axis < -1.0)]
    return Margins(
        max_sensitivity=float(1.0 / distance.min()),
        peak=float(peak_at[np.argmin(distance)]),
        gain=float(np.min(-1.0 / above)) if above.size else np.inf,
        gain_down=float(np.max(-1.0 / below)) if below.size else 0.0,
        phase=float(np.abs(turn).min(initial=np.inf)),
        delay=float((np.mod(turn, 2.0 * np.pi) / crossovers).min(initial=np.inf)),
        disk=float(disk.min()),
        crossovers=crossovers,
        real_axis_crossings=axis[negative],
    )


def worst_margins(margins: list[Margins]) -> Margins:
    """Return the worst of each figure over several loops."""
    if len(margins) == 1:
        return margins[0]
    peak = max(margins, key=lambda m: m.max_sensitivity)
    return Margins(
        max_sensitivity=peak.max_sensitivity,
        peak=peak.peak,
        gain=min(m.gain for m in margins),
        gain_down=max(m.gain_down for m in margins),
        phase=min(m.phase for m in margins),
        delay=min(m.delay for m in margins),
        disk=min(m.disk for m in margins),
        crossovers=np.sort(np.concatenate([m.crossovers for m in margins])),
        real_axis_crossings=np.sort(np.concatenate([m.real_axis_crossings for m in margins])),
    )


def least_distances(
    loops: LoopGain, grid: FloatArray, gains: ComplexArray
) -> list[list[tuple[FloatArray, FloatArray]]]:
    """Return places and values of the local minima of |1 + L| and of 1/|S - 1/2| of each loop."""

    def distances(at: ComplexArray) -> FloatArray:
        # |S - 1/2| = |1 - L| / (2 |1 + L|); 1 - L may vanish: the distance is then unbounded, which
        # a least value does not mind.
        own = np.abs(1.0 + at)
        return np.concatenate([own, 2.0 * own / np.maximum(np.abs(1.0 - at), 1e-300)])

    gains = np.atleast_2d(gains)
    felt = np.tile(np.abs(gains) > _NOTHING, (2, 1))
    found = _all_minima(lambda w: distances(np.atleast_2d(loops(w))), grid, distances(gains), felt)
    return [[found[i], found[len(gains) + i]] for i in range(len(gains))]


def refine_minima(
    function: Callable[[FloatArray], FloatArray],
    grid: FloatArray,
    values: FloatArray,
    among: BoolArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return places and values of all local minima of `function`, refined from a grid.

    The ends of the grid count as minima, and so does what is level to rounding, as it is.  Where
    `among` is given, the others of the grid's points are no minima worth it.
    """
    return _all_minima(lambda w: function(w)[None], grid, values[None], among)[0]


def _all_minima(
    function: Callable[[FloatArray], FloatArray],
    grid: FloatArray,
    values: FloatArray,
    among: BoolArray | None,
) -> list[tuple[FloatArray, FloatArray]]:
    """Return `refine_minima` of each of several functions, (f, k), that are evaluated together.

    All brackets are zoomed into at once, so the functions are called a handful of times with long
    vectors.
    """
    centre, beside = values[:, 1:-1], np.array([values[:, :-2], values[:, 2:]])
    lower = (centre <= beside.min(axis=0)) & (True if among is None else among[..., 1:-1])
    level = beside.max(axis=0) - centre <= _LEVEL * np.abs(centre)
    which, inner = np.nonzero(lower & ~level)
    inner = inner + 1
    best, at = values[which, inner], grid[inner]
    low, high = grid[inner - 1], grid[inner + 1]
    rows, foretold, known = np.arange(inner.size), np.zeros(inner.size, np.bool_), best + 1.0
    for _ in range(_ROUNDS if inner.size else 0):
        settled, before = foretold, known  # one round more makes the place as good as the value
        nodes = low[:, None] + (high - low)[:, None] * _ZOOM
        inside = function(nodes.ravel()).reshape(-1, *nodes.shape)[which, rows]
        k = np.argmin(inside, axis=1)
        middle = np.clip(k, 1, _ZOOM.size - 2)
        low, high = nodes[rows, middle - 1], nodes[rows, middle + 1]
        # The vertex of the parabola through the best node and its neighbours, and how well the
        # function is foretold there: a smooth minimum is found in two or three rounds.
        left, mid, right = (inside[rows, middle + i] for i in (-1, 0, 1))
        bend = left - 2.0 * mid + right
        # Clipped before the division, which would overflow where the nodes are all but level.
        reach = 2.0 * np.maximum(bend, 0.0)
        step = np.clip(left - right, -reach, reach) / np.where(reach > 0.0, reach, 1.0)
        vertex = nodes[rows, middle] + step * 0.5 * (high - low)
        lowest = function(vertex)[which, rows]
        known = best
        for place, value in ((nodes[rows, k], inside[rows, k]), (vertex, lowest)):
            better = value < best
            best, at = np.where(better, value, best), np.where(better, place, at)
        error = np.abs(lowest - mid + 0.5 * bend * step**2)
        foretold = settled | (error <= _FORETOLD * np.abs(lowest))
        at = np.where(foretold & (lowest <= best * (1.0 + _ROUNDING)), vertex, at)
        # At an edge of the function the grid's own point stays the best.
        if np.all(settled | (best == before)):
            break
    rest = lower & level
    found = []
    for i, own in enumerate(values):
        others = np.concatenate([np.flatnonzero(rest[i]) + 1, [0, grid.size - 1]])
        mine = which == i
        found.append(
            (np.concatenate([at[mine], grid[others]]), np.concatenate([best[mine], own[others]]))
        )
    return found


def _turns(grid: FloatArray, values: FloatArray) -> FloatArray:
    """Return where functions, (f, k), may cross zero twice between two points of a grid.

    It is the vertex of the parabola through three points of one sign whose middle one is nearest
    to zero, if it is much nearer still.
    """
    left, mid, right = values[:, :-2], values[:, 1:-1], values[:, 2:]
    size = np.abs(mid)
    nearest = (left * mid > 0.0) & (right * mid > 0.0) & (size < np.minimum(abs(left), abs(right)))
    which, at = np.nonzero(nearest)
    x0, x1, x2 = (np.log(grid[at + i]) for i in range(3))
    f0, f1, f2 = (values[which, at + i] for i in range(3))
    # Newton's form: f1 + (first) (x - x1) + bend (x - x1) (x - x0); what is level to rounding has
    # no vertex.
    with np.errstate(all="ignore"):
        first = (f1 - f0) / (x1 - x0)
        bend = ((f2 - f1) / (x2 - x1) - first) / (x2 - x0)
        step = -0.5 * (first + bend * (x1 - x0)) / bend
        lowest = f1 + step * (first + bend * (x1 - x0) + bend * step)
        inside = (x0 < x1 + step) & (x1 + step < x2)
        return np.asarray(np.exp((x1 + step)[inside & (lowest / f1 < _NEARER)]))


def _crossings(
    function: Callable[[FloatArray], FloatArray],
    grid: FloatArray,
    values: FloatArray,
    among: BoolArray,
) -> list[FloatArray]:
    """Return where several functions, (f, k), change their sign between grid points, of each.

    They are evaluated together, and all places are looked for at once; those count that have an
    end among the points where `among`, (f, k), is true.
    By Chandrupatla's method (Adv. Eng. Software 28, 1997): inverse quadratic interpolation
    where it is safe, bisection elsewhere.
    """
    # Zero counts as positive, so that a crossing that falls on a grid point is seen once.
    changed = (values[:, :-1] >= 0.0) != (values[:, 1:] >= 0.0)
    which, at = np.nonzero(changed & (among[:, :-1] | among[:, 1:]))
    rows = np.arange(at.size)
    a, b = grid[at + 1], grid[at]  # a is the latest point
    fa, fb = values[which, at + 1], values[which, at]
    step = np.full(at.size, 0.5)
    for _ in range(_MOST_STEPS):
        width = np.abs(b - a)
        smallest = _CLOSE * np.abs(a)
        if not np.any((width > smallest) & (fa != 0.0)):
            break
        least = np.minimum(0.5, smallest / np.maximum(width, smallest))
        x = a + np.clip(step, least, 1.0 - least) * (b - a)
        fx = function(x)[which, rows]
        same = (fx >= 0.0) == (fa >= 0.0)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        with np.errstate(divide="ignore", invalid="ignore"):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            inverse = fa / (fb - fa) * fc / (fb - fc)
            inverse += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        step = np.where((phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi), inverse, 0.5)
    nearest = np.asarray(np.where(np.abs(fa) <= np.abs(fb), a, b))
    return [nearest[which == i] for i in range(len(values))]


def level_ends(gain: ComplexArray) -> BoolArray:
    """Return at which ends of a grid L is on the real axis (a finite DC gain), (2,)."""
    ends = gain[[0, -1]]
    return np.asarray((np.abs(ends) > 1e-6) & (np.abs(ends.imag) < 1e-3 * np.abs(ends)))
