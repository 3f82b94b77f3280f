"""Plants that several tests share, and the 1975 thesis's closed forms to judge them by."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from models.plant import LinearPlant, PlantData

# 1975 thesis, worst case (K/M = 0.890 1/s2, zeta = 0.0070), winch and gains of its section on
# the design; submerged weights such that the tension at the winch is 452 kN.
THESIS = PlantData(
    axial_stiffness=1.6e8,
    rope_length=2000.0,
    mass_per_length=8.1,
    rope_weight=69.06,
    damping_ratio=0.0,
    masses=1,
    lumping="thesis",
    payload_mass=73_688.0,
    payload_weight=452e3 - 69.06 * 2000.0,
    quadratic_drag=10_500.0,
    drum_radius=0.413,
    gear_ratio=37.0,
    inertia=120.0,
    viscous_friction=0.47,
    motor="dc",
    resistance=0.074,
    torque_constant=5.8,
    back_emf_constant=5.8,
)
THESIS_DRAG = 0.014 * math.sqrt(80e3 * 89_888.0)  # 2 zeta sqrt(K M) [N s/m]
THESIS_GAINS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
THESIS_FEEDBACK = -200.0 * np.array([[50.0, 100.0, 100.0]])  # u = C y

# An electric winch of today with everything switched on.
MODERN = PlantData(
    axial_stiffness=242.8e6,
    rope_length=1000.0,
    mass_per_length=13.23,
    rope_weight=102.3,
    damping_ratio=0.02,
    masses=6,
    payload_mass=100e3,
    payload_weight=421.7e3,
    quadratic_drag=14_760.0,
    drum_radius=1.07,
    gear_ratio=100.0,
    gear_efficiency=0.925,
    inertia=26.0,
    viscous_friction=0.8,
    motor="ac",
    torque_bandwidth=150.0,
    speed_gain=500.0,
    sensor_bandwidth=62.8,
    telemetry_bandwidth=40.0,
    delay=0.03,
)


def thesis_transfer(
    omega: npt.ArrayLike,
    *,
    K: float,
    M: float,
    C: float,
    r: float,
    n: float,
    inertia: float,
    friction: float,
    R: float,
    K_T: float,
    K_w: float,
    A: float = 0.0,
    a: float = 0.0,
    a1: float = 0.0,
    a2: float = 0.0,
) -> dict[str, npt.NDArray[np.complex128]]:
    """Return T = P/Z, T_2 = X/Z, T_1 = P/E_G and G = P/Y (1975 thesis, eq. 1 and 31 to 34)."""
    s = 1j * np.asarray(omega)
    beta = friction / inertia + K_w * K_T / (R * inertia)
    g = r * K * K_T * A / (n * R * inertia * M)
    kappa = K * r**2 / (inertia * n**2)
    D = (
        s**4
        + (C / M + beta) * s**3
        + (kappa + beta * C / M + K / M + g * a) * s**2
        + (beta * K / M + C / M * kappa + g * a1) * s
        + g * a2
    )
    return {
        "T": K / M * (s**2 + beta * s) / D,
        "T_2": -((kappa + g * a) * s**2 + (C / M * kappa + g * a1) * s + g * a2) / D,
        "T_1": g / D,
        "G": K / (M * s**2 + C * s + K),
    }


def thesis_numbers(data: PlantData, drag: float) -> dict[str, float]:
    """Return the arguments of `thesis_transfer` for a plant of one mass."""
    return {
        "K": data.stiffness,
        "M": data.payload_mass + data.rope_mass,
        "C": drag,
        "r": data.drum_radius,
        "n": data.gear_ratio,
        "inertia": data.inertia,
        "friction": data.viscous_friction,
        "R": data.resistance,
        "K_T": data.torque_constant,
        "K_w": data.back_emf_constant,
    }


def closed_loop(
    plant: LinearPlant, feedback: npt.NDArray[np.float64], omega: npt.ArrayLike
) -> dict[str, npt.NDArray[np.complex128]]:
    """Return the closed-loop response of each output to each disturbance, u = feedback y."""
    r = plant.response(omega)
    ny = len(plant.measurements)
    F = r.zw + r.zu @ feedback @ np.linalg.solve(np.eye(ny) - r.yu @ feedback, r.yw)
    return {
        f"{z}/{w}": F[:, i, j]
        for i, z in enumerate(r.outputs)
        for j, w in enumerate(r.disturbances)
    }


def closed_loop_poles(
    plant: LinearPlant, feedback: npt.NDArray[np.float64]
) -> npt.NDArray[np.complex128]:
    """Return the poles with u = feedback y; the plant must be free of delays."""
    u_of_x = np.linalg.solve(np.eye(len(plant.inputs)) - feedback @ plant.D, feedback @ plant.C)
    return np.linalg.eigvals(plant.A + plant.B @ u_of_x)
