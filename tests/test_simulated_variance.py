"""Long simulations against the spectrum: two routes to every variance that a design reports.

The spectral value is the integral of |F|^2 S with F the closed loop at each frequency, delays and
the hold of a sampled controller exact.  The simulation is that of the nonlinear plant with its
nonlinear parts taken out by parameters, not by another code.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from models import Case, HookMotion, build_plant, load_case
from models.drive import DriveLimits
from models.simulate import run_simulation
from models.simulation import prepare
from synth.linear_feedback import LinearFeedback

SEEDS, DURATION = 24, 1260.0
OUTPUTS = ("payload.displacement", "motor.torque", "motor.speed", "rope.tension")

# Near the best gains of each loop, rounded.
THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
THESIS_LATE = {"A": 1.0, "a": 2108.0, "a1": 1081.0, "a2": 3784.0}
CRANE = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.41}

CASES = {
    "thesis": ("thesis-1975", {}, THESIS, 0.005),
    "thesis, 50 ms": ("thesis-1975", {"sensors.telemetry.delay": 0.05}, THESIS_LATE, 0.01),
    "crane": ("subsea-crane", {"sensors.telemetry.delay": 0.0}, CRANE, 0.01),
    "crane, 30 ms": ("subsea-crane", {}, CRANE, 0.01),
}


def spectral_rms(
    case: Case, gains: dict[str, float], sample_time: float, drag: float
) -> dict[str, float]:
    """Standard deviations from the closed loop's frequency response, by output."""
    hook = HookMotion.from_case(case)
    plant = build_plant(case).linearise(drag=drag)
    # lightly damped poles need nodes of their own: a fine grid does without knowing them
    omega = np.geomspace(*hook.band, 200_001)
    blocks = plant.response(omega)
    C = -gains["A"] * np.array([[gains["a"], gains["a1"], gains["a2"]]])
    late = 1j * omega * sample_time
    hold = (-np.expm1(-late) / late)[:, np.newaxis, np.newaxis]
    loop = np.eye(3) - blocks.yu @ (hold * C)
    u = (hold * C) @ np.linalg.solve(loop, blocks.yw)
    F = blocks.zw + blocks.zu @ u
    heave = blocks.disturbances.index("hook.heave")
    density = hook.density(omega)
    result = {}
    for name in OUTPUTS:
        row = F[:, blocks.outputs.index(name), heave]
        result[name] = math.sqrt(np.trapezoid(np.abs(row) ** 2 * density, omega))
    row = u[:, 0, heave]
    result["drive.command"] = math.sqrt(np.trapezoid(np.abs(row) ** 2 * density, omega))
    return result


@pytest.mark.parametrize("name", CASES)
def test_simulated_variance_is_within_three_standard_errors_of_the_spectral_value(
    name: str,
) -> None:
    bundled, changes, gains, sample_time = CASES[name]
    case = load_case(bundled).replace({"sea.significant_height": 0.3, **changes})
    drag = 5000.0
    linear = {"payload.quadratic_drag": 0.0, "payload.linear_drag": drag}
    if "winch.gear_switching" in build_plant(case).parameters:
        linear["winch.gear_switching"] = 0.0  # the mean of the gear's two losses, as the design
    simulation = prepare(
        case,
        LinearFeedback(case, gains, sample_time=sample_time),
        limits=DriveLimits(),
        parameters=linear,
    )
    expected = spectral_rms(case, gains, sample_time, drag)
    found: dict[str, list[float]] = {signal: [] for signal in expected}
    for seed in range(SEEDS):
        run = run_simulation(simulation, seed=seed, duration=DURATION, settle=60.0)
        for signal in expected:
            found[signal].append(run.statistics[signal].standard_deviation ** 2)
    for signal, variances in found.items():
        error = np.std(variances, ddof=1) / math.sqrt(SEEDS)
        distance = (np.mean(variances) - expected[signal] ** 2) / error
        assert abs(distance) < 3.0, f"{signal}: {distance:.2f} standard errors"
        assert error < 0.05 * expected[signal] ** 2, signal  # or the test says little
