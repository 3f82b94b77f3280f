"""The exact rope against textbook formulae, the lumped plant, and reciprocity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from plant_numbers import MODERN, THESIS

from models.plant import (
    PlantData,
    build_plant,
    fixed_top_modes,
    line_response,
    rope_transfers,
)

ROPE = replace(THESIS, lumping="distributed", masses=None, damping_ratio=0.02)
RIG = {"tip_stiffness": 3e6, "sling_stiffness": 5e6, "block_mass": 4e3, "block_weight": 34e3}
VARIANTS = {
    "dc": ROPE,
    "dc with inductance": replace(ROPE, inductance=0.004, delay=0.05),
    # as much damping as its higher modes have under the other law
    "hysteretic": replace(ROPE, damping_law="hysteretic", damping_ratio=0.15),
    "speed mode": replace(MODERN, rope_length=1500.0),
    "torque mode": replace(MODERN, speed_gain=0.0, telemetry_bandwidth=math.inf),
    "ideal torque": replace(MODERN, speed_gain=0.0, torque_bandwidth=math.inf),
    "ideal speed": replace(MODERN, torque_bandwidth=math.inf, sensor_bandwidth=math.inf),
    "block": replace(ROPE, block_mass=2e4),
    "slings": replace(ROPE, sling_stiffness=5e6, block_mass=4e3),
    "rig, hysteretic": replace(ROPE, **RIG, damping_law="hysteretic", damping_ratio=0.15),
}
every_variant = pytest.mark.parametrize("data", VARIANTS.values(), ids=VARIANTS.keys())
BLOCKS = ("zw", "zu", "yw", "yu")


def distance(data: PlantData, masses: int, s: np.ndarray, drag: float = 3e3) -> dict[str, float]:
    """Return the rms difference of lumped and exact responses, relative, worst of each block."""
    lumped = build_plant(data, masses=masses).linearise(drag=drag).response_at(s)
    exact = line_response(data, s, drag=drag)
    assert lumped.outputs == exact.outputs
    assert lumped.disturbances == exact.disturbances
    assert lumped.measurements == exact.measurements
    assert lumped.inputs == exact.inputs
    found = {}
    for block in BLOCKS:
        a, b = getattr(lumped, block), getattr(exact, block)
        off = np.sqrt(np.mean(np.abs(a - b) ** 2, axis=0))
        size = np.sqrt(np.mean(np.abs(b) ** 2, axis=0))
        found[block] = float((off / np.where(size > 0.0, size, 1.0)).max())
    return found


@every_variant
def test_lumped_plant_converges_with_the_square_of_the_piece(data: PlantData) -> None:
    s = 1j * np.linspace(0.05, 15.0, 120)
    coarse, fine = (distance(data, n, s) for n in (20, 40))
    for block in BLOCKS:
        assert fine[block] < 3e-3
        assert coarse[block] / fine[block] == pytest.approx((39.5 / 19.5) ** 2, rel=0.05)


def test_a_viscous_rope_on_a_tip_converges_too() -> None:
    # Tip and uppermost piece are one Kelvin-Voigt spring to first order in omega tau; what is
    # left falls with that piece.
    s = 1j * np.linspace(0.05, 6.0, 60)
    coarse, fine = (distance(replace(ROPE, **RIG), n, s) for n in (20, 40))
    for block in BLOCKS:
        assert fine[block] < 2e-3
        assert coarse[block] / fine[block] > 1.8


@every_variant
def test_lumped_plant_converges_off_the_imaginary_axis(data: PlantData) -> None:
    s = np.array([0.4 + 2.0j, 3.0 + 0.0j, 1.0 - 6.0j, 0.05 + 0.05j])
    assert max(distance(data, 40, s).values()) < 3e-3


@pytest.mark.parametrize("masses", [2, 3, 12, 40])
@every_variant
def test_a_lumped_rope_is_a_closed_form_too(data: PlantData, masses: int) -> None:
    s = np.concatenate([1j * np.geomspace(0.05, 60.0, 80), 0.3 + 1j * np.linspace(0.0, 20.0, 9)])
    lumped = build_plant(data, masses=masses).linearise(drag=3e3).response_at(s)
    found = line_response(data, s, drag=3e3, masses=masses)
    for block in BLOCKS:
        a, b = getattr(lumped, block), getattr(found, block)
        assert np.abs(a - b).max() <= 1e-7 * np.abs(a).max(), block
        off, size = (np.sqrt(np.mean(np.abs(x) ** 2, axis=0)) for x in (a - b, a))
        assert np.all(off <= 1e-6 * size), block


def test_a_rope_without_mass_is_one_spring() -> None:
    data = replace(ROPE, mass_per_length=1e-9, rope_weight=0.0)
    s = 1j * np.geomspace(0.01, 30.0, 80)
    assert distance(data, 1, s)["zw"] < 1e-6
    massless = replace(data, mass_per_length=0.0)
    np.testing.assert_allclose(
        line_response(massless, s, drag=3e3).zw,
        line_response(data, s, drag=3e3).zw,
        rtol=1e-6,
    )


def test_rope_is_the_textbook_formula() -> None:
    """G = P/Y = 1/(cosh g + Gamma sinh g), and the tension by differentiating the mode shape."""
    omega = np.linspace(0.1, 25.0, 60)
    s = 1j * omega
    C, tau = 5e3, ROPE.damping_time
    EA = ROPE.axial_stiffness * (1.0 + s * tau)
    g = s * 2000.0 * np.sqrt(8.1 / EA)
    Gamma = (ROPE.payload_mass * s**2 + C * s) * 2000.0 / (EA * g)
    P_Y, P_F, T_Y, T_F = rope_transfers(ROPE, s, C)
    G = 1.0 / (np.cosh(g) + Gamma * np.sinh(g))
    np.testing.assert_allclose(P_Y, G, rtol=1e-9)
    np.testing.assert_allclose(P_F, 2000.0 / (EA * g) * np.sinh(g) * G, rtol=1e-9)
    slope = g / 2000.0 * EA * (np.sinh(g) + Gamma * np.cosh(g)) * G
    np.testing.assert_allclose(T_Y, slope, rtol=1e-9)
    np.testing.assert_allclose(T_F, -G, rtol=1e-9)


def test_rope_rings_at_its_exact_modes() -> None:
    data = replace(ROPE, damping_ratio=0.0)
    modes = fixed_top_modes(1.6e8, 2000.0, 8.1, data.payload_mass, 6)
    for omega in modes:
        around = 1j * omega * np.array([1.0 - 1e-6, 1.0, 1.0 + 1e-6])
        inverse = 1.0 / rope_transfers(data, around, 0.0)[0]
        assert abs(inverse[1]) < 1e-3 * abs(inverse[0])
        assert inverse[0].real * inverse[2].real < 0.0


def test_slow_motion_is_quasi_static() -> None:
    P_Y, P_F, T_Y, T_F = rope_transfers(ROPE, np.array([1e-6j]), 3e3)
    assert P_Y[0] == pytest.approx(1.0)
    assert P_F[0] == pytest.approx(1.0 / ROPE.stiffness, rel=1e-6)
    moved = (ROPE.payload_mass + ROPE.rope_mass) * -1e-12 + 3e3 * 1e-6j
    assert T_Y[0] == pytest.approx(moved, rel=1e-6)
    assert T_F[0] == pytest.approx(-1.0)
    at_zero = rope_transfers(ROPE, np.array([0.0j]), 3e3)
    np.testing.assert_allclose(
        np.ravel(at_zero), [1.0, 1.0 / ROPE.stiffness, 0.0, -1.0], rtol=1e-12
    )


@given(
    re=st.floats(0.0, 5.0),
    im=st.floats(0.05, 50.0),
    length=st.floats(50.0, 4000.0),
    line=st.floats(0.1, 60.0),
    damping=st.floats(0.0, 0.2),
    drag=st.floats(0.0, 1e5),
)
@hypothesis_settings(max_examples=60)
def test_responses_are_real_systems(
    re: float, im: float, length: float, line: float, damping: float, drag: float
) -> None:
    """Conjugate points have conjugate responses; the rope's own response is passive."""
    data = replace(ROPE, rope_length=length, mass_per_length=line, damping_ratio=damping)
    s = np.array([re + 1j * im])
    up, down = (line_response(data, point, drag=drag) for point in (s, s.conj()))
    for block in BLOCKS:
        a, b = getattr(up, block), getattr(down, block)
        np.testing.assert_allclose(b, a.conj(), rtol=1e-9, atol=1e-300)
    # force over velocity at the upper end: positive real to the right of the axis
    impedance = (rope_transfers(data, s, drag)[2] / s)[0]
    assert impedance.real >= -1e-9 * abs(impedance)


