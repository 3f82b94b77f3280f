"""`DesignQuestion`: a case and a structure as plant, spectra and limits of a synthesis problem.

    Case, structure -> hook, plant at N rope masses with its sensors, noise, drag, limits
                    -> DesignQuestion -> Problem

Everything that synthesis takes from a case is taken here: what the structure hears and what shakes
it, which limits there are and whether they bind, what the drag is before compensation, how many
rope masses the plant has.  The sea, the error of the reference unit and the noise of the sensors
are disturbances in one cost, so that no gain grows without a price.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from models.basics import (
    ComplexArray,
    FloatArray,
    PhysicsWarning,
    wave_number,
)
from models.case import Case
from models.hook import HookMotion
from models.plant import (
    LinearPlant,
    Plant,
    PlantData,
    build_plant,
)
from models.sensing import (
    LOAD,
    SAMPLE_TIME,
    SET_POINT,
    UnitError,
    sensed_plant,
    sensed_spectra,
    with_loads,
    with_sensors,
)

from ..limits import (
    HOOK,
    PAYLOAD,
    Limit,
    LowFrequency,
    RollOff,
    drive_limits,
    loop_limits,
    modelled_bandwidth,
)
from ..loop import (
    Assessment,
    Coefficients,
    DragElement,
    Element,
    LinearController,
    LossElement,
    disturbances,
)
from ..structures import (
    Fixed,
    LowOrderFeedback,
    ParametrisedController,
    PayloadFeedback,
    WinchStructure,
    structure_aboard,
    structure_named,
)
from .held import uncompensated
from .problem import Problem

GAINS = ("A", "a", "a1", "a2")
"""The thesis's gains; the amplifier A multiplies the others."""


_TRIFLE = 1e-9  # of the static torque: what rounding makes of no losses


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledNoise:
    """Noise as samples carry it: its density up to pi/T [rad/s].

    Its variance is that of the samples, so that what a direct gain makes of it has one too, and a
    rate that goes with it.
    """

    spectrum: Callable[[Any], Any]  #: Density per rad/s.
    sample_time: float = SAMPLE_TIME  #: Time between samples [s].
    #: Frequency below which there is nothing of it, if that is low, and kinks [rad/s].
    lowest: float = math.inf
    splits: tuple[float, ...] = ()
    #: Of an error that is in part a share of a disturbance, see `synth.loop.Disturbance`.
    source: str = ""
    shares: Callable[[FloatArray], ComplexArray] | None = None

    @property
    def band(self) -> tuple[float, float]:
        """Band that holds the variance [rad/s]."""
        return min(1e-5 / self.sample_time, self.lowest), np.pi / self.sample_time

    def density(self, omega: Any) -> Any:
        """Return the one-sided density per rad/s at `omega` [rad/s]."""
        return self.spectrum(omega)


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignQuestion:
    """A case and a structure as synthesis sees them."""

    #: The case, and the structure whose parameters are asked for.
    case: Case
    structure: PayloadFeedback | WinchStructure | LowOrderFeedback
    #: The plant's numbers and the hook's motion.
    data: PlantData
    hook: HookMotion
    model: Plant  #: The plant before it is linearised.
    #: The linear plant with what the structure hears, its drag that before compensation.
    plant: LinearPlant
    #: What shakes it, by name of the disturbance: the sea, the reference unit, the sensors.
    spectra: Mapping[str, Any]
    #: Limits of the loop, limits of the drive, and limits that are reported only.
    loop: tuple[Limit, ...]
    drive: tuple[Limit, ...]
    reported: tuple[Limit, ...]
    #: What is linearised with the response: quadratic drag, if no C is given, and losses that
    #: switch with the motor's direction, if there are some.
    elements: tuple[Element, ...]
    #: Linear drag [N s/m] and rms payload motion [m] with the drum held.
    drag_before: float
    payload_rms_before: float
    #: Parameters of the structure that are not searched, by name.
    held: Mapping[str, float] = field(default_factory=dict)

    @property
    def masses(self) -> int:
        """Rope masses."""
        return self.model.masses

    @property
    def limits(self) -> tuple[Limit, ...]:
        """All limits that bind the design."""
        return (*self.loop, *self.drive)

    @cached_property
    def whole_law(self) -> ParametrisedController:
        """The structure, bound to the plant, with all its parameters."""
        return self.structure.bind(self.plant)

    @cached_property
    def law(self) -> ParametrisedController:
        """The structure, bound to the plant, with the parameters that are not held."""
        if not self.held:
            return self.whole_law
        return Fixed(structure=self.structure, values=self.held).bind(self.plant)

    @property
    def amplifier(self) -> float | None:
        """The fixed gain A of the thesis's feedback; None for a structure without."""
        return _amplifier(self.structure, self.whole_law)

    @cached_property
    def problem(self) -> Problem:
        """The problem with all limits that bind."""
        return self.problem_with(self.limits)

    def problem_with(self, limits: Sequence[Limit]) -> Problem:
        """Return the problem with other limits."""
        return Problem(
            plant=self.plant,
            law=self.law,
            disturbances=disturbances(self.spectra, self.plant.independent_disturbances),
            minimise={PAYLOAD: 1.0},
            limits=tuple(limits),
            elements=self.elements,
        )

    def values(self, parameters: Mapping[str, float]) -> list[float]:
        """Return parameters by name as the law has them: with its own amplifier."""
        return _values(self.law, self.amplifier, parameters)

    def named(self, values: Sequence[float]) -> dict[str, float]:
        """Return the law's parameters by name, the amplifier A with them where there is one."""
        own = {} if self.amplifier is None else {"A": self.amplifier}
        return {**own, **self.law.named(values)}

    def controller(self, parameters: Mapping[str, float]) -> LinearController:
        """Return the controller of given parameters."""
        return self.law.controller(self.values(parameters))

    @property
    def drag(self) -> DragElement | None:
        """The quadratic drag to be linearised with the response, or None if C is given."""
        return next((e for e in self.elements if isinstance(e, DragElement)), None)

    @property
    def loss(self) -> LossElement | None:
        """The losses to be linearised with the response, if there are some."""
        return next((e for e in self.elements if isinstance(e, LossElement)), None)

    def equivalents(self, coefficients: Coefficients) -> tuple[float, float]:
        """Return linear drag [N s/m], the case's if it gives it, and friction [N m s/rad]."""
        known = list(coefficients)
        drag = float(self.case.payload.fixed_drag or 0.0) if self.drag is None else known.pop(0)
        return drag, float(sum(known))

    def coefficients_of(self, drag: float, friction: float) -> tuple[float, ...]:
        """Return the elements' coefficients that `equivalents` tells of."""
        return tuple(drag if e.lasting else friction for e in self.elements)

    def assess(
        self, parameters: Mapping[str, float], coefficients: Coefficients | None = None
    ) -> Assessment:
        """Return the closed loop of given parameters in numbers."""
        return self.problem.assess(self.values(parameters), coefficients)


