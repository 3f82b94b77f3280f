"""The winch: drum, gearbox, motor and drive, as sections of the case file.

From the rope inwards: the rope's tension acts on the drum at the pitch radius of its topmost
layer, the gearbox divides the torque and loses a little, the motor makes it, the drive limits it.
Inertia and friction are summed at the motor's shaft, I = I_M + I_G + I_D/n^2 (1975 thesis,
section on the winch, eq. 14 to 19).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from ..casefile import Quantity, Section
from .drum import Drum


class Gearbox(Section):
    """The gear between motor and drum."""

    ratio: Annotated[float, Quantity("ratio", 0.1, 10000.0)]
    """Turns of the motor per turn of the drum."""
    efficiency: Annotated[float, Quantity("ratio", 0.1, 1.0)] = 1.0
    """Power out over power in, the same in both directions."""
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e6)] = 0.0
    """Moment of inertia of gears, couplings and brake at the motor's shaft."""


class DCMotor(Section):
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
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e6, open_low=True)]
    """Moment of inertia of the rotor."""
    viscous_friction: Annotated[float, Quantity("rotary damping", 0.0, 1e5)] = 0.0
    """Viscous friction of the drive train at the motor's shaft."""
    coulomb_friction: Annotated[float, Quantity("torque", 0.0, 1e6)] = 0.0
    """Dry friction of the drive train at the motor's shaft, the same at every speed; for the
    simulation only."""
    friction_speed: Annotated[float, Quantity("angular speed", 0.0, 1000.0, open_low=True)] = 1.0
    """Speed over which dry friction changes its sign, as tanh(speed/friction_speed)."""
    thermal_time_constant: Annotated[float, Quantity("time", 0.0, 1e6, open_low=True)] = 1800.0
    """Time constant of the motor's temperature (first order, driven by the torque squared)."""
    temperature_rise: Annotated[
        float, Quantity("temperature difference", 0.0, 1000.0, open_low=True)
    ] = 80.0
    """Temperature rise after hours at the continuous torque."""


class ACMotor(Section):
    """A vector-controlled alternating-current motor with its inverter.

    Torque constant one: its "current" is its torque [N m].  The command is a speed reference
    [rad/s] where `speed_gain` is above 0, else a torque [N m].
    """

    type: Literal["ac"]
    """`ac`: vector-controlled motor, commanded by a speed or a torque reference."""
    torque_bandwidth: Annotated[float, Quantity("frequency", 0.1, 1e4)]
    """Bandwidth of the inverter's torque loop (first order)."""
    inertia: Annotated[float, Quantity("inertia", 0.0, 1e6, open_low=True)]
    """Moment of inertia of the rotor (of all motors on the drum together)."""
    viscous_friction: Annotated[float, Quantity("rotary damping", 0.0, 1e5)] = 0.0
    """Viscous friction of the drive train at the motor's shaft."""
    speed_gain: Annotated[float, Quantity("rotary damping", 0.0, 1e7)] = 0.0
    """Gain of the drive's inner speed regulator: torque demand = speed_gain * (reference -
    speed); 0 leaves the drive in torque mode."""
    base_speed: Annotated[float, Quantity("angular speed", 0.0, 5000.0, open_low=True)]
    """Speed above which the torque falls as 1/speed (constant power)."""
    maximum_speed: Annotated[float, Quantity("angular speed", 0.0, 5000.0, open_low=True)]
    """Highest speed of the motor."""
    coulomb_friction: Annotated[float, Quantity("torque", 0.0, 1e6)] = 0.0
    """Dry friction of the drive train at the motor's shaft, the same at every speed; for the
    simulation only."""
    friction_speed: Annotated[float, Quantity("angular speed", 0.0, 1000.0, open_low=True)] = 1.0
    """Speed over which dry friction changes its sign, as tanh(speed/friction_speed)."""
    thermal_time_constant: Annotated[float, Quantity("time", 0.0, 1e6, open_low=True)] = 1800.0
    """Time constant of the motor's temperature (first order, driven by the torque squared)."""
    temperature_rise: Annotated[
        float, Quantity("temperature difference", 0.0, 1000.0, open_low=True)
    ] = 80.0
    """Temperature rise after hours at the continuous torque."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if self.maximum_speed < self.base_speed:
            text = (
                f"must be at least base_speed, {self.base_speed:g} rad/s, "
                f"got {self.maximum_speed:g} rad/s"
            )
            yield ("maximum_speed", text)


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
    def torque_constant(self) -> float:
        """Motor torque per current [N m/A]; one for an AC motor, whose current is its torque."""
        return self.motor.torque_constant if isinstance(self.motor, DCMotor) else 1.0
