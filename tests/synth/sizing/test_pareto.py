"""Pareto fronts: every point an optimum, checked against single designs and other code."""

from __future__ import annotations

import csv
import io
import itertools

import numpy as np
import pytest

from models import load_case
from models.basics import InputError, one_thread
from synth import Rms, optimise_gains
from synth.question import pose
from synth.search import search
from synth.sizing import pareto_front

pytestmark = pytest.mark.ci  # whole optimisations in fixtures


@pytest.fixture(scope="module")
def torque():
    return pareto_front(load_case("thesis-1975"), "torque", points=12, checks=3)


def test_a_looser_bound_is_never_worse(torque):
    rms = [p.payload_rms for p in torque.points]
    assert len(rms) >= 11
    assert all(a >= b * (1.0 - 1e-6) for a, b in itertools.pairwise(rms))


def test_every_point_keeps_its_bound_and_all_limits(torque):
    for point in torque.points:
        assert point.value <= point.bound * (1.0 + 1e-4)
        assert point.max_sensitivity <= 2.0 * (1.0 + 1e-4)


def test_points_pass_the_check_by_other_code(torque):
    assert torque.verified == (3, 3)
    verdict = torque.points[len(torque.points) // 2].verify()
    assert verdict.ok, verdict.status


def test_a_point_is_as_good_as_a_search_of_its_own(torque):
    point = torque.points[6]
    question = pose(load_case("thesis-1975"))
    limit = Rms(bound=point.bound, output="motor.torque")
    with one_thread():
        alone = search(question.problem_with((*question.limits, limit)), 6, 3)
    assert alone.solved is not None
    assert point.payload_rms <= np.exp(alone.solved.objective) * (1.0 + 1e-3)


def test_the_price_is_the_slope_of_the_front(torque):
    x, y = (np.log([getattr(p, n) for p in torque.points]) for n in ("bound", "payload_rms"))
    slope = (y[7] - y[5]) / (x[7] - x[5])
    assert abs(torque.points[6].price) == pytest.approx(abs(slope), rel=0.1)


def test_its_end_is_the_design_without_a_bound(torque):
    design = optimise_gains(load_case("thesis-1975"), "payload-feedback", starts=6)
    assert torque.points[-1].payload_rms == pytest.approx(design.payload_rms, rel=0.02)


def test_the_table_can_be_read_again(torque):
    rows = list(csv.DictReader(io.StringIO(torque.to_csv())))
    assert [float(r["payload_rms"]) for r in rows] == pytest.approx(
        [p.payload_rms for p in torque.points], rel=1e-7
    )


def test_more_delay_is_never_better():
    front = pareto_front(load_case("thesis-1975"), "delay", points=5, between=(0.0, 0.1), checks=1)
    rms = [p.payload_rms for p in front.points]
    assert len(rms) >= 4
    assert rms == sorted(rms)
    # Best known on one spring at no delay and at 25, 50, 100 ms, without the limit on slow motion.
    known = {0.0: 0.0299, 0.025: 0.0712, 0.05: 0.1267, 0.1: 0.2123}
    for point in front.points:
        if round(point.bound, 3) in known:
            assert point.payload_rms >= known[round(point.bound, 3)] * 0.98


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"against": "luck"}, "against must be one of"),
        ({"against": "torque", "points": 1}, "points"),
        ({"against": "torque", "between": (3.0, 2.0)}, "two ascending numbers"),
    ],
)
def test_questions_without_sense_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        pareto_front(load_case("thesis-1975"), **options)


@pytest.mark.slow
def test_every_delay_margin_is_met_and_little_more():
    front = pareto_front(
        load_case("thesis-1975"), "delay_margin", points=6, between=(0.14, 0.3), checks=2
    )
    assert front.lost == ()
    assert front.verified == (2, 2)
    for point in front.points:
        # The band about the forbidden arc has a thickness: a hundredth or so is given away.
        assert point.bound * (1.0 - 1e-5) <= point.value <= 1.02 * point.bound
    rms = [p.payload_rms for p in front.points]
    assert rms == sorted(rms)


def test_a_front_changes_basins_and_loses_no_point():
    front = pareto_front(
        load_case("thesis-1975"), "max_sensitivity", points=16, between=(1.3, 3.0), checks=4
    )
    assert front.lost == ()
    assert front.verified == (4, 4)
    rms = np.array([p.payload_rms for p in front.points])
    assert np.all(np.diff(rms) < 0.0)
    assert rms[-1] < 4.2e-3  # the basin of high gains; that of low ones ends at 27 mm
    for point in front.points:
        assert point.max_sensitivity <= point.bound * (1.0 + 1.1e-5)
