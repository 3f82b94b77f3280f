"""Hook motion: spectra, statistics and records agree with each other and with the thesis."""

from __future__ import annotations

import math

import numpy as np
import pytest
from former_cases import load_case

from models.basics import (
    InputError,
    PhysicsWarning,
    peak_factor,
    spectral_nodes,
    zero_crossing_period,
)
from models.hook import HookMotion
from models.sea import SeaSpectrum
from models.vessel import HeaveRao

# 1975 thesis, Table 5: omega [rad/s], A_R [m/m], S [m^2 s] and R_H [m^2 s] (wave height).
TABLE_5 = np.array(
    [
        (0.34, 0.985, 0, 0),
        (0.43, 1.05, 0.006, 0.0066),
        (0.47, 1.1, 0.125, 0.15),
        (0.52, 1.17, 0.655, 0.9),
        (0.56, 1.20, 1.91, 2.75),
        (0.60, 1.23, 3.34, 5.05),
        (0.65, 1.29, 4.77, 7.92),
        (0.69, 1.29, 5.44, 9.05),
        (0.73, 1.23, 5.74, 8.68),
        (0.78, 1.15, 5.58, 7.37),
        (0.86, 1.0, 4.71, 4.71),
        (0.94, 0.85, 3.61, 2.61),
        (1.03, 0.75, 2.69, 1.51),
        (1.12, 0.60, 1.98, 0.713),
        (1.21, 0.50, 1.44, 0.36),
        (1.29, 0.40, 1.06, 0.17),
        (1.38, 0.35, 0.80, 0.1),
        (1.46, 0.32, 0.6, 0.06),
    ]
)


def thesis_motion(height: float = 2.4384, **choices: str) -> HookMotion:
    sea = SeaSpectrum(kind="bretschneider-1975", significant_height=height, significant_period=8.1)
    rao = HeaveRao(omega=TABLE_5[:, 0], amplitude=TABLE_5[:, 1], **{"beyond": "hold", **choices})
    return HookMotion(sea=sea, rao=rao)


def test_table_5_heave_response():
    omega, operator, spectrum, response = TABLE_5.T
    motion = thesis_motion()
    # The table's own arithmetic, R_H = A_R^2 S, to its printed digits ...
    np.testing.assert_allclose(operator**2 * spectrum, response, rtol=0.004, atol=0.002)
    # ... and ours, where the spectrum is not so steep that a rounded omega spoils it.
    ours = 8.0 * motion.density(omega)
    np.testing.assert_allclose(ours[5:15], response[5:15], rtol=0.05)
    np.testing.assert_array_equal(ours, 8.0 * operator**2 * motion.sea(omega))


def test_heave_of_the_thesis_design_sea():
    # By hand: the table's R_H is of wave height, so an eighth of its area is the variance.
    by_table = math.sqrt(np.trapezoid(TABLE_5[:, 3], TABLE_5[:, 0]) / 8.0)
    motion = thesis_motion()
    assert motion.displacement.rms == pytest.approx(by_table, rel=0.01)
    assert motion.displacement.rms == pytest.approx(0.594, abs=5e-4)
    assert thesis_motion(2.43).displacement.rms == pytest.approx(0.592, abs=5e-4)
    # Nearly nothing of the displacement is extrapolated, most of the acceleration is.
    displacement, velocity, acceleration = (
        motion.rao.share_outside(motion.sea, derivative=n) for n in range(3)
    )
    assert displacement.below < 1e-9
    assert displacement.beyond == pytest.approx(0.0084, abs=1e-4)
    assert velocity.beyond == pytest.approx(0.0559, abs=1e-4)
    assert acceleration.beyond == pytest.approx(0.568, abs=1e-3)
    motion.warn_if_outside()  # warnings are errors here


def test_shares_against_the_choice_zero():
    held, cut = thesis_motion(), thesis_motion(below="zero", beyond="zero")
    for n, name in enumerate(("displacement", "velocity", "acceleration")):
        share = held.rao.share_outside(held.sea, derivative=n).total
        there = cut.rao.share_outside(cut.sea, derivative=n).total
        assert there == pytest.approx(share, rel=1e-6)
        m0 = getattr(held, name).m0
        assert getattr(cut, name).m0 == pytest.approx(m0 * (1.0 - share), rel=1e-6)


def test_velocity_and_acceleration_follow_from_the_displacement():
    motion = thesis_motion(beyond="decay")
    d, v, a = motion.displacement, motion.velocity, motion.acceleration
    assert d.m2 == pytest.approx(v.m0, rel=1e-12)
    assert d.m4 == pytest.approx(a.m0, rel=1e-12)
    assert v.zero_crossing_period == pytest.approx(zero_crossing_period(d.m2, d.m4), rel=1e-12)
    # By nodes that know nothing of the adaptive ones.
    q = spectral_nodes(*motion.band, splits=motion.splits)
    for statistics, power in ((d, 0), (v, 2), (a, 4)):
        m0 = q.integrate(q.omega**power * motion(q.omega))
        assert statistics.m0 == pytest.approx(m0, rel=1e-7)
        k = peak_factor(statistics.zero_crossing_period)
        assert statistics.most_probable_maximum() == k * statistics.rms
        assert statistics.significant_height == 4.0 * statistics.rms


