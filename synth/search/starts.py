"""Starting points of a search: candidates screened for stability, found where screening fails.

    Family -> guesses, candidates drawn, candidates stabilised -> merit -> starting points

Phase 0 draws a Sobol set over signs and orders of magnitude of the parameters and keeps the
stable candidates, ranked by cost and broken limits, all of them at once, and spread out.  Phase I,
where too few are stable, moves the least unstable ones left by minimising their spectral abscissa.
"""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from models.basics import FloatArray

from ..loop import LoopBlocks, LoopResponses, Shaking
from ..question import (
    FamilyProblem,
    LoopNumbers,
    Point,
    Problem,
    Values,
    moment_weights,
    on_sides,
)
from ..structures import pace
from .nodes import around, cost_nodes, margin_nodes

_CANDIDATES = 512
_TRIED = 128  # candidates that say which member of a family is the hardest
_ENOUGH = 8  # stable ones: no more are made of unstable ones
_SCATTERED = 128  # candidates about an answer (a power of two)
_SCATTERS, _FEW = 8, 4  # how often as many are drawn at most, where fewer are stable
_FROM_ZERO = 0.1  # of its scale: about which a parameter is scattered that is smaller
_SPREAD = 0.5  # least distance of two starts, in decades over all parameters
_LEASH = 1e-3  # price of moving a parameter by a factor of e, squared
_PHASE_ONE_STEPS = 60  # Nelder-Mead iterations per parameter and start
_STABLE = -1e-9  # relative abscissa below which a candidate counts
_WEIGHTS = (5.0, 1.0)  # of broken limits against the log cost
_WORST = 20.0  # what one broken limit may add to the merit of a candidate
_AT_ONCE = 64  # candidates whose merits are computed together
_DRAGS = 4  # rounds in which a candidate's coefficients are made to agree with its motion
_PER_DECADE = 20  # margin nodes of the screening
_SAMPLE = 4  # loops whose poles the screening's nodes know


