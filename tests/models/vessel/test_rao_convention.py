"""Any convention of a RAO file: to the project's own, and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_conventions import first_column, headings, written
from vessel_tables import orcaflex_phase, swinging

from models.basics import InputError
from models.vessel import MODES
from models.vessel.convention import CHOICES, Convention
from models.vessel.readers.csv_file import parse_csv

CONVENTIONS = st.builds(
    Convention,
    **{name: st.sampled_from(choices) for name, choices in CHOICES.items()},
    heading_zero=st.sampled_from([0.0, 90.0, 180.0, -45.0]),
)


@given(convention=CONVENTIONS, seed=st.integers(0, 1000))
@settings(max_examples=300, deadline=None)
def test_there_and_back_is_the_identity(convention: Convention, seed: int) -> None:
    raos = swinging(seed=seed)
    slope = raos.wave_number(raos.omega)[:, None] * np.ones(raos.heading.size)
    amplitude, phase, numbers = written(convention, raos.values, slope)
    assert np.all(amplitude >= 0.0)
    for back in (
        convention.values(amplitude, phase, slope),
        convention.complex_values(numbers, slope),
    ):
        assert np.allclose(back, raos.values, rtol=1e-12, atol=1e-15)
    assert np.allclose(
        convention.omega(first_column(convention, raos.omega)), raos.omega, rtol=1e-14
    )
    there = headings(convention, raos.heading)
    assert np.all((there >= 0.0) & (there < 360.0))
    apart = np.exp(1j * (convention.directions(there) - raos.heading))
    assert np.allclose(apart, 1.0, atol=1e-12)


@given(convention=CONVENTIONS, complex_numbers=st.booleans())
@settings(max_examples=60, deadline=None)
def test_a_csv_in_any_convention_is_the_same_table(
    convention: Convention, complex_numbers: bool
) -> None:
    raos = swinging()
    slope = raos.wave_number(raos.omega)[:, None] * np.ones(raos.heading.size)
    amplitude, phase, numbers = written(convention, raos.values, slope)
    first, second = (numbers.real, numbers.imag) if complex_numbers else (amplitude, phase)
    name = {"frequency (rad/s)": "omega", "frequency (Hz)": "frequency", "period (s)": "period"}
    parts = ("real", "imag") if complex_numbers else ("amplitude", "phase")
    lines = [f"# {key}: {getattr(convention, key)}" for key in CHOICES if key != "waves"]
    lines.append(f"# heading_zero: {convention.heading_zero}")
    columns = [f"{mode}_{part}" for mode in MODES for part in parts]
    lines.append(",".join([name[convention.waves], "heading", *columns]))
    for i, column in enumerate(first_column(convention, raos.omega)):
        for j, heading in enumerate(headings(convention, raos.heading)):
            cells = np.column_stack([first[i, j], second[i, j]]).ravel()
            lines.append(",".join(repr(float(v)) for v in (column, heading, *cells)))
    found = parse_csv("table.csv", "\n".join(lines))
    assert np.allclose(found.omega, raos.omega, rtol=1e-12)
    assert np.allclose(found.heading, raos.heading, atol=1e-9)
    assert np.allclose(found.values, raos.values, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("sense", CHOICES["phase"])
@pytest.mark.parametrize("relative_to", CHOICES["phase_relative_to"])
def test_a_phase_is_when_the_motion_is_at_its_largest(sense: str, relative_to: str) -> None:
    convention = Convention(phase=sense, phase_relative_to=relative_to, phase_unit="radians")
    values = np.exp(1j * np.array([0.1, 1.3, 2.9, -2.0, -0.7, 3.1]))
    phase = np.array([orcaflex_phase(complex(v), sense, relative_to) for v in values])
    assert np.allclose(convention.values(np.ones(6), phase, 1.0), values, atol=1e-14)


def test_fossens_axes_are_ours_turned_about_the_x_axis() -> None:
    # A point's displacement and a small rotation are vectors: (x, y, z) -> (x, -y, -z).
    ned = Convention(
        sway="starboard", heave="down", pitch="bow up", yaw="bow to starboard", turning="clockwise"
    )
    assert np.array_equal(ned.signs, [1, -1, -1, 1, -1, -1])
    assert np.allclose(ned.directions([0.0, 30.0, 180.0]), np.radians([0.0, 330.0, 180.0]))
    assert "heave down" in ned.words()
    assert Convention().words() == "the project's own convention"


def test_waves_come_from_where_they_do_not_go() -> None:
    compass = Convention(headings="from", turning="clockwise")
    # From ahead: head sea.  From 90 deg clockwise of the bow, starboard: towards port.
    assert np.allclose(np.degrees(compass.directions([0.0, 90.0, 180.0])), [180.0, 90.0, 0.0])


def test_slope_and_steepness_are_k_a_and_k_a_over_pi() -> None:
    k = 0.02
    rolled = np.array([0.0, 0.0, 0.0, 1.5, 0.0, 0.0])
    slope = Convention(rotations="max wave slope").values(rolled, np.zeros(6), k)
    steepness = Convention(rotations="wave steepness").values(rolled * math.pi, np.zeros(6), k)
    assert slope[3] == pytest.approx(0.03)
    assert steepness[3] == pytest.approx(0.03 * 1.0)
    degrees = Convention(rotations="deg/m").values(rolled, np.zeros(6), k)
    assert degrees[3] == pytest.approx(math.radians(1.5))


def test_a_word_that_is_no_choice_is_refused() -> None:
    with pytest.raises(InputError, match="heave must be one of up, down; got 'upwards'"):
        Convention(heave="upwards")
