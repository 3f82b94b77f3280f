"""The sampled loop against runs in time, and against the continuous loop that it comes from."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from linear_runs import linear_run, sine_part, swell
from sampled_response import sampled_response

from models.plant import build_plant
from synth.controllers import ConstantTension, LinearFeedback, VelocityFeedForward
from synth.loop import LinearController, closed_loop_matrix
from synth.structures import DrumSpeedLoop, sampled_loop

DRAG = 3e4  # so much that transients end within the run [N s/m]
GAINS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
@pytest.mark.parametrize("kind", ["feed-forward", "feedback", "constant tension"])
def test_answer_to_a_swell_is_that_of_a_run_in_time(name: str, kind: str) -> None:
    case, omega = load_case(name), 0.9
    if case.sensors.mru:
        case = case.replace({"sensors.mru.heave_filter_period": None})
    plant = build_plant(case)
    if kind == "feed-forward":
        made = VelocityFeedForward(case, lead=0.1, position_gain=0.2, sample_time=0.05)
        loop = sampled_loop(case, plant, made.recursion, 0.05, drag=DRAG)
    elif kind == "feedback":  # with a state, behind telemetry that is late on one of the cases
        thesis = name == "thesis-1975"
        gain = np.array([[-3000.0, -3000.0, -800.0] if thesis else [-30.0, -60.0, -60.0]])
        lag = LinearController(
            A=[[-2.0]],
            B=[[0.0, 0.0, 2.0]],
            C=gain[:, 2:],
            D=gain * [1.0, 1.0, 0.0],
            measurements=PAYLOAD,
            inputs=("drive.command",),
        )
        made = LinearFeedback(case, lag, sample_time=0.05)
        loop = sampled_loop(case, plant, made.recursion, 0.05, drag=DRAG)
    else:  # no dead band, whose corner has no slope
        made = ConstantTension(case, dead_band=0.0, centring=0.2, sample_time=0.05)
        loop = made.linear_loop(case, plant, drag=DRAG)
    assert loop.stable
    run = linear_run(case, made, swell(omega, 0.1), duration=80.0, drag=DRAG, substeps=10)
    late = run["time"] > 60.0
    for output in ("payload.displacement", "drum.haul", "rope.tension", "motor.torque"):
        expected = sampled_response(case, loop, [output], [omega])[output][0]
        found = sine_part(run["time"][late], run[output][late], omega) / 0.1
        assert found == pytest.approx(expected, rel=1e-3), output


def test_a_reference_is_followed_as_in_a_run_in_time() -> None:
    case, omega = load_case("subsea-crane"), 1.3
    made = VelocityFeedForward(case, position_gain=0.3, sample_time=0.05)
    loop = sampled_loop(case, build_plant(case), made.recursion, 0.05, drag=DRAG)
    run = linear_run(
        case, made, swell(omega, 0.0), reference=swell(omega), duration=70.0, drag=DRAG
    )
    late = run["time"] > 50.0
    expected = sampled_response(
        case, loop, ["drum.haul"], [omega], source="reference.displacement"
    )["drum.haul"][0]
    found = sine_part(run["time"][late], run["drum.haul"][late], omega)
    assert found == pytest.approx(expected, rel=1e-3)


def test_fast_sampling_comes_to_the_continuous_loop_in_first_order() -> None:
    case, omega = load_case("thesis-1975"), np.array([0.3, 0.8, 2.0])
    plant = build_plant(case)
    feedback = LinearController.static([[-1e4, -2e4, -2e4]], PAYLOAD, ("drive.command",))
    # The continuous closed loop by its own matrices: P over Z from (s - A)^-1 E.
    lin = plant.linearise(drag=1187.2)
    closed = closed_loop_matrix(lin, feedback)
    on_u = feedback.D @ lin.F
    row = lin.outputs.index("payload.displacement")
    expected = []
    for s in 1j * omega:
        w = np.array([1.0, s, 0.0, 0.0])
        into = lin.E @ w + lin.B @ (on_u @ w)
        expected.append(lin.Cz[row] @ np.linalg.solve(s * np.eye(len(closed)) - closed, into))
    errors = []
    for T in (0.002, 0.001):
        law = LinearFeedback(case, GAINS, sample_time=T)
        loop = sampled_loop(case, plant, law.recursion, T, drag=1187.2)
        found = sampled_response(case, loop, ["payload.displacement"], omega)
        errors.append(np.abs(found["payload.displacement"] / np.array(expected) - 1.0))
        assert loop.stable
    assert np.all(errors[0] < 5e-3)
    assert errors[0] / errors[1] == pytest.approx(np.full(3, 2.0), rel=0.1)


def test_poles_are_those_of_the_continuous_loop_mapped_by_the_exponential() -> None:
    case, T = load_case("thesis-1975"), 1e-3
    law = LinearFeedback(case, GAINS, sample_time=T)
    poles = sampled_loop(case, build_plant(case), law.recursion, T, drag=1187.2).poles()
    lin = build_plant(case).linearise(drag=1187.2)
    feedback = LinearController.static([[-1e4, -2e4, -2e4]], PAYLOAD, ("drive.command",))
    for s in np.linalg.eigvals(closed_loop_matrix(lin, feedback)):
        assert np.abs(poles - np.exp(s * T)).min() < 0.03 * abs(s * T)


def test_the_thesis_loop_is_unstable_on_a_rope_with_modes() -> None:
    case = load_case("thesis-1975-rope")
    law = LinearFeedback(case, GAINS)
    assert not sampled_loop(case, build_plant(case), law.recursion, 0.01).stable


def test_a_drum_that_nobody_holds_in_place_counts_as_stable() -> None:
    case = load_case("thesis-1975")
    loop = DrumSpeedLoop.from_case(case)
    found = sampled_loop(case, build_plant(case), loop.recursion(), 0.02)
    assert np.abs(found.poles()).max() == pytest.approx(1.0, abs=1e-12)
    assert found.stable
