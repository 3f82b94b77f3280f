"""The winch: drum, gearbox, motor and drive, as sections of the case file.

From the rope inwards: the rope's tension acts on the drum at the pitch radius of its topmost
layer, the gearbox divides the torque and loses a little, the motor makes it, the drive limits it.
Inertia and friction are summed at the motor's shaft, I = I_M + I_G + I_D/n^2 (1975 thesis,
section on the winch, eq. 14 to 19).

Rope lies on the drum in layers.  The more is paid out, the fewer layers are left and the smaller
is the radius at which the rope pulls; the motor's torque and speed hang on it.  The layers come
from a table (pitch diameter, and rope on the drum up to that layer) or from the drum's geometry;
a fixed `radius` overrides both.
"""

import itertools
import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from ..basics import InputError
from ..casefile import Quantity, Section
from .tables import DRUM_LAYERS


class Gearbox(Section):
    """The gear between motor and drum."""

    ratio: Annotated[float, Quantity("ratio", 0.1, 10000.0)]
    """Turns of the motor per turn of the drum."""
    efficiency: Annotated[float, Quantity("ratio", 0.1, 1.0)] = 1.0
    """Power out over power in, the same in both directions."""
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e6)] = 0.0
    """Moment of inertia of gears, couplings and brake at the motor's shaft."""


class _Motor(Section):
    """What every motor has."""

    inertia: Annotated[float, Quantity("inertia", 1e-6, 1e6)]
    """Moment of inertia of the rotor (of all motors on the drum together)."""
    viscous_friction: Annotated[float, Quantity("rotary damping", 0.0, 1e5)] = 0.0
    """Viscous friction of the drive train at the motor's shaft."""
    coulomb_friction: Annotated[float, Quantity("torque", 0.0, 1e6)] = 0.0
    """Dry friction of the drive train at the motor's shaft, the same at every speed; a loss in the
    limits, and in the simulation."""
    friction_speed: Annotated[float, Quantity("angular speed", 0.0, 1000.0, open_low=True)] = 1.0
    """Speed over which dry friction changes its sign, as tanh(speed/friction_speed)."""
    thermal_time_constant: Annotated[float, Quantity("time", 1.0, 1e6)] = 1800.0
    """Time constant of the motor's temperature (first order, driven by the torque squared)."""
    temperature_rise: Annotated[
        float, Quantity("temperature difference", 0.0, 1000.0, open_low=True)
    ] = 80.0
    """Temperature rise after hours at the continuous torque."""


class DCMotor(_Motor):
    """A separately excited direct-current motor; the command is its armature voltage [V]."""

    type: Literal["dc"]
    """`dc`: direct-current motor, commanded by its armature voltage."""
    resistance: Annotated[float, Quantity("resistance", 0.0, 1000.0, open_low=True)]
    """Armature resistance R, with that of the supply."""
    torque_constant: Annotated[float, Quantity("torque constant", 0.0, 1000.0, open_low=True)]
    """Torque per current, K_T."""
    back_emf_constant: Annotated[float, Quantity("back-EMF constant", 0.0, 1000.0)]
    """Voltage per speed, K_omega."""
    inductance: Annotated[float, Quantity("inductance", 0.0, 10.0)] = 0.0
    """Armature inductance L; 0 neglects it."""


