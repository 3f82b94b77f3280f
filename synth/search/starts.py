"""Starting points of a search: candidates screened for stability, found where screening fails.

    Problem -> guesses, candidates drawn, candidates stabilised -> merit -> starting points

Phase 0 draws a Sobol set over signs and orders of magnitude of the parameters and keeps the
stable candidates, ranked by cost and broken limits and spread out.  Phase I, where too few
are stable, moves the least unstable ones left by minimising their spectral abscissa.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from models.basics import FloatArray

from ..question import Goal, Problem
from ..structures import pace
from .nodes import cost_nodes, margin_nodes
from .programme import Programme

_SPREAD = 0.5  # least distance of two starts, in decades over all parameters
_LEASH = 1e-3  # price of moving a parameter by a factor of e, squared
_PHASE_ONE_STEPS = 60  # Nelder-Mead iterations per parameter and start
_WEIGHTS = (5.0, 1.0)  # of broken limits against the log cost
_WORST = 20.0  # what one broken limit may add to the merit of a candidate


def candidates(problem: Problem, count: int, seed: int) -> FloatArray:
    """Return candidate parameter vectors, stable or not: the law's guesses and `count` drawn."""
    law = problem.law
    sampler = qmc.Sobol(law.dimensions, seed=seed)
    points = sampler.random_base2(int(np.ceil(np.log2(count))))[:count]
    omega = crossover_grid(problem)
    # A hair off the imaginary axis, where an undamped pole cannot be hit.
    yu = problem.plant.response_at((1e-3 + 1j) * omega).yu
    return np.vstack([law.guesses(problem, omega), law.draw(points, omega, yu)])


def crossover_grid(problem: Problem) -> FloatArray:
    """Return frequencies [rad/s] at which a loop around this plant may cross over."""
    sizes = np.abs(problem.plant.poles())
    largest = float(sizes.max(initial=1.0))
    moving = sizes[sizes > 1e-6 * max(1.0, largest)]
    low = float(moving.min(initial=largest))
    late = max(problem.plant.delays, default=0.0)
    high = 10.0 * largest if late == 0.0 else min(10.0 * largest, max(10.0 * low, 3.0 / late))
    return np.geomspace(0.3 * low, max(high, 3.0 * low), 64)


def pick_spread(points: FloatArray, merit: FloatArray, scales: FloatArray, count: int) -> list[int]:
    """Return the indices of at most `count` points, best merit first, none too close together.

    Distance is measured on a signed logarithm of each parameter, so that a change of sign
    counts, and a doubling counts alike at every size.
    """
    places = np.arcsinh(points / (1e-2 * scales)) / np.log(10.0)
    chosen: list[int] = []
    order = [int(i) for i in np.argsort(merit) if np.isfinite(merit[i])]
    for i in order:
        if len(chosen) == count:
            return chosen
        if all(np.linalg.norm(places[i] - places[j]) > _SPREAD for j in chosen):
            chosen.append(i)
    for i in order:  # fewer distinct ones than asked for: fill up with the next best
        if len(chosen) == count:
            break
        if i not in chosen:
            chosen.append(i)
    return chosen


def stabilise(
    problem: Problem, points: FloatArray, abscissas: FloatArray, count: int
) -> list[FloatArray]:
    """Return up to `count` stable parameter vectors found from the least unstable points."""
    scales = np.array([p.scale for p in problem.law.parameters])
    low = np.array([p.low for p in problem.law.parameters]) / scales
    high = np.array([p.high for p in problem.law.parameters]) / scales
    found: list[FloatArray] = []
    middle = pace(problem.plant)
    for i in pick_spread(points, abscissas, scales, 2 * count):
        begin = np.arcsinh(points[i] / scales)

        def values_at(y: FloatArray) -> Any:
            # The inner clip: the simplex may wander where sinh overflows.
            return np.clip(np.sinh(np.clip(y, -30.0, 30.0)), low, high) * scales

        def abscissa(y: FloatArray, begin: FloatArray = begin) -> float:
            # In the plant's own time: relative to the fastest pole it is 1, and flat, for a
            # pole that just grows.  The rest keeps the simplex from wandering off.
            largest = problem.growth(values_at(y))
            return largest / middle + _LEASH * float(np.sum((y - begin) ** 2))

        answer = minimize(
            abscissa,
            begin,
            method="Nelder-Mead",
            options={"maxiter": _PHASE_ONE_STEPS * scales.size, "xatol": 1e-6, "fatol": 1e-9},
        )
        values = values_at(answer.x)
        if problem.stable(values):
            found.append(values)
        if len(found) == count:
            break
    return found


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
        # Phase I moves the least unstable ones; those that are stable need no moving.
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
    assessments = [problem.assess(begin, start_coefficient(problem)) for begin in begins]
    return Programme(
        problem,
        cost_nodes(problem, assessments, rtol=1e-4),
        margin_nodes(problem, [v.poles for v in assessments[:4]], 40),
        goal,
        reference=reference,
        tolerance=1e-6,
        **options,
    )
