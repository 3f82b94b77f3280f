from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from designs import THESIS_GAINS, structure_design, thesis_design, unstable_design
from former_cases import load_case
from hypothesis import given, settings
from hypothesis import strategies as st

import stillhook as sh
from models.basics import InputError
from models.vessel.readers import read_raos, write_raos
from synth.sensitivity import sensitivity
from synth.sensitivity.differences import StepError, derivative, sided_derivatives
from synth.sensitivity.elasticity import FIGURES
from synth.sensitivity.fields import numbers_of

STEP = 1e-3
CRANE_GAINS = {"A": 1.0, "a": 0.25, "a1": 0.6, "a2": 0.02}


@cache
def crane():
    """Gains for a shorter rope, late signals and drag that moves with the response."""
    case = load_case("subsea-crane").replace({"rope.length": 300.0, "rope.masses": 1})
    return sh.evaluate_gains(case, CRANE_GAINS)


@cache
def hysteretic():
    """A rope of some masses, of the same damping in every mode, in a rig that gives."""
    law = {"rope.damping_law": "hysteretic", "rope.damping_ratio": 0.02, "rope.masses": 4}
    rig = {"crane.tip_stiffness": 5e6, "rigging.stiffness": 2e7, "rigging.block_mass": 1e3}
    return sh.evaluate_gains(load_case("subsea-crane").replace(law | rig), CRANE_GAINS)


def figures(view):
    return np.log(
        [
            view.sigma("payload.displacement"),
            view.max_sensitivity,
            view.sigma("motor.torque"),
            view.sigma("motor.speed"),
        ]
    )


def by_differences(answers, path, side=""):
    """The same figures computed in full on both sides of every number, or from one side of it."""
    if side:
        sign = 1.0 if side == "above" else -1.0
        there = [answers] + [answers.with_number(path, np.exp(sign * k * STEP)) for k in (1, 2, 3)]
        weighted = zip((-11.0, 18.0, -9.0, 2.0), there, strict=True)
        return sum(w * figures(a.assessment()) for w, a in weighted) / (6.0 * sign * STEP)
    up, down = (answers.with_number(path, np.exp(sign * STEP)) for sign in (1.0, -1.0))
    if up is None:  # at the end of its range, where losses and the band of their noise begin
        steps = -STEP * np.arange(1, 5)
        there = [figures(answers.with_number(path, np.exp(k)).assessment()) for k in steps]
        return np.polyfit(steps, np.array(there), 3)[-2]
    if path.endswith("efficiency"):  # losses bend with it more than central differences stand
        more = answers.with_number(path, np.exp(2.0 * STEP))
        if more is not None:
            less = answers.with_number(path, np.exp(-2.0 * STEP))
            near, far = (
                figures(one.assessment()) - figures(other.assessment())
                for one, other in ((up, down), (more, less))
            )
            return (8.0 * near - far) / (12.0 * STEP)
    return (figures(up.assessment()) - figures(down.assessment())) / (2.0 * STEP)


@pytest.fixture(scope="module", params=[thesis_design, crane, hysteretic])
def study(request):
    return sensitivity(request.param())


@pytest.mark.ci
def test_every_elasticity_is_that_of_finite_differences(study):
    for entry in study.elasticities:
        ours = [getattr(entry, name) for name in FIGURES]
        assert ours == pytest.approx(
            by_differences(study._fixed, entry.path),
            rel=2e-5,
            abs=1e-4 if entry.side else 2e-5,
        ), entry.path


@pytest.mark.ci
def test_numbers_without_effect_have_none(study):
    view = figures(study._fixed.assessment())
    for path in study.without_effect:
        other = study._fixed.with_number(path, 1.01)
        assert other is None or figures(other.assessment()) == pytest.approx(
            view,
            abs=5e-9,  # rounding of other processors' kernels, 1.3e-9 seen
        ), path


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


