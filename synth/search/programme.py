r"""The programme of gain synthesis: one set of parameters, one loop or a family of them.

.. math::

    \min_{p, C_i, t} t \quad\text{s.t. } \log J_i - \log r_i \le t, \;
    \text{limits of every member } i \le 0, \; C_i = q_i \sqrt{8/\pi}\,\sigma_{v,i}, \;
    b_i = \Delta_i \sqrt{2/\pi} / \sigma_{\omega,i},
    \qquad J_i^2 = \sum_z \lambda_z \sum_w \int |F_{zw}|^2 S_w \, d\omega

with r_i = 1 for the worst case and the best cost of its own for the worst regret; a mean is
minimised as it is, and of a family of one the cost.  The integrals are sums over quadrature nodes,
so that a spectrum may be a table and delays are exact; slopes are exact too
(`synth.question.loop_numbers`).  Members on the same loop share its margins and responses.

A spectral integral is finite for an unstable loop, and a margin on a grid can be jumped over.  So
no point is evaluated at which a closed-loop pole of any member lies in the right half plane (Pade
models for the delays): a descent that would go there takes a shorter step.  Every iterate from a
stable start is thus stable, for any order of the loop; inequalities on the characteristic
polynomial (Lienard-Chipart), the usual way, lose their digits beyond order eight or so, and a rope
brings twenty.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Any

import numpy as np

from models.basics import BoolArray, FloatArray, Quadrature

from ..limits import Limit
from ..loop import Coefficients, Dual, LoopResponses, exp, real, sqrt, squared, value_of
from ..question import (
    FamilyLoop,
    FamilyProblem,
    Goal,
    LoopNumbers,
    Objective,
    Point,
    Problem,
    Values,
    moment_weights,
    on_sides,
)
from .sqp import Descent, Evaluation, Glance, descend

_ROOM = 12.0  # how far the logarithms of drag, sea and factors may move: e^12
_STEPS, _MOST_STEPS = 60, 120  # of a solve with few and with many parameters
_MANY = 6
_SHIFT = 1e-6  # relative, of a bound or a frequency, of differences
_SLOW, _CALM = "slow pole", "small motion"  # rows that are no limits of a case
_HANGS = 0.5  # share of its decay from which a pole hangs on drag
_LEAST_DAMPING = 3e-4  # of such a pole without drag, if parameters can move it
_SMALL = 1e-3  # of its typical size: a parameter below it moves as much as if it were that
_STEEP = 10.0  # weight of a damping ratio among rows
_BESIDE = 1e-5  # relative difference for a slope along s
_HANGING = 30.0  # how sharply the worst member stands for its family in a model of the curvature
Tighten = Mapping[tuple[int, str], float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """What a solve returned; nothing in it is verified yet."""

    values: FloatArray  #: The searched parameters.
    #: Those of each member's elements: of drag [N s/m], of losses [N m s/rad].
    coefficients: tuple[tuple[float, ...], ...]
    objective: float  #: Logarithm of what the family's objective makes of the costs.
    converged: bool
    message: str
    iterations: int
    #: d log(cost) / d log(bound) by member and limit, with the sign of the bound: what loosening
    #: takes off counts as negative.
    prices: tuple[Mapping[str, float], ...]
    #: Cost of each member on the nodes, and how much of the objective hangs on it (adds up to 1).
    costs: FloatArray
    pressure: FloatArray
    extra: float = 0.0  #: The variable of a goal other than the cost.

    @property
    def coefficient(self) -> tuple[float, ...]:
        """Coefficients of the first member's elements."""
        return self.coefficients[0]


