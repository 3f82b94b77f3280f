"""The adaptive predictor, against the optimal linear one, in changing seas, on bad input."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sea_records import AT, LEADS, TS, errors_of, sea
from wiener import Wiener

from models.basics import InputError
from mpc.forecast import AdaptiveAR
from mpc.forecast.autoregressive import smoother


def predictor(**options) -> AdaptiveAR:
    return AdaptiveAR(**({"sample_time": TS, "horizon": 8.0} | options))


def feed(found, motion, start, end):
    """Show a motion (time -> heave, rate) from one sample to another."""
    for k in range(start, end):
        found.update(*motion(k * TS), True, k * TS)


def wave(omega, amplitude=1.0):
    return lambda t: (amplitude * math.sin(omega * t), amplitude * omega * math.cos(omega * t))


class TestOptimality:
    # What it costs not to know the sea.  The optimum in the thesis's sea with 1 % of noise uses
    # more than 60 s of the past (a third of the cost at 2 s, the displacement's hardest lead,
    # where what is left of its own variance is least); 20 s and 48 coefficients are what a
    # record of minutes can feed.  With 5 % the noise is the larger part, and in the crane's
    # narrower sea with an error as slow as the waves 20 s are all there is.
    @pytest.mark.parametrize(("name", "most"), [("1 %", 1.45), ("5 %", 1.35), ("crane", 1.25)])
    def test_not_far_from_the_optimal_predictor_that_knows_the_sea(self, name, most):
        known = sea(name)
        error = 0.05 if name == "crane" else 0.0
        found = predictor(delay=known.unit.delay, error=error)
        records = [known.record(seed, 900.0) for seed in (1, 2)]
        made, stated = errors_of(found, records, start=300.0, every=10)
        ratio = made / Wiener(known.hook, known.unit).errors(LEADS)
        assert ratio.max() < most
        assert ratio.mean() < 1.17
        # The record tells how large the errors are, from 2 s ahead within a tenth; nearer, what
        # the record shows is not quite what the hook did.
        np.testing.assert_allclose(stated[:, 3:], made[:, 3:], rtol=0.10)
        np.testing.assert_allclose(stated[:, 1:3], made[:, 1:3], rtol=0.35)

    def test_a_longer_reach_is_nearer_to_the_optimum(self):
        known = sea("1 %")
        records = [known.record(1, 900.0)]
        short, _ = errors_of(predictor(order=6), records, start=300.0, every=10)
        usual, _ = errors_of(predictor(order=20), records, start=300.0, every=10)
        assert short[0, 3] > 1.3 * usual[0, 3]

    def test_a_sine_is_foretold(self):
        found = predictor()
        feed(found, wave(0.8), 0, 2400)
        f = found.forecast()
        t = 2399 * TS + found.leads
        np.testing.assert_allclose(f.displacement, np.sin(0.8 * t), atol=0.01)
        np.testing.assert_allclose(f.velocity, 0.8 * np.cos(0.8 * t), atol=0.01)
        assert f.displacement_std.max() < 0.02

    def test_the_delay_is_foretold_too(self):
        found = predictor(delay=0.37)
        late = wave(0.8)
        feed(found, lambda t: late(t - 0.37), 0, 2400)
        t = 2399 * TS + found.leads
        np.testing.assert_allclose(found.forecast().displacement, np.sin(0.8 * t), atol=0.01)


class TestAdapting:
    def test_it_follows_a_change_of_the_sea(self):
        old, crane = sea("5 %"), sea("crane")
        new = replace(crane, unit=replace(old.unit, heave_rms=crane.unit.heave_rms))
        before, after = old.record(1, 600.0), new.record(2, 1500.0)
        both = tuple(np.hstack((a, b)) for a, b in zip(before, after, strict=True))
        settled, usual = errors_of(predictor(), [after], start=900.0)
        found = predictor()
        changed, stated = errors_of(found, [both], start=1500.0)
        # 900 s, more than two memories, after the change: as if the old sea had never been
        assert (changed / settled)[:, 1:].max() < 1.15
        np.testing.assert_allclose(stated, usual, rtol=0.15)

    def test_before_there_is_a_model_it_fades_with_the_records_deviation(self):
        found = predictor()
        nothing = found.forecast()
        assert not found.ready
        assert not np.any([nothing.displacement, nothing.displacement_std])
        feed(found, wave(0.8, amplitude=2.0), 0, 500)
        f = found.forecast()
        assert not found.ready
        assert f.displacement[0] == pytest.approx(2.0 * math.sin(0.8 * 499 * TS))
        assert f.displacement[-1] == pytest.approx(f.displacement[0] * math.exp(-8.0))
        assert f.velocity[20] == pytest.approx(f.velocity[0] * math.exp(-1.0))
        np.testing.assert_allclose(f.displacement_std, math.sqrt(2.0), rtol=0.1)
        np.testing.assert_allclose(f.velocity_std, 0.8 * math.sqrt(2.0), rtol=0.1)
        feed(found, wave(0.8), 500, 1000)
        assert found.ready

    def test_soon_after_its_start_it_is_better_than_nothing(self):
        known = sea("5 %")
        records = [known.record(seed, 100.0) for seed in range(1, 11)]
        made, _ = errors_of(predictor(), records, start=70.0)
        share = made / known.rms[:, None]
        assert share[:, :4].max() < 0.5
        assert share.max() < 1.05

    def test_a_gap_is_bridged(self):
        found = predictor()
        motion = wave(0.8)
        feed(found, motion, 0, 2400)
        steady = found.forecast().displacement_std
        for k in range(2400, 2440):
            found.update(math.nan, math.nan, False, k * TS)
        f = found.forecast()
        t = 2439 * TS + found.leads
        np.testing.assert_allclose(f.displacement, np.sin(0.8 * t), atol=0.03)
        # its deviations are those of leads 2 s longer, then the record's
        np.testing.assert_allclose(f.displacement_std[:-40], steady[40:], rtol=0.03)
        assert f.displacement_std[-1] == pytest.approx(math.sqrt(0.5), rel=0.1)
        feed(found, motion, 2440, 2451)
        np.testing.assert_allclose(found.forecast().displacement_std, steady, rtol=0.05)

    def test_a_long_gap_is_not_learnt_from(self):
        found = predictor()
        feed(found, wave(0.8), 0, 2400)
        for k in range(2400, 4400):
            found.update(0.0, 0.0, False, k * TS)
        feed(found, wave(0.8), 4400, 5000)
        t = 4999 * TS + found.leads
        np.testing.assert_allclose(found.forecast().displacement, np.sin(0.8 * t), atol=0.02)


class TestBadInput:
    @pytest.mark.parametrize("level", [0.0, 1e-300, 1e-12, 0.3, 999.0])
    def test_a_constant_signal_is_foretold(self, level):
        found = predictor()
        feed(found, lambda t: (level, 0.0), 0, 12_000)
        f = found.forecast()
        np.testing.assert_allclose(f.displacement, level, rtol=1e-3, atol=1e-12)
        np.testing.assert_allclose(f.velocity, 0.0, atol=1e-3 * level + 1e-12)
        assert np.all(f.displacement_std <= max(level, 1e-12))

    def test_waves_after_a_long_calm_and_the_other_way_round(self):
        found = predictor(memory=25.0, order=12)
        for start in (0, 24_000):
            feed(found, lambda t: (0.0, 0.0), start, start + 12_000)
            assert not np.any(np.abs(found.forecast().displacement) > 1e-6)
            feed(found, wave(0.8), start + 12_000, start + 24_000)
            f = found.forecast()
            t = (start + 23_999) * TS + found.leads
            np.testing.assert_allclose(f.displacement, np.sin(0.8 * t), atol=0.01)

    def test_growing_and_jumping_signals_stay_bounded(self):
        found = predictor()
        feed(found, lambda t: (1e-3 * math.exp(0.1 * t), 1e-4 * math.exp(0.1 * t)), 0, 2500)
        jumps = np.random.default_rng(0).choice([-1.0, 0.0, 30.0], (4000, 2))
        for k, (heave, rate) in enumerate(jumps.tolist()):
            found.update(heave, rate, True, 0.0)
            if k % 50 == 0:
                f = found.forecast()
                assert np.max(np.abs(f.displacement)) < 3000.0
                assert np.all(np.isfinite(f.displacement_std))

    @settings(max_examples=15)
    @given(
        st.lists(st.tuples(st.floats(), st.floats(), st.booleans()), min_size=1, max_size=12),
        st.integers(min_value=1, max_value=300),
    )
    def test_whatever_comes_the_forecast_is_finite(self, samples, repeats):
        found = AdaptiveAR(sample_time=0.1, horizon=2.0, order=4, spacing=0.4, memory=5.0)
        for _ in range(repeats):
            for heave, rate, valid in samples:
                found.update(heave, rate, valid, 0.0)
        f = found.forecast()
        assert np.all(np.isfinite([f.displacement, f.velocity]))
        assert np.all(np.isfinite([f.displacement_std, f.velocity_std]))

    def test_wrong_numbers_are_refused(self):
        with pytest.raises(InputError, match=r"adaptive AR: order must be in \[4, 200\], got 2"):
            predictor(order=2)
        with pytest.raises(InputError, match=r"spacing must be in \[0.2, 100\] s, got 0.1"):
            predictor(spacing=0.1)
        with pytest.raises(InputError, match=r"memory must be in \[20, 1e\+06\] s, got 10"):
            predictor(memory=10.0)


def test_smoothing_is_exact_for_a_quartic():
    rows = smoother(np.array([0, 10]), 12, TS, 1.0)
    t = TS * np.arange(-12, 23)
    curve = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5, -0.7])
    seen = np.column_stack((curve(t), curve.deriv()(t))).ravel()
    wanted = [curve(0.0), curve.deriv()(0.0), curve(0.5), curve.deriv()(0.5)]
    np.testing.assert_allclose(rows @ seen, wanted, atol=1e-10)


def test_error_of_the_data_sheet_is_the_least_deviation():
    known = sea("crane")
    records = [known.record(1, 300.0)]
    _, stated = errors_of(predictor(error=0.05), records, start=200.0)
    _, without = errors_of(predictor(), records, start=200.0)
    assert stated[0].min() == pytest.approx(0.05)
    assert without[0, 0] < 0.01
    np.testing.assert_array_equal(stated[:, AT >= 80], without[:, AT >= 80])
