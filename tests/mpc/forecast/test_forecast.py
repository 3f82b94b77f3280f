"""What every predictor promises, whatever stands behind it; and perfect preview."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sea_predictor import SeaPredictor
from sea_records import TS, sea

from models.basics import InputError
from models.operation import SineMotion, SpectrumMotion
from mpc.forecast import AdaptiveAR, PerfectPreview, Predictor
from mpc.forecast.autoregressive import hermite_weights
from mpc.forecast.forecast import leads_of

HORIZON = 6.0


def kalman():
    return SeaPredictor(sea("1 %").case, sample_time=TS, horizon=HORIZON)


def adaptive():
    return AdaptiveAR(sample_time=TS, horizon=HORIZON)


def preview():
    found = PerfectPreview(sample_time=TS, horizon=HORIZON)
    found.foresee(SpectrumMotion(hook=sea("1 %").hook).motion(200.0, TS, 3))
    return found


@pytest.fixture(params=[kalman, adaptive, preview])
def predictor(request) -> Predictor:
    return request.param()


def values(forecast):
    f = forecast
    return np.array([f.displacement, f.velocity, f.displacement_std, f.velocity_std])


def show(predictor, count, start=0):
    _, shown = sea("1 %").record(3, 200.0)
    for k in range(start, count):
        predictor.update(*shown[:, k].tolist(), True, k * TS)


class TestContract:
    def test_it_is_a_predictor_with_leads_from_now_to_the_horizon(self, predictor):
        assert isinstance(predictor, Predictor)
        assert predictor.sample_time == TS
        np.testing.assert_allclose(predictor.leads, TS * np.arange(121))
        assert not predictor.leads.flags.writeable

    def test_a_forecast_has_four_finite_arrays_of_the_leads(self, predictor):
        for count in (1, 30, 1500):
            show(predictor, count)
            found = values(predictor.forecast())
            assert found.shape == (4, 121)
            assert np.all(np.isfinite(found))
            assert np.all(found[2:] >= 0.0)

    def test_velocity_is_the_derivative_of_displacement(self, predictor):
        show(predictor, 1500)
        f = predictor.forecast()
        by_difference = (f.displacement[2:] - f.displacement[:-2]) / (2.0 * TS)
        np.testing.assert_allclose(by_difference, f.velocity[1:-1], atol=0.03)

    def test_forecasting_changes_nothing_and_later_updates_change_no_forecast(self, predictor):
        show(predictor, 1500)
        first = predictor.forecast()
        kept = values(first)
        np.testing.assert_array_equal(values(predictor.forecast()), kept)
        show(predictor, 1700, start=1500)
        np.testing.assert_array_equal(values(first), kept)
        assert np.any(values(predictor.forecast()) != kept)

    def test_reset_forgets(self, predictor):
        show(predictor, 1300)
        once = values(predictor.forecast())
        predictor.reset()
        show(predictor, 1300)
        np.testing.assert_array_equal(values(predictor.forecast()), once)

    @pytest.mark.parametrize(
        ("heave", "rate", "valid"),
        [(1.0, 1.0, False), (math.nan, 0.1, True), (0.1, math.inf, True), (1e9, 0.0, True)],
    )
    def test_what_is_not_valid_or_not_finite_never_enters(self, predictor, heave, rate, valid):
        show(predictor, 1500)
        reference = 1520 * TS
        for k in range(1500, 1521):
            predictor.update(heave, rate, valid, k * TS)
        found = values(predictor.forecast())
        predictor.reset()
        show(predictor, 1500)
        for k in range(1500, 1521):
            predictor.update(math.nan, math.nan, False, k * TS)
        np.testing.assert_array_equal(values(predictor.forecast()), found)
        true = sea("1 %").record(3, 200.0)[0][:, round(reference / TS)]
        assert abs(found[0, 0] - true[0]) < 0.5
        assert abs(found[1, 0] - true[1]) < 0.5


class TestPreview:
    def test_it_is_the_record(self):
        found = preview()
        z, v, _ = SpectrumMotion(hook=sea("1 %").hook).motion(200.0, TS, 3).block(0, 4001)
        for k in (0, 1, 777, 3880):
            found.update(math.nan, math.nan, False, k * TS)
            f = found.forecast()
            np.testing.assert_array_equal(f.displacement, z[k : k + 121])
            np.testing.assert_array_equal(f.velocity, v[k : k + 121])
            assert not np.any([f.displacement_std, f.velocity_std])

    def test_beyond_its_end_the_record_is_held(self):
        found = preview()
        z, _, _ = SpectrumMotion(hook=sea("1 %").hook).motion(200.0, TS, 3).block(4000, 1)
        for k in (4000, 5000):
            found.update(0.0, 0.0, True, k * TS)
            f = found.forecast()
            np.testing.assert_array_equal(f.displacement[1:], z[0])
            assert not f.velocity[1:].any()

    @pytest.mark.parametrize("step", [0.002, 0.025, 0.03, 0.08])
    def test_the_records_own_step_may_be_another(self, step):
        found = PerfectPreview(sample_time=TS, horizon=HORIZON)
        motion = SineMotion(amplitude=1.5, period=8.0).motion(400.0, step, 0)
        found.foresee(motion)
        found.update(0.0, 0.0, True, 390.0)
        f = found.forecast()
        angle = 2.0 * math.pi / 8.0 * (390.0 + found.leads)
        # cubics between rows: (omega step)^4/384 of the amplitude
        np.testing.assert_allclose(f.displacement, 1.5 * np.sin(angle), atol=1e-7)
        rate = 1.5 * 2.0 * math.pi / 8.0 * np.cos(angle)
        np.testing.assert_allclose(f.velocity, rate, atol=1e-5)

    def test_without_a_record_it_refuses(self):
        found = PerfectPreview(sample_time=TS, horizon=HORIZON)
        found.update(0.0, 0.0, True, 0.0)
        with pytest.raises(InputError, match=r"foresee\(motion\) before a forecast, got none"):
            found.forecast()

    def test_it_refuses_a_time_that_is_no_sample(self):
        found = preview()
        with pytest.raises(InputError, match=r"time must be a multiple of 0.05 s, got nan s"):
            found.forecast()
        found.update(0.0, 0.0, True, 0.07)
        with pytest.raises(InputError, match=r"time must be a multiple of 0.05 s, got 0.07 s"):
            found.forecast()


class TestParts:
    def test_hermite_weights_are_exact_for_cubics(self):
        knots = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
        at = np.linspace(0.0, 3.0, 61)
        curve = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.5])
        weights = hermite_weights(knots, at)
        found = weights @ np.column_stack((curve(knots), curve.deriv()(knots))).ravel()
        np.testing.assert_allclose(found, np.concatenate([curve(at), curve.deriv()(at)]))

    def test_leads_are_checked(self):
        np.testing.assert_array_equal(leads_of("test", 0.5, 1.1), [0.0, 0.5, 1.0])
        with pytest.raises(InputError, match="test: sample_time must be above 0 s, got 0"):
            leads_of("test", 0.0, 1.0)
        with pytest.raises(InputError, match="test: horizon must be in"):
            leads_of("test", 0.05, -1.0)
