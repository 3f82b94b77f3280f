r"""The nonlinear programme of gain synthesis, stated in CasADi and solved by IPOPT.

.. math::

    \min_{p,\,C} \tfrac12 \log \sum_z \lambda_z \sum_w \int |F_{zw}|^2 S_w \, d\omega
    \quad\text{s.t. limits} \le 0,\; C = q \sqrt{8/\pi}\,\sigma_v

The integrals are sums over quadrature nodes, so the spectrum may be a table and delays are
exact; derivatives of both orders are CasADi's.

A spectral integral is finite for an unstable loop too, and a margin on a grid can be jumped
over.  So the objective carries a *guard*: it is not a number wherever a closed-loop pole lies
in the right half plane (Pade models for the delays), and IPOPT's line search treats such a
trial point as it treats a division by zero, by a shorter step.  Every iterate from a stable
start is thus stable, for any order of the loop; inequalities on the characteristic
polynomial (Lienard-Chipart), the usual way, lose their digits beyond order eight or so, and a
rope brings twenty.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from typing_extensions import override

from models.basics import FloatArray, Quadrature

from ..question import Goal, LoopSymbols, Problem, Values
from .follow import Follower

_ROOM = 12.0  # how far the logarithms of drag, sea and factors may move: e^12
_ITERATIONS, _MOST_ITERATIONS = 150, 400  # of a solve with few and with many parameters
_MANY = 6
_PATIENCE = 60  # rejected trial points before a solve is given up


class Guard(ca.Callback):
    """Zero where the loop is stable, not a number elsewhere; its derivative is zero.

    Parameters
    ----------
    stable
        Says of the programme's vector, (size,), whether the loop (or every loop) is stable.
    size
        Length of that vector.
    """

    def __init__(self, stable: Callable[[FloatArray], bool], size: int) -> None:
        ca.Callback.__init__(self)
        self._stable = stable
        self._size = size
        self._jacobian: ca.Function | None = None
        self.rejected = 0
        self.construct("guard", {})

    @override
    def get_n_in(self) -> int:
        return 1

    @override
    def get_n_out(self) -> int:
        return 1

    @override
    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        del i
        return ca.Sparsity.dense(self._size, 1)

    @override
    def eval(self, arg: Sequence[Any]) -> list[float]:
        if self.rejected > _PATIENCE:
            return [np.nan]  # ends the solve: its line search finds nothing stable any more
        x = np.array(arg[0], dtype=np.float64).ravel()
        if not np.all(np.isfinite(x)):
            return [np.nan]
        stable = self._stable(x)
        self.rejected += not stable
        return [0.0 if stable else np.nan]

    @override
    def has_jacobian(self) -> bool:
        return True

    @override
    def get_jacobian(
        self, name: str, inames: Sequence[str], onames: Sequence[str], opts: Mapping[str, Any]
    ) -> ca.Function:
        x, out = ca.MX.sym("x", self._size), ca.MX.sym("out", 1)
        zero = ca.MX(ca.Sparsity(1, self._size))
        self._jacobian = ca.Function(name, [x, out], [zero], inames, onames, opts)
        return self._jacobian


def solver_options(tolerance: float, max_iterations: int) -> dict[str, Any]:
    """Return the options of IPOPT that every programme here shares."""
    return {
        "print_time": False,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": tolerance,
        "ipopt.acceptable_tol": 10.0 * tolerance,
        "ipopt.max_iter": max_iterations,
    }


class SolverPace(Enum):
    """How IPOPT goes about a start, by its barrier.

    From afar the adaptive barrier finds the way.  From the answer itself a large barrier would
    carry it off, and from a point that breaks a limit a tiny one gets stuck on the wrong side.
    """

    FAR = {"ipopt.mu_strategy": "adaptive"}  # noqa: RUF012
    NEAR = {"ipopt.mu_strategy": "monotone", "ipopt.mu_init": 1e-3}  # noqa: RUF012
    THERE = {  # noqa: RUF012
        "ipopt.mu_strategy": "monotone",
        "ipopt.mu_init": 1e-5,
        "ipopt.bound_push": 1e-6,
        "ipopt.bound_frac": 1e-6,
        "ipopt.slack_bound_push": 1e-6,
        "ipopt.slack_bound_frac": 1e-6,
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """What a solve returned; nothing in it is verified yet.

    `prices` is d log(cost) / d log(bound) by limit (the envelope theorem), for the goal COST.
    `multipliers` are those of the programme's rows, (m,), which `Programme.follow` begins with.
    """

    values: FloatArray
    coefficient: float | None
    objective: float
    extra: float
    converged: bool
    message: str
    iterations: int
    prices: dict[str, float]
    multipliers: FloatArray | None = None


class Programme:
    """A stated programme: built once for a set of nodes, solved from many starts."""

    def __init__(
        self,
        problem: Problem,
        nodes: Quadrature,
        omega: FloatArray,
        goal: Goal = Goal.COST,
        *,
        reference: FloatArray,
        relaxed: Sequence[str] = (),
        tolerance: float = 1e-7,
        max_iterations: int | None = None,
    ) -> None:
        self.problem = problem
        if max_iterations is None:
            many = len(problem.law.parameters) > _MANY
            max_iterations = _MOST_ITERATIONS if many else _ITERATIONS
        self._goal = goal
        symbols = LoopSymbols(problem, nodes, omega, goal)
        self._bounds = np.array([limit.bound for limit in problem.limits], dtype=np.float64)
        bounds = ca.MX.sym("bounds", self._bounds.size)
        rows, self._slices, at = [], [], 0
        for k, limit in enumerate(problem.limits):
            bound = bounds[k]
            # Relaxed limits share one factor, and rows one slack: the most that any needs.
            if goal is Goal.RELAX and limit.name in relaxed:
                bound = bound * ca.exp(symbols.extra)
            row = limit.rows(symbols, bound)
            if goal is Goal.FEASIBLE:
                row = row - symbols.extra
            rows.append(row)
            self._slices.append(slice(at, at + row.shape[0]))
            at += row.shape[0]
        self._inequalities = at
        # No limit of the case: it stops a real pole from creeping to zero, below every node.
        rows.append(symbols.no_slow_pole(reference))
        self._inequalities += 1
        if problem.drag is not None:
            rows.append(symbols.drag_balance())
        constraints = ca.vertcat(*rows) if rows else ca.MX(0, 1)
        cost = symbols.cost()
        objective = cost
        if goal is not Goal.COST:
            objective = -symbols.extra if goal is Goal.SEA else symbols.extra
        self._guard = Guard(self._stable, symbols.x.shape[0])
        self.evaluate = ca.Function("evaluate", [symbols.x, bounds], [cost, constraints])
        self._statement: dict[str, Any] = {
            "x": symbols.x,
            "p": bounds,
            # Zero or not a number, and flat: it turns points down and changes no derivative.
            "f": objective + self._guard(symbols.x),
            "g": constraints,
        }
        self._cost = objective
        self._options = solver_options(tolerance, max_iterations)
        self._solvers: dict[SolverPace, Any] = {}

    def _stable(self, x: FloatArray) -> bool:
        """Return whether the loop of the programme's vector is stable."""
        parameters = self.problem.law.parameters
        count = len(parameters)
        coefficient = float(np.exp(x[count])) if self.problem.drag is not None else None
        scales = np.array([p.scale for p in parameters])
        return self.problem.stable(x[:count] * scales, coefficient)

    def _solver(self, pace: SolverPace) -> Any:
        if pace not in self._solvers:
            options = {**self._options, **pace.value}
            self._solvers[pace] = ca.nlpsol("synthesis", "ipopt", self._statement, options)
        return self._solvers[pace]

    @cached_property
    def _follower(self) -> Follower:
        # Without the guard: the follower asks for stability itself, before it evaluates.
        return Follower({**self._statement, "f": self._cost})

    def pack(
        self, values: Values, coefficient: float | None = None, extra: float | None = None
    ) -> FloatArray:
        """Return the programme's vector for given parameters."""
        x = [v / p.scale for v, p in zip(values, self.problem.law.parameters, strict=True)]
        # Drag, sea and factors as logarithms: they stay positive, and a step is a share.
        if self.problem.drag is not None:
            x.append(float(np.log(coefficient or self.problem.drag.reference)))
        if self._goal is not Goal.COST:
            x.append(0.0 if extra is None else extra)
        return np.array(x)

    def _tightened(self, tighten: Mapping[str, float]) -> FloatArray:
        bounds = self._bounds.copy()
        for k, limit in enumerate(self.problem.limits):
            step = tighten.get(limit.name, 0.0)
            bounds[k] *= 1.0 + step if limit.at_least else 1.0 - step
        return bounds

    def violations(
        self, x: FloatArray, tighten: Mapping[str, float] | None = None
    ) -> tuple[float, dict[str, float]]:
        """Return the log cost and the largest row of each limit at a vector; see `solve`."""
        cost, rows = self.evaluate(x, self._tightened(tighten or {}))
        flat = np.array(rows, dtype=np.float64).ravel()
        worst = {
            limit.name: float(flat[part].max(initial=-np.inf))
            for limit, part in zip(self.problem.limits, self._slices, strict=True)
        }
        return float(cost), worst

    def solve(
        self,
        start: FloatArray,
        reach: float | None = None,
        tighten: Mapping[str, float] | None = None,
        pace: SolverPace = SolverPace.FAR,
    ) -> Solution:
        """Return IPOPT's answer from a start.

        Parameters
        ----------
        start
            The programme's vector, see `pack`.
        reach
            How far, relatively, a parameter may move.
        tighten
            Relative tightening of bounds by name of the limit.
        pace
            How near the start is to the answer.
        """
        self._guard.rejected = 0
        low, high = self._box(start, reach)
        bottom, solver = self._bottom(), self._solver(pace)
        answer = solver(
            x0=start,
            p=self._tightened(tighten or {}),
            lbx=low,
            ubx=high,
            lbg=bottom,
            ubg=np.zeros(bottom.size),
        )
        stats = solver.stats()
        found = {k: np.array(answer[k], dtype=np.float64).ravel() for k in ("x", "lam_p", "lam_g")}
        return self._answer(
            found["x"],
            float(answer["f"]),
            found["lam_p"],
            found["lam_g"],
            converged=bool(stats["success"]),
            message=str(stats["return_status"]).replace("_", " ").lower(),
            iterations=int(stats["iter_count"]),
        )

    def follow(
        self,
        start: FloatArray,
        near: Solution | None = None,
        tighten: Mapping[str, float] | None = None,
    ) -> Solution | None:
        """Return the answer near a start in a few steps, None if there is none so near.

        Parameters
        ----------
        start, tighten
            As `solve` takes them.
        near
            An answer of this very programme close by, for its multipliers.
        """
        bottom = self._bottom()
        lam = np.zeros(bottom.size)
        if near is not None and near.multipliers is not None and near.multipliers.size == lam.size:
            lam = near.multipliers
        bounds = self._tightened(tighten or {})
        box = self._box(start, None)
        found = self._follower.answer(start, bounds, lam, box, bottom, self._stable)
        if found is None:
            return None
        x, lam, objective, steps = found
        prices = self._follower.prices(x, bounds, lam)
        return self._answer(
            x, objective, prices, lam, converged=True, message="followed", iterations=steps
        )

    def _box(self, start: FloatArray, reach: float | None) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest values that variables may take from a start."""
        parameters = self.problem.law.parameters
        count = len(parameters)
        low, high = start - _ROOM, start + _ROOM
        low[:count] = [p.low / p.scale for p in parameters]
        high[:count] = [p.high / p.scale for p in parameters]
        if reach is not None:
            near = start[:count]
            # A parameter that is nearly zero still gets a thousandth of the largest one's room.
            room = reach * np.maximum(np.abs(near), 1e-3 * np.abs(near).max(initial=1e-3))
            low[:count] = np.maximum(low[:count], near - room)
            high[:count] = np.minimum(high[:count], near + room)
        return low, high

    def _bottom(self) -> FloatArray:
        """Return the lower bounds of the rows: only equalities have one."""
        equalities = int(self.problem.drag is not None)
        return np.append(np.full(self._inequalities, -np.inf), np.zeros(equalities))

    def _answer(
        self,
        x: FloatArray,
        objective: float,
        prices: FloatArray,
        multipliers: FloatArray,
        *,
        converged: bool,
        message: str,
        iterations: int,
    ) -> Solution:
        count = len(self.problem.law.parameters)
        drag = self.problem.drag is not None
        return Solution(
            values=x[:count] * np.array([p.scale for p in self.problem.law.parameters]),
            coefficient=float(np.exp(x[count])) if drag else None,
            objective=objective,
            extra=float(x[-1]) if self._goal is not Goal.COST else 0.0,
            converged=converged,
            message=message,
            iterations=iterations,
            prices={
                limit.name: float(prices[k] * limit.bound)
                for k, limit in enumerate(self.problem.limits)
            },
            multipliers=multipliers,
        )
