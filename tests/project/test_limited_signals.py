"""Limits on signals of the drive hold sea, sensor noise, reference unit and losses everywhere."""

import math

import numpy as np
import pytest
from former_cases import load_case

import stillhook as sh
from models.spread import Spread
from synth.design import Design
from synth.operability import operability
from synth.sweeps import FrequencyEngine

LIMITED = {
    "motor.torque": ("peak", "continuous"),
    "motor.speed": ("peak",),
    "rope.tension": ("peak", "least"),
}
GAINS = {
    "payload.acceleration_gain": 12.5912,
    "payload.velocity_gain": 17.4464,
    "payload.position_gain": 43.3979,
    "drum.position_gain": 7.5,
    "heave.gain": 0.921626,
    "rolloff.corner": 3.01644,
    "rolloff.damping": 2.0,
    "heave.lead": 0.038024,
    "heave.bandwidth": 4.25241,
}
EXCEEDANCE, FRICTION = 0.1, 60.0
SHEAVES, SHEAVE = 4, 0.97


@pytest.fixture(scope="module")
def design() -> Design:
    changes = {
        "limits.exceedance": EXCEEDANCE,
        "limits.drive": "report",
        "winch.motor.coulomb_friction": FRICTION,
        "rope.sheaves": SHEAVES,
        "rope.sheave_efficiency": SHEAVE,
        "rope.skin_drag_coefficient": 0.02,
    }
    case = load_case("subsea-crane").replace(changes)
    return sh.evaluate_gains(case, GAINS, structure="combined")


def torques(case: sh.Case) -> tuple[float, float]:
    """Return mean and loss of the torque at rest [N m], by hand."""
    eta = case.winch.gearbox.efficiency * SHEAVE**case.rope.sheaves
    held = weight(case) * case.drum_radius / case.winch.gearbox.ratio
    return 0.5 * held * (1.0 / eta + eta), 0.5 * held * (1.0 / eta - eta) + FRICTION


def pulls(case: sh.Case) -> tuple[float, float]:
    """Return mean and loss of the tension at the drum at rest [N], by hand."""
    over = SHEAVE**case.rope.sheaves
    hauled, lowered = weight(case) / over, weight(case) * over
    return 0.5 * (hauled + lowered), 0.5 * (hauled - lowered)


def weight(case: sh.Case) -> float:
    return case.payload.submerged_weight + case.rope.submerged_weight


def test_every_limited_signal_holds_sea_unit_noise_and_losses(design: Design) -> None:
    case, loop = design.case, design.assessment
    at_rest = {"motor.torque": torques(case), "rope.tension": pulls(case)}
    sides = {}
    for signal, kinds in LIMITED.items():
        parts = dict(design.shares[signal])
        static, bounded = at_rest.get(signal, (0.0, 0.0))
        assert parts.pop("switching.loss", 0.0) == pytest.approx(bounded, rel=1e-9)
        assert {"hook.heave", "mru.error", "payload.acceleration_noise"} < set(parts)
        assert min(parts.values()) >= 0.0
        assert sum(v**2 for n, v in parts.items() if n != "hook.heave") > 0.0
        sigma = math.sqrt(sum(v**2 for v in parts.values()))
        waves = case.limits.exposure_time / loop.mean_period(signal)
        k = math.sqrt(2.0 * math.log(-waves / math.log(1.0 - EXCEEDANCE)))
        wanted = {
            "peak": static + bounded + k * sigma,
            "least": static - bounded - k * sigma,
            "continuous": math.hypot(static, bounded, sigma),
        }
        sides[signal] = wanted["peak"]
        for kind in kinds:
            found = design.limits[f"{signal}.{kind}"].value
            assert found == pytest.approx(wanted[kind], rel=1e-7), (signal, kind)
    power = design.limits["motor.power.peak"].value
    assert power == pytest.approx(sides["motor.torque"] * sides["motor.speed"], rel=1e-7)
    assert design.verification is not None
    assert design.verification.ok, design.verification.status


