r"""The drum-speed loop: from a speed that is wanted to a drive command.

::

    w_ref -+---------------------> feed ------------------+
           |                                              v
           +--(+)--> e --> Kp + Ki T/(z - 1) ----------->(+)<-- static command
               ^-               ^                         |
               |                +--- tracking <--(+)<-----+--> u asked --> drive
          motor speed                             ^- ... drive.applied (+)

Everything that commands a speed of the rope (velocity feed-forward, constant tension) does it
through this loop.  The motor obeys J w' = kappa (u - u_static) - D w - (change of the load's
torque), with

* DC motor: kappa = K_T/R, D = B + K_T K_omega/R, u in volts;
* AC motor with a speed regulator of gain G: kappa = G, D = B + G, u in rad/s;
* AC motor without: kappa = 1, D = B, u in N m.

The static command holds the load.  ``feed`` = D/kappa is what a steady speed costs: for a DC
motor its back-EMF and a little friction, for a regulated AC motor the reference itself.  Kp
makes the loop as fast as it is asked to be, J omega_b = D + kappa Kp; a regulated AC drive has
its own gain, and Kp is zero.  Ki makes it critically damped, kappa Ki = J omega_b^2/4
(overdamped where the motor of itself is faster than that), and takes away what the static
command got wrong, such as the gear's losses.

The bandwidth follows from what delays the loop: the command is held over T, the speed is a mean
over T, the torque builds up in 1/omega_T (or L/R), the command has a delay of its own.  omega_b
is a quarter of one over their sum, so that they take a quarter of a radian from the phase margin
at omega_b.  Motor speed and motor torque belong to the same shaft, hence the loop is passive
whatever hangs on the rope: rope modes do not limit it, delays do.

Anti-windup is by back-calculation (K. J. Astrom and T. Hagglund, PID Controllers, 2nd ed.,
chapter 3): what the drive did not follow is taken from the integral at a rate of omega_b/2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from models.basics import FloatArray, SynthesisError, check_range
from models.case import Case
from models.plant import MEAN_LOSSES, Plant, PlantData, build_plant
from models.sensing import Recursion

from .recursive import checked_sample_time, make_recursion
from .sampling import sampled_loop

_OWNER = "drum-speed loop"
_PHASE = 0.25  # what all delays together may take at omega_b [rad]
_MARGIN = 2.0  # gain margin that is checked [-]


@dataclass(frozen=True, kw_only=True)
class SteadyMotion:
    """The motor as the controllers see it: J w' = kappa (u - u_static) - D w."""

    inertia: float  #: J at the motor's shaft, the load not included [kg m2].
    torque_gain: float  #: kappa [N m per unit of the command].
    torque_constant: float  #: Torque of a DC motor per current [N m/A]; infinite for an AC motor.
    damping: float  #: D [N m s/rad].
    #: How much of the motor's speed the motor itself takes from the command: K_omega [V s/rad] of a
    #: DC motor, 1 of a regulated AC motor, 0.
    own_gain: float
    regulated: bool  #: Whether the drive has a speed regulator of its own: its command is a speed.
    lag: float  #: Time in which the torque builds up [s].
    command_delay: float  #: Delay of the command [s].
    per_rope_speed: float  #: Motor speed per speed of the rope, n/r [rad/m].

    @classmethod
    def of(cls, data: PlantData) -> SteadyMotion:
        """Return it for a plant's numbers."""
        regulated = data.motor == "ac" and data.speed_gain > 0.0
        if data.motor == "dc":
            gain, own, lag = (
                data.torque_constant / data.resistance,
                data.back_emf_constant,
                data.inductance / data.resistance,
            )
        else:
            gain, own = (data.speed_gain, 1.0) if regulated else (1.0, 0.0)
            lag = 0.0 if math.isinf(data.torque_bandwidth) else 1.0 / data.torque_bandwidth
        return cls(
            inertia=data.inertia,
            torque_gain=gain,
            torque_constant=data.torque_constant if data.motor == "dc" else math.inf,
            damping=data.viscous_friction + gain * own,
            own_gain=own,
            regulated=regulated,
            lag=lag,
            command_delay=data.command_delay,
            per_rope_speed=data.gear_ratio / data.drum_radius,
        )

    def widest(self, sample_time: float) -> float:
        """Return the bandwidth that sampling and the drive leave a drum loop room for [rad/s]."""
        return _PHASE / (sample_time + self.lag + self.command_delay)

    @property
    def feed(self) -> float:
        """Command per motor speed in steady motion, D/kappa."""
        return self.damping / self.torque_gain


