"""Verification of an answer of `synth.design.tune`, on any linear plant.

Poles with other Pade models, the winding number with exact delays, margins by root finding,
the cost by other quadrature and, where all disturbances are white, by a Lyapunov equation,
every limit, the drag, and whether the parameters are those of the controller.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import White, one_thread
from models.plant import LinearPlant

from .claims import ControllerMatrices, TuningClaims
from .demands import limit_demand
from .nyquist import CurveMargins
from .recheck import (
    PADE,
    TIGHT,
    closed_loop_marks,
    guarded,
    limit_check,
    loop_margins,
    margin_checks,
    pole_check,
    winding_check,
    winding_of_plant,
)
from .recompute import LawMatrices, Loop, imaginary, lyapunov_variances, moments
from .verification import Check, Verification, agreement, failure

_DECAY = 1e-10  # of a pole, over the size of the fastest one, to count as stable
_COST = 1e-6  # cost by another quadrature or a Lyapunov equation
_PADE_COST = 1e-3  # ... by a Lyapunov equation with Pade models for the delays
_SAME = 1e-9  # controller from the parameters against the controller


@one_thread()
def verify_tuning(tuning: TuningClaims) -> Verification:
    """Check an answer of `synth.design.tune` by code that the optimiser did not use.

    Parameters
    ----------
    tuning
        The answer, with the question it answers.

    Returns
    -------
    Verification
        `ok` only if the closed loop is stable with the exact delays and every claim was met.
    """
    if tuning.controller is None:
        return Verification.of([failure("controller", "there is none")], "")
    loop = _TunedLoop(tuning, tuning.controller)
    checks = guarded("stability", loop.stability)
    if not all(check.ok for check in checks):
        return Verification.of(checks, "")
    checks += guarded("parameters", loop.parameters)
    checks += guarded("margins", loop.margins)
    checks += guarded("cost", loop.cost)
    checks += guarded("coefficient", loop.drag)
    checks += guarded("limits", loop.limits)
    return Verification.of(
        checks, f"verified: stable with the exact delays, {len(checks)} checks passed"
    )


@dataclass(frozen=True, eq=False)
class _TunedLoop:
    """A tuned loop, put together again."""

    tuning: TuningClaims
    controller: ControllerMatrices

    @cached_property
    def plant(self) -> LinearPlant:
        """The plant with its drag: force = -(C - reference) velocity."""
        plant, element = self.tuning.problem.plant, self.tuning.problem.drag
        if element is None or self.tuning.coefficient is None:
            return plant
        row = plant.outputs.index(element.velocity)
        column = plant.disturbances.index(element.force)
        more = element.reference - self.tuning.coefficient
        velocity, force = plant.Cz[row], more * plant.E[:, column]
        return replace(
            plant,
            A=plant.A + np.outer(force, velocity),
            C=plant.C + more * np.outer(plant.F[:, column], velocity),
            Cz=plant.Cz + more * np.outer(plant.Fz[:, column], velocity),
        )

    @cached_property
    def law(self) -> LawMatrices:
        return LawMatrices.of(self.controller, self.plant)

    @cached_property
    def loop(self) -> Loop:
        marks = closed_loop_marks(self.plant, self.law)
        return Loop(
            plant=self.plant.response_at,
            law=self.law,
            marks=marks,
            inputs=len(self.plant.inputs),
        )

    @cached_property
    def curve_margins(self) -> CurveMargins:
        return loop_margins(self.loop)

    @cached_property
    def intensities(self) -> dict[str, float] | None:
        """Intensities of the disturbances, or None if one of them is not white."""
        found = {}
        for disturbance in self.tuning.problem.disturbances:
            origin = getattr(disturbance.density, "__self__", None)
            if not isinstance(origin, White):
                return None
            found[disturbance.name] = origin.intensity
        return found

    def stability(self) -> list[Check]:
        fastest = float(np.abs(self.loop.marks).max(initial=1.0))
        return [
            winding_check(winding_of_plant(self.plant, self.law, self.loop.marks), "the plant"),
            pole_check("poles", self.plant, self.law, "the plant", _DECAY * fastest),
        ]

    def parameters(self) -> list[Check]:
        """Return the check that the parameters named make the controller handed over."""
        law = self.tuning.problem.law
        again = law.controller([self.tuning.parameters[p.name] for p in law.parameters])
        sizes = np.abs(self.loop.marks)
        s = imaginary(np.geomspace(0.1, 10.0, 7) * float(np.median(sizes)) if sizes.size else [1.0])
        pair = [LawMatrices.of(c, self.plant)(s) for c in (self.controller, again)]
        size = float(np.abs(pair[0]).max(initial=0.0))
        apart = float(np.abs(pair[0] - pair[1]).max(initial=0.0))
        return [
            Check(
                name="parameters",
                ok=apart <= _SAME * size,
                claimed=0.0,
                found=apart / size if size else apart,
                tolerance=_SAME,
                note="relative difference of the controller they make",
            )
        ]

    def margins(self) -> list[Check]:
        return margin_checks(self.tuning.margins, self.curve_margins)

    def cost(self) -> list[Check]:
        weights = self.tuning.problem.minimise
        found = self._moments(list(weights), (0,))
        checks = [
            agreement(
                "cost", self.tuning.cost, _cost(weights, found), _COST, "by quad_vec, exact delays"
            )
        ]
        if self.intensities is None:
            return checks
        late = any(self.plant.delays)
        rational = self.plant.without_delays(PADE, at="measurements")
        variances = lyapunov_variances(rational, self.law, self.intensities)
        by_time = _cost(weights, {name: (variances[name],) for name in weights})
        note = "by a Lyapunov equation" + (" with Pade delays" if late else "")
        tolerance = _PADE_COST if late else _COST
        return [*checks, agreement("cost.time", self.tuning.cost, by_time, tolerance, note)]

    def drag(self) -> list[Check]:
        element, claimed = self.tuning.problem.drag, self.tuning.coefficient
        if element is None:
            return []
        if claimed is None:
            return [failure("coefficient", "there is drag but no coefficient is claimed")]
        sigma = math.sqrt(self._moments([element.velocity], (0,))[element.velocity][0])
        needed = element.quadratic * math.sqrt(8.0 / math.pi) * sigma
        return [agreement("coefficient", claimed, needed, TIGHT, "q sqrt(8/pi) sigma")]

    def limits(self) -> list[Check]:
        checks = []
        for limit in self.tuning.problem.limits:
            use = self.tuning.limits.get(limit.name)
            if use is None:
                note = "the problem states it, the answer does not"
                checks.append(failure(f"limits.{limit.name}", note))
                continue
            demand = limit_demand(limit)
            found = {
                output: self._moments([output], orders)[output]
                for output, orders in demand.orders.items()
            }
            value = demand.measured(self.loop, self.curve_margins, found)
            check = limit_check(demand, use.value, value)
            if self.tuning.ok and not demand.kept(value, TIGHT):
                note = f"the answer counts as good but breaks the bound {demand.bound:.6g}"
                check = replace(check, ok=False, note=note)
            checks.append(check)
        return checks

    def _moments(
        self, outputs: Sequence[str], orders: tuple[int, ...]
    ) -> dict[str, tuple[float, ...]]:
        delay = max(self.plant.delays, default=0.0)
        return moments(
            self.loop, outputs, self.tuning.problem.disturbances, orders=orders, delay=delay
        )


def _cost(weights: Mapping[str, float], found: Mapping[str, tuple[float, ...]]) -> float:
    return math.sqrt(sum(weight * found[name][0] for name, weight in weights.items()))
