"""Spread files that nobody has written on purpose: an InputError or a spread."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from touched_files import touched

from models import load_case
from models.basics import InputError
from models.spread import Spread

CASE = load_case("thesis-1975")
TREE = {
    "vary": {
        "payload.mass": "20 %",
        "rope.length": {"uniform": {"low": "1900 m", "high": "2100 m"}},
        "rope.axial_stiffness": {"normal": {"sd": "10 %", "low": "1e8 N"}},
        "winch.motor.inertia": {"lognormal": 0.3},
        "sensors.telemetry.delay": {"samples": [0.1, "20 ms"]},
        "payload.area": {"triangular": {"low": "-10 %", "high": "10 %"}},
    },
    "correlations": [["payload.mass", "rope.length", 0.3]],
}


def written(tree: Any, path: Path) -> Path:
    text = io.StringIO()
    YAML(typ="safe", pure=True).dump(tree, text)
    path.write_text(text.getvalue(), encoding="utf-8")
    return path


def test_the_file_as_it_stands_is_a_spread(tmp_path: Path) -> None:
    assert Spread.from_yaml(written(TREE, tmp_path / "a.yaml")).on(CASE).sample(8).shape == (8, 6)


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(tree=touched(TREE))
@example(tree={**TREE, "correlations": 3})
@example(tree={"vary": {"rope.length": {"uniform": {"low": None, "high": 3.0}}}})
@example(tree={"vary": {"rope.length": [None, None]}})
@example(tree={"vary": {"rope.length": [{}, 1]}})
@example(tree={"vary": {"winch.motor.inertia": {"lognormal": 10**400}}})
def test_a_touched_file_is_a_spread_or_refused(tree: Any, tmp_path: Path) -> None:
    path = written(tree, tmp_path / "a.yaml")
    spread, said = None, ""
    try:
        spread = Spread.from_yaml(path)
        spread.on(CASE).sample(8)
    except InputError as error:
        said = str(error)
    assert not said or ("spread" if spread else str(path)) in said


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(text=st.text(max_size=200))
def test_any_text_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(InputError, match=r"a\.yaml"):
        Spread.from_yaml(path)