def test_the_warm_view_and_a_sweep_say_the_same(design: Design) -> None:
    look = sh.prepare(design.case, "combined").evaluate(design.parameters)
    for name, use in design.limits.items():
        assert look.limits[name].value == pytest.approx(use.value, rel=1e-6), name
    names = {
        "torque_peak": "motor.torque.peak",
        "speed_peak": "motor.speed.peak",
        "tension_peak": "rope.tension.peak",
        "tension_least": "rope.tension.least",
    }
    friction = Spread({"winch.motor.coulomb_friction": "10 %"})
    engine = FrequencyEngine(design, friction, metrics=[*names, "static_torque"])
    found = engine.evaluate(np.array([[FRICTION]]))
    for metric, name in names.items():
        assert found[metric][0] == pytest.approx(design.limits[name].value, rel=1e-5), metric
    assert found["static_torque"][0] == pytest.approx(sum(torques(design.case)), rel=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("motor.torque.peak", "winch.drive.torque_peak"),
        ("motor.power.peak", "winch.drive.power"),
        ("motor.speed.peak", "winch.drive.speed"),
        ("rope.tension.peak", "limits.rope_tension_peak"),
    ],
)
def test_operability_ends_where_the_design_says(design: Design, name: str, path: str) -> None:
    case = design.case
    if name == "rope.tension.peak":
        # In seas that hardly move it the drum's losses leave noise more of the rope's tension than
        # a sea of 2 m makes of it: the limit would be broken from a flat sea on.
        case = case.replace({"sea.significant_height": 6.0})
    bound = sh.evaluate_gains(case, design.parameters, structure="combined").limits[name].value
    case = case.replace({path: bound})
    tight = sh.evaluate_gains(case, design.parameters, structure="combined")
    period, heading = case.sea.spectral_peak_period, case.vessel.heading
    study = operability(tight, periods=[period], headings=[heading])
    limit = study.dataset.height_limit.sel(limit=name).item()
    assert limit == pytest.approx(case.sea.significant_height, rel=2e-3)


def test_a_dc_motor_holds_the_loss_in_current_and_voltage() -> None:
    gear = {"winch.gearbox.efficiency": 0.9, "winch.motor.coulomb_friction": FRICTION}
    gear |= {"rope.sheaves": 1, "rope.sheave_efficiency": SHEAVE}
    case = load_case("thesis-1975").replace({**gear, "limits.exceedance": EXCEEDANCE})
    found = sh.evaluate_gains(case, case.gains)
    loop, motor = found.assessment, case.winch.motor
    mean, loss = torques(case)
    for signal, per in (
        ("motor.current", 1.0 / motor.torque_constant),
        ("motor.voltage", motor.resistance / motor.torque_constant),
    ):
        waves = case.limits.exposure_time / loop.mean_period(signal)
        k = math.sqrt(2.0 * math.log(-waves / math.log(1.0 - EXCEEDANCE)))
        peak = (mean + loss) * per + k * loop.sigma(signal)
        assert found.limits[f"{signal}.peak"].value == pytest.approx(peak, rel=1e-7)
        assert found.shares[signal]["switching.loss"] == pytest.approx(loss * per, rel=1e-9)
    friction = Spread({"winch.motor.coulomb_friction": "10 %"})
    engine = FrequencyEngine(found, friction, metrics=["tension_peak", "tension_rms"])
    swept = engine.evaluate(np.array([[FRICTION]]))  # one spring without delay: by polynomials
    sigma, k = (
        loop.sigma("rope.tension"),
        loop.peak("rope.tension", case.limits.equivalent_exposure),
    )
    assert swept["tension_rms"][0] == pytest.approx(sigma, rel=1e-5)
    assert swept["tension_peak"][0] == pytest.approx(sum(pulls(case)) + k, rel=1e-5)


def test_losses_as_they_were_before_there_was_a_choice(design: Design) -> None:
    case = design.case.replace({"winch.losses": "hauling"})
    before = sh.evaluate_gains(case, design.parameters, structure="combined")
    hauled = case.static_torque_budget
    sigma = math.sqrt(sum(v**2 for v in before.shares["motor.torque"].values()))
    assert "switching.loss" not in before.shares["motor.torque"]
    continuous = before.limits["motor.torque.continuous"].value
    assert continuous == pytest.approx(math.hypot(hauled, sigma), rel=1e-7)
    less = design.limits["motor.torque.peak"].value - before.limits["motor.torque.peak"].value
    # But for the dry friction that was left out and for what losses as friction make of the motion.
    exposure = case.limits.equivalent_exposure
    reach, reached = (d.assessment.peak("motor.torque", exposure) for d in (design, before))
    assert less - (reach - reached) == pytest.approx(FRICTION, rel=1e-6)
    assert before.friction == 0.0 < design.friction
    assert before.verification is not None
    assert before.verification.ok, before.verification.status


def test_an_induction_motor_holds_the_loss_in_breakdown_and_heat(design: Design) -> None:
    case = design.case.replace({"winch.motor.kind": "induction"})
    found = sh.evaluate_gains(case, design.parameters, structure="combined")
    fast = found.limits["motor.speed.peak"].value / case.winch.motor.base_speed
    torque = design.limits["motor.torque.peak"].value
    breakdown = found.limits["motor.torque.breakdown"].value
    assert breakdown == pytest.approx(torque * fast**2, rel=1e-6)
    slow = design.limits["motor.torque.continuous"].value  # the speed hardly passes the base speed
    assert found.limits["motor.torque.continuous"].value == pytest.approx(slow, rel=0.05)
    assert found.verification is not None
    assert found.verification.ok, found.verification.status