@dataclass(frozen=True, kw_only=True, eq=False)
class DrumSpeedLoop:
    """The drum-speed loop of a case; `from_case` makes it."""

    motor: SteadyMotion  #: The motor's numbers.
    static: float  #: Command that holds the load.
    #: Kp [command s/rad], Ki [command/rad].
    proportional: float
    integral: float
    bandwidth: float  #: omega_b [rad/s].
    tracking: float  #: Rate at which the integral follows a drive that does not obey [1/s].
    speed_limit: float  #: Highest motor speed that is asked for [rad/s].
    sample_time: float  #: T [s].

    @classmethod
    def from_case(
        cls,
        case: Case,
        *,
        sample_time: float = 0.02,
        bandwidth: float | None = None,
        plant: Plant | None = None,
    ) -> DrumSpeedLoop:
        """Return the loop of a case, sampled every T [s].

        Its bandwidth omega_b [rad/s] is by default that which the delays in the loop allow; what
        the motor has of itself is not taken away.  `plant` is the case's, if it is there already.

        Raises
        ------
        InputError
            If the sample time or the bandwidth is out of its range.
        SynthesisError
            If the loop is not stable on the linear plant, or not with twice the gains.
        """
        checked_sample_time(_OWNER, sample_time)
        plant = build_plant(case) if plant is None else plant
        point, motor = plant.operating_point(MEAN_LOSSES), SteadyMotion.of(plant.data)
        wanted = motor.widest(sample_time)
        if bandwidth is not None:
            wanted = check_range(
                _OWNER, "bandwidth", bandwidth, low=0.0, unit="rad/s", open_low=True
            )
        own = motor.damping / motor.inertia
        extra = 0.0 if motor.regulated else max(0.0, wanted - own) * motor.inertia
        # The integral must not be faster than the delays allow, however fast the motor itself.
        reached = min(wanted, own) if motor.regulated else wanted
        loop = cls(
            motor=motor,
            static=point.command,
            proportional=extra / motor.torque_gain,
            integral=0.25 * motor.inertia * reached**2 / motor.torque_gain,
            bandwidth=own if motor.regulated else max(own, wanted),
            tracking=min(0.5 * reached, 1.0 / sample_time),
            speed_limit=case.winch.speed_limit,
            sample_time=float(sample_time),
        )
        loop._check(case, plant)
        return loop

    @property
    def initial(self) -> FloatArray:
        """State before the first sample: the integral, and the command asked for last."""
        return np.array([0.0, self.static])

    def command(
        self, state: ca.SX, rope_speed: ca.SX, measured: Mapping[str, ca.SX]
    ) -> tuple[ca.SX, ca.SX]:
        """Return (next state, command) for a wanted speed of the rope, symbols.

        The state is (2, 1), see `initial`.  The speed is that wanted at the drum, positive hauling
        in [m/s], and cut to what the motor can turn.  What is measured is by name.
        """
        wanted = self.motor.per_rope_speed * rope_speed
        wanted = ca.fmin(self.speed_limit, ca.fmax(-self.speed_limit, wanted))
        error = wanted - measured["motor.speed"]
        share = self.tracking * self.sample_time
        integral = state[0] + share * (measured["drive.applied"] - state[1])
        command = self.static + (self.motor.feed * wanted + self.proportional * error + integral)
        return ca.vertcat(integral + self.integral * self.sample_time * error, command), command

    def recursion(self) -> Recursion:
        """Return the loop alone, following ``reference.velocity`` as the speed of the rope."""
        return make_recursion(
            self.initial, lambda xc, m: self.command(xc, m["reference.velocity"], m)
        )

    def delay_at(self, omega: float) -> float:
        """Return by how much the speed is late at a frequency [rad/s], load constant [s].

        The half sample of hold that every command waits is included, and its own delay.
        """
        m, s = self.motor, 1j * omega
        torque = m.torque_gain / (1.0 + s * m.lag)
        # Only the command is held, and late.
        held = torque * np.exp(-s * (0.5 * self.sample_time + m.command_delay))
        friction = m.damping - m.torque_gain * m.own_gain
        regulated = held * (self.proportional + self.integral / s)
        forward = held * m.feed + regulated
        back = m.inertia * s + friction + torque * m.own_gain + regulated
        return float(-np.angle(forward / back) / omega)

    def _check(self, case: Case, plant: Plant) -> None:
        for more in (1.0, _MARGIN):
            louder = replace(
                self, proportional=more * self.proportional, integral=more * self.integral
            )
            loop = sampled_loop(case, plant, louder.recursion(), self.sample_time)
            if not loop.stable:
                largest = float(np.abs(loop.poles()).max())
                twice = "" if more == 1.0 else f"{more:g} times the gains of "
                raise SynthesisError(
                    f"{_OWNER}: with {twice}a bandwidth of {self.bandwidth:.3g} rad/s at a sample "
                    f"time of {self.sample_time:g} s the loop is unstable on the linear plant "
                    f"(largest eigenvalue {largest:.6g}); ask for a lower bandwidth or a shorter "
                    "sample time"
                )
