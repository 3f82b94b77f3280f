"""The bank of seas: how well it foretells the sea as told, and that it notices another."""

from __future__ import annotations

import numpy as np
import pytest
from mpc_cases import WEIGHTS, case_of, controller_of
from sea_records import TS

from models import load_case
from models.hook import HookMotion
from models.operation import SpectrumMotion
from mpc.forecast import Forecast, PerfectPreview, SeaBank, fused
from mpc.linear import LinearMPC
from mpc.winch import ProcessNoise, Weights
from stillhook import simulate

TWO = {
    "sea": {
        "spectrum": "sum",
        "parts": [
            {"spectrum": "jonswap", "significant_height": 1.52, "peak_period": 14.0, "gamma": 3.3},
            {"spectrum": "jonswap", "significant_height": 1.14, "peak_period": 6.5, "gamma": 2.0},
        ],
    }
}
LONG, SHORT = {"sea.significant_period": 10.53}, {"sea.significant_period": 5.67}
pytestmark = pytest.mark.filterwarnings("ignore::models.PhysicsWarning")


def bank() -> SeaBank:
    return SeaBank(case_of("thesis-1975", 1.9), sample_time=TS, horizon=8.0)


def path(changes, seed, seconds):
    hook = HookMotion.from_case(case_of("thesis-1975", 1.9).replace(changes))
    motion = SpectrumMotion(hook=hook).motion(seconds, TS, seed)
    z, v, _ = motion.block(0, motion.rows)
    return z, v, hook.displacement.rms


def show(predictor, z, v, first=0):
    for k, pair in enumerate(zip(z.tolist(), v.tolist(), strict=True), first):
        predictor.update(*pair, True, k * TS)


def test_in_the_sea_as_told_it_errs_by_as_much_as_it_states_and_by_less_than_few_states():
    z, v, rms = path({}, 3, 600.0)
    found, at, made, stated = bank(), np.array([40, 60, 100]), [], []
    for k in range(z.size - 160):
        found.update(float(z[k]), float(v[k]), True, k * TS)
        if k > 2400 and k % 10 == 0:
            forecast = found.forecast()
            made.append((forecast.displacement[at] - z[k + at]) / rms)
            stated.append(forecast.displacement_std[at] / rms)
    error = np.sqrt(np.mean(np.square(made), axis=0))
    assert not found.misfit
    # The filter's own sea of eight states errs by 18, 22 and 44 %.
    assert np.all(error < [0.17, 0.22, 0.42])
    np.testing.assert_allclose(error, np.sqrt(np.mean(np.square(stated), axis=0)), rtol=0.35)


@pytest.mark.parametrize(
    ("changes", "most"),
    [(TWO, 0.25), (LONG, 0.25), (SHORT, 0.3)],
    ids=["two systems", "longer waves", "shorter waves"],
)
def test_another_sea_is_noticed_within_a_minute_and_foretold_by_others(changes, most):
    z, v, rms = path(changes, 1, 120.0)
    found = bank()
    show(found, z[:1200], v[:1200])
    assert found.misfit
    errors = []
    for k in range(1200, 2300):
        show(found, z[k : k + 1], v[k : k + 1], k)
        if k > 1800:
            errors.append(found.forecast().displacement[40] - z[k + 40])
    assert np.std(errors) < most * rms
    found.reset()
    assert not found.misfit
    assert found.fit > 0.99


def test_it_foretells_well_before_the_filter_has_settled():
    made, at = [], np.array([20, 40])
    for seed in range(4):
        z, v, rms = path({}, seed, 100.0)
        found = bank()
        for k in range(1800):
            found.update(float(z[k]), float(v[k]), True, k * TS)
            if k > 900 and k % 10 == 0:
                made.append((found.forecast().displacement[at] - z[k + at]) / rms)
    assert np.all(np.sqrt(np.mean(np.square(made), axis=0)) < [0.125, 0.205])


def test_an_error_that_is_known_to_be_is_no_other_sea():
    z, v, rms = path({}, 2, 150.0)
    rate = HookMotion.from_case(case_of("thesis-1975", 1.9)).velocity.rms
    off = 0.02 * np.random.default_rng(0).standard_normal((2, z.size)) * [[rms], [rate]]
    told = SeaBank(
        case_of("thesis-1975", 1.9), sample_time=TS, horizon=8.0, error=(0.02 * rms, 0.02 * rate)
    )
    untold = bank()
    for found in (told, untold):
        show(found, z + off[0], v + off[1])
    assert told.fit > 0.5
    assert not told.misfit
    # Who holds the hook to be exact takes the error for a sea.
    assert untold.fit < 1e-3


def test_the_same_record_gives_the_same_forecast_after_a_reset():
    z, v, _ = path({}, 0, 90.0)
    found = bank()
    show(found, z, v)
    before = found.forecast()
    found.reset()
    show(found, z, v)
    np.testing.assert_array_equal(found.forecast().displacement, before.displacement)


def test_two_forecasts_are_weighed_by_their_variances_and_the_shorter_one_fades_out():
    ones = np.ones(40)
    own = Forecast(0.0 * ones, 0.0 * ones, 2.0 * ones, ones)
    other = Forecast(ones[:10], ones[:10], ones[:10], 0.0 * ones[:10])
    both = fused(own, other, 0.1)
    np.testing.assert_allclose(both.displacement[:10], 0.8)
    np.testing.assert_allclose(both.displacement_std[:10], 2.0 * np.sqrt(0.2))
    np.testing.assert_allclose(both.velocity[:10], 1.0)
    np.testing.assert_allclose(both.velocity_std[:10], 0.0)
    assert both.displacement[19] == pytest.approx(0.8 * np.exp(-1.0))
    assert both.displacement_std[-1] > 1.99


