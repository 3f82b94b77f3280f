r"""The condensed quadratic programme: every state of the horizon eliminated, the moves blocked.

.. math::

    \min_v \; \tfrac12 v' H v + f' v \quad \text{subject to} \quad
    l \le v \le u, \quad \underline r \le R v + r_0 \le \overline r \ \text{(soft)},

with the inputs d held over blocks of samples (`Horizon`), the cost that of the regulator
(`mpc.programme.regulator`),

.. math::

    J = \sum_{j=1}^{N-1} p_j^2 + \rho \sum_{j=0}^{N-1} (d_j - d_\infty c)^2
        + x_N' P x_N + 2 x_N' N_\zeta \zeta_N ,

and everything divided by N times a scale.  Gradient f and free response r_0 are linear in what is
known at the sample: the plant's state x, the constants c, and the path w of the disturbance at
the N + 1 samples of the horizon.  All products that do not change are made here, once.

zeta_N holds the state of the disturbance's own model at the end of the horizon, where the path ends
and that model goes on.

`Horizon` holds the states of a sampled plant over a horizon, with the moves blocked.

.. math::

    x_{j+1} = A x_j + B d_j + \Gamma_w (w_j, w_{j+1}) + \Gamma_c c, \qquad d_j = u \, v_{b(j)}

with w a disturbance that is known along a path, c constant disturbances, v the moves, each of
which is held over its block b of samples, and u their unit.  Every state is a linear function of
the *columns* (x_0, path, c, v), in this order, the path being w_0, w_1, ... one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, ReadOnlyArrays, check_range

from .regulator import LQRegulator

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Condensed(ReadOnlyArrays):
    """Matrices of the programme; `condense` makes it."""

    horizon: Horizon  #: Plant, blocks and unit of the moves.
    H: FloatArray  #: (nb, nb), per unit of a move.
    #: Gradient f of the horizon's columns but the moves, (nb, columns), and of the disturbance's
    #: state at the end of the horizon, (nb, nh).
    gradient: FloatArray
    from_end: FloatArray
    at: IntArray  #: Sample of each row, (nr,).
    kind: IntArray  #: What each row is: a number of the caller's, (nr,).
    rows: FloatArray  #: r_0 and R, by the horizon's columns, (nr, columns).
    #: Signal on which the bounds of the moves depend (the motor's speed) at the start of each
    #: block, by the horizon's columns, (nb, columns).
    speeds: FloatArray
    cost: float  #: What the cost is divided by.

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
    return Condensed(
        horizon=horizon,
        H=(H + H.T) / cost,
        gradient=2.0 * gradient / cost,
        from_end=2.0 * end.T @ regulator.N[:, :nh] / cost,
        at=np.array(at),
        kind=np.array(kind),
        rows=np.array(rows).reshape(len(rows), moves.stop),
        speeds=np.array(speeds),
        cost=cost,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon(ReadOnlyArrays):
    """A sampled plant of one input, and the blocks of its moves."""

    #: (n, n), (n, 1), (n, 2 nw), (n, nc).
    A: FloatArray
    B: FloatArray
    from_path: FloatArray
    from_constants: FloatArray
    blocks: tuple[int, ...]  #: Length of each block in samples, (nb,).
    unit: float  #: Input of a move of one.

    @cached_property
    def steps(self) -> int:
        """Number of samples N of the horizon."""
        return sum(self.blocks)

    @cached_property
    def block(self) -> IntArray:
        """Block of each sample, (N,)."""
        return np.repeat(np.arange(len(self.blocks)), self.blocks)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """Sample at which each block begins, (nb,)."""
        return tuple(np.cumsum((0, *self.blocks[:-1])).tolist())

    @property
    def state(self) -> slice:
        """Columns of x_0."""
        return slice(0, len(self.A))

    @property
    def path(self) -> slice:
        """Columns of the path."""
        n, nw = self.from_path.shape
        return slice(n, n + nw // 2 * (self.steps + 1))

    @property
    def constants(self) -> slice:
        """Columns of the constants."""
        first = self.path.stop
        return slice(first, first + self.from_constants.shape[1])

    @property
    def moves(self) -> slice:
        """Columns of the moves."""
        first = self.constants.stop
        return slice(first, first + len(self.blocks))

    def ends(self, j: int) -> slice:
        """Return the columns of the path at both ends of sample j."""
        n, nw = self.from_path.shape
        return slice(n + nw // 2 * j, n + nw // 2 * j + nw)

    def move(self, j: int) -> int:
        """Return the column of the move that acts over sample j."""
        return int(self.moves.start + self.block[j])

    def states(self) -> Iterator[FloatArray]:
        """Yield x_0, x_1, .. x_N by the columns, (n, columns) each."""
        S = np.eye(len(self.A), self.moves.stop)
        yield S
        pushed = self.B[:, 0] * self.unit
        for j in range(self.steps):
            S = self.A @ S
            S[:, self.ends(j)] += self.from_path
            S[:, self.constants] += self.from_constants
            S[:, self.move(j)] += pushed
            yield S


def default_blocking(owner: str, horizon: float, sample_time: float) -> tuple[int, ...]:
    """Return lengths of blocks [samples] that grow over a horizon [s]: some thirty moves.

    What is far ahead is known less well and is planned again many times before it comes.

    Raises InputError if the horizon is shorter than four samples or longer than 2000; `owner`
    begins the message.
    """
    check_range(owner, "horizon", horizon, low=4 * sample_time, high=2000 * sample_time, unit="s")
    left = round(horizon / sample_time)
    blocks: list[int] = []
    # So many moves of this length [s]; the last length goes on to the end.
    for count, length in ((6, 0.0), (6, 0.1), (6, 0.2), (10**6, 0.4)):
        size = max(1, round(length / sample_time))
        for _ in range(count):
            if left <= 0:
                return tuple(blocks)
            if left < 2 * size:
                size = left
            blocks.append(size)
            left -= size
    return tuple(blocks)


def free_outputs(A: FloatArray, C: FloatArray, steps: int) -> FloatArray:
    """Return the outputs C x_0, C x_1, .. of x+ = A x by x_0, (ny (steps + 1), n)."""
    rows, state = [], np.eye(len(A))
    for _ in range(steps + 1):
        rows.append(C @ state)
        state = A @ state
    return np.vstack(rows)
