"""The independent check: good designs pass it, and every corrupted claim is caught by name."""

from __future__ import annotations

import ast
import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import synth
from models import load_case
from models.plant import LinearPlant
from synth import (
    Design,
    DragElement,
    LimitUse,
    LowOrder,
    MaxSensitivity,
    Peak,
    Rms,
    StaticGain,
    Tuning,
    White,
    evaluate_gains,
    tune,
)
from synth.verify import Check, Verification, agreement, bounded, verify_design, verify_tuning
from synth.verify.verification import failure

THESIS = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
SHALLOW = {"rope.length": "300 m", "limits.drive": "report"}


@pytest.fixture(scope="module")
def thesis() -> Design:
    """Return the 1975 gains on the one spring."""
    return evaluate_gains(load_case("thesis-1975"), THESIS)


@pytest.fixture(scope="module")
def shallow() -> Design:
    """Return gains for M_s = 2 on 300 m of rope with its modes and consistent drag."""
    case = load_case("thesis-1975-rope").replace(SHALLOW)
    return evaluate_gains(case, {"A": 200.0, "a": 3.234, "a1": 1.066, "a2": 25.76})


@pytest.fixture(scope="module")
def oscillator() -> Tuning:
    """Return a static gain for an oscillator under white noise."""
    plant = LinearPlant(
        A=[[0.0, 1.0], [-1.0, -0.02]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=np.eye(2),
        Cz=[[1.0, 0.0], [0.0, 0.0]],
        Dz=[[0.0], [1.0]],
        outputs=("x", "u"),
    )
    weights = {"x": 1.0, "u": 0.1}
    limits = [MaxSensitivity(bound=2.0)]
    noise = {"w1": White(1.0)}
    return tune(plant, StaticGain(), spectrum=noise, minimise=weights, limits=limits, starts=2)


def test_thesis_loop_on_one_spring_is_verified(thesis: Design) -> None:
    found = thesis.verify()
    assert found.ok, str(found)
    assert found.failed == ()
    # 1975 thesis's own loop, figures of two independent routes
    assert found["payload_rms"].found == pytest.approx(11.7e-3, abs=0.05e-3)
    assert found["margins.max_sensitivity"].found == pytest.approx(5.15, abs=0.01)
    assert found["margins.gain_down"].found == pytest.approx(0.092, abs=5e-4)
    assert found["margins.delay"].found == pytest.approx(25.7e-3, abs=0.1e-3)
    assert np.degrees(found["margins.phase"].found) == pytest.approx(11.3, abs=0.05)
    assert found["payload_rms_before"].found == pytest.approx(5.99, abs=0.01)
    assert found["winding number"].found == 0.0
    # growth rate of the slowest pole and the time-domain route, each by itself
    assert found["poles"].found < 0.0
    assert found["payload_rms.time"].found == pytest.approx(thesis.payload_rms, rel=0.01)


def test_one_spring_design_says_what_rope_modes_do_to_it(thesis: Design) -> None:
    found = verify_design(thesis)
    modes = found["rope modes"]
    assert not modes.ok
    assert not modes.counts
    assert modes.found == pytest.approx(4.6, abs=0.1)  # growth rate [1/s] on 20 masses
    assert "unstable" in found.status
    assert "one-spring" in found.status


@pytest.mark.parametrize(("delay", "unstable"), [(0.025, 0), (0.0256, 0), (0.0258, 2), (0.03, 2)])
def test_thesis_loop_with_delay(thesis: Design, delay: float, unstable: int) -> None:
    # The delay margin is 25.66 ms; the other claims of the design are stale and not looked at.
    case = thesis.case.replace({"sensors.telemetry.delay": delay})
    found = verify_design(replace(thesis, case=case))
    assert found["winding number"].found == unstable
    assert found["winding number"].ok == (unstable == 0)
    assert found["poles"].ok == (unstable == 0)
    assert not found.ok


def test_thesis_loop_on_the_rope_is_unstable(thesis: Design) -> None:
    given = {"payload.drag": {"method": "given", "coefficient": 1187.2}}
    case = load_case("thesis-1975-rope").replace(given)
    found = verify_design(replace(thesis, case=case, masses=10))
    assert not found.ok
    assert found["winding number"].found >= 2.0
    assert found["poles"].found > 3.0
    assert "winding number" in found.status
    assert set(found.failed) == {"winding number", "poles", "poles.design"}


def test_rope_design_is_verified_on_the_distributed_rope(shallow: Design) -> None:
    found = shallow.verify()
    assert found.ok, str(found)
    assert "distributed rope" in found["winding number"].note
    assert found["payload_rms.rope"].found == pytest.approx(shallow.payload_rms, rel=0.01)
    assert found["payload_rms.rope"].found != shallow.payload_rms  # another model of the rope
    assert found["rope.max_sensitivity"].found == pytest.approx(
        shallow.margins.max_sensitivity, rel=0.01
    )
    # q sqrt(8/pi) sigma of the payload's velocity
    assert found["drag"].found == pytest.approx(shallow.drag, rel=1e-5)


def test_hysteretic_rope_is_verified_by_a_law_written_once_more(shallow: Design) -> None:
    law = {"rope.damping_law": "hysteretic", "rope.damping_ratio": 0.02}
    design = evaluate_gains(shallow.case.replace(law), shallow.parameters)
    found = design.verify()
    assert found.ok, str(found)
    assert found["payload_rms_before"].found == pytest.approx(design.payload_rms_before, rel=1e-6)
    # The other law would move the payload otherwise with the drum held.
    viscous = replace(design, case=design.case.replace({"rope.damping_law": "kelvin-voigt"}))
    assert not viscous.verify().ok


@pytest.mark.parametrize("law", ["kelvin-voigt", "hysteretic"])
def test_boom_block_slings_and_falls_are_verified_too(shallow: Design, law: str) -> None:
    rig = {"crane.tip_stiffness": 2e6, "rigging.stiffness": 3e6, "rigging.block_mass": 2e3}
    more = {"rope.falls": 2, "winch.drum.radius": 0.7, "rope.masses": 6, "limits.drive": "report"}
    changes = {**rig, **more, "rope.damping_law": law, "rope.damping_ratio": 0.02}
    gains = {**shallow.parameters, "A": 20.0}
    design = evaluate_gains(shallow.case.replace(changes), gains)
    found = design.verify()
    assert found.ok, str(found)
    assert found["payload_rms_before"].found == pytest.approx(design.payload_rms_before, rel=1e-6)
    for path in rig:  # each of them is in what the check computes by itself
        none = 0.0 if path.endswith("mass") else None
        other = replace(design, case=design.case.replace({path: none}))
        assert not other.verify().ok, path


def test_undamped_rope_is_verified_on_twice_the_masses(shallow: Design) -> None:
    case = shallow.case.replace({"rope.damping_ratio": 0.0})
    found = verify_design(replace(shallow, case=case))
    assert f"{2 * shallow.masses} masses (undamped" in found["winding number"].note
    assert found["winding number"].found is not None


def flipped(design: Design) -> Design:
    return replace(design, parameters={**design.gains, "A": -design.gains["A"]})


def changed_use(design: Design, name: str, **changes: Any) -> Design:
    use = replace(design.limits[name], **changes)
    return replace(design, limits={**design.limits, name: use})


CORRUPTIONS: dict[str, tuple[Any, str]] = {
    "rms": (lambda d: replace(d, payload_rms=1.01 * d.payload_rms), "payload_rms"),
    "rms, a little": (lambda d: replace(d, payload_rms=1.00001 * d.payload_rms), "payload_rms"),
    "hook": (lambda d: replace(d, hook_rms=0.99 * d.hook_rms), "hook_rms"),
    "before": (
        lambda d: replace(d, payload_rms_before=1.001 * d.payload_rms_before),
        "payload_rms_before",
    ),
    "drag": (lambda d: replace(d, drag=1.02 * d.drag), "drag"),
    "drag before": (lambda d: replace(d, drag_before=0.98 * d.drag_before), "drag_before"),
    "signs": (flipped, "winding number"),
    "one gain": (
        lambda d: replace(d, parameters={**d.gains, "a1": 1.01 * d.gains["a1"]}),
        "margins.max_sensitivity",
    ),
    "no displacement gain": (
        lambda d: replace(d, parameters={**d.gains, "a2": 0.0}),
        "winding number",
    ),
    "not a number": (lambda d: replace(d, payload_rms=float("nan")), "payload_rms"),
    "no margins": (lambda d: replace(d, margins=None), "margins"),
    "another sea": (
        lambda d: replace(d, significant_height=0.9 * d.significant_height),
        "payload_rms",
    ),
    "masses": (lambda d: replace(d, masses=99), "stability"),
    "a limit's value": (
        lambda d: changed_use(
            d, "motor.torque.peak", value=0.999 * d.limits["motor.torque.peak"].value
        ),
        "limits.motor.torque.peak",
    ),
    "a limit's bound": (
        lambda d: changed_use(d, "motor.speed.peak", bound=1000.0),
        "limits.motor.speed.peak",
    ),
    "enforced or not": (
        lambda d: changed_use(d, "motor.voltage.peak", enforced=True),
        "limits.motor.voltage.peak",
    ),
    "a lost limit": (
        lambda d: replace(d, limits={k: v for k, v in d.limits.items() if k != "low_frequency"}),
        "limits.low_frequency",
    ),
    "a limit too many": (
        lambda d: replace(
            d,
            limits={**d.limits, "luck": LimitUse(name="luck", value=0.5, bound=1.0, use=0.5)},
        ),
        "limits.luck",
    ),
}


ON_THE_ROPE = ("rms", "before", "drag", "drag before", "signs", "a lost limit")


@pytest.mark.parametrize(
    ("which", "what"),
    [("thesis", what) for what in CORRUPTIONS] + [("shallow", what) for what in ON_THE_ROPE],
)
def test_a_corrupted_claim_is_caught(which: str, what: str, request: pytest.FixtureRequest) -> None:
    design: Design = request.getfixturevalue(which)
    corrupt, named = CORRUPTIONS[what]
    found = verify_design(corrupt(design))
    assert not found.ok
    assert named in found.failed, str(found)
    assert "failed" in found.status


@pytest.mark.parametrize("name", ["max_sensitivity", "gain", "gain_down", "phase", "delay", "disk"])
def test_a_corrupted_margin_is_caught(thesis: Design, name: str) -> None:
    value = getattr(thesis.margins, name)
    wrong = 20.0 if np.isinf(value) else 1.002 * value
    assert thesis.margins is not None
    found = verify_design(replace(thesis, margins=replace(thesis.margins, **{name: wrong})))
    assert found.failed == (f"margins.{name}",)
    assert found.status.startswith(f"the check of margins.{name} failed: claimed {wrong:.6g}")


def test_a_good_word_for_a_broken_limit_is_caught(thesis: Design) -> None:
    # M_s is 5.15 against 2: honest as long as the design does not count as good.
    assert not thesis.ok
    found = verify_design(replace(thesis, ok=True))
    assert found.failed == ("limits.max_sensitivity",)
    assert "breaks the bound 2" in found["limits.max_sensitivity"].note


def test_tuning_is_verified(oscillator: Tuning) -> None:
    found = oscillator.verify()
    assert found.ok, str(found)
    assert {"winding number", "poles", "cost", "cost.time", "limits.max_sensitivity"} <= {
        check.name for check in found.checks
    }
    # LQ optimum: static gains on both states are the full state feedback
    assert found["cost.time"].found == pytest.approx(oscillator.cost, rel=1e-6)


def test_corrupted_tunings_are_caught(oscillator: Tuning) -> None:
    tuned = oscillator
    margins, limit = tuned.margins, tuned.limits["max_sensitivity"]
    assert margins is not None
    assert tuned.controller is not None
    lost = {"max_sensitivity": replace(limit, value=0.9 * limit.value)}
    name, value = next(iter(tuned.parameters.items()))
    other = {**tuned.parameters, name: 1.001 * value}
    away = replace(tuned.controller, D=-10.0 * tuned.controller.D)
    for changes, named in (
        ({"cost": 1.001 * tuned.cost}, ("cost", "cost.time")),
        ({"margins": replace(margins, phase=0.5 * margins.phase)}, ("margins.phase",)),
        ({"limits": lost}, ("limits.max_sensitivity",)),
        ({"limits": {}}, ("limits.max_sensitivity",)),
        ({"parameters": other}, ("parameters",)),
        ({"parameters": {}}, ("parameters",)),
        ({"controller": None}, ("controller",)),
        ({"controller": away}, ("winding number", "poles")),
        ({"margins": None}, ("margins",)),
    ):
        found = verify_tuning(replace(tuned, **changes))  # type: ignore[arg-type]
        assert not found.ok
        assert found.failed == named, str(found)


def test_a_limit_of_a_users_own_fails_by_its_name_and_nothing_else_does(
    oscillator: Tuning,
) -> None:
    class Still(Rms):
        """A limit that this check has never heard of."""

    own = Still(bound=1e3, output="x", name="still")
    tuned = tune(
        oscillator.problem.plant,
        StaticGain(),
        spectrum={"w1": White(1.0)},
        minimise=oscillator.problem.minimise,
        limits=[MaxSensitivity(bound=2.0), own],
        starts=2,
    )
    assert "still" in tuned.limits
    for answer in (
        tuned,
        replace(tuned, limits={"max_sensitivity": tuned.limits["max_sensitivity"]}),
    ):
        found = verify_tuning(answer)
        assert found.failed == ("limits.still",), str(found)
        assert "is a Still, which there is no independent measure for" in str(found)


def test_tuning_of_an_unstable_plant_with_drag_and_delay() -> None:
    # An inverted pendulum with quadratic drag, heard late, under a table of wind gusts.
    plant = LinearPlant(
        A=[[0.0, 1.0], [1.0, -0.2]],
        B=[[0.0], [1.0]],
        E=[[0.0, 0.0], [1.0, 1.0]],
        C=np.eye(2),
        Cz=[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
        Dz=[[0.0], [0.0], [1.0]],
        disturbances=("wind", "drag"),
        outputs=("angle", "rate", "torque"),
        delays=(0.1, 0.05),
    )
    omega = np.linspace(0.1, 6.0, 60)
    gusts = (omega, np.exp(-((omega - 1.5) ** 2)))
    tuned = tune(
        plant,
        StaticGain(),
        spectrum={"wind": gusts},
        minimise={"angle": 1.0, "torque": 0.01},
        limits=[Peak(output="torque", bound=9.0, duration=600.0), MaxSensitivity(bound=2.5)],
        drag=DragElement(quadratic=0.5, velocity="rate", force="drag", reference=0.1),
        starts=2,
    )
    found = tuned.verify()
    assert tuned.ok
    assert found.ok, str(found)
    assert "1 open-loop poles are unstable" in found["winding number"].note
    assert found["coefficients.drag"].found == pytest.approx(tuned.coefficients[0], rel=1e-4)
    assert found["limits.torque.peak"].ok
    wrong = verify_tuning(replace(tuned, coefficients=(1.05 * tuned.coefficients[0],)))
    assert "coefficients.drag" in wrong.failed
    assert "cost" in wrong.failed
    # A bound that it does not keep, and still counts as good.
    peak, sensitivity = tuned.problem.limits
    tighter = (replace(peak, bound=0.9 * tuned.limits["torque.peak"].value), sensitivity)
    broken = verify_tuning(replace(tuned, problem=replace(tuned.problem, limits=tighter)))
    assert broken.failed == ("limits.torque.peak",)
    # The same controller, heard half a second later.
    late = replace(tuned.problem.plant, delays=(0.6, 0.55))
    worse = verify_tuning(replace(tuned, problem=replace(tuned.problem, plant=late)))
    assert worse.failed == ("winding number", "poles")


def test_tuning_of_a_plant_with_two_inputs() -> None:
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    forced = np.vstack([np.zeros((2, 2)), np.eye(2)])
    plant = LinearPlant(
        A=np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -0.05 * np.eye(2)]]),
        B=forced,
        E=forced,
        C=np.eye(4),
        Cz=np.vstack([np.eye(4)[:2], np.zeros((2, 4))]),
        Dz=np.vstack([np.zeros((2, 2)), np.eye(2)]),
        outputs=("x1", "x2", "f1", "f2"),
        delays=(0.05,) * 4,
    )
    weights = dict(zip(plant.outputs, (1.0, 1.0, 0.1, 0.1), strict=True))
    noise = {"w1": White(1.0), "w2": White(0.5)}
    tuned = tune(plant, StaticGain(), spectrum=noise, minimise=weights, starts=1)
    found = tuned.verify()
    assert tuned.ok
    assert found.ok, str(found)
    # Margins are the worst over both loops, and one of them is better.
    loops = [check for check in found.checks if check.name.startswith("margins.")]
    assert len(loops) == 6


