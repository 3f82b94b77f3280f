r"""A sampled plant over a horizon, as columns: `Horizon`, and what depends on them: `Signals`.

.. math::

    x_{j+1} = A x_j + B d_j + \Gamma_w (w_j, w_{j+1}) + \Gamma_c c, \qquad d_j = u \, v_{b(j)}

with w known along a path (disturbances and references), c constant disturbances, v the moves, each
of which is held over its block b of samples, and u the units of the inputs.  Every state is a
linear function of the *columns* (x_0, path, c, v), in this order, the path being w_0, w_1, ... one
after the other, and the moves those of the first block, of the second, ...

`sampled` makes the matrices of any `models.LinearPlant`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, ReadOnlyArrays, check_range
from models.plant import LinearPlant, hermite_hold, zero_order_hold

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon(ReadOnlyArrays):
    """A sampled plant, and the blocks of its moves."""

    #: (n, n), (n, nu), (n, 2 nw), (n, nc).
    A: FloatArray
    B: FloatArray
    from_path: FloatArray
    from_constants: FloatArray
    blocks: tuple[int, ...]  #: Length of each block in samples, (nb,).
    units: FloatArray  #: Inputs of a move of one, (nu,).

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
        return slice(first, first + len(self.blocks) * len(self.units))

    def ends(self, j: int) -> slice:
        """Return the columns of the path at both ends of sample j; at N of the one end."""
        n, nw = self.from_path.shape
        first = n + nw // 2 * j
        return slice(first, min(first + nw, self.path.stop))

    def move(self, j: int) -> slice:
        """Return the columns of the moves that act over sample j."""
        first = self.moves.start + len(self.units) * int(self.block[j])
        return slice(first, first + len(self.units))

    def states(self) -> Iterator[FloatArray]:
        """Yield x_0, x_1, .. x_N by the columns, (n, columns) each."""
        S = np.eye(len(self.A), self.moves.stop)
        yield S
        pushed = self.B * self.units
        for j in range(self.steps):
            S = self.A @ S
            S[:, self.ends(j)] += self.from_path
            S[:, self.constants] += self.from_constants
            S[:, self.move(j)] += pushed
            yield S


@dataclass(frozen=True, kw_only=True, eq=False)
class Signals(ReadOnlyArrays):
    """Signals s = C x + D d + F (w_j, w_j+1) + G c, by name."""

    names: tuple[str, ...]
    C: FloatArray
    D: FloatArray
    F: FloatArray
    G: FloatArray

    def at(self, horizon: Horizon, j: int, S: FloatArray) -> FloatArray:
        """Return the signals of sample j by the columns, (ns, columns), of x_j by the columns."""
        rows = self.C @ S
        here = horizon.ends(j)
        rows[:, here] += self.F[:, : here.stop - here.start]
        rows[:, horizon.constants] += self.G
        if j < horizon.steps:
            rows[:, horizon.move(j)] += self.D * horizon.units
        return rows

    @cached_property
    def at_end(self) -> npt.NDArray[np.bool_]:
        """Which need no input and no path to come, and so are known at the end too, (ns,)."""
        later = self.F[:, self.F.shape[1] // 2 :]
        return np.asarray(~(self.D.any(axis=1) | later.any(axis=1)))


def sampled(plant: LinearPlant, period: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B and from_path of any linear plant, for samples of a period [s].

    Inputs and disturbances are held over a sample, exactly; a disturbance that comes with its rate
    moves along the cubic through both at either end.
    """
    nu, nw = len(plant.inputs), len(plant.disturbances)
    A, held = zero_order_hold(plant.A, np.hstack([plant.B, plant.E]), period)
    from_path = np.hstack([held[:, nu:], np.zeros((len(A), nw))])
    for rate, base in plant.rates.items():
        pair = [plant.disturbances.index(base), plant.disturbances.index(rate)]
        moved = hermite_hold(plant.A, plant.E[:, pair], period, period)[0]
        from_path[:, [*pair, *(nw + k for k in pair)]] = moved
    return A, held[:, :nu], from_path


def lasting(rows: FloatArray, lasts: FloatArray) -> FloatArray:
    """Return the columns of a path that lasts as it is now, (., nw), of those of both its ends."""
    now, later = np.hsplit(rows, 2)
    return np.asarray(now + later * lasts)


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
