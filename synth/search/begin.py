"""Where a search of a problem begins: stable points, ranked on a coarse programme.

    Problem -> guesses, screened candidates, stabilised candidates -> merit -> starting points

`synth.search.starts` draws and stabilises them; here they are looked at as the search will see
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from models.basics import FloatArray

from ..loop import Assessment
from ..question import Goal, Problem
from .nodes import cost_nodes, margin_nodes
from .programme import Programme
from .starts import candidates, pick_spread, stabilise

_WEIGHTS = (5.0, 1.0)  # of broken limits against the log cost
_WORST = 20.0  # what one broken limit may add to the merit of a candidate


def briskest(problem: Problem, points: Sequence[FloatArray]) -> FloatArray:
    """Return the point whose loop settles fastest, to tell the sides of the stability boundary."""
    return min(points, key=problem.abscissa)


def start_coefficient(problem: Problem) -> float | None:
    """Return the drag coefficient that a search begins with [N s/m]."""
    return None if problem.drag is None else problem.drag.reference


def begin_points(
    problem: Problem, starts: int, seed: int, guesses: Sequence[Sequence[float]]
) -> list[FloatArray]:
    """Return stable starting points: guesses, screened candidates, stabilised candidates.

    Guesses that are stable come first, whatever their merit.
    """
    order = len(problem.rational.states)
    points = candidates(problem, 1024 if order <= 12 else 512, seed)
    given = [np.array(guess, dtype=np.float64) for guess in guesses]
    first = [guess for guess in given if problem.abscissa(guess) < -1e-9][:starts]
    if len(given) > len(first):  # phase I may mend them
        points = np.vstack([*given, points])
    abscissas = np.array([problem.abscissa(p) for p in points])
    stable = np.flatnonzero(abscissas < -1e-9)
    scales = np.array([p.scale for p in problem.law.parameters])
    if stable.size < starts:
        found = stabilise(problem, points, np.where(abscissas < 0, np.inf, abscissas), starts)
        points = np.vstack([points[stable], *[f[None] for f in found]])
    else:
        points = points[stable]
    if not len(points):
        return first
    wanted = starts - len(first)
    orders = [pick_spread(points, merit, scales, wanted) for merit in _merits(problem, points)]
    # In turns: the quickest to keep the limits, and the most still with limits to mend.
    turns = dict.fromkeys(i for pair in zip(*orders, strict=True) for i in pair)
    return [*first, *(points[i] for i in list(turns)[:wanted])]


def _merits(problem: Problem, points: FloatArray) -> list[FloatArray]:
    """Return log cost plus a penalty on broken limits, on nodes that suit the plant alone.

    Two of them, (k,) each: with the rows as they are, and with rows that weigh more.
    """
    sample = points[:: max(1, len(points) // 4)][:4]
    programme = coarse_programme(problem, list(sample), briskest(problem, list(sample)))
    merits = []
    for point in points:
        x = programme.pack(point, start_coefficient(problem))
        cost, broken = programme.violations(x)
        # Rows are logarithms as the cost is: a margin broken tenfold outweighs a tenfold gain.
        penalty = sum(min(_WORST, max(0.0, row)) for row in broken.values())
        merits.append([cost + weight * penalty for weight in _WEIGHTS])
    found = np.nan_to_num(np.array(merits, dtype=np.float64), nan=np.inf)
    return [np.asarray(column) for column in found.T]


def coarse_programme(
    problem: Problem,
    begins: Sequence[FloatArray],
    reference: FloatArray,
    goal: Goal = Goal.COST,
    **options: Any,
) -> Programme:
    """Return a programme on nodes that suit all the starts."""
    views = [
        Assessment(
            problem.plant,
            problem.law.controller([float(v) for v in begin]),
            problem.disturbances,
            drag=problem.drag,
            coefficient=start_coefficient(problem),
        )
        for begin in begins
    ]
    return Programme(
        problem,
        cost_nodes(problem, views, rtol=1e-4),
        margin_nodes(problem, [v.poles for v in views[:4]], 40),
        goal,
        reference=reference,
        tolerance=1e-6,
        **options,
    )
