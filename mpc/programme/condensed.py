r"""The condensed quadratic programme: every state of the horizon eliminated, the moves blocked.

.. math::

    \min_v \; \tfrac12 v' H v + f' v \quad \text{subject to} \quad
    l \le v \le u, \quad \underline r \le R v + r_0 \le \overline r \ \text{(soft)},

with the inputs d held over blocks of samples (`mpc.programme.horizon`), the cost that of the
regulator (`mpc.programme.regulator`),

.. math::

    J = \sum_{j=1}^{N-1} p_j^2 + \rho \sum_{j=0}^{N-1} (d_j - d_\infty c)^2
        + x_N' P x_N + 2 x_N' N_\zeta \zeta_N ,

and everything divided by N times a scale.  Gradient f and free response r_0 are linear in what is
known at the sample: the plant's state x, the constants c, and the path w of the disturbance at
the N + 1 samples of the horizon.  All products that do not change are made here, once.

zeta_N holds the state of the disturbance's own model at the end of the horizon, where the path ends
and that model goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, ReadOnlyArrays

from .horizon import Horizon
from .regulator import LQRegulator

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Condensed(ReadOnlyArrays):
    """Matrices of the programme; `condense` makes it.

    Attributes
    ----------
    horizon
        Plant, blocks and unit of the moves.
    H
        (nb, nb), per unit of a move.
    from_state, from_path, from_constants, from_end
        Gradient f of the plant's state, of the path, of the constants, and of the disturbance's
        state at the end of the horizon, (nb, nx), (nb, nw (N + 1)), (nb, nc), (nb, nh).
    at
        Sample of each row, (nr,).
    kind
        What each row is: a number of the caller's, (nr,).
    rows, rows_state, rows_path, rows_constants
        R and r_0, (nr, nb), (nr, nx), (nr, nw (N + 1)), (nr, nc).
    speeds
        Signal on which the bounds of the moves depend (the motor's speed) at the start of each
        block, by the horizon's columns, (nb, columns).
    cost
        What the cost is divided by.
    """

    horizon: Horizon
    H: FloatArray
    from_state: FloatArray
    from_path: FloatArray
    from_constants: FloatArray
    from_end: FloatArray
    at: IntArray
    kind: IntArray
    rows: FloatArray
    rows_state: FloatArray
    rows_path: FloatArray
    rows_constants: FloatArray
    speeds: FloatArray
    cost: float

    @property
    def blocks(self) -> tuple[int, ...]:
        """Length of each block in samples, (nb,)."""
        return self.horizon.blocks

    @property
    def unit(self) -> float:
        """Input of a move of one."""
        return self.horizon.unit

    @property
    def steps(self) -> int:
        """Number of samples N of the horizon."""
        return self.horizon.steps


def condense(
    horizon: Horizon,
    regulator: LQRegulator,
    *,
    output: FloatArray,
    scale: float,
    speed: FloatArray,
    signals: Callable[[int, FloatArray], Iterable[tuple[int, FloatArray]]],
) -> Condensed:
    """Return the matrices of the programme.

    Parameters
    ----------
    horizon
        Plant and blocks.
    regulator
        Weight of the input, and the value function that ends the horizon; the constants are the
        last of its disturbance.
    output
        Row of the state whose square is the cost, (n,).
    scale
        What the cost of a sample is divided by.
    speed
        Row of the state on which the bounds of the moves depend, (n,).
    signals
        Gives (kind, row of the columns) of what may be limited at sample j, of j and x_j.
    """
    constants, moves = horizon.constants, horizon.moves
    N, nb = horizon.steps, len(horizon.blocks)
    H, gradient = np.zeros((nb, nb)), np.zeros((nb, moves.start))
    rows, at, kind, speeds = [], [], [], []
    starts = set(horizon.starts)
    for j, S in enumerate(horizon.states()):
        if 0 < j < N:  # the first is past, and the last in the value function
            p = output @ S
            H += np.outer(p[moves], p[moves])
            gradient += np.outer(p[moves], p[: moves.start])
        for which, row in signals(j, S):
            rows.append(row)
            at.append(j)
            kind.append(which)
        if j in starts:
            speeds.append(speed @ S)
    lengths = np.array(horizon.blocks, dtype=np.float64)
    nc = constants.stop - constants.start
    nh = regulator.N.shape[1] - nc
    # The input is weighed as it differs from what holds the output against the constants.
    H += regulator.weight * horizon.unit**2 * np.diag(lengths)
    steady = regulator.steady[nh:]
    gradient[:, constants] -= regulator.weight * horizon.unit * np.outer(lengths, steady)
    # The rest of the cost, from the horizon's end to infinity, is the regulator's value function.
    end = S[:, moves]
    H += end.T @ regulator.P @ end
    gradient += end.T @ regulator.P @ S[:, : moves.start]
    gradient[:, constants] += end.T @ regulator.N[:, nh:]

    cost = N * scale
    G = np.array(rows).reshape(len(rows), moves.stop)
    return Condensed(
        horizon=horizon,
        H=(H + H.T) / cost,
        from_state=2.0 * gradient[:, horizon.state] / cost,
        from_path=2.0 * gradient[:, horizon.path] / cost,
        from_constants=2.0 * gradient[:, constants] / cost,
        from_end=2.0 * end.T @ regulator.N[:, :nh] / cost,
        at=np.array(at),
        kind=np.array(kind),
        rows=G[:, moves],
        rows_state=G[:, horizon.state],
        rows_path=G[:, horizon.path],
        rows_constants=G[:, constants],
        speeds=np.array(speeds),
        cost=cost,
    )
