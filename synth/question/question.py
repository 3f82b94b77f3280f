"""`DesignQuestion`: a case as plant, spectra and limits of a synthesis problem.

    Case -> hook motion, plant at N rope masses, drag, limits -> DesignQuestion -> Problem

Everything that synthesis takes from a case is taken here: which limits there are and whether
they bind, what the drag is before compensation, how many rope masses the plant has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, adaptive_nodes
from models.case import Case
from models.hook import HookMotion
from models.plant import (
    LinearPlant,
    PlantData,
    build_plant,
    fixed_top_modes,
    rope_transfers,
    settled_drag,
)

from ..limits import HOOK, PAYLOAD, Limit, RollOff, drive_limits, loop_limits, modelled_bandwidth
from ..loop import Assessment, DragElement, disturbances
from ..structures import PayloadFeedback
from .problem import Problem


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignQuestion:
    """A case as synthesis sees it.

    Attributes
    ----------
    plant
        The linear plant at `masses` rope masses, its drag that before compensation.
    limits, reported
        Limits that bind the design, and those that are only reported.
    drag
        The quadratic drag to be linearised with the response, or None if C is given.
    drag_before, payload_rms_before
        Linear drag [N s/m] and rms payload motion [m] with the drum held.
    """

    case: Case
    data: PlantData
    hook: HookMotion
    masses: int
    plant: LinearPlant
    structure: PayloadFeedback
    limits: tuple[Limit, ...]
    reported: tuple[Limit, ...]
    drag: DragElement | None
    drag_before: float
    payload_rms_before: float

    @property
    def amplifier(self) -> float:
        """The fixed gain A."""
        return self.structure.amplifier

    @cached_property
    def problem(self) -> Problem:
        """The problem with all limits that bind."""
        return self.problem_with(self.limits)

    def problem_with(self, limits: tuple[Limit, ...]) -> Problem:
        """Return the problem with other limits."""
        return Problem(
            plant=self.plant,
            law=self.structure.bind(self.plant),
            disturbances=disturbances({HOOK: self.hook}, self.plant.independent_disturbances),
            minimise={PAYLOAD: 1.0},
            limits=limits,
            drag=self.drag,
        )

    def law_values(self, gains: Mapping[str, float]) -> list[float]:
        """Return gains ``A, a, a1, a2`` as the law has them: with its own amplifier."""
        scale = gains["A"] / self.amplifier
        return [scale * gains[name] for name in ("a", "a1", "a2")]

    def assess(self, gains: Mapping[str, float], coefficient: float | None = None) -> Assessment:
        """Return the closed loop of given gains ``A, a, a1, a2`` in numbers."""
        return self.problem.assess(self.law_values(gains), coefficient)


def pose(case: Case, masses: int | None = None) -> DesignQuestion:
    """Return the question of a case.

    Parameters
    ----------
    case
        The case.
    masses
        Rope masses; by default the case's, or a number that suits a quick loop.

    Raises
    ------
    InputError
        If the case lacks what a design needs.
    """
    data = PlantData.from_case(case)
    hook = HookMotion.from_case(case)
    model = build_plant(data, masses)
    drag_before, rms_before = uncompensated(case, data, hook)
    plant = model.linearise(drag=drag_before)
    stochastic = case.payload.fixed_drag is None and data.quadratic_drag > 0.0
    binding = loop_limits(case, data, model.masses)
    drive = drive_limits(case, plant)
    enforced = case.limits.drive == "enforce"
    amplifier = case.gains.A if case.gains is not None else 1.0
    return DesignQuestion(
        case=case,
        data=data,
        hook=hook,
        masses=model.masses,
        plant=plant,
        structure=PayloadFeedback(amplifier=amplifier, bounds=_bounds(case, amplifier)),
        limits=(*binding, *drive) if enforced else binding,
        reported=() if enforced else drive,
        drag=DragElement(quadratic=data.quadratic_drag, reference=drag_before)
        if stochastic
        else None,
        drag_before=drag_before,
        payload_rms_before=rms_before,
    )


def assess_gains(
    case: Case, gains: Mapping[str, float], *, masses: int | None = None, drag: float | None = None
) -> Assessment:
    """Return the closed loop of gains ``A, a, a1, a2`` on a case, in numbers.

    Parameters
    ----------
    case, gains
        The case and the gains.
    masses
        Rope masses of the plant.
    drag
        Linear drag coefficient [N s/m], if it is known already.
    """
    return pose(case, masses).assess(gains, drag)


def uncompensated(case: Case, data: PlantData, hook: HookMotion) -> tuple[float, float]:
    """Return drag coefficient [N s/m] and rms payload motion [m] with the drum held.

    On the exact distributed rope (the lumped one spring with the thesis's lumping); drag that
    is stochastically linearised agrees with the motion.
    """
    modes = _modes(data, hook.band[1])
    mass = data.payload_mass + data.rope_mass * (1.0 if data.lumping == "thesis" else 1.0 / 3.0)

    def moved(C: float, omega: FloatArray) -> FloatArray:
        P_Y = _locked(data, np.asarray(1j * omega, dtype=np.complex128), C)
        return np.asarray(np.abs(P_Y) ** 2)

    def about(C: float, power: int) -> Callable[[float], float]:
        damping = 0.5 * data.damping_time * modes**2
        damping[0] += 0.5 * C / mass  # the drag is the payload's, which hardly moves above
        if damping[0] <= 0.0:
            return lambda C: math.inf  # undamped resonance: no stationary motion
        nodes = adaptive_nodes(
            lambda omega: moved(C, omega) * hook.density(omega) * omega**power,
            *hook.band,
            splits=hook.splits,
            poles=[complex(-h, w) for h, w in zip(damping, modes, strict=True) if h > 0.0],
            rtol=1e-9,
        )
        weights = nodes.weights * hook.density(nodes.omega) * nodes.omega**power
        return lambda C: math.sqrt(moved(C, nodes.omega) @ weights)

    fixed = case.payload.fixed_drag
    if fixed is None:
        fixed = settled_drag(data.quadratic_drag, lambda C: about(C, 2), 0.0)
    return fixed, about(fixed, 0)(fixed)


def _modes(data: PlantData, highest: float) -> FloatArray:
    """Return the axial modes with the drum held up to a frequency, at least one [rad/s]."""
    if data.lumping == "thesis" or data.mass_per_length == 0.0:
        mass = data.payload_mass + data.rope_mass
        return np.array([math.sqrt(data.stiffness / mass)])
    rope = (data.axial_stiffness, data.rope_length, data.mass_per_length)
    spacing = math.pi / data.rope_length * math.sqrt(data.axial_stiffness / data.mass_per_length)
    found = fixed_top_modes(*rope, data.payload_mass, int(highest / spacing) + 1)
    return np.asarray(found[(found < highest) | (found == found[0])])


def locked_response(case: Case, omega: FloatArray, drag: float) -> ComplexArray:
    """Return P/Z with the drum held at frequencies [rad/s], (k,), for a drag C [N s/m]."""
    s = 1j * np.asarray(omega, dtype=np.complex128)
    return _locked(PlantData.from_case(case), s, drag)


def _locked(data: PlantData, s: ComplexArray, drag: float) -> ComplexArray:
    """Return P/Z with the drum held, (k,): one spring or the exact distributed rope."""
    if data.lumping != "thesis":
        return rope_transfers(data, s, drag)[0]
    spring = data.stiffness * (1.0 + s * data.damping_time)
    mass = data.payload_mass + data.rope_mass
    return np.asarray(spring / (mass * s**2 + drag * s + spring))


def _bounds(case: Case, amplifier: float) -> dict[str, tuple[float, float]]:
    if case.gain_bounds is None:
        return {}
    given = {name: getattr(case.gain_bounds, name) for name in ("a", "a1", "a2")}
    return {
        name: (pair[0] / amplifier, pair[1] / amplifier)
        for name, pair in given.items()
        if pair is not None
    }


def with_masses(question: DesignQuestion, masses: int) -> DesignQuestion:
    """Return the question on another number of rope masses."""
    model = build_plant(question.data, masses)
    return replace(
        question,
        masses=model.masses,
        plant=model.linearise(drag=question.drag_before),
        limits=tuple(_rescaled(lim, question.data, model.masses) for lim in question.limits),
    )


def _rescaled(limit: Limit, data: PlantData, masses: int) -> Limit:
    if isinstance(limit, RollOff):
        return replace(limit, above=modelled_bandwidth(data, masses))
    return limit