def test_scaled_motion():
    motion = thesis_motion(2.0)
    assert motion.scaled(1.0).displacement.rms == pytest.approx(motion.displacement.rms / 2.0)
    assert motion.scaled(1.0).rao is motion.rao


def test_too_short_a_table_is_reported():
    sea = SeaSpectrum(kind="bretschneider", significant_height=2.0, peak_period=9.0)
    rows = {"omega": [0.6, 1.0], "amplitude": [1.0, 1.0]}
    cut = HookMotion(sea=sea, rao=HeaveRao(**rows, below="zero", beyond="hold"))
    omega_p = sea.peak_frequency
    below = math.exp(-1.25 * (omega_p / 0.6) ** 4)
    beyond = 1.0 - math.exp(-1.25 * omega_p**4)
    expected = (
        rf"{below + beyond:.1%} of the hook's displacement variance .*\(0\.6 to 1 rad/s\): "
        rf"{below:.1%} below 0\.6 rad/s is cut; "
        rf"{beyond:.1%} above 1 rad/s is extrapolated \(hold\)"
    )
    with pytest.warns(PhysicsWarning, match=expected):
        cut.warn_if_outside()
    case = load_case("thesis-1975").replace(
        {
            "sea.spectrum": "bretschneider",
            "sea.significant_height": 2.0,
            "sea.peak_period": 9.0,
            "vessel.heave_rao": rows,
            "vessel.below": "zero",
        }
    )
    with pytest.warns(PhysicsWarning, match=expected):
        HookMotion.from_case(case)


@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope", "subsea-crane"])
def test_the_bundled_cases_stay_within_their_tables(name):
    motion = HookMotion.from_case(load_case(name))  # warnings are errors here
    assert motion.rao.share_outside(motion.sea).total < 0.01
    assert 0.1 < motion.displacement.rms < 1.0


# ---------------------------------------------------------------- records


def test_a_record_is_consistent_with_itself():
    record = thesis_motion(beyond="zero").record(300.0, step=0.02, seed=5)
    t, z, v, a = record.time, record.displacement, record.velocity, record.acceleration
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(300.0)
    assert t.size == z.size == v.size == a.size == 15001
    assert (record.step, record.duration) == pytest.approx((0.02, 300.0))
    # Central differences are off by (h^2/6) of the third derivative: 1e-4 of 1 rad/s squared.
    np.testing.assert_allclose((z[2:] - z[:-2]) / 0.04, v[1:-1], atol=3e-4)
    np.testing.assert_allclose((v[2:] - v[:-2]) / 0.04, a[1:-1], atol=3e-4)
    with pytest.raises(ValueError, match="read-only"):
        z[0] = 1.0


def test_a_broad_band_record_is_consistent_with_itself():
    # Up to 60 rad/s: integrate the derivatives back and meet the motion again.
    record = thesis_motion(beyond="hold").record(20.0, step=0.001, seed=8)
    for rate, value in (
        (record.velocity, record.displacement),
        (record.acceleration, record.velocity),
    ):
        grown = np.cumsum(0.5 * (rate[1:] + rate[:-1])) * 0.001
        np.testing.assert_allclose(value[0] + grown, value[1:], atol=1e-4)


@pytest.mark.parametrize("beyond", ["hold", "decay"])
def test_the_variance_of_records_meets_the_spectrum(beyond):
    motion = thesis_motion(beyond=beyond)
    seeds, length = range(12), 1200.0
    records = [motion.record(length, step=0.1, seed=s) for s in seeds]
    q = motion.quadrature
    for name, power in (("displacement", 0), ("velocity", 2), ("acceleration", 4)):
        density = q.omega**power * motion(q.omega)
        m0 = float(q.integrate(density))
        # The variance of a sample variance is 2 pi/T times the integral of S^2 (Parseval).
        error = math.sqrt(2.0 * math.pi / (length * len(records)) * q.integrate(density**2))
        sample = np.mean([np.mean(getattr(r, name) ** 2) for r in records])
        assert sample == pytest.approx(m0, abs=3.5 * error)
        assert error < 0.06 * m0


