"""Statistics of spectra against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.basics import (
    InputError,
    SpectrumStatistics,
    most_probable_maximum,
    peak_factor,
    spectral_nodes,
    spectrum_statistics,
    zero_crossing_period,
)
from models.basics.metrics import moments


@given(
    level=st.floats(1e-3, 1e3),
    low=st.floats(0.05, 2.0),
    width=st.floats(0.1, 10.0),
)
def test_moments_of_a_flat_band(level, low, width):
    high = low + width
    q = spectral_nodes(low, high)
    found = moments(q, lambda omega: np.full_like(omega, level))
    exact = [level * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for n in (0, 1, 2, 4)]
    np.testing.assert_allclose(found, exact, rtol=1e-10)
    by_values = moments(q, np.full(len(q), level), (2,))
    assert by_values[0] == pytest.approx(found[2], rel=1e-14)


def test_statistics_of_a_narrow_band_are_those_of_a_sine():
    # A sine of amplitude a and frequency w has variance a^2/2 and, for every order, m_n = w^n m0.
    low, high = 0.7999, 0.8001
    q = spectral_nodes(low, high)
    s = spectrum_statistics(q, np.full(len(q), 0.5 * 3.0**2 / (high - low)))
    assert s.rms == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-9)
    assert s.significant_height == 4.0 * s.rms
    assert s.significant_amplitude == 2.0 * s.rms
    period = 2.0 * math.pi / 0.8
    for found in (s.zero_crossing_period, s.mean_period):
        assert found == pytest.approx(period, rel=1e-6)
    assert s.most_probable_maximum(600.0) == pytest.approx(
        s.rms * math.sqrt(2.0 * math.log(600.0 / period)), rel=1e-6
    )


@given(crossings=st.floats(2.0, 1e6), t_z=st.floats(0.01, 100.0))
def test_one_crest_in_the_exposure_exceeds_the_most_probable_maximum(crossings, t_z):
    # Rayleigh crests exceed k sigma with probability exp(-k^2/2); the mode is where one does.
    k = peak_factor(t_z, crossings * t_z)
    assert crossings * math.exp(-(k**2) / 2.0) == pytest.approx(1.0, rel=1e-9)


def test_peak_factor_is_held_where_the_formula_means_nothing():
    assert peak_factor(10.0, 5.0) == 1.0
    assert peak_factor(10.0, 10.0 * math.exp(0.5)) == pytest.approx(1.0)
    assert peak_factor(math.inf) == 1.0
    assert peak_factor(10.0, 17.0) > 1.0


def test_a_signal_at_rest():
    s = SpectrumStatistics(m0=0.0, m1=0.0, m2=0.0, m4=0.0)
    assert s.rms == 0.0
    assert s.zero_crossing_period == s.mean_period == math.inf
    assert s.most_probable_maximum() == 0.0


def test_three_hours_is_the_usual_exposure():
    assert most_probable_maximum(2.0, 10.0) == 2.0 * math.sqrt(2.0 * math.log(1080.0))
    assert most_probable_maximum(2.0, 10.0, 3600.0) == 2.0 * math.sqrt(2.0 * math.log(360.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: peak_factor(0.0), "t_z must be above 0 s, got 0.0"),
        (lambda: peak_factor(5.0, -1.0), "duration must be above 0 s, got -1.0"),
        (lambda: peak_factor(math.nan), "t_z must be above 0 s, got nan"),
        (lambda: most_probable_maximum(-1.0, 5.0), "sigma must be at least 0, got -1.0"),
        (lambda: zero_crossing_period(math.nan, 1.0), "m0 must be at least 0, got nan"),
        (lambda: zero_crossing_period(1.0, -1e-9), "m2 must be at least 0, got -1e-09"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(InputError, match=message):
        call()
