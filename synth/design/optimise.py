"""Optimisation and evaluation of the parameters of any structure on a case.

    Case, structure -> DesignQuestion -> simpler structures within -> search
                    -> (too hard? largest sea, what it would take) -> Design -> verified

A case that cannot be met is the norm, not the exception: then the design is the best one in
the largest sea that can, and the status names the limit that breaks first and what it would
have to be.  A design that fails its independent check is not ok, whatever the search said.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import brentq

from models.basics import InputError, check_range, digits_apart, one_thread, shows_progress
from models.case import Case
from models.plant import MAX_MASSES

from ..loop import Assessment, Coefficients
from ..question import (
    GAINS,
    PAYLOAD,
    DesignQuestion,
    FamilyProblem,
    Objective,
    PosedFamily,
    Values,
    least_damping_text,
    on_common_masses,
    on_enough_masses,
    pose,
    pose_family,
    with_masses,
)
from ..search import KEPT, Found, Progress, glanced, hardest, polish, search, with_bests
from ..structures import LowOrderFeedback, structures_aboard
from .design import SWITCHING_LOSS, Design
from .high_order import high_order_gains
from .infeasible import Shortfall, larger_sea, shortfall
from .nested import WITHIN, gains_in_use, nested_starts, no_worse, starts_from
from .tuning import LimitUse, Tuning, limit_uses, tuning_of

#: Structures that are tried where none is named, the simplest first.
NESTED = (
    "payload-feedback",
    "payload-feedback-rolloff",
    "drum-feedback",
    "feed-forward",
    "combined",
)
_AS_STILL = 1.05  # of the stillest design's motion, with which a simpler one is preferred
_ROUGHEST = 0.99  # of the largest sea that any structure can do
_SHARE = 2  # of the starts that each of several structures has
ROUNDS = 6  # of asking an answer for what the rope asks of it
_RESUMED = 3  # ends of a search that the next one, on more masses, begins from
_LEAKS = 0.98  # of an answer's cost, below which an unstable end is worth more masses ...
_FINER = 4  # ... so many times as many
_HAIR = 1e-4  # relative excess over a limit in the largest sea
_ALIKE = 1e-3  # relative difference of two seas that are as large
_NO_DESIGN = "no ok design"  # for the least damping of the rope
_CALMER_ROUNDS = 6  # of looking for parameters in the largest sea
_CALMER = 3.0  # logarithm of what the largest sea may have to be calmer by, for the sensors' noise

_D = TypeVar("_D", bound=Design)


@one_thread()
@shows_progress("searching")
def optimise_gains(
    case: Case,
    structure: str | Sequence[str] | None = None,
    *,
    members: Sequence[Mapping[str, Any] | Case] = (),
    objective: str = "worst",
    fixed: Mapping[str, float] | None = None,
    starts: int = 8,
    seed: int = 0,
    progress: Progress | None = None,
    guesses: Sequence[Mapping[str, float]] = (),
) -> Design:
    """Return the controller that minimises the payload's variance within the limits of a case.

    It is one controller for the case and for the case with the least damping that its rope may
    have (`synth.question.pose_family`), with `members` for others like it too, which keeps the
    limits of all of them.  Of several structures it is the simplest within five percent of the
    stillest that is ok; the others are its `alternatives`.  Where the limits cannot all be kept, it
    is the stillest in the largest sea in which any structure can keep them.

    Parameters
    ----------
    case
        The case; its `gains.A` fixes the amplifier of payload feedback, as only the products
        A a, A a1, A a2 act.
    structure
        Name of the structure, see `synth.structures.structure_names`, or several, the simplest
        first; by default those of `NESTED` whose sensors the case names.
    members
        What the controller is for besides the case itself: changes of it by dotted path, as
        `Case.replace` takes them, or cases.  It is built for the motor and drum of the case.
    objective
        Of several members: ``worst`` for the least worst payload rms, ``mean`` for the least root
        of the mean square, ``regret`` for the least worst ratio to the best of each member alone.
    fixed
        Parameters that are held, by name, as ``{"a": 0.0}``; the others are searched.
    starts, seed
        Size and seed of the multi-start search; each of several structures has a quarter of the
        starts, and begins at the simpler ones' answers too.
    progress
        Called as progress(stage, done, total).
    guesses
        Parameters by name of designs for similar cases or of simpler structures, which the search
        begins with instead of looking for such itself; what they do not name does nothing.  The
        answer is never worse than one of them that keeps the limits.

    Returns
    -------
    Design
        `ok` only if it is stable, keeps every enforced limit in the sea asked for and passes
        the independent check, as each of its `members` does.

    Raises
    ------
    InputError
        If there is no such structure, parameter, objective or change, a structure hears a sensor
        that the case does not name, a limit lies below the static load, or no gains of its own keep
        the limits of a member, for the regret.
    """
    check_range("optimise_gains", "starts", starts, low=1)

    def optimised(
        name: str, starts: int, progress: Progress | None, guesses: Sequence[Mapping[str, float]]
    ) -> Design:
        posed = pose_family(case, members, name, objective=objective, held=fixed)
        return _optimised(posed, starts, seed, progress, guesses)

    if isinstance(structure, str):
        return optimised(structure, int(starts), progress, guesses)
    names = (
        structures_aboard(case, NESTED) if structure is None else tuple(dict.fromkeys(structure))
    )
    if not names:
        raise InputError("optimise_gains: structure must name at least one structure, got none")
    few = max(1, -(-int(starts) // _SHARE))
    designs: list[Design] = []
    for k, name in enumerate(names):
        stage = None if progress is None else _told(progress, f"{name} ({k + 1}/{len(names)})")
        simpler = [d.parameters for d in designs if d.structure in WITHIN.get(name, ())]
        known = [*guesses, *(parameters for parameters in simpler if parameters)]
        designs.append(optimised(name, few, stage, known))
    chosen = _simplest(designs)
    others = tuple(design for design in designs if design is not chosen)
    return replace(chosen, alternatives=others)


def _simplest(designs: Sequence[Design]) -> Design:
    """Return the simplest design within five percent of the stillest; see `optimise_gains`."""
    ok = [design for design in designs if design.ok]
    if not ok:
        # What breaks limits whatever the drive is no answer to how much the drive can do.
        short = [design for design in designs if not design.feasible] or designs
        roughest = max(design.significant_height for design in short)
        there = [d for d in short if d.significant_height >= _ROUGHEST * roughest]
        return min(there, key=lambda design: design.family_rms)
    stillest = min(design.family_rms for design in ok)
    return next(design for design in ok if design.family_rms <= _AS_STILL * stillest)


def _told(progress: Progress, name: str) -> Progress:
    def tell(stage: str, done: int, total: int) -> None:
        progress(f"{name}: {stage}", done, total)

    return tell


def _optimised(
    posed: PosedFamily,
    starts: int,
    seed: int,
    progress: Progress | None,
    guesses: Sequence[Mapping[str, float]],
) -> Design:
    """Return the design of one structure; see `optimise_gains`."""
    question = posed.first
    if isinstance(named := question.structure, LowOrderFeedback) and named.family == "high-order":
        return _high_order(posed, named.order or None, progress)
    known = starts_from(question, guesses) or nested_starts(question, starts, seed, progress)
    count = starts + len(known)
    known = [*known, *gains_in_use(question)]
    given = posed
    answered = _answer(given, count, seed, known, progress)
    posed, tuning = _on_the_rope(given, *answered, known, count, seed, progress)
    if not tuning.ok:
        if tuning.assessment is None or not any(member.drive for member in posed.questions):
            return _family_design(posed, tuning)
        missed = _best_possible(posed, tuning, count, seed, known, progress)
        if isinstance(missed, Design):
            return missed
        posed, tuning = _on_the_rope(given, *missed, known, count, seed, progress)
    design = verified(_family_design(posed, tuning), progress)
    most = 1 if question.data.lumping == "thesis" else MAX_MASSES
    while tuning.ok and not design.ok and 2 * posed.masses <= most:
        # It stands on its own rope only: once more on twice the masses.
        posed = posed.on(2 * posed.masses)
        tuning = _again(posed.problem, tuning, count, seed, progress, known)
        design = verified(_family_design(posed, tuning), progress)
    return design


def _on_the_rope(
    given: PosedFamily,
    posed: PosedFamily,
    tuning: Tuning,
    known: Sequence[Sequence[float]],
    starts: int,
    seed: int,
    progress: Progress | None,
) -> tuple[PosedFamily, Tuning]:
    """Return the answer on masses on which it keeps the limits where `evaluate_gains` looks at it.

    Limits hold a reserve for the distributed rope only where no more masses are to be had.  Known
    points that fewer masses hold to be unstable are looked at again on more.
    """
    damped = tuning.status.startswith(_NO_DESIGN)
    least = 0  # what asked for more masses on the way may be gone
    for _ in range(ROUNDS):
        if not tuning.ok:
            break
        if posed.masses < MAX_MASSES:
            solved = tuning.found.solved
            assert solved is not None
            parameters = posed.first.named([float(v) for v in solved.values])
            stands, masses = seen_at(
                [
                    partial(_looked_at, one, parameters, assess=partial(_glance, start))
                    for one, start in zip(given.questions, solved.coefficients, strict=True)
                ]
            )
            least = max(least, masses)
            told = posed if stands and least <= posed.masses else given.on(least)
            if told.masses == posed.masses:
                break
        elif (told := _fitted(posed, tuning)) is posed:
            break
        again = _again(told.problem, tuning, starts, seed, progress, known)
        posed, tuning = told, again
    if tuning.ok:
        posed, tuning = _where_it_is_stable(given, posed, tuning, known, seed, progress)
    if damped and not tuning.ok:
        tuning = replace(tuning, status=_damped_too_little(posed, tuning))
    return posed, tuning


def _where_it_is_stable(
    given: PosedFamily,
    posed: PosedFamily,
    tuning: Tuning,
    known: Sequence[Sequence[float]],
    seed: int,
    progress: Progress | None,
) -> tuple[PosedFamily, Tuning]:
    """Return a better answer that the masses of a search have held to be unstable, if there is one.

    A rope of few masses has its modes too low, and where they are hardly damped that may cost a
    loop its stability: descents then lead to where it is unstable, and far lower.
    """
    unstable = [start for start in tuning.found.starts if not start.stable]
    leak = min(unstable, key=lambda start: start.told, default=None)
    if leak is None or posed.masses >= MAX_MASSES or not leak.told < _LEAKS * tuning.cost:
        return posed, tuning
    finer = given.on(min(_FINER * posed.masses, MAX_MASSES))
    if not finer.problem.stable(leak.end):
        return posed, tuning
    found = search(finer.problem, 1, seed, [leak.end], progress, only_guesses=True)
    other = tuning_of(finer.problem, found)
    if not (other.ok and other.cost < tuning.cost):
        return posed, tuning
    again = replace(other, starts=tuning.starts, agreed=tuning.agreed)
    # No leak leads on from here: the search began at one point alone.
    return _on_the_rope(given, finer, again, known, 1, seed, progress)


def seen_at(
    looks: Sequence[Callable[[int], tuple[DesignQuestion, Assessment | None, float]]],
) -> tuple[bool, int]:
    """Return whether an answer keeps the limits where `evaluate_gains` looks at it, on what masses.

    They are those that the answer asks for, whatever masses it was found on; a look for each member
    is as `on_common_masses` takes it.
    """
    seen = on_common_masses(looks)
    stands = all(
        loop is not None
        and all(limit.use(limit.worst(loop)) <= 1.0 + KEPT for limit in question.limits)
        for question, loop, _ in seen
    )
    return stands, max(question.masses for question, _, _ in seen)


def _fitted(posed: PosedFamily, tuning: Tuning) -> PosedFamily:
    """Return the family as an answer asks for it; itself where a member is not stable."""
    seen = [t.assessment for t in (tuning, *tuning.members) if t.assessment is not None]
    if len(seen) < len(posed.questions) or not all(one.stable for one in seen):
        return posed
    return posed.fitted(seen)


def _high_order(posed: PosedFamily, order: int | None, progress: Progress | None) -> Design:
    """Return the design of a controller of high order, made for the case alone."""
    if posed.first.held:
        raise InputError("fixed: must be empty for high-order, which is not found by parameters")
    question, parameters = high_order_gains(posed.first.case, order, progress)
    name, masses = question.structure.name, question.masses
    others = (
        pose(member.case, name, masses, built_for=question.case) for member in posed.questions[1:]
    )
    designs = []
    for member in (question, *others):
        growth = member.problem.growth(member.values(parameters))
        loop = member.assess(parameters) if growth <= 0.0 else None
        designs.append(evaluated(member, parameters, loop, growth=growth))
    return verified(together(designs, posed), progress)


@one_thread()
def evaluate_gains(case: Case, gains: object, structure: str | None = None) -> Design:
    """Return what given parameters do on a case, in the same form as an optimised design.

    It is ok if the limits are kept with the least damping that the rope may have, too.

    Parameters
    ----------
    case
        The case.
    gains
        The structure's parameters by name, for payload feedback ``A, a, a1, a2``; ``A`` may be
        left out for the case's own (1 if it has none).  Or the section `gains` of a case, or a
        `Design`: it is looked at on no fewer rope masses than it was found on, so that on its own
        case it is the same design again.
    structure
        Name of the structure, see `synth.structures.structure_names`; by default that of a design,
        else payload feedback.

    Raises
    ------
    InputError
        If there is no such structure, it is not that of the design, or a parameter is missing,
        unknown or out of its range.
    """
    least = 0
    if isinstance(gains, Design):
        if structure not in (None, gains.structure):
            raise InputError(
                f"structure: must be that of the design, {gains.structure}, got {structure}"
            )
        structure, least, gains = gains.structure, gains.masses, gains.parameters
    posed = pose_family(case, (), structure or "payload-feedback")
    complete = checked_parameters(posed.first, gains)
    looks = [partial(_looked_at, one, complete) for one in posed.questions]
    looked = on_common_masses(looks, least)
    posed = replace(posed, questions=tuple(question for question, _, _ in looked))
    designs = [
        evaluated(question, complete, loop, growth=growth) for question, loop, growth in looked
    ]
    return verified(together(designs, posed), None)


def _assessed(question: DesignQuestion, values: Values) -> Assessment:
    return question.problem.assess(values)


def _glance(start: Coefficients, question: DesignQuestion, values: Values) -> Assessment | None:
    return glanced(question.problem, values, start=start)


def _looked_at(
    question: DesignQuestion,
    parameters: Mapping[str, float],
    masses: int,
    assess: Callable[[DesignQuestion, Values], Assessment | None] = _assessed,
) -> tuple[DesignQuestion, Assessment | None, float]:
    """Return a question on the masses that given parameters ask for, and their loop in it."""
    if question.masses < masses and question.data.masses is None:
        question = with_masses(question, masses)
    return on_enough_masses(question, parameters, assess)


def evaluated(
    question: DesignQuestion,
    parameters: Mapping[str, float],
    assessment: Assessment | None,
    prices: Mapping[str, float] | None = None,
    *,
    growth: float = 0.0,
    how: str = "stable",
) -> Design:
    """Return what given parameters do: a design that is ok if it keeps every limit.

    `how` begins its status; `growth` [1/s] is told where `assessment` is None.
    """
    if assessment is None:
        status = "unstable: on the verge with any drag that agrees with the motion"
        if growth > 0.0:
            status = f"unstable: grows by a factor e every {1.0 / growth:.3g} s"
        return recorded(question, parameters, None, {}, ok=False, status=status)
    uses = every_use(question, assessment, prices or {})
    broken = [u.name for u in uses.values() if u.enforced and not u.kept]
    swings = assessment.swings
    how = "unstable in small motion, where drag vanishes: it swings by itself" if swings else how
    status = f"{how}; " + (f"breaks {', '.join(broken)}" if broken else "keeps every limit")
    ok = not (broken or swings)
    return recorded(question, parameters, assessment, uses, ok=ok, status=status)


def _answer(
    posed: PosedFamily,
    starts: int,
    seed: int,
    known: Sequence[Sequence[float]],
    progress: Progress | None,
    *,
    drive: bool = True,
    only_known: bool = False,
) -> tuple[PosedFamily, Tuning]:
    """Return the answer of one member alone, and from where its search ended that of the family.

    Where the worst member counts it is the hardest, whose answer is nearly that of all; else the
    case.  The family stands on the rope masses that the answer of the one alone asks for.  With
    `only_known` the search begins at known points alone.
    """
    family = posed.problem if drive else posed.without_drive
    one = 0
    if len(posed.questions) > 1 and posed.objective is Objective.WORST:
        one = hardest(family, seed)
    alone = family.scenarios[one].problem
    found = search(alone, starts, seed, known, progress, only_guesses=only_known)
    if len(posed.questions) == 1:
        return posed, tuning_of(alone, no_worse(alone, found, known))
    tuning = tuning_of(alone, found)
    posed = posed.on(_fitted(posed.alone(one), tuning).masses)
    last = not drive or not any(question.drive for question in posed.questions)
    if not last and tuning.assessment is not None and tuning.found.excess > KEPT:
        return posed, tuning  # what one member cannot keep the family cannot
    family = posed.problem if drive else posed.without_drive
    again = _again(family, tuning, starts, seed, progress, known, anew=True)
    if not again.ok and last and len(posed.questions) > posed.given:
        agreed = tuning.ok
        if one >= posed.given:
            given = FamilyProblem(scenarios=family.scenarios[: posed.given])
            begins = [s.begin for s in tuning.starts[:_RESUMED]]
            if again.found.solved is not None:
                begins = [again.found.solved.values, *begins]
            found = search(given, 1, seed, begins, progress, only_guesses=True)
            agreed = agreed or tuning_of(given, found).ok
        if agreed:
            again = replace(again, status=_damped_too_little(posed, again))
    return posed, again


def _damped_too_little(posed: PosedFamily, tuning: Tuning) -> str:
    """Return what the least damping of the rope breaks, in one sentence."""
    words = least_damping_text(posed.first.case)
    each = [*zip(posed.questions, (tuning, *tuning.members), strict=False)][posed.given :]
    for question, member in each:
        peak = member.limits.get("max_sensitivity")
        if member.margins is not None and peak is not None and not peak.kept:
            return (
                f"{_NO_DESIGN}: at {words}, M_s is {_number(peak.value, peak.bound)} instead of "
                f"{_number(question.case.limits.max_sensitivity, peak.value)} near "
                f"{member.margins.peak:.3g} rad/s"
            )
    return f"{_NO_DESIGN}: at {words}, the limits cannot all be kept"


def _again(
    family: FamilyProblem,
    tuning: Tuning,
    starts: int,
    seed: int,
    progress: Progress | None,
    known: Sequence[Sequence[float]] = (),
    *,
    anew: bool = False,
) -> Tuning:
    """Return the answer for more members or more rope masses, from the ends of a search.

    The answer is polished where it stands.  What else the search came upon is gone to the end of
    only where it was better before than the answer is now, as neither members nor masses gain much,
    and only once: it then costs without end.  If the answer cannot be kept, the ends are guesses of
    a search, which starts elsewhere too if it is to look `anew`.
    """
    solved = tuning.found.solved
    ranked = sorted((s for s in tuning.starts if s.converged), key=lambda s: -s.cost)
    apart = {f"{s.cost:.4g}": s for s in ranked}  # of starts that agree one
    others = [*reversed(apart.values())][:_RESUMED]
    ends = [start.end for start in others]
    if solved is not None:
        ends = [solved.values, *ends[1:]]
    if family.objective is Objective.REGRET:
        family = with_bests(family, seed, ends, progress)
    standing = None
    wide = False
    if tuning.ok and family.objective is not Objective.REGRET:
        standing, wide = _where_it_stands(family, tuning.found), anew
    found = standing
    if standing is None:
        found = search(family, starts if wide else 1, seed, ends, progress, only_guesses=not wide)
    elif better := [s for s in others[1:] if s.cost < family.total(standing.costs)]:
        # What was better before may break the limits of the others: then the answer stands.
        resumed = [s.end for s in better]
        other = search(family, 1, seed, resumed, progress, only_guesses=True, kept_only=True)
        found = other if _beats(other, standing) else standing
        spent = {f"{s.cost:.4g}" for s in better}
        tried = (replace(s, cost=np.inf) if f"{s.cost:.4g}" in spent else s for s in tuning.starts)
        tuning = replace(tuning, starts=tuple(tried))
    assert found is not None
    again = tuning_of(family, no_worse(family, found, known))
    if not again.ok and tuning.ok and not wide:
        again = tuning_of(family, search(family, starts, seed, ends[:1], progress))
    return replace(again, starts=tuning.starts, agreed=tuning.agreed)


def _beats(found: Found, other: Found) -> bool:
    """Return whether an answer keeps the limits and is better than another, which keeps them."""
    one, two = found.solved, other.solved
    if one is None or two is None or found.excess > KEPT or not one.converged:
        return False
    return one.objective < two.objective


def _where_it_stands(family: FamilyProblem, found: Found) -> Found | None:
    """Return an answer for more members or rope masses, polished; None if it cannot be kept."""
    solved, reference = found.solved, found.reference
    if solved is None or reference is None:
        return None
    known = solved.coefficients
    known += known[-1:] * (len(family.scenarios) - len(known))
    if not family.stable(solved.values, known):
        return None
    polished, assessments, excess = polish(family, replace(solved, coefficients=known), reference)
    if not polished.converged or excess > KEPT:
        return None
    return replace(found, solved=polished, assessments=assessments, excess=excess)


def _best_possible(
    posed: PosedFamily,
    missed: Tuning,
    starts: int,
    seed: int,
    known: Sequence[Sequence[float]],
    progress: Progress | None,
) -> Design | tuple[PosedFamily, Tuning]:
    """Return the best design in the largest feasible sea, for a drive that is too small.

    Or the answer in the sea asked for, where that is feasible after all.
    """
    case, solved = posed.first.case, missed.found.solved
    alike = False
    if solved is not None and missed.found.excess > KEPT:
        # Where no limit of the drive is in the way, the others exclude each other without it too.
        drive = {limit.name for question in posed.questions for limit in question.drive}
        alike = not any(own[name] for own in solved.prices for name in drive & own.keys())
        known = [[float(v) for v in solved.values], *known] if alike else known
    posed, free = _answer(posed, starts, seed, known, progress, drive=False, only_known=alike)
    if not free.ok:
        status = free.status
        if not status.startswith(_NO_DESIGN):
            status = f"whatever the drive: {status}"
        return _family_design(posed, replace(free, status=status), drive_kept=False)
    short = shortfall(posed.problem, free, progress)
    if short is None:
        status = "the drive's limits cannot be kept in any sea, however small"
        return _family_design(posed, replace(free, ok=False, status=status), drive_kept=False)
    if short.share >= 1.0:
        # The sea asked for is feasible after all: the search missed it, so it starts from there.
        found = search(posed.problem, 4, seed, [short.values], progress)
        return posed, tuning_of(posed.problem, found)
    calm = _in_the_largest_sea(posed, short)
    height = calm.significant_height
    design = replace(
        calm,
        status=_too_small(posed, short, height),
        case=case,
        required=short.required,
        starts=free.starts,
        agreed=free.agreed,
        members=tuple(
            replace(member, case=question.case)
            for member, question in zip(calm.members, posed.questions[1:], strict=True)
        ),
    )
    return replace(verified(design, progress), ok=False)


def _in_the_largest_sea(posed: PosedFamily, short: Shortfall) -> Design:
    """Return what the drive can do in the largest sea, with parameters for that.

    The shortfall makes everything smaller that shakes the loop, but the noise of sensors does not
    shrink with the sea.  Its parameters are kept in what sea they can; there, where the noise is
    what it is, they are looked for again, until no larger sea is found.
    """
    values, share = np.array(short.values), short.share
    found = _kept_in(posed, posed.first.named(short.values), share)
    asked = posed.first.case.sea.significant_height
    if found.significant_height > (1.0 - _ALIKE) * share * asked:
        return found  # noise counts for nothing
    for _ in range(_CALMER_ROUNDS):
        there = _in_seas(posed, found.significant_height / asked)
        pairs = zip(there.questions, (found, *found.members), strict=True)
        known = [question.coefficients_of(one.drag, one.friction) for question, one in pairs]
        better = larger_sea(there.problem, values, known)
        if better is None or better[0] < 1.0 + _ALIKE:
            break
        share, values = better
        found = _kept_in(there, posed.first.named([float(v) for v in values]), share)
    return found


def _in_seas(posed: PosedFamily, share: float) -> PosedFamily:
    """Return a family in seas of a share of its own significant heights."""
    questions = []
    for question in posed.questions:
        height = share * question.case.sea.significant_height
        calmer = pose(
            question.case.replace({"sea.significant_height": height}),
            question.structure.name,
            question.masses,
            built_for=posed.first.case,
        )
        questions.append(replace(calmer, held=question.held))
    return replace(posed, questions=tuple(questions))


def _kept_in(posed: PosedFamily, parameters: Mapping[str, float], share: float) -> Design:
    """Return given parameters in seas near a share of those asked for that the drive can do.

    The sea may have to be calmer than that, as the noise of sensors does not shrink with it.
    """

    def at(log_share: float) -> Design:
        designs = []
        for calmer in _in_seas(posed, float(np.exp(log_share))).questions:
            assessment = calmer.assess(parameters)
            uses = every_use(calmer, assessment, {})
            designs.append(recorded(calmer, parameters, assessment, uses, ok=False, status=""))
        return with_members(designs, posed)

    def over(log_share: float) -> float:
        design = at(log_share)
        return max(
            one.limits[limit.name].use
            for one, question in zip((design, *design.members), posed.questions, strict=True)
            for limit in question.drive
        ) - 1.0  # fmt: skip

    top = float(np.log(share))
    if over(top) > _HAIR > over(top - _CALMER):
        top = brentq(lambda x: over(x) - 0.5 * _HAIR, top - _CALMER, top, xtol=0.1 * _HAIR)
    return at(top)


def _too_small(posed: PosedFamily, found: Shortfall, height: float) -> str:
    names = {limit.name: limit for question in posed.questions for limit in question.limits}
    asked = posed.first.case.sea.significant_height
    text = (
        f"not feasible at H_s {asked:.3g} m: {found.breaks_first} breaks first; feasible up to "
        f"H_s {height:.3g} m, for which the gains are"
    )
    needs = [
        f"{name} {_number(value, names[name].bound)} {names[name].unit} instead of "
        f"{_number(names[name].bound, value)}"
        for name, value in found.required.items()
    ]
    return f"{text}; H_s {asked:.3g} m would take {' and '.join(needs)}" if needs else text


def _number(value: float, other: float) -> str:
    digits = digits_apart(value, other, 4)
    return f"{value:.{digits}g}" if abs(value) < 1e4 else f"{value:,.0f}".replace(",", " ")


def _family_design(posed: PosedFamily, tuning: Tuning, *, drive_kept: bool = True) -> Design:
    """Return a tuning as a design, with one for each further member."""
    tunings = (tuning, *tuning.members) if tuning.members else (tuning,) * len(posed.questions)
    each = zip(posed.questions, tunings, strict=True)
    return with_members([design_of(*pair, drive_kept=drive_kept) for pair in each], posed)


def with_members(designs: Sequence[_D], posed: PosedFamily) -> _D:
    """Return the first of some designs, the others as its members."""
    first, *others = designs
    return replace(
        first,
        objective=posed.objective.value,
        fixed=tuple(posed.first.held),
        members=tuple(replace(member, built_for=posed.first.case) for member in others),
    )


def together(designs: Sequence[_D], posed: PosedFamily) -> _D:
    """Return the first of the members' designs with the others, ok if all of them are."""
    each = zip(posed.names, designs, strict=True)
    failed = [f"{name}: {one.status}" for name, one in each if not one.ok]
    design = with_members(designs, posed)
    if len(designs) == 1 or not failed:
        return design
    return replace(design, ok=False, status="; ".join(failed))


