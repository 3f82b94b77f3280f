"""Descent to an optimum on nodes that follow the loop, and the assessment of where it ended.

start -> nodes for its poles -> descent -> nodes for the new poles -> ... -> Solution
      -> margins where they are measured -> assessment -> excess over the limits
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from models.basics import FloatArray

from ..limits import Limit
from ..loop import Assessment, Coefficients
from ..question import FamilyProblem, Goal, Problem, Values
from .nodes import cost_nodes, glanced, margin_nodes
from .programme import GainProgramme, Solution
from .sqp import INFEASIBLE

KEPT = 1e-5  # relative excess over a limit that counts as none
_PER_DECADE, _FINE_PER_DECADE = 40, 60  # margin nodes
_ROUGH_STEPS = 40
_ROUNDS, _FINE_ROUNDS = 3, 4  # of a descent with new nodes
_SETTLED, _FINE_SETTLED = 1e-4, 1e-6  # change of the log objective below which nodes are right
_HAIR = 2e-2  # relative excess that tightening may still mend
_NEARLY_ZERO = 1e-3  # of the lowest frequency
_HAIRS = 3  # rounds of it


def stated(
    asked: FamilyProblem | Problem,
    values: Values,
    coefficients: Sequence[Coefficients] | None = None,
    goal: Goal = Goal.COST,
    *,
    reference: FloatArray,
    relaxed: Sequence[str] = (),
    rough: bool = False,
    fine: bool = False,
    exact: bool = False,
) -> GainProgramme:
    """Return a programme of a family on nodes that suit the loops at a point.

    The point is one of searched parameters, and of coefficients of elements.  Goal, reference and
    relaxed limits are as `GainProgramme` takes them.  The nodes are for three digits if `rough`,
    for eight if `fine`; if `exact`, margins are held where they are measured.
    """
    family = FamilyProblem.of(asked)
    nodes, omega = [], []
    for group in family.groups:
        scenario = family.scenarios[group[0]]
        known = None if coefficients is None else coefficients[group[0]]
        own, shaken = scenario.values(values), family.shaken_by_all(group)
        poles = scenario.problem.loop_poles(own, known)
        if fine and _rippled(shaken):
            found = shaken.assess(own, known).quadrature(shaken.outputs)
            # The plant's blocks may have a pole at zero, where the closed loop has none.
            least = _NEARLY_ZERO * float(found.omega[found.omega > 0.0].min())
            nodes.append(replace(found, omega=np.maximum(found.omega, least)))
        else:
            how = "fine" if fine else "rough" if rough else "coarse"
            nodes.append(cost_nodes(shaken, poles, how))
        per_decade = _FINE_PER_DECADE if fine else _PER_DECADE
        omega.append(margin_nodes(scenario.problem, poles, per_decade))
    tolerance = 1e-13 if fine else 1e-4 if rough else 1e-6
    return GainProgramme(
        family,
        nodes,
        omega,
        goal,
        reference=reference,
        relaxed=relaxed,
        tolerance=tolerance,
        max_iterations=_ROUGH_STEPS if rough else None,
        exact=exact,
        # Rough descents look whether a start leads anywhere: of one that gets stuck there are more.
        in_a_calm=not rough,
    )


def settle(
    asked: FamilyProblem | Problem,
    values: Values,
    coefficients: Sequence[Coefficients] | None,
    goal: Goal = Goal.COST,
    *,
    reference: FloatArray,
    relaxed: Sequence[str] = (),
    extra: float | None = None,
    fine: bool = False,
    exact: bool = False,
    rounds: int = _ROUNDS,
    reach: float | None = None,
    tighten: dict[tuple[int, str], float] | None = None,
    worth: float = np.inf,
) -> Solution:
    """Return the answer that is reached from a point, on nodes that suit the loop there.

    Parameters
    ----------
    asked, values, coefficients, goal, reference, relaxed, fine
        See `stated`.
    extra
        Where the variable of the goal begins.
    rounds
        Most renewals of the nodes; the first of them, far from the answer, holds margins by discs,
        which see a limit before it is broken.  One alone goes only roughly to the end, if not fine.
    reach, tighten, worth
        See `GainProgramme.solve`.
    """
    last: Solution | None = None
    iterations = 0
    for k in range(rounds):
        programme = stated(
            asked,
            values,
            coefficients,
            goal,
            reference=reference,
            relaxed=relaxed,
            rough=rounds == 1 and not fine,
            fine=fine,
            exact=exact or fine or k > 0,
        )
        found = programme.solve(programme.pack(values, coefficients, extra), reach, tighten, worth)
        iterations += found.iterations
        found = replace(found, iterations=iterations)
        if not np.isfinite(found.objective):
            return last or found
        if found.message == INFEASIBLE:
            return found
        moved = np.inf if last is None else abs(found.objective - last.objective)
        values, coefficients, extra, last = found.values, found.coefficients, found.extra, found
        if moved < (_FINE_SETTLED if fine else _SETTLED):
            break
    assert last is not None
    return last


def polish(
    asked: FamilyProblem | Problem,
    solved: Solution,
    reference: FloatArray,
    goal: Goal = Goal.COST,
    relaxed: Sequence[str] = (),
) -> tuple[Solution, tuple[Assessment, ...], float]:
    """Return a solution on fine nodes and with its true margins.

    Also returned: the assessment of each member's loop, and the largest relative excess over a
    limit.
    """
    family = FamilyProblem.of(asked)
    tighten: dict[tuple[int, str], float] = {}
    best: tuple[Solution, tuple[Assessment, ...], float] | None = None
    rough = solved
    fine = partial(settle, family, goal=goal, reference=reference, relaxed=relaxed, fine=True)
    # Of costs it is seen at the end whether nodes for the loop at the start were right.
    rounds = 1 if goal is Goal.COST else _FINE_ROUNDS
    for _ in range(1 + _HAIRS):
        start = solved.values, solved.coefficients
        found = fine(*start, extra=solved.extra, tighten=tighten, rounds=rounds)
        sound = np.isfinite(found.objective) and family.stable(found.values, found.coefficients)
        if sound:
            assessments, overs = _measured(family, found, goal, relaxed)
            right = found.converged and _off(family, found, assessments) < _FINE_SETTLED
            if rounds == 1 and not right:
                solved, rounds = found, _FINE_ROUNDS
                continue
            excess = max([0.0, *overs.values()])
            if best is None or (excess > KEPT, found.objective) < (
                best[2] > KEPT,
                best[0].objective,
            ):
                best = found, assessments, excess
            if excess <= KEPT or excess > _HAIR:
                break
            for key, over in overs.items():
                if over > 0.5 * KEPT:
                    tighten[key] = tighten.get(key, 0.0) + 1.1 * over
            solved = found
        else:
            break
    if best is None:
        assessments, overs = _measured(family, solved, goal, relaxed)
        return replace(solved, converged=False), assessments, max([1.0, *overs.values()])
    found, assessments, excess = best
    if rough.converged and abs(found.objective - rough.objective) < _SETTLED and excess <= KEPT:
        # Rounding may leave no further programme where there is nothing more to gain.
        found = replace(found, converged=True)
    return found, assessments, excess


def assess(
    asked: FamilyProblem | Problem,
    solved: Solution,
    goal: Goal = Goal.COST,
    relaxed: Sequence[str] = (),
) -> tuple[tuple[Assessment, ...], float]:
    """Return each member's loop in numbers, and the largest relative excess over a limit."""
    assessments, overs = _measured(FamilyProblem.of(asked), solved, goal, relaxed)
    return assessments, max(overs.values(), default=0.0)


