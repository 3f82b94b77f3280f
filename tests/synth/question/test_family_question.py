"""Cases with one structure as the problem of a family."""

from __future__ import annotations

import pytest
from former_cases import load_case

from models.basics import InputError
from synth.question import (
    FamilyProblem,
    FamilyQuestion,
    Objective,
    difference_text,
    pose,
    pose_family,
)
from synth.search import search


def test_seas_on_one_plant_share_their_loop():
    case = load_case("thesis-1975")
    posed = FamilyQuestion(case)
    depths, heights = (1500.0, 2000.0), (1.5, 2.0)
    family = FamilyProblem(
        scenarios=tuple(
            posed.loop(case.replace({"rope.length": depth, "sea.significant_height": height}))
            for depth in depths
            for height in heights
        )
    )
    assert [len(group) for group in family.groups] == [2, 2]


def test_where_drag_follows_the_sea_no_two_share_their_loop():
    case = load_case("thesis-1975-rope")
    posed = FamilyQuestion(case)
    calmer = case.replace({"sea.significant_height": 0.5 * case.sea.significant_height})
    family = FamilyProblem(scenarios=(posed.loop(case), posed.loop(calmer)))
    assert [len(group) for group in family.groups] == [1, 1]


def test_the_case_is_the_first_member_and_its_law_is_that_of_all():
    case = load_case("thesis-1975")
    family = pose_family(case, [{"rope.length": 1500.0}, {"rope.length": 1000.0}]).problem
    assert family.objective is Objective.WORST
    assert [s.name for s in family.scenarios][1:] == ["rope.length 1500", "rope.length 1000"]
    first = family.scenarios[0].problem
    own = pose(case).problem
    assert first.plant.poles() == pytest.approx(own.plant.poles())
    assert all(s.problem.law is first.law for s in family.scenarios)
    shorter = pose(case.replace({"rope.length": 1000.0})).problem
    assert family.scenarios[2].problem.plant.poles() == pytest.approx(shorter.plant.poles())


def test_a_structure_hears_what_it_names_in_every_member():
    case = load_case("subsea-crane")
    family = pose_family(case, [{"rope.damping_ratio": 2e-4}], "combined", masses=3).problem
    laws = {id(s.problem.law) for s in family.scenarios}
    assert len(laws) == 1
    one, other = (s.problem for s in family.scenarios)
    assert one.plant.measurements == other.plant.measurements
    assert one.plant.A.shape == other.plant.A.shape
    assert {d.name for d in one.disturbances} == {d.name for d in other.disturbances}
    assert [limit.name for limit in one.limits] == [limit.name for limit in other.limits]


def test_more_members_are_not_better_than_one():
    case = load_case("thesis-1975")
    alone = search(pose(case).problem, 8)
    both = search(pose_family(case, [{"rope.length": 1500.0}]).problem, 3)
    assert both.excess <= 1e-5
    assert both.costs.max() >= alone.costs[0] * (1.0 - 1e-6)


def test_a_change_that_is_wrong_is_told():
    with pytest.raises(InputError, match=r"rope\.lenght"):
        pose_family(load_case("thesis-1975"), [{"rope.lenght": 1.0}])


def test_a_held_parameter_is_not_searched_but_stands_among_the_named_ones():
    case = load_case("thesis-1975")
    family = pose_family(case, [{"rope.length": 1500.0}], held={"a": 0.5})
    assert [p.name for p in family.problem.parameters] == ["a1", "a2"]
    amplifier = case.gains.A
    assert family.first.named([2.0, 3.0]) == {"A": amplifier, "a": 0.5, "a1": 2.0, "a2": 3.0}
    free = pose(case)
    known = {"A": amplifier, "a": 0.5, "a1": 2.0, "a2": 3.0}
    assert family.first.values(known) == free.values(known)[1:]
    with pytest.raises(InputError, match="no parameter 'b'; there are: a, a1, a2"):
        _ = pose_family(case, [], held={"b": 1.0}).problem


def test_more_masses_are_those_of_every_member_that_has_fewer():
    case = load_case("subsea-crane").replace({"rope.masses": 3})
    family = pose_family(case, [{"rope.masses": 6}])
    assert family.masses == 6
    assert [q.masses for q in family.on(5).questions] == [5, 6]


def test_a_member_is_called_by_what_is_different_in_it():
    case = load_case("thesis-1975")
    assert difference_text(case, case) == "the case itself"
    other = case.replace({"rope.length": 1500.0, "payload.mass": "40 t"})
    assert set(difference_text(case, other).split(", ")) == {
        "rope.length 1500",
        "payload.mass 40000",
    }


def test_the_controller_of_a_member_is_built_for_the_case():
    case = load_case("subsea-crane")
    other = case.replace({"winch.gearbox.ratio": 1.2 * case.winch.gearbox.ratio})
    first, second = pose_family(case, [other], "drum-feedback").questions
    parameters = first.named([p.scale for p in first.law.parameters])
    own = pose(other, "drum-feedback").controller(parameters)
    assert pytest.approx(first.controller(parameters).D) == second.controller(parameters).D
    assert pytest.approx(first.controller(parameters).D) != own.D
