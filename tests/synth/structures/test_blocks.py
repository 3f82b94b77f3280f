"""Filter sections: response, denominator and state space say the same, with slopes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.plant import LinearPlant
from synth.loop import Dual
from synth.structures import Parameter
from synth.structures.blocks import (
    FilterSection,
    integral,
    lead_lag,
    lead_time,
    notch,
    roll_off,
    series,
)
from synth.structures.diagram import Branch, DiagramLaw

SECTIONS: dict[str, FilterSection] = {
    "roll-off": roll_off("f", corner=(0.5, 50.0)),
    "lead-lag": lead_lag("f", zero=(0.1, 30.0), pole=(0.1, 60.0)),
    "notch": notch("f", frequency=(1.0, 20.0)),
    "integral": integral("f", corner=(0.01, 1.0)),
    "lead time": lead_time("f"),
}
OMEGA = np.geomspace(0.03, 300.0, 9)


def values_of(section: FilterSection, share: float) -> list[float]:
    points = np.full((1, len(section.parameters)), share)
    return [float(v) for v in section.guess(points)[0]]


@pytest.mark.parametrize("name", SECTIONS)
@given(share=st.floats(0.02, 0.98))
@settings(max_examples=20, deadline=None)
def test_state_space_has_the_response(name: str, share: float) -> None:
    section = SECTIONS[name]
    values = values_of(section, share)
    A, B, C, D = section.matrices(values)
    s = 1j * OMEGA
    found = [(C @ np.linalg.solve(p * np.eye(len(A)) - A, B) + D)[0, 0] for p in s]
    assert np.asarray(section.response(values, s)) == pytest.approx(np.array(found), rel=1e-12)


@pytest.mark.parametrize("name", SECTIONS)
def test_slopes_are_differences(name: str) -> None:
    section = SECTIONS[name]
    values, s = values_of(section, 0.4), 1j * OMEGA
    unit = np.eye(len(values))
    found = section.response([Dual(np.array([v]), unit[:, [k]]) for k, v in enumerate(values)], s)
    assert found.value == pytest.approx(np.asarray(section.response(values, s)), rel=1e-14)
    for k, v in enumerate(values):
        step = 1e-5 * v * unit[k]
        more, less = (np.asarray(section.response(values + e, s)) for e in (step, -step))
        size = np.abs(found.slope[k]).max()
        assert found.slope[k] == pytest.approx(
            (more - less) / (2e-5 * v), rel=1e-6, abs=1e-8 * size
        )


def test_textbook_values() -> None:
    at_corner = roll_off("f", corner=(1.0, 10.0)).response([4.0, 0.5], np.array([4.0j]))
    assert at_corner == pytest.approx([-1.0j])  # 1/(2 i z)
    at_notch = notch("f", frequency=(1.0, 10.0)).response([7.0, 0.3, 0.1], np.array([7.0j]))
    assert at_notch == pytest.approx([0.1])
    lead = lead_time("f").response([0.2, 1e6], np.array([0.5j]))
    assert lead == pytest.approx([1.0 + 0.1j], rel=1e-5)
    action = integral("f", corner=(0.01, 1.0)).response([0.2], np.array([0.2j]))
    assert action == pytest.approx([1.0 - 1.0j])
    lag = lead_lag("f", zero=(0.1, 9.0), pole=(0.1, 9.0)).response([1.0, 5.0], np.array([1e9j]))
    assert lag == pytest.approx([5.0], rel=1e-6)


@pytest.mark.parametrize("name", SECTIONS)
def test_guesses_lie_within_the_bounds(name: str) -> None:
    section = SECTIONS[name]
    for share in (0.0, 0.5, 1.0):
        for value, parameter in zip(values_of(section, share), section.parameters, strict=True):
            assert parameter.low * (1 - 1e-12) <= value <= parameter.high * (1 + 1e-12)
            assert 0.0 < parameter.scale <= parameter.high
    assert all(p.name.startswith("f.") for p in section.parameters)


def test_series_is_the_product() -> None:
    first, then = SECTIONS["notch"], SECTIONS["integral"]
    one, two = values_of(first, 0.3), values_of(then, 0.6)
    A, B, C, D = series(first.matrices(one), then.matrices(two))
    s = 1j * OMEGA
    found = [(C @ np.linalg.solve(p * np.eye(len(A)) - A, B) + D)[0, 0] for p in s]
    wanted = np.asarray(first.response(one, s)) * np.asarray(then.response(two, s))
    assert wanted == pytest.approx(np.array(found), rel=1e-12)


class Drawn(DiagramLaw):
    def draw(self, points, omega, yu):
        return points


def test_sections_in_a_row_are_the_product_and_branches_add() -> None:
    first, then = SECTIONS["notch"], integral("g", corner=(0.01, 1.0))
    one, two = values_of(first, 0.3), values_of(then, 0.6)
    plant = LinearPlant(A=[[-1.0]], B=[[1.0]], E=[[1.0]], C=[[1.0], [2.0]])
    filtered = Branch(weights={"y1": lambda p: p["k"], "y2": lambda _: 2.0}, sections=(first, then))
    branches = [filtered, Branch(weights={"y2": lambda _: 3.0})]
    law = Drawn(plant, branches, [Parameter(name="k", scale=1.0)], {})
    s = 1j * OMEGA
    both = np.asarray(first.response(one, s)) * np.asarray(then.response(two, s))
    wanted = np.stack([5.0 * both, 2.0 * both + 3.0], axis=1)
    found = law.controller([5.0, *one, *two]).response_at(s)[:, 0]
    assert found == pytest.approx(wanted, rel=1e-12)
