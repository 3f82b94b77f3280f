"""Multi-start search: many starts on moderate nodes, the best answers polished on refined ones.

    Problem -> starts -> IPOPT from each -> distinct answers -> exchange of nodes -> Found

Between the first solve and the last the programme sees ever more of what it must not do:
after each solve the places where a limit is pressed hardest become nodes (the exchange
method of semi-infinite programming), until nothing is broken in between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from models.basics import FloatArray

from ..loop import Assessment
from ..question import Goal, Problem
from .family_programme import FamilySolved
from .nodes import cost_nodes, margin_nodes
from .polishing import KEPT, assess, polish, thinned
from .programme import Programme, Solution, SolverPace
from .starts import begin_points, briskest, coarse_programme, pick_spread, start_coefficient

Progress = Callable[[str, int, int], None]
Answer = TypeVar("Answer", Solution, FamilySolved)

AGREE = 1e-4  # answers whose costs differ by less, relatively, are one answer
_POLISHED = 6  # distinct answers that are polished at most
_RESERVE = 16  # further starts for a search of which none arrived
_SECOND_TRIES = 4  # of starts that gave up on the way to something better
_BASIN = 1.0  # how far, relatively, a parameter may move within its basin
_RESUMED = 6  # ends of an earlier search that a resumed one starts from


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """One start of the search: where it began, where it ended, and how.

    `cost` is on the moderate nodes of the first pass, where a margin may leak between nodes.
    """

    begin: FloatArray
    end: FloatArray
    cost: float
    converged: bool
    stable: bool
    message: str
    iterations: int

    @classmethod
    def of(cls, begin: FloatArray, solved: Solution | FamilySolved, *, stable: bool) -> Start:
        """Return the record of a solve; one that did not arrive costs without end."""
        return cls(
            begin=begin,
            end=solved.values,
            cost=float(np.exp(solved.objective)) if stable and solved.converged else np.inf,
            converged=solved.converged,
            stable=stable,
            message=solved.message,
            iterations=solved.iterations,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What a search found: the best answer, its assessment, and every start.

    `excess` is the largest relative excess over a limit; `solved` is None where nothing
    stable was found at all.  `reference` are parameters of a briskly stable loop.
    """

    solved: Solution | None
    assessment: Assessment | None
    excess: float
    starts: tuple[Start, ...] = ()
    agreed: int = 0
    reference: FloatArray | None = None


def search(
    problem: Problem,
    starts: int,
    seed: int,
    guesses: Sequence[Sequence[float]] = (),
    progress: Progress | None = None,
) -> Found:
    """Return the best answer of a multi-start search; see `synth.design.tuning.tune`."""
    # The reserve is picked together with the starts, so that it lies apart from them.
    begins = begin_points(problem, starts + _RESERVE, seed, guesses)
    if not begins:
        return Found(solved=None, assessment=None, excess=np.inf)
    reference = briskest(problem, begins)
    return _from(problem, begins, reference, start_coefficient(problem), progress, starts)


def resume(
    problem: Problem,
    values: Sequence[float],
    earlier: Found,
    progress: Progress | None = None,
) -> Found:
    """Return the answer to a problem close to one that was solved, from that one's ends."""
    ends = [np.array(values, dtype=np.float64)]
    ends += [s.end for s in sorted(earlier.starts, key=lambda s: s.cost) if s.converged]
    coefficient = earlier.solved.coefficient if earlier.solved is not None else None
    stable = [end for end in ends if problem.stable(end, coefficient)]
    if not stable:  # the problem is not that close after all
        return search(problem, max(1, len(earlier.starts)), 0, [], progress)
    scales = np.array([p.scale for p in problem.law.parameters])
    order = np.arange(len(stable), dtype=np.float64)
    chosen = pick_spread(np.array(stable), order, scales, _RESUMED)
    known = [] if earlier.reference is None else [earlier.reference]
    reference = briskest(problem, [*known, *stable])
    found = _from(problem, [stable[i] for i in chosen], reference, coefficient, progress)
    if earlier.solved is None or not problem.stable(earlier.solved.values, coefficient):
        return found
    # The earlier answer itself, without leaving its neighbourhood.
    solved, assessment, excess = polish(problem, earlier.solved, reference)
    if solved is earlier.solved or excess > KEPT:
        return found
    rival = found.solved
    if rival is not None and found.excess <= KEPT and rival.objective <= solved.objective:
        return found
    return replace(found, solved=solved, assessment=assessment, excess=excess)


def _from(
    problem: Problem,
    begins: Sequence[FloatArray],
    reference: FloatArray,
    coefficient: float | None,
    progress: Progress | None,
    wanted: int | None = None,
) -> Found:
    """Return the best answer from stable starts, of which `wanted` are used if any arrives."""
    tell = progress or (lambda stage, done, total: None)
    programme = coarse_programme(problem, begins[:wanted], reference)
    records: list[Start] = []
    solves: list[Solution] = []
    count = len(begins) if wanted is None else min(wanted, len(begins))
    for k, begin in enumerate(begins):
        if k >= count and any(np.isfinite(record.cost) for record in records):
            break  # the reserve is for a search of which no start has arrived yet
        tell("starts", min(k, count - 1), count)
        solved = programme.solve(programme.pack(begin, coefficient))
        stable = problem.stable(solved.values, solved.coefficient)
        records.append(Start.of(begin, solved, stable=stable))
        solves.append(solved)
    _once_more(programme, records, solves)
    first = [
        solved for solved, record in zip(solves, records, strict=True) if np.isfinite(record.cost)
    ]
    tell("starts", count, count)
    if not first:
        solved = least_violation(problem, begins, reference)
        assessment, excess = assess(problem, solved)
        return Found(
            solved=solved,
            assessment=assessment,
            excess=max(excess, 1.0),
            starts=tuple(records),
            reference=reference,
        )
    return _polished(problem, first, reference, tuple(records), tell)


