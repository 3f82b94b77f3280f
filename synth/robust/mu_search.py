r"""Search for the structured singular value of a loop: from below and from above.

    UncertainLoop -> scalings at frequencies until they prove all of them -> mu at most this
                  -> corners of the box, zeros of det(I - M Delta), local search
                     -> parameters on the boundary -> mu at least this

The proof holds at the ends of intervals, each with one pair of scalings for both, and so for
what lies between as far as the response is smooth there.  What the search finds is a pole on
the axis: of parameters as real as they are, and delays that are delays.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize, root

from models.basics import FloatArray

from ..loop import closed_loop_poles, frequency_grid
from .mu_plant import UncertainLoop
from .mu_structured_value import mu_upper

_PADE = 6
_THIN = 4  # of the grid's nodes, one in so many to begin with
_ENOUGH = 1.01  # an interval within this factor of the highest bound is not looked at again
_MOST_SCALINGS = 300
_NARROW = 1e-7  # relative width of an interval that is not halved
_NEAR_REAL = 0.2  # |Im|/Re of an eigenvalue from which a zero is looked for
_TRIED = 3  # eigenvalues of each corner
_POLISHED = 6  # corners from which the local search begins
_CLOSE = 1e-8  # of |det(I - M Delta)| of a zero
FURTHEST = 20.0  # times the ranges: beyond it nothing is asked
_INSIDE = 0.999
_FAR = 3.0  # in logarithms, of a zero from where it is looked for
_CORNERS = 64  # at most


@dataclass(frozen=True, kw_only=True)
class Critical:
    """Parameters that put a pole on the axis.

    Attributes
    ----------
    size
        Largest |delta| among them: by how many times their ranges they are off.
    omega
        Where the pole is [rad/s].
    delta
        The deltas, in the order of the loop's doubts.
    """

    size: float
    omega: float
    delta: tuple[float, ...]


def grid_of(loop: UncertainLoop) -> FloatArray:
    """Return frequencies dense enough to see the loop and its plant [rad/s]."""
    plant = loop.plant
    poles = closed_loop_poles(plant.without_delays(_PADE), loop.controller)
    open_poles = np.concatenate([plant.poles(), np.linalg.eigvals(loop.controller.A)])
    return frequency_grid(np.concatenate([poles, open_poles]))


def proved_bound(
    loop: UncertainLoop, grid: FloatArray, near: Sequence[float] = (), floor: float = 0.0
) -> tuple[float, float]:
    """Return an upper bound on mu over all frequencies, and where it is reached [rad/s].

    Each interval between two nodes is held by one pair of scalings that proves both its ends;
    where there is none, it is halved.  That finds the peaks of mu for real parameters, which
    may be so narrow that nodes miss them.

    Parameters
    ----------
    loop
        The loop.
    grid
        Frequencies to begin with [rad/s].
    near
        Further frequencies at which mu is known to be large [rad/s].
    floor
        Bound that need not be improved upon: mu is known to be as large, or it does not matter.
    """
    # Row i of the table is what scalings i prove at every node.  An interval is held by the row
    # that is lowest at its worse end; the interval held worst is halved, and gets scalings of its
    # own, which may serve its neighbours too.
    omega = np.unique(np.concatenate([grid[::_THIN], grid[-1:], np.asarray(near)]))
    matrices = loop.matrix(omega)
    first = mu_upper(matrices[int(np.argmin(np.abs(omega - 1.0)))], loop.blocks)
    scalings, table = [first], first.bounds(matrices)[None]
    peak, at_peak = floor, 0.0
    for _ in range(_MOST_SCALINGS):
        ends = np.maximum(table[:, 1:], table[:, :-1])
        held = ends.min(axis=0)
        k = int(np.argmax(held))
        if held[k] <= _ENOUGH * peak:
            break
        low, high = omega[k], omega[k + 1]
        if high / low - 1.0 < _NARROW:
            # As narrow as a step of mu: real parameters alone may make it jump.
            peak, at_peak = float(held[k]), float(low)
            continue
        middle = float(np.sqrt(low * high))
        matrix = loop.matrix(np.array([middle]))
        column = np.array([float(s.bounds(matrix)[0]) for s in scalings])
        best = scalings[int(np.argmin(column))]
        found = mu_upper(matrix[0], loop.blocks, begin=best, enough=peak)
        if found.bound > peak:
            peak, at_peak = found.bound, middle
        omega = np.insert(omega, k + 1, middle)
        matrices = np.insert(matrices, k + 1, matrix, axis=0)
        table = np.insert(table, k + 1, column, axis=1)
        scalings.append(found)
        table = np.vstack([table, found.bounds(matrices)])
    ends = np.maximum(table[:, 1:], table[:, :-1]).min(axis=0)
    k = int(np.argmax(ends))
    return float(max(peak, ends[k])), at_peak if at_peak > 0.0 else float(omega[k])


def critical_point(loop: UncertainLoop, grid: FloatArray) -> Critical | None:
    """Return the nearest parameters that were found to put a pole on the axis; None if none."""
    grid = grid[::_THIN]
    matrices = loop.matrix(grid)
    found: list[Critical] = []
    count = len(loop.doubts)
    corners = list(itertools.product(*((1.0, d.least) for d in loop.doubts)))[:_CORNERS]
    for corner in corners:
        signs = np.array(corner)
        # exp(-i omega tau) - 1 is about -i omega tau; the weight omega is in M.
        late = [-1j * s for s, d in zip(corner, loop.doubts, strict=True) if d.delay]
        diagonal = np.concatenate([loop.spread(signs), late])
        values = np.linalg.eigvals(matrices * diagonal[None, None, :])
        real = np.where(np.abs(values.imag) < _NEAR_REAL * values.real, values.real, 0.0)
        best = real.max(axis=1)
        inner = np.flatnonzero((best[1:-1] >= best[:-2]) & (best[1:-1] >= best[2:])) + 1
        inner = np.append(inner[best[inner] > 0.0], [0] if best[0] > 0.0 else [])
        for at in inner[np.argsort(-best[inner.astype(int)])][:_TRIED].astype(int):
            point = _along(loop, signs, float(grid[at]), 1.0 / float(best[at]))
            if point is not None:
                found.append(point)
    found.sort(key=lambda point: point.size)
    distinct: list[Critical] = []
    for point in found:
        if all(abs(point.size - p.size) > 1e-6 * p.size for p in distinct):
            distinct.append(point)
    polished = [_nearer(loop, point) for point in distinct[:_POLISHED]] if count > 1 else distinct
    return min(polished, key=lambda point: point.size, default=None)


def _along(loop: UncertainLoop, signs: FloatArray, omega: float, size: float) -> Critical | None:
    """Return the zero of the determinant near a frequency along a direction, if there is one."""
    begin = np.log([omega, size])

    def equations(x: FloatArray) -> FloatArray:
        x = begin + np.clip(np.nan_to_num(x - begin), -_FAR, _FAR)
        value = loop.determinant(np.exp(x[:1]), np.exp(x[1]) * signs)[0]
        return np.array([value.real, value.imag])

    with np.errstate(all="ignore"):
        answer = root(equations, begin, method="hybr")
    if not np.all(np.abs(answer.x - begin) < _FAR):
        return None
    found = float(np.exp(answer.x[1]))
    delta = tuple(float(v) for v in found * signs)
    reversed_sign = any(x <= -d.furthest for d, x in zip(loop.doubts, delta, strict=True))
    if np.abs(equations(answer.x)).max() > _CLOSE or found > FURTHEST or reversed_sign:
        return None
    return Critical(size=found, omega=float(np.exp(answer.x[0])), delta=delta)


def _nearer(loop: UncertainLoop, begin: Critical) -> Critical:
    """Return a zero of the determinant with a smaller largest delta, by sequential programming."""
    count = len(begin.delta)
    start = np.concatenate([[np.log(begin.omega), 1.0], np.array(begin.delta) / begin.size])

    def zero(x: FloatArray) -> FloatArray:
        value = loop.determinant(np.exp(x[:1]), begin.size * x[2:])[0]
        return np.array([value.real, value.imag])

    def inside(x: FloatArray) -> FloatArray:
        return np.concatenate([x[1] - x[2:], x[1] + x[2:]])

    bounds = [(float(start[0]) - 1.0, float(start[0]) + 1.0), (0.0, 1.0)]
    bounds += [(max(d.least, -_INSIDE * d.furthest / begin.size), 1.0) for d in loop.doubts]
    constraints: list[dict[str, Any]] = [
        {"type": "eq", "fun": zero},
        {"type": "ineq", "fun": inside},
    ]
    with np.errstate(all="ignore"):
        answer: Any = minimize(  # type: ignore[call-overload]
            lambda x: float(x[1]),
            start,
            jac=lambda x: np.eye(count + 2)[1],
            method="SLSQP",
            bounds=bounds,
            constraints=constraints,
            options={"maxiter": 100, "ftol": 1e-9},
        )
    size = begin.size * float(np.abs(answer.x[2:]).max())
    if not np.all(np.isfinite(answer.x)) or np.abs(zero(answer.x)).max() > _CLOSE:
        return begin
    if size >= begin.size:
        return begin
    delta = tuple(float(v) for v in begin.size * answer.x[2:])
    return Critical(size=size, omega=float(np.exp(answer.x[0])), delta=delta)


def furthest(loop: UncertainLoop) -> float:
    """Return the size of the box in which no value changes its sign, at most `FURTHEST`."""
    return min(FURTHEST, *(d.furthest for d in loop.doubts))
