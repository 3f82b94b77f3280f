"""Gain schedules in files that nobody has written on purpose: an InputError or a schedule."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from touched_files import touched

from models import load_case
from models.basics import InputError
from models.casefile import read_yaml
from synth.robust import GainSchedule

CASE = load_case("thesis-1975")
MADE = GainSchedule(
    case=CASE,
    lengths=np.array([500.0, 1000.0, 2000.0]),
    gains=np.array([[50.0, 100.0, 80.0], [50.0, 100.0, 90.0], [40.0, 90.0, 100.0]]),
    names=("a", "a1", "a2"),
    amplifier=200.0,
)
TREE = read_yaml(MADE.to_yaml(), "schedule")[0]


def written(tree: Any) -> str:
    text = io.StringIO()
    YAML(typ="safe", pure=True).dump(tree, text)
    return text.getvalue()


def test_the_file_as_it_stands_is_the_schedule() -> None:
    again = GainSchedule.from_yaml(written(TREE), CASE)
    assert again.at(700.0) == pytest.approx(MADE.at(700.0), rel=1e-12)


@settings(max_examples=200, deadline=None)
@given(tree=touched(TREE))
@example(tree={**TREE, "amplifier": math.nan})
@example(tree={**TREE, "lengths": [500.0, math.nan, 2000.0]})
@example(tree={**TREE, "lengths": [500.0, 1000.0, math.inf]})
@example(tree={**TREE, "lengths": [500.0, 1000.0, 10**400]})
@example(tree={**TREE, "gains": {}})
@example(tree={**TREE, "gains": {"a": 1.0, "a1": 2.0, "a2": 3.0}})
@example(tree={**TREE, "gains": {3: [1.0, 2.0, 3.0]}})
@example(tree={**TREE, "stillhook_schedule": 2})
@example(tree={**TREE, "amplifier": True, "over": "payload.mass"})
def test_a_touched_file_is_a_schedule_or_refused(tree: Any) -> None:
    found, said = None, ""
    try:
        found = GainSchedule.from_yaml(written(tree), CASE, "a.yaml")
    except InputError as error:
        said = str(error)
    if found is None:
        assert said.startswith("a.yaml: ")
        return
    for length in (found.lengths[0], found.lengths[-1]):
        gains = found.at(float(length))
        assert all(isinstance(name, str) and math.isfinite(v) for name, v in gains.items())
    again = GainSchedule.from_yaml(found.to_yaml(), CASE)
    assert (again.lengths == found.lengths).all()
    assert (again.gains == found.gains).all()


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=200))
def test_any_text_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"a\.yaml"):
        GainSchedule.from_yaml(text, CASE, "a.yaml")
