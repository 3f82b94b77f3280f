"""The shortfall of a drive that is too small: its largest sea, and the limits that would do.

Two further programmes on the same loop.  The first makes the sea a variable and maximises it
within the limits: the limits that bind there are the ones that break first.  The second keeps
the sea asked for and looks for the least factor on just those limits.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray

from ..limits import Limit
from ..loop import Assessment, Coefficients
from ..question import FamilyProblem, Goal, Problem
from ..search import Progress, Solution, assess, briskest, polish, settle
from .tuning import Tuning

_BINDING = 5e-3  # a limit that is used up to this share of itself binds
_KEPT = 1e-4  # relative excess over a limit that a polished answer may have
_ALIKE = 1e-3  # of the logarithm that is looked for, within which two answers agree
_HOPELESS = 3  # points that lead nowhere, after which no other is tried


@dataclass(frozen=True, kw_only=True)
class Shortfall:
    """What a drive that is too small can do."""

    share: float  #: Largest feasible significant height over the one asked for.
    values: Sequence[float]  #: The searched parameters there.
    breaks_first: str  #: Name of the drive limit that binds there at the highest price.
    #: What each binding drive limit would have to be in the sea asked for.
    required: Mapping[str, float]


def shortfall(
    problem: FamilyProblem | Problem, free: Tuning, progress: Progress | None = None
) -> Shortfall | None:
    """Return the largest feasible sea and what is missing, or None if no sea is feasible.

    Of a family the seas of all members grow and shrink together.  The problem has all its limits;
    `free` is the answer without drive limits, to start from.  `progress` is called as
    progress(stage, done, total).
    """
    family = FamilyProblem.of(problem)
    if progress is not None:
        progress("largest sea", 0, 2)
    best = _largest_sea(family, free)
    if best is None:
        return None
    binding = _binding(family, best)
    if progress is not None:
        progress("largest sea", 1, 2)
    required = _required(family, free, best, binding)
    if progress is not None:
        progress("largest sea", 2, 2)
    return Shortfall(
        share=float(np.exp(best.extra)),
        values=[float(v) for v in best.values],
        breaks_first=binding[0],
        required=required,
    )


def _largest_sea(problem: FamilyProblem, free: Tuning) -> Solution | None:
    seas = (0.0, -1.5, -4.0)  # from the sea asked for down to a fiftieth of it
    # Drag goes with the motion, so with the sea; losses against it.
    known = [
        tuple(
            tuple(
                c * np.exp(sea if element.lasting else -sea)
                for c, element in zip(own, member.problem.elements, strict=True)
            )
            for own, member in zip(_coefficients(free), problem.scenarios, strict=True)
        )
        for sea in seas
    ]
    begins = _begins(free)
    found = _arrived(problem, begins, list(zip(known, seas, strict=True)), Goal.SEA)
    if not found:
        return None
    best = min(found, key=lambda s: s.objective)
    polished, _, excess = polish(problem, best, briskest(problem, begins), Goal.SEA)
    return polished if excess <= _KEPT else None


def larger_sea(
    problem: FamilyProblem, values: FloatArray, known: Sequence[Coefficients]
) -> tuple[float, FloatArray] | None:
    """Return the share of a sea that near parameters can do, and those; None if it is not found.

    The problem is that in its sea, where `values`, searched parameters, keep its limits; `known`
    are coefficients of each member's elements.
    """
    solved = settle(problem, values, known, Goal.SEA, reference=values, extra=0.0)
    if not solved.converged or not problem.stable(solved.values, solved.coefficients):
        return None
    polished, _, excess = polish(problem, solved, values, Goal.SEA)
    return (float(np.exp(polished.extra)), polished.values) if excess <= _KEPT else None


def _arrived(
    problem: FamilyProblem,
    begins: Sequence[FloatArray],
    tries: Sequence[tuple[Sequence[Coefficients], float]],
    goal: Goal,
    relaxed: Sequence[str] = (),
) -> list[Solution]:
    """Return from each point the answer of the first try that leads to a stable one.

    A try is coefficients and extra.  No further point is tried once the best two agree, nor after
    some that lead nowhere.
    """
    found: list[Solution] = []
    reference = briskest(problem, begins)
    for k, begin in enumerate(begins):
        best = sorted(solved.objective for solved in found)[:2]
        if (len(best) == 2 and best[1] - best[0] < _ALIKE) or (k == _HOPELESS and not found):
            break
        for coefficients, extra in tries:
            solved = settle(
                problem,
                begin,
                coefficients,
                goal,
                reference=reference,
                relaxed=relaxed,
                extra=extra,
            )
            if solved.converged and problem.stable(solved.values, solved.coefficients):
                found.append(solved)
                break
    return found


def _required(
    problem: FamilyProblem, free: Tuning, best: Solution, binding: Sequence[str]
) -> dict[str, float]:
    """Return the least bounds of the binding limits for which the sea asked for is feasible."""
    first, *others = _begins(free)
    begins = [first, best.values, *others]
    # From the limits as they are to twenty times those.
    tries = [(_coefficients(free), room) for room in (0.0, 1.0, 3.0)]
    # Where a limit bends that does not bind at the largest sea, all of the drive's may give way.
    every = [lim.name for lim in problem.scenarios[0].problem.limits if lim.drive]
    for given in (binding, every):
        if found := _arrived(problem, begins, tries, Goal.RELAX, given):
            binding = given
            break
    else:
        return {}
    least = min(found, key=lambda s: s.extra)
    reference = briskest(problem, begins)
    _, assessments, excess = polish(problem, least, reference, Goal.RELAX, binding)
    if excess > _KEPT:
        return {}
    # What each of them comes to there; one that the others spare is not asked for more.
    needed: dict[str, tuple[float, float]] = {}
    for lim, value in _measured(problem, assessments):
        if lim.name in binding and lim.use(value) > max(1.0, needed.get(lim.name, (0.0, 0.0))[0]):
            needed[lim.name] = lim.use(value), value
    return {name: value for name, (_, value) in needed.items()}


def _binding(problem: FamilyProblem, solved: Solution) -> list[str]:
    """Return the drive limits that are used up at the largest sea, the highest price first.

    Not by their multipliers alone: of two limits that say nearly the same (torque and current
    of a DC motor) only one has a price, and relaxing that one would change nothing.
    """
    uses: dict[str, float] = {}
    for lim, value in _measured(problem, assess(problem, solved, Goal.SEA)[0]):
        if lim.drive:
            uses[lim.name] = max(uses.get(lim.name, -np.inf), lim.use(value))
    names = [name for name, use in uses.items() if use > 1.0 - _BINDING]
    price = {name: sum(abs(own.get(name, 0.0)) for own in solved.prices) for name in uses}
    return sorted(names or [max(uses, key=lambda n: uses[n])], key=lambda n: -price[n])


def _measured(
    problem: FamilyProblem, assessments: Sequence[Assessment]
) -> Iterator[tuple[Limit, float]]:
    """Return every limit of every member with what is measured of it."""
    for scenario, assessment in zip(problem.scenarios, assessments, strict=True):
        for lim in scenario.problem.limits:
            yield lim, lim.worst(assessment)


def _coefficients(free: Tuning) -> tuple[tuple[float, ...], ...]:
    """Return the coefficients of every member's elements."""
    return tuple(one.coefficients for one in (free, *free.members))


def _begins(free: Tuning) -> list[FloatArray]:
    """Return the answer without drive limits and a few other stable ends of its search."""
    assert free.found.solved is not None
    others = [s.end for s in free.starts if s.converged and s.stable]
    others += [s.begin for s in free.starts]
    return [free.found.solved.values, *others[:5]]
