"""The prepared view: its looks against verified designs, what it keeps, its warm descent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from former_cases import load_case

from models import InputError
from synth.design import Look, evaluate_gains, optimise_gains, prepare
from synth.operability.pose import pose_operability
from synth.question import FamilyProblem, pose

CASES = {
    "thesis-1975": {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0},
    "thesis-1975-rope": {"A": 200.0, "a": 0.4684, "a1": 0.3252, "a2": 0.7769},
    "subsea-crane": {"A": 1.0, "a": 16.02, "a1": 44.36, "a2": 6.416},
    "landing": {"A": 1.0, "a": 96.03, "a1": 189.64, "a2": 2020.0},
}
THESIS = CASES["thesis-1975"]


def agree(name: str, count: int, seed: int) -> None:
    """Compare looks at random stable designs with what is verified."""
    case, rng = load_case(name), np.random.default_rng(seed)
    view, compared, drawn = prepare(case), 0, 0
    while compared < count:
        drawn += 1
        assert drawn < 40 * count
        gains = {k: v * float(np.exp(0.7 * rng.normal())) for k, v in CASES[name].items()}
        look = view.evaluate(gains)
        if not look.stable:
            assert not evaluate_gains(case, gains).ok
            continue
        compared += 1
        design = evaluate_gains(case, gains)
        assert design.margins is not None
        assert look.margins is not None
        assert look.masses == design.masses
        assert look.payload_rms == pytest.approx(design.payload_rms, rel=1e-3)
        worst = design.margins.max_sensitivity
        assert look.margins.max_sensitivity == pytest.approx(worst, rel=5e-3)
        assert look.drag == pytest.approx(design.drag, rel=1e-3)
        assert set(look.limits) == set(design.limits)
        for limit, use in design.limits.items():
            assert look.limits[limit].use == pytest.approx(use.use, rel=5e-3, abs=1e-6)
            assert look.limits[limit].enforced == use.enforced


@pytest.mark.ci
@pytest.mark.parametrize("name", CASES)
def test_a_look_agrees_with_a_verified_design(name: str) -> None:
    agree(name, 12, 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_looks_agree_with_a_thousand_verified_designs(name: str) -> None:
    agree(name, 250, 4)


LIGHTER = {"rope.damping_ratio": 0.0002}
COMBINED = {
    "payload.acceleration_gain": 12.56,
    "payload.velocity_gain": 17.23,
    "payload.position_gain": 42.97,
    "drum.position_gain": 7.5,
    "heave.gain": 0.9207,
    "rolloff.corner": 3.015,
    "rolloff.damping": 2.0,
    "heave.lead": 0.03777,
    "heave.bandwidth": 4.24,
}


@pytest.mark.ci
def test_a_look_at_a_family_agrees_with_verified_designs_of_its_members() -> None:
    case = load_case("subsea-crane")
    view = prepare(case, "combined", members=[LIGHTER])
    seen = set()
    for change in ({}, {"drum.position_gain": 6.75}, {"payload.position_gain": 34.4}):
        gains = {**COMBINED, **change}
        look = view.evaluate(gains)
        seen.add(look.ok)
        (member,) = look.members
        assert member.case == case.replace(LIGHTER)
        each = [evaluate_gains(one.case, gains, "combined") for one in (look, member)]
        for one, design in zip((look, member), each, strict=True):
            assert one.margins is not None
            assert design.margins is not None
            assert one.masses == design.masses
            assert one.payload_rms == pytest.approx(design.payload_rms, rel=1e-3)
            worst = design.margins.max_sensitivity
            assert one.margins.max_sensitivity == pytest.approx(worst, rel=5e-3)
            assert {u.name for u in one.limits.values() if u.kept} == {
                u.name for u in design.limits.values() if u.kept
            }
        assert look.stable
        assert look.ok == all(design.ok for design in each)
        assert look.family_rms == max(look.payload_rms, member.payload_rms)
    assert seen == {True, False}


def test_a_member_that_fails_is_told_and_a_change_reaches_every_member() -> None:
    case = load_case("thesis-1975")
    view = prepare(case, members=[{"limits.max_sensitivity": 1.01}], objective="mean")
    gains = view.optimise(THESIS).gains
    look = view.evaluate(THESIS)
    assert not look.ok
    assert look.objective == "mean"
    assert "limits.max_sensitivity 1.01: stable; breaks max_sensitivity" in look.status
    squares = [one.payload_rms**2 for one in (look, *look.members)]
    assert look.family_rms == pytest.approx(np.sqrt(np.mean(squares)))

    rougher = view.replace({"sea.significant_height": 1.2 * case.sea.significant_height})
    found = rougher.evaluate(gains)
    assert [one.case for one in (found, *found.members)] == [
        q.case.replace({"sea.significant_height": 1.2 * case.sea.significant_height})
        for q in view.posed.questions
    ]
    kept = zip(view.posed.questions, rougher.posed.questions, strict=True)
    assert all(before.model is after.model for before, after in kept)


@pytest.mark.ci
def test_a_warm_descent_of_a_family_finds_its_optimum_nearby() -> None:
    case, members = load_case("thesis-1975"), [{"rope.length": 1500.0}]
    best = optimise_gains(case, "payload-feedback", members=members)
    start = {name: v * (1.0 if name == "A" else 0.9) for name, v in best.gains.items()}

    design = prepare(case, members=members).optimise(start, verify=True)

    assert design.ok, design.status
    assert design.verification is not None
    assert design.family_rms == pytest.approx(best.family_rms, rel=1e-4)
    assert [one.parameters for one in design.members] == [design.parameters]


@pytest.mark.ci
def test_a_loop_that_swings_by_itself_without_its_drag_is_seen_on_the_verge() -> None:
    """Its pole is 4e-5 1/s from the axis, where nodes for a little more drag do not see it."""
    gains = {"A": 2.275003319, "a": 3.517917461, "a1": 34.96444923, "a2": 8.398323470}
    # With losses the drum is calmer and the payload has less drag, too little without them.
    case = load_case("subsea-crane").replace({"winch.losses": "hauling"})
    look, design = prepare(case).evaluate(gains), evaluate_gains(case, gains)
    assert look.stable
    assert design.margins is not None
    assert look.drag == pytest.approx(design.drag, rel=1e-6)
    assert look.payload_rms == pytest.approx(design.payload_rms, rel=1e-6)

    # In small motion drag vanishes: no sea is calm enough, and all who are asked say so.
    for one in (look, design):
        assert not one.ok
        assert one.status.startswith("unstable in small motion, where drag vanishes: it swings by")
    problem, values = design.question.problem, design.question.values(gains)
    loop = problem.assess(values, [design.drag])
    assert loop.held
    assert loop.swings
    assert not problem.stable(values, [design.drag])
    assert not FamilyProblem.of(problem).stable(values, [[design.drag]])
    assert FamilyProblem.of(problem).abscissa(values) > 0.0
    assert FamilyProblem.of(problem).growth(values) > 0.0 > problem.growth(values)
    asked = pose_operability(design, ())
    assert asked.loop is not None
    assert asked.loop.swings
    # A design that called itself good all the same is found out.
    assert replace(design, ok=True).verify().failed[0] == "poles.calm"

    # No drag holds this one off the axis.
    gains = {"A": 0.889238533, "a": 48.22058768, "a1": 27.66414557, "a2": 6.365940700}
    look, design = prepare(case).evaluate(gains), evaluate_gains(case, gains)
    assert not look.stable
    assert design.margins is None
    assert "on the verge" in design.status


def test_a_loop_that_nothing_damps_does_not_swing_by_itself() -> None:
    changes = {"rope.damping_ratio": 0.0, "limits.drive": "report"}
    posed = pose(load_case("subsea-crane").replace(changes), "payload-feedback", 3)
    assert posed.drag is not None
    still = [0.0] * len(posed.law.parameters)
    assert abs(posed.problem.loop_poles(still, posed.problem.nothing).real.max()) < 1e-8
    assert not posed.problem.assess(still, posed.problem.nothing).swings


def test_the_curves_are_those_of_the_figures() -> None:
    look = prepare(load_case("thesis-1975")).evaluate(THESIS)

    assert isinstance(look, Look)
    assert look.stable
    assert look.verification is None
    assert look.margins is not None
    nearest = 1.0 / np.abs(1.0 + look.loop_gain).min()
    assert nearest <= look.margins.max_sensitivity  # which is refined between the frequencies
    assert nearest == pytest.approx(look.margins.max_sensitivity, rel=5e-2)
    assert np.sqrt(np.trapezoid(look.spectrum, look.omega)) == pytest.approx(
        look.payload_rms, rel=5e-2
    )
    assert look.residual == look.payload_rms / look.hook_rms
    assert look.response.shape == look.omega.shape


def test_an_unstable_loop_has_a_growth_rate_and_nothing_else() -> None:
    look = prepare(load_case("thesis-1975")).evaluate({**THESIS, "a1": -1e4})

    assert not look.stable
    assert not look.ok
    assert look.growth > 0.0
    assert look.payload_rms == np.inf
    assert look.margins is None


@pytest.mark.parametrize("gains", [{"a": 1.0}, {**THESIS, "b": 1.0}, None])
def test_unknown_and_missing_gains_are_refused(gains: Any) -> None:
    with pytest.raises(InputError, match="gains: must be a, a1, a2 and optionally A"):
        prepare(load_case("thesis-1975")).evaluate(gains)


@pytest.mark.parametrize(
    "changes",
    [
        {"sea.significant_height": 3.0},
        {"sea.peak_period": 11.0},
        {"limits.max_sensitivity": 1.5},
        {"sensors.telemetry.delay": 0.2},
        {"rope.length": 1400.0},
        {"payload.mass": 60000.0},
        {"vessel.heading": 2.0},
        {"winch.drum.inertia": 60000.0},
        {"payload.drag_coefficient": 0.9},
    ],
)
def test_a_view_of_a_changed_case_is_that_of_the_case_posed_anew(changes: dict[str, Any]) -> None:
    case, gains = load_case("subsea-crane"), CASES["subsea-crane"]
    view = prepare(case)
    before = view.evaluate(gains)

    found = view.replace(changes).evaluate(gains)
    anew = prepare(case.replace(changes)).evaluate(gains)

    assert found.payload_rms == pytest.approx(anew.payload_rms, rel=1e-5)
    assert found.drag == pytest.approx(anew.drag, rel=1e-5)
    assert found.hook_rms == anew.hook_rms
    for name, use in anew.limits.items():
        assert found.limits[name].use == pytest.approx(use.use, rel=1e-4)
    uses = [look.limits["max_sensitivity"].use for look in (found, before)]
    assert uses[0] != uses[1] or found.payload_rms != before.payload_rms


@pytest.mark.ci
def test_a_warm_descent_finds_the_optimum_nearby() -> None:
    case = load_case("subsea-crane")
    best = optimise_gains(case, "payload-feedback", starts=4)
    start = {k: v * (1.0 if k == "A" else 0.8) for k, v in best.gains.items()}

    design = prepare(case).optimise(start, verify=True)

    assert design.ok
    assert design.verification is not None
    assert design.payload_rms == pytest.approx(best.payload_rms, rel=1e-4)
    assert "max_sensitivity" in design.binding


@pytest.mark.parametrize("name", ["subsea-crane", "landing"])
def test_a_warm_descent_is_never_worse_than_a_start_that_keeps_the_limits(name: str) -> None:
    view = prepare(load_case(name))
    start = view.optimise(CASES[name]).gains
    look = view.evaluate(start)
    assert look.ok

    design = view.optimise(start)

    assert design.ok
    assert design.verification is None
    assert design.payload_rms <= look.payload_rms * (1.0 + 1e-5)


def test_a_descent_wants_a_stable_start() -> None:
    with pytest.raises(InputError, match="start: must be gains of a stable loop"):
        prepare(load_case("thesis-1975")).optimise({**THESIS, "a1": -1e4})
