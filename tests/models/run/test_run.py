"""A run, and several runs of one question: access, intervals, standard errors."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import beta, chi2, expon, t
from standard_error import spectral_standard_error, standard_error_of_variance

from models import load_case
from models.basics import InputError, fall_time, mean_interval, share
from models.hook import HookMotion
from models.run import Accumulator, Event, Run, Summary, Timings
from models.sea import SeaSpectrum
from models.vessel import HeaveRao

SIGNALS = ("hook.heave", "payload.displacement", "rope.minimum_tension", "rope.tension")
UNITS = {"hook.heave": "m", "payload.displacement": "m", "rope.tension": "N"}


def run(seed: int = 1, *, payload: float = 0.1, fall: float | None = None, **changes) -> Run:
    """A made-up run: sines with noise; `fall` is when the payload is thrown off."""
    step, n = 0.1, 6001
    rng = np.random.default_rng(seed)
    time = step * np.arange(n)
    values = np.column_stack(
        (
            np.sin(0.7 * time) + 0.1 * rng.standard_normal(n),
            payload * np.sin(0.7 * time + 0.4) + 0.01 * rng.standard_normal(n),
            1e4 * (1.2 - np.abs(np.sin(0.7 * time))),
            1e5 + 1e4 * np.sin(0.7 * time),
        )
    )
    if fall is not None:
        values[time >= fall, 1] += 5.0
        values[time >= fall, 2] = 0.0
    gather = Accumulator(SIGNALS, step, units=UNITS, lock_limit=1.0)
    gather.update(values)
    given = {
        "case": case(),
        "controller": "linear",
        "scenario": "hold",
        "seed": seed,
        "sample_time": step,
        "step": 0.01,
        "duration": 600.0,
        "compiled": True,
        "signals": SIGNALS,
        "units": UNITS,
        "time": time[::5],
        "values": values[::5],
        "statistics": gather.result(),
        "timings": Timings.of(wall_seconds=0.5, steps=60_000, duration=600.0),
    }
    return Run(**(given | changes))


@functools.cache
def case():
    return load_case("thesis-1975")


def test_a_signal_is_found_by_its_name():
    r = run()
    np.testing.assert_array_equal(r["payload.displacement"], r.values[:, 1])
    assert "hook.heave" in r
    assert "hook" not in r
    assert r.units["rope.minimum_tension"] == ""
    with pytest.raises(
        InputError, match=r"run: no signal 'payload\.displacment'; did you mean 'payload\.disp"
    ):
        r["payload.displacment"]
    with pytest.raises(InputError, match=r"run: no signal 'x'; known here: hook\.heave, "):
        r["x"]


def test_a_run_cannot_be_changed_and_copies_nothing():
    values, time = np.zeros((3, 4)), np.arange(3.0)
    r = run(values=values, time=time)
    assert np.shares_memory(r.values, values)
    for array in (r.values, r.time, r["hook.heave"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    values[0, 0] = 1.0  # the caller's own array is still the caller's
    with pytest.raises(TypeError):
        r.units["hook.heave"] = "ft"
    with pytest.raises(TypeError):
        r.timings.fallbacks["late"] = 1


def test_a_run_prints_as_a_tree_with_what_happened():
    events = [Event(time=float(k), kind="slack", text=f"slack {k}") for k in range(9)]
    text = str(run(events=events, status="diverged", message="the payload left at 8 s"))
    lines = text.splitlines()
    assert lines[0] == (
        "Run of thesis-1975, linear, hold, seed 1: diverged (the payload left at 8 s)"
    )
    assert lines[1] == "├ 4 signals, 1201 times to 600 of 600 s"
    assert lines[2] == "├ step 10 ms, sample 100 ms, compiled, 1200 times real time"
    assert lines[3].startswith("├ payload 71.")
    assert "├ 0 s: slack 0" in lines
    assert lines[-1] == "└ and 3 more events"
    assert str(run()).splitlines()[-1].startswith("└ payload")


def test_a_run_that_did_not_complete_says_so():
    assert run().completed
    assert not run(status="interrupted").completed
    empty = run(time=np.zeros(0), values=np.zeros((0, 4)), status="diverged")
    assert "0 times to 0 of 600 s" in str(empty)


def test_timings_sum_up_the_controller_s_steps():
    seconds = np.linspace(1e-6, 1e-4, 101)
    timings = Timings.of(
        wall_seconds=2.0,
        steps=1000,
        duration=50.0,
        controller_seconds=seconds,
        fallbacks={"late": 2},
    )
    assert timings.real_time_factor == 25.0
    assert timings.controller_median == pytest.approx(np.median(seconds))
    assert timings.controller_p99 == pytest.approx(np.percentile(seconds, 99))
    assert timings.controller_max == 1e-4
    assert timings.fallbacks == {"late": 2}
    none = Timings.of(wall_seconds=0.0, steps=0, duration=0.0)
    assert math.isnan(none.controller_max)
    assert math.isfinite(none.real_time_factor)


def test_means_over_seeds_have_student_s_interval():
    runs = [run(seed, payload=0.1 + 0.01 * seed) for seed in range(5)]
    found = Summary.of(runs)
    each = np.array([r.statistics.value("payload rms") for r in runs])
    low, high = t.interval(0.95, 4, each.mean(), each.std(ddof=1) / math.sqrt(5))
    rms = found["payload rms"]
    assert (rms.mean, rms.low, rms.high) == pytest.approx((each.mean(), low, high), rel=1e-12)
    assert (rms.count, rms.unit) == (5, "m")
    by_statistics = Summary.of([r.statistics for r in runs])
    assert by_statistics["payload rms"] == rms
    assert "not completed" not in by_statistics.shares
    rows = {row[0]: row for row in found.table()}
    assert rows["payload rms"] == ("payload rms", rms.mean, rms.low, rms.high, "m")
    assert "lost lock at" not in rows  # nobody did
    with pytest.raises(InputError, match=r"no quantity 'payload mrs'; did you mean 'payload rms'"):
        found["payload mrs"]


def test_the_residual_is_against_the_hook_and_against_the_uncompensated_run():
    after, before = [run(s, payload=0.1) for s in (1, 2)], [run(s, payload=1.5) for s in (1, 2)]
    found = Summary.of(after, held=before)
    deviation = [[r[name].std() for r in after] for name in ("payload.displacement", "hook.heave")]
    ratio = np.divide(*deviation).mean()
    assert found["residual"].mean == pytest.approx(100.0 * ratio, rel=2e-3)
    assert found["attenuation"].mean == pytest.approx(-20.0 * math.log10(ratio), rel=2e-3)
    against = [
        a.statistics.value("payload rms") / b.statistics.value("payload rms")
        for a, b in zip(after, before, strict=True)
    ]
    assert found["residual held"].mean == pytest.approx(100.0 * np.mean(against))
    assert found["attenuation held"].mean == pytest.approx(np.mean(-20.0 * np.log10(against)))


def test_mishaps_have_shares_and_falls_a_rate():
    falls = [100.0, 250.0, None, None, None]
    runs = [run(k, fall=fall) for k, fall in enumerate(falls)]
    found = Summary.of([*runs, run(9, status="interrupted")])
    assert (found.shares["lost lock"].count, found.shares["lost lock"].total) == (2, 6)
    assert found.shares["slack"].count == 2
    assert found.shares["not completed"].count == 1
    assert "touched" not in found.shares  # there is nothing to touch
    exposure = 100.0 + 250.0 + 4 * 600.1
    assert found.fall_time.exposure == pytest.approx(exposure)
    assert found.fall_time.rate == pytest.approx(2.0 / exposure)
    rows = {row[0]: row for row in found.table()}
    assert rows["share of runs: lost lock"][1] == pytest.approx(100.0 / 3.0)
    assert rows["mean time to loss of lock"][1] == pytest.approx(exposure / 2.0)


def test_a_single_run_has_no_interval():
    found = Summary.of([run()])["payload rms"]
    assert found.count == 1
    assert math.isnan(found.low)
    assert math.isnan(mean_interval([]).mean)
    assert mean_interval([1.0, math.nan, 3.0]).count == 2
    assert math.isnan(mean_interval([1.0, math.inf]).high)


def test_what_cannot_be_summed_up_is_refused():
    with pytest.raises(InputError, match=r"at least one run is wanted, got none"):
        Summary.of([])
    with pytest.raises(InputError, match=r"as many with the drum held as runs, 2, got 1"):
        Summary.of([run(1), run(2)], held=[run(1)])
    with pytest.raises(InputError, match=r"times must be at least 0 s"):
        fall_time([], [])
    with pytest.raises(InputError, match=r"times must be at least 0 s"):
        fall_time([1.0, -1.0], [True, True])
    with pytest.raises(InputError, match=r"share: count must be in \[0, 3\], got 4"):
        share(4, 3)


@pytest.mark.parametrize(("count", "total"), [(0, 10), (2, 10), (6, 10), (10, 10)])
def test_shares_have_the_interval_of_clopper_and_pearson(count, total):
    found = share(count, total)
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    assert (found.low, found.high) == pytest.approx((low, high), rel=1e-10)
    assert found.value == count / total


def test_the_rate_of_falls_has_the_chi_square_interval():
    found = fall_time([300.0, 1200.0, 900.0, 1200.0], [True, False, True, False])
    assert found.rate_low == pytest.approx(chi2.ppf(0.025, 4) / (2 * 3600.0))
    assert found.rate_high == pytest.approx(chi2.ppf(0.975, 6) / (2 * 3600.0))
    assert found.mean[0] == pytest.approx(1800.0)
    assert found.mean[1] == pytest.approx(1.0 / found.rate_high)


def test_no_fall_bounds_the_rate_from_above():
    none = fall_time([1200.0] * 10, [False] * 10)
    assert (none.rate, none.rate_low) == (0.0, 0.0)
    assert none.rate_high == pytest.approx(-math.log(0.025) / 12000.0)
    assert none.mean[0] == math.inf
    at_once = fall_time([0.0], [True])
    assert at_once.rate == math.inf


def test_the_interval_of_the_rate_covers_the_truth():
    rng, rate, covered = np.random.default_rng(5), 1.0 / 900.0, 0
    for _ in range(400):
        times = expon.rvs(scale=1.0 / rate, size=10, random_state=rng)
        found = fall_time(np.minimum(times, 1200.0), times < 1200.0)
        covered += found.rate_low <= rate <= found.rate_high
    # Conservative with counted falls: 95 % or more, of 400 within three standard errors.
    assert covered >= 400 * (0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 400))


def resonance(radius: float, angle: float, n: int):
    """An autoregressive filter of order two, and the exact standard error over n samples."""
    b, a = [1.0], [1.0, -2.0 * radius * math.cos(angle), radius**2]
    impulse = lfilter(b, a, np.r_[1.0, np.zeros(2**17 - 1)])
    covariance = np.fft.irfft(np.abs(np.fft.rfft(impulse, 2**18)) ** 2)[:n]
    terms = (1.0 - np.arange(n) / n) * covariance**2
    return b, a, math.sqrt(2.0 / n * (2.0 * terms.sum() - terms[0]))


@pytest.mark.parametrize(
    ("radius", "angle", "n"),
    [(0.99, 0.3, 20_000), (0.95, 1.0, 20_000), (0.98, 0.0, 20_000), (0.97, 0.3, 2_000)],
)
def test_the_standard_error_is_that_of_many_records(radius, angle, n):
    count = 3_000_000 // n
    b, a, exact = resonance(radius, angle, n)
    rng = np.random.default_rng(8)
    records = lfilter(b, a, rng.standard_normal((count, n + 3000)))[:, 3000:]
    found = np.array([standard_error_of_variance(x) for x in records])
    # By the formula on the exact autocovariance, within three standard errors of the mean and the
    # 1 % that the end of the sum may cost; and by the scatter of the variances themselves.
    rms = math.sqrt((found**2).mean())
    assert rms == pytest.approx(exact, rel=0.01 + 3.0 * found.std() / exact / math.sqrt(count))
    scatter = records.var(axis=1).std(ddof=1)
    assert scatter == pytest.approx(exact, rel=3.0 / math.sqrt(2.0 * count))


def test_the_standard_error_of_a_sea_is_that_of_its_spectrum():
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=10.0, gamma=2.0)
    rao = HeaveRao(omega=[0.3, 1.2], amplitude=[1.0, 1.0], beyond="zero", below="zero")
    motion = HookMotion(sea=sea, rao=rao)
    heave = [motion.record(10800.0, step=0.25, seed=s).displacement for s in range(12)]
    found = np.array([standard_error_of_variance(x) for x in heave])
    exact = spectral_standard_error(motion.quadrature, motion.density, 10800.0)
    at_nodes = motion.density(motion.quadrature.omega)
    assert spectral_standard_error(motion.quadrature, at_nodes, 10800.0) == exact
    rms = math.sqrt((found**2).mean())
    assert rms == pytest.approx(exact, rel=0.01 + 3.0 * found.std() / exact / math.sqrt(12))
    # And the simulated variance is the spectral one within three of them.
    variance = np.mean([x.var() for x in heave])
    assert abs(variance - motion.displacement.m0) < 3.0 * rms / math.sqrt(12)


def test_the_standard_error_refuses_what_it_cannot_tell():
    with pytest.raises(InputError, match=r"100 samples or more, got \(50,\)"):
        standard_error_of_variance(np.ones(50))
    with pytest.raises(InputError, match=r"too short against its correlation time"):
        standard_error_of_variance(np.sin(0.01 * np.arange(2000)))
    with pytest.raises(InputError, match=r"record must be finite numbers, got nan at index 3"):
        standard_error_of_variance(np.where(np.arange(200) == 3, math.nan, 1.0))
    assert standard_error_of_variance(np.ones(200)) == 0.0
