"""Robust design: one set of gains for a family of plants and seas, `optimise_robust`.

    case + Family -> scenarios -> search -> worst member of the ranges -> add it, search again
                  -> nothing hurts more -> random draws, verification -> RobustDesign

The set of members that is designed for grows until the worst member of the whole ranges hurts
no more than those in the set (Apkarian, Dao and Noll, "Parametric robust structured control
design", IEEE TAC 60, 2015); it is returned with the gains, as it says what decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.basics import FloatArray, InputError, check_range, one_thread
from models.case import Case
from models.plant import masses_for_bandwidth

from ..question import FamilyLoop, FamilyProblem, Objective
from ..search import KEPT, FamilyFound, Progress, search, search_family
from ..structures import Structure
from .family import Family, Member
from .family_plants import PAYLOAD_FEEDBACK, FamilyPlants
from .robust_result import RobustDesign as RobustDesign
from .robust_result import ScenarioResult as ScenarioResult
from .robust_result import answer_of
from .worst_case import worst_members

_MOST_FIRST = 64  # members that a design begins with at most
_ROUNDS = 8  # of looking for the worst member
_HURTS = 2e-3  # what a member may ask for more than the set gives, relatively
_MODES = 5.0  # every rope mode below this many crossovers belongs in the plant
_MOST_MASSES = 40
_BEST_STARTS = 6  # of the search for the best gains of one scenario alone


@one_thread()
def tune_family(
    scenarios: Sequence[FamilyLoop],
    *,
    objective: str | Objective = "worst",
    starts: int = 8,
    seed: int = 0,
    guesses: Sequence[Sequence[float]] = (),
    progress: Progress | None = None,
) -> tuple[FamilyProblem, FamilyFound]:
    """Return the parameters that serve all scenarios best, on plants of any kind.

    Parameters
    ----------
    scenarios
        Problems with laws of the same parameters, `synth.question.family_problem.FamilyLoop`.
    objective
        ``worst`` cost, ``mean`` (root of the weighted mean square) or ``regret`` (worst ratio
        of cost to `FamilyLoop.best`).
    starts, seed
        Size and seed of the multi-start search.
    guesses
        Parameters to start from before any that are drawn.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If there is no scenario, or an unknown objective is asked for.
    """
    check_range("tune_family", "starts", starts, low=1)
    family = FamilyProblem(scenarios=tuple(scenarios), objective=Objective.of(objective))
    return family, search_family(family, int(starts), seed, guesses, progress)


@one_thread()
def optimise_robust(
    case: Case,
    family: Family,
    objective: str | Objective = "worst",
    *,
    structure: str | Structure = PAYLOAD_FEEDBACK,
    starts: int = 8,
    seed: int = 0,
    draws: int = 10_000,
    progress: Progress | None = None,
) -> RobustDesign:
    """Return one set of gains for a family of plants and seas.

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
        The controller, see `synth.robust.family_plants.FamilyPlants`.
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
    found: FamilyFound | None = None
    records: FamilyFound | None = None
    given, problem, quiet = len(members), None, False
    for k in range(_ROUNDS):
        problem = _problem(plants, members, wanted, seed, progress)
        found, plants, problem = _searched(
            plants, problem, members, wanted, found, starts, seed, progress
        )
        records = records or found
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
    assert found is not None
    assert records is not None
    assert problem is not None
    return answer_of(
        case, family, wanted, plants, problem, members, found, records,
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


def _problem(
    plants: FamilyPlants,
    members: Sequence[Member],
    objective: Objective,
    seed: int,
    progress: Progress | None,
) -> FamilyProblem:
    scenarios = [plants.scenario(m) for m in members]
    if objective is Objective.REGRET:
        bests = []
        for k, scenario in enumerate(scenarios):
            if progress is not None:
                progress("the best of each scenario", k, len(scenarios))
            bests.append(_best_of(scenario, plants, seed))
        scenarios = [replace(s, best=b) for s, b in zip(scenarios, bests, strict=True)]
    elif objective is Objective.MEAN:
        # Members that were added for their limits have no occurrence of their own.
        first = {m: k < len(_first(plants.family)) for k, m in enumerate(members)}
        scenarios = [
            s if first[m] else replace(s, weight=0.0)
            for s, m in zip(scenarios, members, strict=True)
        ]
    return FamilyProblem(scenarios=tuple(scenarios), objective=objective)


def _best_of(scenario: FamilyLoop, plants: FamilyPlants, seed: int) -> float:
    """Return the least payload rms that gains of its own reach in a scenario [m]."""
    found = search(scenario.problem, _BEST_STARTS, seed, plants.guesses)
    if found.solved is None or found.assessment is None or found.excess > KEPT:
        raise InputError(
            f"regret: {scenario.name}: no gains of its own keep the limits, so there is no best "
            "to compare with"
        )
    return float(np.exp(found.solved.objective))


def _searched(
    plants: FamilyPlants,
    problem: FamilyProblem,
    members: Sequence[Member],
    objective: Objective,
    earlier: FamilyFound | None,
    starts: int,
    seed: int,
    progress: Progress | None,
) -> tuple[FamilyFound, FamilyPlants, FamilyProblem]:
    """Return the answer on a set of members, on plants with as many rope masses as it needs."""
    guesses: list[FloatArray] = [np.array(g) for g in plants.guesses]
    if earlier is not None and earlier.solved is not None:
        ends = sorted((s for s in earlier.starts if s.converged), key=lambda s: s.cost)
        guesses = [earlier.solved.values, *(s.end for s in ends[:3])]
    again = earlier is not None
    found = search_family(problem, starts, seed, guesses, progress, only_guesses=again)
    if again and (found.solved is None or found.excess > KEPT):
        found = search_family(problem, starts, seed, guesses, progress)
    masses = _masses_wanted(plants, members, found)
    if masses > plants.most_masses and found.solved is not None:
        plants = plants.with_masses(masses)
        problem = _problem(plants, members, objective, seed, progress)
        more = [found.solved.values, *(s.end for s in found.starts if s.converged)][:4]
        found = search_family(problem, starts, seed, more, progress, only_guesses=True)
    return found, plants, problem


def _masses_wanted(plants: FamilyPlants, members: Sequence[Member], found: FamilyFound) -> int:
    """Return the rope masses that the fastest crossover of any scenario asks for."""
    most = plants.most_masses
    if plants.masses is not None or found.solved is None:
        return most
    for member, assessment in zip(members, found.assessments, strict=True):
        data = plants.question(member).data
        crossovers = assessment.margins.crossovers
        if data.masses is not None or not crossovers.size or not assessment.stable:
            continue
        try:
            most = max(most, masses_for_bandwidth(data, _MODES * float(crossovers.max())))
        except InputError:
            return _MOST_MASSES
    return most