def test_tuning_of_a_dynamic_controller() -> None:
    # Unstable plant, noisy measurement: an LQG problem with a controller of its order.
    plant = LinearPlant(
        A=[[0.0, 1.0], [1.0, 0.0]],
        B=[[0.0], [1.0]],
        E=[[0.0, 0.0], [1.0, 0.0]],
        C=[[1.0, 0.0]],
        F=[[0.0, 0.1]],
        Cz=[[1.0, 0.0], [0.0, 0.0]],
        Dz=[[0.0], [1.0]],
        outputs=("x", "u"),
    )
    noise = {"w1": White(1.0), "w2": White(1.0)}
    tuned = tune(plant, LowOrder(2), spectrum=noise, minimise={"x": 1.0, "u": 0.1}, starts=1)
    found = tuned.verify()
    assert tuned.ok
    assert found.ok, str(found)
    assert "4 poles" in found["poles"].note
    assert "1 open-loop poles are unstable" in found["winding number"].note


def test_a_loop_that_is_not_well_posed_fails() -> None:
    from synth.verify import LawMatrices, winding_of_plant
    from synth.verify.recheck import winding_check

    plant = LinearPlant(A=[[-1.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], D=[[1.0]])
    law = LawMatrices(
        A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[1.0]])
    )
    check = winding_check(winding_of_plant(plant, law), "the plant")
    assert not check.ok
    assert "not well posed" in check.note