def test_a_record_is_gaussian_and_its_maximum_is_the_predicted_one():
    motion = thesis_motion(beyond="decay")
    length = 1200.0
    records = [motion.record(length, step=0.2, seed=s) for s in range(60)]
    sigma = motion.displacement.rms
    ensemble = np.array([r.displacement[:: round(40.0 / 0.2)] for r in records]).ravel() / sigma
    # 31 x 60 nearly independent normal values: E x^3 = 0 +- sqrt(15/n), E x^4 = 3 +- sqrt(96/n).
    n = ensemble.size
    assert abs(np.mean(ensemble)) < 4.0 / math.sqrt(n)
    assert abs(np.mean(ensemble**3)) < 4.0 * math.sqrt(15.0 / n)
    assert abs(np.mean(ensemble**4) - 3.0) < 4.0 * math.sqrt(96.0 / n)
    # The mean of the largest of N Rayleigh crests is k + 0.5772/k (Longuet-Higgins 1952), its
    # scatter about pi/(k sqrt 6).
    k = peak_factor(motion.displacement.zero_crossing_period, length)
    largest = [np.max(r.displacement) / sigma for r in records]
    scatter = math.pi / (k * math.sqrt(6.0 * len(records)))
    assert np.mean(largest) == pytest.approx(k + 0.5772 / k, abs=3.5 * scatter)
    # Random amplitudes: the records' own variances scatter as they do at sea.
    q = motion.quadrature
    expected = math.sqrt(2.0 * math.pi / length * q.integrate(motion(q.omega) ** 2))
    found = np.std([np.mean(r.displacement**2) for r in records])
    assert found == pytest.approx(expected, rel=0.35)


def test_a_record_does_not_repeat_itself():
    z = thesis_motion().record(3600.0, step=0.5, seed=2).displacement
    assert z.size == 7201
    z = z - z.mean()
    size = 1 << (2 * z.size).bit_length()
    spectrum = np.abs(np.fft.rfft(z, size)) ** 2
    lags = np.fft.irfft(spectrum, size)[: z.size]
    lags /= lags[0]
    # After five minutes nothing is left of the correlation but the scatter of the estimate.
    assert np.max(np.abs(lags[600:])) < 0.3


def test_seeds():
    motion = thesis_motion()
    one, again, other = (motion.record(60.0, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.displacement, again.displacement)
    assert np.max(np.abs(one.displacement - other.displacement)) > 0.1
    assert (one.seed, other.seed) == (1, 2)


def test_a_short_record_is_the_beginning_of_a_longer_one():
    # So even a record of a minute is drawn with lines that are fine against the spectral peak.
    motion = thesis_motion()
    short, longer = motion.record(60.0, seed=3), motion.record(600.0, seed=3)
    np.testing.assert_array_equal(short.displacement, longer.displacement[: short.time.size])


@pytest.mark.parametrize("duration", [9990.0, 10800.0, 10800.02, 10805.0, 13010.0])
def test_the_fourier_transforms_have_no_large_prime_factor(duration, monkeypatch):
    lengths = []
    transform = np.fft.irfft

    def irfft(values, n):
        lengths.append(n)
        return transform(values, n)

    monkeypatch.setattr(np.fft, "irfft", irfft)
    record = thesis_motion(beyond="zero").record(duration, step=0.5, seed=2)
    assert record.duration == pytest.approx(duration, abs=0.5)
    assert len(lengths) == 3
    for length in lengths:
        # The transform's own step is 0.05 s: 200 to ten seconds, of which there is a whole number.
        assert length % 200 == 0
        tens = length // 200
        assert 2.0 * duration <= 10.0 * tens < 2.01 * duration
        assert max(k for k in range(2, tens + 1) if tens % k == 0 and is_prime(k)) <= 300


def is_prime(number):
    return all(number % k for k in range(2, math.isqrt(number) + 1))


@pytest.mark.parametrize("step", [0.2, 0.1, 0.025])
def test_the_same_seed_gives_the_same_motion_at_every_step(step):
    motion = thesis_motion()
    fine = motion.record(120.0, step=0.0125, seed=9)
    coarse = motion.record(120.0, step=step, seed=9)
    every = round(step / 0.0125)
    for name in ("time", "displacement", "velocity", "acceleration"):
        np.testing.assert_allclose(getattr(coarse, name), getattr(fine, name)[::every], atol=1e-9)


def test_the_same_seed_gives_the_same_waves_on_every_vessel():
    motion = thesis_motion(below="hold")
    rows = {"omega": TABLE_5[:, 0], "amplitude": 0.5 * TABLE_5[:, 1]}
    upside_down = HeaveRao(**rows, phase=np.full(18, math.pi), below="hold", beyond="hold")
    ours = motion.record(60.0, seed=4)
    theirs = HookMotion(sea=motion.sea, rao=upside_down).record(60.0, seed=4)
    np.testing.assert_allclose(theirs.displacement, -0.5 * ours.displacement, atol=1e-12)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"duration": 0.0}, "duration must be at least 0.05 s, got 0.0"),
        ({"step": 0.0}, "step must be above 0 s, got 0.0"),
        ({"step": math.nan}, "step must be above 0 s, got nan"),
        ({"seed": -1}, "seed must be at least 0, got -1"),
    ],
)
def test_bad_arguments(keywords, message):
    with pytest.raises(InputError, match=message):
        thesis_motion().record(**{"duration": 60.0, "step": 0.05, "seed": 0, **keywords})
