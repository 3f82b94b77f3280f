r"""The sampled model of winch and rope, with the torque as its input: `SampledWinch`.

    x[k+1] = A x + B d + from_hook [z, z', z+, z+'] + from_constants c

The input d is not the drive's command but the torque that it asks for at the start of a sample,
over the one that holds the load.  The command is

    u = u_rest + back omega + d / gain,

where ``back omega`` is the back-EMF of a DC motor, or the speed itself for a drive with a speed
regulator.  So a limit on the torque is a bound on the input, and that on the voltage a line
through the state.  Over the sample the command is held, and the torque gives way to the speed as
it does in the drive.

Everything is a deviation from rest.  The hook moves along the cubic through its displacement and
velocity at both ends of a sample; the rest is exact.  Constants c are a force on the payload [N]
and a torque at the motor [N m].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, ReadOnlyArrays, check_range, read_only
from models.case import Case
from models.plant import (
    MEAN_LOSSES,
    MEASUREMENTS,
    LinearPlant,
    Plant,
    PlantData,
    build_plant,
    hermite_hold,
    zero_order_hold,
)
from models.sensing import sensed_plant

_OWNER = "predictive control"


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledWinch(ReadOnlyArrays):
    """Plant and sensors, sampled; `sampled_winch` makes it."""

    case: Case
    data: PlantData  #: Numbers of the plant.
    plant: LinearPlant  #: The linear plant of the case with all sensors, in continuous time.
    A: FloatArray  #: (n, n)
    B: FloatArray  #: (n, 1)
    from_hook: FloatArray  #: (n, 4)
    from_constants: FloatArray  #: (n, 2)
    payload: FloatArray  #: Row of the payload's displacement [m], of the state, (n,).
    velocity: FloatArray  #: Of its velocity [m/s].
    speed: FloatArray  #: Of the motor's speed [rad/s].
    tension: FloatArray  #: Of the tension at the payload [N].
    tension_from_hook: FloatArray  #: Shares of (z, z') in that tension, (2,).
    tension_from_constants: FloatArray  #: Shares of the constants in it, (2,).
    #: What the payload's sensors show at once of a force on it, per newton, (3,).
    force_felt: FloatArray
    #: State of a plant whose load is off by one metre, and of one that moves at one metre per
    #: second, drum and payload alike, (n, 2).
    moved: FloatArray
    gain: float  #: Torque per command.
    back: float  #: Command per speed.
    rest_command: float  #: What holds the load [unit of the command].
    rest_torque: float  #: [N m]
    rest_tension: float  #: [N]
    sample_time: float  #: T [s].
    masses: int  #: Masses along the rope.
    drag: float  #: Linear drag coefficient of the payload in A [N s/m].

    @property
    def dc(self) -> bool:
        """Whether the motor is a DC motor, whose command is a voltage."""
        return self.data.motor == "dc"

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.A)

    def extra_drag(self, velocity: float) -> float:
        """Return the force of quadratic drag at a payload velocity [m/s] that A has not [N].

        A velocity at which the drag would exceed the weight is no estimate to rely on.
        """
        highest = math.sqrt(self.data.hung_weight / max(self.data.quadratic_drag, 1.0))
        velocity = min(max(velocity, -highest), highest)
        return (self.drag - self.data.quadratic_drag * abs(velocity)) * velocity

    def command(self, torque: float, speed: float) -> float:
        """Return the drive command for an input d [N m] at a motor speed [rad/s]."""
        return self.rest_command + self.back * speed + torque / self.gain

    def torque(self, command: float, speed: float) -> float:
        """Return the input d [N m] of a drive command at a motor speed [rad/s]."""
        return (command - self.rest_command - self.back * speed) * self.gain

    def off(self, **factors: float) -> SampledWinch:
        """Return the winch of the same case with factors on numbers of the plant."""
        return sampled_winch(
            self.case, sample_time=self.sample_time, masses=self.masses, drag=self.drag, off=factors
        )

    @cached_property
    def steady(self) -> FloatArray:
        """Input that holds the payload in its place against each of the constants, (2,)."""
        return read_only(self._held[self.size])

    @cached_property
    def resting(self) -> FloatArray:
        """State in which it then rests, for each of the constants, (n, 2)."""
        return read_only(self._held[: self.size])

    @cached_property
    def _held(self) -> FloatArray:
        """State and input that hold the payload in its place against the constants, (n + 1, 2)."""
        n = self.size
        system = np.zeros((n + 1, n + 1))
        system[:n, :n] = self.A - np.eye(n)
        system[:n, n:] = self.B
        system[n, :n] = self.payload
        wanted = np.vstack([-self.from_constants, np.zeros((1, 2))])
        scale = np.abs(system).max(axis=1)
        solved = np.linalg.lstsq(system / scale[:, None], wanted / scale[:, None], rcond=None)[0]
        return np.asarray(solved)


def sampled_winch(
    case: Case,
    *,
    sample_time: float = 0.05,
    masses: int | None = None,
    drag: float | None = None,
    off: Mapping[str, float] | None = None,
) -> SampledWinch:
    """Return the sampled plant of a case.

    Its rope has Kelvin-Voigt damping, of the same ratio at the first mode where the case's is
    hysteretic: a prediction over seconds follows the first mode, and the branches of the other law
    would be several times as many states.

    Parameters
    ----------
    case
        The case.
    sample_time
        T [s].
    masses
        Masses along the rope; by default those of the case.
    drag
        Linear drag coefficient of the payload [N s/m]; by default that of the case if it gives
        one, else zero: a payload that is held still has next to no quadratic drag.
    off
        Factors on the plant's numbers (`models.plant.plant_data.PlantData`) by name, for a plant
        that is not what the case says: ``{"payload_mass": 1.3}``.

    Raises
    ------
    InputError
        If a number is out of its range, or commands or readings are late in a way that the
        prediction does not hold.
    """
    T = check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
    coefficient = (case.payload.fixed_drag or 0.0) if drag is None else drag
    _refuse(case)
    data = PlantData.from_case(case).viscous
    count = data.chosen_masses(masses)
    changed: dict[str, Any] = {k: v * getattr(data, k) for k, v in (off or {}).items()}
    data = replace(data, **changed)
    plant = sensed_plant(data, masses=count, drag=coefficient, sensors=case.sensors)
    symbolic = build_plant(data, count)
    rest = symbolic.operating_point(MEAN_LOSSES)
    gain, back = command_law(symbolic)
    known = {name: k for k, name in enumerate(plant.disturbances)}
    hook = [known["hook.heave"], known["hook.heave_rate"]]
    rows = {name: k for k, name in enumerate(plant.outputs)}
    speed = plant.Cz[rows["motor.speed"]]
    # Command and constant forces are held over a sample, which is exact; the hook is not.
    held = np.column_stack([plant.B[:, 0], plant.E[:, known["payload.force"]]])
    A, inputs = zero_order_hold(plant.A, held, T)
    # A rope goes slack first at its lower end, which does not carry its weight.
    tension, force = rows["rope.lower_tension"], known["payload.force"]
    return SampledWinch(
        case=case,
        data=data,
        plant=plant,
        # The command is held at u = back omega(start) + d / gain.
        A=A + back * np.outer(inputs[:, 0], speed),
        B=inputs[:, :1] / gain,
        from_hook=hermite_hold(plant.A, plant.E[:, hook], T, T)[0],
        from_constants=np.column_stack([inputs[:, 1], inputs[:, 0] / gain]),
        payload=plant.Cz[rows["payload.displacement"]],
        velocity=plant.Cz[rows["payload.velocity"]],
        speed=speed,
        tension=plant.Cz[tension],
        tension_from_hook=plant.Fz[tension, hook],
        tension_from_constants=np.array([plant.Fz[tension, force], 0.0]),
        force_felt=plant.F[: len(MEASUREMENTS), force],
        moved=_moved(plant, symbolic),
        gain=gain,
        back=back,
        rest_command=rest.command,
        rest_torque=rest.torque,
        rest_tension=rest.tension,
        sample_time=T,
        masses=symbolic.masses,
        drag=coefficient,
    )


def command_law(plant: Plant) -> tuple[float, float]:
    """Return the drive's torque per command, and the command per motor speed at constant torque."""
    data = plant.data
    if data.motor == "dc":
        return data.torque_constant / data.resistance, data.back_emf_constant
    return (data.speed_gain, 1.0) if data.speed_gain > 0.0 else (1.0, 0.0)


