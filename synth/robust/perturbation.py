r"""Radius of errors of the gains that leave a loop stable, exactly: `gain_radius`.

For a loop affine in its gains, 1 + L = 1 - sum_k g_k phi_k(i omega), a pole can only cross
the axis where this vanishes.  At each frequency that is two real linear equations in the
errors d_k = (g_k - g_k0)/|g_k0|,

.. math::

    A(\omega)\, d = b(\omega), \quad A = [\mathrm{Re}; \mathrm{Im}](|g_k| \phi_k),
    \; b = [\mathrm{Re}; \mathrm{Im}](1 + L)

and the least d that solves them is known in closed form: its length \|A^+ b\|, and, for
errors bounded one by one, max over directions l of l'b / \|A'l\|_1.  The radius is the least
over all frequencies, zero and infinity included (Keel and Bhattacharyya, "Robust, fragile, or
optimal?", IEEE TAC 42, 1997; Bhattacharyya, Chapellat and Keel, *Robust Control: the
Parametric Approach*, 1995, ch. 4).  Delays are exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError
from models.plant import LinearPlant

from ..loop import closed_loop_poles, frequency_grid, refine_minima
from ..structures import ParametrisedController

_AFFINE = 1e-9  # relative size of what would not be affine
_PADE = 6
_FLAT = 1e-9  # ratio of singular values below which a frequency gives one equation


@dataclass(frozen=True, kw_only=True, eq=False)
class GainRadius:
    """The errors of the gains, relative to their sizes, that a stable loop survives."""

    names: tuple[str, ...]  #: The gains that may be off.
    ball: float  #: Root sum of squares of the least errors that reach the stability boundary [-].
    box: float  #: Every gain may be off by less than this share, all at once, in any direction [-].
    #: Where the boundary is first reached in the ball [rad/s]; 0 or infinity for a real pole.
    omega: float
    #: Gains at the boundary, by name: the nearest in the ball, and the nearest in the box.
    worst: Mapping[str, float]
    worst_box: Mapping[str, float]

    def __str__(self) -> str:
        """Return the figures in a line."""
        return (
            f"every gain may be off by {100.0 * self.box:.1f} % at once; the nearest unstable "
            f"gains are {self.ball:.3g} away, at {self.omega:.3g} rad/s"
        )


def gain_radius(
    plant: LinearPlant, law: ParametrisedController, values: Sequence[float]
) -> GainRadius:
    """Return how much the gains of a stable loop may be off: all in which it is affine.

    The plant has one input; with quadratic drag it is at the drag of the design.

    Raises InputError if the plant has several inputs, or the loop is unstable or affine in none.
    """
    if len(plant.inputs) != 1:
        raise InputError(f"gain radius: the plant must have one input, got {len(plant.inputs)}")
    given = np.array([float(v) for v in values])
    poles = closed_loop_poles(plant.without_delays(_PADE), law.controller([*given]))
    if float(poles.real.max(initial=-1.0)) >= 0.0:
        raise InputError("gain radius: the loop must be stable with the gains given")
    known = [p.name for p in law.parameters]
    index = [k for k in range(len(known)) if given[k] != 0.0 and _is_affine(law, given, k, poles)]
    if len(index) > 1 and not _is_affine(law, given, index, poles):
        index = index[:1]
    if not index:
        raise InputError("gain radius: the loop is affine in none of its parameters")
    curve = _Curve(plant, law, given, index)
    grid = frequency_grid(np.concatenate([plant.poles(), poles]))
    late = any(plant.delays)
    ball = _least(curve, grid, box=False, late=late)
    box = _least(curve, grid, box=True, late=late)

    def gains(errors: FloatArray) -> Mapping[str, float]:
        off = given[index] + np.abs(given[index]) * errors
        return MappingProxyType({known[k]: float(v) for k, v in zip(index, off, strict=True)})

    return GainRadius(
        names=tuple(known[k] for k in index),
        ball=ball[0],
        box=box[0],
        omega=ball[1],
        worst=gains(ball[2]),
        worst_box=gains(box[2]),
    )


class _Curve:
    """The rows A d = b of a loop along the frequency axis."""

    def __init__(
        self,
        plant: LinearPlant,
        law: ParametrisedController,
        values: FloatArray,
        index: Sequence[int],
    ) -> None:
        self._plant, self._law, self._values, self._index = plant, law, values, tuple(index)
        self.count = len(self._index)

    def equations(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the columns of A, (k, n), and b, (k,), as complex numbers."""
        heard = self._plant.response_at(s).yu[:, :, 0]
        here = _answer(self._law, self._values, s, heard)
        columns = []
        for k in self._index:
            # Affine: a step of the gain's own size is the derivative, exactly.
            moved = self._values.copy()
            moved[k] += abs(moved[k])
            columns.append(_answer(self._law, moved, s, heard) - here)
        return np.stack(columns, axis=1), 1.0 - here

    def distance(self, omega: FloatArray, *, box: bool) -> FloatArray:
        """Return the size of the least errors that put a pole at i omega, (k,)."""
        columns, b = self.equations(np.asarray(1j * omega, dtype=np.complex128))
        return _sizes(columns, b, box=box)

    def errors(self, omega: float, *, box: bool) -> FloatArray:
        """Return those errors at one frequency."""
        columns, b = self.equations(np.array([1j * omega], dtype=np.complex128))
        return _solution(columns[0], complex(b[0]), box=box)


