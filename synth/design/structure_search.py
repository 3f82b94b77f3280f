"""Optimisation of a named structure on a case.

    StructureQuestion -> simpler structures within -> search -> (drive too small? say so)
                      -> StructureDesign -> verified, on twice the rope masses too

A design that fails its independent check is not ok, whatever the search said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from models.basics import check_range, one_thread
from models.case import Case
from models.plant import MAX_MASSES

from ..limits import Limit
from ..loop import Assessment
from ..question import PAYLOAD, Problem, StructureQuestion, pose_structure
from ..search import Progress, begin_points, briskest, least_violation, search
from .structure_design import StructureDesign
from .structure_starts import nested_starts, no_worse, starts_from
from .tuning import LimitUse, Tuning, limit_uses, tuning_of

_HARDLY = 1e-2  # largest row of a limit that a search may still mend
_ROUNDS = 3  # of a search that did not arrive
_ENDS = 4  # ends of a search that the next one begins from


@one_thread()
def optimise_structure(
    case: Case,
    name: str,
    starts: int = 16,
    seed: int = 0,
    *,
    progress: Progress | None = None,
    guesses: Sequence[Mapping[str, float]] = (),
) -> StructureDesign:
    """Return the best controller of a structure for a case.

    The search first looks for the least motion within the limits of the loop.  If the drive
    cannot follow that, it looks again within the drive's limits too; if they cannot be kept at
    all, the first answer is returned, not ok, and the status says what the drive would need.

    Parameters
    ----------
    case
        The case.
    name
        Name of the structure, see `synth.structures.winch_structures.structure_names`.
    starts
        Starts of the search.
    seed
        Seed of the starts.
    progress
        Called as progress(stage, done, total).
    guesses
        Parameters by name of designs for similar cases or of simpler structures, which the search
        begins with instead of looking for such itself; what they do not name does nothing.  The
        answer is never worse than one of them that keeps the limits.

    Raises
    ------
    InputError
        If there is no such structure, or a limit lies below the static load.
    """
    check_range("optimise_structure", "starts", starts, low=1)
    posed = pose_structure(case, name)
    known = starts_from(posed, guesses) or nested_starts(posed, int(starts), seed, progress)
    design, values = _searched(posed, int(starts), seed, known, progress)
    most = 1 if posed.question.data.lumping == "thesis" else MAX_MASSES
    checked = verified(design, progress)
    while design.ok and not checked.ok and 2 * design.masses <= most:
        # It stands on its own rope only: once more on twice the masses.
        posed = pose_structure(case, name, 2 * design.masses)
        design, values = _searched(posed, int(starts), seed, [values], progress)
        checked = verified(design, progress)
    return checked


def _searched(
    posed: StructureQuestion,
    starts: int,
    seed: int,
    guesses: Sequence[Sequence[float]],
    progress: Progress | None,
) -> tuple[StructureDesign, list[float]]:
    """Return the best design within the limits, or within those that can be kept."""
    problem = posed.problem(posed.limits)
    free = _patient(problem, starts, seed, guesses, progress)
    values = list(free.parameters.values())
    if not posed.drive or not free.ok or free.assessment is None:
        return design_of(posed, free, drive_kept=not posed.drive), values
    broken = _broken(posed.drive, free.assessment)
    full = posed.problem((*posed.limits, *posed.drive))
    near = _within(full, values, seed) if broken else values
    if near is not None:
        known = [near, values]
        count = starts + len(known) if broken else 1
        tuned = tuning_of(full, no_worse(full, search(full, count, seed, known, progress), known))
        if tuned.ok:
            return design_of(posed, tuned, drive_kept=True), list(tuned.parameters.values())
    needs = [f"{u.name} {u.value:.4g} {u.unit} instead of {u.bound:.4g}" for u in broken]
    status = f"the drive is too small: without its limits the best takes {', '.join(needs)}"
    if not broken:
        status = "the search within the drive's limits did not arrive"
    return replace(design_of(posed, free, drive_kept=False), ok=False, status=status), values


def _within(problem: Problem, values: Sequence[float], seed: int) -> list[float] | None:
    """Return parameters that keep all limits, as near as a few starts come; None if none does."""
    begins = begin_points(problem, 3, seed, [values])
    if not begins:
        return None
    least = least_violation(problem, begins, briskest(problem, begins))
    return [float(v) for v in least.values] if least.objective < _HARDLY else None


def _patient(
    problem: Problem,
    starts: int,
    seed: int,
    guesses: Sequence[Sequence[float]],
    progress: Progress | None,
) -> Tuning:
    """Return the answer of a search that goes on from where it ended if no start arrived.

    With ten parameters or more a solve may need more iterations than it is given.
    """
    found = search(problem, starts + len(guesses), seed, guesses, progress)
    tuning = tuning_of(problem, no_worse(problem, found, guesses))
    for _ in range(_ROUNDS):
        if tuning.ok:
            break
        ends = [s.end for s in tuning.starts if s.stable and s.message.startswith("maximum")]
        if not ends:
            break
        again = [*([float(v) for v in end] for end in ends[:_ENDS]), *guesses]
        count = min(starts, _ENDS) + len(again)
        tuning = tuning_of(problem, search(problem, count, seed, again, progress))
    return tuning


def _broken(limits: Sequence[Limit], assessment: Assessment) -> list[LimitUse]:
    return [use for use in limit_uses(limits, assessment, {}).values() if not use.kept]


def design_of(posed: StructureQuestion, tuning: Tuning, *, drive_kept: bool) -> StructureDesign:
    """Return a tuning as a design, with the limits that it did not have to keep as reported."""
    question, assessment = posed.question, tuning.assessment
    limits: dict[str, LimitUse] = dict(tuning.limits)
    parts: dict[str, float] = {}
    if assessment is not None:
        others = (*posed.reported, *(() if drive_kept else posed.drive))
        limits |= limit_uses(others, assessment, {}, enforced=False)
        for disturbance in tuning.problem.disturbances:
            # Its drag is in the plant already.
            alone = Assessment(assessment.plant, assessment.controller, [disturbance])
            parts[disturbance.name] = alone.sigma(PAYLOAD)
    fixed = question.case.payload.fixed_drag
    drag = question.drag_before
    if assessment is not None:
        drag = assessment.coefficient if question.drag is not None else float(fixed or 0.0)
    return StructureDesign(
        case=question.case,
        structure=posed.structure.name,
        ok=tuning.ok,
        status=tuning.status,
        parameters=dict(tuning.parameters),
        units={p.name: p.unit for p in posed.law.parameters},
        payload_rms=tuning.cost,
        payload_rms_before=question.payload_rms_before,
        hook_rms=float(question.hook.displacement.rms),
        parts=parts,
        margins=tuning.margins,
        limits=limits,
        drag=drag,
        drag_before=question.drag_before,
        masses=question.masses,
        starts=len(tuning.starts),
        agreed=tuning.agreed,
        drive_kept=drive_kept,
    )


def verified(design: StructureDesign, progress: Progress | None) -> StructureDesign:
    """Return the design with its independent check; one that fails it is not ok."""
    if not design.parameters or design.margins is None:
        return design
    if progress is not None:
        progress("verify", 0, 1)
    checked = design.verify()
    if progress is not None:
        progress("verify", 1, 1)
    status = design.status if checked.ok else f"not verified: {checked.status}"
    return replace(design, ok=design.ok and checked.ok, status=status, verification=checked)
