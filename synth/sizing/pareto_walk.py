"""Continuation along a Pareto front: one programme, a bound that moves, warm starts.

    answers of searches -> predictor, warm solve, next bound ... -> best answer at each bound

Walks begin at the answers of multi-start searches, go both ways and end where another walk has
been with a better answer.  Each solve begins at the point that its two neighbours lead to, with
the multipliers of the nearer one, so that a few iterations do.  What leaks between the nodes is
seen on a dense grid, and becomes a node on the way; nodes that nothing came near for a while are
dropped.  What leaves here is a front on moderate nodes, for `synth.sizing.pareto_walk`.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.basics import FloatArray

from ..loop import Assessment
from ..question import Problem
from ..search import (
    KEPT,
    Programme,
    Progress,
    Solution,
    SolverPace,
    assessment_of,
    cost_nodes,
    margin_nodes,
    polish,
    thinned,
)
from .pareto_point import ParetoPoint, point_of

Place = tuple[float, FloatArray]  # a step, and the programme's vector there

_SAME = 1e-6  # log costs that differ by less are the same answer
_LEAK = 5e-3  # relative excess over a limit that an answer may leak between the nodes
_SUSPECT = 5e-3  # largest row on the dense grid from which on an answer is looked at
_TRIES = 6  # at one bound
_PARTS = (1, 3, 10)  # of a step to the next bound
_RENEWALS = 80  # of the nodes, over a front
_REMEMBERED = 5  # leaks whose neighbourhoods are nodes
_VIEWS = 9  # loops that make the nodes of a programme
_DENSE = 250  # nodes per decade of the grid on which leaks are seen
_SPARSE = 30  # margin nodes per decade where nothing is known to be critical
_CRITICAL = 100  # critical frequencies that a programme has as nodes, about
_LEAST_STEP = 1e-12  # between two bounds, relative
_STRETCH = 8  # points that share a programme
_PER_DECADE = 15  # margin nodes away from what is critical: the points hardly move any more
_STRETCH_CRITICAL = 150  # frequencies that a stretch adds at a time
_RTOL = 1e-6  # of the variances
_ROUNDS = 9  # of the exchange of nodes over a stretch
_FIRST_HAIR, _HAIR = 1e-4, 1e-3  # excess that tightening mends, at first and later
_SHARE = 1.1  # of what a limit is broken by, by which it is tightened


class FrontWalk:
    """Walks along the bounds of one programme, and the best answer found at each."""

    def __init__(self, problem: Problem, name: str, bounds: FloatArray) -> None:
        self.problem, self.name, self.bounds = problem, name, bounds
        self.begins: list[tuple[int, FloatArray, float | None]] = []
        self.best: list[Solution | None] = [None] * len(bounds)
        limit = next(lim for lim in problem.limits if lim.name == name)
        self.bound = limit.bound  # that the programme is made with
        # As `Programme.solve` takes it: a bound relative to the one it was made with.
        self._at_least = limit.at_least
        self.steps = [(b / limit.bound - 1.0) * (1 if limit.at_least else -1) for b in bounds]
        self.reference = np.zeros(0)
        self._held: deque[FloatArray] = deque(maxlen=_REMEMBERED)
        self._assessments: list[Assessment] = []
        self._renewed = 0

    def go(self, tell: Progress) -> None:
        """Walk both ways from every beginning, then look at what is out of order."""
        problem = self.problem
        # The reference normalises the row that keeps slow poles off: a briskly stable point does.
        stable = [b for b in self.begins if problem.stable(b[1], b[2])]
        self.reference = min((b[1] for b in stable), key=problem.abscissa)
        self._assessments = [
            problem.assess(values, coefficient) for _, values, coefficient in stable
        ]
        poles = [assessment.poles for assessment in self._assessments[:4]]
        nodes = cost_nodes(problem, self._assessments[:_VIEWS], rtol=1e-5)
        dense = margin_nodes(problem, poles, _DENSE)
        self._dense = Programme(problem, nodes, dense, reference=self.reference)
        self._state_again()
        for k, (at, values, coefficient) in enumerate(stable):
            tell("walking along the front", k, len(stable))
            x = self.programme.pack(values, coefficient)
            self._along(range(at, len(self.bounds)), x)
            self._along(range(at - 1, -1, -1), x)
        self._put_in_order()

    def _put_in_order(self) -> None:
        """Begin again where a point is missing or worse than its tighter neighbour.

        What serves a tight bound serves a looser one.
        """
        tighter_first = range(len(self.bounds))
        if self.steps[0] < self.steps[-1]:
            tighter_first = tighter_first[::-1]
        for order in (tighter_first, tighter_first[::-1]):
            for i, j in itertools.pairwise(order):
                one, other = self.best[i], self.best[j]
                if one is None:
                    continue
                worse = order is tighter_first and (
                    other is not None and one.objective < other.objective - _SAME
                )
                if other is None or worse:
                    x = self.programme.pack(one.values, one.coefficient)
                    self._along(order[order.index(j) :], x)

    def _state_again(self) -> None:
        self.programme = local_programme(
            self.problem, self._assessments, list(self._held), self.reference, rtol=1e-5
        )

    def _along(self, order: Sequence[int], x: FloatArray) -> None:
        """Go on from bound to bound until another walk has been there with a better answer."""
        before: tuple[float, FloatArray] | None = None
        last: Solution | None = None
        for n, i in enumerate(order):
            here = (self.steps[order[n - 1]], x) if n > 0 else None
            solved = self._reached(before, here or (self.steps[i], x), self.steps[i], last)
            if solved is None:
                return
            # Where another walk has done as well this one would only follow it: it ends there, but
            # for its own beginning, which it may share.
            known = self.best[i]
            if known is not None and solved.objective > known.objective - _SAME:
                if n > 0 or known.objective < solved.objective - _SAME:
                    return
            else:
                self.best[i] = solved
            before = here
            x, last = self.programme.pack(solved.values, solved.coefficient), solved

    def _reached(
        self, before: Place | None, here: Place, step: float, last: Solution | None
    ) -> Solution | None:
        """Return an answer at a step from where a walk stands, in smaller steps if it must be."""
        # A basin may turn too sharply for one step: then three, then ten, each from the last.
        for parts in _PARTS:
            at, behind, solved = here, before, last
            for k in range(1, parts + 1):
                target = here[0] + (step - here[0]) * k / parts
                ahead = at[1] if behind is None else _led(behind, at, target)
                solved = self._solved(at[1], ahead, target, solved)
                if solved is None:
                    break
                behind, at = at, (target, self.programme.pack(solved.values, solved.coefficient))
            if solved is not None:
                return solved
            if here[0] == step:
                return None
        return None

    def _solved(
        self, x: FloatArray, ahead: FloatArray, step: float, last: Solution | None
    ) -> Solution | None:
        """Return a stable answer at a step that does not leak between the nodes, if any."""
        own = with_bound(self.problem, self.name, self._bound(step))
        loop = [limit for limit in own.limits if not limit.drive]
        for _ in range(_TRIES):
            solved = self._answer(x, ahead, last, {self.name: step})
            if solved is None:
                return None
            assessment = self._leaking(solved, own, step)
            if assessment is None:
                return solved
            if self._renewed >= _RENEWALS:
                return None
            # It slipped through between the nodes: where it did becomes a node.
            self._renewed += 1
            # Only what is merely close may be thinned out.
            near = thinned([limit.critical(assessment) for limit in loop], _CRITICAL)
            self._held.append(np.concatenate([near, *(limit.worst(assessment) for limit in loop)]))
            self._state_again()
        return None

    def _bound(self, step: float) -> float:
        """Return the bound at a step."""
        return float(self.bound * (1.0 + (step if self._at_least else -step)))

    def _answer(
        self, x: FloatArray, ahead: FloatArray, last: Solution | None, tighten: dict[str, float]
    ) -> Solution | None:
        """Return a stable answer on the nodes, by the quickest way that leads to one."""
        programme, stable = self.programme, self.problem.stable
        # A few quadratic programmes, begun with the neighbour's multipliers, mostly do; IPOPT, from
        # near and from far, is for where other limits come to bind.
        if last is not None:
            for start in (ahead, x):
                near = programme.follow(start, last, tighten)
                if near is not None and stable(near.values, near.coefficient):
                    return near
        for pace in (SolverPace.NEAR, SolverPace.FAR):
            solved = programme.solve(x, tighten=tighten, pace=pace)
            if solved.converged and stable(solved.values, solved.coefficient):
                return solved
        return None

    def _leaking(self, solved: Solution, own: Problem, step: float) -> Assessment | None:
        """Return the assessment of an answer that leaks through a limit, None if it does not."""
        x = self._dense.pack(solved.values, solved.coefficient)
        rows = self._dense.violations(x, {self.name: step})[1]
        loop = [limit for limit in own.limits if not limit.drive]
        if all(rows[limit.name] < _SUSPECT for limit in loop):
            return None
        assessment = assessment_of(own, solved)
        leaks = any(lim.use(lim.measure(assessment)) >= 1.0 + _LEAK for lim in loop)
        return assessment if leaks else None


def local_programme(
    problem: Problem,
    assessments: Sequence[Assessment],
    held: Sequence[FloatArray],
    reference: FloatArray,
    rtol: float,
    per_decade: int = _SPARSE,
) -> Programme:
    """Return a programme whose nodes suit a few loops of a front.

    Parameters
    ----------
    problem, reference
        The problem with the bound that its programmes are made with, and a briskly stable point.
    assessments
        Loops whose poles and critical frequencies make nodes.
    held
        Further margin nodes [rad/s].
    rtol
        Of the variances.
    per_decade
        Margin nodes where nothing is known to be critical.
    """
    chosen = list(assessments)[:_VIEWS]
    critical = [limit.critical(assessment) for assessment in chosen for limit in problem.limits]
    omega = margin_nodes(problem, [assessment.poles for assessment in chosen[:4]], per_decade)
    return Programme(
        problem,
        cost_nodes(problem, chosen, rtol=rtol),
        np.unique(np.concatenate([omega, thinned(critical, _CRITICAL), *held])),
        reference=reference,
        tolerance=1e-8,
    )


def with_bound(problem: Problem, name: str, bound: float) -> Problem:
    """Return the problem with another bound of one of its limits."""
    limits = tuple(replace(m, bound=bound) if m.name == name else m for m in problem.limits)
    return replace(problem, limits=limits)


def _led(before: Place, here: Place, step: float) -> FloatArray:
    """Return where two points of a walk lead to at the next step, by a straight line."""
    gap = here[0] - before[0]
    if abs(gap) < _LEAST_STEP:
        return here[1]
    share = np.clip((step - here[0]) / gap, 0.0, 2.0)
    return np.asarray(here[1] + share * (here[1] - before[1]), dtype=np.float64)


def exchanged(walk: FrontWalk, tell: Progress) -> list[tuple[float, ParetoPoint | None]]:
    """Return the front with nodes where any of its points leaked through a limit."""
    there = [i for i, solved in enumerate(walk.best) if solved is not None]
    stretches = [there[k : k + _STRETCH] for k in range(0, len(there), _STRETCH)]
    found: list[ParetoPoint | None] = [None] * len(walk.bounds)
    for n, stretch in enumerate(stretches):
        tell("between the nodes", n, len(stretches))
        work = _Stretch(walk, stretch)
        work.settle()
        for i in stretch:
            point = work.point(i)
            found[i] = point if point.ok else _alone(walk, i)
    return [(float(bound), point) for bound, point in zip(walk.bounds, found, strict=True)]


class _Stretch:
    """Neighbouring points of a front, solved again until none leaks."""

    def __init__(self, walk: FrontWalk, indices: Sequence[int]) -> None:
        self._walk, self._indices = walk, indices
        self._own: dict[int, Problem] = {
            i: with_bound(walk.problem, walk.name, float(walk.bounds[i])) for i in indices
        }
        self._solved: dict[int, Solution] = {}
        for i in indices:
            solved = walk.best[i]
            assert solved is not None
            self._solved[i] = solved
        self._assessments = {i: assessment_of(self._own[i], self._solved[i]) for i in indices}
        self._hairs: dict[int, dict[str, float]] = {i: {} for i in indices}
        self._worst: list[FloatArray] = []

    def settle(self) -> None:
        """Solve and look in turns; those that keep their limits are left alone."""
        left = list(self._indices)
        for k in range(_ROUNDS):
            self._solve_again(left, self._programme(left))
            left = [i for i in left if self._excess(i, _HAIR if k else _FIRST_HAIR) > KEPT]
            if not left:
                return

    def point(self, index: int) -> ParetoPoint:
        """Return one of the points as it is now."""
        return point_of(
            self._own[index],
            self._walk.name,
            float(self._walk.bounds[index]),
            self._solved[index],
            self._assessments[index],
            self._walk.bound,
        )

    def _programme(self, left: Sequence[int]) -> Programme:
        """Return a programme with nodes where any of some points is critical or leaked."""
        # At first every other one says enough; what the rest leak will be seen.
        looked = left if self._worst else left[:: 2 if len(left) > 2 else 1]
        critical = []
        for i in looked:
            for limit in self._own[i].limits:
                critical.append(limit.critical(self._assessments[i]))
                self._worst.append(limit.worst(self._assessments[i]))
        some = list(dict.fromkeys([looked[0], looked[len(looked) // 2], looked[-1]]))
        assessments: list[Assessment] = [self._assessments[i] for i in some]
        held = [thinned(critical, _STRETCH_CRITICAL), *self._worst]
        return local_programme(
            self._walk.problem, assessments, held, self._walk.reference, _RTOL, _PER_DECADE
        )

    def _solve_again(self, left: Sequence[int], programme: Programme) -> None:
        walk = self._walk
        last: Solution | None = None
        for i in left:
            hairs = self._hairs[i]
            tighten = {**hairs, walk.name: walk.steps[i] + hairs.get(walk.name, 0.0)}
            x = programme.pack(self._solved[i].values, self._solved[i].coefficient)
            again = programme.follow(x, last, tighten)
            for pace in (SolverPace.NEAR, SolverPace.FAR, None):
                if again is not None and self._sound(again):
                    self._solved[i] = last = again
                    self._assessments[i] = assessment_of(self._own[i], again)
                    break
                if pace is not None:
                    again = programme.solve(x, tighten=tighten, pace=pace)

    def _sound(self, solved: Solution) -> bool:
        problem = self._walk.problem
        return solved.converged and problem.stable(solved.values, solved.coefficient)

    def _excess(self, index: int, mends: float) -> float:
        """Return the largest relative excess; what is broken by a hair is tightened by it."""
        largest = 0.0
        for limit in self._own[index].limits:
            over = limit.use(limit.measure(self._assessments[index])) - 1.0
            largest = max(largest, over)
            if 0.5 * KEPT < over < mends:
                hairs = self._hairs[index]
                hairs[limit.name] = hairs.get(limit.name, 0.0) + _SHARE * over
        return largest


def _alone(walk: FrontWalk, index: int) -> ParetoPoint | None:
    """Return a point polished as any single answer is; None if that does not keep its limits."""
    own = with_bound(walk.problem, walk.name, float(walk.bounds[index]))
    solved = walk.best[index]
    assert solved is not None
    again, assessment, _ = polish(own, solved, walk.reference)
    point = point_of(own, walk.name, float(walk.bounds[index]), again, assessment)
    return point if point.ok else None
