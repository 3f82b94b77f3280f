"""Frequency nodes of a programme: quadrature for its variances, a grid for its margins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.basics import (
    ComplexArray,
    FloatArray,
    Quadrature,
    SolverError,
    adaptive_nodes,
    spectral_nodes,
)

from ..loop import Assessment, closed_loop, frequency_grid, integration_band, numeric_blocks
from ..question import Problem

_SLOW_SIDE = 8  # nodes per decade below everything that moves
_FAST_SIDE = 24  # ... and above it, where a loop may cross over narrowly with the wrong gains
_MOST_PANELS = 4000
_INSIDE = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)  # nodes about the edge of a limit's band


def cost_nodes(
    problem: Problem, assessments: Sequence[Assessment], rtol: float = 1e-8
) -> Quadrature:
    """Return nodes that integrate every output the problem speaks of, for all assessments."""
    wanted = {*problem.minimise, *(o for limit in problem.limits for o in limit.outputs)}
    if problem.drag is not None:
        wanted.add(problem.drag.velocity)
    outputs = sorted(wanted)
    pairs = [(output, d.name) for output in outputs for d in problem.disturbances]
    poles = np.concatenate([assessment.poles for assessment in assessments])
    low, high, half_line = integration_band(problem.disturbances, poles)

    def integrands(omega: FloatArray) -> FloatArray:
        # Drag makes every assessment's plant its own; without it they share the responses.
        shared = numeric_blocks(problem.plant.response(omega)) if problem.drag is None else None
        densities = {d.name: d.density(omega) for d in problem.disturbances}
        rows = []
        for assessment in assessments:
            blocks = shared or numeric_blocks(assessment.plant.response(omega))
            law = assessment.controller.response_at(1j * omega)
            entries = [[law[:, i, j] for j in range(law.shape[2])] for i in range(law.shape[1])]
            found = closed_loop(blocks, entries, pairs)
            for output in outputs:
                parts = [
                    np.abs(found[output, name]) ** 2 * density
                    for name, density in densities.items()
                ]
                rows.append(np.sum(parts, axis=0))
        return np.array(rows, dtype=np.float64)

    splits = [omega for d in problem.disturbances for omega in d.splits]
    try:
        return adaptive_nodes(
            integrands,
            low,
            high,
            splits=splits,
            rtol=rtol,
            half_line=half_line,
            max_panels=_MOST_PANELS,
        )
    except SolverError:
        # A loop at the edge of stability has a variance without digits; nodes that know its
        # poles are good enough for the solver to leave that edge.
        light = poles[np.abs(poles.real) > 1e-9 * np.abs(poles)]
        return spectral_nodes(low, high, splits=splits, poles=light, half_line=half_line)


def margin_nodes(problem: Problem, poles: Sequence[ComplexArray], per_decade: int) -> FloatArray:
    """Return the frequencies [rad/s] at which the margins are held.

    Dense where the plant or a loop moves, thin towards zero and infinity, with a cluster at
    each lightly damped pole; what falls between the nodes is the exchange's to find.
    """
    every = np.concatenate([problem.plant.poles(), *poles])
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
