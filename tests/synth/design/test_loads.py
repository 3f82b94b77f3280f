"""Loads in the rope: closed forms, the limits and criteria that say the same, and simulations."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from designs import infeasible_design, structure_design, thesis_design, unstable_design
from scipy.special import ndtr

import stillhook as sh
from models import load_case
from models.basics import exceedance_probability, fractile_factor, peak_factor
from models.hook import HookMotion
from synth.design import RARE, design_loads
from synth.operability.criteria import payload_criteria
from synth.operability.pose import pose_operability

LAW = {
    "payload.acceleration_gain": 10.83,
    "payload.velocity_gain": 2.31,
    "payload.position_gain": 14.4,
    "drum.position_gain": 4.14,
    "heave.gain": 0.993,
    "rolloff.corner": 1.0,
    "rolloff.damping": 0.727,
    "heave.lead": 0.194,
    "heave.bandwidth": 4.42,
}
FOLLOWING = {
    "drum.position_gain": 4.0,
    "heave.gain": 1.0,
    "heave.lead": 0.1,
    "heave.bandwidth": 4.4,
}
ENDS = ("drum", "hook_load")
#: A reference unit whose error has no part that goes with the motion, with one sign in each run.
PLAIN_UNIT = {"sensors.mru.gain_error": 0.0, "sensors.mru.phase_error": 0.0}


@cache
def crane_design():
    """About the best design of the crane."""
    return sh.evaluate_gains(load_case("subsea-crane"), LAW, "combined")


@cache
def crane_loads():
    return design_loads(crane_design())


@cache
def reeved_design(falls: int):
    """The crane that follows the hook with so many falls, none too well."""
    case = load_case("subsea-crane").variant({"rope.falls": falls, "rope.length": 700.0})
    return sh.evaluate_gains(case, FOLLOWING, "feed-forward")


@cache
def plain_design():
    """The crane's with a reference unit that errs in noise alone."""
    return sh.evaluate_gains(load_case("subsea-crane").variant(PLAIN_UNIT), LAW, "combined")


def spring_design(drag: float = 20e3, **limits):
    """The thesis's winch with so much drag on its load, the drum of which hardly moves."""
    changes = {"payload.drag.coefficient": drag}
    changes |= {f"limits.{name}": value for name, value in limits.items()}
    case = load_case("thesis-1975").variant(changes)
    return sh.evaluate_gains(case, {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0})


def spring_tension(drag: float):
    """Return deviation and period of the load's tension on the thesis's one spring, by a sum."""
    case = load_case("thesis-1975")
    hook = HookMotion.from_case(case)
    omega = np.linspace(*hook.band, 1_000_001)
    mass, stiffness = case.moving_mass, case.rope.stiffness
    payload = stiffness / (stiffness - mass * omega**2 + 1j * omega * drag)
    load = (-case.payload.virtual_mass * omega**2 + 1j * omega * drag) * payload
    density = np.abs(load) ** 2 * hook.density(omega)
    m0, m2 = (float(np.trapezoid(omega**n * density, omega)) for n in (0, 2))
    return math.sqrt(m0), 2.0 * math.pi * math.sqrt(m0 / m2)


def test_a_load_on_one_spring_has_the_loads_of_closed_forms():
    loads = design_loads(spring_design(20e3, exposure_time=3600.0))
    end = loads.held.hook_load
    weight, light = 314.1e3, 0.95 * 314.1e3
    sigma, period = spring_tension(20e3)
    assert (end.output, end.loss) == ("rope.lower_tension", 0.0)
    assert (end.static, end.static_light) == pytest.approx((weight, light))
    assert (end.rms, end.linear_rms) == pytest.approx((sigma, sigma), rel=1e-5)
    assert (end.period, end.linear_period) == pytest.approx((period, period), rel=1e-5)
    k = math.sqrt(2.0 * math.log(3600.0 / period))
    # 1 - exp(-N exp(-x^2/2)) = 0.1.
    rare = math.sqrt(2.0 * math.log(3600.0 / period / -math.log(0.9)))
    assert (end.largest, end.least) == pytest.approx((weight + k * sigma, weight - k * sigma))
    assert end.largest_rare == pytest.approx(weight + rare * sigma)
    assert end.least_rare == pytest.approx(weight - rare * sigma)
    assert (end.safe_largest, end.safe_least) == pytest.approx((end.largest, end.least))
    assert end.safe_least_light == pytest.approx(light - k * sigma)
    assert end.daf == pytest.approx(1.0 + k * sigma / weight, rel=1e-5)
    for margin, slack, rest in (
        (end.margin, end.slack_probability, weight),
        (end.margin_light, end.slack_probability_light, light),
    ):
        assert margin == pytest.approx(rest / sigma, rel=1e-5)
        rate = math.exp(-0.5 * (rest / sigma) ** 2) / period
        assert slack == pytest.approx(1.0 - math.exp(-3600.0 * rate), rel=1e-3)
    assert 0.0 < end.slack_probability < end.slack_probability_light < 1.0
    assert (loads.exposure_time, loads.rare) == (3600.0, RARE) == (3600.0, 0.1)


