"""Predictive control as C in `sh.simulate`: where it pays, and the same run."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from laws_in_c import needs_compiler

import stillhook as sh
from models.operation import scenario_named
from models.simulation import SimulationOptions
from mpc.winch import ProcessNoise, Weights
from stillhook.controllers import with_c, with_c_if_any
from stillhook.runs import Series

CASE = load_case("thesis-1975")
WEIGHTS = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.05, rope=0.1))


def predictive(**options: object) -> sh.LinearMPC:
    return sh.LinearMPC(CASE, weights=WEIGHTS, predictor="kalman", **options)  # type: ignore[arg-type]


def series(controller: object, duration: float, **options: object) -> Series:
    scenario = scenario_named("hold", CASE)
    return Series.prepare(
        CASE, controller, scenario, SimulationOptions(duration=duration, **options)
    )  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def pays_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let it pay from ten minutes on, so that the tests are short."""
    monkeypatch.setattr("stillhook.runs.simulation._PAYS", 600.0)


@needs_compiler
def test_a_long_run_is_the_same() -> None:
    mpc = predictive()
    in_c, in_python = series(mpc, 600.0), series(mpc, 599.95)
    assert in_c.simulation.fused
    assert not in_python.simulation.fused
    runs = [one.run(3) for one in (in_c, in_python)]
    rows = min(len(run.time) for run in runs)
    for name in ("payload.displacement", "drive.command", "motor.torque"):
        one, other = (run[name][:rows] for run in runs)
        assert np.abs(one - other).max() <= 1e-6 * np.ptp(other)
    assert runs[0].timings.controller_median > 0.0
    assert runs[0].timings.statuses == runs[1].timings.statuses


@needs_compiler
def test_what_has_no_c_is_called_from_python() -> None:
    law = sh.LinearFeedback(CASE, {"a": 1.0, "a1": 5.0, "a2": 3.0})
    assert with_c_if_any(law) is law
    told = predictive(
        fallback=sh.LinearFeedback(CASE, {"a": 1, "a1": 5, "a2": 3}, sample_time=0.05)
    )
    assert with_c_if_any(told) is told
    assert with_c(told) is not told
    assert not series(told, 600.0).simulation.fused
    assert not series(predictive(), 600.0, compiled=False).simulation.fused
    assert not series(predictive(), 600.0, deadline=1.0).simulation.fused


@pytest.mark.ci
@needs_compiler
def test_a_comparison_counts_the_same_of_both(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = sh.simulate(CASE, predictive(), seeds=1, duration=600.0)[0]
    monkeypatch.setattr("stillhook.runs.simulation._PAYS", 1e9)
    again = sh.simulate(CASE, predictive(), seeds=1, duration=600.0)[0]
    assert scenario.statistics.value("payload rms") == pytest.approx(
        again.statistics.value("payload rms"), rel=1e-6
    )
    assert scenario.timings.statuses == again.timings.statuses
