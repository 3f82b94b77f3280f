"""Extreme values against Rayleigh's law on Gaussian seas, and against laws that are known."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, gumbel_r

from models.basics import InputError
from models.hook import HookMotion
from models.run import FEWEST_MAXIMA, Accumulator, ExtremeEstimate, extreme_over_seeds
from models.run.extremes import gumbel_fit, gumbel_maximum
from models.sea import SeaSpectrum
from models.vessel import HeaveRao

THREE_HOURS = 10800.0


@functools.cache
def sea_motion() -> HookMotion:
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=10.0, gamma=2.0)
    rao = HeaveRao(omega=[0.3, 1.2], amplitude=[1.0, 1.0], beyond="zero", below="zero")
    return HookMotion(sea=sea, rao=rao)


def seeds(count: int, duration: float = THREE_HOURS, **options):
    found = []
    for seed in range(count):
        heave = sea_motion().record(duration, step=0.25, seed=seed).displacement
        gather = Accumulator(["hook.heave"], 0.25, **options)
        gather.update(heave[:, np.newaxis])
        found.append(gather.result())
    return found


@functools.cache
def many():
    return seeds(24)


@pytest.mark.parametrize("minimum", [False, True])
def test_a_gaussian_sea_has_the_rayleigh_maximum_within_the_interval(minimum):
    found = extreme_over_seeds(many(), "hook.heave", minimum=minimum)
    exact = sea_motion().displacement.most_probable_maximum(THREE_HOURS)
    sign = -1.0 if minimum else 1.0
    assert found.status == "ok"
    assert found.low <= sign * exact <= found.high
    assert found.low <= found.rayleigh <= found.high
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.1 * exact
    # From 72 h of waves the deviation is known to 0.4 %, the period better.
    assert sign * found.rayleigh == pytest.approx(exact, rel=0.012)


def test_the_maxima_of_whole_runs_agree_with_rayleigh_too():
    maxima = [s["hook.heave"].maximum for s in many()]
    found = gumbel_maximum(maxima, block=THREE_HOURS)
    assert found.low <= sea_motion().displacement.most_probable_maximum() <= found.high
    assert found.count == 24
    location, scale = gumbel_r.fit(maxima)
    assert found.value == pytest.approx(location, rel=1e-5)
    assert found.scale == pytest.approx(scale, rel=1e-4)


def test_rope_that_snaps_has_larger_tension_than_rayleigh_says():
    rng = np.random.default_rng(4)
    found = []
    for seed in range(8):
        tension = 5.0 + sea_motion().record(3600.0, step=0.25, seed=seed).displacement
        snaps = rng.choice(tension.size, 4, replace=False)
        tension[snaps] += rng.gumbel(6.0, 1.0, 4)
        gather = Accumulator(["rope.tension"], 0.25, levels={"rope.tension": 5.0})
        gather.update(tension[:, np.newaxis])
        found.append(gather.result())
    estimate = extreme_over_seeds(found, "rope.tension")
    assert not estimate.low <= estimate.rayleigh <= estimate.high
    assert estimate.low > estimate.rayleigh


# 200 repetitions; the number covered has to be one that 95 % would give in 99.8 of 100 cases.
REPETITIONS = 200
LEAST, MOST = (int(k) for k in binom.ppf((0.001, 0.999), REPETITIONS, 0.95))


@pytest.mark.parametrize(("size", "duration"), [(8, 1200.0), (20, THREE_HOURS), (60, 3e5)])
def test_the_gumbel_interval_covers_the_truth_in_95_of_100_cases(size, duration):
    rng = np.random.default_rng(11)
    truth = 5.0 + 0.7 * math.log(duration / 1200.0)
    covered = 0
    for seed in range(REPETITIONS):
        maxima = rng.gumbel(5.0, 0.7, size)
        found = gumbel_maximum(maxima, block=1200.0, duration=duration, repetitions=1000, seed=seed)
        covered += found.low <= truth <= found.high
    assert LEAST <= covered <= MOST


@given(
    location=st.floats(-1e3, 1e3),
    scale=st.floats(1e-3, 1e5),
    size=st.integers(3, 40),
    seed=st.integers(0, 1000),
)
def test_the_gumbel_fit_solves_the_likelihood_equations(location, scale, size, seed):
    x = np.random.default_rng(seed).gumbel(location, scale, size)
    at, wide = (float(v) for v in gumbel_fit(x))
    z = (x - at) / wide
    # d ln L / d location and d ln L / d scale, both over n.
    assert np.exp(-z).mean() == pytest.approx(1.0, abs=1e-6)
    assert (z - z * np.exp(-z)).mean() == pytest.approx(1.0, abs=1e-6)


def test_the_estimate_moves_with_unit_and_zero():
    rng = np.random.default_rng(9)
    maxima = rng.gumbel(5.0, 1.0, 30)
    one = gumbel_maximum(maxima, block=1200.0)
    other = gumbel_maximum(1e3 * maxima - 7.0, block=1200.0)
    for name in ("value", "low", "high"):
        assert getattr(other, name) == pytest.approx(1e3 * getattr(one, name) - 7.0, rel=1e-6)


def test_more_seeds_narrow_the_interval():
    rng = np.random.default_rng(3)
    few, more = (gumbel_maximum(rng.gumbel(size=n), block=1200.0) for n in (10, 160))
    assert more.high - more.low < 0.4 * (few.high - few.low)


def test_too_few_data_are_told():
    with pytest.raises(InputError, match=rf"at least {FEWEST_MAXIMA} block maxima, got 3; simul"):
        gumbel_maximum([1.0, 2.0, 3.0], block=1200.0)
    with pytest.raises(InputError, match=r"the 9 maxima must differ, all are 2"):
        gumbel_maximum(np.full(9, 2.0), block=1200.0)


def test_over_seeds_too_few_data_are_a_status_not_a_failure():
    found = extreme_over_seeds(seeds(1, 3600.0), "hook.heave")
    assert isinstance(found, ExtremeEstimate)
    assert "want" in found.status
    assert math.isnan(found.value)
    assert math.isnan(found.high)
    assert not found.low <= found.rayleigh <= found.high
    assert found.rayleigh > 0.0


def test_what_was_not_gathered_is_told():
    bare = seeds(1, 600.0, block_signals=[])
    with pytest.raises(InputError, match=r"'hook\.heave' must have extremes of equal blocks"):
        extreme_over_seeds(bare, "hook.heave")
    with pytest.raises(InputError, match=r"no signal 'heave'; did you mean 'hook\.heave'"):
        extreme_over_seeds(bare, "heave")
    with pytest.raises(InputError, match=r"at least one run is wanted, got none"):
        extreme_over_seeds([], "hook.heave")
