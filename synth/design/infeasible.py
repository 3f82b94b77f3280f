"""The shortfall of a drive that is too small: its largest sea, and the limits that would do.

Two further programmes on the same loop.  The first makes the sea a variable and maximises it
within the limits: the limits that bind there are the ones that break first.  The second keeps
the sea asked for and looks for the least factor on just those limits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray

from ..question import DesignQuestion, Goal, Problem
from ..search import Progress, Solution, assess, briskest, polish, settle
from .tuning import Tuning

_BINDING = 5e-3  # a limit that is used up to this share of itself binds
_KEPT = 1e-4  # relative excess over a limit that a polished answer may have


@dataclass(frozen=True, kw_only=True)
class Shortfall:
    """What a drive that is too small can do.

    Attributes
    ----------
    share
        Largest feasible significant height over the one asked for.
    values, coefficient
        Parameters there, and their drag coefficient [N s/m].
    breaks_first
        Name of the drive limit that binds there at the highest price.
    required
        What each binding drive limit would have to be in the sea asked for.
    """

    share: float
    values: Mapping[str, float]
    coefficient: float | None
    breaks_first: str
    required: Mapping[str, float]


def shortfall(
    question: DesignQuestion, free: Tuning, progress: Progress | None = None
) -> Shortfall | None:
    """Return the largest feasible sea and what is missing, or None if no sea is feasible.

    Parameters
    ----------
    question
        The case, with all its limits.
    free
        The answer without drive limits, to start from.
    progress
        Called as progress(stage, done, total).
    """
    problem = question.problem
    if progress is not None:
        progress("largest sea", 0, 2)
    best = _largest_sea(problem, free)
    if best is None:
        return None
    binding = _binding(problem, best)
    if progress is not None:
        progress("largest sea", 1, 2)
    required = _required(problem, free, best, binding)
    if progress is not None:
        progress("largest sea", 2, 2)
    return Shortfall(
        share=float(np.exp(best.extra)),
        values=problem.law.named([float(v) for v in best.values]),
        coefficient=best.coefficient,
        breaks_first=binding[0],
        required=required,
    )


def _largest_sea(problem: Problem, free: Tuning) -> Solution | None:
    seas = (0.0, -1.5, -4.0)  # from the sea asked for down to a fiftieth of it
    # Drag goes with the motion, so with the sea.
    drags = [None if free.coefficient is None else free.coefficient * np.exp(sea) for sea in seas]
    begins = _begins(free)
    found = _arrived(problem, begins, list(zip(drags, seas, strict=True)), Goal.SEA)
    if not found:
        return None
    best = min(found, key=lambda s: s.objective)
    polished, _, excess = polish(problem, best, briskest(problem, begins), Goal.SEA)
    return polished if excess <= _KEPT else None


def _arrived(
    problem: Problem,
    begins: Sequence[FloatArray],
    tries: Sequence[tuple[float | None, float]],
    goal: Goal,
    relaxed: Sequence[str] = (),
) -> list[Solution]:
    """Return from each point the answer of the first (drag, extra) that leads to a stable one."""
    found, reference = [], briskest(problem, begins)
    for begin in begins:
        for coefficient, extra in tries:
            solved = settle(
                problem,
                begin,
                (coefficient,),
                goal,
                reference=reference,
                relaxed=relaxed,
                extra=extra,
            )
            if solved.converged and problem.stable(solved.values, solved.coefficient):
                found.append(solved)
                break
    return found


def _required(
    problem: Problem, free: Tuning, best: Solution, binding: Sequence[str]
) -> dict[str, float]:
    """Return the least bounds of the binding limits for which the sea asked for is feasible."""
    begins = [*_begins(free), best.values]
    # From the limits as they are to twenty times those.
    tries = [(free.coefficient, room) for room in (0.0, 1.0, 3.0)]
    found = _arrived(problem, begins, tries, Goal.RELAX, binding)
    if not found:
        return {}
    least = min(found, key=lambda s: s.extra)
    reference = briskest(problem, begins)
    _, assessments, excess = polish(problem, least, reference, Goal.RELAX, binding)
    if excess > _KEPT:
        return {}
    # What each of them comes to there; one that the others spare is not asked for more.
    values = {
        lim.name: (lim, lim.measure(assessments[0]))
        for lim in problem.limits
        if lim.name in binding
    }
    return {name: value for name, (lim, value) in values.items() if lim.use(value) > 1.0}


def _binding(problem: Problem, solved: Solution) -> list[str]:
    """Return the drive limits that are used up at the largest sea, the dearest first.

    Not by their multipliers alone: of two limits that say nearly the same (torque and current
    of a DC motor) only one has a price, and relaxing that one would change nothing.
    """
    (assessment,), _ = assess(problem, solved, Goal.SEA)
    uses = {lim.name: lim.use(lim.measure(assessment)) for lim in problem.limits if lim.drive}
    names = [name for name, use in uses.items() if use > 1.0 - _BINDING]
    return sorted(
        names or [max(uses, key=lambda n: uses[n])], key=lambda n: -abs(solved.prices[0][n])
    )


def _begins(free: Tuning) -> list[FloatArray]:
    """Return the answer without drive limits and a few other stable ends of its search."""
    best = np.array(list(free.parameters.values()))
    others = [s.end for s in free.starts if s.converged and s.stable]
    others += [s.begin for s in free.starts]
    return [best, *others[:5]]