def _answer(
    law: ParametrisedController, values: FloatArray, s: ComplexArray, heard: ComplexArray
) -> ComplexArray:
    """Return C P_yu = -L, (k,)."""
    entries = law.response([float(v) for v in values], s)[0]
    total = np.zeros(s.size, dtype=np.complex128)
    for j, entry in enumerate(entries):
        total += np.asarray(entry, dtype=np.complex128) * heard[:, j]
    return total


def _is_affine(
    law: ParametrisedController, values: FloatArray, index: int | Sequence[int], poles: ComplexArray
) -> bool:
    """Return whether the controller is affine in some parameters, moved all at once."""
    at = np.abs(poles)
    s = 1j * np.geomspace(max(0.1 * at.min(initial=1.0), 1e-3), 10.0 * at.max(initial=1.0), 9)

    def response(step: float) -> ComplexArray:
        moved = values.copy()
        moved[index] += step * np.abs(moved[index])
        entries = law.response([float(v) for v in moved], s)[0]
        return np.array([np.broadcast_to(np.asarray(e, complex), s.shape) for e in entries])

    first, middle, last = response(0.0), response(0.5), response(1.0)
    size = np.abs(first).max() + np.abs(last).max()
    return bool(np.abs(first - 2.0 * middle + last).max() <= _AFFINE * size)


def _least(
    curve: _Curve, grid: FloatArray, *, box: bool, late: bool
) -> tuple[float, float, FloatArray]:
    """Return the least size over all frequencies, where it is, and the errors."""
    if curve.count == 1:
        found = _isolated(curve, grid)
    else:

        def distance(omega: FloatArray) -> FloatArray:
            return curve.distance(omega, box=box)

        at, size = refine_minima(distance, grid, distance(grid))
        best = int(np.argmin(size))
        found = float(size[best]), float(at[best]), curve.errors(float(at[best]), box=box)
    # A real pole may pass zero or infinity: there is one equation there, found on the real
    # axis.  With a delay nothing real comes from infinity.
    for s, name in ((1e-6 * float(grid[0]), 0.0), (1e6 * float(grid[-1]), np.inf)):
        if late and name > 0.0:
            continue
        columns, b = curve.equations(np.array([s + 0.0j], dtype=np.complex128))
        if not np.any(np.abs(columns[0]) > 1e-12 * (1.0 + abs(b[0]))):
            continue
        end = float(_sizes(columns, b, box=box)[0])
        if end < found[0]:
            found = end, name, _solution(columns[0], complex(b[0]), box=box)
    return found


