"""Exact frequency responses of winch and load on a distributed rope, none of it lumped.

The rope is the wave equation EA(s) u'' = m s^2 u between the drum and the payload, EA(s) being
EA (1 + tau s) or the hysteretic law's (`PlantData.rope_modulus`).
Its responses at a point s of the complex plane are closed forms; closed with the winch's own
equations they give the same blocks, by the same names, as the lumped `LinearPlant`.  They are
the yardstick for the lumping, and what the final verification evaluates on its contours: a
design that holds on the lumped rope only is not a design.

For a rope of length L with payload equation D P = T_lower + F, D = M_1 s^2 + C s:

    gamma = s L sqrt(m / EA(s)),   l = L / EA(s),
    P     = (Y + l sinh(gamma)/gamma F) / (cosh(gamma) + D l sinh(gamma)/gamma),
    T_top = ((gamma sinh(gamma)/l + D cosh(gamma)) Y - F) / (the same denominator).

The first is 1/(cosh gamma + Gamma sinh gamma) with Gamma = D l / gamma.  Slings of stiffness k_s
under a hook block m_b make D g + m_b s^2 of D there, g = 1/(1 + D/k_s); a tip of stiffness k_t
takes T_top/k_t from Y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, pick
from .equations import DISTURBANCES, INPUTS, MEASUREMENTS, RATES, UPPER_TENSION
from .plant_data import PlantData, as_plant_data
from .response import PlantResponse

if TYPE_CHECKING:
    from ..case import Case

# What of command, hook's heave and force on the payload is in each column, see `line_response`.
_COLUMNS = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def line_response(
    source: Case | PlantData,
    s: npt.ArrayLike,
    *,
    drag: float,
    disturbances: Sequence[str] | None = None,
    masses: int = 0,
) -> PlantResponse:
    """Return the exact response of a case's plant at points s (k,) [1/s], such as i omega.

    Safe from overflow for any Re s >= 0: every hyperbolic function is carried as its product with
    exp(-gamma).  No point may be a pole (s = 0 is one).  The payload's equivalent linear drag is C
    [N s/m]; of the disturbances some may be named, by default all are there.  With `masses` it is
    that of the rope in so many, see `rope_transfers`.
    """
    data = as_plant_data(source)
    s = np.array(s, dtype=np.complex128).reshape(-1)
    P_Y, P_F, T_Y, T_F = rope_transfers(data, s, drag, masses=masses)

    # Motor: torque = forward command - back s theta, both with the drive's dynamics in them.
    forward = data.torque_per_command(s)
    if data.motor == "dc":
        back = forward * data.back_emf_constant
    else:
        lag = 1.0 / (1.0 + s / data.torque_bandwidth)  # 1 for an infinite bandwidth
        back = lag * data.speed_gain
    h = data.drum_radius / data.gear_ratio
    load = data.mean_gear_factor * h
    # Torque balance of the shaft, solved for its angle: the rope is a spring T_Y on the drum.
    shaft = data.inertia * s**2 + (data.viscous_friction + back) * s + load * h * T_Y
    # columns: command, heave, force on the payload, set-point
    own = tuple(name for name in DISTURBANCES if name not in RATES)
    wanted = own if disturbances is None else tuple(disturbances)
    columns = [0, *(1 + k for k in pick("plant response", "disturbance", own, wanted))]
    command, heave, force = _COLUMNS[:, columns, None]
    angle = (forward * command - load * (T_Y * heave + T_F * force)) / shaft
    top = h * angle + heave
    payload = P_Y * top + P_F * force
    torque = forward * command - back * s * angle
    upper = (T_Y * top + T_F * force) / data.falls  # of each
    z = {
        "payload.displacement": payload,
        "payload.velocity": s * payload,
        "payload.acceleration": s**2 * payload,
        "drum.haul": h * angle,
        "motor.torque": torque,
        "motor.speed": s * angle,
        "motor.current": torque / data.torque_constant,
        "rope.tension": data.mean_sheaves_factor * upper,
        "rope.lower_tension": (data.payload_mass * s**2 + drag * s) * payload - force,
    }
    if data.sheaves_efficiency < 1.0:
        z[UPPER_TENSION] = upper
    if data.motor == "dc":
        z["motor.voltage"] = np.broadcast_to(command, angle.shape)
    # Exact delay and low-passes: no Pade model, no states.
    sensor = np.exp(-s * (data.delay + data.command_delay))
    for bandwidth in (data.sensor_bandwidth, data.telemetry_bandwidth):
        if not math.isinf(bandwidth):
            sensor = sensor / (1.0 + math.sqrt(2.0) * (s / bandwidth) + (s / bandwidth) ** 2)
    z_rows = np.stack(list(z.values())).transpose(2, 0, 1)
    y_rows = np.stack([sensor * z[name] for name in MEASUREMENTS]).transpose(2, 0, 1)
    return PlantResponse(
        s=s,
        zw=z_rows[:, :, 1:],
        zu=z_rows[:, :, :1],
        yw=y_rows[:, :, 1:],
        yu=y_rows[:, :, :1],
        inputs=INPUTS,
        disturbances=wanted,
        measurements=MEASUREMENTS,
        outputs=tuple(z),
    )


def rope_transfers(
    data: PlantData, s: ComplexArray, drag: float, *, spring: bool = False, masses: int = 0
) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """Return P/Y, P/F, T_top/Y and T_top/F of the rope with its payload, each (k,), at s [1/s].

    Y is the motion of the rope's upper end, or of the foot of a tip that gives; F a force on the
    payload, T_top the tension at the drum, as deviations from rest.  By reciprocity T_top/F =
    -P/Y.  Drag is C [N s/m]; Re s >= 0 is safe from overflow.  As in the thesis the rope may be one
    `spring`, with all of its mass below.

    Or it is N >= 2 `masses` of `lump_rope`: a wave changes by exp(+-theta) from one to the next, 2
    sinh(theta/2) = gamma/(N - 1/2), so that (N - 1/2) theta stands for gamma as an argument, and
    the half pieces at the ends bring a factor cosh(theta/2).  A tip is in series with the whole
    rope, as in a plant of a hysteretic one.
    """
    stiffness = data.rope_modulus(s)
    D, slings = data.payload_mass * s**2 + drag * s, 1.0 / data.sling_stiffness
    g = 1.0 / (1.0 + D * slings)
    hung = D * g + data.block_mass * s**2
    if spring:
        P_Y, P_F, T_Y = _spring_transfers(data, s, stiffness, hung)
    else:
        P_Y, P_F, T_Y = _line_transfers(data, s, stiffness, hung, masses)
    # From the rope's lower end to the payload, and from its upper end to the tip's foot.
    P_Y, P_F = P_Y * g, (P_F * g + slings) * g
    tip = 1.0 / data.tip_stiffness
    e = 1.0 / (1.0 + T_Y * tip)
    P_F = P_F + e * P_Y**2 * tip
    return e * P_Y, P_F, e * T_Y, -e * P_Y


def _spring_transfers(
    data: PlantData, s: ComplexArray, stiffness: ComplexArray, hung: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return `_line_transfers` of one spring with all of the rope's mass below it."""
    spring = stiffness / data.rope_length
    P_F = 1.0 / (hung + data.rope_mass * s**2 + spring)
    return spring * P_F, P_F, spring * (1.0 - spring * P_F)


