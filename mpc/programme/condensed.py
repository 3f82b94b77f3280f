r"""The condensed programme of a sampled plant: every state of the horizon eliminated.

.. math::

    \min_v \; \tfrac12 v' H v + f' v \quad \text{subject to} \quad
    l \le v \le u, \quad \underline r \le R v + r_0 \le \overline r \ \text{(hard or soft)},

with the inputs d held over blocks of samples (`mpc.programme.horizon`), and the cost

.. math::

    J = \sum_{j=0}^{N-1} s_j' W s_j + x_N' P x_N + 2 x_N' N_\zeta \zeta_N ,

s being what costs, as it differs from its reference, and zeta_N what lasts beyond the horizon.
Everything is divided by a scale, rows are in units of their limits and moves in those of the
inputs.  Gradient f and free response r_0 are linear in what is known at the sample: the state x,
the constants c, and the path w of disturbances and references.  All products that do not change
are made once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import FloatArray, InputError, SolverError, check_range, pick

from .horizon import Horizon, IntArray, Signals
from .qp import ITERATIONS, SoftQP
from .regulator import LQRegulator

Question = tuple[FloatArray, FloatArray, FloatArray]
_OWNER = "programme"
_QUADRATIC, _LINEAR = 1e4, 1e2  # price of a soft row, over its scale, in units of the cost
_WIDE = 1e20  # no limit, for the solver
_FAINT = 1e-6  # of a limit, which the whole cost may move: the solver takes less for nothing
_NONE = np.zeros(0)


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """A limit on an output, an input, or the ``rate of`` an input.

    Raises InputError if there is no limit, the two are in the wrong order, or a price is not above
    zero.
    """

    signal: str
    low: float = -math.inf
    high: float = math.inf
    #: Whether it may be violated: at a price so high that it is not without need, or at one of your
    #: own, (p, q) for p s + q s^2 at each sample with a violation s.
    soft: bool | tuple[float, float] = False
    samples: frozenset[int] | None = None  #: At which it is kept; by default at all.

    def __post_init__(self) -> None:
        if not self.low <= self.high or math.inf in (self.low, -self.high):
            raise InputError(
                f"constraint: {self.signal} must have low <= high, got {self.low:g} and "
                f"{self.high:g}"
            )
        if math.isinf(self.low) and math.isinf(self.high):
            raise InputError(f"constraint: {self.signal} must have a finite limit, got none")
        if not isinstance(self.soft, bool):
            for price in self.soft:
                check_range("constraint", "price", price, low=0.0, open_low=True)


class Condensed:
    """The programme, set up once and solved anew each sample.

    Parameters
    ----------
    horizon, signals, cost
        Plant and blocks; what may be limited; what costs, with the weights of `end`.
    end
        Value function of what comes after the horizon; the constants are the last of its zeta.
    constraints, inputs, rest
        Limits, names of the inputs, values of signals at rest.
    scale
        What the cost is divided by; by default the largest entry of its Hessian.
    traced
        A signal whose rows at the start of each block are kept.
    links
        Further hard rows of the moves, (nl, nm), whose bounds come with each question.
    iterations, time_limit
        How many the solver may take, and how long [s]; zero for no end.

    Attributes
    ----------
    blocks, steps, unit
        Length of each block and of the horizon in samples; the first input of a move of one.
    cost
        What the cost is divided by.
    traced
        The rows of that signal, by the horizon's columns, (nb, columns).
    H, gradient, from_end
        The Hessian, per unit of a move, (nm, nm); the gradient by the horizon's columns but the
        moves, and by what of zeta at the end of the horizon is no constant.
    rows, at, kind, scale
        Rows by the horizon's columns, hard ones first, (nr, columns), scaled; the sample of each,
        its signal, and what it is scaled by.
    low, high, row_low, row_high
        Bounds on the moves and on the rows.
    qp
        The solver.

    Raises
    ------
    InputError
        If constraints name no signal or exclude each other.
    """

    def __init__(
        self,
        horizon: Horizon,
        *,
        signals: Signals,
        cost: Signals,
        end: LQRegulator,
        constraints: Sequence[Constraint],
        inputs: Sequence[str],
        rest: Mapping[str, float],
        scale: float | None = None,
        traced: str | None = None,
        links: FloatArray | None = None,
        iterations: int = ITERATIONS,
        time_limit: float = 0.0,
    ) -> None:
        self.horizon, self.signals, self.cost_rows, self.end = horizon, signals, cost, end
        self.inputs, self.rest = tuple(inputs), rest
        h, moves, N = horizon, horizon.moves, horizon.steps
        self.blocks, self.steps = h.blocks, N
        self.unit = float(h.units[0])
        size = moves.stop - moves.start
        self.low, self.high = np.full(size, -_WIDE), np.full(size, _WIDE)
        limits = [side for limit in constraints if (side := self._side(limit)) is not None]
        H, gradient = np.zeros((size, size)), np.zeros((size, moves.start))
        found: list[tuple[_Side, int, FloatArray]] = []
        trace, last = [], dict.fromkeys(limits, np.zeros(0))
        for j, S in enumerate(h.states()):
            if j < N:
                s = cost.at(h, j, S)
                weighed = s[:, moves].T * end.weights
                H += weighed @ s[:, moves]
                gradient += weighed @ s[:, : moves.start]
            rows = signals.at(h, j, S)
            for side in limits:
                row, of = rows[side.kind], side.limit.samples
                if (of is not None and j not in of) or (j == N and not signals.at_end[side.kind]):
                    continue
                # What no move changes is past, and what is the same as before has been asked.
                if row[moves].any() and not np.array_equal(row, last[side]):
                    found.append((side, j, row))
                    last[side] = row
            if traced is not None and j in h.starts:
                trace.append(rows[signals.names.index(traced)])
        # The rest of the cost, from the horizon's end to infinity.
        reach, nz = S[:, moves], end.N.shape[1] - h.from_constants.shape[1]
        H += reach.T @ end.P @ reach
        gradient += reach.T @ end.P @ S[:, : moves.start]
        gradient[:, h.constants] += reach.T @ end.N[:, nz:]
        self.cost = float(np.diag(H).max()) if scale is None else scale
        self.H, self.gradient = (H + H.T) / self.cost, 2.0 * gradient / self.cost
        self.from_end = 2.0 * reach.T @ end.N[:, :nz] / self.cost
        self.traced = np.array(trace)
        found.sort(key=lambda one: one[0].soft)  # hard ones first
        rows = np.array([row for _, _, row in found]).reshape(len(found), moves.stop)
        # How far the cost of one reaches: rows in units of that, or of their limits where a
        # violation of one per cent is to cost the same whatever is limited.
        reach = np.linalg.norm(np.linalg.solve(self._root(), rows[:, moves].T), axis=0)
        usual = np.array([side.usual for side, _, _ in found], dtype=np.bool_)
        sizes = np.where(usual, [side.size for side, _, _ in found], reach)
        kept = np.flatnonzero(reach > np.where(usual, _FAINT * sizes, 0.0)).tolist()
        sides = [found[k][0] for k in kept]
        hard = sum(not side.soft for side in sides)
        self.at: IntArray = np.array([found[k][1] for k in kept], dtype=np.int64)
        self.kind: IntArray = np.array([side.kind for side in sides], dtype=np.int64)
        self.scale = 1.0 / sizes[kept]
        self.rows = rows[kept] * self.scale[:, None]
        self.row_low = np.maximum(np.array([side.low for side in sides]) * self.scale, -_WIDE)
        self.row_high = np.minimum(np.array([side.high for side in sides]) * self.scale, _WIDE)
        more = np.zeros((0, size)) if links is None else links
        self._hard = np.vstack([more, self.rows[:hard, moves]])
        self._effort = iterations, time_limit
        self._prices: tuple[float, float] | tuple[FloatArray, FloatArray] = _LINEAR, _QUADRATIC
        if not usual[kept][hard:].all():
            priced = zip(sides[hard:], sizes[kept][hard:].tolist(), strict=True)
            own = np.array([side.prices(self.cost, size) for side, size in priced])
            self._prices = own[:, 0], own[:, 1]
        self.qp = self.solver(np.ascontiguousarray(self.rows[hard:, moves]))

    def _root(self) -> FloatArray:
        """Return L of H = L L'."""
        try:
            return np.asarray(np.linalg.cholesky(self.H), dtype=np.float64)
        except np.linalg.LinAlgError as error:
            raise SolverError(f"{_OWNER}: its Hessian is not positive definite") from error

    @cached_property
    def last(self) -> slice:
        """Columns of the path at the end of the horizon."""
        h = self.horizon
        return slice(h.path.stop - h.from_path.shape[1] // 2, h.path.stop)

    @cached_property
    def law(self) -> FloatArray:
        """First moves of the answer without limits, by the gradient, (nu, nm)."""
        return np.asarray(-np.linalg.inv(self.H)[: len(self.horizon.units)])

    def solver(self, rows: FloatArray) -> SoftQP:
        """Return a solver of the programme, with other soft rows of the moves, scaled."""
        iterations, limit = self._effort
        linear, quadratic = self._prices
        return SoftQP(
            self.H,
            rows,
            quadratic=quadratic,
            linear=linear,
            hard=self._hard,
            iterations=iterations,
            time_limit=limit,
        )

    def question(
        self,
        gradient: FloatArray,
        free: FloatArray,
        low: FloatArray,
        high: FloatArray,
        links: tuple[FloatArray, FloatArray] = (_NONE, _NONE),
    ) -> Question:
        """Return gradient, lower and upper bounds for the solver, of a free response (nr,).

        Lowest and highest moves are (nm,), `links` the bounds of the further hard rows.
        """
        lower = np.concatenate((low, links[0], self.row_low - free))
        upper = np.concatenate((high, links[1], self.row_high - free))
        return gradient, lower, upper

    def _side(self, limit: Constraint) -> _Side | None:
        """Return a limit that is a row; one of an input goes into the bounds of the moves."""
        name, nu = limit.signal, len(self.inputs)
        kind = pick(_OWNER, "output, input or rate", self.signals.names, [name])[0]
        rest = self.rest.get(name, 0.0)
        side = _Side(kind, limit, limit.low - rest, limit.high - rest)
        if name not in self.inputs or side.soft or limit.samples is not None:
            return side
        i = self.inputs.index(name)
        unit = self.horizon.units[i]
        self.low[i::nu] = np.maximum(self.low[i::nu], side.low / unit)
        self.high[i::nu] = np.minimum(self.high[i::nu], side.high / unit)
        if (self.low > self.high).any():
            raise InputError(f"{_OWNER}: constraints of {name} must not exclude each other")
        return None


@dataclass(frozen=True)
class _Side:
    """A limit that is a row: its signal and its bounds as deviations from rest."""

    kind: int
    limit: Constraint
    low: float
    high: float

    @property
    def soft(self) -> bool:
        return self.limit.soft is not False

    @property
    def usual(self) -> bool:
        """Whether it has the usual price."""
        return self.limit.soft is True

    @property
    def size(self) -> float:
        """The larger bound, or one where that is zero."""
        return max(abs(e) for e in (self.low, self.high) if math.isfinite(e)) or 1.0

    def prices(self, cost: float, size: float) -> tuple[float, float]:
        """Return w and W of its row in units of a size, a cost being one."""
        if isinstance(self.limit.soft, bool):
            return _LINEAR, _QUADRATIC
        linear, square = self.limit.soft
        return linear * size / cost, 2.0 * square * size**2 / cost
