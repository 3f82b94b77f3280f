"""Extreme values against Rayleigh's law on Gaussian seas, and against laws that are known."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, genpareto, gumbel_r

from models.basics import InputError
from models.hook import HookMotion
from models.run import FEWEST_MAXIMA, Accumulator, ExtremeEstimate, extreme_over_seeds
from models.run.exceedances import cluster_maxima
from models.run.extremes import FEWEST_PEAKS, gumbel_fit, gumbel_maximum, pareto_maximum
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
@pytest.mark.parametrize("method", ["gumbel", "pareto"])
def test_a_gaussian_sea_has_the_rayleigh_maximum_within_the_interval(method, minimum):
    found = extreme_over_seeds(many(), "hook.heave", method=method, minimum=minimum, over=0.98)
    exact = sea_motion().displacement.most_probable_maximum(THREE_HOURS)
    sign = -1.0 if minimum else 1.0
    assert found.status == "ok"
    assert found.low <= sign * exact <= found.high
    assert found.low <= found.rayleigh <= found.high
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.1 * exact
    # From 72 h of waves the deviation is known to 0.4 %, the period better.
    assert sign * found.rayleigh == pytest.approx(exact, rel=0.012)
    # Beyond the most probable one, which has a probability of 1/e.
    assert sign * found.quantile(0.9) > exact > 0.0
    assert found.quantile(math.exp(-1.0)) == pytest.approx(found.value)


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


@pytest.mark.parametrize("shape", [-0.2, 0.0, 0.15])
@pytest.mark.slow
def test_the_pareto_interval_covers_the_truth_in_95_of_100_cases(shape):
    rng = np.random.default_rng(12)
    expected = 150.0 * THREE_HOURS / 36000.0
    truth = 2.0 + 0.5 * (math.log(expected) if shape == 0.0 else (expected**shape - 1.0) / shape)
    covered = 0
    for _ in range(REPETITIONS):
        peaks = 2.0 + genpareto.rvs(shape, scale=0.5, size=rng.poisson(150), random_state=rng)
        found = pareto_maximum(peaks, 2.0, exposure=36000.0, duration=THREE_HOURS)
        covered += found.low <= truth <= found.high
    assert LEAST <= covered <= MOST


@pytest.mark.parametrize("shape", [-0.25, 0.0, 0.3])
def test_the_pareto_estimate_is_the_most_likely_one_and_its_interval_the_profile_s(shape):
    rng = np.random.default_rng(7)
    excess = genpareto.rvs(shape, scale=3.0, size=200, random_state=rng)
    found = pareto_maximum(100.0 + excess, 100.0, exposure=7200.0, duration=THREE_HOURS)
    c, _, scale = genpareto.fit(excess, floc=0.0)
    rate = 200 * THREE_HOURS / 7200.0
    assert found.shape == pytest.approx(c, abs=2e-3)
    assert found.value == pytest.approx(100.0 + scale * (rate**c - 1.0) / c, rel=1e-3)

    # The likelihood on a grid, with the rate as a parameter of its own.
    best = genpareto.logpdf(excess, c, scale=scale).sum() + 200 * math.log(rate) - 200.0
    for level, inside in ((found.low, 1), (found.high, -1)):
        for shift, sign in ((0.01, 1.0), (-0.01, -1.0)):
            q = level + shift * inside * (found.high - found.low) - 100.0
            shapes = np.linspace(c - 0.4, c + 0.4, 161)[:, np.newaxis]
            rates = rate * np.exp(np.linspace(-0.3, 0.3, 61))
            scales = q * shapes / (rates**shapes - 1.0)
            pdf = genpareto.logpdf(excess[:, None, None], shapes, scale=scales).sum(axis=0)
            # The counted exceedances are Poisson, 7200 s of exposure.
            grid = pdf + 200 * np.log(rates) - rates * 7200.0 / THREE_HOURS
            deviance = 2.0 * (best - np.nanmax(grid))
            assert sign * (3.8415 - deviance) > 0.0


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
    maxima, peaks = rng.gumbel(5.0, 1.0, 30), 1.0 + rng.exponential(1.0, 100)
    one = gumbel_maximum(maxima, block=1200.0)
    other = gumbel_maximum(1e3 * maxima - 7.0, block=1200.0)
    two = pareto_maximum(peaks, 1.0, exposure=3600.0)
    another = pareto_maximum(1e3 * peaks - 7.0, 993.0, exposure=3600.0)
    for a, b in ((one, other), (two, another)):
        for name in ("value", "low", "high"):
            assert getattr(b, name) == pytest.approx(1e3 * getattr(a, name) - 7.0, rel=1e-6)


def test_more_seeds_narrow_the_interval():
    rng = np.random.default_rng(3)
    few, more = (gumbel_maximum(rng.gumbel(size=n), block=1200.0) for n in (10, 160))
    assert more.high - more.low < 0.4 * (few.high - few.low)


@given(
    values=st.lists(st.integers(0, 9), min_size=1, max_size=60),
    threshold=st.integers(0, 9),
    gap=st.integers(1, 5),
)
def test_clusters_are_those_found_by_walking_along(values, threshold, gap):
    found, quiet, top = [], gap, None
    for value in values:
        if value > threshold:
            top = value if top is None else max(top, value)
            quiet = 0
        else:
            quiet += 1
            if quiet == gap and top is not None:
                found.append(top)
                top = None
    if top is not None:
        found.append(top)
    assert cluster_maxima(values, threshold, gap).tolist() == found


def test_too_few_data_are_told():
    with pytest.raises(InputError, match=rf"at least {FEWEST_MAXIMA} block maxima, got 3; simul"):
        gumbel_maximum([1.0, 2.0, 3.0], block=1200.0)
    with pytest.raises(InputError, match=r"the 9 maxima must differ, all are 2"):
        gumbel_maximum(np.full(9, 2.0), block=1200.0)
    few = rf"at least {FEWEST_PEAKS} peaks over the threshold of 1, got 4; simulate more"
    with pytest.raises(InputError, match=few):
        pareto_maximum([2.0, 3.0, 4.0, 5.0], 1.0, exposure=3600.0)
    with pytest.raises(InputError, match=r"peaks must be above 1, got 1"):
        pareto_maximum(np.linspace(1.0, 2.0, 60), 1.0, exposure=3600.0)


@pytest.mark.parametrize("method", ["gumbel", "pareto"])
def test_over_seeds_too_few_data_are_a_status_not_a_failure(method):
    found = extreme_over_seeds(seeds(1, 3600.0), "hook.heave", method=method)
    assert isinstance(found, ExtremeEstimate)
    assert "want" in found.status
    assert math.isnan(found.value)
    assert math.isnan(found.high)
    assert not found.low <= found.rayleigh <= found.high
    assert found.rayleigh > 0.0


def test_what_was_not_gathered_is_told():
    bare = seeds(1, 600.0, block_signals=[], cycle_capacity=1)
    with pytest.raises(InputError, match=r"'hook\.heave' must have extremes of equal blocks"):
        extreme_over_seeds(bare, "hook.heave")
    with pytest.raises(InputError, match=r"the cycles of 'hook\.heave' were not kept in every"):
        extreme_over_seeds(bare, "hook.heave", method="pareto")
    with pytest.raises(InputError, match=r"no signal 'heave'; did you mean 'hook\.heave'"):
        extreme_over_seeds(bare, "heave")
    with pytest.raises(InputError, match=r"at least one run is wanted, got none"):
        extreme_over_seeds([], "hook.heave")