def pose(
    case: Case,
    structure: str = "payload-feedback",
    masses: int | None = None,
    known: Sequence[DesignQuestion] = (),
    *,
    built_for: Case | None = None,
) -> DesignQuestion:
    """Return the question of a case and a structure.

    A structure that does not hear the payload cannot do anything about its slow drift with the
    ship: for it the limit on slow motion is reported only.

    `masses` along the rope are by default the case's, or a number that suits a quick loop.  What
    the question has in common with those of similar cases, `known`, is taken from there.  The
    structure, named as in `synth.structures.structure_names`, is built for the motor, the drum and
    the gains of the case, or of `built_for`.

    Raises InputError if there is no such structure, or the case lacks what a design needs, such as
    a sensor.
    """
    named = structure_aboard(structure, built_for or case)
    _warn_of_waves(case, named.measurements)
    data = PlantData.from_case(case)
    alike = [one for one in known if one.data == data and masses in (None, one.masses)]
    shaken = [one for one in known if _same_sea(case, one.case)]
    hook = shaken[0].hook if shaken else HookMotion.from_case(case)
    model = alike[0].model if alike else build_plant(data, masses)
    held = [one for one in shaken if one.data == data and one.case.payload == case.payload]
    if held:
        drag_before, rms_before = held[0].drag_before, held[0].payload_rms_before
    else:
        near = known[0].drag_before if known else 0.0
        drag_before, rms_before = uncompensated(case, data, hook, near)
    heard = drag_before, case.sensors, named.measurements
    plants = [
        one.plant
        for one in alike
        if (one.drag_before, one.case.sensors, one.structure.measurements) == heard
    ]
    plant = plants[0] if plants else loaded_plant(case, data, model, drag_before, heard[-1])
    elements = equivalent_elements(case, data, hook, plant, drag_before)
    loop = loop_limits(case, data, model.masses)
    slow = [lim for lim in loop if isinstance(lim, LowFrequency) and not named.hears_payload]
    drive = drive_limits(case, plant)
    enforced = case.limits.drive == "enforce"
    return DesignQuestion(
        case=case,
        structure=named,
        data=data,
        hook=hook,
        model=model,
        plant=plant,
        spectra=heard_spectra(case, hook, named.measurements),
        loop=tuple(limit for limit in loop if limit not in slow),
        drive=drive if enforced else (),
        reported=(*slow, *(() if enforced else drive)),
        elements=elements,
        drag_before=drag_before,
        payload_rms_before=rms_before,
    )


def loaded_plant(
    case: Case, data: PlantData, model: Plant, drag: float, measurements: Sequence[str]
) -> LinearPlant:
    """Return a model's linear plant with what is heard, and loads on a motor with losses."""
    linear = model.linearise(drag=drag)
    if _switching(linear) > 0.0:
        linear = with_loads(linear, data)
    sensed = with_sensors(linear, case.sensors, data.command_delay)
    return sensed.select(measurements=measurements)


