"""Sweeps of every structure against one loop at a time, with its sensors, noise and delays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from designs import structure_design
from former_cases import load_case
from solved_loops import solved_variance

from models import load_case as shipped_case
from models.basics import Quadrature, spectral_nodes
from models.case import Case
from models.hook import HookMotion
from models.spread import Spread, Uniform
from synth.loop import Assessment
from synth.question import pose
from synth.sensitivity.fixed_design import FixedDesign
from synth.sweeps import FrequencyEngine

FloatArray = npt.NDArray[np.float64]

COMBINED = {
    "payload.acceleration_gain": 0.98162,
    "payload.velocity_gain": 1.6166,
    "payload.position_gain": 2.8879,
    "drum.position_gain": 0.65588,
    "heave.gain": 0.93224,
    "rolloff.corner": 20.741,
    "rolloff.damping": 1.0217,
    "heave.lead": 0.028445,
    "heave.bandwidth": 7.3838,
}
TENSION = {"drum.position_gain": 0.0052691, "tension.gain": 8.491e-06}
INTEGRAL = {
    "a": 21.3,
    "a1": 11.9,
    "a2": 66.4,
    "integral.corner": 0.05,
    "rolloff.corner": 120.0,
    "rolloff.damping": 0.7,
}
# A controller that is unstable itself, which the loop needs: its phase turns the other way.
LOW_ORDER = {
    "alpha1[1]": -8.1645,
    "alpha0[1]": 147750.0,
    "B[1.1,payload.acceleration]": -313410000.0,
    "B[1.1,payload.velocity]": -10873000000.0,
    "B[1.1,payload.displacement]": -15264000000000.0,
    "B[1.2,payload.acceleration]": 7646900000.0,
    "B[1.2,payload.velocity]": 15249000000000.0,
    "B[1.2,payload.displacement]": -62728000000.0,
}
OUTPUTS = {
    "payload_rms": "payload.displacement",
    "velocity_rms": "payload.velocity",
    "torque_rms": "motor.torque",
    "speed_rms": "motor.speed",
    "haul_rms": "drum.haul",
    "tension_rms": "rope.tension",
    "current_rms": "motor.current",
}
PLANT: Mapping[str, object] = {
    "payload.mass": "20 %",
    "stiffness": "20 %",
    "delay": Uniform("5 ms", "60 ms"),
    "winch.motor.inertia": "10 %",
    "payload.area": "30 %",
    "winch.gearbox.ratio": "2 %",
    "sensors.mru.delay": Uniform("0 ms", "80 ms"),
}
CRANE: Mapping[str, object] = {
    **PLANT,
    "sensors.mru.heave_filter_period": Uniform("60 s", "200 s"),
    "sensors.mru.noise_bandwidth": Uniform(0.5, 2.0),
    "sensors.mru.noise_fraction": Uniform(0.05, 0.3),
    "sensors.load_cell.bandwidth": Uniform("3 Hz", "8 Hz"),
    "sensors.payload.velocity_noise": "50 %",
    "sensors.payload.bandwidth": "20 %",
}
STATED: Mapping[str, object] = {
    **PLANT,
    "sensors.mru.gain_error": Uniform(0.0, 0.05),
    "sensors.mru.phase_error": Uniform("0 deg", "3 deg"),
    "sensors.mru.drift": Uniform("0 cm", "10 cm"),
    "sensors.mru.drift_period": Uniform("60 s", "300 s"),
    "sensors.mru.noise": Uniform(0.0, 2e-4),
    "sensors.mru.bandwidth": Uniform("1 Hz", "10 Hz"),
}
SLIGHT = {"payload.mass": "0.5 %"}


def crane() -> Case:
    return load_case("subsea-crane").replace({"rope.masses": 5})


def crane_of_two_falls() -> Case:
    rig = {"crane.tip_stiffness": 3e6, "rigging.stiffness": 5e6, "rigging.block_mass": 3e3}
    falls = {"rope.falls": 2, "winch.drum.radius": 1.07, "limits.drive": "report"}
    return crane().replace(rig | falls)


def stated_crane() -> Case:
    """The crane with a reference unit as makers state it."""
    unit = {"heave_filter_period": 200.0, "delay": 0.02, "gain_error": 0.02, "phase_error": 0.02}
    return crane().replace({"sensors.mru": {**unit, "drift": 0.05, "noise": 1e-4}})


def late_thesis() -> Case:
    """The thesis's winch with all sensors, its telemetry late, its payload's velocity noisy."""
    return load_case("thesis-1975").replace(
        {
            "sensors.telemetry.delay": 0.025,
            "sensors.mru": {"delay": 0.02, "noise_floor": 0.02},
            "sensors.payload.velocity_noise": 1e-3,
        }
    )


QUESTIONS = {
    "crane, combined": (crane, "combined", COMBINED, CRANE, "payload.velocity_gain"),
    "crane, stated": (stated_crane, "combined", COMBINED, STATED, "payload.velocity_gain"),
    "crane, tension": (crane, "constant-tension", TENSION, CRANE, "tension.gain"),
    "two falls, tension": (crane_of_two_falls, "constant-tension", TENSION, CRANE, "tension.gain"),
    "crane, corner": (crane, "combined", COMBINED, SLIGHT, "rolloff.corner"),
    "thesis, integral": (late_thesis, "payload-feedback-integral", INTEGRAL, PLANT, "a1"),
    "thesis, low order": (late_thesis, "low-order-2", LOW_ORDER, SLIGHT, "alpha1[1]"),
}


def alone(engine: FrequencyEngine, row: FloatArray) -> Assessment | None:
    """The same controller on the same case through state space; None if it is unstable."""
    own = FixedDesign.of(engine.design)
    moved = engine.spread.gains(row)
    values = [moved.get(name, value) for name, value in zip(own.names, own.values, strict=True)]
    case = engine.spread.case_at(row)
    return replace(own, case=case, values=tuple(values), known=None).assessment()


def with_coefficients(view: Assessment, known: Sequence[float]) -> Assessment:
    """The loop with its elements' coefficients given."""
    return Assessment(
        view._bare,
        view.controller,
        view.disturbances,
        elements=view.elements,
        coefficients=known,
    )


