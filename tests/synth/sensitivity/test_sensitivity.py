from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from designs import THESIS_GAINS, thesis_design, unstable_design
from hypothesis import given, settings
from hypothesis import strategies as st

import stillhook as sh
from models.basics import InputError
from synth.sensitivity import sensitivity
from synth.sensitivity.differences import derivative
from synth.sensitivity.fields import numbers_of
from synth.sensitivity.results import FIGURES

STEP = 1e-3
CRANE_GAINS = {"A": 1.0, "a": 0.25, "a1": 0.6, "a2": 0.02}


@cache
def crane():
    """Gains for a shorter rope, late signals and drag that moves with the response."""
    case = sh.load_case("subsea-crane").replace({"rope.length": 300.0, "rope.masses": 1})
    return sh.evaluate_gains(case, CRANE_GAINS)


def figures(view):
    return np.log(
        [
            view.sigma("payload.displacement"),
            view.max_sensitivity,
            view.sigma("motor.torque"),
            view.sigma("motor.speed"),
        ]
    )


def by_differences(answers, path):
    """The same figures computed in full on both sides of every number."""
    up, down = (answers.with_number(path, np.exp(sign * STEP)) for sign in (1.0, -1.0))
    if up is None:  # at the end of its range
        more = answers.with_number(path, np.exp(-2.0 * STEP))
        here, less, least = (figures(a.assessment()) for a in (answers, down, more))
        return (1.5 * here - 2.0 * less + 0.5 * least) / STEP
    return (figures(up.assessment()) - figures(down.assessment())) / (2.0 * STEP)


@pytest.fixture(scope="module", params=["thesis", "crane"])
def study(request):
    return sensitivity(thesis_design() if request.param == "thesis" else crane())


@pytest.mark.ci
def test_every_elasticity_is_that_of_finite_differences(study):
    for entry in study.elasticities:
        ours = [getattr(entry, name) for name in FIGURES]
        assert ours == pytest.approx(
            by_differences(study._fixed, entry.path), rel=2e-5, abs=2e-5
        ), entry.path


@pytest.mark.ci
def test_numbers_without_effect_have_none(study):
    view = figures(study._fixed.assessment())
    for path in study.without_effect:
        other = study._fixed.with_number(path, 1.01)
        assert other is None or figures(other.assessment()) == pytest.approx(view, abs=1e-9), path


def test_every_number_of_the_case_is_in_one_of_the_two_lists(study):
    told = {e.path for e in study.elasticities} | {*study.without_effect, *study.stepping}
    numbers = {n.path for n in numbers_of(study._fixed.case)}
    assert told == numbers | {"gains.a", "gains.a1", "gains.a2"}


def test_the_figures_are_those_of_the_design(study):
    assert study.payload_rms == pytest.approx(study.design.payload_rms, rel=1e-8)
    assert study.max_sensitivity == pytest.approx(study.design.margins.max_sensitivity, rel=1e-6)


def test_a_linear_loop_answers_to_the_sea_in_proportion():
    found = sensitivity(thesis_design())
    for path in ("sea.significant_height", "vessel.heave_rao.amplitude"):
        assert found[path].payload_rms == pytest.approx(1.0, abs=1e-9)
        assert found[path].max_sensitivity == 0.0


def test_the_scale_of_the_three_gains_is_the_amplifier():
    # A multiplies all three, so their elasticities add up to that of A.
    found, case = sensitivity(thesis_design()), thesis_design().case

    def rms(factor):
        return sh.evaluate_gains(case, {**THESIS_GAINS, "A": 200.0 * factor}).payload_rms

    total = sum(found[f"gains.{name}"].payload_rms for name in ("a", "a1", "a2"))
    by_differences = np.log(rms(np.exp(STEP)) / rms(np.exp(-STEP))) / (2.0 * STEP)
    assert total == pytest.approx(by_differences, rel=1e-4)


@pytest.mark.ci
def test_a_drum_that_takes_one_more_turn_has_no_elasticity_there():
    # 2.2 m hold 44 turns of 50 mm exactly.
    found = sensitivity(crane())
    assert {"rope.diameter", "winch.drum.geometry.width"} <= set(found.stepping)
    assert "rope.diameter: steps here" in str(found)


def test_ten_per_cent_on_each_gain_is_figure_32_of_the_thesis():
    moved = {m.path: m for m in sensitivity(thesis_design()).moved(0.1)}
    rms = [1e3 * moved[f"gains.{name}"].payload_rms for name in ("a", "a1", "a2")]
    peaks = [moved[f"gains.{name}"].max_sensitivity for name in ("a", "a1", "a2")]
    assert rms == pytest.approx([11.90, 11.03, 11.05], rel=2e-3)
    assert peaks == pytest.approx([4.78, 5.88, 5.16], abs=0.006)


def test_second_order_foretells_ten_per_cent_better_than_first():
    found = sensitivity(thesis_design(), second=6)
    numbers = {n.path for n in numbers_of(thesis_design().case)}
    for entry in found.elasticities[:6]:
        if entry.path not in numbers or abs(entry.curvature) < 0.01:
            continue
        true = found.moved(0.1, [entry.path])[0].payload_rms / found.payload_rms
        first = np.exp(entry.payload_rms * np.log(1.1))
        assert abs(entry.predicted(0.1) - true) < 0.2 * abs(first - true), entry.path


def test_an_unstable_loop_is_refused():
    with pytest.raises(InputError, match="sensitivity: the loop must be stable"):
        sensitivity(unstable_design())


def test_an_unknown_path_is_refused():
    found = sensitivity(thesis_design())
    with pytest.raises(InputError, match=r"'rope\.colour'"):
        found.moved(0.1, ["rope.colour"])
    with pytest.raises(InputError, match=r"'rope\.colour' has no elasticity"):
        found["rope.colour"]


@settings(max_examples=50, deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(0.1, 3.0))
def test_the_derivative_of_a_power_is_exact_to_ten_digits(at, power):
    found = derivative(lambda x: np.array([x**power]), at)[0]
    assert found == pytest.approx(power * at ** (power - 1.0), rel=1e-9, abs=1e-300)


def test_at_the_end_of_a_range_the_derivative_is_one_sided():
    def from_one_on(x):
        if x < 1.0:
            raise InputError("x must be at least 1")
        return np.array([x**3])

    assert derivative(from_one_on, 1.0)[0] == pytest.approx(3.0, rel=1e-7)
    with pytest.raises(InputError, match="zero"):
        derivative(from_one_on, 0.0)
