"""Polishing of a solution by the exchange of nodes, until no limit is broken between them.

The exchange method of semi-infinite programming: solve, look where a limit is pressed
hardest, make those places nodes, solve again.  What leaves here has been looked at on
refined frequencies and adaptive quadrature, not on the nodes it was solved on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.basics import FloatArray

from ..loop import Assessment
from ..question import Goal, Problem
from .nodes import cost_nodes, margin_nodes
from .programme import Programme, Solution, SolverPace

KEPT = 1e-5  # a limit counts as kept up to this relative excess
_MOST_CRITICAL = 300  # frequencies that one assessment adds
_ROUNDS = 12  # of the exchange of nodes
_LATE = 4  # rounds after which it settles for less
_LATE_HAIR = 2e-4  # relative excess that is then mended by tightening
_REACH = 0.3  # how far, relatively, a round of the exchange may move a parameter
_FAR_REACH = 3.0  # ... where it must leave the neighbourhood to keep the limits
_CLOSE = 3e-2  # relative excess below which a start counts as the answer itself
_HAIR = 2e-2  # relative excess that tightening may still mend
_SETTLED = 2e-5  # change of the log cost below which the exchange has settled


def polish(
    problem: Problem,
    solved: Solution,
    reference: FloatArray,
    goal: Goal = Goal.COST,
    relaxed: Sequence[str] = (),
) -> tuple[Solution, Assessment, float]:
    """Return a solution on refined nodes: exchange until no limit is broken between them.

    Also returned: its assessment, and the largest relative excess over a limit.
    """
    before, broken = np.zeros(0), np.zeros(0)
    assessment, excess = assess(problem, solved, goal, relaxed)
    best = (excess > KEPT, solved.objective, solved, assessment, excess)
    hairs: dict[str, float] = {}
    for k in range(_ROUNDS):
        late = k >= _LATE
        if late:
            # In a flat valley the peaks wander for ever: what a hair mends need not be waited for.
            for name, over in _overs(problem, assessment, relaxed).items():
                if 0.5 * KEPT < over < _LATE_HAIR:
                    hairs[name] = hairs.get(name, 0.0) + 1.1 * over
        # Where a limit was broken stays a node; what was merely close stays for one more round.
        critical = thinned([limit.critical(assessment) for limit in problem.limits])
        broken = np.concatenate([broken, *(limit.worst(assessment) for limit in problem.limits)])
        held, before = np.concatenate([before, critical, broken]), critical
        programme = Programme(
            problem,
            cost_nodes(problem, [assessment]),
            np.unique(np.concatenate([margin_nodes(problem, [assessment.poles], 60), held])),
            goal,
            reference=reference,
            relaxed=relaxed,
            tolerance=1e-9,
        )
        start = programme.pack(solved.values, solved.coefficient, solved.extra)
        again = _any_pace(programme, start, excess, hairs, follow=goal is Goal.COST)
        if again is None:
            break
        moved = abs(again.objective - solved.objective)
        solved = again
        assessment, excess = assess(problem, solved, goal, relaxed)
        # The exchange need not descend: a round may leak anew, so the best so far is kept.
        if (excess > KEPT, solved.objective) < best[:2] or best[0]:
            best = (excess > KEPT, solved.objective, solved, assessment, excess)
        if excess <= (KEPT if late else 0.5 * KEPT) and moved < (5.0 if late else 1.0) * _SETTLED:
            break
    return best[2:] if not best[0] else _tightened(problem, best[2:], programme, goal, relaxed)


def thinned(critical: Sequence[FloatArray], most: int = _MOST_CRITICAL) -> FloatArray:
    """Return all critical frequencies, or an even choice where there are more than `most`."""
    every = np.unique(np.concatenate([np.zeros(0), *critical]))
    return np.asarray(every[:: 1 + every.size // most])


def _any_pace(
    programme: Programme,
    start: FloatArray,
    excess: float,
    tighten: Mapping[str, float],
    *,
    follow: bool,
) -> Solution | None:
    """Return an answer near the start, by whichever pace of the solver gets there."""
    # From the answer itself a few quadratic programmes do; an interior point must first leave
    # the limits that bind, and so comes after.
    if follow and excess < _CLOSE:
        near = programme.follow(start, None, tighten)
        if near is not None and programme.problem.stable(near.values, near.coefficient):
            return near
    if excess < _CLOSE:
        tries = [(SolverPace.THERE, _REACH), (SolverPace.NEAR, _REACH)]
    else:
        tries = [(SolverPace.NEAR, _REACH), (SolverPace.FAR, _REACH), (SolverPace.NEAR, _FAR_REACH)]
    for pace, reach in tries:
        solved = programme.solve(start, reach, tighten, pace)
        if solved.converged and programme.problem.stable(solved.values, solved.coefficient):
            return solved
    return None


def _tightened(
    problem: Problem,
    answer: tuple[Solution, Assessment, float],
    programme: Programme,
    goal: Goal,
    relaxed: Sequence[str],
) -> tuple[Solution, Assessment, float]:
    """Return an answer that keeps the limits, from one that breaks them by a hair.

    Where the exchange does not settle, the bounds are tightened by what they were broken by;
    the cost of that is of the same order, and stands in no report as a price.
    """
    solved, assessment, excess = answer
    if not solved.converged or excess > _HAIR:
        return answer
    tighten: dict[str, float] = {}
    for _ in range(3):
        for name, over in _overs(problem, assessment, relaxed).items():
            if over > 0.5 * KEPT:
                tighten[name] = tighten.get(name, 0.0) + 1.1 * over
        start = programme.pack(solved.values, solved.coefficient, solved.extra)
        again = programme.solve(start, _REACH, tighten, SolverPace.NEAR)
        if not (again.converged and problem.stable(again.values, again.coefficient)):
            return answer
        solved = again
        assessment, excess = assess(problem, solved, goal, relaxed)
        if excess <= KEPT:
            return solved, assessment, excess
    return answer


def assessment_of(problem: Problem, solved: Solution, amplitude: float = 1.0) -> Assessment:
    """Return a solution in numbers, the disturbances' amplitudes times `amplitude`."""
    scaled = tuple(d.scaled(amplitude) for d in problem.disturbances)
    return replace(problem, disturbances=scaled).assess(solved.values, solved.coefficient)


def assess(
    problem: Problem, solved: Solution, goal: Goal = Goal.COST, relaxed: Sequence[str] = ()
) -> tuple[Assessment, float]:
    """Return a solution in numbers, and its largest relative excess over a limit."""
    assessment = assessment_of(
        problem, solved, float(np.exp(solved.extra)) if goal is Goal.SEA else 1.0
    )
    return assessment, max(_overs(problem, assessment, relaxed).values(), default=0.0)


def _overs(problem: Problem, assessment: Assessment, relaxed: Sequence[str]) -> dict[str, float]:
    """Return the relative excess over each limit that counts, by name."""
    return {
        limit.name: limit.use(limit.measure(assessment)) - 1.0
        for limit in problem.limits
        if limit.name not in relaxed
    }