def test_force_and_motion_are_reciprocal() -> None:
    """With an ideal gear, P/torque = theta/force: here P/E_a and haul/F in their units."""
    r = line_response(ROPE, 1j * np.linspace(0.1, 20.0, 50), drag=3e3)
    P_u = r.zu[:, r.outputs.index("payload.displacement"), 0]
    angle_F = r.column("drum.haul", "payload.force") / (ROPE.drum_radius / ROPE.gear_ratio)
    per_volt = ROPE.torque_constant / ROPE.resistance
    np.testing.assert_allclose(P_u, angle_F * per_volt, rtol=1e-9)


def test_far_out_nothing_overflows() -> None:
    s = np.array([1e3j, 1e5j, 1e8j, 1e4 + 1e4j, 1e7, 1e8 + 0j])
    for data in (ROPE, replace(ROPE, damping_ratio=0.0), MODERN):
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            r = line_response(data, s, drag=3e3)
        for block in BLOCKS:
            assert np.isfinite(getattr(r, block)).all()
        assert abs(r.column("payload.displacement", "hook.heave")[-1]) < 1e-12


def test_sensors_and_delay_are_in_the_measurements() -> None:
    omega = np.linspace(0.1, 40.0, 30)
    r = line_response(MODERN, 1j * omega, drag=3e3)
    s = 1j * omega
    shown = np.exp(-0.03 * s)
    for b in (MODERN.sensor_bandwidth, MODERN.telemetry_bandwidth):
        shown = shown * b**2 / (s**2 + math.sqrt(2.0) * b * s + b**2)
    P = r.column("payload.displacement", "hook.heave")
    np.testing.assert_allclose(r.yw[:, 2, 0], shown * P, rtol=1e-12)
    np.testing.assert_allclose(r.yw[:, 0, 0], shown * s**2 * P, rtol=1e-12)