def substituted(view: Assessment, nodes: Quadrature) -> list[float]:
    """Coefficients that agree with the motion, each put where the motion asked for it."""
    known = [element.begin for element in view.elements]
    for _ in range(200):
        held, before = with_coefficients(view, known), known
        known = [
            float(e.coefficient(solved_variance(held, e.velocity, nodes))) for e in view.elements
        ]
        if np.allclose(known, before, rtol=1e-13, atol=0.0):
            return known
    raise AssertionError("the substitution does not settle")


@pytest.mark.ci
@pytest.mark.parametrize("name", QUESTIONS)
def test_sweep_of_a_structure_is_one_by_one_evaluation(name: str) -> None:
    make, structure, parameters, vary, gain = QUESTIONS[name]
    case = make()
    design = structure_design(case, structure, parameters)
    spread = Spread({**vary, f"gains.{gain}": "5 %"})
    hook = HookMotion.from_case(case)
    nodes = spectral_nodes(hook.band[0], 60.0, splits=hook.splits, per_panel=5)
    close = FrequencyEngine(design, spread, metrics=[*OUTPUTS, "drag"], nodes=nodes)
    own = FrequencyEngine(design, spread, metrics=[*OUTPUTS, "max_sensitivity"])
    rows = close.spread.sample(4, seed=2)
    found, free = close.evaluate(rows), own.evaluate(rows)
    assert own.rows.unresolved == 0
    # A free controller's numbers of 1e13 leave fewer digits to the state space.
    digits = 3e-8 if structure.startswith("low-order") else 1e-10
    assert found["stable"].any()
    for k, row in enumerate(rows):
        view = alone(close, row)
        assert bool(found["stable"][k]) == bool(free["stable"][k]) == (view is not None)
        if view is None:
            continue
        known = substituted(view, nodes)
        if view.elements:
            assert found["drag"][k] == pytest.approx(known[0], rel=1e-10)
        held = with_coefficients(view, known)
        for metric, output in OUTPUTS.items():
            expected = np.sqrt(solved_variance(held, output, nodes))
            assert found[metric][k] == pytest.approx(expected, rel=digits), metric
            assert free[metric][k] == pytest.approx(view.sigma(output), rel=1e-7), metric
        assert free["max_sensitivity"][k] == pytest.approx(view.max_sensitivity, rel=10.0 * digits)


