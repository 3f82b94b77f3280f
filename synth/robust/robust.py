"""Robust design: one set of gains for a family of plants and seas, `optimise_robust`.

    case + Family -> scenarios -> search -> worst member of the ranges -> add it, search again
                  -> nothing hurts more -> random draws, verification -> RobustDesign

The set of members that is designed for grows until the worst member of the whole ranges hurts
no more than those in the set (Apkarian, Dao and Noll, "Parametric robust structured control
design", IEEE TAC 60, 2015); it is returned with the gains, as it says what decides.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.basics import InputError, check_range, one_thread
from models.case import Case

from ..design import gains_in_use
from ..question import PAYLOAD_FEEDBACK, FamilyProblem, Objective
from ..search import KEPT, Found, Progress, search, with_bests
from .family import Family, Member
from .family_plants import FamilyPlants
from .robust_result import RobustDesign as RobustDesign
from .robust_result import ScenarioResult as ScenarioResult
from .robust_result import answer_of
from .worst_case import worst_members

_MOST_FIRST = 64  # members that a design begins with at most
_ROUNDS = 8  # of looking for the worst member
_HURTS = 2e-3  # what a member may ask for more than the set gives, relatively
_ENDS = 3  # ends of a search that the next one begins from, besides its answer


@one_thread()
def optimise_robust(
    case: Case,
    family: Family,
    objective: str | Objective = "worst",
    *,
    structure: str = PAYLOAD_FEEDBACK,
    starts: int = 8,
    seed: int = 0,
    draws: int = 10_000,
    progress: Progress | None = None,
) -> RobustDesign:
    """Return one set of gains for a family of plants and seas.

    The rope is damped as the case and the family say, and no less.

    Parameters
    ----------
    case
        The case that the family varies.
    family
        Plants and seas, `Family.of`.
    objective
        ``worst``: least worst payload rms; ``mean``: least root of the occurrence-weighted
        mean square over the combinations given; ``regret``: least worst ratio to what gains
        of its own would reach in each scenario.
    structure
        Name of the controller's structure, see `synth.structures.structure_names`.
    starts, seed
        Size and seed of the multi-start search.
    draws
        Random members that the result is checked with; 0 for none.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    RobustDesign
        With ``ok`` false and a status that says why, if it does not hold.

    Raises
    ------
    InputError
        If the family does not belong to the case, or a figure is out of range.
    """
    wanted = Objective.of(objective)
    check_range("robust", "starts", starts, low=1)
    check_range("robust", "draws", draws, low=0)
    if family.case != case:
        raise InputError("robust: the family must be one of this case, see Family.of(case, ...)")
    plants = FamilyPlants(family, structure)
    members = _first(family)
    problem = _problem(plants, members, wanted, seed, progress)
    found = search(problem, starts, seed, gains_in_use(plants.nominal), progress)
    given, quiet = len(members), False
    for k in range(_ROUNDS):
        if found.solved is None:
            break
        more = plants.for_assessed(members, found.assessments)
        if more is not plants:
            plants = more
            problem = _problem(plants, members, wanted, seed, progress)
            found = _again(problem, found, starts, seed, progress)
        if found.solved is None or found.excess > KEPT:
            break
        if progress is not None:
            progress("looking for what hurts most", k, _ROUNDS)
        hurting = worst_members(
            plants,
            [float(v) for v in found.solved.values],
            float(np.max(found.costs)),
            wanted,
            tolerance=_HURTS,
            seed=seed + k,
            known=members,
        )
        if not hurting:
            quiet = True
            break
        members = [*members, *(f.member for f in hurting)]
        problem = _problem(plants, members, wanted, seed, progress)
        found = _again(problem, found, starts, seed, progress)
    return answer_of(
        plants, problem, members, found,
        given=given, quiet=quiet, draws=draws, seed=seed, progress=progress,
    )  # fmt: skip


def _first(family: Family) -> list[Member]:
    """Return the members to begin with: the grid, else the corners, else the nominal ones."""
    for choose in (family.grid, family.corners):
        try:
            members = choose()
        except InputError:
            continue
        if len(members) <= _MOST_FIRST:
            return members
    return family.nominal()


def _again(
    problem: FamilyProblem, earlier: Found, starts: int, seed: int, progress: Progress | None
) -> Found:
    """Return the answer on a changed family, from where an earlier search ended."""
    assert earlier.solved is not None
    ends = sorted((s for s in earlier.starts if s.converged), key=lambda s: s.cost)
    guesses = [earlier.solved.values, *(s.end for s in ends[:_ENDS])]
    found = search(problem, starts, seed, guesses, progress, only_guesses=True)
    if found.solved is None or found.excess > KEPT:
        found = search(problem, starts, seed, guesses, progress)
    return found


def _problem(
    plants: FamilyPlants,
    members: Sequence[Member],
    objective: Objective,
    seed: int,
    progress: Progress | None,
) -> FamilyProblem:
    scenarios = [plants.scenario(m) for m in members]
    if objective is Objective.MEAN:
        # Members that were added for their limits have no occurrence of their own.
        first = len(_first(plants.family))
        scenarios[first:] = [replace(s, weight=0.0) for s in scenarios[first:]]
    family = FamilyProblem(scenarios=tuple(scenarios), objective=objective)
    if objective is Objective.REGRET:
        return with_bests(family, seed, gains_in_use(plants.nominal), progress)
    return family
