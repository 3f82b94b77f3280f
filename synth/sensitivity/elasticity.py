r"""Elasticities of a design: by how many per cent its figures move for one per cent of a number.

    design -> closed loop at its own drag -> gradients -> slopes along every number -> Sensitivity

The gains are fixed, the world moves: rope, payload, winch, sensors and sea, and the gains
themselves.  Where the payload's drag is linearised with the response, C = q sqrt(8/pi) sigma_v, it
moves with every number too.  With theta the number and all slopes logarithmic,

.. math::

    \frac{d \ln\sigma}{d\theta} = \frac{\partial\ln\sigma}{\partial\theta}
        + \frac{\partial\ln\sigma}{\partial C}\,\frac{dC}{d\theta}, \qquad
    \frac{dC}{d\theta} = C\,\frac{\partial_\theta\ln q + \partial_\theta\ln\sigma_v}
        {1 - C\,\partial_C \ln\sigma_v}

(implicit differentiation of the fixed point).  Figure 32 of the 1975 thesis is the preset
`Sensitivity.moved`: its gains 10 % up, one at a time, the response recomputed in full.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.basics import FloatArray, InputError
from models.plant import PlantData

from ..design import Design
from ..loop import Assessment, Disturbance
from ..question import PAYLOAD
from ..search import Progress
from .differences import StepError, derivative
from .fields import Number, numbers_of
from .fixed_design import FixedDesign
from .gradient import Gradient, sensitivity_gradient, variance_gradient
from .results import Elasticity, Sensitivity
from .slopes import PlantSlopes, changed

_OUTPUTS = {"payload_rms": PAYLOAD, "torque_rms": "motor.torque", "speed_rms": "motor.speed"}
_PEAK = "peak of |S| "
_SHAKING = ("sea.", "vessel.", "sensors.")  # sections that the disturbances' spectra depend on
_TIE = 0.999  # peaks of this share of the largest count as tied
_SECOND = 0.01  # share of a number for its second derivative


def sensitivity(
    design: Design, *, second: int = 0, progress: Progress | None = None
) -> Sensitivity:
    """Return the elasticities of a design in every number of its case and in every gain.

    Parameters
    ----------
    design
        A stable design: gains, or any structure.
    second
        For how many of the numbers with the largest effect the second derivative is computed too.
    progress
        Called with a word, the numbers done and their count.

    Returns
    -------
    Sensitivity

    Raises
    ------
    InputError
        If the loop is unstable.
    """
    if design.margins is None:
        raise InputError("sensitivity: the loop must be stable; an unstable one has no rms")
    fixed = FixedDesign.of(design)
    figures, found, idle, steps = _first(fixed, progress)
    found.sort(key=lambda e: -abs(e.payload_rms))
    for k in range(min(second, len(found))):
        if progress is not None:
            progress("second derivatives", k, min(second, len(found)))
        found[k] = _with_curvature(fixed, found[k])
    return Sensitivity(
        design=design,
        elasticities=tuple(found),
        without_effect=tuple(idle),
        stepping=tuple(steps),
        **figures,
    )


def _first(
    fixed: FixedDesign, progress: Progress | None, only: str | None = None
) -> tuple[dict[str, float], list[Elasticity], list[str], list[str]]:
    """Return the figures, the elasticities, the paths without effect, and those that step."""
    assessment = fixed.assessment()
    if assessment is None:
        raise InputError("sensitivity: the loop must be stable; an unstable one has no rms")
    gradients = _gradients(assessment, fixed)
    figures = {name: gradients[name].value for name in _OUTPUTS}
    figures["max_sensitivity"] = assessment.max_sensitivity
    design, drag_now = fixed.design, assessment.coefficient or fixed.fixed_drag
    slopes = PlantSlopes(
        fixed.case, masses=design.masses, drag=drag_now, measurements=design.measurements
    )
    drag = _DragMotion(fixed, assessment, gradients, slopes) if fixed.stochastic else None
    numbers = [n for n in numbers_of(fixed.case) if only is None or n.path == only]
    found: list[Elasticity] = []
    idle: list[str] = []
    steps: list[str] = []
    for k, number in enumerate(numbers):
        if progress is not None:
            progress("numbers of the case", k, len(numbers))
        try:
            matrices = slopes.of(number)
            densities = _density_slopes(fixed, number, gradients["payload_rms"].omega)
        except StepError:
            steps.append(number.path)
            continue
        own = {
            name: gradient.along(matrices) + gradient.along_densities(densities)
            for name, gradient in gradients.items()
        }
        moved = drag.along(number, own["velocity"]) if drag is not None else 0.0
        if matrices.is_zero and not densities and moved == 0.0:
            idle.append(number.path)
            continue
        whole = _shares(number.value, own, moved, drag)
        found.append(Elasticity(path=number.path, value=number.value, unit=number.unit, **whole))
    for name, value, slope in fixed.law_slopes(gradients["payload_rms"].s):
        path = f"gains.{name}"
        if only is not None and path != only:
            continue
        own = {
            key: gradient.along_law(
                fixed.law_slope(name, gradient.s) if key.startswith(_PEAK) else slope
            )
            for key, gradient in gradients.items()
        }
        moved = drag.shift(own["velocity"]) if drag is not None else 0.0
        whole = _shares(value, own, moved, drag)
        found.append(Elasticity(path=path, value=value, unit=design.units.get(name, ""), **whole))
    return figures, found, idle, steps


def _shares(
    value: float, own: Mapping[str, float], moved: float, drag: _DragMotion | None
) -> dict[str, float]:
    """Return the elasticities of all figures from their slopes at fixed drag and dC."""
    whole = {
        name: value * (slope + (moved * drag.of[name] if drag is not None else 0.0))
        for name, slope in own.items()
    }
    peaks = [slope for name, slope in whole.items() if name.startswith(_PEAK)]
    return {name: whole[name] for name in _OUTPUTS} | {"max_sensitivity": max(peaks, key=abs)}


class _DragMotion:
    """How the drag coefficient that agrees with the response moves."""

    def __init__(
        self,
        fixed: FixedDesign,
        assessment: Assessment,
        gradients: Mapping[str, Gradient],
        slopes: PlantSlopes,
    ) -> None:
        self._case, self.C = fixed.case, assessment.coefficient
        self.of = {name: g.along(slopes.of_drag()) for name, g in gradients.items()}

    def shift(self, velocity: float, quadratic: float = 0.0) -> float:
        """Return dC for slopes of ln sigma_v and of ln q at fixed C."""
        return self.C * (velocity + quadratic) / (1.0 - self.C * self.of["velocity"])

    def along(self, number: Number, velocity: float) -> float:
        """Return dC / d number."""

        def quadratic(value: float) -> FloatArray:
            q = PlantData.from_case(changed(self._case, number, value)).quadratic_drag
            return np.array([np.log(q)])

        own = 0.0
        if number.path.startswith("payload."):
            own = float(np.real(derivative(quadratic, number.value)[0]))
        return self.shift(velocity, own)


def _gradients(assessment: Assessment, fixed: FixedDesign) -> dict[str, Gradient]:
    outputs = {**_OUTPUTS, "velocity": "payload.velocity"}
    nodes = assessment.quadrature(list(outputs.values()))
    arguments = assessment.plant, assessment.controller, fixed.disturbances
    found = {
        name: variance_gradient(*arguments, output, nodes.omega, nodes.weights)
        for name, output in outputs.items()
    }
    for k, peak in enumerate(assessment.sensitivity_peaks(_TIE * assessment.max_sensitivity)):
        found[f"{_PEAK}{k}"] = sensitivity_gradient(
            assessment.plant, assessment.controller, float(peak)
        )
    return found


def _density_slopes(fixed: FixedDesign, number: Number, omega: FloatArray) -> dict[str, FloatArray]:
    """Return d S / d number at the nodes by disturbance, where the number shakes anything."""
    if not number.path.startswith(_SHAKING):
        return {}

    def densities(value: float) -> FloatArray:
        sources = fixed.disturbances_of(changed(fixed.case, number, value))
        return np.array([_density(sources, d.name, omega) for d in fixed.disturbances])

    slopes = np.asarray(derivative(densities, number.value, common=True), dtype=np.float64)
    pairs = zip(fixed.disturbances, slopes, strict=True)
    return {d.name: slope for d, slope in pairs if slope.any()}


def _density(sources: Sequence[Disturbance], name: str, omega: FloatArray) -> FloatArray:
    for source in sources:
        if source.name == name:
            return source.density(omega)
    return np.zeros_like(omega)


def _with_curvature(fixed: FixedDesign, entry: Elasticity) -> Elasticity:
    """Return the elasticity with its own slope, by differences of exact first derivatives."""
    ends = []
    for sign in (1.0, -1.0):
        other = fixed.with_number(entry.path, np.exp(sign * _SECOND))
        found = _first(other, None, entry.path)[1] if other is not None else []
        ends.append(found[0].payload_rms if found else np.nan)
    curvature = float((ends[0] - ends[1]) / (2.0 * _SECOND))
    return replace(entry, curvature=curvature if np.isfinite(curvature) else None)
