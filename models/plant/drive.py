"""Motor and drive in CasADi symbols: the torque that a command makes, within their limits.

    command --> [ voltage ] --> [ window of torque: peak, current, power, overspeed ] --> torque

The linear plant of the synthesis is made without limits; the simulation and nonlinear
prediction are made with them.  Every limit stands where the physics has it:

* the armature voltage is cut to what the supply has;
* torque and current are held inside a window.  Above the base speed the window narrows as
  1/speed (constant power) and, of an induction motor, as 1/speed^2 where its breakdown torque is
  the less (Leonhard, Control of Electrical Drives, 2001), and near the highest speed the side
  that would speed the motor up closes, so that an overspeeding motor is braked (a droop over 2 %
  of the speed);
* with an armature inductance the drive keeps the current inside by cutting the voltage to
  E = K_omega omega + R i_limit, from which a first-order current cannot overshoot;
* with a torque loop of finite bandwidth the demand is cut, and the torque follows it.

`models.plant.equations` puts this into the plant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, check_range

if TYPE_CHECKING:
    from ..case import Case
    from .plant_data import PlantData

SPEED_BAND = 0.02  # of the highest speed, over which the driving torque closes [-]

_UNITS = {
    "torque": "N m",
    "current": "A",
    "voltage": "V",
    "speed": "rad/s",
    "power": "W",
    "breakdown": "N m rad2/s2",
}


@dataclass(frozen=True, kw_only=True)
class DriveLimits:
    """Limits of motor and inverter at the motor's shaft or terminals; infinite where none.

    Raises InputError if a limit is not above zero.
    """

    torque: float = math.inf  #: Highest torque [N m].
    current: float = math.inf  #: Highest armature current of a DC motor [A].
    voltage: float = math.inf  #: Highest armature voltage of a DC motor [V].
    speed: float = math.inf  #: Highest speed [rad/s].
    power: float = math.inf  #: Highest shaft power, motoring or braking [W].
    breakdown: float = math.inf  #: Breakdown torque times speed squared [N m rad2/s2].

    def __post_init__(self) -> None:
        for name, unit in _UNITS.items():
            value = getattr(self, name)
            if value != math.inf:
                check_range("drive limits", name, value, low=0.0, unit=unit, open_low=True)

    @classmethod
    def from_case(cls, case: Case) -> DriveLimits:
        """Return the peak limits of a case's drive."""
        drive = case.winch.drive
        return cls(
            torque=drive.torque_peak,
            current=math.inf if drive.current_peak is None else drive.current_peak,
            voltage=math.inf if drive.voltage is None else drive.voltage,
            speed=case.winch.speed_limit,
            power=case.winch.power_limit,
            breakdown=case.winch.breakdown_limit,
        )

    def top(self, speed: npt.ArrayLike, peak: float) -> FloatArray:
        """Return the highest torque at motor speeds [rad/s], at most `peak` [N m]."""
        fast = np.maximum(np.abs(speed), 1e-9)
        return np.minimum(peak, np.minimum(self.power / fast, self.breakdown / (fast * fast)))

    @property
    def parameters(self) -> dict[str, float]:
        """The finite limits, by the names that they have among the plant's parameters."""
        values = {f"drive.{f.name}_limit": float(getattr(self, f.name)) for f in fields(self)}
        return {name: value for name, value in values.items() if value != math.inf}


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorEquations:
    """What the motor gives to the plant's equations."""

    #: Motor torque [N m] and armature current [A] (an AC motor's is its torque).
    torque: ca.SX
    current: ca.SX
    #: Derivative of the motor's own state, if it has one, by the state's name.
    derivative: Mapping[str, ca.SX]
    #: The command that would have given the same without any limit [unit of the command].
    applied: ca.SX


def motor_equations(
    data: PlantData, p: Mapping[str, ca.SX], x: Mapping[str, ca.SX], command: ca.SX
) -> MotorEquations:
    """Return torque, current, derivative and the command applied, limits included.

    Parameters and states are by name; limits are those parameters that exist.  The command is an
    armature voltage [V], a speed reference [rad/s] or a torque [N m].
    """
    speed = x["motor.speed"]
    window = _torque_window(p, speed)
    if data.motor == "dc":
        back = p["motor.back_emf_constant"] * speed
        constant, resistance = p["motor.torque_constant"], p["motor.resistance"]
        voltage = command
        if "drive.voltage_limit" in p:
            voltage = _clip(voltage, -p["drive.voltage_limit"], p["drive.voltage_limit"])
        wanted = (voltage - back) / resistance
        steady = wanted if window is None else _clip(wanted, *(end / constant for end in window))
        applied = command if voltage is command and window is None else back + resistance * steady
        if data.inductance > 0.0:
            current = x["motor.current"]
            rate = (applied - back - resistance * current) / p["motor.inductance"]
            derivative = {"motor.current": rate}
        else:
            current, derivative = steady, {}
        return MotorEquations(
            torque=constant * current, current=current, derivative=derivative, applied=applied
        )
    regulated = data.speed_gain > 0.0
    demand = p["motor.speed_gain"] * (command - speed) if regulated else command
    applied = command
    if window is not None:
        demand = _clip(demand, *window)
        applied = speed + demand / p["motor.speed_gain"] if regulated else demand
    if math.isinf(data.torque_bandwidth):
        return MotorEquations(torque=demand, current=demand, derivative={}, applied=applied)
    torque = x["motor.torque"]
    derivative = {"motor.torque": p["motor.torque_bandwidth"] * (demand - torque)}
    return MotorEquations(torque=torque, current=torque, derivative=derivative, applied=applied)


def _torque_window(p: Mapping[str, ca.SX], speed: ca.SX) -> tuple[ca.SX, ca.SX] | None:
    """Return the lowest and the highest torque at a speed, None without a torque limit."""
    ends = []
    if "drive.torque_limit" in p:
        ends.append(p["drive.torque_limit"])
    if "drive.current_limit" in p:
        ends.append(p["motor.torque_constant"] * p["drive.current_limit"])
    if not ends:
        return None
    peak = ends[0] if len(ends) == 1 else ca.fmin(*ends)
    if "drive.power_limit" in p:
        # min(peak, power/|speed|), written so that nothing divides by a speed of zero
        power = p["drive.power_limit"]
        peak = power / ca.fmax(ca.fabs(speed), power / peak)
    if "drive.breakdown_limit" in p:
        breakdown = p["drive.breakdown_limit"]
        peak = breakdown / ca.fmax(speed * speed, breakdown / peak)
    if "drive.speed_limit" not in p:
        return -peak, peak
    top = p["drive.speed_limit"]
    slope = peak / (SPEED_BAND * top)
    return -_clip(slope * (top + speed), -peak, peak), _clip(slope * (top - speed), -peak, peak)


def _clip(value: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    return ca.fmax(low, ca.fmin(high, value))