def _line_transfers(
    data: PlantData, s: ComplexArray, stiffness: ComplexArray, hung: ComplexArray, masses: int
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return P/Y, P/F and T_top/Y of a rope with a load of dynamic stiffness `hung` below it."""
    compliance = data.rope_length / stiffness
    gamma = s * data.rope_length * np.sqrt(data.mass_per_length / stiffness)
    # All functions are even in gamma: take the root whose exponential does not grow.
    gamma = np.where(gamma.real < 0.0, -gamma, gamma)
    along, end = gamma, np.ones_like(gamma)
    if masses:
        half = gamma / (2.0 * masses - 1.0)  # sinh(theta/2)
        along = np.asarray((2.0 * masses - 1.0) * np.arcsinh(half), dtype=np.complex128)
        end = np.sqrt(1.0 + half**2)
    decay = np.exp(-along)
    cosh = 0.5 * (1.0 + decay**2)  # times exp(-along), as the next one
    safe = np.where(gamma == 0.0, 1.0, gamma)
    sinh_over_gamma = np.where(gamma == 0.0, 1.0, -0.5 * np.expm1(-2.0 * along) / safe)
    # The wave equation's solution between Y above and the load's D P = F - tension below.
    below = end * cosh + hung * compliance * sinh_over_gamma
    P_Y = decay / below
    P_F = compliance * sinh_over_gamma / below
    T_Y = (gamma**2 / compliance * sinh_over_gamma + hung * cosh / end) / below
    return P_Y, P_F, T_Y
