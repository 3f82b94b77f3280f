"""Controllers of high order as designs: verified, saved, loaded, simulated, within all limits."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from former_cases import load_case

import stillhook as sh
from models.basics import InputError, SynthesisError
from synth.bound import bound_for
from synth.question import pose
from synth.structures import structure_named, structure_names

NOISY = {
    "sensors.payload.acceleration_noise": 1e-3,
    "sensors.payload.velocity_noise": 2e-3,
    "sensors.payload.displacement_noise": 2e-3,
    "sensors.telemetry.delay": "20 ms",
}


@cache
def spring() -> sh.Design:
    return sh.optimise_gains(load_case("thesis-1975").replace(NOISY), "high-order")


@pytest.mark.ci
def test_it_is_an_ordinary_design(tmp_path: Path) -> None:
    design = spring()
    assert design.ok
    assert design.verification is not None
    assert design.verification.ok
    order = int(design.structure.removeprefix("high-order-"))
    assert order == len(design.controller.A) < 30
    assert len(design.parameters) == order * (1 + len(design.measurements))
    assert design.measurements == (
        "payload.acceleration",
        "payload.velocity",
        "payload.displacement",
        "drum.haul",
        "motor.speed",
    )
    assert all(use.kept for use in design.limits.values() if use.enforced)
    again = sh.load_design(sh.save_design(design, tmp_path / "design.yaml"))
    assert again.parameters == design.parameters
    assert again.verify().ok
    given = sh.evaluate_gains(design.case, design.parameters, design.structure)
    assert given.payload_rms == pytest.approx(design.payload_rms, rel=1e-6)


@pytest.mark.ci
def test_it_is_no_better_than_the_bound_and_much_better_than_three_gains() -> None:
    design = spring()
    best = bound_for(design)
    assert best.rms is not None
    assert best.free.value < best.rms
    three = sh.optimise_gains(design.case, "payload-feedback", starts=4)
    assert design.payload_rms < 0.1 * three.payload_rms


@pytest.mark.ci
def test_few_states_are_asked_for_by_name() -> None:
    design = spring()
    with pytest.raises(SynthesisError, match="no truncation to 2 states"):
        sh.optimise_gains(design.case, "high-order-2")


def test_it_is_there_on_request_only() -> None:
    case = load_case("subsea-crane")
    assert not any(name.startswith("high-order") for name in structure_names())
    named = structure_named("high-order-12", case)
    assert named.name == "high-order-12"
    assert "rope.tension" in named.measurements
    assert "mru.heave" not in structure_named("high-order", load_case("thesis-1975")).measurements
    with pytest.raises(InputError, match="its order must be told with its parameters"):
        _ = pose(case, "high-order").law


@pytest.mark.slow
def test_on_the_crane_all_limits_are_kept_on_the_exact_rope() -> None:
    case = load_case("subsea-crane")
    design = sh.optimise_gains(case, "high-order")
    assert design.ok, design.status
    assert design.payload_rms < 1.6e-3
    assert design.limits["motor.power.peak"].use <= 1.0
    assert design.limits["gain_margin_down"].use <= 1.0
    assert "verified on the distributed rope" in str(design.verification)
    # It was made with the loss of the gear, which switches with the direction.
    real = sh.simulate(case, design, duration=900.0).runs[0]
    assert real.completed
    assert np.std(np.asarray(real["payload.displacement"])) < 1.1 * design.payload_rms