def test_a_rare_extreme_is_exceeded_as_rarely_as_it_is_called():
    end = design_loads(spring_design(20e3)).held.drum
    factor = (end.largest_rare - end.static) / end.rms
    assert factor == pytest.approx(fractile_factor(end.period, 0.9), rel=1e-12)
    assert exceedance_probability(factor, end.period) == pytest.approx(0.1, rel=1e-9)


def test_the_drum_carries_the_rope_too_whose_weight_is_known():
    case = load_case("thesis-1975")
    end = design_loads(spring_design(20e3)).held.drum
    rope = case.rope.submerged_weight
    assert end.static == pytest.approx(314.1e3 + rope)
    assert end.static_light == pytest.approx(0.95 * 314.1e3 + rope)


def test_an_exceedance_of_the_case_counts_and_rare_stays_rare():
    usual, seldom = (
        design_loads(spring_design(20e3, exceedance=p)) for p in (1.0 - math.exp(-1.0), 0.1)
    )
    assert seldom.exceedance == 0.1
    for name in ENDS:
        one, other = getattr(usual.held, name), getattr(seldom.held, name)
        assert other.largest == pytest.approx(one.largest_rare, rel=1e-9)
        assert other.least == pytest.approx(one.least_rare, rel=1e-9)
        assert other.safe_largest > one.safe_largest
        for same in ("largest_rare", "least_rare", "margin", "slack_probability", "rms"):
            assert getattr(other, same) == pytest.approx(getattr(one, same), rel=1e-9), same


@pytest.mark.parametrize("falls", [0, 1, 2])
def test_a_design_s_limits_say_the_same(falls):
    design = reeved_design(falls) if falls else crane_design()
    limits, compensated = design.limits, design_loads(design).compensated
    for name, value in (
        ("rope.tension.peak", compensated.drum.safe_largest),
        ("rope.tension.least", compensated.drum.safe_least),
        ("rope.lower_tension.least", compensated.hook_load.safe_least_light),
    ):
        assert value == pytest.approx(limits[name].value, rel=1e-6), name


def test_the_report_s_expected_figures_are_the_same():
    design, loads = crane_design(), crane_loads()
    for end in (loads.compensated.drum, loads.compensated.hook_load):
        switched = design.switched
        rest = design.question.plant.static[end.output]
        assert end.rms == switched.deviation(end.output)
        assert end.largest == rest + switched.extreme(end.output, 10800.0, 1)
        assert end.least == rest - switched.extreme(end.output, 10800.0, -1)
        # Never beyond what limits are held to.
        assert end.safe_least < end.least < rest < end.largest < end.safe_largest
        assert end.linear_rms == design.assessment.sigma(end.output)
        assert end.linear_period == design.assessment.mean_period(end.output)


def test_the_daf_is_that_of_operability():
    """The criterion of the study, on the same loop and on its own held drum, in the same sea."""
    design, loads = crane_design(), crane_loads()
    (criterion,) = payload_criteria(design.case, daf=1.3)
    assert criterion.worst(design.assessment) == pytest.approx(
        loads.compensated.hook_load.daf, rel=1e-12
    )
    system = pose_operability(design, (criterion,)).held
    hook = HookMotion.from_case(design.case)
    moments = system.responses(hook.quadrature).moments(
        [hook.density(hook.quadrature.omega)[np.newaxis]], [np.array([design.drag_before])]
    )
    assert criterion.measure(moments)[0] == pytest.approx(loads.held.hook_load.daf, rel=1e-6)


@pytest.mark.parametrize("condition", ["held", "compensated"])
def test_figures_agree_with_each_other(condition):
    loads = crane_loads()
    for name in ENDS:
        end = getattr(getattr(loads, condition), name)
        assert end.daf == pytest.approx(end.safe_largest / end.static, rel=1e-12)
        for rest, margin in ((end.static, end.margin), (end.static_light, end.margin_light)):
            worst = (rest - end.loss) / margin
            assert worst == pytest.approx(end.linear_rms, rel=0.1)
            assert worst >= end.linear_rms * (1.0 - 1e-9)
        assert end.least_rare < end.least < end.static < end.largest < end.largest_rare
        assert end.safe_least - end.safe_least_light == pytest.approx(end.static - end.static_light)
    assert loads.held.hook_load.daf > loads.compensated.hook_load.daf > 1.0


def test_the_load_alone_is_uncertain_at_both_ends():
    case, loads = load_case("subsea-crane"), crane_loads()
    less = case.payload.submerged_weight - case.payload.least_weight
    hook_load, drum = loads.held.hook_load, loads.held.drum
    assert hook_load.static - hook_load.static_light == pytest.approx(less)
    mean = drum.static / case.static_tension  # of hauling in and paying out
    assert drum.static - drum.static_light == pytest.approx(mean * less)
    assert drum.loss == pytest.approx(case.static_tension_budget - drum.static, rel=1e-9)


