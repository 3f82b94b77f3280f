"""Continuation along a row of problems, each descent at its neighbour's answer: `best_of_each`.

    searches at the ends and in the middle -> descent at the next problem, both ways ...
                                           -> best answer to each

Bounds of a Pareto front and lengths of a rope make such rows.  Walks begin at the answers of
multi-start searches, go both ways and end where another walk has been with a better answer: a row
may change basins.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from models.basics import FloatArray

from ..question import Problem
from ..search import Found, Progress, search
from .follow import Answer, follow

STARTS = 6  # of the searches at the ends and in the middle
_ENDS = 2  # distinct answers of each that a walk begins from
_OTHER = 1e-3  # difference of log costs that tells two ends apart
_SAME = 1e-6  # log costs that differ by less are the same answer


def best_of_each(
    problems: Sequence[Problem],
    guesses: Sequence[Sequence[float]],
    *,
    harder: bool,
    seed: int,
    known: Mapping[int, Found],
    tell: Progress,
) -> list[Answer | None] | None:
    """Return the best answer to each problem of a row, None where there is none.

    None alone where the searches at the ends and in the middle find nothing.  Searches begin with
    the guesses too; those that were made already are known by the index of their problem.  The
    problems get harder from the first to the last, or easier.
    """
    begins: list[tuple[int, Answer | FloatArray]] = []
    for n, k in enumerate((0, len(problems) // 2, len(problems) - 1)):
        tell("searches at the ends", n, 3)
        found = known.get(k) or search(problems[k], STARTS, seed, guesses)
        begins += [(k, begin) for begin in _begins(problems[k], found)]
    return _walked(problems, begins, harder, tell) if begins else None


def _begins(problem: Problem, found: Found) -> list[Answer | FloatArray]:
    """Return the best answer of a search, and its best distinct ends."""
    chosen: list[tuple[FloatArray, float]] = []
    for start in sorted((s for s in found.starts if s.converged), key=lambda s: s.cost):
        if all(abs(np.log(start.cost / cost)) > _OTHER for _, cost in chosen):
            chosen.append((start.end, start.cost))
    answer = Answer.of(problem, found)
    ends = [values for values, _ in chosen[:_ENDS]]
    return [*ends] if answer is None else [answer, *ends]


def _walked(
    problems: Sequence[Problem],
    begins: Sequence[tuple[int, Answer | FloatArray]],
    harder: bool,
    tell: Progress,
) -> list[Answer | None]:
    """Return the best answers along walks from the index of a problem and what is close to it."""
    every = range(len(problems))
    best: list[Answer | None] = [None for _ in every]
    for k, (at, begin) in enumerate(begins):
        tell("walking from one to the next", k, len(begins))
        own = _along(problems, best, every[at:], begin)
        _along(problems, best, every[:at][::-1], own or begin)
    # Once more where a point is missing or worse than its harder neighbour: what serves a tight
    # bound serves a looser one.
    easing = every[::-1] if harder else every
    for order in (easing, easing[::-1]):
        for k, (i, j) in enumerate(itertools.pairwise(order), 1):
            one, other = best[i], best[j]
            if one is not None and (other is None or (order is easing and _better(one, other))):
                _along(problems, best, order[k:], one)
    return best


def _along(
    problems: Sequence[Problem],
    best: list[Answer | None],
    order: Sequence[int],
    begin: Answer | FloatArray,
) -> Answer | None:
    """Go on from problem to problem until another walk has been there with a better answer.

    Returns the first answer.
    """
    first: Answer | None = None
    for i in order:
        answer, known = follow(problems[i], [begin]), best[i]
        if answer is None:
            break
        if known is None or _better(answer, known):
            best[i] = answer
        elif i != order[0] or _better(known, answer):
            # Where another walk has done as well this one would only follow it, but for its own
            # beginning, which it may share.
            break
        first, begin = first or answer, answer
    return first


def _better(one: Answer, other: Answer) -> bool:
    return one.solved.objective < other.solved.objective - _SAME
