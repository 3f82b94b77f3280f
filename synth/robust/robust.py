"""Robust design: one set of gains for a family of plants and seas, `optimise_robust`.

    case + Family -> scenarios -> search -> worst member of the ranges -> add it, search again
                  -> nothing hurts more -> random draws, verification -> RobustDesign

The set of members that is designed for grows until the worst member of the whole ranges hurts
no more than those in the set (Apkarian, Dao and Noll, "Parametric robust structured control
design", IEEE TAC 60, 2015); it is returned with the gains, as it says what decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.basics import InputError, check_range, one_thread, shows_progress
from models.case import Case

from ..design import Design, LimitUse, Tuning, design_of, gains_in_use, tuning_of
from ..loop import Margins
from ..question import PAYLOAD_FEEDBACK, FamilyProblem, Objective
from ..search import KEPT, Found, Progress, Solution, search, with_bests
from .family import Family, Member
from .family_plants import FamilyPlants
from .perturbation import GainRadius, gain_radius
from .worst_case import DrawCheck, draw_check, worst_members

_VERIFIED = 8  # scenarios, the hardest first, that are verified one by one


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioResult:
    """What the gains do in one scenario."""

    #: Which it is.
    name: str
    member: Member
    weight: float  #: Occurrence of its sea.
    #: The gains as a design for the scenario's own case; verified only if it is among the hardest.
    design: Design
    best_rms: float | None  #: For the regret: the payload's rms with gains of its own [m].
    #: How far every gain may be off at once [-], and the nearest unstable gains; None for
    #: structures that are not affine in their gains.
    radius: GainRadius | None
    pressure: float  #: How much of the objective hangs on the scenario; all of them add up to 1.

    @property
    def margins(self) -> Margins:
        """Margins of its loop."""
        assert self.design.margins is not None  # unstable loops have no result
        return self.design.margins

    @property
    def verified(self) -> bool | None:
        """Whether other code confirmed it; None if it was not asked."""
        found = self.design.verification
        return None if found is None else found.ok

    @property
    def tightest(self) -> LimitUse | None:
        """The enforced limit that is used most."""
        enforced = [u for u in self.design.limits.values() if u.enforced]
        return max(enforced, key=lambda u: u.use, default=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class RobustDesign:
    """One set of gains for a family, with everything that was asked of it."""

    #: The question.
    family: Family
    objective: Objective
    #: Every scenario keeps its limits, nothing in the ranges hurts more, no random draw is
    #: unstable, and the hardest scenarios were verified; in words.
    ok: bool
    status: str
    parameters: Mapping[str, float]  #: The structure's parameters by name.
    #: The set of members that was designed for, the worst payload motion first.
    scenarios: tuple[ScenarioResult, ...]
    added: int  #: How many of them the search for the worst member added.
    check: DrawCheck | None  #: What random draws say.
    plants: FamilyPlants  #: The family as it was posed.

    @property
    def worst(self) -> ScenarioResult:
        """The scenario with the largest payload motion."""
        return self.scenarios[0]

    @property
    def mean_rms(self) -> float:
        """Root of the occurrence-weighted mean square of the payload's motion [m]."""
        squares = np.array([s.design.payload_rms**2 for s in self.scenarios])
        weights = np.array([s.weight for s in self.scenarios])
        return float(np.sqrt(weights @ squares / weights.sum()))

    def __str__(self) -> str:
        """Return a small tree."""
        gains = ", ".join(f"{name} = {value:.6g}" for name, value in self.parameters.items())
        lines = [f"RobustDesign for {self.family.case.name}: {self.status}", f"├ {gains}"]
        for s in self.scenarios[:6]:
            rms, peak = 1e3 * s.design.payload_rms, s.margins.max_sensitivity
            lines.append(f"├ {s.name}: {rms:.4g} mm, M_s {peak:.3f}")
        if len(self.scenarios) > 6:
            lines.append(f"├ and {len(self.scenarios) - 6} more scenarios")
        lines.append(f"└ {self.check}" if self.check is not None else "└ no random draws")
        return "\n".join(lines)