def test_takes_a_case() -> None:
    case = load_case("subsea-crane")
    r = line_response(case, [0.5j, 1.0j], drag=3e3)
    wanted = line_response(PlantData.from_case(case), [0.5j, 1.0j], drag=3e3)
    np.testing.assert_array_equal(r.zw, wanted.zw)
    assert r.disturbances == ("hook.heave", "payload.force", "drive.set_point")


@every_variant
def test_the_tension_at_the_payload_is_what_its_inertia_and_drag_ask_for(data: PlantData) -> None:
    s, drag = 1j * np.linspace(0.05, 15.0, 60), 3e3
    asked = data.payload_mass * s**2 + drag * s
    for found, near in (
        (line_response(data, s, drag=drag), 1e-12),
        (build_plant(data, masses=1).linearise(drag=drag).response_at(s), 1e-9),
        (build_plant(data, masses=9).linearise(drag=drag).response_at(s), 1e-8),
    ):
        low, moved = (
            found.outputs.index(n) for n in ("rope.lower_tension", "payload.displacement")
        )
        for blocks, names in ((found.zw, found.disturbances), (found.zu, found.inputs)):
            for k, name in enumerate(names):
                wanted = asked * blocks[:, moved, k] - (name == "payload.force")
                np.testing.assert_allclose(blocks[:, low, k], wanted, rtol=near, atol=near)


def test_the_tension_at_the_payload_leaves_the_ropes_weight_out() -> None:
    for masses in (1, 4, 40):
        static = build_plant(load_case("subsea-crane"), masses=masses).linearise(drag=1e4).static
        assert static["rope.lower_tension"] == pytest.approx(421.7e3, rel=1e-9)
        assert static["rope.tension"] > 1.2 * static["rope.lower_tension"]
