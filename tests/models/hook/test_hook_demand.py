"""The hook's motion in figures, and over headings, peak periods and both sides of the ship."""

from __future__ import annotations

import csv
import io
import math
import warnings

import numpy as np
import pytest
from barge import barge_case
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st

from models import InputError
from models.basics import PhysicsWarning, fractile_factor, peak_factor
from models.hook import HookDemand, HookMotion, hook_motion


@given(t_z=st.floats(2.0, 20.0), p=st.floats(0.01, 0.999))
def test_a_fractile_is_that_of_the_largest_of_many_rayleigh_maxima(t_z, p):
    x = fractile_factor(t_z, p)
    waves = 10800.0 / t_z
    # P(largest < x) = (1 - exp(-x^2/2))^N, of which the formula is the limit of many waves.
    assert (1.0 - math.exp(-0.5 * x * x)) ** waves == pytest.approx(p, abs=0.01)
    assert fractile_factor(t_z, math.exp(-1.0)) == pytest.approx(peak_factor(t_z), rel=1e-12)


@pytest.mark.parametrize("p", [0.0, 1.0, -0.5, math.nan])
def test_a_fractile_lies_between_none_and_all(p):
    with pytest.raises(InputError, match=r"fractile must be in \(0, 1\)"):
        fractile_factor(8.0, p)


def test_figures_of_a_sine_and_of_a_band():
    omega = 0.7
    moments = 0.25 * omega ** np.arange(9.0)
    for order, found in enumerate(HookDemand(moments=moments, tension=0.0).motions):
        assert found.rms == pytest.approx(0.5 * omega**order)
        assert found.significant_amplitude == pytest.approx(omega**order)
        assert found.zero_crossing_period == pytest.approx(2.0 * math.pi / omega)
        assert found.width == pytest.approx(0.0, abs=1e-7)
    # White from 0 to 1 rad/s: m_n = 1/(n+1), width sqrt(4/3 - 1).
    white = HookDemand(moments=1.0 / np.arange(1.0, 10.0), tension=0.0).displacement
    assert white.width == pytest.approx(math.sqrt(1.0 / 3.0))
    still = HookDemand(moments=np.zeros(9), tension=0.0).displacement
    assert (still.rms, still.width, still.most_probable_maximum()) == (0.0, 0.0, 0.0)


def test_the_figures_are_those_of_the_motion():
    case = load_case("subsea-crane")
    demand, hook = HookDemand.from_case(case), HookMotion.from_case(case)
    assert demand.motions == (hook.displacement, hook.velocity, hook.acceleration)
    tension = case.payload.submerged_weight + case.rope.submerged_weight
    assert demand.peak_power == pytest.approx(tension * demand.velocity.most_probable_maximum())
    # Mean |P| by sampling a Gaussian speed.
    speed = demand.velocity.rms * np.random.default_rng(1).standard_normal(400_000)
    assert demand.mean_power == pytest.approx(float(np.mean(np.abs(tension * speed))), rel=0.005)
    assert demand.fractile_power > demand.peak_power


def test_power_of_a_lift_in_deep_water():
    # 530 kN and 0.3, 0.5 and 0.7 m/s rms at T_z 9.7 s: 0.60, 0.99 and 1.39 MW; 127, 211, 296 kW.
    for rms, peak, mean in ((0.3, 0.60, 127.0), (0.5, 0.99, 211.0), (0.7, 1.39, 296.0)):
        omega = 2.0 * math.pi / 9.7
        moments = (rms / omega) ** 2 * omega ** np.arange(9.0)
        demand = HookDemand(moments=moments, tension=530e3)
        assert 1e-6 * demand.peak_power == pytest.approx(peak, abs=0.006)
        assert 1e-3 * demand.mean_power == pytest.approx(mean, rel=0.005)


SEAS = {
    "long-crested": {},
    "short-crested": {"sea__spreading": {"kind": "cos-2s", "exponent": 8.0}},
    "under way": {"vessel_speed": 2.0},
    "short-crested, under way": {
        "sea__spreading": {"kind": "cos-2s", "exponent": 8.0},
        "vessel_speed": 2.0,
    },
}


@pytest.mark.parametrize("name", SEAS)
def test_every_point_of_a_survey_is_the_case_there(tmp_path, name):
    case = barge_case(tmp_path, **SEAS[name])
    survey = hook_motion(case, headings=[0.0, 60.0, 210.0], peak_periods=[7.0, 11.0])
    assert survey.moments.shape == (2, 3, 2, 9)
    assert survey.points[1] == (-25.0, -14.0, 20.0)
    rtol = 2e-4 if case.vessel.moves else 1e-6
    for side, heading, period in ((0, 0, 0), (0, 1, 1), (1, 2, 0), (1, 1, 1)):
        x, y, z = survey.points[side]
        there = case.replace(
            {
                "vessel.hook": {"x": x, "y": y, "z": z},
                "vessel.heading": survey.headings[heading],
                "sea.peak_period": survey.peak_periods[period],
            }
        )
        hook = HookMotion.from_case(there)
        figures = survey.figures(side, heading, period)
        assert figures.displacement.rms == pytest.approx(hook.displacement.rms, rel=rtol)
        assert figures.velocity.rms == pytest.approx(hook.velocity.rms, rel=rtol)
        assert survey.rms("velocity")[side, heading, period] == figures.velocity.rms
    assert survey.own.velocity.rms == pytest.approx(HookMotion.from_case(case).velocity.rms)


