"""Recipes for controllers: from a store, in any process the same one, or none with a why."""

from __future__ import annotations

import importlib
import json
import pickle
import sys

import numpy as np
import pytest
import sweep_pilots
from designs import PERFECT_MRU, thesis_design, unstable_design

import stillhook as sh
from models.basics import InputError
from models.sensing import HEARD, Measurement
from stillhook.controllers import (
    CONTENDERS,
    contenders_of,
    recipe_from,
    recipe_of,
)
from synth.controllers import LinearFeedback

CASE = sh.load_case("thesis-1975")


def answers(controller):
    """Return the commands to some measurements."""
    controller.reset()
    shown = np.random.default_rng(3).standard_normal((4, len(HEARD)))
    return [controller.step(Measurement(row), 0.01 * i) for i, row in enumerate(shown)]


def test_a_design_without_a_law_is_named_with_what_is_wrong():
    with pytest.raises(InputError, match=r"^the design has no law: unstable: grows by a factor e"):
        recipe_of(unstable_design(), "sweep").controller(CASE)


def test_a_recipe_that_was_stored_makes_the_same_controller():
    own = recipe_of(thesis_design(), "sweep")
    again = recipe_from(json.loads(json.dumps(own.to_dict())))
    assert (again.name, again.kind, again.needs) == ("feedback", "law", "payload-feedback")
    assert again.identity == own.identity
    one, other = own.controller(CASE), again.controller(CASE)
    assert answers(one) == answers(other)
    changed = again.with_gains(CASE, {"a2": 90.0}).controller(CASE)
    assert answers(changed) == answers(LinearFeedback(CASE, {**own.gains, "a2": 90.0}))
    assert answers(changed) != answers(one)


def test_a_parameter_of_any_structure_can_vary():
    gains = {
        "drum.speed_gain": 0.0533,
        "drum.position_gain": 12.5,
        "heave.gain": 0.97,
        "heave.lead": 0.28,
        "heave.bandwidth": 100.0,
    }
    case = CASE.replace(PERFECT_MRU)
    design = sh.evaluate_gains(case, gains, "feed-forward")
    own = recipe_of(design, "sweep")
    assert (own.name, own.needs, own.gains) == ("feed-forward", "feed-forward", design.parameters)
    changed = own.with_gains(case, {"heave.gain": 0.5}).controller(case)
    other = sh.evaluate_gains(case, {**gains, "heave.gain": 0.5}, "feed-forward")
    assert answers(changed) == answers(LinearFeedback.from_design(other))
    assert answers(changed) != answers(own.controller(CASE))


def test_a_function_of_a_module_goes_to_any_process_and_one_of_a_test_does_not():
    own = recipe_of(("linear", sweep_pilots.linear), "sweep")
    assert own.portable
    assert pickle.loads(pickle.dumps(own)).controller(CASE).name == "linear"
    assert own.identity == recipe_of(("linear", sweep_pilots.linear), "sweep").identity
    local = [recipe_of(("mine", lambda case: None), "sweep") for _ in range(2)]
    assert not local[0].portable
    assert local[0].identity != local[1].identity
    with pytest.raises(InputError, match="was given as Python code, which is not kept"):
        recipe_from(own.to_dict())


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("thesys", "compare: there is no controller 'thesys'"),
        (("a", "feedback"), "compare: a: must be a design, a controller or a function"),
        (1.5, r"compare: a controller must be a name, .*; got float"),
    ],
)
def test_what_is_no_controller_is_refused_in_the_name_of_who_asked(wanted, message):
    with pytest.raises(InputError, match=message):
        recipe_of(wanted, "compare")


def test_who_has_nothing_to_vary_or_to_follow_with_says_so():
    held = recipe_of("none", "sweep")
    with pytest.raises(InputError, match="none: gains can be varied of a design of a winch"):
        held.with_gains(CASE, {"a": 1.0})
    with pytest.raises(InputError, match="as an object cannot follow the case"):
        recipe_of(LinearFeedback(CASE, thesis_design().gains), "sweep").follow(CASE, starts=1)
    with pytest.raises(InputError, match="void: the factory must return a controller with name"):
        recipe_of(("void", lambda case: None), "sweep").controller(CASE)


def test_a_design_is_wanted_by_laws_that_are_designed_for_every_sea_alone():
    assert CONTENDERS["feedback-half"].needs == "payload-feedback-half"
    assert CONTENDERS["none"].needs == CONTENDERS["clairvoyant"].needs == ""
    (given,) = contenders_of([thesis_design()])
    assert (given.name, given.needs, given.group) == ("design", "", "linear")


@pytest.mark.parametrize(("entry", "portable"), [("", False), ("{here}", True)])
def test_a_module_that_only_the_current_folder_leads_to_stays_here(
    tmp_path, monkeypatch, entry, portable
):
    # Other processes do not look there, as anybody's file may lie there.
    name = f"pilot_beside_{portable}"
    (tmp_path / f"{name}.py").write_text("def make(case):\n    return None\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(entry.format(here=tmp_path))
    monkeypatch.setattr(sys, "path", [entry.format(here=tmp_path), *sys.path[1:]])
    make = importlib.import_module(name).make
    assert recipe_of(("mine", make), "sweep").portable is portable
