"""Intervals of pooled rms and of their ratios: positive, paired, inverse, and wide enough."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from models.basics import pooled_interval

SIZES = st.floats(1e-9, 1e6)
PAIRS = st.lists(st.tuples(SIZES, SIZES), min_size=2, max_size=12)


@given(PAIRS)
def test_the_ends_are_positive_and_on_either_side(pairs):
    own, other = (list(side) for side in zip(*pairs, strict=True))
    for found in (pooled_interval(own), pooled_interval(own, other)):
        assert 0.0 < found.low <= found.mean <= found.high < math.inf
        # as far below as above, on a log scale
        assert found.low * found.high == pytest.approx(found.mean**2, rel=1e-9)
        assert found.count == len(pairs)


@given(PAIRS)
def test_a_ratio_is_that_of_the_pooled_rms_and_its_inverse_is_inverse(pairs):
    own, other = (list(side) for side in zip(*pairs, strict=True))
    ratio, inverse = pooled_interval(own, other), pooled_interval(other, own)
    assert ratio.mean == pytest.approx(pooled_interval(own).mean / pooled_interval(other).mean)
    assert ratio.low * inverse.high == pytest.approx(1.0, rel=1e-9)
    assert ratio.high * inverse.low == pytest.approx(1.0, rel=1e-9)


@given(st.lists(SIZES, min_size=2, max_size=12), st.floats(1e-3, 1e3))
def test_what_is_the_same_share_in_every_run_has_no_width(values, factor):
    found = pooled_interval(factor * np.array(values), values)
    assert (found.low, found.high) == pytest.approx((factor, factor), rel=1e-6)


@given(st.lists(SIZES, min_size=2, max_size=12), st.floats(1e-3, 1e3))
def test_the_unit_does_not_matter(values, factor):
    plain, scaled = pooled_interval(values), pooled_interval(factor * np.array(values))
    for name in ("mean", "low", "high"):
        assert getattr(scaled, name) == pytest.approx(factor * getattr(plain, name), rel=1e-9)


def test_runs_without_a_partner_are_left_out():
    found = pooled_interval([1.0, 2.0, 5.0, math.nan], [0.5, 1.0, math.nan, 3.0])
    assert (found.mean, found.count) == (2.0, 2)


@pytest.mark.parametrize(
    ("values", "over", "centre"),
    [
        ([], None, math.nan),
        ([0.0, 0.0], None, math.nan),
        ([1.0, math.inf], None, math.inf),
        ([1.0, math.inf], [1.0, 1.0], math.inf),
        ([1.0, 2.0], [1.0, math.inf], math.nan),
        ([1.0, 2.0], [0.0, 0.0], math.nan),
        ([3.0], None, 3.0),
    ],
)
def test_what_has_no_interval_has_none(values, over, centre):
    found = pooled_interval(values, over)
    assert found.mean == pytest.approx(centre, nan_ok=True)
    assert math.isnan(found.low)
    assert math.isnan(found.high)


@pytest.mark.parametrize(("spread", "least"), [(0.1, 0.93), (0.4, 0.88)])
def test_the_interval_covers_the_true_value_about_as_often_as_it_says(spread, least):
    rng = np.random.default_rng(4)
    runs = np.exp(spread * rng.standard_normal((2000, 6)))
    true = math.exp(spread**2)  # root of the mean square of a lognormal
    held = [found.low <= true <= found.high for found in map(pooled_interval, runs)]
    assert least < np.mean(held) < 0.98


def test_the_interval_is_that_of_students_distribution():
    found = pooled_interval([1.0, 1.1, 1.2], confidence=0.9)
    squares = np.array([1.0, 1.21, 1.44])
    half = stats.t.ppf(0.95, 2) * squares.std(ddof=1) / squares.mean() / math.sqrt(3.0) / 2.0
    assert math.log(found.high / found.mean) == pytest.approx(half)
