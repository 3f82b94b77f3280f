"""Rope and payload with the drum held: the exact rope against many masses, and closed forms."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from models import load_case
from models.hook import HookMotion
from models.plant import PlantData, build_plant
from synth.question import held_modes, held_motion, held_responses, uncompensated

#: Cases of every kind of chain: their rope and rig as changes.
CHAINS = {
    "thesis rope": ("thesis-1975-rope", {}),
    "crane": ("subsea-crane", {}),
    "Kelvin and Voigt": ("subsea-crane", {"rope.damping_law": "kelvin-voigt"}),
    "deep": ("subsea-crane", {"rope.length": 1450.0, "payload.mass": "45 t"}),
    "slings and block": (
        "subsea-crane",
        {"rigging": {"stiffness": "8 MN/m", "block_mass": "3 t"}, "rope.damping_ratio": 0.01},
    ),
    "two falls": ("subsea-crane", {"rope.falls": 2, "rope.length": 700.0}),
    "no damping": ("thesis-1975-rope", {"rope.damping_ratio": 0.0}),
}
MASSES = 40


@cache
def chain(name: str):
    """Return a case, its numbers, and its drag with the drum held."""
    base, changes = CHAINS[name]
    case = load_case(base).variant({"limits.drive": "report", **changes})
    data, hook = PlantData.from_case(case), HookMotion.from_case(case)
    return case, data, hook, uncompensated(case, data, hook)[0]


@cache
def lumped(name: str):
    """Return A of the chain's many masses with the drum held, and what heave and force do there.

    The drum's two states are struck out: nothing of the winch or the sensors moves.
    """
    case, _, _, drag = chain(name)
    plant = build_plant(case, MASSES).linearise(drag=drag)
    kept = [i for i, state in enumerate(plant.states) if state.startswith(("rope.", "payload."))]
    outputs = [plant.outputs.index(z) for z in ("payload.displacement", *TENSIONS)]
    sources = [plant.disturbances.index(w) for w in ("hook.heave", "hook.heave_rate")]
    return (
        plant.A[np.ix_(kept, kept)],
        plant.E[np.ix_(kept, sources)],
        plant.Cz[np.ix_(outputs, kept)],
        plant.Fz[np.ix_(outputs, sources)],
    )


TENSIONS = ("rope.tension", "rope.lower_tension")


@pytest.mark.parametrize("name", CHAINS)
def test_modes_are_those_of_many_masses(name):
    _, data, _, drag = chain(name)
    exact = held_modes(data, drag, 3)
    poles = np.linalg.eigvals(lumped(name)[0])
    poles = poles[poles.imag > 1e-3]
    poles = poles[np.argsort(poles.imag)][:3]
    assert exact.imag == pytest.approx(poles.imag, rel=2e-3)
    ratios, known = (-p.real / np.abs(p) for p in (exact, poles))
    assert ratios == pytest.approx(known, rel=6e-3, abs=1e-9)
    assert np.all(ratios > 0.0)


@pytest.mark.parametrize("name", CHAINS)
def test_modes_without_damping_are_the_natural_frequencies(name):
    case, *_ = chain(name)
    data = PlantData.from_case(case.variant({"rope.damping_ratio": 0.0}))
    modes = held_modes(data, 0.0, 3)
    assert modes.imag == pytest.approx(data.axial_modes(3), rel=1e-12)
    assert np.abs(modes.real).max() < 1e-12


@pytest.mark.parametrize("ratio", [0.0, 0.007, 0.3, 0.99])
def test_one_spring_has_the_damping_of_a_textbook(ratio):
    data = PlantData.from_case(load_case("thesis-1975"))
    mass, stiffness = data.payload_mass + data.rope_mass, data.stiffness
    drag = 2.0 * ratio * math.sqrt(stiffness * mass)
    (pole,) = held_modes(data, drag, 3)
    omega = math.sqrt(stiffness / mass)
    assert pole.real == pytest.approx(-ratio * omega, rel=1e-9, abs=1e-12)
    assert pole.imag == pytest.approx(omega * math.sqrt(1.0 - ratio**2), rel=1e-9)


def test_a_mode_that_drag_stops_does_not_swing():
    data = PlantData.from_case(load_case("thesis-1975"))
    critical = 2.0 * math.sqrt(data.stiffness * (data.payload_mass + data.rope_mass))
    (pole,) = held_modes(data, 1.5 * critical, 3)
    assert abs(pole.imag) < 1e-9 * abs(pole)
    # (s/omega)^2 + 3 s/omega + 1 = 0.
    roots = (-1.5 + math.sqrt(1.25), -1.5 - math.sqrt(1.25))
    assert min(abs(pole.real / (data.stiffness / 89888.0) ** 0.5 - x) for x in roots) < 1e-6


@pytest.mark.parametrize("name", CHAINS)
def test_tensions_are_those_of_many_masses(name):
    _, data, hook, drag = chain(name)
    A, E, C, F = lumped(name)
    omega = np.array([0.3, 0.7, 0.95, 1.1, 2.0])
    s = 1j * omega
    found = held_responses(data, s, drag)
    for k, w in enumerate(omega):
        heave = np.array([1.0, 1j * w])
        known = (C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, E) + F) @ heave
        exact = [found[name][0][k] for name in ("payload.displacement", *TENSIONS)]
        assert np.array(exact) == pytest.approx(known, rel=6e-3)
    assert hook.band[0] < omega[0]


def test_a_force_on_the_load_is_held_at_the_drum():
    """Lifted slowly, the load takes all of the force off the falls, through slings and tip."""
    for name in ("crane", "slings and block", "two falls"):
        _, data, _, drag = chain(name)
        found = held_responses(data, np.array([1e-4j]), drag)
        each = -data.mean_sheaves_factor / data.falls
        assert found["rope.tension"][1][0] == pytest.approx(each, rel=1e-4)
        assert found["rope.lower_tension"][1][0] == pytest.approx(-1.0, rel=1e-4)
        compliance = data.chain_compliance
        assert found["payload.displacement"][1][0] == pytest.approx(compliance, rel=2e-3)


def spring_moments(case, drag: float):
    """Return m_0 and m_2 of the thesis's one spring by its textbook response and a fine sum."""
    data, hook = PlantData.from_case(case), HookMotion.from_case(case)
    omega = np.linspace(*hook.band, 2_000_001)
    mass = data.payload_mass + data.rope_mass
    spring = data.stiffness / (data.stiffness - mass * omega**2 + 1j * omega * drag)
    load = (-data.payload_mass * omega**2 + 1j * omega * drag) * spring
    drum = data.stiffness * (1.0 - spring)
    density = hook.density(omega)
    return [
        tuple(float(np.trapezoid(omega**n * np.abs(z) ** 2 * density, omega)) for n in (0, 2))
        for z in (spring, drum, load)
    ]


