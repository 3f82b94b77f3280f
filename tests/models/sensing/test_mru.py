"""The motion reference unit: high-pass, error, delay, against analysis and by statistics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from models.rig import MRU
from models.sensing import MruModel, error_density, unit_response

TS = 0.05
QUIET = MRU(heave_filter_period=30.0, noise_floor=0.0, noise_fraction=0.0)
# exp(-w t/sqrt(2)) of its filter has fallen to 1 %: 31.1 s
SETTLED = math.log(100.0) * math.sqrt(2.0) * 30.0 / (2.0 * math.pi)
NOISY = MRU(heave_filter_period=30.0, noise_floor=0.05, noise_bandwidth=1.0, delay=0.12)


def model(mru, **kwargs):
    return MruModel(mru, **({"sample_time": TS, "heave_rms": 0.5, "seed": 0} | kwargs))


def run(unit, displacement, velocity):
    return unit.block(unit.initial(displacement[0], velocity[0]), displacement, velocity)[0]


def sine(omega, n, step=TS, phase=0.4):
    t = step * np.arange(n)
    return t, np.cos(omega * t + phase), -omega * np.sin(omega * t + phase)


def phasor(t, values, omega):
    """Complex amplitude of a sine in a series, by least squares."""
    fit = np.column_stack((np.cos(omega * t), -np.sin(omega * t)))
    (re_part, im_part), *_ = np.linalg.lstsq(fit, values, rcond=None)
    return complex(re_part, im_part)


def error_of(unit, n):
    """The error alone: what a unit shows of a hook that does not move."""
    still = np.zeros(n)
    block = run(unit, still, still)
    return block.heave, block.heave_rate


class TestPerfect:
    def test_without_a_unit_the_motion_is_shown_as_it_is(self):
        unit = model(None)
        _, z, v = sine(0.7, 50)
        block = run(unit, z, v)
        assert np.array_equal(block.heave, z)
        assert np.array_equal(block.heave_rate, v)
        assert np.array_equal(block.valid, np.ones(50))
        assert unit.error_rms == unit.delay == 0.0
        assert np.array_equal(unit_response(None, [0.0, 3.0j]), [1.0, 1.0])
        assert not unit.noise_density([0.5, 1.0]).any()

    def test_a_unit_can_be_perfect_but_for_its_delay(self):
        unit = model(MRU(noise_floor=0.0, noise_fraction=0.0, delay=0.15))
        _, z, v = sine(0.7, 50)
        block = run(unit, z, v)
        assert np.array_equal(block.heave[3:], z[:-3])
        assert np.array_equal(block.heave_rate[3:], v[:-3])


class TestFilter:
    @pytest.mark.parametrize("omega", [0.1, 0.21, 0.6, 1.5])
    def test_a_sine_meets_the_transfer(self, omega):
        unit = model(replace_delay(QUIET, 0.2))
        n = 8000
        t, z, v = sine(omega, n)
        block = run(unit, z, v)
        late = t > 4.0 * (SETTLED + unit.delay)
        true = phasor(t, z, omega)
        expected = complex(unit_response(unit.mru, 1j * omega))
        heave = phasor(t[late], block.heave[late], omega) / true
        rate = phasor(t[late], block.heave_rate[late], omega) / (1j * omega * true)
        # Exact but for the cubic between samples, (omega Ts)^4/384 of the motion.
        assert abs(heave - expected) < 2e-7
        assert abs(rate - expected) < 2e-7

    def test_slow_heave_is_ahead_as_a_butterworth_filter_makes_it(self):
        unit = model(QUIET)
        omega = np.array([0.05, 0.2, 0.4, 0.8])
        b, a = scipy.signal.butter(2, 2 * math.pi / 30.0, "high", analog=True)
        _, expected = scipy.signal.freqs(b, a, omega)
        np.testing.assert_allclose(unit_response(unit.mru, 1j * omega), expected, rtol=1e-12)
        # arctan(sqrt(2) r/(1 - r^2)) with r = corner/omega, at 0.4 rad/s some 52 degrees.
        r = 2 * math.pi / 30.0 / 0.4
        lead = math.atan2(math.sqrt(2.0) * r, 1.0 - r**2)
        t, z, v = sine(0.4, 6000)
        block = run(unit, z, v)
        late = t > 150.0
        got = np.angle(phasor(t[late], block.heave[late], 0.4) / phasor(t, z, 0.4))
        assert got == pytest.approx(lead, abs=1e-6)
        assert 40.0 < math.degrees(lead) < 60.0

    def test_agrees_with_an_ode_solver(self):
        w = 2 * math.pi / 30.0

        def z(t):
            return 0.4 * np.sin(0.5 * t) + 0.2 * np.sin(1.3 * t + 1.0) + 0.1

        def v(t):
            return 0.2 * np.cos(0.5 * t) + 0.26 * np.cos(1.3 * t + 1.0)

        t = TS * np.arange(1200)
        solution = scipy.integrate.solve_ivp(
            lambda t, q: [q[1], z(t) - math.sqrt(2) * w * q[1] - w**2 * q[0]],
            (0.0, t[-1]),
            [0.0, 0.0],
            t_eval=t,
            rtol=1e-10,
            atol=1e-12,
        )
        q, rate = solution.y
        heave = z(t) - math.sqrt(2) * w * rate - w**2 * q
        block = run(model(QUIET), z(t), v(t))
        np.testing.assert_allclose(block.heave, heave, atol=2e-8)
        np.testing.assert_allclose(
            block.heave_rate, v(t) - math.sqrt(2) * w * heave - w**2 * rate, atol=2e-8
        )

    def test_rate_is_the_derivative_of_heave(self):
        unit = model(NOISY, sample_time=0.002, heave_frequency=0.7)
        _, z, v = sine(0.7, 20_000, 0.002)
        block = run(unit, z, v)
        slope = (block.heave[2:] - block.heave[:-2]) / 0.004
        # The error's second derivative is white noise: differences are rough by sqrt(step).
        rough = math.sqrt(2.0 * math.sqrt(2.0) * 0.05**2 * 0.002)
        assert np.abs(slope - block.heave_rate[1:-1]).max() < 5.0 * rough

    def test_a_known_frequency_leaves_no_transient(self):
        omega = 0.6
        unit = model(replace_delay(QUIET, 0.73), heave_frequency=omega)
        t, z, v = sine(omega, 2000)
        block = run(unit, z, v)
        amplitude = complex(unit_response(unit.mru, 1j * omega)) * np.exp(0.4j)
        # 0.73 s is 14.6 samples: (1 - 0.6) 0.6 (omega Ts)^2/2 is lost to interpolation.
        tolerance = 0.12 * (omega * TS) ** 2 + 1e-7
        np.testing.assert_allclose(
            block.heave, (amplitude * np.exp(1j * omega * t)).real, atol=tolerance
        )
        np.testing.assert_allclose(
            block.heave_rate,
            (1j * omega * amplitude * np.exp(1j * omega * t)).real,
            atol=tolerance,
        )

    def test_otherwise_a_hundredth_is_left_after_the_settling_time(self):
        unit = model(QUIET)
        t, z, v = sine(0.6, 2000)
        transient = run(unit, z, v).heave - run(replace(unit, heave_frequency=0.6), z, v).heave
        after = np.abs(transient[t > SETTLED]).max()
        # The envelope falls to 1 %; the ripple below it may gain sqrt(2).
        assert 0.0 < after < 0.01 * math.sqrt(2.0) * np.abs(transient).max()
        assert np.abs(transient).max() > 0.1


class TestError:
    def test_is_the_larger_of_floor_and_fraction(self):
        mru = MRU(noise_floor=0.05, noise_fraction=0.05)
        assert model(mru, heave_rms=0.5).error_rms == 0.05
        assert model(mru, heave_rms=3.0).error_rms == pytest.approx(0.15)

    def test_density_integrates_to_the_variance(self):
        unit = model(NOISY)
        variance, _ = scipy.integrate.quad(unit.noise_density, 0.0, math.inf)
        assert variance == pytest.approx(0.05**2, rel=1e-8)
        b, a = scipy.signal.butter(2, 1.0, analog=True)
        omega = np.array([0.1, 1.0, 5.0])
        shape = np.abs(scipy.signal.freqs(b, a, omega)[1]) ** 2
        density = unit.noise_density(omega)
        np.testing.assert_allclose(density / unit.noise_density(0.0), shape, rtol=1e-9)

    @pytest.mark.parametrize(("width", "step"), [(1.0, 0.05), (4.0, 0.5), (0.2, 0.05)])
    def test_has_its_rms_and_its_rate(self, width, step):
        mru = MRU(noise_floor=0.05, noise_bandwidth=width)
        n = 400_000
        heave, rate = error_of(model(mru, sample_time=step, seed=4), n)
        s = 0.05
        for series, variance in ((heave, s**2), (rate, (width * s) ** 2)):
            spread = variance_spread(series, variance)
            assert abs(np.mean(series**2) - variance) < 3.0 * spread
        # A stationary process is not correlated with its own derivative at the same time.
        both = np.mean(heave * rate) / (width * s**2)
        assert abs(both) < 3.0 * variance_spread(heave, s**2) / s**2

    def test_is_stationary_from_the_first_sample(self):
        first = np.array(
            [[series[0] for series in error_of(model(NOISY, seed=seed), 1)] for seed in range(400)]
        )
        for values, rms in zip(first.T, (0.05, 0.05), strict=True):
            ratio = np.mean(values**2) / rms**2
            assert abs(ratio - 1.0) < 3.0 * math.sqrt(2.0 / 400)

    def test_has_its_spectrum(self):
        unit = model(MRU(noise_floor=0.05, noise_bandwidth=1.0), seed=8)
        heave, rate = error_of(unit, 1024 * 400)
        omega, mean = averaged_periodogram(heave, 1024)
        _, of_rate = averaged_periodogram(rate, 1024)
        use = (omega > 0.2) & (omega < 4.0)
        assert use.sum() > 25
        for got, power in ((mean, 0), (of_rate, 2)):
            ratio = got[use] / (unit.noise_density(omega[use]) * omega[use] ** power)
            # Each ratio is a mean of 400 exponential numbers.
            assert abs(ratio.mean() - 1.0) < 3.0 / math.sqrt(400 * use.sum())
            assert np.abs(ratio - 1.0).max() < 4.5 / math.sqrt(400)

    def test_seeds(self):
        first, again, other = (error_of(model(NOISY, seed=s), 100)[0] for s in (1, 1, 2))
        assert np.array_equal(first, again)
        assert not np.array_equal(first, other)


def test_response_to_random_motion_meets_transfer_and_noise():
    # Motion of random harmonics, in segments of one period: no leakage, so that the cross spectrum
    # over a segment is the transfer plus the error's own harmonics.
    unit = model(replace_delay(NOISY, 0.2), seed=3)
    size, segments = 1024, 120
    period = size * TS
    lines = np.arange(3, 60)
    omega = 2 * math.pi * lines / period
    rng = np.random.default_rng(5)
    wave = (rng.standard_normal(len(lines)) + 1j * rng.standard_normal(len(lines))) * 0.1
    half = np.zeros((2, size // 2 + 1), dtype=complex)
    half[0, lines], half[1, lines] = wave, 1j * omega * wave
    z, v = np.fft.irfft(half * size / 2, size)
    whole = run(unit, np.tile(z, segments + 4), np.tile(v, segments + 4))
    late = slice(4 * size, None)  # over 200 s: the transient is gone
    for series, power in ((whole.heave[late], 0), (whole.heave_rate[late], 1)):
        lines_of = np.fft.rfft(series.reshape(segments, size), axis=1)[:, lines] * 2 / size
        got = (lines_of / (wave * (1j * omega) ** power)).mean(axis=0)
        density = unit.noise_density(omega) * omega ** (2 * power)
        # A density S gives harmonics with |amplitude|^2 of 2 S d omega on average.
        noise = 2.0 * density * 2 * math.pi / period
        variance = noise / (np.abs(wave) ** 2 * omega ** (2 * power)) / segments
        off = np.abs(got - unit_response(unit.mru, 1j * omega)) ** 2 / variance
        assert off.max() < 10.0  # exponential: 1 in 22 000 each
        assert abs(off.mean() - 1.0) < 3.0 / math.sqrt(len(lines))


class TestChunks:
    @settings(max_examples=40)
    @given(
        st.lists(st.integers(1, 200), min_size=1, max_size=8),
        st.sampled_from([0.0, 0.04, 0.05, 0.33, 2.0]),
        st.booleans(),
    )
    def test_do_not_matter(self, counts, delay, gap):
        outages = [(1.0, 3.0), (7.0, 7.1)] if gap else []
        unit = model(replace_delay(NOISY, delay), outages=outages, heave_frequency=0.6)
        _, z, v = sine(0.7, sum(counts))
        whole = run(unit, z, v)
        state, at = unit.initial(z[0], v[0]), 0
        for count in counts:
            cut = slice(at, at + count)
            block, state = unit.block(state, z[cut], v[cut])
            at += count
            assert state.sample == at
            for name in ("heave", "heave_rate", "valid"):
                got, wanted = getattr(block, name), getattr(whole, name)[cut]
                np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-14)

    def test_a_state_can_be_used_twice(self):
        unit = model(NOISY)
        _, z, v = sine(0.7, 300)
        _, state = unit.block(unit.initial(z[0], v[0]), z[:100], v[:100])
        first, again = (unit.block(state, z[100:], v[100:])[0] for _ in range(2))
        assert np.array_equal(first.heave, again.heave)


def test_delay_between_samples_is_exact_on_average():
    unit = model(MRU(noise_floor=0.0, noise_fraction=0.0, delay=0.12))  # 2.4 samples
    line = 3.0 + 0.5 * TS * np.arange(100)
    block = run(unit, line, np.full(100, 0.5))
    np.testing.assert_allclose(block.heave[3:], line[3:] - 0.5 * 0.12, rtol=1e-13)
    assert block.heave[0] == 3.0


def test_outage_holds_the_last_values():
    unit = model(NOISY, outages=[(0.0, 0.2), (1.0, 2.0)])
    _, z, v = sine(0.7, 100)
    block = run(unit, z, v)
    free = run(replace(unit, outages=()), z, v)
    gone = np.flatnonzero(block.valid == 0.0)
    assert gone.tolist() == [*range(4), *range(20, 40)]
    assert np.array_equal(block.heave[:4], np.zeros(4))
    assert np.array_equal(block.heave[20:40], np.full(20, free.heave[19]))
    assert np.array_equal(block.heave_rate[20:40], np.full(20, free.heave_rate[19]))
    assert np.array_equal(block.heave[40:], free.heave[40:])


def replace_delay(mru, delay):
    return MRU(**(dict(mru) | {"delay": delay}))


def averaged_periodogram(series, size):
    """One-sided variance density [per rad/s] with a Hann window, on average over segments."""
    window = np.sin(np.pi * np.arange(size) / size) ** 2
    segments = series.reshape(-1, size) * window
    power = np.abs(np.fft.rfft(segments, axis=1)) ** 2
    omega = 2 * math.pi * np.fft.rfftfreq(size, TS)
    return omega, power.mean(axis=0) * TS / (math.pi * np.sum(window**2))


def variance_spread(series, variance):
    """Standard error of the mean square of a Gaussian series, from its own correlation."""
    n = len(series)
    spectrum = np.abs(np.fft.rfft(series, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[: n // 100] / n / variance
    return variance * math.sqrt(2.0 / n * (1.0 + 2.0 * np.sum(correlation[1:] ** 2)))


STATED = MRU(
    heave_filter_period=30.0,
    gain_error=0.03,
    phase_error=0.04,
    drift=0.06,
    drift_period=40.0,
    noise=0.002,
    bandwidth=20.0,
    delay=0.1,
)


def heard_sine(unit, omega, n):
    """Time, what the unit hears of a sine that goes on for ever, and the sine."""
    reads = []

    def read(start, count):
        reads.append(count)
        t = TS * np.arange(start, start + count)
        return np.cos(omega * t + 0.4), -omega * np.sin(omega * t + 0.4)

    t = TS * np.arange(n)
    return t, unit.heard(read, 0, n), read(0, n)


class TestStatedError:
    @pytest.mark.parametrize("omega", [0.3, 0.6, 1.5, 4.0])
    @pytest.mark.parametrize("seed", range(4))
    def test_gain_and_phase_are_those_of_the_run(self, omega, seed):
        unit = model(STATED, seed=seed)
        t, heard, true = heard_sine(unit, omega, 4000)
        gain, phase = unit.signs
        expected = 1.0 + gain * 0.03 + 1j * phase * 0.04
        for one, other in zip(heard, true, strict=True):
            ratio = phasor(t, one, omega) / phasor(t, other, omega)
            assert abs(ratio - expected) < 1e-4

    def test_signs_are_as_often_the_one_as_the_other_and_independent(self):
        signs = np.array([model(STATED, seed=seed).signs for seed in range(400)])
        assert set(signs.ravel()) == {-1.0, 1.0}
        for values in (*signs.T, signs.prod(axis=1)):
            assert abs(values.mean()) < 3.0 / math.sqrt(400)

    def test_what_is_heard_does_not_hang_on_the_chunks(self):
        unit = model(STATED)

        def read(start, count):
            t = TS * np.arange(start, start + count)
            return np.where(t < 0.0, 0.0, np.cos(0.6 * t)), np.where(t < 0.0, 0.0, np.sin(t))

        whole = np.stack(unit.heard(read, 0, 900))
        parts = [np.stack(unit.heard(read, k, 300)) for k in (0, 300, 600)]
        np.testing.assert_allclose(np.hstack(parts), whole, atol=1e-12)

    def test_a_unit_without_gain_and_phase_error_hears_the_motion(self):
        z = np.array([1.0, 2.0])
        heard = model(NOISY).heard(lambda start, count: (z, 2.0 * z), 0, 2)
        assert [*map(list, heard)] == [[1.0, 2.0], [2.0, 4.0]]

    def test_drift_and_noise_have_their_spectra(self):
        unit = model(STATED, seed=8)
        heave, rate = error_of(unit, 4096 * 400)
        omega, mean = averaged_periodogram(heave, 4096)
        _, of_rate = averaged_periodogram(rate, 4096)
        density = unit.noise_density(omega)
        for low, high, got, expected in (
            (0.08, 0.4, mean, density),
            (2.0, 15.0, mean, density),
            # The rate is the mean over a sample, a difference.
            (2.0, 15.0, of_rate, density * (2.0 / TS * np.sin(0.5 * omega * TS)) ** 2),
        ):
            use = (omega > low) & (omega < high)
            ratio = got[use] / expected[use]
            assert abs(ratio.mean() - 1.0) < 3.0 / math.sqrt(400 * use.sum()) + 0.02

    def test_density_integrates_to_drift_noise_and_share(self):
        omega = np.geomspace(1e-5, 1e4, 400_001)
        heave = np.where((omega > 0.5) & (omega < 0.7), 1.0, 0.0)

        def variance(**stated):
            unit = MRU(heave_filter_period=100.0, **stated)
            return np.trapezoid(error_density(unit, omega, heave, 0.4), omega)

        assert variance(drift=0.06, drift_period=40.0) == pytest.approx(0.06**2, rel=1e-3)
        # White noise of N behind a Butterworth low-pass of the second order with w: N^2 w/(4 2^.5).
        assert variance(noise=0.002, bandwidth=30.0) == pytest.approx(
            0.002**2 * 30.0 / (4.0 * math.sqrt(2.0)), rel=1e-3
        )
        passed = np.abs(unit_response(MRU(heave_filter_period=100.0), 1j * omega)) ** 2
        of_heave = np.trapezoid(passed * heave, omega)
        assert variance(gain_error=0.03) == pytest.approx(0.03**2 * of_heave, rel=1e-9)
        both = variance(gain_error=0.03, phase_error=0.04)
        assert both == pytest.approx(0.05**2 * of_heave, rel=1e-9)

    def test_noise_at_low_frequency_is_that_of_the_data_sheet(self):
        # A one-sided density per rad/s is 1/(2 pi) of that per hertz.
        unit = model(MRU(noise=0.002))
        assert unit.noise_density(0.1) == pytest.approx(0.002**2 / (2.0 * math.pi), rel=1e-6)

    @settings(max_examples=20)
    @given(st.lists(st.integers(1, 200), min_size=1, max_size=6))
    def test_chunks_do_not_matter(self, counts):
        unit = model(STATED, heave_frequency=0.6)
        _, z, v = sine(0.7, sum(counts))
        whole = run(unit, z, v)
        state, parts, start = unit.initial(z[0], v[0]), [], 0
        for count in counts:
            block, state = unit.block(state, z[start : start + count], v[start : start + count])
            parts.append((block.heave, block.heave_rate))
            start += count
        np.testing.assert_allclose(np.hstack(parts), [whole.heave, whole.heave_rate], atol=1e-12)