class ACMotor(_Motor):
    """A vector-controlled alternating-current motor with its inverter.

    Torque constant one: its "current" is its torque [N m].  The command is a speed reference
    [rad/s] where `speed_gain` is above 0, else a torque [N m].
    """

    type: Literal["ac"]
    """`ac`: vector-controlled motor, commanded by a speed or a torque reference."""
    torque_bandwidth: Annotated[float, Quantity("frequency", 0.1, 1e4)]
    """Bandwidth of the inverter's torque loop (first order)."""
    speed_gain: Annotated[float, Quantity("rotary damping", 0.0, 1e7)] = 0.0
    """Gain of the drive's inner speed regulator: torque demand = speed_gain * (reference -
    speed); 0 leaves the drive in torque mode."""
    base_speed: Annotated[float, Quantity("angular speed", 0.0, 5000.0, open_low=True)]
    """Speed above which the torque falls as 1/speed (constant power)."""
    maximum_speed: Annotated[float, Quantity("angular speed", 0.0, 5000.0, open_low=True)]
    """Highest speed of the motor."""
    kind: Literal["induction", "permanent-magnet"] | None = None
    """What limits the motor above its base speed besides constant power. `induction`: the breakdown
    torque, 2.5 times the continuous torque at the base speed and falling as 1/speed^2.
    `permanent-magnet`: nothing. Of both the continuous torque falls as 1/speed. Not given: nothing,
    and the continuous torque is that of every speed."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.maximum_speed < self.base_speed:
            text = (
                f"must be at least base_speed, {self.base_speed:g} rad/s, "
                f"got {self.maximum_speed:g} rad/s"
            )
            yield ("maximum_speed", text)


BREAKDOWN = 2.5
"""Breakdown torque of an induction motor over its continuous torque, at the base speed."""

Motor = Annotated[DCMotor | ACMotor, Field(discriminator="type")]


class Drive(Section):
    """Limits of motor and inverter, all at the motor's shaft or terminals."""

    torque_continuous: Annotated[float, Quantity("torque", 0.0, 1e8, open_low=True)]
    """Torque that the motor holds for hours (rms)."""
    torque_peak: Annotated[float, Quantity("torque", 0.0, 1e9, open_low=True)]
    """Highest torque for some seconds."""
    speed: Annotated[float, Quantity("angular speed", 0.0, 5000.0, open_low=True)] | None = None
    """Highest speed; by default `maximum_speed` of an AC motor. A DC motor needs it."""
    voltage: Annotated[float, Quantity("voltage", 0.0, 1e5, open_low=True)] | None = None
    """Highest armature voltage of a DC motor."""
    current_continuous: Annotated[float, Quantity("current", 0.0, 1e6, open_low=True)] | None = None
    """Armature current that a DC motor holds for hours (rms)."""
    current_peak: Annotated[float, Quantity("current", 0.0, 1e6, open_low=True)] | None = None
    """Highest armature current of a DC motor for some seconds."""
    power: Annotated[float, Quantity("power", 0.0, 1e9, open_low=True)] | None = None
    """Highest shaft power; by default peak torque times base speed of an AC motor, and none
    for a DC motor."""
    command_delay: Annotated[float, Quantity("time", 0.0, 10.0)] = 0.0
    """Delay from the controller's command to the drive that follows it, besides the delays of
    what it hears."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.torque_peak < self.torque_continuous:
            text = (
                f"must be at least torque_continuous, {self.torque_continuous:g} N m, "
                f"got {self.torque_peak:g} N m"
            )
            yield ("torque_peak", text)
        peak, continuous = self.current_peak, self.current_continuous
        if peak is not None and continuous is not None and peak < continuous:
            text = f"must be at least current_continuous, {continuous:g} A, got {peak:g} A"
            yield ("current_peak", text)


class Brake(Section):
    """The holding brake at the motor's shaft."""

    torque: Annotated[float, Quantity("torque", 0.0, 1e9, open_low=True)] | None = None
    """Torque at which the closed brake slips; by default it holds whatever comes."""
    closing_time: Annotated[float, Quantity("time", 0.0, 60.0)] = 0.3
    """Time from the order to close until the brake holds."""


class DrumLayer(Section):
    """One layer of rope on the drum."""

    pitch_diameter: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Diameter of the circle on which the rope's centre lies in this layer."""
    rope_on_drum: Annotated[float, Quantity("length", 0.1, 50000.0)]
    """Rope on the drum when it is full up to this layer (cumulative)."""


