"""The plant's equations of motion, written once in CasADi symbols.

From the drum down: motor, gear and drum; the rope as springs with masses between them; the
payload with its drag; the sensors' low-pass filters.  `models.plant` describes signs and
coordinates, wraps these functions and linearises them; nothing else should need this file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from .plant_data import PlantData
    from .rope import RopeLumps

__all__ = [
    "DISTURBANCES",
    "INPUTS",
    "MEASUREMENTS",
    "RATES",
    "Equations",
    "build_equations",
    "displacement_names",
]

INPUTS = ("drive.command",)
DISTURBANCES = ("hook.heave", "hook.heave_rate", "payload.force", "drive.set_point")
MEASUREMENTS = ("payload.acceleration", "payload.velocity", "payload.displacement")
RATES = {"hook.heave_rate": "hook.heave"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """Symbolic functions of the plant, and the names of what goes in and out.

    Parameters
    ----------
    states, outputs
        Names of the entries of x and z.
    parameters
        Names and values of the entries of p.
    function
        (x, u, w, p) -> (xdot, y, z).
    jacobians
        (x, u, w, p) -> (A, B, E, C, D, F, Cz, Dz, Fz).
    units
        Unit of each signal by name.
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: Mapping[str, float]
    function: ca.Function
    jacobians: ca.Function
    units: Mapping[str, str]


def build_equations(data: PlantData, lumps: RopeLumps) -> Equations:
    """Return the equations for a lumping of the rope; the data decide which states exist."""
    n = len(lumps.masses)
    parameters = _parameter_values(data)
    symbols = ca.SX.sym("p", len(parameters))
    p = {name: symbols[i] for i, name in enumerate(parameters)}

    states = _state_names(data, n)
    x = ca.SX.sym("x", len(states))
    x_of = {name: x[i] for i, name in enumerate(states)}
    u = ca.SX.sym("u", len(INPUTS))
    w = ca.SX.sym("w", len(DISTURBANCES))
    heave, heave_rate, force, set_point = ca.vertsplit(w)

    speed = x_of["motor.speed"]
    r_over_n = p["winch.drum_radius"] / p["winch.gear_ratio"]
    haul, haul_rate = r_over_n * x_of["motor.angle"], r_over_n * speed
    command = u[0] + set_point
    xdot: dict[str, ca.SX] = {"motor.angle": speed}

    # Rope: position and velocity of the upper end, then of every mass.
    position = [haul + heave, *(x_of[name] for name in displacement_names(n))]
    velocity = [haul_rate + heave_rate, *(x_of[name] for name in _velocities(n))]
    hanging = _hanging_weights(lumps, p)
    tension = []
    for j in range(n):
        k = p["rope.axial_stiffness"] / (p["rope.length"] * lumps.springs[j])
        stretch = position[j] - position[j + 1]
        rate = velocity[j] - velocity[j + 1]
        whole = hanging[j] + k * (stretch + p["rope.damping_time"] * rate)
        tension.append(ca.fmax(0, whole))
    top = tension[0] + p["rope.submerged_weight_per_length"] * p["rope.length"] * lumps.at_drum
    acceleration = ca.SX(0)
    for j, (shift, move) in enumerate(zip(displacement_names(n), _velocities(n), strict=True)):
        share = p["rope.length"] * lumps.masses[j]
        weight = p["rope.submerged_weight_per_length"] * share
        mass = p["rope.mass_per_length"] * share
        below = tension[j + 1] if j + 1 < n else ca.SX(0)
        other = ca.SX(0)
        if j + 1 == n:
            v = velocity[-1]
            mass += p["payload.virtual_mass"]
            weight += p["payload.submerged_weight"]
            drag = p["payload.quadratic_drag"] * ca.fabs(v) * v + p["payload.linear_drag"] * v
            other = force - drag
        acceleration = (tension[j] - below - weight + other) / mass
        xdot[shift] = velocity[j + 1]
        xdot[move] = acceleration

    torque, current, motor_dot = _motor(data, p, x_of, command)
    xdot |= motor_dot
    direction = p["winch.gear_direction"] + ca.tanh(p["winch.gear_switching"] * speed)
    eta = p["winch.gear_efficiency"]
    gear = 0.5 * ((1 + direction) / eta + (1 - direction) * eta)
    xdot["motor.speed"] = (
        torque - p["winch.viscous_friction"] * speed - gear * r_over_n * top
    ) / p["winch.inertia"]

    measured = (acceleration, velocity[-1], position[-1])
    for stage in ("sensor", "telemetry"):
        if f"{stage}.bandwidth" in p:
            measured, filter_dot = _butterworth(stage, p[f"{stage}.bandwidth"], x_of, measured)
            xdot |= filter_dot

    z = {
        "payload.displacement": position[-1],
        "payload.velocity": velocity[-1],
        "payload.acceleration": acceleration,
        "drum.haul": haul,
        "motor.torque": torque,
        "motor.speed": speed,
        "motor.current": current,
        "rope.tension": top,
    }
    if data.motor == "dc":
        z["motor.voltage"] = command
    y_out, z_out = ca.vertcat(*measured), ca.vertcat(*z.values())
    rhs = ca.vertcat(*(xdot[name] for name in states))
    arguments = [x, u, w, symbols]
    derivatives = [ca.jacobian(f, v) for f in (rhs, y_out, z_out) for v in (x, u, w)]
    signatures = ["x", "u", "w", "p"], ["xdot", "y", "z"]
    return Equations(
        states=states,
        outputs=tuple(z),
        parameters=parameters,
        function=ca.Function("plant", arguments, [rhs, y_out, z_out], *signatures),
        jacobians=ca.Function("plant_jacobians", arguments, derivatives),
        units=_units(data, states, tuple(z)),
    )