def _moved(plant: LinearPlant, symbolic: Plant) -> FloatArray:
    """Return the states of a load that is off by one metre, or moves by one metre per second.

    Rope, drum and sensors' filters move with it: such a shift is a solution of the plant's
    equations, a steady motion one but for friction and drag.
    """
    values = symbolic.parameters
    turns = values["winch.gear_ratio"] / values["winch.drum_radius"]
    moved = np.zeros((len(plant.states), 2))
    for k, name in enumerate(plant.states):
        part, signal = name.split(".")[0], name.rsplit(".", 1)[-1]
        if part not in ("motor", "rope", "payload", "sensor", "telemetry"):
            continue
        by = {"angle": (turns, 0.0), "speed": (0.0, turns)}
        by |= {"displacement": (1.0, 0.0), "velocity": (0.0, 1.0)}
        moved[k] = by.get(signal, (0.0, 0.0))
    return moved


def _refuse(case: Case) -> None:
    """Refuse what the prediction does not hold: late commands, held or later readings."""
    payload = case.sensors.payload
    late = {"winch.drive.command_delay": case.winch.drive.command_delay}
    for name in ("acceleration", "velocity", "displacement"):
        late[f"sensors.payload.{name}_rate"] = payload.rate(name) or 0.0
        late[f"sensors.payload.{name}_latency"] = payload.latency(name)
    for path, value in late.items():
        if value > 0.0:
            raise InputError(
                f"{case.label}: {path} must be left out for predictive control, whose prediction "
                f"does not hold it, got {value:g}"
            )
