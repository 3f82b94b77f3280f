"""Stability margins of a loop from its frequency response, refined until grid-free.

Every margin here is that of a loop that is stable at its nominal gain and delay; whether it
is, `synth.loop.assess` asks of the poles.  Peaks are found on a grid and refined on polynomials
through ever closer nodes, crossings by inverse interpolation, so that no figure depends on the
grid's spacing.  Evaluations are dear one by one and cheap together: all places are looked for at
once, several nodes at a time.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from models.basics import LONGEST_DELAY, BoolArray, ComplexArray, FloatArray

LoopGain = Callable[[FloatArray], ComplexArray]
"""From frequencies [rad/s], (k,), to L there, (k,), or that of n loops, (n, k)."""

_NOTHING = 1e-9  # |L| below which neither a peak nor a crossing matters to any margin
_HIGHER = 1.5  # of the least on the grid: what is higher is not the least between its points
_FLAT = 0.95  # |1 + L| from which S has no peak
_CLOSE, _MOST_STEPS = 1e-13, 50  # relative width of a bracket that is a point; steps towards it
_HAIR = 0.1  # share of a bracket beside the first guess of a crossing in it
_ORDER = 10  # of the polynomials about a minimum
_TABLE = 257  # points at which a polynomial is looked at
_ROUNDS = 12  # each narrows by a factor of three at least: 3^12 is 5e5
_NEARER = 0.95  # share of a least height on the grid below which there may be zeros beside it
_LOOKS = 4  # at ever closer points about such a height
_UNEVEN = 0.7  # share of three points' width of which a parabola through them says little
_LEVEL = 1e-12  # relative depth of a minimum below which it is none
_RESOLVED = 1e-11  # relative size of a polynomial's last terms where it is as good as the function


@dataclass(frozen=True, kw_only=True, eq=False)
class Margins:
    """Margins of a stable loop; for several loops, of the worst one."""

    max_sensitivity: float  #: M_s, the peak of |1/(1+L)|, at `peak` [rad/s].
    peak: float
    gain: float  #: Factor by which the gain may grow; infinity if without bound.
    gain_down: float  #: Factor to which the gain may fall; 0 if all the way.
    phase: float  #: Phase margin, the least at any crossover [rad]; infinity without a crossover.
    delay: float  #: Further delay that makes the loop unstable [s]; infinity without a crossover.
    #: Balanced disk margin alpha, 1/max|S - 1/2| (Seiler, Packard and Gahinet 2020, skew 0).
    disk: float
    #: Where |L| = 1 and where L crosses the negative real axis [rad/s].
    crossovers: FloatArray
    real_axis_crossings: FloatArray

    @property
    def delay_text(self) -> str:
        """The further delay in words; a dash where it is beyond all that a plant has."""
        return f"{1e3 * self.delay:.1f} ms" if self.delay <= LONGEST_DELAY else "-"

    @property
    def most_gain(self) -> str:
        """By how much the gain may grow, in words."""
        return "without bound" if math.isinf(self.gain) else f"x {self.gain:.3g}"

    def __str__(self) -> str:
        """Return the figures as a small tree."""
        return (
            f"Margins\n├ M_s {self.max_sensitivity:.3f} at {self.peak:.3g} rad/s\n"
            f"├ gain x {self.gain_down:.3g} to {self.most_gain}\n"
            f"├ phase {np.degrees(self.phase):.1f} deg\n"
            f"├ delay {self.delay_text}\n└ disk {self.disk:.3f}"
        )


def loop_margins(
    loops: LoopGain,
    grid: FloatArray,
    gains: ComplexArray,
    minima: Sequence[Sequence[tuple[FloatArray, FloatArray]]] | None = None,
    error: float = 0.0,
) -> Margins:
    """Return the margins of `loops`(omega) -> L, known as `gains` on a grid [rad/s].

    L is (k,), or (n, k) of n loops, of which the worst of each figure is told.  `minima` are their
    `least_distances`, where they are known already; the relative error that may be left is by
    default that of rounding.
    """
    gains = np.atleast_2d(gains)
    count, known = len(gains), minima or least_distances(loops, grid, gains, error)

    def heights(at: ComplexArray) -> FloatArray:
        return np.concatenate([np.abs(at) - 1.0, at.imag])

    for _ in range(_LOOKS):
        turns = _turns(grid, heights(gains))
        if not turns.size:
            break
        grid, order = np.unique(np.append(grid, turns), return_index=True)
        gains = np.concatenate([gains, np.atleast_2d(loops(turns))], axis=1)[:, order]
    felt = np.abs(gains) > _NOTHING
    among = np.concatenate([np.ones_like(felt), felt])
    known_there = grid, heights(gains), among, max(error, _CLOSE)
    places = _crossings(lambda w: heights(np.atleast_2d(loops(w))), *known_there)
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
    loops: LoopGain, grid: FloatArray, gains: ComplexArray, error: float = 0.0
) -> list[list[tuple[FloatArray, FloatArray]]]:
    """Return places and values of the local minima of |1 + L| and of 1/|S - 1/2| of each loop.

    Those count that may be the least, and of |1 + L| those where |S| has a peak worth the name.
    """

    def distances(at: ComplexArray) -> FloatArray:
        # |S - 1/2| = |1 - L| / (2 |1 + L|); 1 - L may vanish: the distance is then unbounded, which
        # a least value does not mind.
        own = np.abs(1.0 + at)
        return np.concatenate([own, 2.0 * own / np.maximum(np.abs(1.0 - at), 1e-300)])

    gains = np.atleast_2d(gains)
    on_grid = distances(gains)
    high = np.tile([[_FLAT], [0.0]], (1, len(gains))).reshape(-1, 1)
    worth = on_grid < np.maximum(_HIGHER * on_grid.min(axis=1, keepdims=True), high)
    worth &= np.tile(np.abs(gains) > _NOTHING, (2, 1))
    known = grid, on_grid, worth, max(error, _RESOLVED)
    found = _all_minima(lambda w: distances(np.atleast_2d(loops(w))), *known)
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
    close: float = _RESOLVED,
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
    ends = np.stack([values[which, inner - 1], values[which, inner + 1]])
    sought, stuck = np.arange(inner.size), np.zeros(inner.size, np.bool_)
    for _ in range(_ROUNDS):
        if not sought.size:
            break
        own, width = which[sought], (high - low)[sought]
        nodes = low[sought, None] + width[:, None] * _LOBATTO
        inside = np.empty_like(nodes)
        inside[:, [0, -1]] = ends[:, sought].T
        new = function(nodes[:, 1:-1].ravel()).reshape(len(values), sought.size, -1)
        inside[:, 1:-1] = new[own, np.arange(sought.size)]
        k, before = np.argmin(inside, axis=1), best[sought]
        rows = np.arange(sought.size)
        better = inside[rows, k] < before
        best[sought] = np.where(better, inside[rows, k], before)
        at[sought] = np.where(better, nodes[rows, k], at[sought])
        # To the nodes on either side of the best place.
        left = np.sum(nodes < at[sought, None], axis=1) - 1
        right = np.sum(nodes <= at[sought, None], axis=1)
        left, right = np.maximum(left, 0), np.minimum(right, _ORDER)
        low[sought], high[sought] = nodes[rows, left], nodes[rows, right]
        ends[:, sought] = inside[rows, left], inside[rows, right]
        place, least, error = _vertex(inside)
        resolved = error <= close * np.abs(best[sought])
        done = sought[resolved]
        at[done] = nodes[resolved, 0] + width[resolved] * place[resolved]
        best[done] = np.minimum(best[done], least[resolved])
        # At an edge of the function the grid's own point stays the best.
        edge = ~better & stuck[sought]
        stuck[sought] = ~better
        sought = sought[~resolved & ~edge]
    rest = lower & level
    found = []
    for i, own in enumerate(values):
        others = np.concatenate([np.flatnonzero(rest[i]) + 1, [0, grid.size - 1]])
        mine = which == i
        found.append(
            (np.concatenate([at[mine], grid[others]]), np.concatenate([best[mine], own[others]]))
        )
    return found


def _lobatto() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes between 0 and 1, a matrix from values there to those of a table, and to terms.

    The table holds value, slope, bend and its rate, (4, points, nodes), on even points; the terms
    are the coefficients of the Chebyshev polynomials (Trefethen, *Approximation Theory and
    Approximation Practice*, ch. 3).
    """
    angles = np.arange(_ORDER + 1) * np.pi / _ORDER
    nodes = -np.cos(angles)
    terms: FloatArray = np.linalg.inv(chebyshev.chebvander(nodes, _ORDER)).astype(np.float64)
    points = np.linspace(-1.0, 1.0, _TABLE)
    slopes = [chebyshev.chebder(np.eye(_ORDER + 1), order) for order in range(4)]
    table = [
        chebyshev.chebvander(points, len(d) - 1) @ d @ terms * 2.0**i for i, d in enumerate(slopes)
    ]
    return 0.5 * (1.0 + nodes), np.array(table), terms


