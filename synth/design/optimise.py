"""Optimisation and evaluation of the parameters of any structure on a case.

    Case, structure -> DesignQuestion -> simpler structures within -> search
                    -> (too hard? largest sea, what it would take) -> Design -> verified

A case that cannot be met is the norm, not the exception: then the design is the best one in
the largest sea that can, and the status names the limit that breaks first and what it would
have to be.  A design that fails its independent check is not ok, whatever the search said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from models.basics import InputError, check_range, one_thread
from models.case import Case
from models.plant import MAX_MASSES
from models.sensing import aboard

from ..loop import Assessment
from ..question import GAINS, PAYLOAD, DesignQuestion, Problem, masses_for, pose, with_masses
from ..search import Progress, search
from ..structures import LowOrderFeedback, structure_named
from .design import Design
from .high_order import high_order_gains
from .infeasible import Shortfall, shortfall
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
_SHARE = 4  # of the starts that each of several structures has
_RESUMED = 5  # ends of a search that the next one, on more masses, begins from
_HAIR = 1e-4  # relative excess over a limit in the largest sea
_CALMER = 3.0  # logarithm of what the largest sea may have to be calmer by, for the sensors' noise


@one_thread()
def optimise_gains(
    case: Case,
    structure: str | Sequence[str] | None = None,
    *,
    starts: int = 16,
    seed: int = 0,
    progress: Progress | None = None,
    guesses: Sequence[Mapping[str, float]] = (),
) -> Design:
    """Return the controller that minimises the payload's variance within the limits of a case.

    Of several structures it is the simplest within five percent of the stillest that is ok; the
    others are its `alternatives`.  Where the limits cannot all be kept, it is the stillest in the
    largest sea in which any structure can keep them.

    Parameters
    ----------
    case
        The case; its `gains.A` fixes the amplifier of payload feedback, as only the products
        A a, A a1, A a2 act.
    structure
        Name of the structure, see `synth.structures.structure_names`, or several, the simplest
        first; by default those of `NESTED` whose sensors the case names.
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
        the independent check.

    Raises
    ------
    InputError
        If there is no such structure, or a limit lies below the static load.
    """
    check_range("optimise_gains", "starts", starts, low=1)
    if isinstance(structure, str):
        return _optimised(case, structure, int(starts), seed, progress, guesses)
    names = structures_aboard(case) if structure is None else tuple(dict.fromkeys(structure))
    if not names:
        raise InputError("optimise_gains: structure must name at least one structure, got none")
    few = max(1, -(-int(starts) // _SHARE))
    designs: list[Design] = []
    for k, name in enumerate(names):
        stage = None if progress is None else _told(progress, f"{name} ({k + 1}/{len(names)})")
        simpler = [d.parameters for d in designs if d.structure in WITHIN.get(name, ())]
        known = [*guesses, *(parameters for parameters in simpler if parameters)]
        designs.append(_optimised(case, name, few, seed, stage, known))
    chosen = _simplest(designs)
    others = tuple(design for design in designs if design is not chosen)
    return replace(chosen, alternatives=others)


def structures_aboard(case: Case) -> tuple[str, ...]:
    """Return the structures of `NESTED` whose sensors a case names, the simplest first."""
    heard = set(aboard(case))
    named = {name: structure_named(name, case) for name in NESTED}
    return tuple(name for name, made in named.items() if heard.issuperset(made.measurements))


def _simplest(designs: Sequence[Design]) -> Design:
    """Return the simplest design within five percent of the stillest; see `optimise_gains`."""
    ok = [design for design in designs if design.ok]
    if not ok:
        roughest = max(design.significant_height for design in designs)
        there = [d for d in designs if d.significant_height >= _ROUGHEST * roughest]
        return min(there, key=lambda design: design.payload_rms)
    stillest = min(design.payload_rms for design in ok)
    return next(design for design in ok if design.payload_rms <= _AS_STILL * stillest)


def _told(progress: Progress, name: str) -> Progress:
    def tell(stage: str, done: int, total: int) -> None:
        progress(f"{name}: {stage}", done, total)

    return tell


def _optimised(
    case: Case,
    structure: str,
    starts: int,
    seed: int,
    progress: Progress | None,
    guesses: Sequence[Mapping[str, float]],
) -> Design:
    """Return the design of one structure; see `optimise_gains`."""
    count = starts
    question = pose(case, structure)
    if isinstance(named := question.structure, LowOrderFeedback) and named.family == "high-order":
        question, parameters = high_order_gains(case, named.order or None, progress)
        return verified(_evaluated(question, parameters), progress, question)
    known = starts_from(question, guesses) or nested_starts(question, count, seed, progress)
    count += len(known)
    known = [*known, *gains_in_use(question)]
    tuning = _searched(question.problem, count, seed, known, progress)
    while (loop := tuning.assessment) is not None and loop.stable:
        if (wanted := masses_for(question, loop)) <= question.masses:
            break
        # The rope turned out to need more masses: the ends of the search are the guesses.
        question, tuning = _on_more(question, wanted, tuning, count, seed, progress)
    if not tuning.ok:
        if tuning.assessment is None or not question.drive:
            return design_of(question, tuning)
        return _best_possible(question, count, seed, known, progress)
    design = verified(design_of(question, tuning), progress, question)
    most = 1 if question.data.lumping == "thesis" else MAX_MASSES
    while tuning.ok and not design.ok and 2 * question.masses <= most:
        # It stands on its own rope only: once more on twice the masses.
        question, tuning = _on_more(question, 2 * question.masses, tuning, count, seed, progress)
        design = verified(design_of(question, tuning), progress, question)
    return design


@one_thread()
def evaluate_gains(case: Case, gains: object, structure: str = "payload-feedback") -> Design:
    """Return what given parameters do on a case, in the same form as an optimised design.

    Parameters
    ----------
    case
        The case.
    gains
        The structure's parameters by name, for payload feedback ``A, a, a1, a2``; ``A`` may be
        left out for the case's own (1 if it has none).  Or the section `gains` of a case.
    structure
        Name of the structure, see `synth.structures.structure_names`.

    Raises
    ------
    InputError
        If there is no such structure, or a parameter is missing, unknown or out of its range.
    """
    question = pose(case, structure)
    complete = checked_parameters(question, gains)
    growth = _growth(question, complete)
    if growth > 0.0 and question.masses < MAX_MASSES and question.data.masses is None:
        # Few masses do not have their modes where the rope does: made on it, a loop may hold there.
        finer = with_masses(question, MAX_MASSES)
        if (there := _growth(finer, complete)) <= 0.0:
            question, growth = finer, there
    if growth <= 0.0:
        masses = masses_for(question, question.assess(complete))
        if masses > question.masses:
            question = with_masses(question, masses)
            growth = _growth(question, complete)
    if growth > 0.0:
        status = f"unstable: grows by a factor e every {1.0 / growth:.3g} s"
        return recorded(question, complete, None, {}, ok=False, status=status)
    return verified(_evaluated(question, complete), None, question)


def _evaluated(question: DesignQuestion, parameters: Mapping[str, float]) -> Design:
    """Return what parameters of a stable loop do."""
    assessment = question.assess(parameters)
    uses = every_use(question, assessment, {})
    broken = [u.name for u in uses.values() if u.enforced and not u.kept]
    status = "stable; " + (f"breaks {', '.join(broken)}" if broken else "keeps every limit")
    return recorded(question, parameters, assessment, uses, ok=not broken, status=status)


def _searched(
    problem: Problem,
    starts: int,
    seed: int,
    guesses: Sequence[Sequence[float]],
    progress: Progress | None,
) -> Tuning:
    """Return the answer of a search, or a guess that is better and keeps the limits."""
    found = search(problem, starts, seed, guesses, progress)
    return tuning_of(problem, no_worse(problem, found, guesses))


def _on_more(
    question: DesignQuestion,
    masses: int,
    tuning: Tuning,
    starts: int,
    seed: int,
    progress: Progress | None,
) -> tuple[DesignQuestion, Tuning]:
    """Return the question on more rope masses, and its answer from the ends of the search."""
    question = with_masses(question, masses)
    values, problem = list(tuning.parameters.values()), question.problem
    ends = [s.end for s in sorted(tuning.starts, key=lambda s: s.cost) if s.converged]
    known = [values, *([float(v) for v in end] for end in ends[:_RESUMED])]
    again = tuning_of(problem, search(problem, 1, seed, known, progress, only_guesses=True))
    if not again.ok and tuning.ok:
        again = tuning_of(problem, search(problem, starts, seed, [values], progress))
    return question, replace(again, starts=tuning.starts, agreed=tuning.agreed)


def _best_possible(
    question: DesignQuestion,
    starts: int,
    seed: int,
    guesses: Sequence[Sequence[float]],
    progress: Progress | None,
) -> Design:
    """Return the best design in the largest feasible sea, for a drive that is too small."""
    case = question.case
    free = _searched(question.problem_with(question.loop), starts, seed, guesses, progress)
    if not free.ok:
        status = f"whatever the drive: {free.status}"
        return design_of(question, replace(free, status=status), drive_kept=False)
    short = shortfall(question, free, progress)
    if short is None:
        status = "the drive's limits cannot be kept in any sea, however small"
        return design_of(question, replace(free, ok=False, status=status), drive_kept=False)
    if short.share >= 1.0:
        # The sea asked for is feasible after all: the search missed it, so it starts from there.
        values = list(short.values.values())
        tuning = tuning_of(question.problem, search(question.problem, 4, seed, [values], progress))
        return verified(design_of(question, tuning), progress, question)
    parameters = question.named(list(short.values.values()))
    height = short.share * case.sea.significant_height
    calm = _kept_in(question, parameters, height)
    status = _too_small(question, short, calm.significant_height)
    design = replace(
        calm,
        status=status,
        case=case,
        required=short.required,
        starts=free.starts,
        agreed=free.agreed,
    )
    return replace(verified(design, progress), ok=False)


def _kept_in(question: DesignQuestion, parameters: Mapping[str, float], height: float) -> Design:
    """Return given parameters in the sea near a height [m] in which they keep the drive's limits.

    The shortfall makes everything smaller that shakes the loop; but the noise of sensors does not
    shrink with the sea, so that the sea may have to be calmer still.
    """

    def at(log_height: float) -> Design:
        sea = {"sea.significant_height": float(np.exp(log_height))}
        calmer = pose(question.case.replace(sea), question.structure.name, question.masses)
        assessment = calmer.assess(parameters)
        uses = every_use(calmer, assessment, {})
        return recorded(calmer, parameters, assessment, uses, ok=False, status="")

    def over(log_height: float) -> float:
        limits = at(log_height).limits
        return max(limits[limit.name].use for limit in question.drive) - 1.0

    top = float(np.log(height))
    if over(top) > _HAIR > over(top - _CALMER):
        top = brentq(lambda x: over(x) - 0.5 * _HAIR, top - _CALMER, top, xtol=0.1 * _HAIR)
    return at(top)


def _too_small(question: DesignQuestion, found: Shortfall, height: float) -> str:
    names = {limit.name: limit for limit in question.limits}
    asked = question.case.sea.significant_height
    text = (
        f"not feasible at H_s {asked:.3g} m: {found.breaks_first} breaks first; feasible up to "
        f"H_s {height:.3g} m, for which the gains are"
    )
    needs = [
        f"{name} {_number(value)} {names[name].unit} instead of {_number(names[name].bound)}"
        for name, value in found.required.items()
    ]
    return f"{text}; H_s {asked:.3g} m would take {' and '.join(needs)}" if needs else text


def _number(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:,.0f}".replace(",", " ")


def design_of(question: DesignQuestion, tuning: Tuning, *, drive_kept: bool = True) -> Design:
    """Return a tuning as a design, with the limits that it did not have to keep as reported."""
    if tuning.assessment is None:
        status = "no stabilising gains were found"
        design = recorded(question, {}, None, {}, ok=False, status=status)
    else:
        prices = {name: use.price for name, use in tuning.limits.items()}
        uses = every_use(question, tuning.assessment, prices, drive_kept=drive_kept)
        design = recorded(
            question,
            question.named(list(tuning.parameters.values())),
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
    drag, shares = question.drag_before, {}
    if assessment is not None:
        fixed = question.case.payload.fixed_drag
        drag = assessment.coefficient if question.drag is not None else float(fixed or 0.0)
        limits = (*question.limits, *question.reported)
        signals = dict.fromkeys([PAYLOAD, *(name for limit in limits for name in limit.outputs)])
        shares = {name: assessment.shares(name) for name in signals}
    return Design(
        case=question.case,
        structure=question.structure.name,
        parameters=dict(parameters),
        units={p.name: p.unit for p in question.law.parameters},
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
        masses=question.masses,
    )


def verified(
    design: Design, progress: Progress | None, question: DesignQuestion | None = None
) -> Design:
    """Return the design with its independent check; one that fails it is not ok.

    `question` is the design's own, where it is at hand: it need not be posed again.
    """
    if design.margins is None:
        return design
    if progress is not None:
        progress("verify", 0, 1)
    checked = design.verify()
    if progress is not None:
        progress("verify", 1, 1)
    status = design.status + _in_small_motion(question or design.question, design.parameters)
    if design.payload_rms > design.payload_rms_before:
        status += "; with the drum held the payload moves less"
    if not checked.ok:
        status = f"not verified: {checked.status}"
    return replace(design, ok=design.ok and checked.ok, status=status, verification=checked)


def _growth(
    question: DesignQuestion, parameters: Mapping[str, float], drag: float | None = None
) -> float:
    """Return the largest growth rate of the loop [1/s], by default with the drag before."""
    coefficient = question.drag_before if drag is None else drag
    return float(question.assess(parameters, coefficient).poles.real.max())


def _in_small_motion(question: DesignQuestion, parameters: Mapping[str, float]) -> str:
    """Return a remark if the loop needs its drag to be stable, else nothing.

    Quadratic drag vanishes in small motion: such a loop swings by itself, at the amplitude
    that gives it drag enough.
    """
    if question.drag is None or _growth(question, parameters, 0.0) <= 0.0:
        return ""
    return "; without drag, in small motion, the loop is unstable and swings by itself"


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