@pytest.mark.ci
@pytest.mark.parametrize(
    "sea",
    [
        {},
        {"sea.spectrum": "tma", "sea.depth": 300.0},
        {"sea.spectrum": "torsethaugen"},
        {"sea.spreading": {"kind": "cos-2s", "exponent": 10.0}},
        {"vessel.speed": 1.0},
        {"vessel.speed": 3.0, "vessel.heading": "20 deg"},
    ],
    ids=["jonswap", "tma", "torsethaugen", "short-crested", "under-way", "following"],
)
def test_what_moves_a_kink_of_the_density_has_the_slope_of_the_integral(sea):
    # JONSWAP's width jumps at the peak, a following sea's density has a fold; the integral neither.
    case = crane().case.replace(sea)
    found = sensitivity(sh.evaluate_gains(case, CRANE_GAINS))
    assert not [path for path in found.stepping if path.startswith(("sea.", "vessel."))]
    entry = found["sea.peak_period"]
    ours = [getattr(entry, name) for name in FIGURES]
    # Of a vessel under way the energy is mapped to the frequencies of encounter in numbers.
    near = 1e-3 if "vessel.speed" in sea else 5e-5
    assert ours == pytest.approx(by_differences(found._fixed, entry.path), rel=near, abs=near)
    assert abs(entry.torque_rms) > 0.4


@pytest.mark.ci
def test_a_heading_at_a_row_of_a_coarse_table_has_a_slope_on_either_side(tmp_path):
    # Headings further than 30 deg apart are linear in between: the hook has a corner at 180 deg.
    ship = read_raos("osv-83m")
    coarse = replace(ship, heading=ship.heading[::3], values=ship.values[:, ::3])
    table = str(write_raos(tmp_path / "coarse.csv", coarse))
    case = crane().case.variant({"vessel.raos": table, "vessel.heading": "180 deg"})
    found = sensitivity(sh.evaluate_gains(case, CRANE_GAINS))
    sides = {e.side: e for e in found.elasticities if e.path == "vessel.heading"}
    assert set(sides) == {"below", "above"}
    for side, entry in sides.items():
        ours = [getattr(entry, name) for name in FIGURES]
        theirs = by_differences(found._fixed, entry.path, side)
        assert ours == pytest.approx(theirs, rel=1e-4, abs=1e-4)
    assert abs(sides["below"].payload_rms - sides["above"].payload_rms) > 0.01
    assert found["vessel.heading"] is max(sides.values(), key=lambda e: abs(e.payload_rms))
    assert "vessel.heading (above its corner)" in {e.label for e in sides.values()}
    assert ",corner: below its value" in found.to_csv()


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


def test_a_corner_has_two_slopes_and_a_step_has_none():
    def bent(x):
        return np.log([x, x**2 + 0.3 * abs(x - 2.0)])

    below, above = sided_derivatives(bent, 2.0)
    assert below == pytest.approx([0.5, (4.0 - 0.3) / 4.0], rel=1e-8)
    assert above == pytest.approx([0.5, (4.0 + 0.3) / 4.0], rel=1e-8)
    for near in (2.0012, 1.5):  # within the first steps, and far
        pair = sided_derivatives(bent, near)
        sign = np.sign(near - 2.0)
        slope = (2.0 * near + 0.3 * sign) / (near**2 + 0.3 * abs(near - 2.0))
        assert np.array_equal(*pair)
        assert pair[0][1] == pytest.approx(slope, rel=1e-8)
    with pytest.raises(StepError):
        sided_derivatives(lambda x: np.log([x + 0.1 * (x > 2.0)]), 2.0)


@pytest.mark.ci
def test_errors_of_a_reference_unit_have_the_slopes_of_their_differences():
    stated = {"gain_error": 0.02, "phase_error": 0.03, "drift": 0.03, "drift_period": 150.0}
    stated |= {"noise": 1e-4, "bandwidth": 40.0}
    changes = {"limits.drive": "report", "rope.masses": 5, "sensors.mru": stated}
    case = load_case("subsea-crane").replace(changes)
    gains = {"drum.position_gain": 0.1, "heave.gain": 0.98, "heave.lead": 0.66}
    gains["heave.bandwidth"] = 1.4173
    design = structure_design(case, "feed-forward", gains)
    found = {e.path: e.payload_rms for e in sensitivity(design).elasticities}
    for name, value in stated.items():
        moved = [{f"sensors.mru.{name}": value * factor} for factor in (0.999, 1.001)]
        low, high = (
            structure_design(case.replace(own), "feed-forward", gains).payload_rms for own in moved
        )
        slope = np.log(high / low) / np.log(1.001 / 0.999)
        assert found[f"sensors.mru.{name}"] == pytest.approx(slope, rel=1e-3, abs=1e-6), name
