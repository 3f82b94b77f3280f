"""The front against the telemetry's delay: a plant of its own at every point.

Unlike a bound, a delay changes the plant, so each point has its own programme.  It begins at
its neighbours' answers, from both ends and from the middle, and is polished as any answer is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from models.basics import FloatArray, SynthesisError
from models.case import Case

from ..question import Problem, pose
from ..search import KEPT, Solution, polish, search
from .pareto_point import ParetoPoint, point_of

Progress = Callable[[str, int, int], None]

_STARTS = 8
_SAME = 1e-6


def delay_points(
    case: Case, count: int, between: tuple[float, float], seed: int, progress: Progress | None
) -> list[tuple[float, ParetoPoint | None]]:
    """Return the best answer at each delay [s], None where there is none."""
    delays = np.linspace(*between, count)
    problems = [pose(case.replace({"sensors.telemetry.delay": float(d)})).problem for d in delays]
    guesses = [[case.gains.a, case.gains.a1, case.gains.a2]] if case.gains is not None else []
    tell = progress or (lambda stage, done, total: None)
    best: list[tuple[Solution, float] | None] = [None] * count
    begins: list[tuple[int, Solution, FloatArray]] = []
    for n, k in enumerate((0, count // 2, count - 1)):
        tell("ends of the front", n, 3)
        found = search(problems[k], _STARTS, seed, guesses)
        if found.solved is not None and found.excess <= KEPT and found.reference is not None:
            begins.append((k, found.solved, found.reference))
            _keep(best, k, found.solved, found.excess)
    if not begins:
        raise SynthesisError("pareto: no gains keep the limits at any delay in the range")
    for n, (k, solved, reference) in enumerate(begins):
        tell("walking along the front", n, len(begins))
        _along(problems, best, range(k + 1, count), solved, reference)
        _along(problems, best, range(k - 1, -1, -1), solved, reference)
    points: list[tuple[float, ParetoPoint | None]] = []
    for delay, problem, kept in zip(delays, problems, best, strict=True):
        point = None if kept is None else point_of(problem, "", float(delay), kept[0])
        points.append((float(delay), point))
    return points


def _along(
    problems: Sequence[Problem],
    best: list[tuple[Solution, float] | None],
    order: Sequence[int],
    solved: Solution,
    reference: FloatArray,
) -> None:
    """Go on from delay to delay until another walk has been there with a better answer."""
    for i in order:
        problem = problems[i]
        if not problem.stable(solved.values, solved.coefficient):
            return
        again, _, excess = polish(problem, solved, solved.values)
        if again is solved or excess > KEPT:
            return
        if not _keep(best, i, again, excess):
            return
        solved = again


def _keep(
    best: list[tuple[Solution, float] | None], index: int, solved: Solution, e: float
) -> bool:
    known = best[index]
    if known is not None and known[0].objective <= solved.objective + _SAME:
        return False
    best[index] = solved, e
    return True
