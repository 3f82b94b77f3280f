"""A Pareto front on better nodes: until no point breaks a limit between them.

    Walk -> stretches of neighbouring points, a programme each -> looks, nodes where one leaked
         -> what is left, polished alone -> points

Neighbouring points have their peaks at nearly the same frequencies, so that a stretch of the
front needs few nodes; solves within a stretch begin with their neighbour's multipliers.  Nothing
leaves here that has not been looked at on refined frequencies and adaptive quadrature.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from models.basics import FloatArray

from ..loop import Assessment
from ..question import Problem
from ..search import KEPT, Pace, Programme, Solution, polish, thinned, view_of
from .pareto_point import ParetoPoint, point_of
from .pareto_walk import Walk, local_programme, with_bound

Progress = Callable[[str, int, int], None]

_STRETCH = 8  # points that share a programme
_PER_DECADE = 15  # margin nodes away from what is critical: the points hardly move any more
_CRITICAL = 150  # frequencies that a stretch adds at a time
_RTOL = 1e-6  # of the variances
_ROUNDS = 9  # of the exchange of nodes over a stretch
_FIRST_HAIR, _HAIR = 1e-4, 1e-3  # excess that tightening mends, at first and later
_SHARE = 1.1  # of what a limit is broken by, by which it is tightened


def exchanged(walk: Walk, tell: Progress) -> list[tuple[float, ParetoPoint | None]]:
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

    def __init__(self, walk: Walk, indices: Sequence[int]) -> None:
        self._walk, self._indices = walk, indices
        self._own: dict[int, Problem] = {
            i: with_bound(walk.problem, walk.name, float(walk.bounds[i])) for i in indices
        }
        self._solved: dict[int, Solution] = {}
        for i in indices:
            solved = walk.best[i]
            assert solved is not None
            self._solved[i] = solved
        self._views = {i: view_of(self._own[i], self._solved[i]) for i in indices}
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
            self._views[index],
            self._walk.bound,
        )

    def _programme(self, left: Sequence[int]) -> Programme:
        """Return a programme with nodes where any of some points is critical or leaked."""
        # At first every other one says enough; what the rest leak will be seen.
        looked = left if self._worst else left[:: 2 if len(left) > 2 else 1]
        critical = []
        for i in looked:
            for limit in self._own[i].limits:
                critical.append(limit.critical(self._views[i]))
                self._worst.append(limit.worst(self._views[i]))
        some = list(dict.fromkeys([looked[0], looked[len(looked) // 2], looked[-1]]))
        views: list[Assessment] = [self._views[i] for i in some]
        held = [thinned(critical, _CRITICAL), *self._worst]
        return local_programme(
            self._walk.problem, views, held, self._walk.reference, _RTOL, _PER_DECADE
        )

    def _solve_again(self, left: Sequence[int], programme: Programme) -> None:
        walk = self._walk
        last: Solution | None = None
        for i in left:
            hairs = self._hairs[i]
            tighten = {**hairs, walk.name: walk.steps[i] + hairs.get(walk.name, 0.0)}
            x = programme.pack(self._solved[i].values, self._solved[i].coefficient)
            again = programme.follow(x, last, tighten)
            for pace in (Pace.NEAR, Pace.FAR, None):
                if again is not None and self._sound(again):
                    self._solved[i] = last = again
                    self._views[i] = view_of(self._own[i], again)
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
            over = limit.use(limit.measure(self._views[index])) - 1.0
            largest = max(largest, over)
            if 0.5 * KEPT < over < mends:
                hairs = self._hairs[index]
                hairs[limit.name] = hairs.get(limit.name, 0.0) + _SHARE * over
        return largest


def _alone(walk: Walk, index: int) -> ParetoPoint | None:
    """Return a point polished as any single answer is; None if that does not keep its limits."""
    own = with_bound(walk.problem, walk.name, float(walk.bounds[index]))
    solved = walk.best[index]
    assert solved is not None
    again, view, _ = polish(own, solved, walk.reference)
    point = point_of(own, walk.name, float(walk.bounds[index]), again, view)
    return point if point.ok else None
