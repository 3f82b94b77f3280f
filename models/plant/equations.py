"""The plant's equations of motion, written once in CasADi symbols.

From the drum down: motor, gear and drum; the rope as springs with masses between them; the
payload with its drag; the sensors' low-pass filters.  `models.plant.plant` describes signs and
coordinates, wraps these functions and linearises them; nothing else should need this file.

What a simulation has and a design has not comes in by arguments, and without them the equations
are those of the design: limits of the drive (`models.plant.drive`), rope that grows and layers of
the drum (`models.plant.payout`), and what acts on the payload from outside
(`models.plant.surroundings`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

from .drive import DriveLimits, motor_equations
from .rope import chain_of

if TYPE_CHECKING:
    from .payout import DrumTravel
    from .plant_data import PlantData
    from .rope import RopeLumps
    from .surroundings import Surroundings

INPUTS = ("drive.command",)
DISTURBANCES = ("hook.heave", "hook.heave_rate", "payload.force", "drive.set_point")
MEASUREMENTS: tuple[str, ...] = ("payload.acceleration", "payload.velocity", "payload.displacement")
RATES = {"hook.heave_rate": "hook.heave"}
UPPER_TENSION = "rope.upper_tension"  # below the sheaves, where there are any
MOTION = ("displacement", "velocity", "acceleration")  # of whatever else moves: deck, surface


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """Symbolic functions of the plant, and the names of what goes in and out."""

    data: PlantData  #: The numbers it was built from.
    lumps: RopeLumps  #: The rope's lumping.
    inputs: tuple[str, ...] = INPUTS  #: Names of the entries of u.
    measurements: tuple[str, ...] = MEASUREMENTS  #: Of y.
    states: tuple[str, ...]  #: Of x.
    disturbances: tuple[str, ...]  #: Of w.
    outputs: tuple[str, ...]  #: Of z.
    parameters: Mapping[str, float]  #: Names and values of the entries of p.
    #: casadi.Function (x, u, w, p) -> (xdot, y, z), smooth but for slack rope.
    function: ca.Function
    jacobians: ca.Function  #: (x, u, w, p) -> (A, B, E, C, D, F, Cz, Dz, Fz).
    units: Mapping[str, str]  #: Unit of each signal by name.


def build_equations(
    data: PlantData,
    lumps: RopeLumps,
    *,
    limits: DriveLimits | None = None,
    travel: DrumTravel | None = None,
    surroundings: Surroundings | None = None,
) -> Equations:
    """Return the equations for a lumping of the rope; the data decide which states exist.

    The arguments are those of `models.plant.plant.build_plant`.
    """
    n, relaxing = len(lumps.masses), data.branches[1].size
    parameters = parameter_values(data)
    if limits is not None:
        parameters |= limits.parameters
    if surroundings is not None:
        parameters |= surroundings.parameters
    symbols = ca.SX.sym("p", len(parameters))
    p = {name: symbols[i] for i, name in enumerate(parameters)}

    states = state_names(data, n)
    x = ca.SX.sym("x", len(states))
    x_of = {name: x[i] for i, name in enumerate(states)}
    u = ca.SX.sym("u", len(INPUTS))
    moving = () if surroundings is None else surroundings.motions
    disturbances = DISTURBANCES + tuple(f"{name}.{end}" for name in moving for end in MOTION)
    w = ca.SX.sym("w", len(disturbances))
    heave, heave_rate, force, set_point, *others = ca.vertsplit(w)

    speed = x_of["motor.speed"]
    radius, ratio = p["winch.drum_radius"], p["winch.gear_ratio"]
    length: ca.SX = p["rope.length"]
    haul = radius / ratio * x_of["motor.angle"]
    if travel is not None:
        haul, radius = travel.haul(x_of["motor.angle"], radius, ratio)
        length = length - haul
    r_over_n = radius / ratio
    haul_rate = r_over_n * speed
    command = u[0] + set_point
    xdot: dict[str, ca.SX] = {"motor.angle": speed}

    # Rope: position and velocity of the vessel's end, then of every mass.
    position = [haul + heave, *(x_of[name] for name in displacement_names(data, n))]
    velocity = [haul_rate + heave_rate, *(x_of[name] for name in _velocities(data, n))]
    links = chain_of(p, lumps, length)
    tension = []
    for j, link in enumerate(links):
        k = link.stiffness
        stretch = position[j] - position[j + 1]
        rate = velocity[j] - velocity[j + 1]
        at_rest = link.carried
        if travel is not None and link.is_rope:
            # A rope that has grown has the stretch of the static rope at its new stiffness.
            at_rest = at_rest * p["rope.length"] / length
        gives = j == 0 and "crane.tip_stiffness" in p  # part of the stretch is the tip's
        give = link.give if gives else ca.SX(0)
        if relaxing and link.is_rope:
            # Every branch is a spring behind a damper that has moved by q: what is left of the
            # stretch pulls too.
            moved = [x_of[name] for name in _branch_names(j, relaxing)]
            gains = [p[f"rope.branch_{b + 1}.gain"] for b in range(relaxing)]
            pulled = [g * (stretch - q) for g, q in zip(gains, moved, strict=True)]
            whole = at_rest + k * (stretch + sum(pulled[1:], start=pulled[0]))
            quick = 1 + sum(gains[1:], start=gains[0])
            give = give * quick
        else:
            damping_time = link.series_time if gives else link.damping_time
            whole = at_rest + k * (stretch + damping_time * rate)
        if gives:
            # The tip gives (T - T_rest)/k_t, and the rope has the rest of the stretch.
            whole = (whole + give * link.carried) / (1 + give)
        tension.append(ca.fmax(0, whole))  # a rope does not push
        if relaxing and link.is_rope:
            if gives:
                stretch = stretch - (whole - link.carried) * link.give / k
            # A slack piece is shorter than its ends are apart: by what leaves it no tension.
            gained = (tension[j] - whole) / (k * quick)
            for b, (name, q) in enumerate(zip(_branch_names(j, relaxing), moved, strict=True)):
                xdot[name] = (stretch + gained - q) / p[f"rope.branch_{b + 1}.time"]
    # What no mass carries (two thirds of the rope on one spring) hangs on the drum all the same.
    top = tension[0] + p["rope.submerged_weight_per_length"] * length * lumps.at_drum
    acceleration = other = ca.SX(0)
    load = p["payload.virtual_mass"]
    outside: Mapping[str, ca.SX] = {}
    names = zip(links, displacement_names(data, n), _velocities(data, n), strict=True)
    for j, (link, shift, move) in enumerate(names):
        mass, weight = link.mass, link.weight
        below = tension[j + 1] if j + 1 < len(links) else ca.SX(0)
        if j + 1 == len(links):
            v, quadratic = velocity[-1], p["payload.quadratic_drag"]
            if surroundings is not None:
                triples = zip(others[0::3], others[1::3], others[2::3], strict=True)
                motions = dict(zip(moving, triples, strict=True))
                around = surroundings.build(position[-1], velocity[-1], motions, p)
                v, quadratic = around.relative_velocity, quadratic * around.drag_factor
                load = load + around.virtual_mass_change
                force, outside = force + around.force, around.outputs
            # Quadratic drag has no slope at rest: a linear plant gets its drag as a parameter.
            other = force - quadratic * ca.fabs(v) * v - p["payload.linear_drag"] * v
            mass = mass + load
            weight = weight + p["payload.submerged_weight"]
        acceleration = (tension[j] - below - weight + other) / mass
        if data.skin_drag > 0.0 and j < n:
            along, piece = velocity[j + 1], length * lumps.masses[j]
            acceleration -= p["rope.skin_drag"] * piece * ca.fabs(along) * along / mass
        xdot[shift] = velocity[j + 1]
        xdot[move] = acceleration
    # What the payload hangs on: rope and hook block in its mass are above that.
    lower = ca.fmax(0, load * acceleration + p["payload.submerged_weight"] - other)

    motor = motor_equations(data, p, x_of, command)
    xdot |= motor.derivative
    # Losses always work against the motion: the motor feels 1/eta of the load that it hauls, and
    # eta of one that drives it.  A simulation switches by the speed, a linear plant takes the mean.
    direction = p["winch.gear_direction"] + ca.tanh(p["winch.gear_switching"] * speed)

    def lossy(efficiency: ca.SX) -> ca.SX:
        return 0.5 * ((1 + direction) / efficiency + (1 - direction) * efficiency)

    upper = top if data.falls == 1.0 else top / data.falls  # of each
    eta, at_drum = p["winch.gear_efficiency"], upper
    if data.sheaves_efficiency < 1.0:  # they switch with the gear: one efficiency to the motor
        eta = eta * p["rope.sheaves_efficiency"]
        at_drum = lossy(p["rope.sheaves_efficiency"]) * upper
    gear = lossy(eta)
    friction = p["winch.viscous_friction"] * speed
    if data.coulomb_friction > 0.0:
        friction += p["winch.coulomb_friction"] * ca.tanh(speed / data.friction_speed)
    xdot["motor.speed"] = (motor.torque - friction - gear * r_over_n * top) / p["winch.inertia"]

    # Sensor, then telemetry: the same low-pass each, its delay is left to whoever samples it.
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
        "motor.torque": motor.torque,
        "motor.speed": speed,
        "motor.current": motor.current,
        "rope.tension": at_drum,
        "rope.lower_tension": lower,
    }
    if data.sheaves_efficiency < 1.0:
        z[UPPER_TENSION] = upper
    if data.motor == "dc":
        z["motor.voltage"] = motor.applied
    if limits is not None or travel is not None or surroundings is not None:  # a simulation
        slackest = lower
        for other_tension in tension:
            slackest = ca.fmin(slackest, other_tension)
        z |= {
            "rope.minimum_tension": slackest,
            "rope.length": length,
            "drive.applied": motor.applied,
            **outside,
        }
    y_out, z_out = ca.vertcat(*measured), ca.vertcat(*z.values())
    rhs = ca.vertcat(*(xdot[name] for name in states))
    arguments = [x, u, w, symbols]
    # All nine blocks in one function share their subexpressions.
    derivatives = [ca.jacobian(f, v) for f in (rhs, y_out, z_out) for v in (x, u, w)]
    signatures = ["x", "u", "w", "p"], ["xdot", "y", "z"]
    units = _units(data, states, disturbances, tuple(z))
    if surroundings is not None:
        units |= {name: unit for name, unit in surroundings.output_units.items() if name in z}
    return Equations(
        data=data,
        lumps=lumps,
        states=states,
        disturbances=disturbances,
        outputs=tuple(z),
        parameters=parameters,
        function=ca.Function("plant", arguments, [rhs, y_out, z_out], *signatures),
        jacobians=ca.Function("plant_jacobians", arguments, derivatives),
        units=units,
    )


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


def weighed_tension(signals: Collection[str]) -> str:
    """Return which of a plant's signals a load cell at the rope's upper end weighs."""
    return UPPER_TENSION if UPPER_TENSION in signals else "rope.tension"


def displacement_names(data: PlantData, n: int) -> list[str]:
    """Return the names of the displacements of the chain's masses from the drum down.

    With slings the rope's last mass is the hook block, and the payload one more.
    """
    above = n - 1 if math.isinf(data.sling_stiffness) else n
    return [*(f"rope.{j + 1}.displacement" for j in range(above)), "payload.displacement"]


def _velocities(data: PlantData, n: int) -> list[str]:
    return [name.replace("displacement", "velocity") for name in displacement_names(data, n)]


def _branch_names(piece: int, branches: int) -> list[str]:
    """Return the states of a piece of hysteretic rope: how far the dampers have moved."""
    return [f"rope.{piece + 1}.branch_{b + 1}.stretch" for b in range(branches)]


def state_names(data: PlantData, n: int) -> tuple[str, ...]:
    """Return the names of the states of a plant with n masses along the rope."""
    names = ["motor.angle", "motor.speed"]
    if data.motor == "dc" and data.inductance > 0.0:
        names.append("motor.current")
    if data.motor == "ac" and not math.isinf(data.torque_bandwidth):
        names.append("motor.torque")
    names += [*displacement_names(data, n), *_velocities(data, n)]
    for piece in range(n):
        names += _branch_names(piece, data.branches[1].size)
    for stage, bandwidth in (
        ("sensor", data.sensor_bandwidth),
        ("telemetry", data.telemetry_bandwidth),
    ):
        if not math.isinf(bandwidth):
            names += [f"{stage}.displacement", f"{stage}.velocity"]
    return tuple(names)


def parameter_values(data: PlantData) -> dict[str, float]:
    """Return the plant's parameters p by name, in their order.

    The axial stiffness is that of a slow pull, EA_0; a hysteretic rope's branches have gains g_j
    = k_j / k_0 on it (`PlantData.branches`).
    """
    slow, gains, times = data.branches
    values = {
        "rope.axial_stiffness": data.slow_stiffness,
        "rope.length": data.rope_length,
        "rope.mass_per_length": data.mass_per_length,
        "rope.submerged_weight_per_length": data.rope_weight,
        "rope.damping_time": data.damping_time,
        **{f"rope.branch_{b + 1}.gain": float(k / slow) for b, k in enumerate(gains)},
        **{f"rope.branch_{b + 1}.time": float(tau) for b, tau in enumerate(times)},
        "payload.virtual_mass": data.payload_mass,
        "payload.submerged_weight": data.payload_weight,
        "payload.quadratic_drag": data.payload_drag,
        "payload.linear_drag": 0.0,
        "winch.drum_radius": data.drum_radius,
        "winch.gear_ratio": data.gear_ratio,
        "winch.gear_efficiency": data.gear_efficiency,
        "winch.gear_direction": 0.0,
        "winch.gear_switching": 0.0,
        "winch.inertia": data.inertia,
        "winch.viscous_friction": data.viscous_friction,
    }
    if data.skin_drag > 0.0:
        values["rope.skin_drag"] = data.skin_drag
    if data.sheaves_efficiency < 1.0:
        values["rope.sheaves_efficiency"] = data.sheaves_efficiency
    if not math.isinf(data.tip_stiffness):
        values["crane.tip_stiffness"] = data.tip_stiffness
    if not math.isinf(data.sling_stiffness):
        values["rigging.stiffness"] = data.sling_stiffness
    if data.block_mass > 0.0:
        values["rigging.block_mass"] = data.block_mass
        values["rigging.block_weight"] = data.block_weight
    if data.coulomb_friction > 0.0:
        # Zero here: its slope at rest, T_c/omega_f, is no friction of a drum that moves.
        values["winch.coulomb_friction"] = 0.0
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


def _units(
    data: PlantData,
    states: tuple[str, ...],
    disturbances: tuple[str, ...],
    outputs: tuple[str, ...],
) -> dict[str, str]:
    by_ending = {
        "displacement": "m",
        "stretch": "m",
        "velocity": "m/s",
        "acceleration": "m/s2",
        "haul": "m",
        "heave": "m",
        "heave_rate": "m/s",
        "force": "N",
        "tension": "N",
        "lower_tension": "N",
        "upper_tension": "N",
        "minimum_tension": "N",
        "length": "m",
        "angle": "rad",
        "speed": "rad/s",
        "torque": "N m",
        "current": "A" if data.motor == "dc" else "N m",
        "voltage": "V",
    }
    command = "V" if data.motor == "dc" else "rad/s" if data.speed_gain > 0.0 else "N m"
    by_ending |= {"command": command, "set_point": command, "applied": command}
    names = {*states, *INPUTS, *disturbances, *MEASUREMENTS, *outputs}
    return {name: by_ending.get(name.rsplit(".", 1)[-1], "-") for name in sorted(names)}