def _motor(
    data: PlantData, p: Mapping[str, ca.SX], x: Mapping[str, ca.SX], command: ca.SX
) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
    """Return torque [N m], current [A] and the derivative of the motor's own state."""
    speed = x["motor.speed"]
    if data.motor == "dc":
        driving = command - p["motor.back_emf_constant"] * speed
        if data.inductance > 0.0:
            current = x["motor.current"]
            rate = (driving - p["motor.resistance"] * current) / p["motor.inductance"]
            return p["motor.torque_constant"] * current, current, {"motor.current": rate}
        current = driving / p["motor.resistance"]
        return p["motor.torque_constant"] * current, current, {}
    demand = p["motor.speed_gain"] * (command - speed) if data.speed_gain > 0.0 else command
    if math.isinf(data.torque_bandwidth):
        return demand, demand, {}
    torque = x["motor.torque"]
    return torque, torque, {"motor.torque": p["motor.torque_bandwidth"] * (demand - torque)}


def _butterworth(
    stage: str, bandwidth: ca.SX, x: Mapping[str, ca.SX], signals: tuple[ca.SX, ca.SX, ca.SX]
) -> tuple[tuple[ca.SX, ca.SX, ca.SX], dict[str, ca.SX]]:
    """Return (acceleration, velocity, displacement) behind one second-order low-pass.

    The same filter on a signal and on its derivatives: two states hold all three, as the
    filtered velocity is the derivative of the filtered displacement.
    """
    shown, moving = x[f"{stage}.displacement"], x[f"{stage}.velocity"]
    rate = bandwidth**2 * (signals[2] - shown) - math.sqrt(2.0) * bandwidth * moving
    return (rate, moving, shown), {f"{stage}.displacement": moving, f"{stage}.velocity": rate}


def displacement_names(n: int) -> list[str]:
    """Return the names of the displacements of the rope's masses from the drum down."""
    return [*(f"rope.{j + 1}.displacement" for j in range(n - 1)), "payload.displacement"]


def _velocities(n: int) -> list[str]:
    return [*(f"rope.{j + 1}.velocity" for j in range(n - 1)), "payload.velocity"]


def _state_names(data: PlantData, n: int) -> tuple[str, ...]:
    names = ["motor.angle", "motor.speed"]
    if data.motor == "dc" and data.inductance > 0.0:
        names.append("motor.current")
    if data.motor == "ac" and not math.isinf(data.torque_bandwidth):
        names.append("motor.torque")
    names += [*displacement_names(n), *_velocities(n)]
    for stage, bandwidth in (
        ("sensor", data.sensor_bandwidth),
        ("telemetry", data.telemetry_bandwidth),
    ):
        if not math.isinf(bandwidth):
            names += [f"{stage}.displacement", f"{stage}.velocity"]
    return tuple(names)


def _parameter_values(data: PlantData) -> dict[str, float]:
    values = {
        "rope.axial_stiffness": data.axial_stiffness,
        "rope.length": data.rope_length,
        "rope.mass_per_length": data.mass_per_length,
        "rope.submerged_weight_per_length": data.rope_weight,
        "rope.damping_time": data.damping_time,
        "payload.virtual_mass": data.payload_mass,
        "payload.submerged_weight": data.payload_weight,
        "payload.quadratic_drag": data.quadratic_drag,
        "payload.linear_drag": 0.0,
        "winch.drum_radius": data.drum_radius,
        "winch.gear_ratio": data.gear_ratio,
        "winch.gear_efficiency": data.gear_efficiency,
        "winch.gear_direction": 0.0,
        "winch.gear_switching": 0.0,
        "winch.inertia": data.inertia,
        "winch.viscous_friction": data.viscous_friction,
    }
    if data.motor == "dc":
        values |= {
            "motor.resistance": data.resistance,
            "motor.torque_constant": data.torque_constant,
            "motor.back_emf_constant": data.back_emf_constant,
        }
        if data.inductance > 0.0:
            values["motor.inductance"] = data.inductance
    else:
        if data.speed_gain > 0.0:
            values["motor.speed_gain"] = data.speed_gain
        if not math.isinf(data.torque_bandwidth):
            values["motor.torque_bandwidth"] = data.torque_bandwidth
    if not math.isinf(data.sensor_bandwidth):
        values["sensor.bandwidth"] = data.sensor_bandwidth
    if not math.isinf(data.telemetry_bandwidth):
        values["telemetry.bandwidth"] = data.telemetry_bandwidth
    return values


def _hanging_weights(lumps: RopeLumps, p: Mapping[str, ca.SX]) -> list[ca.SX]:
    """Return the submerged weight below the top of each spring, its tension at rest [N]."""
    rope = p["rope.submerged_weight_per_length"] * p["rope.length"]
    return [p["payload.submerged_weight"] + rope * float(part) for part in lumps.hanging]


def _units(data: PlantData, states: tuple[str, ...], outputs: tuple[str, ...]) -> dict[str, str]:
    by_ending = {
        "displacement": "m",
        "velocity": "m/s",
        "acceleration": "m/s2",
        "haul": "m",
        "heave": "m",
        "heave_rate": "m/s",
        "force": "N",
        "tension": "N",
        "angle": "rad",
        "speed": "rad/s",
        "torque": "N m",
        "current": "A" if data.motor == "dc" else "N m",
        "voltage": "V",
    }
    command = "V" if data.motor == "dc" else "rad/s" if data.speed_gain > 0.0 else "N m"
    by_ending |= {"command": command, "set_point": command}
    names = {*states, *INPUTS, *DISTURBANCES, *MEASUREMENTS, *outputs}
    return {name: by_ending[name.rsplit(".", 1)[-1]] for name in sorted(names)}
