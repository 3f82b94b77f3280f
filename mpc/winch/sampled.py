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

Where commands are late, x holds those on their way, over u_rest, the newest first; the oldest still
acts over a part of the sample, the next one over the rest.  The speed that a command reckons with
is then that at which it will arrive, as the motor alone would have it: d is the torque asked for
there, but for what rope and load do to the speed in the meantime.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import FloatArray, ReadOnlyArrays, check_range, read_only
from models.case import Case
from models.plant import (
    MEAN_LOSSES,
    MEASUREMENTS,
    LinearPlant,
    Plant,
    PlantData,
    build_plant,
    hermite_hold,
    late_hold,
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
    reckoned: FloatArray  #: Of the speed that a command reckons with [rad/s].
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

    @property
    def waiting(self) -> int:
        """Number of commands on their way, the last of the states."""
        return self.size - len(self.plant.states)

    def extra_drag(self, velocity: float) -> float:
        """Return the force of quadratic drag at a payload velocity [m/s] that A has not [N].

        A velocity at which the drag would exceed the weight is no estimate to rely on.
        """
        highest = math.sqrt(self.data.hung_weight / max(self.data.quadratic_drag, 1.0))
        velocity = min(max(velocity, -highest), highest)
        return (self.drag - self.data.quadratic_drag * abs(velocity)) * velocity

    def command(self, torque: float, speed: float) -> float:
        """Return the drive command for an input d [N m] at a reckoned speed [rad/s]."""
        return self.rest_command + self.back * speed + torque / self.gain

    def torque(self, command: float, speed: float) -> float:
        """Return the input d [N m] of a drive command at a reckoned speed [rad/s]."""
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
        If a number is out of its range.
    """
    T = check_range(_OWNER, "sample_time", sample_time, low=0.0, unit="s", open_low=True)
    coefficient = (case.payload.fixed_drag or 0.0) if drag is None else drag
    data = PlantData.from_case(case).viscous
    count = data.chosen_masses(masses)
    changed: dict[str, Any] = {k: v * getattr(data, k) for k, v in (off or {}).items()}
    data = replace(data, **changed)
    # Late commands are on their way in the state, and so in no measurement's delay.
    on_time = replace(data, command_delay=0.0)
    plant = sensed_plant(on_time, masses=count, drag=coefficient, sensors=case.sensors)
    symbolic = build_plant(data, count)
    rest, moved = symbolic.operating_point(MEAN_LOSSES), _moved(plant, symbolic)
    gain, back = command_law(symbolic)
    known = {name: k for k, name in enumerate(plant.disturbances)}
    hook = [known["hook.heave"], known["hook.heave_rate"]]
    rows = {name: k for k, name in enumerate(plant.outputs)}
    speed = plant.Cz[rows["motor.speed"]]
    # Command and constant forces are held over a sample, which is exact; the hook is not.
    held = np.column_stack([plant.B[:, 0], plant.E[:, known["payload.force"]]])
    A, inputs = zero_order_hold(plant.A, held, T)
    late = data.command_delay / T
    n, waiting = len(A), late_hold(late)[0]
    commands = by_command(plant, inputs[:, 0], T, T, late)
    own = np.zeros((n + waiting, n + waiting))
    own[:n, :n], own[:n, n:] = A, commands[:, 1:]
    own[n + 1 :, n:-1] = np.eye(max(waiting - 1, 0))
    given = np.concatenate([commands[:, 0], np.eye(waiting)[0] if waiting else ()])
    reckoned = _reckoned(plant, speed, T, late)

    def wide(part: FloatArray) -> FloatArray:
        """Return rows of the plant's state, or columns of its effect, with commands as well."""
        return np.pad(part, [(0, waiting), *[(0, 0)] * (part.ndim - 1)])

    # A rope goes slack first at its lower end, which does not carry its weight.
    tension, force = rows["rope.lower_tension"], known["payload.force"]
    return SampledWinch(
        case=case,
        data=data,
        plant=plant,
        # The command is held at u = back omega(start) + d / gain.
        A=own + back * np.outer(given, reckoned),
        B=given[:, None] / gain,
        from_hook=wide(hermite_hold(plant.A, plant.E[:, hook], T, T)[0]),
        from_constants=wide(np.column_stack([inputs[:, 1], inputs[:, 0] / gain])),
        payload=wide(plant.Cz[rows["payload.displacement"]]),
        velocity=wide(plant.Cz[rows["payload.velocity"]]),
        speed=wide(speed),
        reckoned=reckoned,
        tension=wide(plant.Cz[tension]),
        tension_from_hook=plant.Fz[tension, hook],
        tension_from_constants=np.array([plant.Fz[tension, force], 0.0]),
        force_felt=plant.F[: len(MEASUREMENTS), force],
        moved=np.vstack([moved, np.outer(np.full(waiting, back), speed @ moved)]),
        gain=gain,
        back=back,
        rest_command=rest.command,
        rest_torque=rest.torque,
        rest_tension=rest.tension,
        sample_time=T,
        masses=symbolic.masses,
        drag=coefficient,
    )


def by_command(
    plant: LinearPlant, held: FloatArray, t: float, sample_time: float, late: float
) -> FloatArray:
    """Return what a command does up to a time t [s] of a sample, the newest first, (n, 1 + m).

    Of a command that is held all the time it is (n,); m of them are on their way, each late by so
    many samples: the last of them acts first, the one before it next.
    """
    waiting, share = late_hold(late)
    columns = np.zeros((len(held), waiting + 1))
    columns[:, waiting] = held
    rest = t - share * sample_time
    if waiting and rest > 0.0:
        columns[:, waiting - 1] = zero_order_hold(plant.A, plant.B[:, :1], rest)[1][:, 0]
        columns[:, waiting] -= columns[:, waiting - 1]
    return columns


def _reckoned(plant: LinearPlant, speed: FloatArray, T: float, late: float) -> FloatArray:
    """Return the row of the motor's speed at which a command arrives, by the motor alone, (n + m).

    The hook moves on meanwhile, of which the state does not tell; and so a rope that is held at its
    top would tell less than no rope.
    """
    waiting, share = late_hold(late)
    names = plant.states
    own = [k for k, name in enumerate(names) if name.startswith("motor.") and "angle" not in name]
    rows = np.eye(len(speed) + waiting)[own]
    for k in range(waiting):  # the oldest first, which acts to its end
        A, B = plant.A[np.ix_(own, own)], plant.B[own, :1]
        over, held = zero_order_hold(A, B, (1.0 if k else share) * T)
        rows = over @ rows
        rows[:, len(rows[0]) - 1 - k] += held[:, 0]
    return np.asarray(speed[own] @ rows)


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
