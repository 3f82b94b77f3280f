"""Quintic Hermite interpolation: a motion between nodes at which all three of its parts are known.

Between two nodes the displacement is the polynomial of fifth degree that has the displacements,
velocities and accelerations of both; velocity and acceleration are its derivatives.  A harmonic of
angular frequency omega is met within (omega h)^6/46080 of its amplitude, with h the distance of
the nodes.  `models.operation.excitation` reads long motions through it, in blocks.
"""

from collections.abc import Callable

import numpy as np

from ..basics import FloatArray

Nodes = Callable[[int, int], FloatArray]
"""Gives displacement, velocity and acceleration (count, 3) of `count` nodes from one on."""

MotionBlock = tuple[FloatArray, FloatArray, FloatArray]
"""Displacement [m], velocity [m/s] and acceleration [m/s2], each (n,)."""

_ROWS_AT_ONCE = 16384


def interpolated(
    nodes: Nodes, last_node: int, node_step: float, step: float
) -> Callable[[int, int], MotionBlock]:
    """Return `Motion.evaluate`, a row each `step` [s], for a motion that is known at nodes.

    Node 0 is at time zero, the others `node_step` apart [s]; no row lies beyond the last.
    """
    ratio = node_step / step
    whole = round(ratio) if abs(ratio - round(ratio)) < 1e-9 * ratio else 0

    # Element by element throughout: a product of matrices may round differently with another
    # number of rows, and a motion has to be the same however it is cut.

    def coefficients(low: int, high: int) -> FloatArray:
        """Return those of 1, u, ... u^5 in the intervals low to high, u from 0 to 1 (6, n)."""
        # An interval that starts at the last node is only asked for its start: what it ends with
        # plays no part.
        values = nodes(low, min(high + 1, last_node) - low + 1).T
        z, v, a = values[:, : high - low + 1]
        after = values[:, 1:]
        if high >= last_node:
            after = np.concatenate([after, values[:, -1:]], axis=1)
        rise = after[0] - z
        v0, v1 = node_step * v, node_step * after[1]
        a0, a1 = 0.5 * node_step**2 * a, 0.5 * node_step**2 * after[2]
        return np.stack(
            [
                z,
                v0,
                a0,
                10.0 * rise - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1,
                -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1,
                6.0 * rise - 3.0 * (v0 + v1) - a0 + a1,
            ]
        )

    def evaluated(c: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        z = ((((c[5] * u + c[4]) * u + c[3]) * u + c[2]) * u + c[1]) * u + c[0]
        v = (((5.0 * c[5] * u + 4.0 * c[4]) * u + 3.0 * c[3]) * u + 2.0 * c[2]) * u + c[1]
        a = ((20.0 * c[5] * u + 12.0 * c[4]) * u + 6.0 * c[3]) * u + 2.0 * c[2]
        return z, v / node_step, a / node_step**2

    def rows(start: int, count: int) -> tuple[FloatArray, ...]:
        if whole:
            # With a whole number of rows to a node all intervals have the same places u.
            low, high = start // whole, (start + count - 1) // whole
            grid = evaluated(coefficients(low, high)[:, :, None], np.arange(whole) / whole)
            skip = start - low * whole
            return tuple(part.reshape(-1)[skip : skip + count] for part in grid)
        clock = np.arange(start, start + count, dtype=np.float64) * (step / node_step)
        index = np.floor(clock + 1e-9).astype(np.int64)
        low, high = int(index[0]), int(index[-1])
        c = coefficients(low, high).take(index - low, axis=1)
        return evaluated(c, clock - index)

    def evaluate(start: int, count: int) -> MotionBlock:
        result = np.empty((3, count))
        for first in range(0, count, _ROWS_AT_ONCE):
            some = min(_ROWS_AT_ONCE, count - first)
            result[:, first : first + some] = rows(start + first, some)
        return result[0], result[1], result[2]

    return evaluate
