"""Optimisation and evaluation of the gains of a case.

    Case -> DesignQuestion -> tune -> (too hard? largest sea, what it would take) -> GainDesign

A case that cannot be met is the norm, not the exception: then the design is the best one in
the largest sea that can, and the status names the limit that breaks first and what it would
have to be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.basics import InputError, check_range, one_thread
from models.case import Case
from models.plant import masses_for_bandwidth

from ..loop import Assessment
from ..question import PAYLOAD, DesignQuestion, pose, with_masses
from ..search import Progress, search
from .design import GainDesign
from .infeasible import Shortfall, shortfall
from .tuning import LimitUse, Tuning, limit_uses, tuning_of

_MODES = 5.0  # every rope mode below this many crossovers belongs in the design plant
_MOST_MASSES = 40
_RESUMED = 5  # ends of a search that the next one, on more masses, begins from


@one_thread()
def optimise_gains(
    case: Case, *, starts: int = 16, seed: int = 0, progress: Progress | None = None
) -> GainDesign:
    """Return the gains that minimise the payload's variance within the limits of a case.

    As in the thesis, it is the sea alone that shakes them: the noise of the payload's sensors is
    not counted here, but by `optimise_structure` and by the bound (`GainDesign.bound`).

    Parameters
    ----------
    case
        The case; its `gains.A` fixes the amplifier, as only the products A a, A a1, A a2 act.
    starts, seed
        Size and seed of the multi-start search.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    GainDesign
        `ok` only if it is stable, keeps every enforced limit in the sea asked for and passes
        the independent check.

    Raises
    ------
    InputError
        If a limit lies below the static load, or the rope needs more masses than there are.
    """
    question = pose(case)
    guesses = _guesses(question)
    tuning = tuning_of(question.problem, search(question.problem, starts, seed, guesses, progress))
    while (wanted := _masses_wanted(question, tuning)) > question.masses:
        # The rope turned out to need more masses: the ends of the search are the guesses.
        question = with_masses(question, wanted)
        values = list(tuning.parameters.values())
        problem = question.problem
        ends = [s.end for s in sorted(tuning.starts, key=lambda s: s.cost) if s.converged]
        guesses = [values, *([float(v) for v in end] for end in ends[:_RESUMED])]
        again = tuning_of(problem, search(problem, 1, seed, guesses, progress, only_guesses=True))
        if not again.ok and tuning.ok:
            again = tuning_of(problem, search(problem, starts, seed, [values], progress))
        tuning = replace(again, starts=tuning.starts, agreed=tuning.agreed)
    if tuning.ok:
        return _verified(question, _design(question, tuning, tuning.status), progress)
    if tuning.assessment is None or not any(limit.drive for limit in question.limits):
        return _design(question, tuning, tuning.status)
    return _best_possible(question, starts, seed, progress)


@one_thread()
def evaluate_gains(case: Case, gains: Mapping[str, float]) -> GainDesign:
    """Return what given gains do on a case, in the same form as an optimised design.

    Parameters
    ----------
    case
        The case.
    gains
        ``A, a, a1, a2``; ``A`` may be left out for the case's own (1 if it has none).

    Raises
    ------
    InputError
        If a gain is missing, unknown or not finite.
    """
    complete = _complete(case, gains)
    question = pose(case)
    growth = _growth(question, complete)
    if growth <= 0.0:
        masses = _masses_for(question, question.assess(complete))
        if masses > question.masses:
            question = with_masses(question, masses)
            growth = _growth(question, complete)
    if growth > 0.0:
        return _unstable(question, complete, growth)
    assessment = question.assess(complete)
    uses = _uses(question, assessment, {})
    broken = [u.name for u in uses.values() if u.enforced and not u.kept]
    status = "stable; " + (f"breaks {', '.join(broken)}" if broken else "keeps every limit")
    design = _record(question, complete, assessment, uses, ok=not broken, status=status)
    return _verified(question, design, None)


def _best_possible(
    question: DesignQuestion, starts: int, seed: int, progress: Progress | None
) -> GainDesign:
    """Return the best design in the largest feasible sea, for a drive that is too small."""
    case = question.case
    loop_limits = tuple(limit for limit in question.limits if not limit.drive)
    loop_only = question.problem_with(loop_limits)
    free = tuning_of(loop_only, search(loop_only, starts, seed, _guesses(question), progress))
    if not free.ok:
        return _design(question, free, f"whatever the drive: {free.status}")
    found = shortfall(question, free, progress)
    if found is None:
        status = "the drive's limits cannot be kept in any sea, however small"
        return _design(question, free, status)
    height = found.share * case.sea.significant_height
    calmer = pose(case.replace({"sea.significant_height": height}), question.masses)
    if found.share >= 1.0:
        # The sea asked for is feasible after all: the search missed it, so it starts from there.
        values = [found.values[name] for name in ("a", "a1", "a2")]
        tuning = tuning_of(question.problem, search(question.problem, 4, seed, [values], progress))
        return _verified(question, _design(question, tuning, tuning.status), progress)
    gains = {"A": question.amplifier, **found.values}
    assessment = calmer.assess(gains, found.coefficient)
    uses = _uses(calmer, assessment, {})
    design = _record(
        question, gains, assessment, uses, ok=False, status=_too_small(question, found, height)
    )
    design = replace(
        design,
        significant_height=height,
        payload_rms_before=calmer.payload_rms_before,
        drag_before=calmer.drag_before,
        hook_rms=float(calmer.hook.displacement.rms),
        required=found.required,
        starts=free.starts,
        agreed=free.agreed,
    )
    return replace(_verified(question, design, progress), ok=False)


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


def _design(question: DesignQuestion, tuning: Tuning, status: str) -> GainDesign:
    if tuning.assessment is None:
        return _unstable(question, {"A": question.amplifier, "a": 0.0, "a1": 0.0, "a2": 0.0}, 0.0)
    gains = {"A": question.amplifier, **tuning.parameters}
    prices = {name: use.price for name, use in tuning.limits.items()}
    uses = _uses(question, tuning.assessment, prices)
    design = _record(question, gains, tuning.assessment, uses, ok=tuning.ok, status=status)
    return replace(design, starts=tuning.starts, agreed=tuning.agreed)


def _uses(
    question: DesignQuestion, assessment: Assessment, prices: Mapping[str, float]
) -> dict[str, LimitUse]:
    return {
        **limit_uses(question.limits, assessment, prices),
        **limit_uses(question.reported, assessment, prices, enforced=False),
    }


def _record(
    question: DesignQuestion,
    gains: Mapping[str, float],
    assessment: Assessment | None,
    uses: Mapping[str, LimitUse],
    *,
    ok: bool,
    status: str,
) -> GainDesign:
    """Return a design in the sea asked for; `assessment` is None where the loop is unstable."""
    drag = question.drag_before
    if assessment is not None:
        fixed = question.case.payload.fixed_drag
        drag = assessment.coefficient if question.drag is not None else float(fixed or 0.0)
    return GainDesign(
        case=question.case,
        gains=dict(gains),
        ok=ok,
        status=status,
        significant_height=question.case.sea.significant_height,
        payload_rms=assessment.sigma(PAYLOAD) if assessment is not None else np.inf,
        payload_rms_before=question.payload_rms_before,
        hook_rms=float(question.hook.displacement.rms),
        margins=assessment.margins if assessment is not None else None,
        limits=uses,
        drag=drag,
        drag_before=question.drag_before,
        masses=question.masses,
    )


def _unstable(question: DesignQuestion, gains: Mapping[str, float], growth: float) -> GainDesign:
    status = "no stabilising gains were found"
    if growth > 0.0:
        status = f"unstable: grows by a factor e every {1.0 / growth:.3g} s"
    return _record(question, gains, None, {}, ok=False, status=status)


def _verified(
    question: DesignQuestion, design: GainDesign, progress: Progress | None
) -> GainDesign:
    """Return the design with its independent check; one that fails it is not ok."""
    if progress is not None:
        progress("verify", 0, 1)
    checked = design.verify()
    if progress is not None:
        progress("verify", 1, 1)
    status = design.status + _in_small_motion(question, design.gains)
    if design.payload_rms > design.payload_rms_before:
        status += "; with the drum held the payload moves less"
    if not checked.ok:
        status = f"not verified: {checked.status}"
    return replace(design, ok=design.ok and checked.ok, status=status, verification=checked)


def _growth(
    question: DesignQuestion, gains: Mapping[str, float], drag: float | None = None
) -> float:
    """Return the largest growth rate of the loop [1/s], by default with the drag before."""
    coefficient = question.drag_before if drag is None else drag
    return float(question.assess(gains, coefficient).poles.real.max())


def _in_small_motion(question: DesignQuestion, gains: Mapping[str, float]) -> str:
    """Return a remark if the loop needs its drag to be stable, else nothing.

    Quadratic drag vanishes in small motion: such a loop swings by itself, at the amplitude
    that gives it drag enough.
    """
    if question.drag is None or _growth(question, gains, 0.0) <= 0.0:
        return ""
    return "; without drag, in small motion, the loop is unstable and swings by itself"


def _guesses(question: DesignQuestion) -> Sequence[Sequence[float]]:
    gains = question.case.gains
    return [] if gains is None else [[gains.a, gains.a1, gains.a2]]


def _complete(case: Case, gains: Mapping[str, float]) -> dict[str, float]:
    unknown = sorted(set(gains) - {"A", "a", "a1", "a2"})
    missing = [name for name in ("a", "a1", "a2") if name not in gains]
    if unknown or missing:
        raise InputError(
            "gains: must be a, a1, a2 and optionally A, got " + (", ".join(gains) or "none")
        )
    own = case.gains.A if case.gains is not None else 1.0
    values = {"A": own, **gains}
    return {name: check_range("gains", name, values[name]) for name in ("A", "a", "a1", "a2")}


def _masses_wanted(question: DesignQuestion, tuning: Tuning) -> int:
    if tuning.assessment is None or not tuning.assessment.stable:
        return question.masses
    return _masses_for(question, tuning.assessment)


def _masses_for(question: DesignQuestion, assessment: Assessment) -> int:
    """Return the rope masses that the loop's crossover asks for, where the case leaves it open."""
    if question.data.masses is not None or not assessment.margins.crossovers.size:
        return question.masses
    highest = _MODES * float(assessment.margins.crossovers.max())
    try:
        return max(question.masses, masses_for_bandwidth(question.data, highest))
    except InputError:
        return _MOST_MASSES
