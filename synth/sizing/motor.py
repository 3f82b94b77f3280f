r"""Family of motors: the case's own, larger or smaller, behind any gear.

    case, scale s, gear ratio n -> case

Geometrically similar machines with the same shear stress in the air gap: the torque grows with
the volume, T ~ l^3, the rotor's inertia with J ~ l^5, so J ~ T^(5/3) (dimensional analysis, as
Budinger, Liscouet, Hospital, Mare: "Estimation models for the preliminary design of
electromechanical actuators", Proc. IMechE G 226 (2012) 243-259, set up theirs).  Speeds and the
ratio of peak to continuous torque are kept, so the power goes with the torque.  The supply of a DC
motor keeps its voltage, hence K_T and K_omega: the current goes with the torque, resistance and
inductance against it (the same share of losses, the same electrical time constant).  Friction
goes with the torque, couplings and brake on the motor's shaft with the rotor, and the drive's own
speed regulator keeps its bandwidth on both.
"""

from __future__ import annotations

from dataclasses import dataclass

from models.basics import check_range
from models.case import Case
from models.rig import DCMotor

INERTIA_EXPONENT = 5.0 / 3.0  #: Of the rotor's inertia over the torque.

_DRIVE = ("torque_continuous", "torque_peak", "power", "current_continuous", "current_peak")


@dataclass(frozen=True, kw_only=True)
class MotorData:
    """A motor in the figures that one buys it by."""

    #: At the shaft [N m].
    torque_continuous: float
    torque_peak: float
    speed: float  #: Rated speed: base speed of an AC motor, highest speed of a DC motor [rad/s].
    power: float  #: Rated power, continuous torque times that speed [W].
    inertia: float  #: Of the rotor [kg m2].

    @classmethod
    def of(cls, case: Case) -> MotorData:
        """Return the motor of a case."""
        motor, drive = case.winch.motor, case.winch.drive
        speed = case.winch.speed_limit if isinstance(motor, DCMotor) else motor.base_speed
        return cls(
            torque_continuous=drive.torque_continuous,
            torque_peak=drive.torque_peak,
            speed=speed,
            power=drive.torque_continuous * speed,
            inertia=motor.inertia,
        )


def motor_changes(case: Case, scale: float) -> dict[str, float]:
    """Return the changes by dotted path that make a case's motor `scale` times as large, by torque.

    Raises InputError if the scale is not above 0.
    """
    check_range("motor", "scale", scale, low=0.0, open_low=True)
    motor, drive, box = case.winch.motor, case.winch.drive, case.winch.gearbox
    inertia = scale**INERTIA_EXPONENT
    changes = {
        "winch.motor.inertia": motor.inertia * inertia,
        "winch.motor.viscous_friction": motor.viscous_friction * scale,
        "winch.motor.coulomb_friction": motor.coulomb_friction * scale,
        "winch.gearbox.inertia": box.inertia * inertia,
    }
    if isinstance(motor, DCMotor):
        changes["winch.motor.resistance"] = motor.resistance / scale
        changes["winch.motor.inductance"] = motor.inductance / scale
    else:
        changes["winch.motor.speed_gain"] = motor.speed_gain * inertia
    for name in _DRIVE:
        value = getattr(drive, name)
        if value is not None:
            changes[f"winch.drive.{name}"] = value * scale
    return changes


def with_motor(case: Case, scale: float, gear: float) -> Case:
    """Return a case with its motor `scale` times as large behind a gear of ratio `gear`.

    See `motor_changes`; the ratio is in turns of the motor per turn of the drum.
    """
    return case.variant({**motor_changes(case, scale), "winch.gearbox.ratio": gear})
