"""Responses in time against closed forms, python-control, and the response over frequency."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from feedback import with_feedback
from plant_numbers import MODERN, THESIS, THESIS_DRAG, THESIS_FEEDBACK
from time_response import Sine, Step, time_response

from models.basics import InputError
from models.plant import LinearPlant, build_plant
from synth.loop import LinearController, closed_loop_poles

PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")
THESIS_CONTROLLER = LinearController.static(THESIS_FEEDBACK, PAYLOAD, ("drive.command",))


def oscillator(omega: float = 2.0, zeta: float = 0.1) -> LinearPlant:
    """x'' + 2 zeta omega x' + omega^2 x = u + w + 0.5 w', seen through x, x' and x''."""
    A = [[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]
    return LinearPlant(
        A=A,
        B=[[0.0], [1.0]],
        E=[[0.0, 0.0], [1.0, 0.5]],
        C=[[1.0, 0.0], [0.0, 1.0]],
        Cz=[[1.0, 0.0], [0.0, 1.0], A[1]],
        Dz=[[0.0], [0.0], [1.0]],
        Fz=[[0.0, 0.0], [0.0, 0.0], [1.0, 0.5]],
        inputs=["u"],
        disturbances=["w", "w_rate"],
        rates={"w_rate": "w"},
        outputs=["x", "v", "a"],
    )


def test_step_of_an_oscillator():
    omega, zeta = 2.0, 0.1
    run = time_response(oscillator(omega, zeta), {"u": Step(size=3.0)}, duration=12.0, step=0.07)
    damped = omega * math.sqrt(1.0 - zeta**2)
    t = run.time
    decay = np.exp(-zeta * omega * t)
    shape = np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
    assert t[-1] == pytest.approx(11.97)
    np.testing.assert_allclose(run["x"], 3.0 / omega**2 * (1.0 - decay * shape), atol=1e-13)
    assert run["a"][0] == pytest.approx(3.0)  # the force acts on the mass at once


def test_the_impulse_in_a_steps_rate_moves_the_state_at_once():
    both = time_response(oscillator(), {"w": Step()}, duration=5.0, step=0.1)
    assert both["v"][0] == pytest.approx(0.5)  # the impulse 0.5 on a unit mass
    # w + 0.5 w' is one unit step plus half the step's derivative.
    plain = time_response(oscillator(), {"u": Step()}, duration=5.0, step=0.1)
    np.testing.assert_allclose(both["x"], plain["x"] + 0.5 * plain["v"], atol=1e-13)


def test_a_sine_settles_at_the_frequency_response():
    plant = oscillator()
    omega = 1.7
    run = time_response(plant, {"w": Sine(amplitude=2.0, omega=omega)}, duration=120.0, step=0.01)
    late = run.time > 100.0  # exp(-0.2 * 100) is 2e-9
    for row, name in enumerate(plant.outputs):
        gain = plant.response([omega]).zw[0, row, 0]
        wanted = 2.0 * np.imag(gain * np.exp(1j * omega * run.time[late]))
        np.testing.assert_allclose(run[name][late], wanted, atol=2e-8)
    assert run["x"][0] == run["v"][0] == 0.0


def test_signals_add_up_and_samples_do_not_depend_on_the_step():
    signals = {"u": Step(size=-1.0), "w": Sine(amplitude=0.3, omega=3.0)}
    fine = time_response(oscillator(), signals, duration=8.0, step=0.02)
    coarse = time_response(oscillator(), signals, duration=8.0, step=0.4)
    np.testing.assert_allclose(fine.values[:, ::20], coarse.values, atol=1e-12)
    parts = [
        time_response(oscillator(), {name: signal}, duration=8.0, step=0.4).values
        for name, signal in signals.items()
    ]
    np.testing.assert_allclose(coarse.values, parts[0] + parts[1], atol=1e-12)


def test_a_closed_loop_against_python_control():
    import control

    plant = build_plant(replace(MODERN, delay=0.0)).linearise(drag=5e3)
    law = LinearController(
        A=np.array([[-4.0]]),
        B=np.array([[0.0, 1.0, 0.0]]),
        C=np.array([[-3.0]]),
        D=np.array([[-0.5, -2.0, -1.0]]),
        measurements=PAYLOAD,
        inputs=("drive.command",),
    )
    closed = with_feedback(plant, law)
    run = time_response(closed, {"payload.force": Step(size=1e4)}, duration=30.0, step=0.05)
    # The same loop by python-control: all inputs and disturbances, all measurements and outputs.
    open_loop = plant.to_control()
    heard, led = open_loop.noutputs, open_loop.ninputs
    B, C, D = np.zeros((1, heard)), np.zeros((led, 1)), np.zeros((led, heard))
    B[:, :3], C[:1], D[:1, :3] = law.B, law.C, law.D
    loop = control.feedback(open_loop, control.ss(law.A, B, C, D), sign=1)
    forced = np.zeros((5, run.time.size))
    forced[open_loop.input_labels.index("payload_force")] = 1e4
    oracle = control.forced_response(loop, run.time, forced).outputs[3:]
    assert [name.replace(".", "_") for name in run.outputs] == open_loop.output_labels[3:]
    scale = np.abs(oracle).max(axis=1, keepdims=True)
    np.testing.assert_allclose(run.values / scale, oracle / scale, atol=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(closed.poles()), np.sort_complex(closed_loop_poles(plant, law)), rtol=1e-7
    )


def test_closed_loop_with_delay_keeps_its_frequency_response():
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    late = replace(plant, delays=(0.02, 0.02, 0.02))
    closed = with_feedback(late, THESIS_CONTROLLER, pade_order=8)
    omega = np.geomspace(0.05, 20.0, 60)
    exact = late.response(omega)
    F = exact.zw + exact.zu @ THESIS_FEEDBACK @ np.linalg.solve(
        np.eye(3) - exact.yu @ THESIS_FEEDBACK, exact.yw
    )
    np.testing.assert_allclose(closed.response(omega).zw, F, rtol=1e-6, atol=1e-12)
    assert closed.poles().real.max() < 0.0
    # 25.7 ms is the delay margin of this loop (1975 thesis's gains on one spring).
    beyond = with_feedback(replace(plant, delays=(0.027,) * 3), THESIS_CONTROLLER)
    assert beyond.poles().real.max() > 0.0


def test_commands_add_to_the_feedback():
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    closed = with_feedback(plant, THESIS_CONTROLLER)
    by_command = time_response(closed, {"drive.command": Step()}, duration=20.0, step=0.5)
    by_set_point = time_response(closed, {"drive.set_point": Step()}, duration=20.0, step=0.5)
    np.testing.assert_allclose(by_command.values, by_set_point.values, atol=1e-12)
    assert by_command["payload.displacement"][-1] == pytest.approx(1.0 / 20_000.0, rel=1e-3)


def test_a_feedback_may_use_some_signals_only():
    plant = build_plant(THESIS).linearise(drag=THESIS_DRAG)
    one = LinearController.static([[-2e4]], PAYLOAD[2:], ("drive.command",))
    all_three = LinearController.static([[0.0, 0.0, -2e4]], PAYLOAD, ("drive.command",))
    np.testing.assert_allclose(with_feedback(plant, one).A, with_feedback(plant, all_three).A)


def test_bad_input():
    plant = oscillator()
    with pytest.raises(InputError, match=r"no input or disturbance 'wind'; there are: u, w$"):
        time_response(plant, {"wind": Step()}, duration=1.0, step=0.1)
    with pytest.raises(InputError, match="no input or disturbance 'w_rate'"):
        time_response(plant, {"w_rate": Step()}, duration=1.0, step=0.1)
    with pytest.raises(InputError, match=r"duration must be .*0.1.* s, got 0.05"):
        time_response(plant, {"u": Step()}, duration=0.05, step=0.1)
    with pytest.raises(InputError, match="size of the step of u must be a finite number"):
        time_response(plant, {"u": Step(size=math.nan)}, duration=1.0, step=0.1)
    run = time_response(plant, {"u": Step()}, duration=1.0, step=0.1)
    with pytest.raises(InputError, match="no output 'y'"):
        run["y"]
    with pytest.raises(ValueError, match="read-only"):
        run.values[0, 0] = 1.0
    wire = LinearPlant(
        A=np.zeros((0, 0)), B=np.zeros((0, 1)), E=np.zeros((0, 0)), C=np.zeros((1, 0)), D=[[1.0]]
    )
    with pytest.raises(InputError, match="not well posed"):
        with_feedback(wire, LinearController.static([[1.0]], ("y1",), ("u1",)))
