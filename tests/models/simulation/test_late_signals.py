"""Held readings and late commands in a run: what a design says of them happens in time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from former_cases import load_case

from models import Case, HookMotion
from models.plant import DriveLimits
from models.sensing import sensed_plant, sensed_spectra
from models.simulation import SimulationOptions, prepare, run_simulation
from synth import evaluate_gains
from synth.controllers import LinearFeedback
from synth.loop import LinearController
from synth.question import controller_for

CRANE = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.41}
ROLLOFF = {**CRANE, "rolloff.corner": 10.0, "rolloff.damping": 0.7}
PAYLOAD = ("payload.acceleration", "payload.velocity", "payload.displacement")
QUIET = {
    "sea.significant_height": 0.01,
    **{f"sensors.payload.{name.partition('.')[2]}_noise": 0.0 for name in PAYLOAD},
}
DRAG = 5000.0


def linear(
    case: Case, gains: dict[str, float] | LinearController, sample_time: float, duration: float
) -> Any:
    """A run with nothing but linear parts, without limits, ready."""
    parameters = {
        "payload.quadratic_drag": 0.0,
        "payload.linear_drag": DRAG,
        "winch.gear_switching": 0.0,
    }
    options = SimulationOptions(
        duration=duration, settle=60.0, limits=DriveLimits(), parameters=parameters
    )
    return prepare(case, LinearFeedback(case, gains, sample_time=sample_time), options=options)


def torque_of_noise(case: Case) -> float:
    """Standard deviation of the torque by the noise of the payload's sensors, from spectra."""
    omega = np.geomspace(1e-4, 4000.0, 100_001)
    blocks = sensed_plant(case, drag=DRAG).select(measurements=PAYLOAD).response(omega)
    C = -np.array([[CRANE["a"], CRANE["a1"], CRANE["a2"]]])
    F = blocks.zu @ C @ np.linalg.solve(np.eye(3) - blocks.yu @ C, blocks.yw)
    row = F[:, blocks.outputs.index("motor.torque")]
    spectra = sensed_spectra(case, HookMotion.from_case(case))
    parts = [
        np.trapezoid(
            np.abs(row[:, blocks.disturbances.index(name)]) ** 2 * spectra[name].density(omega),
            omega,
        )
        for name in (f"{signal}_noise" for signal in PAYLOAD)
    ]
    return math.sqrt(sum(parts))


@pytest.mark.ci
def test_torque_of_noise_does_not_hang_on_the_control_rate() -> None:
    case = load_case("subsea-crane").replace({"sea.significant_height": 0.01})
    found = {0.0: torque_of_noise(case)}
    for sample_time in (0.005, 0.01, 0.02):
        simulation = linear(case, CRANE, sample_time, 660.0)
        runs = [run_simulation(simulation, seed=seed).statistics for seed in range(4)]
        rms = [run["motor.torque"].standard_deviation for run in runs]
        found[sample_time] = math.sqrt(np.mean(np.square(rms)))
    # Every command of 20 ms is held over a fifth of the period of 10 Hz: 4 % less than the
    # spectrum of a loop without samples, and so all within 3 % of their mean.
    mean = np.mean(list(found.values()))
    assert all(value == pytest.approx(mean, rel=0.03) for value in found.values()), found
    assert found[0.005] == pytest.approx(found[0.0], rel=0.02)


def growth(case: Case, gains: dict[str, float]) -> float:
    """How much larger the motor's speed is late in a run than before; infinite if that tripped."""
    run = run_simulation(linear(case, gains, 0.005, 600.0), seed=1)
    speed = np.abs(run.values[:, run.signals.index("motor.speed")])
    early, late = (
        speed[(run.time > start) & (run.time < start + 200.0)] for start in (60.0, 399.0)
    )
    tripped = any(event.kind == "trip" for event in run.events) or late.max() == 0.0
    return math.inf if tripped else float(late.max() / early.max())


@pytest.mark.ci
@pytest.mark.parametrize(
    "changes",
    [
        {"sensors.payload.velocity_rate": "5 Hz"},
        {"winch.drive.command_delay": "37 ms"},
        {"sensors.payload.velocity_latency": "60 ms"},
    ],
    ids=["held", "late command", "latency"],
)
def test_a_run_is_unstable_from_the_gain_on_that_margins_say(changes: dict[str, str]) -> None:
    case = load_case("subsea-crane").replace(
        {
            **QUIET,
            **changes,
            "winch.losses": "hauling",  # the run has no loss that switches
            "limits.drive": "report",
            "payload.drag": {"method": "given", "coefficient": DRAG},
        }
    )
    limit = evaluate_gains(case, CRANE).margins.gain
    assert 1.1 < limit < 20.0
    calm, loud = (growth(case, {**CRANE, "A": factor * limit}) for factor in (0.95, 1.25))
    assert calm < 2.0
    assert loud > 10.0


def test_a_late_command_does_what_late_telemetry_does() -> None:
    # One sample, to the last digits but those of the order of operations.
    late = {
        "command": {"winch.drive.command_delay": 0.01},
        "telemetry": {"sensors.telemetry.delay": 0.04},
    }
    runs = {}
    for name, changes in late.items():
        case = load_case("subsea-crane").replace({**QUIET, **changes})
        run = run_simulation(linear(case, CRANE, 0.01, 120.0), seed=3)
        runs[name] = run.values[:, run.signals.index("payload.displacement")]
    size = np.abs(runs["command"]).max()
    assert np.abs(runs["command"] - runs["telemetry"]).max() < 1e-9 * size


def test_a_late_command_is_no_limit_to_a_controller_with_states() -> None:
    # Anti-windup compares what the drive did with what it was asked: a command on its way is both.
    late = {
        "command": {"winch.drive.command_delay": 0.02},
        "telemetry": {"sensors.telemetry.delay": 0.05},
    }
    runs = {}
    for name, changes in late.items():
        case = load_case("subsea-crane").replace({**QUIET, **changes})
        law = controller_for(case, "payload-feedback-rolloff", ROLLOFF)
        run = run_simulation(linear(case, law, 0.01, 120.0), seed=3)
        runs[name] = run.values[:, run.signals.index("motor.torque")]
    size = np.ptp(runs["telemetry"])
    assert np.abs(runs["command"] - runs["telemetry"]).max() < 1e-6 * size
