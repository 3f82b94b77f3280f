"""The loop in CasADi symbols: what cost and limits of a programme are made of."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import casadi as ca
import numpy as np

from models.basics import FloatArray, Quadrature

from ..loop import (
    Phasor,
    PlantBlocks,
    close_scalar,
    closed_loop,
    determinant,
    numeric_blocks,
    return_differences,
)
from .problem import Goal, Problem


class LoopSymbols:
    """Symbolic loop, moments and responses: the `synth.limits.Symbols` of a programme.

    Parameters
    ----------
    problem, nodes, omega, goal
        The problem, where its spectra are integrated and its margins held [rad/s], and what
        is looked for.
    shared
        (x, parameter values, log of the drag or None) of a programme of several loops, each
        with symbols of its own; by default the symbols make their own.
    """

    def __init__(
        self,
        problem: Problem,
        nodes: Quadrature,
        omega: FloatArray,
        goal: Goal,
        shared: tuple[Any, Sequence[Any], Any] | None = None,
    ) -> None:
        law, scales = problem.law, [p.scale for p in problem.law.parameters]
        count = len(scales)
        has_drag, has_extra = problem.drag is not None, goal is not Goal.COST
        if shared is None:
            x = ca.MX.sym("x", count + has_drag + has_extra)
            shared = x, [x[i] * scales[i] for i in range(count)], x[count] if has_drag else None
        self.x: Any = shared[0]
        self.values: list[Any] = list(shared[1])
        self.log_drag: Any = shared[2]
        self.extra: Any = self.x[count + has_drag] if has_extra else None
        self.amplitude: Any = 1.0
        if self.extra is not None and goal is Goal.SEA:
            self.amplitude = ca.exp(self.extra)
        self.omega_values = omega
        self.omega = ca.DM(omega)
        self._problem = problem
        self._nodes = nodes
        wanted = {*problem.minimise, *(o for lim in problem.limits for o in lim.outputs)}
        if problem.drag is not None:
            wanted.add(problem.drag.velocity)
        names = [d.name for d in problem.disturbances]
        pairs = [(output, name) for output in sorted(wanted) for name in names]
        at_nodes = self._blocks(nodes.omega)
        s = Phasor(0.0, ca.DM(nodes.omega))
        self._responses = closed_loop(at_nodes, law.response(self.values, s), pairs)
        self._margin_blocks = self._blocks(omega)
        self._margin_law = law.response(self.values, Phasor(0.0, self.omega))
        self.differences: list[Phasor] = [
            _as_vector(d, omega.size)
            for d in return_differences(self._margin_blocks, self._margin_law)
        ]
        self._shake(problem)

    def _shake(self, problem: Problem) -> None:
        omega, weights = self._nodes.omega, self._nodes.weights
        self._densities = {d.name: d.density(omega) * weights for d in problem.disturbances}
        self._moments: dict[tuple[str, int], Any] = {}

    def under(self, problem: Problem) -> LoopSymbols:
        """Return the same loop shaken by the disturbances of another problem."""
        other = copy(self)
        other._problem = problem
        other._shake(problem)
        return other

    @property
    def module_margin(self) -> float:
        """Radius of the disc about -1 that a limit on the sensitivity keeps clear; 0 without."""
        bounds = [lim.bound for lim in self._problem.limits if lim.name == "max_sensitivity"]
        return 1.0 / bounds[0] if bounds else 0.0

    def response(self, output: str, disturbance: str) -> Phasor:
        """Return the closed-loop response at the margin nodes."""
        pair = (output, disturbance)
        found = closed_loop(self._margin_blocks, self._margin_law, [pair])[pair]
        return _as_vector(found, self.omega_values.size)

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`."""
        if (output, order) not in self._moments:
            total: Any = 0.0
            power = self._nodes.omega**order
            for name, density in self._densities.items():
                squared = self._responses[output, name].squared()
                total = total + ca.dot(ca.DM(density * power), squared * ca.DM.ones(power.size))
            self._moments[output, order] = self.amplitude**2 * total
        return self._moments[output, order]

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s]."""
        m0, m2 = self.moment(output, 0), self.moment(output, 2)
        cycles = duration / (2.0 * np.pi) * ca.sqrt(m2 / m0)
        # No fewer than e^(1/2) cycles, a factor of one: for less the logarithm turns negative.
        factor = ca.sqrt(2.0 * ca.log(ca.fmax(cycles, float(np.exp(0.5)))))
        return factor * ca.sqrt(m0)

    def cost(self) -> Any:
        """Return the logarithm of the square root of the weighted variance."""
        terms = [w * self.moment(name, 0) for name, w in self._problem.minimise.items()]
        return 0.5 * ca.log(sum(terms[1:], terms[0]))

    def drag_balance(self) -> Any:
        """Return log C - log(slope sigma_v), zero where drag and motion agree."""
        drag = self._problem.drag
        assert drag is not None
        sigma = ca.sqrt(self.moment(drag.velocity, 0))
        return self.log_drag - ca.log(drag.slope * sigma)

    def no_slow_pole(self, reference: FloatArray) -> Any:
        """Return a row that keeps real poles from crossing -decay.

        det(I - C yu) at a real point s is the characteristic function over that of the open
        loop, and cannot change its sign unless a real pole passes s.  Complex poles cannot
        reach the axis through |1 + L| > 0, but a real one may creep up to zero, below every
        frequency node; the guard alone would let it crawl there.
        """
        at = self._problem.slow_point
        law = self._problem.law
        here = determinant(self._blocks_at(at), law.response(self.values, Phasor(at, 0.0)))
        there = determinant(
            numeric_blocks(self._problem.plant.response_at([at])),
            law.response(list(reference), np.array([at + 0j])),
        )
        return 1e-6 - _as_vector(here, 1).re / float(np.real(np.atleast_1d(there))[0])

    def _blocks_at(self, s: complex) -> PlantBlocks:
        return self._with_drag(numeric_blocks(self._problem.plant.response_at([s]), symbolic=True))

    def _blocks(self, omega: FloatArray) -> PlantBlocks:
        return self._with_drag(numeric_blocks(self._problem.plant.response(omega), symbolic=True))

    def _with_drag(self, blocks: PlantBlocks) -> PlantBlocks:
        drag = self._problem.drag
        if drag is None:
            return blocks
        gain = drag.reference - ca.exp(self.log_drag)
        return close_scalar(blocks, drag.velocity, drag.force, gain)


def _as_vector(value: Any, count: int) -> Phasor:
    """Return a phasor whose parts are vectors even where the law made scalars of them."""
    ones = ca.DM.ones(count)
    if not isinstance(value, Phasor):
        return Phasor(value * ones, 0.0 * ones)
    return Phasor(value.re * ones, value.im * ones)