def design_of(question: DesignQuestion, tuning: Tuning, *, drive_kept: bool = True) -> Design:
    """Return a tuning as a design, with the limits that it did not have to keep as reported."""
    solved = tuning.found.solved
    if tuning.assessment is None or solved is None:
        status = "no stabilising gains were found"
        design = recorded(question, {}, None, {}, ok=False, status=status)
    else:
        prices = {name: use.price for name, use in tuning.limits.items()}
        uses = every_use(question, tuning.assessment, prices, drive_kept=drive_kept)
        design = recorded(
            question,
            question.named([float(v) for v in solved.values]),
            tuning.assessment,
            uses,
            ok=tuning.ok,
            status=tuning.status,
        )
    return replace(design, starts=tuning.starts, agreed=tuning.agreed, drive_kept=drive_kept)


def every_use(
    question: DesignQuestion,
    assessment: Assessment,
    prices: Mapping[str, float],
    *,
    drive_kept: bool = True,
) -> dict[str, LimitUse]:
    """Return the use of the limits that bind and of those that are reported only, by name."""
    enforced = question.limits if drive_kept else question.loop
    reported = (*question.reported, *(() if drive_kept else question.drive))
    return {
        **limit_uses(enforced, assessment, prices),
        **limit_uses(reported, assessment, prices, enforced=False),
    }


