"""Late commands and held readings in designs: margins, verification, sweeps."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from former_cases import load_case

from models.basics import PhysicsWarning
from models.spread import Spread, Uniform
from synth import evaluate_gains
from synth.question import pose
from synth.sweeps import FrequencyEngine

GAINS = {"A": 1.0, "a": 10.0, "a1": 30.0, "a2": 4.0}
REPORT = {"limits.drive": "report"}
READ = {
    "sensors.payload.velocity_rate": "5 Hz",
    "sensors.payload.acceleration_rate": "50 Hz",
    "sensors.payload.displacement_latency": "50 ms",
    "winch.drive.command_delay": "10 ms",
}


def test_a_delay_of_the_command_is_one_of_the_telemetry() -> None:
    case = load_case("subsea-crane").replace(REPORT)
    sent, told = (
        evaluate_gains(case.replace(change), GAINS)
        for change in ({"sensors.telemetry.delay": 0.05}, {"winch.drive.command_delay": 0.02})
    )
    for name in ("max_sensitivity", "gain", "phase", "delay", "disk"):
        pair = getattr(sent.margins, name), getattr(told.margins, name)
        assert pair[0] == pytest.approx(pair[1], rel=1e-12), name
    assert sent.payload_rms == pytest.approx(told.payload_rms, rel=1e-12)
    assert told.verify().ok


@pytest.mark.ci
def test_held_readings_are_verified_and_swept_as_they_are_designed() -> None:
    changes = {**REPORT, **READ, "rope.masses": 8}
    design = evaluate_gains(load_case("subsea-crane").replace(changes), GAINS)
    found = design.verify()
    assert found.ok, str(found)
    spread = Spread(
        {
            "sensors.payload.velocity_rate": Uniform(8.0 * np.pi, 12.0 * np.pi),
            "winch.drive.command_delay": Uniform(0.0, 0.02),
        }
    )
    engine = FrequencyEngine(design, spread, metrics=["payload_rms", "max_sensitivity"])
    rows = np.array([[10.0 * np.pi, 0.01], [8.0 * np.pi, 0.02]])
    solved = engine.evaluate(rows)
    for k, (rate, delay) in enumerate(rows):
        changes = {"sensors.payload.velocity_rate": rate, "winch.drive.command_delay": delay}
        one = evaluate_gains(design.case.replace(changes), GAINS)
        assert solved["payload_rms"][k] == pytest.approx(one.payload_rms, rel=1e-5)
        assert solved["max_sensitivity"][k] == pytest.approx(one.margins.max_sensitivity, rel=1e-4)


def test_a_gauge_that_feels_the_waves_is_told_of() -> None:
    case = load_case("subsea-crane").replace({"sea.peak_period": "12 s"})
    half = 0.5 * 9.80665 * 12.0**2 / (2.0 * np.pi)  # of a deep wave of 12 s: 112 m
    with pytest.warns(PhysicsWarning, match="pressure gauge would show the waves"):
        pose(case.replace({"rope.length": half - 1.0}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pose(case.replace({"rope.length": half + 1.0}))
        pose(case.replace({"rope.length": half - 1.0}), "feed-forward")
