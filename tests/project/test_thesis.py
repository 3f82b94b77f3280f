"""The 1975 thesis, reproduced: its tables as printed, and the figures that were found since.

The tables stand in `notebooks/thesis_tables.py`.  How close they can be met is their own matter:
they are readings of Bode plots, most with two digits; the accuracies asked for here are those at
which the worst case was identified from them.  Figures with more digits than the thesis has
("found since") were computed twice, by independent codes, before this one; they are asked for to
their last digit.
"""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from feedback import with_feedback
from plant_numbers import THESIS, THESIS_GAINS, thesis_numbers, thesis_transfer
from time_response import Sine, Step, time_response

from models import HookMotion, build_plant, load_case
from models.basics import spectral_nodes
from synth.design import evaluate_gains
from synth.loop import LinearController, closed_loop_poles
from synth.question import pose

PAYLOAD, HAUL, HOOK = "payload.displacement", "drum.haul", "hook.heave"
MEASURED = ("payload.acceleration", "payload.velocity", "payload.displacement")
MEAN_HEIGHT, MEAN_PERIOD = 1.524, 7.29  # H, T of Appendix B, as the tables use them [m], [s]


def _tables():
    path = Path(__file__).parents[2] / "notebooks" / "thesis_tables.py"
    spec = importlib.util.spec_from_file_location("thesis_tables", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLES = _tables()


@pytest.fixture(scope="module")
def case():
    return load_case("thesis-1975")


@pytest.fixture(scope="module")
def question(case):
    return pose(case)


@pytest.fixture(scope="module")
def loop(question):
    """The thesis's gains on the thesis's model."""
    return question.assess(THESIS_GAINS)


@pytest.fixture(scope="module")
def hook(case):
    return HookMotion.from_case(case)


@pytest.fixture(scope="module")
def closed(question):
    plant = question.plant
    A, a, a1, a2 = (THESIS_GAINS[name] for name in ("A", "a", "a1", "a2"))
    return with_feedback(
        plant, LinearController.static(-A * np.array([[a, a1, a2]]), MEASURED, plant.inputs)
    )


def band_rms(loop, hook, output, low, high):
    """Standard deviation of an output from the part of the sea between two frequencies."""
    poles = [p for p in loop.poles if abs(p.real) > 1e-9]
    nodes = spectral_nodes(low, high, splits=hook.splits, poles=poles)
    return math.sqrt(nodes.integrate(loop.spectrum(output, nodes.omega)))


def closed_forms(case, omega, **gains):
    from models.plant import PlantData

    numbers = thesis_numbers(PlantData.from_case(case), case.payload.fixed_drag)
    return thesis_transfer(omega, **numbers, **gains)


# --- the worst case ---------------------------------------------------------------------------


def test_the_identified_worst_case(case):
    K, M, C = case.rope.stiffness, case.moving_mass, case.payload.fixed_drag
    stiffness_per_mass, zeta = K / M, C / (2.0 * math.sqrt(K * M))
    assert stiffness_per_mass == pytest.approx(0.890, abs=5e-4)
    assert zeta == pytest.approx(0.0070, abs=5e-5)
    assert case.drum_radius == pytest.approx(0.413)
    assert case.static_tension == pytest.approx(452e3, abs=500.0)
    assert case.static_torque == pytest.approx(5.05e3, abs=5.0)


# --- Appendix B and Table 5: the spectrum -------------------------------------------------------


def test_table_b2_but_for_three_slips():
    nu, printed = TABLES.SHAPE.T
    formula = 3.434 * nu**-5 * np.exp(-0.675 * nu**-4)
    excess = printed / formula - 1.0
    slips = {0.55: 0.09, 0.65: 0.05, 0.75: 0.03}  # of the print: high by 9, 5 and 3 %
    for value, error in zip(nu, excess, strict=True):
        if value in slips:
            assert error == pytest.approx(slips[value], abs=0.005)
        else:
            assert abs(error) < (0.02 if value == 0.5 else 0.0095)


def test_table_5_is_table_b2_at_round_nu(hook):
    # The frequencies are nu 2 pi / T, cut to two digits; S follows the printed B-2, slips and all.
    nu = TABLES.SHAPE[:17, 0]
    omega = 2.0 * math.pi * nu / MEAN_PERIOD
    assert np.all(np.abs(omega - TABLES.HEAVE[1:, 0]) < 0.0082)
    from_b2 = TABLES.SHAPE[:17, 1] * MEAN_HEIGHT**2 * MEAN_PERIOD / (2.0 * math.pi)
    digits = np.where(TABLES.HEAVE[1:, 0] < 0.53, 0.5e-3, 5e-3)  # as printed
    assert np.all(np.abs(from_b2 - TABLES.HEAVE[1:, 2]) <= digits + 0.003 * from_b2)


def test_table_5_in_its_own_convention(hook):
    # A spectrum of wave height: eight times ours, at the frequencies that the table means.
    nu = TABLES.SHAPE[:17, 0]
    ours = 8.0 * hook.sea.density(2.0 * math.pi * nu / MEAN_PERIOD)
    deviation = ours / TABLES.HEAVE[1:, 2] - 1.0
    slipped = np.isin(nu, [0.55, 0.65, 0.75])
    assert np.all(np.abs(deviation[~slipped]) < 0.0095)
    np.testing.assert_allclose(deviation[slipped], [-0.080, -0.048, -0.032], atol=0.002)
    assert 8.0 * hook.sea.density([0.34])[0] < 0.0005  # printed 0


def test_the_height_spectrum_integrates_to_half_of_hs_squared(hook):
    # H_rms^2 = H_S^2 / 2, eight times the variance H_S^2 / 16; the constants are rounded, so that
    # it comes out as 3.434 / (4 x 0.675) H^2 where H = 0.625 H_S.
    assert 0.625 * hook.sea.significant_height == pytest.approx(MEAN_HEIGHT, rel=1e-12)
    exact = 3.434 / 2.7 * MEAN_HEIGHT**2
    assert 8.0 * hook.sea.statistics.m0 == pytest.approx(exact, rel=1e-6)
    assert exact == pytest.approx(2.4384**2 / 2.0, rel=0.007)


def test_table_5_heave(hook):
    omega, amplitude, S, R_H = TABLES.HEAVE.T
    np.testing.assert_allclose(np.abs(hook.rao.response(omega)), amplitude, rtol=1e-12)
    large = R_H >= 0.1
    np.testing.assert_allclose(amplitude[large] ** 2 * S[large], R_H[large], rtol=0.025)
    assert hook.displacement.rms == pytest.approx(0.594, abs=5e-4)


# --- the loop: eq. 32 to 34, Tables 7 to 9 ------------------------------------------------------


def test_the_plant_is_the_thesis_s(case, loop):
    omega = np.geomspace(0.01, 50.0, 200)
    thesis = closed_forms(case, omega, **THESIS_GAINS)
    np.testing.assert_allclose(loop.response(PAYLOAD, HOOK, omega), thesis["T"], rtol=1e-9)
    np.testing.assert_allclose(loop.response(HAUL, HOOK, omega), thesis["T_2"], rtol=1e-9)
    T_1 = loop.response(PAYLOAD, "drive.set_point", omega) * THESIS_GAINS["A"]
    np.testing.assert_allclose(T_1, thesis["T_1"], rtol=1e-9)


def test_table_7(loop):
    omega, printed = TABLES.PAYLOAD_RATIO.T
    ours = np.abs(loop.response(PAYLOAD, HOOK, omega))
    assert np.all(np.abs(ours / printed - 1.0) < 0.07)


def test_table_8(case):
    omega, printed, R_H, payload = TABLES.BEFORE.T
    ours = np.abs(closed_forms(case, omega)["G"]) ** 2
    deviation = np.abs(ours / printed - 1.0)
    allowed = np.full(omega.size, 0.06)
    allowed[omega == 0.86] = 0.105  # "10 %"
    allowed[omega == 1.03] = 0.21
    assert np.all(deviation < allowed)
    seen = R_H > 0.0
    np.testing.assert_allclose((printed * R_H)[seen], payload[seen], rtol=0.09, atol=0.005)


def test_table_9(loop):
    omega, printed, R_H, payload = TABLES.AFTER.T
    ours = 1e4 * np.abs(loop.response(PAYLOAD, HOOK, omega)) ** 2
    deviation = np.abs(ours / printed - 1.0)
    assert np.all(deviation < np.where(omega <= 0.43, 0.25, 0.10))
    assert np.all(np.abs(0.1 * printed * R_H - payload) < 0.3)


def test_drum_and_payload_identity(case, loop):
    # T_2 = T/G - 1: X = Y - Z and P = G Y, whatever the gains.
    omega = np.geomspace(0.05, 30.0, 300)
    G = closed_forms(case, omega)["G"]
    T, T_2 = (loop.response(output, HOOK, omega) for output in (PAYLOAD, HAUL))
    assert np.max(np.abs(T_2 - (T / G - 1.0))) < 1e-10 * np.max(np.abs(T / G))


def test_peaks(loop):
    omega = np.linspace(7.5, 7.8, 3001)
    X = np.abs(loop.response(HAUL, HOOK, omega))
    P = np.abs(loop.response(PAYLOAD, HOOK, omega))
    assert X.max() == pytest.approx(5.08, abs=0.005)
    assert omega[X.argmax()] == pytest.approx(7.67, abs=0.005)
    assert P.max() == pytest.approx(0.078, abs=0.0005)
    assert omega[P.argmax()] == pytest.approx(7.65, abs=0.005)


# --- found since: what the loop does, and how little it stands ----------------------------------


def test_payload_motion_before_and_after(question, loop):
    assert loop.sigma(PAYLOAD) == pytest.approx(11.7e-3, abs=0.05e-3)
    assert question.payload_rms_before == pytest.approx(5.99, abs=0.005)


def test_before_compensation_with_consistent_drag(case):
    own = pose(case.replace({"payload.drag": {"method": "stochastic"}}))
    assert own.payload_rms_before == pytest.approx(1.53, abs=0.005)
    # The thesis's C belongs to an amplitude of 0.12 m at 1.1 rad/s.
    energy = case.replace(
        {"payload.drag": {"method": "energy", "amplitude": 0.12, "frequency": 1.1}}
    )
    assert energy.payload.fixed_drag == pytest.approx(case.payload.fixed_drag, rel=0.01)
    assert own.drag_before > 15.0 * case.payload.fixed_drag


def test_margins(loop):
    m = loop.margins
    assert m.max_sensitivity == pytest.approx(5.15, abs=0.005)
    assert math.degrees(m.phase) == pytest.approx(11.3, abs=0.05)
    assert m.delay == pytest.approx(25.7e-3, abs=0.05e-3)
    assert m.gain_down == pytest.approx(0.092, abs=0.0005)
    assert m.gain == math.inf
    assert m.crossovers == pytest.approx([7.7], abs=0.05)


def test_conditional_stability(question, loop):
    (at,) = [w for w in loop.margins.real_axis_crossings if 1.5 < w < 3.0]
    assert at == pytest.approx(2.0, abs=0.05)
    assert loop.loop_gain(np.array([at]))[0] == pytest.approx(-10.9, abs=0.05)
    for share, stable in ((0.090, False), (0.094, True)):
        weaker = question.assess({**THESIS_GAINS, "A": share * THESIS_GAINS["A"]})
        assert weaker.stable is stable


def test_delay_margin_is_where_the_loop_goes_unstable(case):
    for delay, stable in ((0.0250, True), (0.0263, False)):
        late = pose(case.replace({"sensors.telemetry.delay": delay}))
        assert late.assess(THESIS_GAINS).stable is stable


@pytest.mark.parametrize(("high", "torque", "speed"), [(3.0, 4.9e3, 409.0), (60.0, 8.98e3, 420.0)])
def test_torque_and_speed(loop, hook, high, torque, speed):
    digits = 50.0 if high == 3.0 else 5.0
    assert band_rms(loop, hook, "motor.torque", 0.2, high) == pytest.approx(torque, abs=digits)
    rpm = 30.0 / math.pi * band_rms(loop, hook, "motor.speed", 0.2, high)
    assert rpm == pytest.approx(speed, abs=0.5)
    if high == 60.0:  # the whole sea: what a design reports
        assert loop.sigma("motor.torque") == pytest.approx(torque, abs=digits)


def test_figure_32(question, hook):
    # From 11.71 mm; found since for 0.2 to 3 rad/s, to a hundredth (the last digit cut).
    found = {"a": (11.90, 4.78), "a1": (11.03, 5.88), "a2": (11.05, 5.16)}
    for name, (millimetres, peak) in found.items():
        changed = question.assess({**THESIS_GAINS, name: 1.1 * THESIS_GAINS[name]})
        rms = 1e3 * band_rms(changed, hook, PAYLOAD, 0.2, 3.0)
        assert rms == pytest.approx(millimetres, abs=0.01)
        assert 1e3 * changed.sigma(PAYLOAD) == pytest.approx(rms, abs=0.01)  # the rest of the sea
        assert changed.margins.max_sensitivity == pytest.approx(peak, abs=0.005)


# --- in time: Figures 31 and 33 -----------------------------------------------------------------


def test_final_value_of_a_step_of_z_is_zero(closed, question):
    run = time_response(closed, {HOOK: Step()}, duration=60.0, step=0.05)
    assert abs(run[PAYLOAD][-1]) < 1e-6
    assert run[HAUL][-1] == pytest.approx(-1.0, abs=1e-6)  # the drum has hauled it all in
    # Without displacement gain the motion that is left is not zero: no integrator acts on it.
    law = LinearController.static([[-1e4, -2e4, 0.0]], MEASURED, question.plant.inputs)
    drift = time_response(
        with_feedback(question.plant, law), {HOOK: Step()}, duration=600.0, step=1.0
    )
    assert abs(drift[PAYLOAD][-1]) > 1e-3


def test_figure_33_unit_step_of_e_g(closed):
    run = time_response(
        closed, {"drive.set_point": Step(size=THESIS_GAINS["A"])}, duration=60.0, step=0.05
    )
    # T_1(0) = 1/a2; D(s) has no zeros but the start is of third order: P, P' and P'' begin at 0.
    assert run[PAYLOAD][-1] == pytest.approx(1.0 / THESIS_GAINS["a2"], rel=1e-5)
    assert run[PAYLOAD][0] == run["payload.velocity"][0] == 0.0


@pytest.mark.parametrize("omega", [0.5, 0.944, 2.0])
def test_figure_31_sines_of_z(closed, case, omega):
    run = time_response(closed, {HOOK: Sine(omega=omega)}, duration=100.0, step=0.01)
    late = run.time > 60.0
    T = closed_forms(case, [omega], **THESIS_GAINS)["T"][0]
    settled = np.imag(T * np.exp(1j * omega * run.time[late]))
    np.testing.assert_allclose(run[PAYLOAD][late], settled, atol=1e-6 * abs(T) + 1e-12)


# --- conclusions --------------------------------------------------------------------------------


def test_compliance_to_a_force_on_the_payload(case, loop):
    slow = loop.response(PAYLOAD, "payload.force", np.array([1e-4]))[0]
    # At rest the motor's torque balances the force, F r / n = K_T (A a2 P) / R; with the drum held
    # the payload gives by 1/K.
    n, r, R, K_T = 37.0, 0.413, 0.074, 5.8
    assert abs(slow) == pytest.approx(r / n * R / K_T / (200.0 * 100.0), rel=1e-3)
    assert abs(slow) < 1e-3 / case.rope.stiffness
    # On resonance |G| / K was 71 times 1/K.
    omega = np.array([0.944])
    before = abs(closed_forms(case, omega)["G"][0]) / case.rope.stiffness
    after = abs(loop.response(PAYLOAD, "payload.force", omega)[0])
    assert before / after == pytest.approx(3000.0, rel=0.05)


def test_tide_and_swell(loop):
    # P/Z at 0.01 rad/s: in proportion to omega, beta K / (M g a2) of it.
    slow = np.abs(loop.response(PAYLOAD, HOOK, np.array([0.005, 0.01])))
    assert slow[1] == pytest.approx(2.6e-4, abs=0.05e-4)
    assert slow[1] / slow[0] == pytest.approx(2.0, rel=1e-3)


def test_rope_tension(question, loop, hook, case):
    static = question.plant.static["rope.tension"]
    after = static + loop.peak("rope.tension", 10_800.0)
    assert after == pytest.approx(458e3, abs=500.0)

    def dynamic(q):
        """Rms of the tension and its three-hour peak with the drum held, by eq. 1 [N]."""
        K = q.case.rope.stiffness
        M, C = q.case.moving_mass, q.drag_before
        pole = complex(-0.5 * C / M, math.sqrt(K / M))
        nodes = spectral_nodes(*hook.band, splits=hook.splits, poles=[pole])
        G = K / (K - M * nodes.omega**2 + 1j * C * nodes.omega)
        density = np.abs(K * (1.0 - G)) ** 2 * hook.density(nodes.omega)
        m0, m2 = (float(nodes.integrate(density * nodes.omega**n)) for n in (0, 2))
        cycles = 10_800.0 / (2.0 * math.pi * math.sqrt(m0 / m2))
        return math.sqrt(m0), math.sqrt(2.0 * math.log(cycles) * m0)

    # Before, with the thesis's C: a standard deviation above the load itself; the rope would be
    # slack a sixth of the time, and a linear model has nothing to say.
    rms, _ = dynamic(question)
    assert rms > static
    moved = case.rope.stiffness * question.payload_rms_before  # the payload's far above the hook's
    assert rms == pytest.approx(moved, rel=0.02)
    # With consistent drag it stays taut, but nearly doubles its load.
    own = pose(case.replace({"payload.drag": {"method": "stochastic"}}))
    rms, peak = dynamic(own)
    assert rms == pytest.approx(103.5e3, abs=500.0)
    assert 0.8 * static < peak < static


# --- the rope is not one spring -----------------------------------------------------------------


@pytest.mark.parametrize(("masses", "growth"), [(2, 3.7), (5, 4.5), (10, 4.6), (20, 4.6)])
def test_unstable_on_a_rope_with_axial_modes(case, masses, growth):
    # The growth rates found since are for masses at the lower end of each piece, no damping.
    data = replace(THESIS, masses=masses, lumping="thesis")
    law = LinearController.static([[-1e4, -2e4, -2e4]], MEASURED, ("drive.command",))
    plant = build_plant(data).linearise(drag=case.payload.fixed_drag)
    assert closed_loop_poles(plant, law).real.max() == pytest.approx(growth, abs=0.05)
    # Both lumpings go to the same limit, 4.66 1/s.
    better = build_plant(replace(data, lumping="distributed")).linearise(drag=1187.2)
    found = closed_loop_poles(better, law).real.max()
    assert found == pytest.approx(4.66, abs={2: 1.0, 5: 0.13, 10: 0.04, 20: 0.02}[masses])


def test_second_axial_mode_on_the_crossover(case, loop):
    from models import fixed_top_modes

    rope = case.rope
    modes = fixed_top_modes(rope.ea, rope.length, rope.mass_per_length, 73_688.0, 2)
    assert modes[1] == pytest.approx(7.13, abs=0.005)
    assert rope.travel_time == pytest.approx(0.45, abs=0.005)
    assert loop.margins.crossovers[0] == pytest.approx(modes[1], rel=0.1)


def test_the_design_says_so_itself(case):
    design = evaluate_gains(case, THESIS_GAINS)
    assert not design.ok  # M_s 5.15 against 2
    assert "max_sensitivity" in design.status
    assert design.verification is not None
    assert "axial modes" in design.verification.status
    assert design.limits["motor.torque.peak"].use > 3.0
    assert not design.limits["motor.torque.peak"].enforced
