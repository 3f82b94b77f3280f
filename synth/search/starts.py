"""Where a search begins: candidates screened for stability, and found where screening fails.

Phase 0 draws a Sobol set over signs and orders of magnitude of the parameters and keeps the
stable candidates, ranked by cost and broken limits and spread out.  Phase I, where too few
are stable, moves the least unstable ones left by minimising their spectral abscissa.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from models.basics import FloatArray

from ..question import Problem
from ..structures import pace

Progress = Callable[[str, int, int], None]

_SPREAD = 0.5  # least distance of two starts, in decades over all parameters
_LEASH = 1e-3  # price of moving a parameter by a factor of e, squared
_PHASE_ONE_STEPS = 60  # Nelder-Mead iterations per parameter and start


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
