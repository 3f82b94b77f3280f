r"""The states of a sampled plant over a horizon, with the moves blocked: `Horizon`.

.. math::

    x_{j+1} = A x_j + B d_j + \Gamma_w (w_j, w_{j+1}) + \Gamma_c c, \qquad d_j = u \, v_{b(j)}

with w a disturbance that is known along a path, c constant disturbances, v the moves, each of
which is held over its block b of samples, and u their unit.  Every state is a linear function of
the *columns* (x_0, path, c, v), in this order, the path being w_0, w_1, ... one after the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, ReadOnlyArrays, check_range

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon(ReadOnlyArrays):
    """A sampled plant of one input, and the blocks of its moves.

    Parameters
    ----------
    A, B, from_path, from_constants
        (n, n), (n, 1), (n, 2 nw), (n, nc).
    blocks
        Length of each block in samples, (nb,).
    unit
        Input of a move of one.
    """

    A: FloatArray
    B: FloatArray
    from_path: FloatArray
    from_constants: FloatArray
    blocks: tuple[int, ...]
    unit: float

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

    Raises
    ------
    InputError
        If the horizon is shorter than four samples or longer than 2000; `owner` begins the message.
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
