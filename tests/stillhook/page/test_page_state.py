"""What stands on the page: sliders, what is typed, and what it means in SI."""

from __future__ import annotations

import math
from functools import cache

import pytest

import stillhook as sh
from models import InputError
from stillhook.page.desk import Desk
from stillhook.page.state import State, at_rest, gains_in_use, usual_structure
from synth.structures import Parameter

LAW = (
    Parameter(name="a1", scale=100.0, unit="(rad/s)/(m/s)"),
    Parameter(name="heave.gain", scale=0.1, low=0.0, high=2.0, unit="-"),
    Parameter(name="rolloff.corner", scale=20.0, low=1.0, high=500.0, unit="rad/s"),
)


@cache
def crane():
    return sh.load_case("subsea-crane")


def state(**parameters: float) -> State:
    values = {"a1": 40.0, "heave.gain": 0.9, "rolloff.corner": 10.0, **parameters}
    return State.of(crane(), "combined", LAW, values)


def test_a_case_has_the_sliders_of_what_it_names():
    shown = {c.key: c for c in state().controls() if not c.gain}
    assert list(shown) == [
        "sea.significant_height",
        "sea.peak_period",
        "vessel.heading",
        "rope.length",
        "sensors.telemetry.delay",
        "limits.max_sensitivity",
    ]
    assert (shown["sensors.telemetry.delay"].value, shown["sensors.telemetry.delay"].unit) == (
        pytest.approx(30.0),
        "ms",
    )
    assert shown["vessel.heading"].value == pytest.approx(165.0)
    assert shown["rope.length"].high == 1500.0  # all the rope that is on the drum
    assert shown["sea.peak_period"].name == "Peak period T_p [s]"
    assert all(c.help and c.low <= c.value <= c.high and c.step > 0.0 for c in shown.values())


def test_a_sea_of_1975_has_its_own_period_and_no_heading():
    case = sh.load_case("thesis-1975")
    keys = [c.key for c in State.of(case, "payload-feedback", ()).controls()]
    assert "sea.significant_period" in keys
    assert not {"sea.peak_period", "vessel.heading"} & set(keys)


def test_what_is_shown_is_kept_in_si():
    changed = state().with_value("sensors.telemetry.delay", 45.0).with_value("vessel.heading", 90)
    assert changed.changes["sensors.telemetry.delay"] == pytest.approx(0.045)
    assert changed.case_now.sensors.telemetry.delay == pytest.approx(0.045)
    assert changed.case_now.vessel.heading == pytest.approx(math.pi / 2)
    assert changed.case.sensors.telemetry.delay == 0.03
    assert changed.value_of("rope.length") == 1000.0
    assert changed.value_of("rope.no_such") is None


def test_sliders_of_parameters_reach_about_their_values():
    spans = state().spans
    assert spans["a1"] == (0.0, 100.0)
    assert spans["heave.gain"] == (0.0, 2.0)
    assert spans["rolloff.corner"] == (2.0, 50.0)
    assert state(a1=-40.0).spans["a1"] == (-100.0, 0.0)
    assert state(a1=0.0).spans["a1"] == (0.0, 100.0)
    assert state(**{"rolloff.corner": 400.0}).spans["rolloff.corner"] == (80.0, 500.0)


def test_a_slider_moves_on_where_a_value_is_typed_beyond_it():
    assert state().with_value("a1", 30.0).spans["a1"] == (0.0, 100.0)
    moved = state().with_value("a1", 400.0)
    assert moved.parameters["a1"] == 400.0
    assert moved.spans["a1"] == (0.0, 1000.0)
    assert moved.control("a1").high == 1000.0


def test_units_are_as_the_trade_writes_them():
    shown = {c.key: c.unit for c in state().controls()}
    assert (shown["a1"], shown["heave.gain"], shown["rolloff.corner"]) == (
        "(rad/s)/(m/s)",
        "",
        "rad/s",
    )


@pytest.mark.parametrize("text", ["2.5", " 2,5 ", "2.5e0"])
def test_numbers_are_typed_as_people_write_them(text):
    assert state().with_text("sea.significant_height", text).changes == {
        "sea.significant_height": 2.5
    }


@pytest.mark.parametrize(
    ("key", "text", "said"),
    [
        ("sea.significant_height", "two", "Wave height H_s must be a number, got 'two'"),
        ("heave.gain", "-1", "Heave feed-forward gain must be"),
        ("a1", "nan", "Gain a1, on the load's velocity must be a finite number"),
        ("no.such", "1", "there is no control 'no.such'"),
    ],
)
def test_what_is_no_value_is_refused_in_a_sentence(key, text, said):
    with pytest.raises(InputError, match="page") as refused:
        state().with_text(key, text)
    assert said in str(refused.value)


def test_all_parameters_have_to_be_there():
    with pytest.raises(InputError, match=r"combined: the parameter heave\.gain is missing"):
        State.of(crane(), "combined", LAW, {"a1": 1.0})
    kept = state().with_value("rope.length", 900.0).with_parameters({p.name: 1.0 for p in LAW})
    assert (kept.parameters["a1"], kept.changes) == (1.0, {"rope.length": 900.0})


def test_a_case_begins_at_its_own_gains_or_at_rest():
    thesis = sh.load_case("thesis-1975")
    assert usual_structure(thesis) == "payload-feedback"
    assert usual_structure(crane()) == "drum-feedback"
    assert gains_in_use(thesis, "payload-feedback") == {"A": 200, "a": 50, "a1": 100, "a2": 100}
    assert gains_in_use(thesis, "drum-feedback") is None
    assert at_rest(LAW) == {"a1": 0.0, "heave.gain": 0.1, "rolloff.corner": 20.0}
    opened = Desk().state(thesis, "payload-feedback")
    assert opened.parameters["a1"] == 100.0
    assert "payload-feedback" in opened.structures
    assert "feed-forward" not in opened.structures