def begin_points(
    asked: FamilyProblem | Problem, count: int, seed: int, guesses: Sequence[Values] = ()
) -> list[FloatArray]:
    """Return stable starting points: guesses, screened candidates, stabilised candidates.

    Guesses that are stable come first, whatever their merit.
    """
    family = FamilyProblem.of(asked)
    loops = [family.scenarios[group[0]] for group in family.groups]
    given = [np.array(guess, dtype=np.float64) for guess in guesses]
    first = [guess for guess in given if family.abscissa(guess, enough=0.0) < _STABLE][:count]
    # Guesses that are not may be mended by phase I.
    points = [np.vstack(given)] if len(given) > len(first) else []
    beside = 0  # candidates of another kind, which come last
    if all(loop.blend is None for loop in loops):
        chosen = loops[:: max(1, len(loops) // 4)]
        drawn = [candidates(loop.problem, _CANDIDATES // len(chosen), seed) for loop in chosen]
        others = [others_of(loop.problem, seed) for loop in chosen]
        points += [*drawn, *others]
        beside = sum(len(part) for part in others)
    if not points:
        return first
    every = np.vstack(points)
    abscissas = np.array([family.abscissa(point, enough=0.0) for point in every])
    settled = abscissas < _STABLE
    stable, beside = every[settled], int(np.count_nonzero(settled[len(every) - beside :]))
    wanted = count - len(first)
    if len(stable) < min(wanted, _ENOUGH):
        # Phase I moves the least unstable ones; those that are stable need no moving.
        rest = np.where(abscissas < 0.0, np.inf, abscissas)
        found = stabilise(family, every, rest, min(wanted, _ENOUGH))
        stable = np.vstack([*[f[None] for f in found], stable])
    kinds = np.split(np.arange(len(stable)), [len(stable) - beside])
    return [*first, *_picked(family, stable, kinds, wanted)]


def hardest(family: FamilyProblem, seed: int) -> int:
    """Return the member that drawn points do worst with: unstable, with limits broken, or dear.

    Of members as hard it is the last, as those of the least damping come last.
    """
    first = family.scenarios[0].problem
    points = _drawn(first, _TRIED, seed, crossover_grid(first))
    burdens = []
    for scenario in family.scenarios:
        alone = FamilyProblem(scenarios=(scenario,))
        stable = np.array([point for point in points if alone.stable(point)])
        merits = _merits(alone, stable)[0] if len(stable) else np.zeros(0)
        unstable = len(points) - len(stable)
        burdens.append(np.minimum(merits, _WORST).sum() + 2.0 * _WORST * unstable)
    return len(burdens) - 1 - int(np.argmax(burdens[::-1]))


def scattered(
    family: FamilyProblem, values: FloatArray, far: float, count: int, seed: int
) -> list[FloatArray]:
    """Return starting points far about an answer: screened candidates with its signs.

    Up to `far` decades either way in every parameter at once, for the answers that lie where a
    parameter has gone to its end or is of another order: few descents from elsewhere lead there.
    """
    sampler = qmc.Sobol(values.size, seed=seed)
    middle = np.copysign(np.maximum(np.abs(values), _FROM_ZERO * family.scales), values)
    low, high = np.array([(p.low, p.high) for p in family.parameters]).T
    stable: list[FloatArray] = []
    for _ in range(_SCATTERS):
        drawn = sampler.random(_SCATTERED)
        points = np.clip(middle * 10.0 ** (far * (2.0 * drawn - 1.0)), low, high)
        stable += [point for point in points if family.stable(point)]
        if len(stable) >= _FEW:
            break
    return _picked(family, np.array(stable), [np.arange(len(stable))], count)


def _picked(
    family: FamilyProblem, stable: FloatArray, kinds: Sequence[Any], count: int
) -> list[FloatArray]:
    """Return the most promising of stable points, spread out, the kinds of them in turns."""
    if not len(stable):
        return []
    orders = [
        [at[i] for i in pick_spread(stable[at], merit[at], family.scales, count)]
        for merit in _merits(family, stable)
        for at in kinds
    ]
    # In turns: the quickest to keep the limits, and the most still with limits to mend.
    turns = dict.fromkeys(int(i) for turn in zip_longest(*orders) for i in turn if i is not None)
    return [stable[i] for i in list(turns)[:count]]


def candidates(problem: Problem, count: int, seed: int) -> FloatArray:
    """Return candidate parameter vectors, stable or not: the law's guesses and `count` drawn."""
    omega = crossover_grid(problem)
    drawn = _drawn(problem, count, seed, omega)
    return np.vstack([problem.law.guesses(problem, omega), drawn])


def _drawn(problem: Problem, count: int, seed: int, omega: FloatArray) -> FloatArray:
    """Return parameter vectors drawn for crossovers at some frequencies, stable or not."""
    sampler = qmc.Sobol(problem.law.dimensions, seed=seed)
    points = sampler.random_base2(int(np.ceil(np.log2(count))))[:count]
    # A hair off the imaginary axis, where an undamped pole cannot be hit.
    yu = problem.plant.response_at((1e-3 + 1j) * omega).yu
    return np.asarray(problem.law.draw(points, omega, yu), dtype=np.float64)


def others_of(problem: Problem, seed: int) -> FloatArray:
    """Return the law's candidates of another kind, stable or not."""
    return problem.law.others(problem, crossover_grid(problem), seed)


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
    family: FamilyProblem, points: FloatArray, abscissas: FloatArray, count: int
) -> list[FloatArray]:
    """Return up to `count` stable parameter vectors found from the least unstable points."""
    scales = family.scales
    low = np.array([p.low for p in family.parameters]) / scales
    high = np.array([p.high for p in family.parameters]) / scales
    found: list[FloatArray] = []
    middle = pace(family.scenarios[0].problem.plant)
    for i in pick_spread(points, abscissas, scales, 2 * count):
        begin = np.arcsinh(points[i] / scales)

        def values_at(y: FloatArray) -> Any:
            # The inner clip: the simplex may wander where sinh overflows.
            return np.clip(np.sinh(np.clip(y, -30.0, 30.0)), low, high) * scales

        def abscissa(y: FloatArray, begin: FloatArray = begin) -> float:
            # In the plant's own time: relative to the fastest pole it is 1, and flat, for a
            # pole that just grows.  The rest keeps the simplex from wandering off.
            largest = family.growth(values_at(y))
            return largest / middle + _LEASH * float(np.sum((y - begin) ** 2))

        answer = minimize(
            abscissa,
            begin,
            method="Nelder-Mead",
            options={"maxiter": _PHASE_ONE_STEPS * scales.size, "xatol": 1e-6, "fatol": 1e-9},
        )
        values = values_at(answer.x)
        if family.stable(values):
            found.append(values)
        if len(found) == count:
            break
    return found


def briskest(asked: FamilyProblem | Problem, points: Sequence[FloatArray]) -> FloatArray:
    """Return the point whose loops settle fastest, to tell the sides of the stability boundary."""
    return min(points, key=FamilyProblem.of(asked).abscissa)


def start_coefficients(asked: FamilyProblem | Problem) -> tuple[tuple[float, ...], ...]:
    """Return the coefficients of each member's elements that a search begins with."""
    return tuple(scenario.problem.begin for scenario in FamilyProblem.of(asked).scenarios)


def _merits(family: FamilyProblem, points: FloatArray) -> list[FloatArray]:
    """Return log cost plus a penalty on broken limits of stable points.

    Two of them, (k,) each: with the rows as they are, and with rows that weigh more.
    """
    chosen = range(0, len(points), max(1, len(points) // _SAMPLE))
    sample = [points[i] for i in chosen][:_SAMPLE]
    costs = np.full((len(family.scenarios), len(points)), np.nan)
    penalty = np.zeros(len(points))
    for group in family.groups:
        first = family.scenarios[group[0]]
        problem = first.problem
        poles = around([problem.loop_poles(first.values(p)) for p in sample])
        nodes = cost_nodes(problem, poles, "rough")
        omega, still = on_sides(problem, margin_nodes(problem, poles, _PER_DECADE))
        parts = problem.blocks(1j * nodes.omega), problem.margin_blocks(1j * omega)
        every = np.concatenate([part.s for part in parts])
        still = np.append(np.zeros(nodes.omega.size, np.bool_), still)
        weights = [moment_weights(family.scenarios[i].problem, nodes) for i in group]
        for begin in range(0, len(points), _AT_ONCE):
            some = slice(begin, begin + _AT_ONCE)
            own = [
                column[:, None] for column in np.array([first.values(p) for p in points[some]]).T
            ]
            known = _consistent(problem, own, parts[0], weights[0])
            point = Point(values=own, coefficients=known)
            closing = point.closing(problem, every, still)
            cuts = slice(0, nodes.omega.size), slice(nodes.omega.size, None)
            cost, margins = (
                LoopResponses(part, closing.part(cut))
                for part, cut in zip(parts, cuts, strict=True)
            )
            numbers = LoopNumbers(problem, cost, margins, weights[0], omega, point)
            for k, i in enumerate(group):
                member = family.scenarios[i].problem
                seen = numbers if i == group[0] else numbers.under(member, weights[k])
                costs[i, some] = seen.cost()[..., 0]
                for limit in member.limits:
                    if limit.drive or i == group[0]:
                        row = np.max(limit.worst_rows(seen, limit.bound), axis=-1, initial=-np.inf)
                        # Rows are logarithms as the cost is: a margin broken tenfold outweighs a
                        # tenfold gain.
                        penalty[some] += np.clip(np.nan_to_num(row, nan=_WORST), 0.0, _WORST)
    with np.errstate(all="ignore"):
        total = np.log([family.total(np.exp(column)) for column in costs.T])
    found = [np.nan_to_num(total + weight * penalty, nan=np.inf) for weight in _WEIGHTS]
    return [np.asarray(column, dtype=np.float64) for column in found]


def _consistent(
    problem: Problem, values: Sequence[FloatArray], blocks: LoopBlocks, shaking: Shaking
) -> list[FloatArray]:
    """Return the coefficients that agree with the motion of many candidates, (b, 1) each."""
    known = [np.full((len(values[0]), 1), begin) for begin in problem.begin]
    names = [element.velocity for element in problem.elements]
    for _ in range(_DRAGS if names else 0):
        closing = Point(values=values, coefficients=known).closing(problem, blocks.s)
        every = LoopResponses(blocks, closing).integrals(names, (), shaking, [0])
        variances = dict(zip(names, every[:, 0, ..., :1], strict=True))
        known = problem.coefficients_in(variances.__getitem__)
    return known
