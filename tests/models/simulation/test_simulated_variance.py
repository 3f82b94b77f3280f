"""Long simulations against the spectrum: two routes to every variance that a design reports.

The spectral value is the integral of |F|^2 S with F the closed loop at each frequency, by two
codes: `SampledLoop`, which knows what a signal is at the samples, and the design's continuous loop
with the hold of a sampled controller as a transfer.  They differ where a signal jumps at the
samples, as the torque of a motor without inductance does.  The simulation is that of the nonlinear
plant with its nonlinear parts taken out by parameters, not by another code.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from former_cases import load_case
from sampled_response import sampled_response

from models import Case, HookMotion, build_plant
from models.plant import DriveLimits
from models.simulation import SimulationOptions, prepare, run_simulation
from synth import evaluate_gains
from synth.controllers import BrakeOn, LinearFeedback
from synth.question import pose
from synth.structures import sampled_loop

SEEDS, DURATION = 16, 1260.0
OUTPUTS = (
    "payload.displacement",
    "payload.velocity",
    "motor.torque",
    "motor.speed",
    "rope.tension",
)

# Near the best gains of each loop, rounded.
THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
THESIS_LATE = {"A": 1.0, "a": 2108.0, "a1": 1081.0, "a2": 3784.0}
CRANE = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.41}

# The sea alone is compared: what its sensors' noise does to a loop is tested elsewhere.
SILENT = {
    f"sensors.payload.{name}_noise": 0.0 for name in ("acceleration", "velocity", "displacement")
}
CASES = {
    "thesis": ("thesis-1975", {}, THESIS, 0.005),
    "thesis, 50 ms": ("thesis-1975", {"sensors.telemetry.delay": 0.05}, THESIS_LATE, 0.01),
    "crane": ("subsea-crane", {**SILENT, "sensors.telemetry.delay": 0.0}, CRANE, 0.01),
    "crane, 30 ms": ("subsea-crane", SILENT, CRANE, 0.01),
}


def continuous_rms(
    case: Case, gains: dict[str, float], sample_time: float, drag: float
) -> dict[str, float]:
    """Standard deviations from the design's loop with the hold of the samples in it, by output."""
    hook = HookMotion.from_case(case)
    plant = build_plant(case).linearise(drag=drag)
    omega = np.geomspace(*hook.band, 100_001)
    blocks = plant.response(omega)
    C = -gains["A"] * np.array([[gains["a"], gains["a1"], gains["a2"]]])
    late = 1j * omega * sample_time
    hold = (-np.expm1(-late) / late)[:, np.newaxis, np.newaxis]
    loop = np.eye(3) - blocks.yu @ (hold * C)
    F = blocks.zw + blocks.zu @ (hold * C) @ np.linalg.solve(loop, blocks.yw)
    heave = blocks.disturbances.index("hook.heave")
    rows = {name: F[:, blocks.outputs.index(name), heave] for name in OUTPUTS}
    return _rms(rows, hook, omega)


def sampled_rms(case: Case, controller: LinearFeedback, drag: float) -> dict[str, float]:
    """Standard deviations at the samples, by output."""
    hook = HookMotion.from_case(case)
    T = controller.sample_time
    loop = sampled_loop(case, build_plant(case), controller.recursion, T, drag=drag)
    omega = np.geomspace(*hook.band, 3001)
    rows = sampled_response(case, loop, OUTPUTS, omega)
    motor = case.winch.motor
    if motor.type == "dc" and motor.inductance == 0.0:
        # The torque jumps with the voltage; a run logs it just after, not before the jump.
        link, late = case.sensors.telemetry, -1j * omega
        heard = [
            rows["payload.displacement"] * (1j * omega) ** order * np.exp(late * link.delay)
            for order in (2, 1, 0)
        ]
        gains = controller.controller.D[0]
        rows["motor.voltage"] = sum(g * y for g, y in zip(gains, heard, strict=True))
        emf = motor.back_emf_constant * rows["motor.speed"]
        current = (rows["motor.voltage"] - emf) / motor.resistance
        rows["motor.torque"] = motor.torque_constant * current
    return _rms(rows, hook, omega)


def _rms(rows: dict[str, np.ndarray], hook: HookMotion, omega: np.ndarray) -> dict[str, float]:
    density = hook.density(omega)
    return {
        name: math.sqrt(np.trapezoid(np.abs(row) ** 2 * density, omega))
        for name, row in rows.items()
    }


def unlimited(parameters: dict[str, float]) -> SimulationOptions:
    """Return a drive without limits, and plant parameters by name."""
    return SimulationOptions(
        duration=DURATION, settle=60.0, limits=DriveLimits(), parameters=parameters
    )


@pytest.mark.ci
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
    controller = LinearFeedback(case, gains, sample_time=sample_time)
    simulation = prepare(case, controller, options=unlimited(linear))
    expected = sampled_rms(case, controller, drag)
    designed = continuous_rms(case, gains, sample_time, drag)
    for signal in ("payload.displacement", "motor.speed", "rope.tension"):
        assert expected[signal] == pytest.approx(designed[signal], rel=2e-3), signal
    found: dict[str, list[float]] = {signal: [] for signal in expected}
    for seed in range(SEEDS):
        run = run_simulation(simulation, seed=seed)
        for signal in expected:
            found[signal].append(run.statistics[signal].standard_deviation ** 2)
    for signal, variances in found.items():
        error = np.std(variances, ddof=1) / math.sqrt(SEEDS)
        distance = (np.mean(variances) - expected[signal] ** 2) / error
        assert abs(distance) < 3.0, f"{signal}: {distance:.2f} standard errors"
        assert error < 0.05 * expected[signal] ** 2, signal  # or the test says little