def test_a_forecast_that_is_to_begin_elsewhere_forgets_it_within_seconds():
    ones = np.ones(101)
    found = Forecast(2.0 * ones, -1.0 * ones, ones, 3.0 * ones).begun_at(3.0, 1.0, 0.05)
    assert (found.displacement[0], found.velocity[0]) == (3.0, 1.0)
    assert found.displacement[20] - 2.0 == pytest.approx(np.exp(-1.0))
    assert found.velocity[20] + 1.0 == pytest.approx(2.0 * np.exp(-1.0))
    assert abs(found.displacement[-1] - 2.0) < 0.01
    np.testing.assert_array_equal(found.displacement_std, ones)
    np.testing.assert_array_equal(found.velocity_std, 3.0 * ones)


def rms_of(run, begin):
    return float(np.sqrt((run["payload.displacement"][run.time > begin] ** 2).mean()))


def test_a_load_in_a_sea_of_two_systems_is_held_and_the_misfit_is_counted_and_told():
    case = case_of("thesis-1975", 1.9).replace(TWO)
    controller = controller_of("thesis-1975", 1.9, predictor="bank")
    run = simulate(case, controller, seeds=1, duration=120.0)[0]
    # Where the filter's own sea is believed it moves more than the hook: 3.6 m.
    assert rms_of(run, 30.0) < 0.25 * run["hook.heave"].std()
    assert controller.counts["misfit"] == run.timings.statuses["misfit"] > 1000
    assert sum("not as the controller was told" in event.text for event in run.events) == 1


def test_a_swell_that_was_not_told_is_no_error_of_the_unit():
    swell = {"spectrum": "jonswap", "significant_height": 1.9, "peak_period": 16.0, "gamma": 3.3}
    controller = controller_of("thesis-1975", 1.9, predictor="bank")
    run = simulate(
        case_of("thesis-1975", 1.9).replace({"sea": swell}), controller, seeds=1, duration=100.0
    )[0]
    # A filter that holds no wave to be as long takes a sixth of it for an error: 10 mm.
    assert rms_of(run, 40.0) < 3e-3


def test_a_unit_that_drifts_in_the_sea_as_told_is_taken_for_no_other_sea():
    case = case_of("subsea-crane")
    controller = controller_of("subsea-crane", predictor="bank")
    run = simulate(case, controller, seeds=1, duration=150.0)[0]
    assert controller.counts["misfit"] == 0
    assert controller.predictor.fit > 0.5
    assert rms_of(run, 30.0) < 0.03


def test_a_filter_that_has_just_begun_is_no_other_sea():
    """In seed 0 long waves were taken for better at 27 s, in seed 4 the autoregression at 114 s.

    It began after the first errors, which the others were held against.
    """
    case = load_case("subsea-crane")
    # As they are tuned for the case.
    noise = ProcessNoise(force=0.0012, torque=0.495, rope=0.566, sensors=1.84e-3, unit=0.05)
    weights = Weights(torque=0.183, noise=noise, stiffness=1.277)
    controller = LinearMPC(case, weights=weights)
    for seed in (0, 4):
        simulate(case, controller, seeds=[seed], duration=120.0)
        assert controller.counts["misfit"] == 0
        assert controller.predictor.shares[-1] < 1e-2


@pytest.mark.parametrize("name", ["landing", "subsea-crane"])
def test_in_the_sea_as_told_it_costs_next_to_nothing_on_a_unit_that_errs_slowly(name):
    case, weights = load_case(name), WEIGHTS["subsea-crane"]
    left = []
    for predictor in ("bank", "kalman"):
        controller = LinearMPC(case, weights=weights, predictor=predictor)
        runs = simulate(case, controller, seeds=range(4), duration=120.0)
        left.append(np.sqrt(np.mean([rms_of(run, 15.0) ** 2 for run in runs])))
    # A path that begins elsewhere than the filter's hook costs a fifth of the first minutes.
    assert left[0] < 1.06 * left[1]


def test_a_preview_of_two_seconds_is_fused_and_who_has_the_record_is_named_so():
    case = case_of("thesis-1975", 2.43)
    plain = LinearMPC(case, weights=WEIGHTS["thesis-1975"], predictor="bank")
    near = PerfectPreview(sample_time=TS, horizon=2.0)
    told = LinearMPC(
        case, weights=WEIGHTS["thesis-1975"], predictor="bank", preview=near, name="own"
    )
    assert (plain.name, told.name) == ("mpc", "own-preview")
    left = [rms_of(simulate(case, one, seeds=1, duration=180.0)[0], 60.0) for one in (plain, told)]
    assert left[1] < 0.7 * left[0]


def test_a_preview_has_to_fit_the_controller():
    late = PerfectPreview(sample_time=0.1, horizon=2.0)
    with pytest.raises(ValueError, match="preview must forecast every"):
        controller_of("thesis-1975", 1.9, predictor="bank", preview=late)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [TWO, LONG, SHORT])
def test_what_is_left_is_within_three_times_of_what_is_left_when_told(changes):
    case = case_of("thesis-1975", 1.9).replace(changes)
    believed = controller_of("thesis-1975", 1.9, predictor="bank")
    told = type(believed)(case, weights=believed.weights, predictor="bank")
    for seed in range(3):
        runs = [simulate(case, one, seeds=[seed], duration=720.0)[0] for one in (believed, told)]
        assert rms_of(runs[0], 180.0) < 3.0 * rms_of(runs[1], 180.0)
        assert rms_of(runs[0], 600.0) < 1.5 * rms_of(runs[1], 600.0)