def test_falls_share_the_tension_at_the_drum_and_not_the_hook_load():
    one, both = (design_loads(reeved_design(falls)) for falls in (1, 2))
    assert both.held.drum.static < 0.6 * one.held.drum.static
    assert both.held.hook_load.static == pytest.approx(one.held.hook_load.static)
    # Twice as stiff a rope moves its load less with the drum held.
    assert both.held.hook_load.daf < one.held.hook_load.daf


def test_an_unstable_loop_has_loads_with_the_drum_held_alone():
    loads = design_loads(unstable_design())
    assert loads.compensated is None
    held = design_loads(thesis_design()).held
    assert loads.held.hook_load.daf == held.hook_load.daf


def test_figures_are_those_of_the_sea_that_the_design_s_hold_for():
    design = infeasible_design()
    assert design.significant_height == 0.5
    loads, calm = design_loads(design), design_loads(thesis_design())
    assert loads.significant_height == 0.5
    share = 0.5 / calm.significant_height
    known = calm.held.hook_load.linear_rms
    assert loads.held.hook_load.linear_rms == pytest.approx(share * known, rel=1e-6)


def test_a_rope_that_nothing_damps_goes_slack_for_certain():
    case = load_case("thesis-1975").variant({"payload.drag.coefficient": 0.0})
    gains = {"A": 200.0, "a": 50.0, "a1": 100.0, "a2": 100.0}
    end = design_loads(structure_design(case, "payload-feedback", gains)).held.hook_load
    assert end.rms == end.largest == end.daf == math.inf
    assert end.least == -math.inf
    assert (end.margin, end.slack_probability) == (0.0, 1.0)


def test_loads_are_frozen_numbers():
    end = crane_loads().compensated.drum
    with pytest.raises(dataclasses.FrozenInstanceError):
        end.daf = 1.0
    values = [getattr(end, field.name) for field in dataclasses.fields(end)]
    assert {type(value) for value in values} == {str, float}


@cache
def simulated(condition: str):
    """Return three runs of half an hour of the crane's, behind what settles, at 50 Hz."""
    design = plain_design()
    who = "none" if condition == "held" else design
    return sh.simulate(design.case, who, seeds=3, duration=1850.0, settle=50.0, store_step=0.02)


@pytest.mark.ci
@pytest.mark.parametrize("condition", ["held", "compensated"])
@pytest.mark.parametrize("name", ENDS)
def test_simulations_have_these_loads(condition, name):
    """Deviations within a few per cent, extremes within what three runs of half an hour tell.

    With the drum held the payload's drag, linear here, keeps the largest swings lower there.
    """
    end = getattr(getattr(design_loads(plain_design()), condition), name)
    records = [run[end.output][run.time > 50.0] for run in simulated(condition)]
    mean = np.mean([record.mean() for record in records])
    assert mean == pytest.approx(end.static, rel=1e-3)
    deviation = math.sqrt(np.mean([record.var() for record in records]))
    assert deviation == pytest.approx(end.rms, rel=0.05)
    ups = sum(np.count_nonzero((r[:-1] < mean) & (r[1:] >= mean)) for r in records)
    # Of a signal that turns within a sample or two crossings are missed.
    assert 5400.0 / ups == pytest.approx(end.period, rel=0.08 if end.period > 5.0 else 0.25)
    # The mean of the largest in half an hour, from the most probable one in three.
    half_hour, usual = (peak_factor(end.linear_period, time) for time in (1800.0, 10800.0))
    switching = end.loss if condition == "compensated" else 0.0
    gumbel = end.linear_rms / half_hour
    error = 2.5 * math.pi / math.sqrt(6.0) * gumbel / math.sqrt(len(records))
    for way, extreme in ((1.0, end.largest), (-1.0, end.least)):
        swing = abs(extreme - end.static) - switching
        expected = switching + swing * half_hour / usual + np.euler_gamma * gumbel
        found = np.mean([np.max(way * (record - end.static)) for record in records])
        lower = 0.12 * swing if condition == "held" else 0.0
        assert -error - lower < found - expected < error, (found, expected, error)


@pytest.mark.parametrize(("factor", "period"), [(1.5, 5.0), (2.5, 8.0), (3.0, 8.0)])
def test_levels_are_exceeded_as_often_as_by_independent_maxima(factor, period):
    """Of N Rayleigh maxima, one by one: the Poisson process in the limit of many."""
    count = 600.0 / period
    below = (1.0 - math.exp(-0.5 * factor**2)) ** count
    assert exceedance_probability(factor, period, 600.0) == pytest.approx(1.0 - below, abs=0.02)
    # A Gaussian signal is above it that share of the time at least, were it all of one piece.
    assert exceedance_probability(factor, period, 600.0) > ndtr(-factor)


@pytest.mark.parametrize(
    ("factor", "period", "probability"),
    [(0.0, 8.0, 1.0), (-2.0, 8.0, 1.0), (math.inf, 8.0, 0.0), (3.0, math.inf, 0.0)],
)
def test_what_is_certain_and_what_never_happens(factor, period, probability):
    assert exceedance_probability(factor, period) == probability