def recorded(
    question: DesignQuestion,
    parameters: Mapping[str, float],
    assessment: Assessment | None,
    uses: Mapping[str, LimitUse],
    *,
    ok: bool,
    status: str,
) -> Design:
    """Return a design in the question's sea; `assessment` is None where the loop is unstable."""
    drag, friction, shares = question.drag_before, 0.0, {}
    if assessment is not None:
        drag, friction = question.equivalents(assessment.coefficients)
        limits = (*question.limits, *question.reported)
        signals = dict.fromkeys([PAYLOAD, *(name for limit in limits for name in limit.outputs)])
        losses = question.plant.loss
        shares = {
            name: assessment.shares(name)
            | ({SWITCHING_LOSS: losses[name]} if losses.get(name, 0.0) > 0.0 else {})
            for name in signals
        }
    return Design(
        case=question.case,
        structure=question.structure.name,
        parameters=dict(parameters),
        units={p.name: p.unit for p in question.whole_law.parameters},
        ok=ok,
        status=status,
        significant_height=question.case.sea.significant_height,
        payload_rms=assessment.sigma(PAYLOAD) if assessment is not None else np.inf,
        payload_rms_before=question.payload_rms_before,
        hook_rms=float(question.hook.displacement.rms),
        shares=shares,
        margins=assessment.margins if assessment is not None else None,
        limits=uses,
        drag=drag,
        drag_before=question.drag_before,
        friction=friction,
        masses=question.masses,
    )