@pytest.mark.ci
@pytest.mark.parametrize("height", [1.0, 2.5])
def test_stochastic_drag_predicts_the_rms_that_quadratic_drag_leaves(height: float) -> None:
    # On the same seeds as a linear plant with that drag: what is left is the linearisation.
    case = load_case("subsea-crane").replace({"sea.significant_height": height})
    design = evaluate_gains(case, CRANE)
    rms = {}
    for name, parameters in {
        "quadratic": {"winch.gear_switching": 0.0},
        "linear": {
            "winch.gear_switching": 0.0,
            "payload.quadratic_drag": 0.0,
            "payload.linear_drag": design.drag,
        },
    }.items():
        controller = LinearFeedback(case, CRANE, sample_time=0.02)
        simulation = prepare(case, controller, options=unlimited(parameters))
        runs = [run_simulation(simulation, seed=s) for s in range(6)]
        variances = [r.statistics["payload.displacement"].standard_deviation ** 2 for r in runs]
        rms[name] = math.sqrt(np.mean(variances))
    assert rms["quadratic"] == pytest.approx(rms["linear"], rel=0.03)
    assert rms["quadratic"] != pytest.approx(rms["linear"], rel=1e-6)  # it did something


@pytest.mark.ci
def test_skin_drag_in_every_piece_calms_a_resonant_load_as_its_share_at_the_load_does() -> None:
    deep = {
        "rope.length": 2000.0,
        "rope.axial_stiffness": 127.6e6,  # the first mode is at 8.2 s, in the sea
        "winch.drum.rope_on_drum_total": 2500.0,
        "sea.significant_height": 1.5,
    }
    simulated, predicted = [], []
    for coefficient in (0.0, 0.02):  # 22 % of the payload's drag, were it all at the load
        case = load_case("subsea-crane").replace(
            {**deep, "rope.skin_drag_coefficient": coefficient}
        )
        predicted.append(pose(case).payload_rms_before)
        simulation = prepare(case, BrakeOn(case), options=SimulationOptions(duration=3600.0))
        runs = [run_simulation(simulation, seed=s) for s in range(2)]
        variances = [r.statistics["payload.displacement"].standard_deviation ** 2 for r in runs]
        simulated.append(math.sqrt(np.mean(variances)))
    less = simulated[1] / simulated[0]
    assert less < 0.985
    assert predicted[1] / predicted[0] == pytest.approx(less, abs=0.003)


MRU = {"heave_filter_period": 200.0, "delay": 0.02}
STATED = {
    "gain": {"gain_error": 0.05},
    "phase": {"phase_error": math.radians(3.0)},
    "drift": {"drift": 0.05, "drift_period": 60.0},
    "noise": {"noise": 1e-4},
}
FOLLOWING = {
    "feed-forward": {
        "drum.position_gain": 0.05,
        "heave.gain": 0.97845,
        "heave.lead": 0.65903,
        "heave.bandwidth": 1.4173,
    },
    "combined": {
        "payload.acceleration_gain": 0.98162,
        "payload.velocity_gain": 1.6166,
        "payload.position_gain": 2.8879,
        "drum.position_gain": 0.65588,
        "heave.gain": 0.93224,
        "rolloff.corner": 20.741,
        "rolloff.damping": 1.0217,
        "heave.lead": 0.028445,
        "heave.bandwidth": 7.3838,
    },
}


@pytest.mark.ci
@pytest.mark.parametrize("structure", FOLLOWING)
def test_each_error_of_the_reference_unit_leaves_what_the_design_says(structure: str) -> None:
    drag, seeds, parameters = 5000.0, 6, FOLLOWING[structure]
    linear = {
        "payload.quadratic_drag": 0.0,
        "payload.linear_drag": drag,
        "winch.gear_switching": 0.0,
    }
    exact = load_case("subsea-crane").replace(
        {
            **SILENT,
            "sea.significant_height": 0.5,
            "payload.drag": {"method": "given", "coefficient": drag},
            "sensors.mru": {**MRU, "noise_floor": 0.0, "noise_fraction": 0.0},
        }
    )

    def series(case: Case) -> list[dict[str, np.ndarray]]:
        """Payload motion and motor speed of each seed."""
        law = pose(case, structure).controller(parameters)
        controller = LinearFeedback(case, law, sample_time=0.01)
        simulation = prepare(case, controller, options=unlimited(linear))
        runs = [run_simulation(simulation, seed=seed) for seed in range(seeds)]
        late = [run.time > 200.0 for run in runs]
        return [
            {name: run[name][use] for name in ("payload.displacement", "motor.speed")}
            for run, use in zip(runs, late, strict=True)
        ]

    without = series(exact)
    for kind, stated in STATED.items():
        case = exact.replace({"sensors.mru": {**MRU, **stated}})
        view, runs = pose(case, structure).assess(parameters, [0.0]), series(case)
        for name in ("payload.displacement", "motor.speed"):
            # On a linear plant the error alone is the difference to the unit without errors.
            pairs = zip(runs, without, strict=True)
            found = [np.var(one[name] - other[name]) for one, other in pairs]
            share = view.shares(name)["mru.error"]
            distance = np.mean(found) / share**2 - 1.0
            error = np.std(found, ddof=1) / math.sqrt(seeds) / share**2
            assert abs(distance) < max(0.06, 3.0 * error), (kind, name)
            assert error < 0.15, (kind, name)
