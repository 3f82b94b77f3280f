"""Gains over the rope's length: the spline, its files, and that it holds between its nodes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from models import load_case
from models.basics import InputError
from synth.loop import closed_loop_poles
from synth.question import pose
from synth.robust import GainSchedule, schedule_gains
from synth.robust.schedule import blend_of

pytestmark = pytest.mark.ci  # whole optimisations in fixtures


@pytest.fixture(scope="module")
def schedule():
    return schedule_gains(load_case("thesis-1975"), (1200.0, 2000.0), checks=5, close=0.2)


def test_blends_are_the_spline_of_what_they_blend():
    lengths = np.array([100.0, 300.0, 700.0, 2000.0])
    values = np.array([3.0, -1.0, 4.0, 1.5])
    spline = CubicSpline(np.log(lengths), values)
    for length in (100.0, 150.0, 555.0, 2000.0):
        assert blend_of(lengths, length) @ values == pytest.approx(spline(np.log(length)))


def test_blends_of_any_nodes_keep_a_constant():
    for lengths in ([50.0], [50.0, 90.0], [50.0, 90.0, 400.0]):
        assert blend_of(lengths, 60.0).sum() == pytest.approx(1.0)


def test_two_nodes_are_joined_by_a_line_in_the_logarithm():
    assert blend_of([100.0, 10000.0], 1000.0) == pytest.approx([0.5, 0.5])


def test_it_holds_at_lengths_that_it_was_not_made_for(schedule):
    assert schedule.ok, schedule.status
    case = load_case("thesis-1975")
    for length in (1234.5, 1500.0, 1777.0, 1999.0):
        view = pose(case.replace({"rope.length": length})).assess(schedule.at(length))
        assert view.poles.real.max() < 0.0
        assert view.margins.max_sensitivity <= 2.0 * (1.0 + 2e-3)


def test_its_loops_are_stable_by_their_eigenvalues(schedule):
    case = load_case("thesis-1975")
    for length in np.geomspace(1200.0, 2000.0, 9).clip(1200.0, 2000.0):
        question = pose(case.replace({"rope.length": float(length)}))
        gains = schedule.at(float(length))
        law = question.structure.bind(question.plant)
        poles = closed_loop_poles(
            question.plant, law.controller([gains[n] for n in law.named([0.0] * 3)])
        )
        assert poles.real.max() < 0.0


def test_no_length_loses_more_than_was_asked_for(schedule):
    for point in schedule.points:
        assert point.best_rms * (1.0 - 1e-3) <= point.payload_rms <= 1.2 * point.best_rms


def test_it_survives_its_file(schedule):
    again = GainSchedule.from_yaml(schedule.to_yaml(), schedule.case)
    assert again.at(1500.0) == pytest.approx(schedule.at(1500.0))


def test_its_table_holds_the_gains_at_every_length(schedule):
    lines = schedule.to_csv(11).splitlines()
    assert lines[0] == "rope.length,A,a,a1,a2"
    for line in lines[1:]:
        length, *gains = (float(cell) for cell in line.split(","))
        clipped = min(max(length, 1200.0), 2000.0)
        assert gains == pytest.approx(list(schedule.at(clipped).values()), rel=1e-8)


def test_it_is_not_extrapolated(schedule):
    with pytest.raises(InputError, match="length"):
        schedule.at(2500.0)


@pytest.mark.parametrize("text", ["lengths: [1, 2]", "- 1", "gains: {a: [1]}\nlengths: [1, 2]"])
def test_a_file_that_is_no_schedule_is_refused(text):
    with pytest.raises(InputError, match="schedule"):
        GainSchedule.from_yaml(text, load_case("thesis-1975"))


def test_lengths_must_ascend():
    with pytest.raises(InputError, match="two ascending"):
        schedule_gains(load_case("thesis-1975"), (2000.0, 1000.0))