def verified(design: Design, progress: Progress | None) -> Design:
    """Return the design with its independent check; one that fails it is not ok.

    An exhibit is looked at with the least damping of its rope too.
    """
    if design.margins is None:
        return design
    if progress is not None:
        progress("verify", 0, 1)
    checked = design.verify()
    if progress is not None:
        progress("verify", 1, 1)
    status = design.status
    if design.payload_rms > design.payload_rms_before:
        status += "; with the drum held the payload moves less"
    if not checked.ok and not status.startswith(_NO_DESIGN):
        # What is wrong besides, as with a drive that is too small, is not hidden by it.
        found = f"not verified: {checked.status}"
        status = found if design.ok else f"{status}; {found}"
    return replace(
        design,
        ok=design.ok and checked.ok,
        status=status,
        verification=checked,
        exhibit=_exhibit(design),
    )


def _exhibit(design: Design) -> Design | None:
    """Return what a design does with the least damping of its rope, where that is reported only."""
    least = design.sea_case.with_least_damping
    if least is None or design.case.rope.damping_law == "hysteretic":
        return None
    question = pose(least, design.structure, design.masses, built_for=design.built_for)
    question, loop, growth = _looked_at(question, design.parameters, 0)
    found = evaluated(question, design.parameters, loop, growth=growth)
    limits = {name: replace(use, enforced=False) for name, use in found.limits.items()}
    return replace(found, limits=limits, built_for=design.built_for or design.case)


def checked_parameters(question: DesignQuestion, gains: object) -> dict[str, float]:
    """Return parameters by name, checked; the amplifier is the case's own if it is left out."""
    given: dict[str, object] = {}
    if isinstance(gains, Mapping):
        given = dict(gains)
    elif gains is not None:
        given = {name: getattr(gains, name) for name in getattr(type(gains), "model_fields", ())}
    law = {p.name: p for p in question.law.parameters}
    own = {} if question.amplifier is None else {"A": question.amplifier}
    unknown = [name for name in given if name not in {**law, **own}]
    missing = [name for name in law if name not in given]
    if unknown or missing:
        optional = " and optionally A" if own else ""
        raise InputError(
            f"gains: must be {', '.join(law)}{optional}, got {', '.join(given) or 'none'}"
        )
    every: dict[str, Any] = {**own, **given}
    checked = {}
    for name in (*own, *law):
        # A gain may have either sign; a corner, a width, a bandwidth may not.
        low = -np.inf if name in GAINS else law[name].low
        checked[name] = check_range(
            "gains", name, every[name], low=0.0 if low >= 0.0 else -np.inf, open_low=low > 0.0
        )
    return checked
