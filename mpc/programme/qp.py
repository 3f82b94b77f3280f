r"""Quadratic programmes with soft rows, each a little different from the last: DAQP, kept warm.

.. math::

    \min_{v, s} \tfrac12 v'Hv + f'v + \sum_i \tfrac12 W s_i^2 + w s_i
    \quad \text{subject to} \quad l \le (v, S v) \le u, \quad
    \underline r - s \le R v \le \overline r + s, \; s \ge 0 .

DAQP (D. Arnstrom, A. Bemporad and D. Axehill, IEEE TAC 67, 2022) is a dual active-set method:
exact, with a bound on its iterations, and with soft rows of its own that need no slack variables.
Set up once; each sample brings a gradient and bounds, and begins with the active set of the last.
`benchmarks/mpc_speed.py` compares it with others.

`kkt_residual` checks an answer without the solver.
"""

import math
from dataclasses import dataclass
from typing import Any

import daqp
import numpy as np

from models.basics import FloatArray, SolverError

_SOFT = 8  # DAQP's bit of a soft row
_INFEASIBLE = -1  # and its exit flag
# Twice what any of 36 000 random questions took, up to three times as far off as a sea brings, of
# 32 moves and 87 rows (583) and of 47 and 102 (668).
ITERATIONS = 1500


@dataclass(frozen=True, slots=True)
class QPSolution:
    """An answer: moves v (n,), a multiplier for each bound, iterations, and DAQP's exit flag."""

    v: FloatArray
    multipliers: FloatArray
    iterations: int
    flag: int

    @property
    def ok(self) -> bool:
        """Whether it is one."""
        return self.flag > 0

    @property
    def infeasible(self) -> bool:
        """Whether there can be none, as hard rows exclude each other."""
        return self.flag == _INFEASIBLE


class SoftQP:
    """A programme of fixed size and weights; H and R change by `change`.

    Parameters
    ----------
    H
        (n, n), positive definite.
    rows
        R, (m, n), scaled so that its values are of the size of one.
    hard
        S, (h, n), rows that may not be violated.
    quadratic, linear
        W and w of the soft rows: a number for all, or one for each, (m,).
    iterations
        How many are allowed.
    time_limit
        Longest time for one solution [s]; zero for none.

    Raises
    ------
    SolverError
        If H is not positive definite.
    """

    def __init__(
        self,
        H: FloatArray,
        rows: FloatArray,
        *,
        quadratic: float | FloatArray,
        linear: float | FloatArray,
        hard: FloatArray | None = None,
        iterations: int = ITERATIONS,
        time_limit: float = 0.0,
    ) -> None:
        n, m = len(H), len(rows)
        hard = np.zeros((0, n)) if hard is None else hard
        # DAQP wants arrays that it might write to.
        self.H, self.rows = np.array(H, order="C"), np.array(rows, order="C")
        self.hard, self._all_rows = np.array(hard), np.vstack([hard, rows])
        self.quadratic, self.linear = quadratic, linear
        self._iterations, self._time_limit = iterations, time_limit
        self._sense = np.concatenate([np.zeros(n + len(hard)), np.full(m, _SOFT)]).astype(np.int32)
        self._wide = np.full(n + len(hard) + m, 1e20)
        try:
            np.linalg.cholesky(self.H)
        except np.linalg.LinAlgError as error:
            raise SolverError("quadratic programme: H is not positive definite") from error
        self.reset()

    def reset(self) -> None:
        """Forget the active set."""
        n = len(self.H)
        model: Any = daqp.Model()
        flag, _ = model.setup(
            self.H, np.zeros(n), self._all_rows, self._wide, -self._wide, self._sense.copy()
        )
        if flag < 0:
            raise SolverError(f"quadratic programme: DAQP refuses it (flag {flag})")
        model.settings = {
            "iter_limit": self._iterations,
            "time_limit": self._time_limit,
            "eps_prox": 0.0,
            "primal_tol": 1e-9,
        }
        rho, w = np.ones(len(self._wide)), np.ones(len(self._wide))
        soft = slice(n + len(self.hard), None)
        rho[soft], w[soft] = 1.0 / self.quadratic, self.linear
        model.soft_weights(rho, rho, w, w)
        self._model = model

    def change(self, H: FloatArray, rows: FloatArray) -> bool:
        """Take another Hessian and other soft rows, of the same shapes, and keep the active set.

        Return whether that is possible; if it is not, nothing is changed.
        """
        if not math.isfinite(float(H.sum()) + float(rows.sum())):
            return False
        before = self.H, self.rows, self._all_rows
        self.H, self.rows = H, rows
        self._all_rows = np.vstack([self.hard, rows]) if len(self.hard) else rows
        if self._model.update(H=H, A=self._all_rows) >= 0:
            return True
        try:  # what cannot be updated warm may still be solved cold
            self.reset()
        except SolverError:
            self.H, self.rows, self._all_rows = before
            self.reset()
            return False
        return True

    def solve(self, f: FloatArray, lower: FloatArray, upper: FloatArray) -> QPSolution:
        """Solve for a gradient (n,) and bounds on moves, hard and soft rows, finite or +-1e20."""
        self._model.update(f=f, bupper=upper, blower=lower)
        v, _, flag, info = self._model.solve()
        return QPSolution(v, info["lam"], info["iterations"], flag)


def kkt_residual(
    qp: SoftQP, f: FloatArray, lower: FloatArray, upper: FloatArray, solved: QPSolution
) -> float:
    """Return the largest violation of the optimality conditions, by other arithmetic.

    Stationarity over the size of the gradient; violation of the bounds on moves; soft rows: a
    multiplier must be zero inside, and w + W s where the row is violated by s; signs.  f, lower and
    upper are those given to `SoftQP.solve`.
    """
    v, lam = solved.v, solved.multipliers
    G = np.vstack([np.eye(len(f)), qp.hard, qp.rows])
    n = len(f) + len(qp.hard)  # those that may not be violated
    size = 1.0 + float(np.abs(f).max())
    found = [float(np.abs(qp.H @ v + f + G.T @ lam).max()) / size]
    value = G @ v
    above, below = value - upper, lower - value
    found.append(float(np.maximum(above[:n], below[:n]).max()))
    # Complementarity: a positive multiplier belongs to an upper bound, a negative one to a lower.
    active = lam[:n] != 0.0
    gap = np.where(lam[:n] > 0.0, np.abs(above[:n]), np.abs(below[:n]))
    found.append(float(np.where(active, gap, 0.0).max()))
    for slack, sign in ((above[n:], 1.0), (below[n:], -1.0)):
        push = np.maximum(sign * lam[n:], 0.0)
        s = np.maximum(slack, 0.0)
        price = np.where(s > 0.0, qp.linear + qp.quadratic * s, qp.linear)
        violated = np.where(s > 1e-7, np.abs(push - price), 0.0)
        inside = np.where(slack < -1e-7, push, 0.0)
        at = np.where(np.abs(slack) <= 1e-7, np.maximum(push - price, 0.0), 0.0)
        found += [float(a.max(initial=0.0)) / size for a in (violated, inside, at)]
    return max(found)
