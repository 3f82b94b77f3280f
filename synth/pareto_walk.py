"""Walking along a Pareto front: one programme, a bound that moves, each solve from its neighbour's.

Walks begin at the answers of multi-start searches, go both ways and end where another walk
has been with a better answer; what leaks between the nodes becomes a node on the way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .assess import Assessment
from .nodes import cost_nodes, margin_nodes
from .pareto_point import ParetoPoint, point_of
from .polish import KEPT, thinned, view_of
from .problem import Problem
from .programme import Pace, Programme, Solved

__all__ = ["Walk", "exchanged", "with_bound"]

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str, int, int], None]

_SAME = 1e-6  # log costs that differ by less are the same answer
_LEAK = 5e-3  # relative excess over a limit that an answer may leak between the nodes
_TRIES = 5  # at one bound
_RENEWALS = 40  # of the nodes, over a front
_ROUNDS = 5  # of the exchange of nodes over the front
_VIEWS = 9  # points of the front whose loops make the first nodes
_HAIR = 1.1  # of what a limit is broken by, by which it is tightened
_NEAR = 6e-3  # excess that tightening mends


class Walk:
    """Walks along the bounds of one programme, and the best answer found at each."""

    def __init__(self, problem: Problem, name: str, bounds: FloatArray) -> None:
        self.problem, self.name, self.bounds = problem, name, bounds
        self.begins: list[tuple[int, FloatArray, float | None]] = []
        self.best: list[Solved | None] = [None] * len(bounds)
        limit = next(lim for lim in problem.limits if lim.name == name)
        self.bound = limit.bound  # that the programme is made with
        # As `Programme.solve` takes it: a bound relative to the one it was made with.
        self.steps = [(b / limit.bound - 1.0) * (1 if limit.at_least else -1) for b in bounds]
        self.reference = np.zeros(0)
        self.held: list[FloatArray] = []
        self.views: list[Assessment] = []
        self.renewed = 0

    def go(self, tell: Progress) -> None:
        """Walk both ways from every beginning, then look at what is out of order."""
        problem = self.problem
        stable = [b for b in self.begins if problem.stable(b[1], b[2])]
        self.reference = min((b[1] for b in stable), key=problem.abscissa)
        self.views = [_looked(problem, values, coefficient) for _, values, coefficient in stable]
        self._state_again()
        for k, (at, values, coefficient) in enumerate(stable):
            tell("walking along the front", k, len(stable))
            x = self.programme.pack(values, coefficient)
            self._along(range(at, len(self.bounds)), x)
            self._along(range(at - 1, -1, -1), x)
        # What serves a tight bound serves a looser one: no point may be worse than its tighter
        # neighbour, else a walk begins there.
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
                    self._along(_from(order, j), x)

    def _state_again(self) -> None:
        self.programme = _programme(self.problem, self.views, self.held, self.reference, rtol=1e-5)

    def _along(self, order: Sequence[int], x: FloatArray) -> None:
        """Go on from bound to bound until another walk has been there with a better answer."""
        for n, i in enumerate(order):
            solved = self._solved(x, i)
            if solved is None:
                return
            known = self.best[i]
            if known is not None and solved.objective > known.objective - _SAME:
                if n > 0 or known.objective < solved.objective - _SAME:
                    return
            else:
                self.best[i] = solved
            x = self.programme.pack(solved.values, solved.coefficient)

    def _solved(self, x: FloatArray, index: int) -> Solved | None:
        """Return a stable answer at a bound that does not leak between the nodes, if any."""
        own = with_bound(self.problem, self.name, float(self.bounds[index]))
        loop = [limit for limit in own.limits if not limit.drive]
        pace = Pace.NEAR
        for _ in range(_TRIES):
            solved = self.programme.solve(x, tighten={self.name: self.steps[index]}, pace=pace)
            if not (solved.converged and self.problem.stable(solved.values, solved.coefficient)):
                if pace is Pace.FAR:
                    return None
                pace = Pace.FAR
                continue
            view = view_of(own, solved)
            if all(lim.use(lim.measure(view)) < 1.0 + _LEAK for lim in loop):
                return solved
            if self.renewed >= _RENEWALS:
                return None
            # It slipped through between the nodes: where it did becomes a node.
            self.renewed += 1
            self.held += [f(view) for lim in loop for f in (lim.critical, lim.worst)]
            self._state_again()
        return None


def _from(order: Sequence[int], first: int) -> list[int]:
    """Return the part of an order from one of its entries on."""
    listed = list(order)
    return listed[listed.index(first) :]


def exchanged(walk: Walk, tell: Progress) -> list[tuple[float, ParetoPoint | None]]:
    """Return the front with nodes where any of its points leaked through a limit."""
    problem, name, bounds, best = walk.problem, walk.name, walk.bounds, walk.best
    hairs: list[dict[str, float]] = [{} for _ in bounds]
    open_still = [i for i, solved in enumerate(best) if solved is not None]
    looks: dict[int, ParetoPoint] = {}
    programme: Programme | None = None
    for k in range(_ROUNDS):
        held = list(walk.held)
        for n, i in enumerate(open_still):
            tell("between the nodes", n, len(open_still))
            solved = best[i]
            assert solved is not None
            own = with_bound(problem, name, float(bounds[i]))
            view = view_of(own, solved)
            looks[i] = point_of(own, name, float(bounds[i]), solved, view, walk.bound)
            held += [limit.critical(view) for limit in own.limits]
            for limit in own.limits:
                over = limit.use(limit.measure(view)) - 1.0
                if 0.5 * KEPT < over < _NEAR:
                    hairs[i][limit.name] = hairs[i].get(limit.name, 0.0) + _HAIR * over
        open_still = [i for i in open_still if not looks[i].ok]
        if not open_still or k == _ROUNDS - 1:
            break
        if programme is None or k == 2:
            some = open_still[:: max(1, len(open_still) // _VIEWS)]
            views = [view_of(problem, solved) for i in some if (solved := best[i]) is not None]
            programme = _programme(problem, views, held, walk.reference, rtol=1e-7)
        for n, i in enumerate(open_still):
            tell("again on better nodes", n, len(open_still))
            solved = best[i]
            assert solved is not None
            tighten = {**hairs[i], name: walk.steps[i] + hairs[i].get(name, 0.0)}
            x = programme.pack(solved.values, solved.coefficient)
            for pace in (Pace.NEAR, Pace.FAR):
                again = programme.solve(x, tighten=tighten, pace=pace)
                if again.converged and problem.stable(again.values, again.coefficient):
                    best[i] = again
                    break
    found: list[tuple[float, ParetoPoint | None]] = []
    for i, bound in enumerate(bounds):
        point = looks.get(i)
        found.append((float(bound), point if point is not None and point.ok else None))
    return found


def _programme(
    problem: Problem,
    views: Sequence[Assessment],
    held: Sequence[FloatArray],
    reference: FloatArray,
    rtol: float,
) -> Programme:
    chosen = list(views)[:_VIEWS]
    critical = [limit.critical(view) for view in chosen for limit in problem.limits]
    omega = margin_nodes(problem, [view.poles for view in chosen[:4]], 40)
    return Programme(
        problem,
        cost_nodes(problem, chosen, rtol=rtol),
        np.union1d(omega, thinned([*critical, *held])),
        reference=reference,
        tolerance=1e-8,
    )


def with_bound(problem: Problem, name: str, bound: float) -> Problem:
    """Return the problem with another bound of one of its limits."""
    """Return the problem with another bound of one of its limits."""
    limits = tuple(replace(m, bound=bound) if m.name == name else m for m in problem.limits)
    return replace(problem, limits=limits)


def _looked(problem: Problem, values: FloatArray, coefficient: float | None) -> Assessment:
    return Assessment(
        problem.plant,
        problem.law.controller([float(v) for v in values]),
        problem.disturbances,
        drag=problem.drag,
        coefficient=coefficient,
    )