def _measured(
    family: FamilyProblem, solved: Solution, goal: Goal, relaxed: Sequence[str]
) -> tuple[tuple[Assessment, ...], dict[tuple[int, str], float]]:
    """Return each member's assessment and the relative excess over its limits."""
    amplitude = float(np.exp(solved.extra)) if goal is Goal.SEA else 1.0
    assessments = []
    for scenario, coefficient in zip(family.scenarios, solved.coefficients, strict=True):
        scaled = tuple(d.scaled(amplitude) for d in scenario.problem.disturbances)
        problem = replace(scenario.problem, disturbances=scaled)
        own = scenario.values(solved.values)
        seen = None if _rippled(problem) else glanced(problem, own, coefficient, how="fine")
        assessments.append(seen or problem.assess(own, coefficient))
    overs = {
        (i, limit.name): limit.use(limit.worst(assessments[i])) - 1.0
        for i, limit in own_limits(family)
        if limit.name not in relaxed
    }
    return tuple(assessments), overs


def _rippled(problem: Problem) -> bool:
    """Return whether a delay ripples the spectrum of white noise far above all poles."""
    return any(problem.plant.delays) and any(d.band is None for d in problem.disturbances)


def _off(family: FamilyProblem, solved: Solution, assessments: Sequence[Assessment]) -> float:
    """Return what the costs on a programme's nodes are off by, relatively, at most."""
    off = [0.0]
    for scenario, cost, seen in zip(family.scenarios, solved.costs, assessments, strict=True):
        terms = (w * seen.sigma(z) ** 2 for z, w in scenario.problem.minimise.items())
        off.append(abs(0.5 * np.log(sum(terms) / cost**2)))
    return float(max(off))


def own_limits(family: FamilyProblem) -> list[tuple[int, Limit]]:
    """Return each member's limits, those on a loop that a group shares only once."""
    return [
        (i, limit)
        for group in family.groups
        for i in group
        for limit in family.scenarios[i].problem.limits
        if limit.drive or i == group[0]
    ]
