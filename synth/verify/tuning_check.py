"""Verification of an answer of `synth.design.tune`, on any linear plant.

Poles with other Pade models, the winding number with exact delays, margins by root finding,
the cost by other quadrature and, where all disturbances are white, by a Lyapunov equation,
every limit, the drag, and whether the parameters are those of the controller.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import SolverError, White, one_thread
from models.plant import LinearPlant

from .claims import ControllerMatrices, EquivalentElement, TuningClaims
from .demands import limit_demand
from .recheck import (
    PADE,
    TIGHT,
    CheckedLoop,
    looked_at,
    pole_check,
    winding_check,
    winding_of_plant,
)
from .recompute import LawMatrices, imaginary, lyapunov_variances
from .verification import Check, Verification, agreement, failure

_DECAY = 1e-10  # of a pole, over the size of the fastest one, to count as stable
_COST = 1e-6  # cost by another quadrature or a Lyapunov equation
_PADE_COST = 1e-3  # ... by a Lyapunov equation with Pade models for the delays
_SAME = 1e-9  # controller from the parameters against the controller


@one_thread()
def verify_tuning(tuning: TuningClaims) -> Verification:
    """Check an answer of `synth.design.tune` by code that the optimiser did not use.

    The answer comes with the question it answers.  The verification is `ok` only if the closed loop
    is stable with the exact delays and every claim was met.
    """
    if tuning.controller is None:
        return Verification.of([failure("controller", "there is none")], "")
    loop = _TunedLoop(tuning, tuning.controller)
    steps = {
        "stability": loop.stability,
        "parameters": loop.parameters,
        "margins": lambda: loop.checked.margin_checks(tuning.margins),
        "cost": loop.cost,
        "coefficients": loop.coefficients,
        "limits": loop.limits,
    }
    return looked_at(steps, ": stable with the exact delays")


@dataclass(frozen=True, eq=False)
class _TunedLoop:
    """A tuned loop, put together again."""

    tuning: TuningClaims
    controller: ControllerMatrices

    @cached_property
    def plant(self) -> LinearPlant:
        """The plant with its elements: force = -(c - reference) velocity."""
        plant, claimed = self.tuning.problem.plant, self.tuning.coefficients
        for element, coefficient in zip(self.tuning.problem.elements, claimed, strict=False):
            row = plant.outputs.index(element.velocity)
            column = plant.disturbances.index(element.force)
            more = element.reference - coefficient
            velocity, force = plant.Cz[row], more * plant.E[:, column]
            plant = replace(
                plant,
                A=plant.A + np.outer(force, velocity),
                C=plant.C + more * np.outer(plant.F[:, column], velocity),
                Cz=plant.Cz + more * np.outer(plant.Fz[:, column], velocity),
            )
        return plant

    @cached_property
    def unknown(self) -> dict[str, str]:
        """Why limits cannot be measured here, by name: those of classes of a user's own."""
        found = {}
        for limit in self.tuning.problem.limits:
            try:
                limit_demand(limit)
            except SolverError as error:
                found[limit.name] = str(error)
        return found

    @cached_property
    def checked(self) -> CheckedLoop:
        asked = self.tuning.problem
        known = [limit for limit in asked.limits if limit.name not in self.unknown]
        demands = {limit.name: limit_demand(limit) for limit in known}
        own = [*asked.minimise, *(element.velocity for element in asked.elements)]
        return CheckedLoop.of(self.plant, self.controller, asked.disturbances, demands, own)

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
        loop, plant = self.checked, self.plant
        fastest = float(np.abs(loop.marks).max(initial=1.0))
        return [
            winding_check(winding_of_plant(plant, loop.law, loop.marks), "the plant"),
            pole_check("poles", plant, loop.closed_poles, "the plant", _DECAY * fastest),
        ]

    def parameters(self) -> list[Check]:
        """Return the check that the parameters named make the controller handed over."""
        law = self.tuning.problem.law
        again = law.controller([self.tuning.parameters[p.name] for p in law.parameters])
        sizes = np.abs(self.checked.marks)
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

    def cost(self) -> list[Check]:
        weights = self.tuning.problem.minimise
        found = _cost(weights, {name: self.checked.moments[name][0] for name in weights})
        note = "by other quadrature, exact delays"
        checks = [agreement("cost", self.tuning.cost, found, _COST, note)]
        if self.intensities is None:
            return checks
        late = any(self.plant.delays)
        rational = self.plant.without_delays(PADE, at="measurements")
        variances = lyapunov_variances(rational, self.checked.law, self.intensities)
        by_time = _cost(weights, variances)
        note = "by a Lyapunov equation" + (" with Pade delays" if late else "")
        tolerance = _PADE_COST if late else _COST
        return [*checks, agreement("cost.time", self.tuning.cost, by_time, tolerance, note)]

    def limits(self) -> list[Check]:
        checks = self.checked.limit_checks(self.tuning, by="problem", on="answer")
        told = [failure(f"limits.{name}", reason) for name, reason in self.unknown.items()]
        names = [check.name for check in told]
        return [*(check for check in checks if check.name not in names), *told]

    def coefficients(self) -> list[Check]:
        elements, claimed = self.tuning.problem.elements, self.tuning.coefficients
        if len(elements) != len(claimed):
            return [failure("coefficients", f"{len(elements)} are asked for, not {len(claimed)}")]
        note = "by the variance of its velocity"
        return [
            agreement(f"coefficients.{e.force}", c, self._needed(e), TIGHT, note)
            for e, c in zip(elements, claimed, strict=True)
        ]

    def _needed(self, element: EquivalentElement) -> float:
        """Return the coefficient that the motion asks for: the mean slope of the force."""
        sigma = self.checked.rms(element.velocity)
        slope = getattr(element, "quadratic", None)
        if slope is not None:
            return float(slope) * math.sqrt(8.0 / math.pi) * sigma
        return float(getattr(element, "torque", 0.0)) / math.sqrt(1.0 + 0.5 * math.pi * sigma**2)


def _cost(weights: Mapping[str, float], variances: Mapping[str, float]) -> float:
    return math.sqrt(sum(weight * variances[name] for name, weight in weights.items()))
