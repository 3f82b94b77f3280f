"""Frequency nodes of a programme: quadrature for its variances, a grid for its margins."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from models.basics import ComplexArray, FloatArray, Quadrature, SolverError, spectral_nodes

from ..loop import (
    Assessment,
    Coefficients,
    consistent_coefficients,
    frequency_grid,
    integration_band,
)
from ..question import Problem, Values

_SLOW_SIDE = 8  # nodes per decade below everything that moves
_FAST_SIDE = 24  # ... and above it, where a loop may cross over narrowly with the wrong gains
_INSIDE = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)  # nodes about the edge of a limit's band
_GLANCED_PER_DECADE = 40  # margin frequencies; peaks and crossings between them are refined
_AT_ZERO = 1e-9  # relative size of a pole at zero, which no panel need shrink towards
_ON_AXIS = 1e-9  # relative distance of a pole from the axis below which no node can resolve it
_PANELS = {"rough": (4, 2.0, 0.1), "coarse": (7, 3.0, 1e-9), "fine": (10, 4.0, 1e-9)}
"""Nodes a panel, panels a decade, least ln of kinks' ratio: 1e-3, 1e-6 and 1e-8 of an rms."""


def cost_nodes(problem: Problem, poles: ComplexArray, how: str = "coarse") -> Quadrature:
    """Return nodes that integrate the spectra of loops with some poles [1/s].

    Panels shrink towards the poles of plant and loops and break where a spectrum has a kink, so
    that nothing needs to be evaluated to know them.
    """
    every = np.concatenate([poles, problem.plant.poles()])
    every = every[np.abs(every) > _AT_ZERO * np.abs(every).max(initial=1.0)]
    low, high, half_line = integration_band(problem.disturbances, every)
    per_panel, per_decade, apart = _PANELS[how]
    splits = np.unique([omega for d in problem.disturbances for omega in d.splits if omega > 0.0])
    splits = splits[np.unique(np.floor(np.log(splits) / apart), return_index=True)[1]]
    return spectral_nodes(
        low,
        high,
        splits=splits.tolist(),
        poles=every[np.abs(every.real) > _ON_AXIS * np.abs(every)],
        per_panel=per_panel,
        panels_per_decade=per_decade,
        half_line=half_line,
    )


def margin_nodes(problem: Problem, poles: ComplexArray, per_decade: int) -> FloatArray:
    """Return the frequencies [rad/s] at which the margins are held.

    Dense where the plant or a loop moves, thin towards zero and infinity, with a cluster at
    each lightly damped pole; what falls between the nodes is found by refinement.
    """
    every = np.concatenate([problem.plant.poles(), poles])
    grid = frequency_grid(every)
    swinging = np.abs(every[np.abs(every.imag) > 0.3 * np.abs(every)])
    # The quantile: a few very fast poles (delay models, high rope modes) would else stretch the
    # dense part over decades in which nothing crosses over.
    low = 0.2 * float(swinging.min(initial=float(grid[-1])))
    high = 3.0 * float(np.quantile(swinging, 0.8)) if swinging.size else float(grid[-1])
    low, high = max(low, float(grid[0])), min(max(high, 10.0 * low), float(grid[-1]))
    slow = np.geomspace(grid[0], low, max(2, int(_SLOW_SIDE * np.log10(low / grid[0]))))
    fast = np.geomspace(high, grid[-1], max(2, int(_FAST_SIDE * np.log10(grid[-1] / high))))
    dense = np.geomspace(low, high, max(2, int(per_decade * np.log10(high / low))))
    omega, damping = np.abs(every.imag), np.abs(every.real)
    light = (omega > 0.5 * low) & (omega < 2.0 * high) & (damping < 0.1 * omega)
    near = omega[light, None] + damping[light, None] * np.array([-2.0, -0.7, 0.0, 0.7, 2.0])
    edges = [share * e for limit in problem.limits for e in limit.edges for share in _INSIDE]
    nodes = np.unique(np.concatenate([slow, dense, fast, near[near > 0.0], edges]))
    return problem.plant.beside_poles(nodes)


def glanced(
    problem: Problem,
    values: Values,
    coefficients: Coefficients | None = None,
    start: Coefficients | None = None,
    how: str = "coarse",
) -> Assessment | None:
    """Return a loop on nodes that are made from its poles; None where no drag agrees with it.

    Where no coefficients of the elements are given they are solved for, from `start`.
    """
    controller = problem.law.controller([float(v) for v in values])
    loop = problem.plant, controller, problem.disturbances
    last: list[Quadrature] = []

    def nodes(poles: ComplexArray) -> Quadrature:
        last.append(cost_nodes(problem, poles, how))
        return last[-1]

    if problem.elements and coefficients is None:
        try:
            coefficients = consistent_coefficients(
                *loop, problem.elements, start=start, nodes=nodes
            )
        except SolverError:
            return None
    same = (lambda _: last[-1]) if last else nodes  # what coefficients were found on does
    grid = partial(margin_nodes, problem, per_decade=_GLANCED_PER_DECADE)
    return Assessment(
        *loop, elements=problem.elements, coefficients=coefficients, nodes=same, grid=grid
    )


def around(values: Sequence[ComplexArray]) -> ComplexArray:
    """Return the poles of several loops together."""
    return np.concatenate([np.zeros(0, np.complex128), *values])
