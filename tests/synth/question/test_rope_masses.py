"""Rope masses that a loop asks for: by its crossover, and by what holds on the rope as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from former_cases import load_case

from models.sensing import sensed_line_at
from synth.question import masses_for, pose

LIGHT: dict[str, Any] = {"rope.damping_ratio": 2e-4}
# Combined, optimal with a second member with a tenth of the rope's damping.
BOTH = [12.5618, 17.2308, 42.9685, 7.5, 0.920736, 3.01522, 2.0, 0.0377744, 4.23995]


@pytest.mark.parametrize("changes", [{}, LIGHT], ids=["the case", "hardly any damping"])
def test_a_mode_that_stands_out_far_above_the_bandwidth_asks_for_no_masses(
    changes: dict[str, Any],
) -> None:
    question = pose(load_case("subsea-crane").replace(changes), "combined", 15)
    loop = question.problem.assess(BOTH)
    # Of the rope's own modes at 26 and 40 rad/s the gain is one on either side.
    assert (loop.margins.crossovers.max() > 20.0) == bool(changes)
    assert masses_for(question, loop) == 15
    # Nothing is lost by it: on the rope as it is the limit of 2 holds too.
    controller = loop.controller
    omega = np.geomspace(0.1, 100.0, 200_001)
    drag, friction = question.equivalents(loop.coefficients)
    known, peaks = {"drag": drag, "data": question.data}, []
    for slack in (friction, 0.0):
        line = sensed_line_at(question.case, 1j * omega, friction=slack, **known)
        heard = line.select(measurements=controller.measurements)
        gain = -np.einsum("kij,kji->k", controller.response_at(1j * omega), heard.yu)
        peaks.append(float((1.0 / np.abs(1.0 + gain)).max()))
    assert max(peaks) == pytest.approx(loop.max_sensitivity, rel=1e-3)
    assert max(peaks) < 2.0


def test_a_peak_that_is_higher_on_the_rope_asks_for_masses() -> None:
    question = pose(load_case("subsea-crane").replace(LIGHT), masses=15)
    loop = question.problem.assess([4.0597, 13.539, 7.7354])
    assert loop.max_sensitivity <= 2.0 * (1.0 + 1e-3)
    assert masses_for(question, loop) > 15


def test_looks_from_two_places_ask_for_the_same_masses() -> None:
    # Points about a pole that was found twice once hid the peak beside them: 12 masses or 40.
    question = pose(load_case("subsea-crane"))
    gains = {"A": 0.879864568998902, "a": 23.387589861224058, "a1": 171.8977436489725}
    gains["a2"] = 5.312489944373191
    found = question.assess(gains).coefficients
    changes = np.linspace(-1e-7, 1e-7, 9)
    loops = [question.assess(gains, [c * (1.0 + x) for c in found]) for x in changes]
    assert {masses_for(question, loop) for loop in loops} == {question.masses}


def test_a_margin_that_is_broken_on_rope_and_masses_asks_for_no_masses() -> None:
    question = pose(load_case("landing"))
    gains = {"A": 0.8076705021147271, "a": 69.96066263279, "a1": 266.2386142632147}
    loop = question.assess({**gains, "a2": 1236.2104855477444})
    assert loop.max_sensitivity > 3.0
    assert masses_for(question, loop) == question.masses


def test_a_peak_that_binds_on_the_masses_alone_asks_for_masses() -> None:
    # Of two peaks of |S| at 2 on 7 masses one is at 2 on the rope; the other has room there.
    gains = {"A": 1.0, "a": 15.940294359577077, "a1": 44.13567326977394, "a2": 6.42833984677358}
    case, asked = load_case("subsea-crane").replace({"winch.losses": "hauling"}), []
    for masses in (7, 15):
        question = pose(case, masses=masses)
        loop = question.assess(gains)
        assert loop.max_sensitivity == pytest.approx(2.0, rel=2e-4)
        asked.append(masses_for(question, loop))
    assert asked[0] > 7
    assert asked[1] == 15


def test_a_light_pole_that_the_controller_has_for_itself_is_no_obstacle() -> None:
    # Far above the loop a closed-loop pole is the roll-off's own, to the last digit.
    question = pose(load_case("subsea-crane"), "combined", masses=15)
    values = [1e-9, 1e-9, 1e-9, 0.5, 0.9, 500.0, 0.2, 0.0, 2.0]
    loop = question.problem.assess(values)
    own = np.linalg.eigvals(loop.controller.A)
    assert np.isclose(own, -100.0 + 489.8979486j).any()
    assert masses_for(question, loop) >= 15
