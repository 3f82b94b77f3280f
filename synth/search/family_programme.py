r"""The nonlinear programme over a family: one set of parameters, many loops.

.. math::

    \min_{p, t} t \quad\text{s.t. } \log J_i(p) - \log r_i \le t,
    \; \text{limits of every scenario } i

with r_i = 1 for the worst case and the best cost J_i* for the worst regret; the mean is
minimised as it is.  Every scenario brings the symbols (`synth.question.LoopSymbols`), limits and
stability guard of a single programme; scenarios on the same loop share its margins and responses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from models.basics import FloatArray, Quadrature

from ..question import FamilyLoop, FamilyProblem, Goal, LoopSymbols, Objective, Values
from .programme import Guard, Solution, SolverPace, solver_options

_ROOM = 12.0  # how far the logarithms of drags and of the cost may move: e^12


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilySolved:
    """What a solve returned; nothing in it is verified yet.

    `costs` are the scenarios' costs on the nodes, `pressure` how much of the objective hangs on
    each of them (the multipliers of log J_i <= t: they add up to 1), `prices` d log(objective)
    / d log(bound) by scenario and limit.
    """

    values: FloatArray
    coefficients: tuple[float | None, ...]
    objective: float
    costs: FloatArray
    pressure: FloatArray
    prices: tuple[Mapping[str, float], ...]
    converged: bool
    message: str
    iterations: int

    def of(self, index: int, scenario: FamilyLoop) -> Solution:
        """Return the answer as the one of a single scenario."""
        return Solution(
            values=scenario.values(self.values),
            coefficient=self.coefficients[index],
            objective=float(np.log(self.costs[index])),
            extra=0.0,
            converged=self.converged,
            message=self.message,
            iterations=self.iterations,
            prices=dict(self.prices[index]),
        )


class FamilyProgramme:
    """A stated programme: built once for a set of nodes, solved from many starts.

    Parameters
    ----------
    family
        The scenarios and the objective.
    nodes, omega
        Quadrature nodes and margin frequencies [rad/s] of each group of scenarios.
    reference
        Searched parameters at which every loop is briskly stable.
    """

    def __init__(
        self,
        family: FamilyProblem,
        nodes: Sequence[Quadrature],
        omega: Sequence[FloatArray],
        *,
        reference: FloatArray,
        tolerance: float = 1e-7,
        max_iterations: int = 200,
    ) -> None:
        self.family = family
        scenarios, count = family.scenarios, len(family.parameters)
        drags = [i for i, s in enumerate(scenarios) if s.problem.drag is not None]
        self._drag_at = {i: count + k for k, i in enumerate(drags)}
        self._mean = family.objective is Objective.MEAN
        x = ca.MX.sym("x", count + len(drags) + (not self._mean))
        searched = [x[i] * float(family.scales[i]) for i in range(count)]
        self._keys = [(i, lim.name) for i, s in enumerate(scenarios) for lim in s.problem.limits]
        self._limits = {(i, m.name): m for i, s in enumerate(scenarios) for m in s.problem.limits}
        self._bounds = np.array([self._limits[key].bound for key in self._keys], dtype=np.float64)
        bounds = ca.MX.sym("bounds", self._bounds.size)
        bound = {key: bounds[k] for k, key in enumerate(self._keys)}
        rows, balances, costs = [], [], {}
        self._rows: dict[tuple[int, str], slice] = {}
        at = 0
        for group, where, margins in zip(family.groups, nodes, omega, strict=True):
            first = scenarios[group[0]]
            log_drag = x[self._drag_at[group[0]]] if group[0] in self._drag_at else None
            shared = x, _blended(first, searched), log_drag
            symbols = LoopSymbols(first.problem, where, margins, Goal.COST, shared)
            for i in group:
                seen = symbols if i == group[0] else symbols.under(scenarios[i].problem)
                for limit in scenarios[i].problem.limits:
                    if limit.drive or i == group[0]:
                        row = limit.rows(seen, bound[i, limit.name])
                        rows.append(row)
                        self._rows[i, limit.name] = slice(at, at + row.shape[0])
                        at += row.shape[0]
                costs[i] = seen.cost()
            rows.append(symbols.no_slow_pole(first.values(reference)))
            at += 1
            if log_drag is not None:
                balances.append(symbols.drag_balance())
        ordered = [costs[i] for i in range(len(scenarios))]
        if self._mean:
            weights = np.array([s.weight for s in scenarios])
            squares = ca.exp(2.0 * ca.vertcat(*ordered))
            objective = 0.5 * ca.log(ca.dot(ca.DM(weights / weights.sum()), squares))
        else:
            objective = x[-1]
            self._best = np.zeros(len(scenarios))
            if family.objective is Objective.REGRET:
                self._best = np.log([s.best for s in scenarios])
            rows += [c - r - x[-1] for c, r in zip(ordered, self._best, strict=True)]
        self._cost_rows = slice(at, at + (0 if self._mean else len(scenarios)))
        self._inequalities = self._cost_rows.stop
        constraints = ca.vertcat(*rows, *balances)
        self._balances = len(balances)
        self._guard = Guard(self._stable, x.shape[0])
        self._evaluate = ca.Function("evaluate", [x, bounds], [ca.vertcat(*ordered), constraints])
        self._statement: dict[str, Any] = {
            "x": x,
            "p": bounds,
            "f": objective + self._guard(x),
            "g": constraints,
        }
        self._options = solver_options(tolerance, max_iterations)
        self._solvers: dict[SolverPace, Any] = {}

    def _stable(self, x: FloatArray) -> bool:
        return self.family.stable(self._values(x), self._coefficients(x))

    def _values(self, x: FloatArray) -> FloatArray:
        return np.asarray(x[: self.family.scales.size] * self.family.scales)

    def _coefficients(self, x: FloatArray) -> tuple[float | None, ...]:
        every = range(len(self.family.scenarios))
        drags = self._drag_at
        return tuple(float(np.exp(x[drags[i]])) if i in drags else None for i in every)

    def pack(
        self, values: Values, coefficients: Sequence[float | None] | None = None
    ) -> FloatArray:
        """Return the programme's vector for searched parameters; t is what they cost."""
        scenarios = self.family.scenarios
        x = list(np.asarray(values, dtype=np.float64) / self.family.scales)
        for i in self._drag_at:
            drag, given = scenarios[i].problem.drag, None
            if coefficients is not None:
                given = coefficients[i]
            assert drag is not None
            x.append(float(np.log(given or drag.reference)))
        if self._mean:
            return np.array(x)
        costs = np.asarray(self._evaluate([*x, 0.0], self._bounds)[0], dtype=np.float64).ravel()
        excess = costs - self._best
        finite = excess[np.isfinite(excess)]
        return np.array([*x, float(finite.max(initial=-20.0)) + 0.1])

    def violations(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Return the scenarios' log costs and the largest row of any limit at a vector."""
        costs, rows = self._evaluate(x, self._bounds)
        flat = np.asarray(rows, dtype=np.float64).ravel()[: self._cost_rows.start]
        return np.asarray(costs, dtype=np.float64).ravel(), float(flat.max(initial=0.0))

    def solve(
        self,
        start: FloatArray,
        reach: float | None = None,
        tighten: Mapping[tuple[int, str], float] | None = None,
        pace: SolverPace = SolverPace.FAR,
    ) -> FamilySolved:
        """Return IPOPT's answer from a start; see `synth.search.programme.Programme.solve`."""
        family, count = self.family, self.family.scales.size
        self._guard.rejected = 0
        low = np.array([p.low for p in family.parameters]) / family.scales
        high = np.array([p.high for p in family.parameters]) / family.scales
        if reach is not None:
            near = start[:count]
            room = reach * np.maximum(np.abs(near), 1e-3 * np.abs(near).max(initial=1e-3))
            low, high = np.maximum(low, near - room), np.minimum(high, near + room)
        bounds = self._bounds.copy()
        for k, key in enumerate(self._keys):
            step = (tighten or {}).get(key, 0.0)
            bounds[k] *= 1.0 + step if self._limits[key].at_least else 1.0 - step
        zeros = np.zeros(self._balances)
        if pace not in self._solvers:
            options = {**self._options, **pace.value}
            self._solvers[pace] = ca.nlpsol("family", "ipopt", self._statement, options)
        solver = self._solvers[pace]
        answer = solver(
            x0=start,
            p=bounds,
            lbx=[*low, *(start[count:] - _ROOM)],
            ubx=[*high, *(start[count:] + _ROOM)],
            lbg=np.concatenate([np.full(self._inequalities, -np.inf), zeros]),
            ubg=np.concatenate([np.zeros(self._inequalities), zeros]),
        )
        stats = solver.stats()
        x = np.asarray(answer["x"], dtype=np.float64).ravel()
        prices = np.asarray(answer["lam_p"], dtype=np.float64).ravel() * self._bounds
        multipliers = np.asarray(answer["lam_g"], dtype=np.float64).ravel()
        costs = np.exp(self.violations(x)[0])
        pressure = multipliers[self._cost_rows]
        if self._mean:
            pressure = np.array([s.weight for s in family.scenarios]) * costs**2
        by_scenario: list[dict[str, float]] = [{} for _ in family.scenarios]
        for (i, name), price in zip(self._keys, prices, strict=True):
            by_scenario[i][name] = float(price)
        return FamilySolved(
            values=self._values(x),
            coefficients=self._coefficients(x),
            objective=float(np.log(family.total(costs))),
            costs=costs,
            pressure=np.asarray(pressure / max(float(pressure.sum()), 1e-300)),
            prices=tuple(by_scenario),
            converged=bool(stats["success"]),
            message=str(stats["return_status"]).replace("_", " ").lower(),
            iterations=int(stats["iter_count"]),
        )


def _blended(scenario: FamilyLoop, searched: Sequence[Any]) -> list[Any]:
    """Return a scenario's own parameters, in symbols."""
    if scenario.blend is None:
        return list(searched)
    rows = []
    for line in scenario.blend:
        terms = [float(w) * p for w, p in zip(line, searched, strict=True) if w != 0.0]
        rows.append(sum(terms[1:], terms[0]) if terms else ca.MX(0.0))
    return rows