def _once_more(programme: Programme, records: list[Start], solves: list[Solution]) -> None:
    """Go on from where starts gave up, if they were on the way to something better.

    The guard, or a restoration that failed, ends a solve at a stable point; from there another
    barrier may lead on.
    """
    best = min((np.log(r.cost) for r in records if np.isfinite(r.cost)), default=np.inf)
    ends: list[tuple[float, int]] = []
    for k, (record, solved) in enumerate(zip(records, solves, strict=True)):
        if record.stable and not record.converged:
            cost, broken = programme.violations(programme.pack(solved.values, solved.coefficient))
            # Rows are logarithms as the cost is, so that they add up to one merit.
            merit = cost + sum(max(0.0, row) for row in broken.values())
            if merit < best:
                ends.append((merit, k))
    for _, k in sorted(ends)[:_SECOND_TRIES]:
        x = programme.pack(solves[k].values, solves[k].coefficient)
        solved = programme.solve(x, pace=SolverPace.NEAR)
        if solved.converged and programme.problem.stable(solved.values, solved.coefficient):
            solves[k] = solved
            record = Start.of(records[k].begin, solved, stable=True)
            iterations = records[k].iterations + solved.iterations
            records[k] = replace(record, iterations=iterations)


def _polished(
    problem: Problem,
    first: Sequence[Solution],
    reference: FloatArray,
    records: tuple[Start, ...],
    tell: Progress,
) -> Found:
    """Return the best of the distinct answers after polishing."""
    pairs = _second_pass(problem, distinct(first, _POLISHED), reference)
    answers = distinct(list(pairs), _POLISHED)
    best: tuple[Solution, Assessment, float] | None = None
    origin = pairs[answers[0]]
    for k, solved in enumerate(answers):
        tell("polish", k, len(answers))
        if best is not None and best[2] <= KEPT and solved.objective > best[0].objective:
            break  # polishing only adds nodes, that is constraints: it cannot get better
        candidate = polish(problem, solved, reference)
        rank = (candidate[2] > KEPT, candidate[0].objective)
        if best is None or rank < (best[2] > KEPT, best[0].objective):
            best, origin = candidate, pairs[solved]
    tell("polish", len(answers), len(answers))
    assert best is not None
    agreed = sum(1 for s in first if abs(s.objective - origin.objective) <= AGREE)
    return Found(
        solved=best[0],
        assessment=best[1],
        excess=best[2],
        starts=records,
        agreed=agreed,
        reference=reference,
    )


def _second_pass(
    problem: Problem, first: Sequence[Solution], reference: FloatArray
) -> dict[Solution, Solution]:
    """Return the answers again with nodes where any of them leaked through a limit.

    Each stays in its basin if the limits can be kept there, else it may move freely.  Each
    answer comes with the one it began from.
    """
    assessments = [assess(problem, solved)[0] for solved in first]
    critical = [
        limit.critical(assessment) for assessment in assessments for limit in problem.limits
    ]
    programme = Programme(
        problem,
        cost_nodes(problem, assessments, rtol=1e-6),
        np.union1d(margin_nodes(problem, [v.poles for v in assessments], 40), thinned(critical)),
        reference=reference,
        tolerance=1e-7,
    )
    sound: dict[Solution, Solution] = {}  # from an answer to the one it began at
    for old in first:
        start = programme.pack(old.values, old.coefficient)
        for reach, pace in ((_BASIN, SolverPace.NEAR), (None, SolverPace.FAR)):
            new = programme.solve(start, reach, pace=pace)
            if new.converged and problem.stable(new.values, new.coefficient):
                sound[new] = old
                break
    return sound or {solved: solved for solved in first}


def least_violation(
    problem: Problem, begins: Sequence[FloatArray], reference: FloatArray
) -> Solution:
    """Return the stable answer that breaks the limits least, for limits that exclude each other."""
    programme = coarse_programme(problem, begins, reference, Goal.FEASIBLE)
    found = []
    for begin in begins[:3]:
        x = programme.pack(begin, start_coefficient(problem))
        # Begin within the rows: the slack takes up the largest violation.
        x[-1] = max([0.0, *programme.violations(x)[1].values()])
        solved = programme.solve(x)
        if problem.stable(solved.values, solved.coefficient):
            found.append(solved)
    if found:
        return min(found, key=lambda s: s.objective)
    return Solution(
        values=begins[0],
        coefficient=start_coefficient(problem),
        objective=np.inf,
        extra=0.0,
        converged=False,
        message="not solved",
        iterations=0,
        prices={limit.name: 0.0 for limit in problem.limits},
    )


def distinct(solved: Sequence[Answer], most: int) -> list[Answer]:
    """Return the best few answers whose costs differ."""
    chosen: list[Answer] = []
    for item in sorted(solved, key=lambda s: s.objective):
        if all(abs(item.objective - other.objective) > AGREE for other in chosen):
            chosen.append(item)
        if len(chosen) == most:
            break
    return chosen