def answer_of(
    plants: FamilyPlants,
    problem: FamilyProblem,
    members: Sequence[Member],
    found: Found,
    *,
    given: int,
    quiet: bool,
    draws: int,
    seed: int,
    progress: Progress | None,
) -> RobustDesign:
    """Return the answer in numbers and words, checked by draws and by other code.

    `given` members were there before the search for the worst added any, and `quiet` says
    whether it came to an end.
    """
    solved, tuning = found.solved, tuning_of(problem, found)
    values = [] if solved is None else [float(v) for v in solved.values]
    results = [] if solved is None else _results(plants, problem, members, tuning, solved)
    notes: list[str] = []
    if tuning.ok:
        results = _verified(results, notes, progress)
    check = None
    if solved is not None and draws and problem.stable(solved.values, solved.coefficients):
        check = draw_check(plants, values, draws, seed + 1, progress)
    all_stable = check is None or check.stable == check.count
    results.sort(key=lambda r: -r.design.payload_rms)
    return RobustDesign(
        family=plants.family,
        objective=problem.objective,
        ok=bool(tuning.ok and quiet and all_stable and not notes),
        status=_status(problem.objective, results, tuning, quiet, check, notes),
        parameters={} if solved is None else plants.nominal.named(values),
        scenarios=tuple(results),
        added=len(members) - given,
        check=check,
        plants=plants,
    )


def _results(
    plants: FamilyPlants,
    problem: FamilyProblem,
    members: Sequence[Member],
    tuning: Tuning,
    solved: Solution,
) -> list[ScenarioResult]:
    results = []
    every = zip(members, problem.scenarios, (tuning, *tuning.members), strict=True)
    for i, (member, scenario, own) in enumerate(every):
        design = design_of(plants.question(member), replace(own, members=()))
        if own.assessment is None or design.margins is None or not own.assessment.stable:
            continue
        values = list(own.parameters.values())
        try:
            radius = gain_radius(own.assessment.plant, scenario.problem.law, values)
        except InputError:  # several inputs, or a structure that is not affine in its gains
            radius = None
        regret = problem.objective is Objective.REGRET
        results.append(
            ScenarioResult(
                name=scenario.name,
                member=member,
                weight=scenario.weight,
                design=replace(design, built_for=plants.nominal.case),
                best_rms=scenario.best if regret else None,
                radius=radius,
                pressure=float(solved.pressure[i]),
            )
        )
    return results


def _verified(
    results: Sequence[ScenarioResult], notes: list[str], progress: Progress | None
) -> list[ScenarioResult]:
    """Return the results, the hardest of them checked by code that no search uses."""
    hardest = sorted(
        range(len(results)),
        key=lambda i: (-results[i].pressure, -results[i].margins.max_sensitivity),
    )[:_VERIFIED]
    checked = list(results)
    for k, i in enumerate(hardest):
        if progress is not None:
            progress("verify", k, len(hardest))
        design = checked[i].design
        verdict = design.verify()
        checked[i] = replace(checked[i], design=replace(design, verification=verdict))
        if not verdict.ok:
            notes.append(f"{checked[i].name}: {verdict.status}")
    if progress is not None:
        progress("verify", len(hardest), len(hardest))
    return checked


def _status(
    objective: Objective,
    results: Sequence[ScenarioResult],
    tuning: Tuning,
    quiet: bool,
    check: DrawCheck | None,
    notes: Sequence[str],
) -> str:
    if tuning.assessment is None:
        return "no gains were found that stabilise every member of the family"
    if not tuning.ok:
        every = [(u, r.name) for r in results for u in r.design.limits.values()]
        broken = [(u.use, u.name, name) for u, name in every if u.enforced]
        use, name, where = max(broken, default=(np.inf, "stability", "every scenario"))
        if use <= 1.0 + KEPT:
            return "the solver did not converge"
        return f"no gains keep the limits of all scenarios; {name} is hardest, in {where}"
    if notes:
        return f"not verified: {notes[0]}"
    if check is not None and check.stable < check.count:
        return f"{check.count - check.stable} of {check.count} random draws are unstable"
    if not quiet:
        return "the search for the worst member did not come to an end"
    goal = {
        Objective.WORST: "least worst payload motion",
        Objective.MEAN: "least mean payload motion",
        Objective.REGRET: "least worst regret",
    }[objective]
    leading = max(results, key=lambda r: r.pressure)
    binds = sorted({name for r in results for name in r.design.binding})
    text = f"{goal} over {len(results)} scenarios, decided by {leading.name}"
    return f"{text}; {', '.join(binds)} bind{'s' * (len(binds) == 1)}" if binds else text


_MOST_FIRST = 64  # members that a design begins with at most
_ROUNDS = 8  # of looking for the worst member
_HURTS = 2e-3  # what a member may ask for more than the set gives, relatively
_ENDS = 3  # ends of a search that the next one begins from, besides its answer


@one_thread()
@shows_progress("searching")
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