class GainProgramme:
    """A programme on a set of nodes, solved from any number of starts.

    Parameters
    ----------
    asked
        The family, or one problem.
    nodes, omega
        Quadrature nodes and margin frequencies [rad/s] of each group of members.
    goal, relaxed
        What is looked for, and the limits whose bounds share a factor (`Goal.RELAX`).
    reference
        Searched parameters at which every loop is briskly stable.
    tolerance
        Of the log objective.
    exact
        Whether margins are held where they are measured, at refined peaks and crossings of the
        curve, and not only on the margin frequencies and by discs that are a little too large.
    in_a_calm
        Whether rows hold the loop stable in small motion.  Without them a descent that comes to
        where it is not gets stuck there, soon.
    """

    def __init__(
        self,
        asked: FamilyProblem | Problem,
        nodes: Sequence[Quadrature],
        omega: Sequence[FloatArray],
        goal: Goal = Goal.COST,
        *,
        reference: FloatArray,
        relaxed: Sequence[str] = (),
        tolerance: float = 1e-8,
        max_iterations: int | None = None,
        exact: bool = False,
        in_a_calm: bool = True,
    ) -> None:
        self.family = family = FamilyProblem.of(asked)
        scenarios, count = family.scenarios, len(family.parameters)
        self._goal, self._relaxed, self._exact = goal, frozenset(relaxed), exact
        self._tolerance, self._calm = tolerance, in_a_calm
        many = _MOST_STEPS if count > _MANY else _STEPS
        self._most = many if max_iterations is None else max_iterations
        # A slack in the rows lets the curve through -1.
        self._guarded = goal is Goal.COST and all(
            any(limit.name == "max_sensitivity" for limit in s.problem.limits) for s in scenarios
        )
        # Where the logarithms of each member's coefficients stand.
        at, self._elements_at = count, []
        for scenario in scenarios:
            self._elements_at.append(slice(at, at + len(scenario.problem.elements)))
            at += len(scenario.problem.elements)
        self._mean = family.objective is Objective.MEAN and len(scenarios) > 1
        # A family of one needs no variable above its costs.
        self._bound_at = None
        if goal is Goal.COST and len(scenarios) > 1 and not self._mean:
            self._bound_at, at = at, at + 1
        self._extra_at = None
        if goal is not Goal.COST:
            self._extra_at, at = at, at + 1
        self.size = at
        self._best = np.zeros(len(scenarios))
        if family.objective is Objective.REGRET:
            self._best = np.log([s.best for s in scenarios])
        # Parameters that are positive stand as logarithms: their products are what acts.
        self._logarithmic = np.array([p.low > 0.0 for p in family.parameters], dtype=np.bool_)
        self._unit = np.where(self._logarithmic, 1.0, family.scales)
        ranges = np.array([(p.low, p.high) for p in family.parameters], dtype=np.float64)
        self._range = ranges.reshape(-1, 2).T
        self._loops = [
            _Loop([scenarios[i] for i in group], where, margins, reference)
            for group, where, margins in zip(family.groups, nodes, omega, strict=True)
        ]

    def stable(self, x: FloatArray) -> bool:
        """Return whether every loop of a vector is stable."""
        return self.family.stable(self._values(x), self._coefficients(x))

    def _values(self, x: FloatArray) -> FloatArray:
        own = x[: self._unit.size]
        return np.where(
            self._logarithmic, np.exp(np.where(self._logarithmic, own, 0.0)), own * self._unit
        )

    def _placed(self, values: Values) -> FloatArray:
        """Return parameters as the programme's vector has them."""
        given = np.asarray(values, dtype=np.float64)
        return np.where(
            self._logarithmic, np.log(np.where(self._logarithmic, given, 1.0)), given / self._unit
        )

    def _coefficients(self, x: FloatArray) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(np.exp(x[at]).tolist()) for at in self._elements_at)

    def pack(
        self,
        values: Values,
        coefficients: Sequence[Coefficients | None] | None = None,
        extra: float | None = None,
    ) -> FloatArray:
        """Return the programme's vector for given parameters.

        Coefficients, sea and factors stand in it as logarithms: they stay positive, and a step is
        a share.
        """
        scenarios = self.family.scenarios
        x = np.zeros(self.size)
        x[: self._unit.size] = self._placed(values)
        for i, at in enumerate(self._elements_at):
            given = None if coefficients is None else coefficients[i]
            pairs = zip(
                given or scenarios[i].problem.begin, scenarios[i].problem.begin, strict=True
            )
            x[at] = np.log([one or begin for one, begin in pairs])
        if self._extra_at is not None:
            x[self._extra_at] = 0.0 if extra is None else extra
        if self._bound_at is not None:
            costs = np.array([c.item() for c in self._numbers(x)[0]])
            excess = (costs - self._best)[np.isfinite(costs)]
            x[self._bound_at] = float(excess.max(initial=-20.0)) + 1e-6
        return x

    def violations(
        self, x: FloatArray, tighten: Tighten | None = None
    ) -> tuple[FloatArray, dict[tuple[int, str], float]]:
        """Return the log costs and the largest row of each limit at a vector; see `solve`."""
        costs, rows = self._numbers(x, tighten)
        worst = {
            key: float(np.max(row, initial=-np.inf))
            for key, row in rows
            if key[1] not in (_SLOW, _CALM)
        }
        return np.array([cost.item() for cost in costs]), worst

    def solve(
        self,
        start: FloatArray,
        reach: float | None = None,
        tighten: Tighten | None = None,
        worth: float = np.inf,
    ) -> Solution:
        """Return the answer that is reached from a start.

        The start is the programme's vector, see `pack`.  `reach` is how far, relatively, a
        parameter may move; `tighten` the relative tightening of bounds by member and name of the
        limit.  What costs more than `worth` (its logarithm) after some steps is given up.
        """
        low, high = self._box(start, reach)
        found = descend(
            lambda x: self.evaluate(x, tighten),
            lambda x: self.glance(x, tighten),
            self.stable,
            start,
            low,
            high,
            logarithmic=np.append(
                self._logarithmic, np.ones(self.size - self._unit.size, np.bool_)
            ),
            tolerance=self._tolerance,
            most=self._most,
            worth=worth,
            guarded=self._guarded,
        )
        return self._solution(found, tighten)

    def _box(self, start: FloatArray, reach: float | None) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest values that variables may take from a start."""
        family, count = self.family, self._unit.size
        low, high = start - _ROOM, start + _ROOM
        low[:count] = self._placed([p.low for p in family.parameters])
        high[:count] = self._placed([p.high for p in family.parameters])
        if reach is not None:
            near = start[:count]
            room = reach * np.where(self._logarithmic, 1.0, np.abs(near))
            low[:count] = np.maximum(low[:count], near - room)
            high[:count] = np.minimum(high[:count], near + room)
        return low, high

    def _bound(self, i: int, limit: Limit, tighten: Tighten | None) -> float:
        step = (tighten or {}).get((i, limit.name), 0.0)
        return limit.bound * (1.0 + step if limit.at_least else 1.0 - step)

    def _numbers(
        self, x: FloatArray, tighten: Tighten | None = None, *, shift: float = 0.0
    ) -> tuple[list[FloatArray], list[tuple[tuple[int, str], FloatArray]]]:
        """Return log costs, and rows by member and limit, without slopes."""
        costs, rows, _, _ = self._parts(x, tighten, slopes=False, shift=shift)
        plain = [(key, np.asarray(value_of(row))) for key, row, _ in rows]
        return [np.asarray(value_of(c)) for c, _ in costs], plain

    def _parts(
        self, x: FloatArray, tighten: Tighten | None, *, slopes: bool, shift: float = 0.0
    ) -> tuple[
        list[tuple[Any, int]],
        list[tuple[tuple[int, str], Any, int]],
        list[tuple[Any, int]],
        list[FloatArray],
    ]:
        family = self.family
        values = self._values(x)
        costs: dict[int, Any] = {}
        curvatures: dict[int, FloatArray] = {}
        rows: list[tuple[tuple[int, str], Any, int]] = []
        balances: list[tuple[Any, int]] = []
        for group, loop in zip(family.groups, self._loops, strict=True):
            first = group[0]
            logs = x[self._elements_at[first]]
            extra = None if self._extra_at is None else float(x[self._extra_at])
            own = family.scenarios[first].values(values)
            numbers, slow = loop.at(own, logs, extra, self._goal, slopes=slopes, exact=self._exact)
            for k, i in enumerate(group):
                problem = family.scenarios[i].problem
                seen = numbers if i == first else numbers.under(problem, loop.weights[k])
                for limit in problem.limits:
                    if not (limit.drive or i == first):
                        continue
                    bound: Any = self._bound(i, limit, tighten) * (1.0 + shift)
                    if self._goal is Goal.RELAX and limit.name in self._relaxed:
                        wider = exp(seen.extra)
                        bound = bound / wider if limit.at_least else wider * bound
                    row = limit.worst_rows(seen, bound)
                    if self._goal is Goal.FEASIBLE:
                        row = row - seen.extra
                    rows.append(((i, limit.name), row, first))
                costs[i] = seen.cost()
                if slopes:
                    curvatures[i] = seen.cost_curvature()
            # No limit of the case: it stops a real pole from creeping to zero, below every node.
            rows += [((first, _SLOW), row, first) for row in slow]
            if self._calm and family.scenarios[first].problem.dragged:
                row = loop.in_a_calm(own, logs, extra, slopes)
                rows.append(((first, _CALM), row, first))
            balances += [(balance, first) for balance in numbers.balances()]
        every = range(len(family.scenarios))
        bends = [curvatures[i] for i in every] if slopes else []
        return [(costs[i], i) for i in every], rows, balances, bends

    def glance(self, x: FloatArray, tighten: Tighten | None = None) -> Glance:
        """Return the programme at a vector, without slopes; see `solve`."""
        with np.errstate(all="ignore"):
            costs, rows, balances, _ = self._parts(x, tighten, slopes=False)
        logs = np.array([cost.item() for cost, _ in costs])
        values = [row.ravel() for _, row, _ in rows]
        objective = float(logs[0] - self._best[0])
        if self._extra_at is not None:
            objective = self._sign * float(x[self._extra_at])
        elif self._mean:
            objective = float(np.log(self.family.total(np.exp(logs))))
        elif self._bound_at is not None:
            objective = float(x[self._bound_at])
            values.append(logs - self._best - objective)
        equations = np.concatenate([np.zeros(0), *(balance for balance, _ in balances)])
        every = np.concatenate(values)
        return Glance(objective=objective, rows=every, equations=equations, costs=logs)

    @property
    def _sign(self) -> float:
        """With which the variable of a goal other than the cost is made small."""
        return -1.0 if self._goal is Goal.SEA else 1.0

    def evaluate(self, x: FloatArray, tighten: Tighten | None = None) -> Evaluation:
        """Return the programme at a vector, with slopes; see `solve`."""
        at = self._values(x)
        with np.errstate(all="ignore"):
            costs, rows, balances, curvatures = self._parts(x, tighten, slopes=True)
        values, slopes, firm = [], [], []
        for i, group in groupby(rows, key=itemgetter(2)):
            every = [(key, row.value.ravel(), row.slope) for key, row, _ in group]
            value = np.concatenate([value for _, value, _ in every])
            slope = np.concatenate([s.reshape(len(s), -1) for _, _, s in every], axis=1)
            values.append(value)
            slopes.append(self._spread(Dual(value, slope), i, at))
            calm = [key[1] == _CALM for key, _, _ in every]
            firm.append(np.repeat(calm, [value.size for _, value, _ in every]))
        spread = [(float(c.value.item()), self._spread(c, i, at)[0]) for c, i in costs]
        slope = np.zeros(self.size)
        if self._extra_at is not None:
            objective = self._sign * float(x[self._extra_at])
            slope[self._extra_at] = self._sign
        elif self._mean:
            weights = np.array([s.weight for s in self.family.scenarios])
            shares = weights * np.exp(2.0 * np.array([c for c, _ in spread]))
            objective = 0.5 * float(np.log(shares.sum() / weights.sum()))
            slope = (shares / shares.sum()) @ np.array([s for _, s in spread])
        elif self._bound_at is not None:
            objective, slope[self._bound_at] = float(x[self._bound_at]), 1.0
            for (cost, own), best in zip(spread, self._best, strict=True):
                own = own.copy()
                own[self._bound_at] = -1.0
                values.append(np.array([cost - best - objective]))
                slopes.append(own[None])
                firm.append(np.zeros(1, np.bool_))
        else:
            objective, slope = spread[0][0] - float(self._best[0]), spread[0][1]
        empty = np.zeros((0, self.size))
        # The members that the objective hangs on: all in a mean, the worst otherwise.
        excess = np.array([c for c, _ in spread]) - self._best
        shares = np.exp((2.0 if self._mean else _HANGING) * (excess - excess.max()))
        curvature = np.zeros((self.size, self.size))
        for (_, i), bend, share in zip(costs, curvatures, shares / shares.sum(), strict=True):
            turn = self._spread(Dual(np.zeros(len(bend)), np.eye(len(bend))), i, at)
            curvature += share * turn.T @ bend @ turn
        return Evaluation(
            curvature=curvature,
            objective=objective,
            costs=np.array([c for c, _ in spread]),
            slope=slope,
            rows=np.concatenate(values),
            jacobian=np.concatenate(slopes),
            firm=np.concatenate(firm),
            equations=np.concatenate([np.zeros(0), *(b.value for b, _ in balances)]),
            equation_slopes=np.concatenate([empty, *(self._spread(b, i, at) for b, i in balances)]),
        )

    def _spread(self, found: Dual, i: int, values: FloatArray) -> FloatArray:
        """Return the slopes of a vector by the programme's variables, (k, size)."""
        scenario, family = self.family.scenarios[i], self.family
        own = len(scenario.problem.law.parameters)
        slope = found.slope.reshape(len(found.slope), -1)
        result = np.zeros((slope.shape[1], self.size))
        by_own = slope[:own].T
        if scenario.blend is not None:
            by_own = by_own @ scenario.blend
        result[:, : family.scales.size] = by_own * np.where(self._logarithmic, values, self._unit)
        of = self._elements_at[i]
        result[:, of] = slope[own : own + of.stop - of.start].T
        if self._extra_at is not None:
            result[:, self._extra_at] = slope[-1]
        return result

    def _solution(self, found: Descent, tighten: Tighten | None) -> Solution:
        family, x = self.family, found.x
        with np.errstate(all="ignore"):
            reached = np.isfinite(found.at.objective)
            costs = np.full(len(family.scenarios), np.inf)
            if reached:
                costs = np.exp(found.at.costs)
        pressure = np.ones(len(family.scenarios))
        if self._bound_at is not None and reached:
            pressure = found.prices[-len(family.scenarios) :]
        elif self._mean:
            pressure = np.array([s.weight for s in family.scenarios]) * costs**2
        extra = 0.0 if self._extra_at is None else float(x[self._extra_at])
        objective = float(np.log(family.total(costs))) if reached else np.inf
        if self._extra_at is not None:
            objective = found.at.objective
        return Solution(
            # At the end of a range a step and a logarithm round, and what is beyond it is refused.
            values=np.clip(self._values(x), *self._range),
            coefficients=self._coefficients(x),
            objective=objective,
            extra=extra,
            converged=found.converged,
            message=found.message,
            iterations=found.steps,
            # Nobody asks what a limit costs on the way.
            prices=self._prices(found, tighten) if reached and self._calm else self._free(),
            costs=np.asarray(costs),
            pressure=np.asarray(pressure / max(float(np.sum(pressure)), 1e-300)),
        )

    def _free(self) -> tuple[dict[str, float], ...]:
        return tuple({lim.name: 0.0 for lim in s.problem.limits} for s in self.family.scenarios)

    def _prices(self, found: Descent, tighten: Tighten | None) -> tuple[dict[str, float], ...]:
        """Return the price of each limit: multipliers times the slope of its rows by its bound."""
        result = self._free()
        above = self._numbers(found.x, tighten, shift=_SHIFT)[1]
        below = self._numbers(found.x, tighten, shift=-_SHIFT)[1]
        at = 0
        for (key, more), (_, less) in zip(above, below, strict=True):
            own = found.prices[at : at + more.size]
            at += more.size
            if key[1] not in (_SLOW, _CALM) and more.shape == less.shape and own.size == more.size:
                result[key[0]][key[1]] = float(own @ (more - less)) / (2.0 * _SHIFT)
        return result


