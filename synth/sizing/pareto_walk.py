"""Continuation along a Pareto front: from bound to bound, each descent at its neighbour's answer.

    answers of searches -> descent at the next bound, both ways ... -> best answer at each bound

Walks begin at the answers of multi-start searches, go both ways and end where another walk has
been with a better answer: a front may change basins.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from models.basics import FloatArray

from ..question import Problem
from ..search import Progress
from .follow import Answer, follow

_SAME = 1e-6  # log costs that differ by less are the same answer


def walked(
    problems: Sequence[Problem],
    begins: Sequence[tuple[int, Answer | FloatArray]],
    *,
    harder: bool,
    tell: Progress,
) -> list[Answer | None]:
    """Return the best answer to each problem of a front, None where there is none.

    Parameters
    ----------
    problems
        In the order of the front.
    begins
        Where walks begin: the index of a problem, and an answer or parameters close to it.
    harder
        Whether the problems get harder from the first to the last, or easier.
    tell
        Called as tell(stage, done, total).
    """
    every = range(len(problems))
    best: list[Answer | None] = [None for _ in every]
    for k, (at, begin) in enumerate(begins):
        tell("walking along the front", k, len(begins))
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
