"""The heave RAO: interpolation, extrapolation, and what hangs on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models import load_case
from models.basics import InputError
from models.sea import SeaSpectrum
from models.vessel import HeaveRao, hook_rao

OMEGA = np.array([0.4, 0.6, 0.9, 1.5])
AMPLITUDE = np.array([1.05, 1.3, 0.8, 0.3])
PHASE = np.array([0.1, 0.4, 1.2, 2.9])


def table(**keywords) -> HeaveRao:
    return HeaveRao(**{"omega": OMEGA, "amplitude": AMPLITUDE, "phase": PHASE, **keywords})


def test_the_table_itself_is_met():
    np.testing.assert_allclose(table()(OMEGA), AMPLITUDE * np.exp(1j * PHASE), rtol=1e-14)


@given(
    row=st.integers(0, 2),
    part=st.floats(0.0, 1.0),
    turns=st.lists(st.integers(-3, 3), min_size=4, max_size=4),
)
def test_amplitude_and_phase_are_interpolated_apart(row, part, turns):
    # Whole turns in a table's phases change nothing.
    rao = table(phase=PHASE + 2.0 * math.pi * np.array(turns))
    omega = OMEGA[row] + part * (OMEGA[row + 1] - OMEGA[row])
    amplitude = AMPLITUDE[row] + part * (AMPLITUDE[row + 1] - AMPLITUDE[row])
    phase = PHASE[row] + part * (PHASE[row + 1] - PHASE[row])
    assert complex(rao(omega)) == pytest.approx(amplitude * np.exp(1j * phase), rel=1e-9)


def test_a_pure_delay_keeps_its_amplitude_between_rows():
    # Why not linear on the complex number: with 2 rad between rows it would read 0.54.
    rao = HeaveRao(omega=OMEGA, amplitude=np.ones(4), phase=-4.0 * OMEGA)
    omega = np.linspace(0.4, 1.5, 101)
    np.testing.assert_allclose(rao(omega), np.exp(-4j * omega), rtol=1e-12)


def test_below():
    omega = np.array([0.0, 0.1, 0.3])
    unity = table(below="unity")(omega)
    np.testing.assert_allclose(np.abs(unity), 1.0 + 0.05 * omega / 0.4, rtol=1e-14)
    np.testing.assert_allclose(np.angle(unity), 0.1 * omega / 0.4, atol=1e-14)
    first = 1.05 * np.exp(0.1j)
    np.testing.assert_allclose(table(below="hold")(omega), np.full(3, first), rtol=1e-14)
    np.testing.assert_array_equal(table(below="zero")(omega), np.zeros(3))


def test_unity_takes_the_short_way_for_the_phase():
    # A first phase of 2 pi - 0.1 is a lag of 0.1, not a lead of 6.18.
    rao = table(phase=PHASE - 0.2 + 2.0 * math.pi, below="unity")
    assert np.angle(rao(0.2)) == pytest.approx(-0.05)


def test_beyond():
    omega = np.array([1.6, 3.0, 60.0])
    last = 0.3 * np.exp(2.9j)
    np.testing.assert_allclose(table(beyond="hold")(omega), np.full(3, last), rtol=1e-14)
    np.testing.assert_array_equal(table(beyond="zero")(omega), np.zeros(3))
    np.testing.assert_allclose(table(beyond="decay")(omega), last * (1.5 / omega) ** 2, rtol=1e-14)


@pytest.mark.parametrize("below", ["unity", "hold"])
@pytest.mark.parametrize("beyond", ["hold", "decay"])
def test_extrapolation_begins_where_the_table_ends(below, beyond):
    rao = table(below=below, beyond=beyond)
    for end in (0.4, 1.5):
        inside, outside = rao(end * (1 - 1e-9)), rao(end * (1 + 1e-9))
        assert abs(inside - outside) < 1e-8


def test_a_table_from_zero_frequency_has_nothing_below():
    rao = HeaveRao(omega=[0.0, 1.0], amplitude=[1.0, 0.5], below="unity")
    assert complex(rao(0.0)) == 1.0
    assert rao(np.zeros((2, 3))).shape == (2, 3)


def test_phase_may_be_left_out():
    np.testing.assert_array_equal(table(phase=None)(OMEGA).imag, np.zeros(4))


def bretschneider(peak_period: float) -> SeaSpectrum:
    return SeaSpectrum(kind="bretschneider", significant_height=2.0, peak_period=peak_period)


def test_share_outside_has_a_closed_form_for_a_constant_rao():
    # The share of a Bretschneider sea below w is exp(-1.25 (w_p/w)^4).
    sea = bretschneider(9.0)
    rao = HeaveRao(omega=[0.6, 1.2], amplitude=[0.7, 0.7], below="hold", beyond="hold")
    share = rao.share_outside(sea)

    def cumulative(omega):
        return math.exp(-1.25 * (sea.peak_frequency / omega) ** 4)

    assert share.below == pytest.approx(cumulative(0.6), rel=1e-6)
    assert share.beyond == pytest.approx(1.0 - cumulative(1.2), rel=1e-5)
    assert share.total == share.below + share.beyond
    # Cut to zero, the share is what holding would have given.
    cut = HeaveRao(omega=[0.6, 1.2], amplitude=[0.7, 0.7], below="zero", beyond="zero")
    assert cut.share_outside(sea) == share
    # omega^-5 of a sea makes the acceleration's tail the larger part.
    shares = [rao.share_outside(sea, derivative=n).beyond for n in range(3)]
    assert shares[0] < shares[1] < shares[2]


def test_share_outside_of_a_vessel_that_does_not_move():
    rao = HeaveRao(omega=[0.6, 1.2], amplitude=[0.0, 0.0], below="hold")
    assert rao.share_outside(bretschneider(9.0)).total == 0.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"omega": [0.4, 0.9, 0.6, 1.5]}, r"0\.9 followed by 0\.6 \(out of order, index 2\)"),
        ({"omega": [0.4, 0.6, 0.6, 1.5]}, r"0\.6 followed by 0\.6 \(repeated, index 2\)"),
        ({"omega": [0.4, math.nan, 0.9, 1.5]}, "omega must be finite numbers, got nan at index 1"),
        ({"omega": [-0.4, 0.6, 0.9, 1.5]}, "omega must be at least 0 rad/s, got -0.4"),
        ({"omega": [0.4]}, "at least 2 rows, got 1"),
        ({"amplitude": [1.0, 1.0]}, r"amplitude must have as many rows as omega \(4\), got 2"),
        ({"amplitude": [1.0, 1.0, -0.2, 0.1]}, "at least 0 m/m, got -0.2 at index 2"),
        ({"phase": [0.0]}, r"phase must have as many rows as omega \(4\), got 1"),
        ({"below": "nothing"}, "below must be one of unity, hold, zero; got 'nothing'"),
        ({"beyond": "unity"}, "beyond must be one of hold, zero, decay; got 'unity'"),
    ],
)
def test_bad_tables(values, message):
    with pytest.raises(InputError, match=message):
        table(**values)


def test_the_table_cannot_be_changed():
    rao, mine = table(), OMEGA.copy()
    assert HeaveRao(omega=mine, amplitude=AMPLITUDE).omega is not mine
    with pytest.raises(ValueError, match="read-only"):
        rao.amplitude[0] = 2.0


def test_from_case():
    case = load_case("thesis-1975").replace(
        {
            "vessel.heave_rao": {"omega": [0.4, 1.0], "amplitude": [1.0, 0.5]},
            "vessel.below": "hold",
            "vessel.beyond": "decay",
        }
    )
    rao = hook_rao(case.vessel)
    assert (rao.below, rao.beyond) == ("hold", "decay")
    np.testing.assert_allclose(np.abs(rao([0.1, 0.7, 2.0])), [1.0, 0.75, 0.125])
    turned = case.replace({"vessel.heave_rao.phase": ["90 deg", "180 deg"]})
    assert complex(hook_rao(turned.vessel)(0.4)) == pytest.approx(1j)