class _Loop:
    """One loop on its nodes and margin frequencies."""

    def __init__(
        self,
        members: Sequence[FamilyLoop],
        nodes: Quadrature,
        omega: FloatArray,
        reference: FloatArray,
    ) -> None:
        problem = self.problem = members[0].problem
        self.weights = [moment_weights(member.problem, nodes) for member in members]
        self.omega, still = on_sides(problem, omega)
        slow, slow_still = on_sides(problem, np.array([problem.slow_point]))
        self._blocks = (
            problem.blocks(1j * nodes.omega),
            problem.margin_blocks(1j * omega).repeated(slow.size),
            problem.margin_blocks(slow[:1]).repeated(slow.size),
        )
        self._s = np.concatenate([blocks.s for blocks in self._blocks])
        self._still = np.concatenate([np.zeros(nodes.omega.size, np.bool_), still, slow_still])
        ends = np.cumsum([0, *(blocks.s.size for blocks in self._blocks)]).tolist()
        self._parts = [slice(*pair) for pair in pairwise(ends)]
        # Reference coefficients: the loop as the plant holds it.
        known = [element.reference for element in problem.elements]
        begin = Point(values=list(members[0].values(reference)), coefficients=known)
        self._scales = np.array([p.scale for p in problem.law.parameters])
        last = self._blocks[-1]
        there = LoopResponses(last, begin.closing(problem, last.s)).determinant()
        self._there = float(np.real(there[0]))

    def at(
        self,
        values: FloatArray,
        logs: FloatArray,
        extra: float | None,
        goal: Goal,
        *,
        slopes: bool,
        exact: bool,
    ) -> tuple[LoopNumbers, list[Any]]:
        """Return the loop's numbers at a point, and the rows that keep slow poles off."""
        point = Point(
            values=[float(v) for v in values],
            coefficients=np.exp(logs).tolist(),
            slopes=slopes,
        )
        closing = point.closing(self.problem, self._s, self._still)
        cost, margins, slow = (
            LoopResponses(blocks, closing.part(part))
            for blocks, part in zip(self._blocks, self._parts, strict=True)
        )
        count = values.size + logs.size
        numbers = LoopNumbers(
            self.problem,
            cost,
            margins,
            self.weights[0],
            self.omega,
            point,
            logs=[
                _variable(float(v), values.size + k, count, extra, slopes)
                for k, v in enumerate(logs)
            ],
            extra=_variable(extra, -1, count, extra, slopes),
            goal=goal,
            fresh=partial(self._fresh, point) if exact else None,
        )
        return numbers, [self._no_slow_pole(slow, extra)]

    def _fresh(self, point: Point, omega: FloatArray, still: BoolArray) -> LoopResponses:
        """Return the closed loop at other frequencies, without losses where `still` is true."""
        blocks, problem = self.problem.margin_blocks(1j * omega), self.problem
        return LoopResponses(blocks, point.closing(problem, blocks.s, still))

    def _no_slow_pole(self, slow: LoopResponses, extra: float | None) -> Any:
        """Return a row that keeps real poles from crossing -decay.

        det(I - C yu) at a real point s is the characteristic function over that of the open loop,
        and cannot change its sign unless a real pole passes s.  Complex poles cannot reach the axis
        through |1 + L| > 0, but a real one may creep up to zero, below every frequency node;
        stability alone would let it crawl there.
        """
        found = slow.determinant()
        if not isinstance(found, Dual):
            return 1e-6 - np.real(found) / self._there
        return 1e-6 - _padded(real(found), extra) / self._there

    def in_a_calm(
        self, values: FloatArray, logs: FloatArray, extra: float | None, slopes: bool
    ) -> Any:
        """Return rows that keep the poles which hang on drag stable without it.

        Drag is none in small motion.  With drag the margins keep complex poles off the axis; one
        that has much of its decay from drag may cross it without, all limits kept, and a descent
        that knew no row there would end at the edge of what it may evaluate.  The slope of a pole
        s is that of det(I - C yu) by the parameters over that by s.
        """
        problem = self.problem
        still = problem.still(np.exp(logs).tolist())
        calm, dragged = (
            poles[poles.imag > 0.0]
            for poles in problem.lively_poles(values, problem.nothing, still)
        )
        if not calm.size or not dragged.size:
            calm = dragged = calm[:0]
        else:
            dragged = dragged[np.abs(calm[:, None] - dragged).argmin(axis=1)]
        poles = calm[calm.real > _HANGS * dragged.real]
        # At the pole itself the matrix is singular.
        points = np.concatenate([poles * (1.0 + _BESIDE), poles * (1.0 - _BESIDE)])
        own = [float(v) for v in values]
        closing = Point(values=own, coefficients=problem.nothing, slopes=True).closing(
            problem, points
        )
        found = LoopResponses(problem.blocks(points), closing).determinant()
        above, below = np.split(found.value, 2)
        by_parameters = sum(np.split(found.slope, 2, axis=1))
        moved = by_parameters * (_BESIDE * poles) / (below - above)
        pole = Dual(poles, moved)
        damping = real(pole) / -sqrt(squared(pole))
        sizes = np.maximum(np.abs(values), _SMALL * self._scales)
        sizes = np.append(sizes, np.ones(logs.size))
        movable = np.abs(damping.slope * sizes[:, None]).max(axis=0) > _LEAST_DAMPING
        row = (_LEAST_DAMPING - damping[movable]) * _STEEP
        return _padded(row, extra) if slopes else row.value


def _padded(found: Dual, extra: float | None) -> Dual:
    """Return a number with a slope of zero by the variable of the goal, if there is one."""
    if extra is None:
        return found
    return Dual(found.value, np.concatenate([found.slope, np.zeros_like(found.slope[:1])]))


def _variable(value: float | None, at: int, count: int, extra: float | None, slopes: bool) -> Any:
    """Return one of the variables that follow the parameters, with its own slope."""
    if value is None:
        return None
    number = np.array([value])
    if not slopes:
        return number
    slope = np.zeros((count + (extra is not None), 1))
    slope[at] = 1.0
    return Dual(number, slope)
