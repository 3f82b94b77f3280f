"""Polishing over a family: exchange of nodes on every loop, assessed one by one.

What `synth.search.polishing` does for one loop.  Scenarios that share a loop share its nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from models.basics import FloatArray

from ..limits import Limit
from ..loop import Assessment, Disturbance
from ..question import FamilyProblem, Problem
from .family_programme import FamilyProgramme, FamilySolved
from .nodes import cost_nodes, margin_nodes
from .polishing import KEPT, assessment_of, thinned
from .programme import SolverPace

PER_DECADE = 16  # margin nodes of the first pass; the exchange finds what lies between
_ROUNDS = 10  # of the exchange of nodes
_EXCHANGED = 3  # rounds after which what is still broken is tightened
_REACH = 0.3  # how far, relatively, a round of the exchange may move a parameter
_HAIR = 1e-3  # relative excess that tightening may mend
_SETTLED = 2e-4  # change of the log objective below which the exchange has settled


def polish_family(
    family: FamilyProblem, solved: FamilySolved, reference: FloatArray
) -> tuple[FamilySolved, tuple[Assessment, ...], float]:
    """Return a solution on refined nodes, the assessment of each loop, and the largest excess.

    The exchange of `synth.search.polishing` on every loop: where a limit is pressed becomes a node.
    """
    assessments, excess = assessments_of(family, solved)
    broken = [np.zeros(0) for _ in family.groups]
    before = [np.zeros(0) for _ in family.groups]
    best = (excess > KEPT, solved.objective, solved, assessments, excess)
    tighten: dict[tuple[int, str], float] = {}
    for k_round in range(_ROUNDS):
        nodes, omega = [], []
        for k, group in enumerate(family.groups):
            problem, assessment = family.scenarios[group[0]].problem, assessments[group[0]]
            before[k] = thinned([before[k], *(lim.critical(assessment) for lim in problem.limits)])
            broken[k] = np.concatenate([broken[k], *(m.worst(assessment) for m in problem.limits)])
            nodes.append(cost_nodes(shaken_by_all(family, group), [assessment], rtol=1e-7))
            near = margin_nodes(problem, [assessment.poles], 2 * PER_DECADE)
            omega.append(np.unique(np.concatenate([near, before[k], broken[k]])))
        programme = FamilyProgramme(family, nodes, omega, reference=reference, tolerance=1e-8)
        start = programme.pack(solved.values, solved.coefficients)
        again = _near(programme, start, tighten)
        if again is None:
            break
        moved, solved = abs(again.objective - solved.objective), again
        assessments, excess = assessments_of(family, solved)
        if (excess > KEPT, solved.objective) < best[:2] or best[0]:
            best = (excess > KEPT, solved.objective, solved, assessments, excess)
        if excess <= KEPT and (moved < _SETTLED or k_round >= _EXCHANGED):
            break
        if k_round >= _EXCHANGED and excess < _HAIR:  # what is broken by a hair is mended by a hair
            for i, limit in own_limits(family):
                over = limit.use(limit.measure(assessments[i])) - 1.0
                if over > 0.5 * KEPT:
                    key = (i, limit.name)
                    tighten[key] = tighten.get(key, 0.0) + 1.1 * over
    return best[2:]


def _near(
    programme: FamilyProgramme, start: FloatArray, tighten: dict[tuple[int, str], float]
) -> FamilySolved | None:
    for pace, reach in (
        (SolverPace.THERE, _REACH),
        (SolverPace.NEAR, _REACH),
        (SolverPace.FAR, None),
    ):
        solved = programme.solve(start, reach, tighten, pace)
        if solved.converged and programme.family.stable(solved.values, solved.coefficients):
            return solved
    return None


def assessments_of(
    family: FamilyProblem, solved: FamilySolved
) -> tuple[tuple[Assessment, ...], float]:
    """Return each scenario's loop in numbers, and the largest relative excess over a limit."""
    assessments = tuple(
        assessment_of(scenario.problem, solved.of(i, scenario))
        for i, scenario in enumerate(family.scenarios)
    )
    own = [lim.use(lim.measure(assessments[i])) - 1.0 for i, lim in own_limits(family)]
    return assessments, max([0.0, *own])


def own_limits(family: FamilyProblem) -> Iterator[tuple[int, Limit]]:
    """Yield each scenario's limits, those on a loop that a group shares only once."""
    for group in family.groups:
        for i in group:
            for limit in family.scenarios[i].problem.limits:
                if limit.drive or i == group[0]:
                    yield i, limit


def shaken_by_all(family: FamilyProblem, group: Sequence[int]) -> Problem:
    """Return a group's first problem, shaken by what shakes any of the group."""
    problems = [family.scenarios[i].problem for i in group]
    if len(problems) == 1:
        return problems[0]
    every = [d for problem in problems for d in problem.disturbances]
    names = dict.fromkeys(d.name for d in every)
    summed = tuple(_summed([d for d in every if d.name == name]) for name in names)
    return replace(problems[0], disturbances=summed)


def _summed(parts: Sequence[Disturbance]) -> Disturbance:
    """Return the disturbance whose density is the sum of several."""
    bands = [d.band for d in parts if d.band is not None]

    def density(omega: FloatArray) -> FloatArray:
        return np.asarray(np.sum([d.density(omega) for d in parts], axis=0), dtype=np.float64)

    whole = (min(b[0] for b in bands), max(b[1] for b in bands)) if bands else None
    return Disturbance(
        name=parts[0].name,
        density=density,
        band=whole if len(bands) == len(parts) else None,
        splits=tuple(sorted({w for d in parts for w in d.splits})),
    )