def _isolated(curve: _Curve, grid: FloatArray) -> tuple[float, float, FloatArray]:
    """Return the same for one gain, which reaches the boundary at single frequencies only."""

    def turn(omega: FloatArray) -> FloatArray:
        columns, b = curve.equations(np.asarray(1j * omega, dtype=np.complex128))
        return np.asarray((b * columns[:, 0].conj()).imag)

    values = turn(grid)
    at = np.flatnonzero((values[:-1] >= 0.0) != (values[1:] >= 0.0))
    if not at.size:
        return np.inf, 0.0, np.full(1, np.nan)
    low, high, left = grid[at], grid[at + 1], values[at]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = (turn(middle) >= 0.0) == (left >= 0.0)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    omega = 0.5 * (low + high)
    columns, b = curve.equations(np.asarray(1j * omega, dtype=np.complex128))
    errors = (b / columns[:, 0]).real
    best = int(np.argmin(np.abs(errors)))
    return float(abs(errors[best])), float(omega[best]), errors[best : best + 1]


def _sizes(columns: ComplexArray, b: ComplexArray, *, box: bool) -> FloatArray:
    """Return the least sizes of d with sum_k d_k columns_k = b, (k,); infinite if there is none."""
    directions = _directions(columns, b, box=box)
    # For every direction l: l'b = l'A d <= size |A'l|, and some direction attains it.
    onto_b = np.abs((directions.conj() * b[:, None]).real)
    onto_a = np.abs((directions.conj()[:, :, None] * columns[:, None, :]).real)
    dual = onto_a.sum(axis=2) if box else np.sqrt((onto_a**2).sum(axis=2))
    scale = np.abs(columns).sum(axis=1)[:, None] + 1e-300
    blind = dual <= _FLAT * scale
    bound = np.where(blind, np.where(onto_b > _FLAT * scale, np.inf, 0.0), 0.0)
    bound = np.where(blind, bound, onto_b / np.where(blind, 1.0, dual))
    return np.asarray(bound.max(axis=1), dtype=np.float64)


def _directions(columns: ComplexArray, b: ComplexArray, *, box: bool) -> ComplexArray:
    """Return the directions in the plane among which the dual's maximum is, (k, m)."""
    if box:
        # The ratio of a linear to a piecewise linear function: at a break, l across a column.
        across = 1j * columns / (np.abs(columns) + 1e-300)
        return np.concatenate([across, (b / (np.abs(b) + 1e-300))[:, None]], axis=1)
    gram = np.empty((len(b), 2, 2))
    gram[:, 0, 0] = (columns.real**2).sum(axis=1)
    gram[:, 1, 1] = (columns.imag**2).sum(axis=1)
    gram[:, 0, 1] = gram[:, 1, 0] = (columns.real * columns.imag).sum(axis=1)
    # l = (A A')^-1 b, up to its length; where A has rank one, along and across it.
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    x = gram[:, 1, 1] * b.real - gram[:, 0, 1] * b.imag
    y = gram[:, 0, 0] * b.imag - gram[:, 0, 1] * b.real
    size = np.hypot(x, y) + 1e-300
    inner = (x + 1j * y) / size
    largest = columns[np.arange(len(b)), np.argmax(np.abs(columns), axis=1)]
    along = largest / (np.abs(largest) + 1e-300)
    flat = determinant <= _FLAT**2 * (gram[:, 0, 0] + gram[:, 1, 1]) ** 2
    return np.stack([np.where(flat, along, inner), np.where(flat, 1j * along, inner)], axis=1)


def _solution(columns: ComplexArray, b: complex, *, box: bool) -> FloatArray:
    """Return the least d with sum_k d_k columns_k = b."""
    matrix, right = np.array([columns.real, columns.imag]), np.array([b.real, b.imag])
    if not box:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=_FLAT)[0], dtype=np.float64)
    from scipy.optimize import linprog

    count = columns.size
    scale = np.abs(matrix).max(axis=1, initial=1e-300)
    kept = scale > _FLAT * scale.max()
    equal = np.hstack([matrix[kept] / scale[kept, None], np.zeros((int(kept.sum()), 1))])
    ones = np.ones((count, 1))
    bounds = np.vstack([np.hstack([np.eye(count), -ones]), np.hstack([-np.eye(count), -ones])])
    answer = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=bounds,
        b_ub=np.zeros(2 * count),
        A_eq=equal,
        b_eq=right[kept] / scale[kept],
        bounds=[(None, None)] * count + [(0.0, None)],
        method="highs",
    )
    if answer.x is None:
        return np.full(count, np.nan)  # nothing reaches the boundary here
    return np.asarray(answer.x[:count], dtype=np.float64)