_LOBATTO, _TO_TABLE, _TO_TERMS = _lobatto()


def _vertex(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return place (between 0 and 1), height and error of minima of polynomials, (m,) each.

    From their values at the nodes, (m, n).  The error is the size of the last two terms.
    """
    error = np.abs(values @ _TO_TERMS[-2:].T).sum(axis=1)
    k = np.argmin(values @ _TO_TABLE[0].T, axis=1)
    height, slope, bend, rate = np.einsum("imn,mn->im", _TO_TABLE[:, k], values)
    # Halley's step to where the slope is zero, not beyond the next point of the table.
    with np.errstate(all="ignore"):
        step = -2.0 * slope * bend / (2.0 * bend**2 - slope * rate)
    far = 1.0 / (_TABLE - 1)
    step = np.clip(np.nan_to_num(step), -far, far)
    place = np.clip(k * far + step, 0.0, 1.0)
    step = place - k * far
    height = height + step * (slope + step * (0.5 * bend + step * rate / 6.0))
    return place, height, error


def _turns(grid: FloatArray, values: FloatArray) -> FloatArray:
    """Return where functions, (f, k), may cross zero twice between two points of a grid.

    It is the vertex of the parabola through three points of one sign whose middle one is nearest
    to zero, if it is nearer still; where one side is much wider, its middle too.
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
        nearer = inside & (lowest / f1 < _NEARER)
    wide = np.where(x2 - x1 > x1 - x0, x2, x0)
    uneven = nearer & (np.abs(wide - x1) > _UNEVEN * (x2 - x0))
    return np.asarray(np.exp(np.concatenate([(x1 + step)[nearer], 0.5 * (x1 + wide)[uneven]])))


def _crossings(
    function: Callable[[FloatArray], FloatArray],
    grid: FloatArray,
    values: FloatArray,
    among: BoolArray,
    close: float,
) -> list[FloatArray]:
    """Return where several functions, (f, k), change their sign between grid points, of each.

    They are evaluated together, and all places are looked for at once; those count that have an
    end among the points where `among`, (f, k), is true.
    A few nodes at a time: the last guess, a hair to both sides of it, and half way to the farther
    end, so that the bracket is halved at least; the next guess is by inverse interpolation.
    """
    # Zero counts as positive, so that a crossing that falls on a grid point is seen once.
    changed = (values[:, :-1] >= 0.0) != (values[:, 1:] >= 0.0)
    which, at = np.nonzero(changed & (among[:, :-1] | among[:, 1:]))
    low, high = grid[at], grid[at + 1]
    f_low, f_high = values[which, at], values[which, at + 1]
    place = low + (high - low) * f_low / (f_low - f_high)
    hair = _HAIR * (high - low)
    sought = np.flatnonzero((f_low != 0.0) & (f_high != 0.0))
    for _ in range(_MOST_STEPS):
        if not sought.size:
            break
        a, b, x = low[sought], high[sought], place[sought]
        beside = np.minimum(hair[sought], 0.4 * np.minimum(x - a, b - x))
        half = x + 0.5 * np.where(x - a > b - x, a - x, b - x)
        nodes = np.sort([a, x - beside, x, x + beside, half, b], axis=0)
        new = function(nodes[1:-1].ravel()).reshape(len(values), -1, sought.size)
        rows = np.arange(sought.size)
        f = np.vstack([f_low[sought], new[which[sought], :, rows].T, f_high[sought]])
        first = np.argmax((f[1:] >= 0.0) != (f[:-1] >= 0.0), axis=0)
        a, b = nodes[first, rows], nodes[first + 1, rows]
        low[sought], high[sought] = a, b
        f_low[sought], f_high[sought] = f[first, rows], f[first + 1, rows]
        guess, error = _inverse(nodes, f)
        line = a + (b - a) * f_low[sought] / (f_low[sought] - f_high[sought])
        inside = (a <= guess) & (guess <= b)
        place[sought] = np.where(inside, guess, line)
        hair[sought] = np.where(inside, np.maximum(error, close * b), _HAIR * (b - a))
        there = (inside & (error <= close * b)) | (b - a <= close * b)
        sought = sought[~there]
    return [place[which == i] for i in range(len(values))]


def _inverse(nodes: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where functions vanish by inverse interpolation, and how well that is known.

    From values at nodes, (n, m); by Neville's scheme.
    """
    guess, before = nodes, nodes
    with np.errstate(all="ignore"):
        for k in range(1, len(nodes)):
            low, high = values[:-k], values[k:]
            before, guess = guess, (high * guess[:-1] - low * guess[1:]) / (high - low)
        return guess[0], np.abs(before - guess).min(axis=0)


def level_ends(gain: ComplexArray) -> BoolArray:
    """Return at which ends of a grid L is on the real axis (a finite DC gain), (2,)."""
    ends = gain[[0, -1]]
    return np.asarray((np.abs(ends) > 1e-6) & (np.abs(ends.imag) < 1e-3 * np.abs(ends)))