def test_one_spring_moves_as_its_textbook_response_says():
    case = load_case("thesis-1975").replace({"payload.drag.coefficient": 20e3})
    held = held_motion(PlantData.from_case(case), HookMotion.from_case(case), 20e3)
    outputs = ("payload.displacement", "rope.tension", "rope.lower_tension")
    for output, (m0, m2) in zip(outputs, spring_moments(case, 20e3), strict=True):
        assert held.sigma(output) == pytest.approx(math.sqrt(m0), rel=1e-6)
        period = 2.0 * math.pi * math.sqrt(m0 / m2)
        assert held.mean_period(output) == pytest.approx(period, rel=1e-6)
        peak = math.sqrt(2.0 * m0 * math.log(3600.0 / period))
        assert held.peak(output, 3600.0) == pytest.approx(peak, rel=1e-6)


@pytest.mark.parametrize("name", CHAINS)
def test_the_payload_moves_as_the_drag_was_found_with(name):
    case, data, hook, _ = chain(name)
    drag, rms = uncompensated(case, data, hook)
    assert held_motion(data, hook, drag).sigma("payload.displacement") == pytest.approx(
        rms, rel=1e-7
    )


def test_nothing_bounds_a_resonance_without_damping():
    case = load_case("thesis-1975")
    held = held_motion(PlantData.from_case(case), HookMotion.from_case(case), 0.0)
    for output in ("payload.displacement", *TENSIONS):
        assert held.sigma(output) == held.peak(output, 3600.0) == math.inf
        assert held.mean_period(output) == math.inf
