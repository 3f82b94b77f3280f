"""Golden figures: nothing that moves files or joins types may change a number.

A group is recomputed and compared row by row with `figures.csv`, `commands.csv` and `faces.json`;
`python tests/golden/make.py` says the same by hand.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def _make():
    if "golden_make" not in sys.modules:
        spec = importlib.util.spec_from_file_location("golden_make", HERE / "make.py")
        module = importlib.util.module_from_spec(spec)
        sys.modules["golden_make"] = module
        spec.loader.exec_module(module)
    return sys.modules["golden_make"]


MAKE = _make()
FIGURES, FACES = MAKE.sibling("golden_figures"), MAKE.sibling("golden_faces")


def _marked(groups):
    return [
        pytest.param(group, id=group.name, marks=[pytest.mark.slow] if group.slow else [])
        for group in groups.values()
    ]


@pytest.mark.parametrize("group", _marked(FIGURES.GROUPS))
def test_figures_are_the_golden_ones(group):
    found = group.figures()
    assert found.rows
    lines = MAKE.figure_differences(found, MAKE.read_rows(), MAKE.read_series(), group.name)
    assert not lines, "\n" + "\n".join(lines)


@pytest.mark.parametrize("group", _marked(FACES.GROUPS))
def test_faces_are_the_golden_ones(group):
    lines = MAKE.face_differences(group.faces(), MAKE.read_faces().get(group.name, {}))
    assert not lines, "\n" + "\n".join(lines)


def test_every_row_belongs_to_a_group():
    known = {*FIGURES.GROUPS}
    names = [*MAKE.read_rows(), *MAKE.read_series()]
    assert {MAKE.group_of(name) for name in names} == known
    assert set(MAKE.read_faces()) == {*FACES.GROUPS}


def test_a_changed_digit_is_a_difference():
    found, rows = FIGURES.Figures(), MAKE.read_rows()
    name = "thesis.payload_before"
    value = float(rows[name]["value"])
    found.put(name, value * (1.0 + 1e-8))
    lines = MAKE.figure_differences(found, {name: rows[name]}, {}, "thesis")
    assert len(lines) == 1
    assert "1.0e-08 against 1e-09" in lines[0]
    found.rows.clear()
    assert MAKE.figure_differences(found, {name: rows[name]}, {}, "thesis") == [
        f"{name}: a row without a figure"
    ]
    found.put(name, value)
    assert MAKE.figure_differences(found, {name: rows[name]}, {}, "thesis") == []
    assert len(MAKE.figure_differences(found, {}, {}, "thesis")) == 1