class DrumGeometry(Section):
    """A drum by its dimensions."""

    core_diameter: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Diameter of the bare drum."""
    width: Annotated[float, Quantity("length", 0.05, 50.0)]
    """Width between the flanges."""
    layers: Annotated[int, Quantity("count", 1, 60)]
    """Number of layers that fit under the flanges."""
    wraps: Annotated[int, Quantity("count", 1, 1000)] | None = None
    """Wraps in a layer; by default as many rope diameters as fit in the width."""
    layer_step: Annotated[float, Quantity("ratio", 0.5, 1.0)] = math.sqrt(3.0) / 2.0
    """Height of a layer over the rope's diameter; by default that of rope nested in the
    grooves of the layer below, sin 60 deg."""

    def table(self, rope_diameter: float) -> tuple[DrumLayer, ...]:
        """Return the layers for a rope diameter [m], from the bare drum outwards.

        Raises InputError if the rope is wider than the drum.
        """
        wraps = self.wraps or math.floor(self.width / rope_diameter * (1.0 + 1e-12))
        if wraps < 1:
            raise InputError(
                f"width must be at least the rope's diameter, {rope_diameter:g} m, "
                f"got {self.width:g} m"
            )
        layers, length = [], 0.0
        for i in range(self.layers):
            pitch = self.core_diameter + (1.0 + 2.0 * i * self.layer_step) * rope_diameter
            length += math.pi * pitch * wraps
            layers.append(DrumLayer(pitch_diameter=pitch, rope_on_drum=length))
        return tuple(layers)


def _named_layers(value: Any) -> Any:
    """Replace the name of a table by its layers."""
    if not isinstance(value, str):
        return value
    if value not in DRUM_LAYERS:
        raise InputError(
            f"must be a list of layers or one of {', '.join(map(repr, DRUM_LAYERS))}, got {value!r}"
        )
    return [
        {"pitch_diameter": pitch, "rope_on_drum": length} for pitch, length in DRUM_LAYERS[value]
    ]


_Layers = Annotated[
    tuple[DrumLayer, ...],
    Field(min_length=1),
    BeforeValidator(_named_layers, json_schema_input_type=str | tuple[DrumLayer, ...]),
]


class Drum(Section):
    """The drum and the rope on it."""

    alternatives = (("layers", "geometry"),)

    radius: Annotated[float, Quantity("length", 0.02, 25.0)] | None = None
    """Radius from the drum's axis to the rope's centre; overrides layers and geometry."""
    layers: _Layers | None = None
    """Layers of rope from the bare drum outwards, or the name of a table:
    `american-hoist-1000` (1975 thesis, Table 6)."""
    geometry: DrumGeometry | None = None
    """The drum's dimensions, from which the layers are computed."""
    rope_on_drum_total: Annotated[float, Quantity("length", 1.0, 50000.0)] | None = None
    """Rope on the drum when none is paid out; by default as much as the layers hold."""
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e9)] = 0.0
    """Moment of inertia of the drum with the rope on it, about the drum's axis."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.layers is not None and self.geometry is not None:
            yield ("", "give either layers or geometry, got both")
        elif self.radius is None and self.layers is None and self.geometry is None:
            yield ("", "give one of radius, layers and geometry, got none")
        if self.layers is not None:
            for name in ("pitch_diameter", "rope_on_drum"):
                values = [getattr(layer, name) for layer in self.layers]
                for i, (inner, outer) in enumerate(itertools.pairwise(values), 1):
                    if outer <= inner:
                        text = f"must grow from layer to layer, got {inner:g} m then {outer:g} m"
                        yield (f"layers.{i}.{name}", text)

    def radius_at(self, paid_out: float, rope_diameter: float) -> float:
        """Return the pitch radius [m] with a length of rope paid out [m].

        It is that from the drum's axis to the centre of the rope's topmost layer.  The rope's
        nominal diameter [m] matters for a drum given by its geometry.

        Raises InputError if more rope is paid out than the drum has, or more is on it than its
        layers hold.
        """
        if self.radius is not None:
            return self.radius
        lays, total = self.lays(rope_diameter), self.total(rope_diameter)
        if paid_out > total:
            raise InputError(
                f"the drum holds {total:.4g} m of rope, less than the {paid_out:g} m paid out"
            )
        return next((radius for start, radius in lays if paid_out >= start), lays[-1][1])

    def total(self, rope_diameter: float) -> float:
        """Return the rope on the drum when none is paid out [m]; infinite where not known."""
        if self.rope_on_drum_total is not None:
            return self.rope_on_drum_total
        layers = self._table(rope_diameter)
        return layers[-1].rope_on_drum if layers else math.inf

    def lays(self, rope_diameter: float) -> tuple[tuple[float, float], ...]:
        """Return (rope paid out from which a radius holds, that radius) [m], innermost first.

        The innermost layer holds from there to the end of the rope, every other one to the
        start of the one before it.

        Raises InputError if more rope is on the drum than its layers hold.
        """
        if self.radius is not None:
            return ((0.0, self.radius),)
        layers, total = self._table(rope_diameter), self.total(rope_diameter)
        capacity = layers[-1].rope_on_drum
        if total > capacity * (1.0 + 1e-9):
            raise InputError(
                f"rope_on_drum_total must be at most what {len(layers)} layers hold, "
                f"{capacity:.4g} m, got {total:g} m"
            )
        return tuple((total - layer.rope_on_drum, layer.pitch_diameter / 2.0) for layer in layers)

    def _table(self, rope_diameter: float) -> tuple[DrumLayer, ...]:
        return self.layers or (self.geometry.table(rope_diameter) if self.geometry else ())


class Winch(Section):
    """Drum, gearbox, motor and drive."""

    drum: Drum
    """Radius of the drum with its layers of rope, and its inertia."""
    gearbox: Gearbox
    """The gear between motor and drum."""
    motor: Motor
    """The motor: `type: dc` or `type: ac`."""
    drive: Drive
    """Limits of motor and inverter."""
    brake: Brake | None = None
    """The holding brake; by default one that holds whatever comes."""
    losses: Literal["switching", "hauling"] = "switching"
    """How losses of gear and dry friction count in the limits of the drive: `switching`, to either
    side of their mean; `hauling`, as if the load were always hauled in and without dry friction,
    as in designs made before there was a choice."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        motor, drive = self.motor, self.drive
        if isinstance(motor, DCMotor):
            if drive.speed is None:
                yield ("drive.speed", "is missing: a DC motor needs its highest speed")
        else:
            if drive.speed is not None and drive.speed > motor.maximum_speed:
                text = (
                    f"must be at most the motor's maximum_speed, {motor.maximum_speed:g} rad/s, "
                    f"got {drive.speed:g} rad/s"
                )
                yield ("drive.speed", text)
            for name in ("voltage", "current_continuous", "current_peak"):
                if getattr(drive, name) is not None:
                    yield (f"drive.{name}", "is for a DC motor only; an AC motor has none")

    @property
    def inertia(self) -> float:
        """Moment of inertia at the motor's shaft, I = I_M + I_G + I_D/n^2 [kg m2]."""
        n = self.gearbox.ratio
        return self.motor.inertia + self.gearbox.inertia + self.drum.inertia / n**2

    @property
    def viscous_friction(self) -> float:
        """Viscous friction B at the motor's shaft [N m s/rad]."""
        return self.motor.viscous_friction

    @property
    def speed_limit(self) -> float:
        """Highest speed of the motor [rad/s]."""
        if self.drive.speed is not None:
            return self.drive.speed
        return self.motor.maximum_speed if isinstance(self.motor, ACMotor) else math.inf

    @property
    def power_limit(self) -> float:
        """Highest shaft power [W]; infinite for a DC motor without a stated one."""
        if self.drive.power is not None:
            return self.drive.power
        if isinstance(self.motor, ACMotor):
            return self.drive.torque_peak * self.motor.base_speed
        return math.inf

    @property
    def breakdown_limit(self) -> float:
        """Breakdown torque times speed squared [N m rad2/s2]; infinite but for induction motors."""
        if isinstance(self.motor, ACMotor) and self.motor.kind == "induction":
            return BREAKDOWN * self.drive.torque_continuous * self.motor.base_speed**2
        return math.inf

    @property
    def cooled_speed(self) -> float:
        """Speed above which the continuous torque falls as 1/speed [rad/s]; infinite for none."""
        if isinstance(self.motor, ACMotor) and self.motor.kind is not None:
            return self.motor.base_speed
        return math.inf

    @property
    def torque_constant(self) -> float:
        """Motor torque per current [N m/A]; one for an AC motor, whose current is its torque."""
        return self.motor.torque_constant if isinstance(self.motor, DCMotor) else 1.0