def test_checks_compare_infinities_and_refuse_nan() -> None:
    assert agreement("x", np.inf, np.inf, 1e-3).ok
    assert not agreement("x", np.inf, 5.0, 1e-3).ok
    assert not agreement("x", 1.0, np.nan, 1e-3).ok
    assert not agreement("x", np.nan, np.nan, 1e-3).ok
    assert agreement("x", 1.0, 1.0009, 1e-3).ok
    assert not agreement("x", 1.0, 1.0011, 1e-3).ok
    assert agreement("x", 0.0, 1e-4, 1e-3, scale=1.0).ok
    assert bounded("x", 2.0, 2.03, 0.02).ok
    assert not bounded("x", 2.0, 2.05, 0.02).ok
    assert not bounded("x", 2.0, 1.95, 0.02, at_least=True).ok
    assert not bounded("x", 2.0, np.nan, 0.02).ok


def test_verification_says_what_failed() -> None:
    good = agreement("rms", 1.0, 1.0, 1e-3)
    aside = Check(name="modes", ok=False, note="but mind the modes", counts=False)
    assert Verification.of([good, aside], "fine").status == "fine; but mind the modes"
    assert Verification.of([good, aside], "fine").ok
    bad = [good, agreement("M_s", 2.0, 3.0, 1e-3, "by roots"), failure("drag", "no root")]
    found = Verification.of(bad, "fine")
    assert not found.ok
    assert found.status == (
        "the check of M_s failed: claimed 2, found 3; by roots (and 1 more: drag)"
    )
    text = str(found)
    assert "├ ok  rms: claimed 1, found 1" in text
    assert "└ BAD drag (no root)" in text
    assert not Verification.of([], "fine").ok
    with pytest.raises(KeyError):
        found["nothing"]


def test_the_check_shares_no_code_with_the_optimiser() -> None:
    # Not even types: what is checked comes in by protocols of the check's own.
    for path in sorted((Path(synth.__file__).parent / "verify").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert node.level < 2, (path.name, node.module)
            if isinstance(node, ast.ImportFrom | ast.Import):
                assert "synth" not in ast.unparse(node), (path.name, ast.unparse(node))


def test_verifying_warns_of_nothing(thesis: Design) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert verify_design(thesis).ok


def test_a_load_that_nothing_damps_moves_without_end_by_both_routes() -> None:
    still = {"method": "given", "coefficient": 0.0}
    case = load_case("thesis-1975").replace({"payload.drag": still, "rope.damping_ratio": 0.0})
    found = evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100}).verify()
    check = found["payload_rms_before"]
    assert check.ok
    assert (check.claimed, check.found) == (math.inf, math.inf)
    assert found["hook_rms"].ok
