"""Contour with the gains found anew for every sea: what fixed gains give away.

    sea -> best gains without the drive's limits -> largest sea that any gains can do -> its limit

The largest sea is the programme of `synth.design.infeasible`, with the payload's criteria among the
limits; the gains that it ends with are then looked at like those of any design.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from models.basics import SolverError, one_thread
from models.case import Case

from ..design import Design, shortfall, tuning_of
from ..limits import Limit
from ..question import pose
from ..search import search
from .columns import SeaColumn
from .contour import Contour
from .limiting import HIGHEST, SeaStates, limiting_heights
from .pose import OperabilityQuestion

_STARTS = 3  # of each search, besides the design's own gains


@one_thread()
def reoptimised_contour(
    design: Design,
    question: OperabilityQuestion,
    columns: Sequence[SeaColumn],
    *,
    highest: float = HIGHEST,
    seed: int = 0,
    step: Callable[[], None] = lambda: None,
) -> Contour:
    """Return the contour of gains that are optimised for each sea.

    Parameters
    ----------
    design
        Where the searches start from, and the rope masses.
    question
        What is asked of the design: its loop and criteria.
    columns
        The seas.
    highest
        Highest H_s that is looked at [m].
    seed
        Of the searches.
    step
        Called after each sea.
    """
    assert question.loop is not None
    criteria = question.criteria["loop"]
    drive = tuple(c.limit for c in criteria if c.limit is not None)
    shape = (len(criteria), len(columns[0].hooks), len(columns))
    heights, drag = np.zeros(shape), np.full(shape[1:], np.nan)
    for p, column in enumerate(columns):
        for h, case in enumerate(column.cases):
            gains = _best(case, design, drive, seed)
            step()
            if gains is None:
                continue
            one = replace(column, headings=None, cases=(case,), hooks=(column.hooks[h],))
            loop = replace(
                question.loop,
                controller=pose(case, design.structure, design.masses).controller(gains),
            )
            found = limiting_heights(SeaStates.of(loop, one), criteria, highest=highest)
            heights[:, h, p], drag[h, p] = found.heights[:, 0], found.drag[0]
    return Contour(
        criteria=criteria,
        periods=np.array([column.period for column in columns]),
        headings=None if columns[0].headings is None else np.array(columns[0].headings),
        heights=heights,
        drag=drag,
        highest=highest,
    )


def _best(
    case: Case, design: Design, drive: tuple[Limit, ...], seed: int
) -> dict[str, float] | None:
    """Return the parameters of the largest sea that any can do, or None."""
    question = pose(case, design.structure, design.masses)
    problem = question.problem_with(question.loop)
    own = question.values(design.parameters)
    free = tuning_of(problem, search(problem, _STARTS, seed, [own], None))
    if not free.ok:
        return None
    limited = replace(question, drive=drive, reported=())
    try:
        found = shortfall(limited, free)
    except SolverError:
        found = None
    return None if found is None else question.named(list(found.values.values()))
