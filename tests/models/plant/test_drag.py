"""Equivalent linear drag by quadrature, Monte Carlo and energy."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import scipy.integrate
from plant_numbers import THESIS

from models import load_case
from models.basics import SolverError, spectral_nodes
from models.plant import (
    build_plant,
    consistent_drag,
    settled_drag,
    stochastic_equivalent,
)
from models.rig import energy_equivalent

NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(200)
WEIGHTS = WEIGHTS / math.sqrt(2.0 * math.pi)


def test_energy_of_a_sine_is_the_same() -> None:
    q, amplitude, omega = 10_500.0, 0.7, 1.1
    C = energy_equivalent(q, amplitude, omega)

    def power(t: float, linear: bool) -> float:
        v = amplitude * omega * math.cos(omega * t)
        return (C * v if linear else q * abs(v) * v) * v

    period = 2.0 * math.pi / omega
    lost = [
        scipy.integrate.quad(power, 0.0, period, args=(linear,), epsabs=0.0)[0]
        for linear in (True, False)
    ]
    assert lost[0] == pytest.approx(lost[1], rel=1e-8)
    # the 1975 thesis writes it with rho C_D A, twice our q (eq. 13)
    assert pytest.approx(4.0 / (3.0 * math.pi) * 2.0 * q * omega * amplitude) == C


def test_thesis_drag_belongs_to_an_amplitude_of_12_cm() -> None:
    """1187 N s/m with C_D = 1.05, 20 m2, 1000 kg/m3 at T = 5.7 s."""
    assert energy_equivalent(10_500.0, 0.12, 2.0 * math.pi / 5.7) == pytest.approx(1187.0, rel=0.02)


@pytest.mark.parametrize("sigma", [0.2, 0.4, 1.5])
def test_the_equivalent_agrees_with_monte_carlo(sigma: float) -> None:
    rng = np.random.default_rng(1975)
    v = sigma * rng.standard_normal(1_000_000)
    wanted = np.mean(100.0 * np.abs(v) * v * v) / sigma**2
    assert stochastic_equivalent(100.0, sigma) == pytest.approx(wanted, rel=5e-3)


def test_gain_has_the_least_mean_square_error() -> None:
    sigma = 0.6
    v = sigma * NODES
    force = np.abs(v) * v

    def error(gain: float) -> float:
        return float(WEIGHTS @ (force - gain * v) ** 2)

    best = stochastic_equivalent(1.0, sigma)
    assert error(best) < min(error(0.99 * best), error(1.01 * best))


def test_the_case_file_has_the_same_formula() -> None:
    case = load_case("thesis-1975-rope")
    q = case.payload.quadratic_drag
    assert case.payload.drag.method == "stochastic"
    energy = case.replace(
        {"payload.drag": {"method": "energy", "amplitude": 0.3, "frequency": 1.1}}
    )
    assert energy.payload.fixed_drag == pytest.approx(energy_equivalent(q, 0.3, 1.1))


# ---- consistent with the motion


def test_consistent_drag_solves_its_equation() -> None:
    """White force of intensity W on a mass: sigma_v^2 = W/(2 C M), C^3 = q^2 (8/pi) W/(2 M)."""
    q, intensity, mass = 10_500.0, 4e6, 9e4
    C = consistent_drag(
        q, lambda C: math.sqrt(intensity / (2.0 * C * mass)) if C > 0.0 else math.inf
    )
    assert pytest.approx((q**2 * 8.0 / math.pi * intensity / (2.0 * mass)) ** (1.0 / 3.0)) == C


def test_consistent_drag_on_the_winch_plant() -> None:
    """Hook heave as a narrow band at the rope's resonance, where substitution swings."""
    plant = build_plant(THESIS)
    omega = np.linspace(0.85, 1.05, 81)
    spectrum = np.exp(-0.5 * ((omega - 0.944) / 0.02) ** 2)

    def velocity_rms(C: float) -> float:
        v = plant.linearise(drag=C).response(omega).column("payload.velocity", "hook.heave")
        return math.sqrt(np.trapezoid(np.abs(v) ** 2 * spectrum, omega))

    C = consistent_drag(THESIS.quadratic_drag, velocity_rms, tolerance=1e-8)
    again = stochastic_equivalent(THESIS.quadratic_drag, velocity_rms(C))
    assert pytest.approx(again, rel=1e-6) == C
    assert C > 1e3


def test_settled_drag_is_the_consistent_one_with_few_sets_of_nodes() -> None:
    """A mass on a spring under a force with a spectrum, its nodes chosen for each drag anew."""
    mass, stiffness, q = 9e4, 9e4, 2e4
    asked: list[float] = []

    def about(near: float) -> Callable[[float], float]:
        asked.append(near)
        pole = complex(-0.5 * near / mass, 1.0)
        nodes = spectral_nodes(0.1, 3.0, poles=[pole])

        def velocity(C: float) -> float:
            s = 1j * nodes.omega
            response = s / (mass * s**2 + C * s + stiffness)
            return float(np.sqrt(nodes.integrate(4e8 * np.abs(response) ** 2)))

        return velocity

    C = settled_drag(q, about, 0.0)
    assert asked[0] == q
    assert len(asked) <= 3
    exact = consistent_drag(q, lambda c: about(c)(c) if c > 0.0 else math.inf)
    assert pytest.approx(exact, rel=1e-9) == C
    assert settled_drag(0.0, about, 1.0) == 0.0


def test_settled_drag_starts_where_there_are_nodes() -> None:
    def about(near: float) -> Callable[[float], float]:
        if near < 1.2e3:
            raise SolverError("no nodes")
        return lambda C: 1.0 / (1.0 + C / 1e4)

    assert settled_drag(1e3, about, 0.0) == consistent_drag(1e3, lambda C: 1.0 / (1.0 + C / 1e4))


def test_without_drag_or_motion_there_is_none() -> None:
    assert consistent_drag(0.0, lambda C: 1.0) == 0.0
    assert consistent_drag(1e4, lambda C: 0.0) == 0.0


def test_a_plant_that_drag_cannot_calm_is_said() -> None:
    with pytest.raises(SolverError, match="no linear drag coefficient agrees with the motion"):
        consistent_drag(1e4, lambda C: math.inf)