def test_the_best_place_is_the_one_of_least_speed(tmp_path):
    survey = hook_motion(
        barge_case(tmp_path), headings=[30.0, 90.0, 150.0], peak_periods=[6.0, 9.2]
    )
    assert survey.nearest_period == 1
    speeds = survey.rms("velocity")[:, :, 1]
    assert speeds[survey.best] == speeds.min()


def test_a_case_with_one_table_is_looked_at_over_periods_only():
    case = load_case("landing")
    survey = hook_motion(case, peak_periods=[7.0, case.sea.spectral_peak_period])
    assert survey.headings.size == 0
    assert survey.points == ()
    assert survey.moments.shape == (1, 1, 2, 9)
    assert survey.figures(0, 0, 1).velocity.rms == pytest.approx(survey.own.velocity.rms, rel=1e-6)
    with pytest.raises(InputError, match=r"headings need vessel\.raos"):
        hook_motion(case, headings=[0.0])


def test_the_thesis_sea_is_varied_by_its_own_period():
    case = load_case("thesis-1975")
    survey = hook_motion(case, peak_periods=[6.0, case.sea.spectral_peak_period])
    assert survey.figures(0, 0, 1).displacement.rms == pytest.approx(
        HookMotion.from_case(case, warn=False).displacement.rms, rel=1e-7
    )


def test_a_sea_without_a_period_is_taken_as_it_is(tmp_path):
    parts = [
        {"spectrum": "jonswap", "significant_height": 1.5, "peak_period": 7.0},
        {
            "spectrum": "gaussian-swell",
            "significant_height": 1.0,
            "peak_period": 13.0,
            "width": 0.05,
        },
    ]
    tree = barge_case(tmp_path).to_dict()
    tree["sea"] = {"spectrum": "sum", "parts": parts}
    from models import Case

    case = Case.from_dict(tree)
    survey = hook_motion(case, headings=[150.0])
    assert survey.moments.shape == (2, 1, 1, 9)
    assert survey.figures(0, 0, 0).velocity.rms == pytest.approx(survey.own.velocity.rms, rel=1e-5)
    with pytest.raises(InputError, match="no peak_period to vary"):
        hook_motion(case, peak_periods=[8.0])


def test_seas_that_break_are_marked(tmp_path):
    case = barge_case(tmp_path, sea__significant_height=3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", PhysicsWarning)  # looked at, not chosen
        survey = hook_motion(case, headings=[180.0], peak_periods=[4.0, 9.0])
    assert survey.steep.tolist() == [True, False]


def test_the_table_holds_every_point(tmp_path):
    survey = hook_motion(barge_case(tmp_path), headings=[0.0, 90.0], peak_periods=[7.0, 9.0, 11.0])
    rows = list(csv.DictReader(io.StringIO(survey.to_csv())))
    assert len(rows) == 2 * 2 * 3
    row = rows[-1]
    assert (row["y"], row["heading_deg"], row["peak_period"]) == ("-14", "90", "11")
    last = survey.figures(1, 1, 2)
    assert float(row["velocity_rms"]) == pytest.approx(last.velocity.rms, rel=1e-5)
    assert float(row["acceleration_T_z"]) == pytest.approx(
        last.acceleration.zero_crossing_period, rel=1e-5
    )
    assert float(row["displacement_fractile_max"]) == pytest.approx(
        last.displacement.fractile(0.9), rel=1e-5
    )
    only = hook_motion(load_case("landing"), peak_periods=[9.0])
    first = next(csv.DictReader(io.StringIO(only.to_csv())))
    assert (first["x"], first["heading_deg"]) == ("", "")


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        ({"peak_periods": [-1.0]}, r"peak period must be in \(0, 60\] s, got -1"),
        ({"headings": []}, "headings must be at least one angle"),
        ({"headings": [math.nan]}, "headings must be finite numbers"),
        ({"fractile": 1.5}, r"fractile must be in \(0, 1\)"),
    ],
)
def test_what_cannot_be_looked_at_is_told(tmp_path, wanted, sentence):
    with pytest.raises(InputError, match=sentence):
        hook_motion(barge_case(tmp_path), **wanted)
    with pytest.raises(InputError, match="motion must be one of displacement"):
        hook_motion(barge_case(tmp_path), headings=[0.0], peak_periods=[9.0]).rms("speed")