def equivalent_elements(
    case: Case, data: PlantData, hook: HookMotion, plant: LinearPlant, drag: float
) -> tuple[Element, ...]:
    """Return what of a case's plant is linearised with the response: drag, and losses.

    The plant is the linear one, with loads on its motor where that has losses, and holds the linear
    drag [N s/m].
    """
    elements: list[Element] = []
    if case.payload.fixed_drag is None and data.quadratic_drag > 0.0:
        elements.append(DragElement(quadratic=data.quadratic_drag, reference=drag))
    if (torque := _switching(plant)) > 0.0:
        # A drum that hauls as the hook heaves.
        usual = float(hook.velocity.rms) * data.gear_ratio / data.drum_radius
        elements.append(LossElement(force=LOAD, torque=torque, usual=usual))
    return tuple(elements)


def _switching(plant: LinearPlant) -> float:
    """Return the losses at the motor that switch with its direction [N m]; zero for a trifle."""
    torque = plant.loss.get("motor.torque", 0.0)
    return torque if torque > _TRIFLE * abs(plant.static.get("motor.torque", 0.0)) else 0.0


def _warn_of_waves(case: Case, measurements: Sequence[str]) -> None:
    """Warn where the payload's displacement is heard so near the surface that waves press on it.

    A pressure gauge takes the pressure of the water for its depth.  Under a wave of number k that
    has a part of exp(-k d) of the surface's elevation at a depth d (Airy), 4 % at half a wave
    length: above that the gauge shows the wave beside the payload's motion, of which a design
    knows nothing.  The depth is at most the length of rope paid out.
    """
    period = case.sea.spectral_peak_period
    half = math.pi / float(wave_number(2.0 * math.pi / period))
    if "payload.displacement" in measurements and case.rope.length < half and not case.quiet:
        warnings.warn(
            f"{case.label}: sensors.payload: with {case.rope.length:g} m of rope the payload hangs "
            f"less deep than half the length of the waves at the peak, {half:.3g} m: a pressure "
            "gauge would show the waves as displacement, which the design leaves out",
            PhysicsWarning,
            stacklevel=2,
        )


def _same_sea(case: Case, other: Case) -> bool:
    """Return whether the hook moves alike in two cases: nothing but limits, sensors, rig differ."""
    apart = {"limits", "sensors", "winch", "motor", "rope", "payload", "gains", "name"}
    sections = set(type(case).model_fields) - apart
    return all(getattr(case, name) == getattr(other, name) for name in sections)


def controller_for(case: Case, structure: str, parameters: Mapping[str, float]) -> LinearController:
    """Return the controller of a structure's parameters on a case.

    Raises InputError if there is no such structure.
    """
    named = structure_named(structure, case)
    plant = sensed_plant(case, drag=case.payload.fixed_drag or 0.0)
    law = named.bind(plant.select(measurements=named.measurements))
    return law.controller(_values(law, _amplifier(named, law), parameters))


def _amplifier(
    structure: PayloadFeedback | WinchStructure | LowOrderFeedback, law: ParametrisedController
) -> float | None:
    if any(p.name in GAINS for p in law.parameters):
        return float(getattr(structure, "amplifier"))  # noqa: B009
    return None


def _values(
    law: ParametrisedController, amplifier: float | None, parameters: Mapping[str, float]
) -> list[float]:
    own = amplifier or 1.0
    scale = parameters.get("A", own) / own
    return [float(parameters[p.name]) * (scale if p.name in GAINS else 1.0) for p in law.parameters]


def heard_spectra(case: Case, hook: HookMotion, measurements: Sequence[str]) -> dict[str, Any]:
    """Return the spectra of what shakes a loop that hears some measurements, by disturbance."""
    heard = set(measurements)
    return {
        source: value if source in (HOOK, SET_POINT) else _sampled(value)
        for source, value in sensed_spectra(case, hook).items()
        if source in (HOOK, SET_POINT)
        or (source == "mru.error" and "mru.heave" in heard)
        or source.removesuffix("_noise") in heard
    }


def _sampled(spectrum: Any) -> SampledNoise:
    if isinstance(spectrum, UnitError):
        return SampledNoise(
            spectrum=spectrum,
            lowest=spectrum.lowest,
            splits=spectrum.splits,
            source=HOOK,
            shares=spectrum.coherent,
        )
    return SampledNoise(spectrum=getattr(spectrum, "density", spectrum))


@lru_cache(maxsize=16)
def with_masses(
    question: DesignQuestion, masses: int, like: DesignQuestion | None = None
) -> DesignQuestion:
    """Return the question on another number of rope masses, the same one if asked again.

    One on as many masses may be known that has the same plant.
    """
    if like is None:
        model, heard = build_plant(question.data, masses), question.structure.measurements
        plant = loaded_plant(question.case, question.data, model, question.drag_before, heard)
    else:
        model, plant = like.model, like.plant
    return replace(
        question,
        model=model,
        plant=plant,
        loop=tuple(_rescaled(lim, question.data, model.masses) for lim in question.loop),
    )


def _rescaled(limit: Limit, data: PlantData, masses: int) -> Limit:
    if isinstance(limit, RollOff):
        return replace(limit, above=modelled_bandwidth(data, masses))
    return limit
