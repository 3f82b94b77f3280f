"""Directional spreading against its own integrals and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import gammaln

from models.basics import InputError
from models.sea import Spreading
from models.sea.spreading import SPREADINGS

QUARTER = 0.5 * math.pi
LAWS = st.builds(Spreading, kind=st.sampled_from(SPREADINGS), exponent=st.floats(0.0, 500.0))


def harmonic(law, order):
    """Mean of cos(m angle), in closed form (DNV-RP-C205; beta functions)."""
    if law.kind == "cos-2s":  # Gamma(s+1)^2 / (Gamma(s+1+m) Gamma(s+1-m)), 0 for whole s < m
        s = law.exponent
        product = 1.0
        for j in range(1, order + 1):
            product *= (s + 1.0 - j) / (s + j)
        return product
    n = law.exponent
    # 2^-n Gamma(n+1) / (Gamma(1+(n+m)/2) Gamma(1+(n-m)/2)) over its value at m = 0.
    top = 2.0 * gammaln(1.0 + 0.5 * n) - gammaln(1.0 + 0.5 * (n + order))
    argument = 1.0 + 0.5 * (n - order)
    if argument <= 0.0:
        return None  # the reciprocal gamma function changes sign down there
    return math.exp(top - gammaln(argument))


@given(law=LAWS, order=st.integers(0, 24), mean=st.floats(-10.0, 10.0))
def test_nodes_are_exact_for_harmonics_of_the_heading(law, order, mean):
    exact = harmonic(law, order)
    headings, weights = law.nodes(mean)
    found = weights @ np.exp(1j * order * (headings - mean))
    assert abs(found.imag) < 1e-9
    if exact is not None:
        assert found.real == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("kind", SPREADINGS)
@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 3.3, 10.0, 40.0, 300.0])
def test_density_and_nodes_are_of_one_law(kind, exponent):
    law = Spreading(kind=kind, exponent=exponent)

    def motion(heading):  # of a barge: what a RAO looks like over headings
        return np.sinc(2.2 * np.cos(heading)) ** 2 + 0.3 * np.sin(heading) ** 2

    whole, _ = quad(law.density, -math.pi, math.pi, points=[-QUARTER, 0.0, QUARTER], limit=300)
    assert whole == pytest.approx(1.0, abs=1e-7)
    mean, _ = quad(
        lambda angle: law.density(angle) * motion(2.0 + angle),
        -math.pi,
        math.pi,
        points=[-QUARTER, -0.2, 0.0, 0.2, QUARTER],
        limit=400,
    )
    headings, weights = law.nodes(2.0)
    assert weights @ motion(headings) == pytest.approx(mean, abs=1e-6)


@given(law=LAWS, mean=st.floats(-100.0, 100.0), count=st.integers(1, 60))
def test_weights_are_positive_and_add_up_to_one(law, mean, count):
    headings, weights = law.nodes(mean, count)
    assert headings.shape == weights.shape == (count,)
    assert np.all(weights >= 0.0)
    assert weights.sum() == pytest.approx(1.0, rel=1e-12)
    assert np.all((headings >= 0.0) & (headings < 2.0 * math.pi))


def test_density_is_that_of_any_turn():
    law = Spreading(kind="cos-2s", exponent=5.0)
    angle = np.linspace(-3.0, 3.0, 61)
    np.testing.assert_allclose(law.density(angle + 4.0 * math.pi), law.density(angle), rtol=1e-9)
    narrow = Spreading(kind="cos-n", exponent=2.0)
    assert narrow.density([-1.6, 1.6, math.pi]).tolist() == [0.0, 0.0, 0.0]


def test_deviation_in_closed_form():
    for s in (1.0, 5.0, 50.0):
        law = Spreading(kind="cos-2s", exponent=s)
        assert law.deviation == pytest.approx(math.sqrt(2.0 / (s + 1.0)), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "cosine", "exponent": 2.0}, "kind must be one of cos-2s, cos-n; got 'cosine'"),
        ({"kind": "cos-n", "exponent": -1.0}, r"exponent must be in \[0, 500\], got -1.0"),
        ({"kind": "cos-n", "exponent": math.nan}, r"exponent must be in \[0, 500\], got nan"),
    ],
)
def test_bad_values(values, message):
    with pytest.raises(InputError, match=message):
        Spreading(**values)


def test_bad_nodes():
    law = Spreading(kind="cos-n", exponent=2.0)
    with pytest.raises(InputError, match="mean_heading must be a finite number in rad, got nan"):
        law.nodes(math.nan)
    with pytest.raises(InputError, match="count must be at least 1, got 0"):
        law.nodes(0.0, 0)