def test_extremes_of_a_sweep_are_those_with_the_worst_signs_of_the_units_errors() -> None:
    case = stated_crane().replace({"limits.drive": "report", "limits.exceedance": 0.1})
    design = structure_design(case, "combined", COMBINED)
    metrics = {
        "torque_peak": "motor.torque.peak",
        "speed_peak": "motor.speed.peak",
        "tension_peak": "rope.tension.peak",
        "tension_least": "rope.tension.least",
        "lower_tension_least": "rope.lower_tension.least",
    }
    spread = Spread({name: STATED[name] for name in STATED if "error" in name})
    engine = FrequencyEngine(design, spread, metrics=[*metrics])
    rows = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05], [0.02, 0.05]])
    found = engine.evaluate(rows)
    for k, row in enumerate(rows):
        view = alone(engine, row)
        assert view is not None
        own = pose(engine.spread.case_at(row), "combined", design.masses)
        limits = {limit.name: limit for limit in own.reported}
        for metric, name in metrics.items():
            wanted = limits[name].worst(view)
            assert found[metric][k] == pytest.approx(wanted, rel=1e-5), (metric, row)
            if row.any():
                assert abs(limits[name].measure(view) / wanted - 1.0) > 1e-4, (metric, row)


def test_drag_and_friction_of_a_loop_that_hardly_decays_are_found_together() -> None:
    # M_s is some hundreds: with any other friction a drag that agrees is elsewhere, or nowhere.
    case = shipped_case("subsea-crane").replace(
        {"rope.masses": 15, "rope.damping_law": "kelvin-voigt"}
    )
    parameters = {
        "payload.acceleration_gain": 0.98162,
        "payload.velocity_gain": 1.6166,
        "payload.position_gain": 2.8879,
        "drum.position_gain": 0.65588,
        "heave.gain": 0.93224,
        "rolloff.corner": 20.741,
        "rolloff.damping": 1.0217,
        "heave.lead": 0.028445,
        "heave.bandwidth": 7.3838,
    }
    spread = Spread(
        {
            "payload.mass": "30 %",
            "rope.axial_stiffness": "20 %",
            "payload.drag_coefficient": "50 %",
            "sensors.telemetry.delay": Uniform("20 ms", "60 ms"),
        }
    )
    design = structure_design(case, "combined", parameters)
    engine = FrequencyEngine(design, spread, metrics=["payload_rms", "drag", "max_sensitivity"])
    rows = np.array(
        [
            [57259.44, 141536884.6, 2.135772422, 0.05900173526],
            [60595.09202, 145897464.4, 1.617306486, 0.04611887449],
        ]
    )
    found = engine.evaluate(rows)
    for k, row in enumerate(rows):
        view = alone(engine, row)
        assert view is not None
        assert found["stable"][k]
        assert found["drag"][k] == pytest.approx(view.coefficients[0], rel=1e-8)
        sigma = view.sigma("payload.displacement")
        assert found["payload_rms"][k] == pytest.approx(sigma, rel=1e-7)
        assert found["max_sensitivity"][k] == pytest.approx(view.max_sensitivity, rel=1e-6)
