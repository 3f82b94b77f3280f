"""The end of a sizing: the gains of the chosen winch, verified, or why there is none."""

from __future__ import annotations

from models.case import Case

from ..design import StructureDesign, tuning_of
from ..design.structure_design import _SOURCES
from ..design.structure_search import _design, _verified
from ..loop import Assessment
from ..question import HOOK, PAYLOAD, pose_structure
from ..search import Found, Progress
from .follow import Answer, Posed, follow
from .sizing_result import Sizing


def designed(
    case: Case, structure: str, near: Answer, masses: int, tell: Progress
) -> StructureDesign | None:
    """Return the best gains of a case close to a known answer, verified; None if none keep it."""
    posed = Posed.of(case, structure, masses)
    enforced = case.limits.drive == "enforce"
    problem = posed.problem((*posed.loop, *(posed.drive if enforced else ())))
    begins = [near.carried(problem), near.solved.values]
    answer = follow(problem, begins, near=near, fine=True)
    if answer is None:
        return None
    found = Found(solved=answer.solved, view=answer.view, excess=answer.excess)
    tuning = tuning_of(problem, found)
    return _verified(
        _design(pose_structure(case, structure, masses), tuning, drive_kept=True), tell
    )


def why_not(sizing: Sizing, free: Answer) -> str:
    """Return why no motor meets the target.

    Parameters
    ----------
    sizing
        One without a motor.
    free
        The optimum without a motor's limits.
    """
    if sizing.unlimited_rms > sizing.target:
        binding = [n for n, use in free.uses().items() if use > 1.0 - 5e-3]
        binding.sort(key=lambda n: -abs(free.solved.prices[n]))
        view = free.view
        for d in free.problem.disturbances:
            share = Assessment(view.plant, view.controller, [d]).sigma(PAYLOAD) / free.payload_rms
            if d.name != HOOK and share**2 > 0.5:
                binding.insert(0, _SOURCES.get(d.name, d.name))
        stops = " and ".join(binding) or "the structure itself"
        return (
            f"no motor holds the payload to {_mm(sizing.target)} rms: without any limit of the "
            f"motor it moves {_mm(sizing.unlimited_rms)}; {stops} stops it"
        )
    names: dict[str, None] = {}
    for point in sizing.points:
        names |= dict.fromkeys(point.binding[:1])
    return (
        f"no motor of this kind holds the payload to {_mm(sizing.target)} rms behind any of these "
        f"gears: {', '.join(names) or 'stability'} stops it"
    )


def _mm(value: float) -> str:
    return f"{1e3 * value:.4g} mm"
