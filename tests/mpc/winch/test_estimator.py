"""The winch's Kalman filter: the gain fits the signals that are there, and what is late is late."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import scipy.linalg
from mpc_cases import WEIGHTS, case_of

import models
import stillhook as sh
from models.sensing import HEARD, MEASURED, Measurement
from mpc.linear import LinearMPC
from mpc.programme import SampledFilter, corrected, kalman_gain, late_row
from mpc.winch import SampledWinch, WinchEstimator, prediction_model, sampled_winch, with_noise

GROUPS = {"payload": slice(0, 3), "mru": slice(3, 5), "encoder": slice(5, 7), "cell": slice(7, 8)}
AT = {name: k for k, name in enumerate(HEARD)}
T = 0.05


def model_of(name):
    case = models.load_case("subsea-crane") if name == "subsea-crane" else case_of(name)
    return with_noise(prediction_model(sampled_winch(case, sample_time=T)), WEIGHTS[name].noise)


@pytest.fixture(scope="module")
def estimator():
    return WinchEstimator(model_of("thesis-1975"))


def signals(*aboard):
    there = np.zeros(len(MEASURED), dtype=np.bool_)
    for name in aboard:
        there[GROUPS[name]] = True
    return there


def shown(model, chi, *, age=None, **changes):
    """What sensors without errors show of a state, with telemetry of an age [s]."""
    C = model.C.copy()
    delays = dict(zip(MEASURED, model.winch.plant.delays, strict=True))
    age = delays[MEASURED[0]] if age is None else age
    for k, name in enumerate(MEASURED[:3]):
        C[k] = late_row(model.now[k], model.first[name], model.depth[name], age / T)
    values = np.zeros(len(HEARD))
    for name, value in zip(MEASURED, C @ chi, strict=True):
        values[AT[name]] = value
    values[AT["rope.tension"]] += model.winch.rest_tension
    values[AT["payload.age"]] = age
    values[[AT["payload.valid"], AT["mru.valid"]]] = 1.0
    values[AT["drive.applied"]] = model.winch.rest_command
    for name, value in changes.items():
        values[AT[name.replace("__", ".")]] = value
    return Measurement(values)


@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope", "subsea-crane"])
def test_every_set_of_signals_that_tells_of_the_load_or_the_drum_has_a_filter_that_holds(name):
    model = model_of(name)
    gains = WinchEstimator(model)
    found = 0
    for aboard in product((True, False), repeat=4):
        names = [one for one, on in zip(GROUPS, aboard, strict=True) if on]
        if not {"payload", "encoder"} & set(names):
            continue
        there = signals(*names)
        gain = gains.steady(there)
        assert gain is not None, names
        assert not gain[:, ~there].any()
        left = np.eye(model.size) - gain @ model.C
        # Constants of which nothing tells stay what they are; nothing else may grow.
        assert np.abs(np.linalg.eigvals(model.A @ left)).max() < 1.0 + 1e-9, names
        found += 1
    assert found == 12


def test_the_gain_of_all_signals_is_no_filter_without_the_payloads():
    """Why the gain has to change: this is what happened to who lost his telemetry."""
    model = model_of("subsea-crane")
    there = signals("mru", "encoder", "cell")
    stale = kalman_gain(model.C, model.R, model.covariance, there)
    growth = np.abs(np.linalg.eigvals(model.A @ (np.eye(model.size) - stale @ model.C))).max()
    assert growth > 1.001


def test_gains_of_changing_signals_are_those_of_the_textbooks_recursion():
    """Also of signals whose gains reckon with less noise than there is, and after those.

    What an estimate is off by then is another covariance than that which made its gains: load and
    rope are less known than those hold, and who takes up those with the signals that come back
    gives a wave that he missed to a constant force.
    """
    model = model_of("thesis-1975")
    P, mute = np.array(model.covariance), signals("mru", "encoder")
    A, Q = model.A, model.G @ model.G.T
    less, size = 0.25 * Q, np.sqrt(np.diag(P)) + 1e-12
    gains = SampledFilter(A, model.C, model.G, model.R, P, {mute.tobytes(): 0.5 * model.G})
    rng = np.random.default_rng(16)
    off = None  # what the estimate is off by, where P is not that
    for k in range(60):
        there = mute if k % 7 in (2, 3) else rng.random(len(MEASURED)) < 0.5
        late = k % 7 == 5  # telegrams of another age than usual
        C = model.C * (1.0 + 0.1 * rng.random(model.C.shape)) if late else model.C
        if k % 4:  # whoever asks beforehand finds the same
            spread = np.diag(model.C @ (P if off is None else off) @ model.C.T) + model.R
            np.testing.assert_allclose(gains.innovations, spread, rtol=1e-6)
        if there is mute:
            off = P if off is None else off
        elif off is not None:
            P, off = off, None
        expected = kalman_gain(C, model.R, P, there)
        found = gains.at(there, C if late else None)
        scaled = (found - expected) * np.sqrt(model.R) / size[:, None]
        assert np.abs(scaled).max() < 1e-6
        P = A @ corrected(P, C, model.R, expected) @ A.T + (less if there is mute else Q)
        if off is not None:
            off = A @ corrected(off, C, model.R, expected) @ A.T + Q


def test_what_is_not_heard_of_for_long_is_as_far_off_as_its_steady_gain_leaves_it():
    """On a gain that is held, too: by Lyapunov's equation of the errors."""
    model = model_of("thesis-1975-rope")
    gains, there = WinchEstimator(model), signals("mru", "encoder")
    for _ in range(150_000):  # constants are forgotten in an hour
        last = gains.at(there)
    assert np.array_equal(last, gains.steady(there))
    A = model.A.copy()
    at = np.arange(model.constants_at.start, model.constants_at.stop)
    A[at, at] = math.exp(-T / 3600.0)
    kept = A @ (np.eye(model.size) - last @ model.C)
    added = model.G @ model.G.T + A @ (last * model.R) @ last.T @ A.T
    off = scipy.linalg.solve_discrete_lyapunov(kept, added)
    spread = np.diag(model.C @ off @ model.C.T) + model.R
    np.testing.assert_allclose(gains.innovations, spread, rtol=0.02)


def test_a_set_that_lasts_comes_to_its_steady_gain_and_is_held_there():
    model = model_of("thesis-1975")
    gains = WinchEstimator(model)
    there, every = signals("mru", "encoder", "cell"), np.ones(len(MEASURED), dtype=np.bool_)
    first = gains.at(there)
    for _ in range(12_000):
        last = gains.at(there)
    steady = gains.steady(there)
    assert np.array_equal(last, steady)
    assert not np.allclose(first, steady, rtol=0.05)
    for _ in range(4000):
        back = gains.at(every)
    assert np.array_equal(back, gains.steady(every))


def test_a_state_that_is_known_for_certain_keeps_no_gain_from_being_held():
    """What rounding adds to a variance of zero is more than any share of it."""
    case = models.load_case("thesis-1975")  # of a unit without errors
    model = with_noise(prediction_model(sampled_winch(case)), WEIGHTS["thesis-1975"].noise)
    assert np.diag(model.covariance).min() < 1e-30
    gains, every = WinchEstimator(model), np.ones(len(MEASURED), dtype=np.bool_)
    for _ in range(20):
        last = gains.at(every)
    assert np.array_equal(last, gains.steady(every))


def test_the_covariance_of_an_unstable_plant_stays_symmetric():
    """Products of three matrices are not, by rounding; and the plant makes that grow."""
    A, C = np.array([[30.0, 5.0, 1.0], [1.0, 20.0, 2.0], [0.0, 3.0, 0.5]]), np.eye(3)[:2]
    G, R, P = 0.1 * np.eye(3), np.ones(2), np.eye(3)
    gains = SampledFilter(A, C, G, R, P, {})
    every = np.ones(2, dtype=np.bool_)
    for _ in range(100):
        expected, found = kalman_gain(C, R, P), gains.at(every)
        P = A @ corrected(P, C, R, expected) @ A.T + G @ G.T
        P = 0.5 * (P + P.T)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_an_estimate_that_is_no_number_is_begun_anew():
    gains = SampledFilter(np.eye(2), np.eye(2), np.eye(2), np.ones(2), np.eye(2), {})
    every = np.ones(2, dtype=np.bool_)
    gains.correct(np.ones(2), np.ones(2), np.array([True, False]))
    gains.correct(np.array([np.inf, 1.0]), np.zeros(2), every)
    assert not gains.state.any()
    assert not gains.unheard.any()
    # Covariance one, error one: half of what it is off by.
    np.testing.assert_allclose(gains.correct(np.zeros(2), np.ones(2), every), 0.5)


def test_signals_that_nobody_planned_for_have_a_gain_too():
    A, C = np.array([[1.0, 0.1], [0.0, 1.0]]), np.eye(2)
    gains = SampledFilter(A, C, 0.1 * np.eye(2), np.ones(2), 0.01 * np.eye(2), {})
    none, one = np.zeros(2, dtype=np.bool_), np.array([True, False])
    assert gains.steady(one) is None
    assert not gains.at(none).any()
    before = gains.innovations - 1.0
    for _ in range(500):
        gain = gains.at(one)
    assert np.abs(np.linalg.eigvals(A @ (np.eye(2) - gain @ C))).max() < 1.0
    assert gains.innovations[0] - 1.0 < 10.0 * before.sum()


def test_a_link_whose_age_varies_has_the_first_gains_too(estimator, monkeypatch):
    """Else a load of another weight is learnt as slowly as the constants drift."""
    monkeypatch.setattr(SampledWinch, "extra_drag", lambda self, velocity: 0.0)
    model, rng = estimator.model, np.random.default_rng(5)
    chi = 0.01 * model.scale * rng.normal(size=model.size)
    estimator.reset()
    estimator.update(shown(model, chi, age=0.03))
    C, _ = estimator._late(0.03)
    assert C is not estimator._rows
    # No numbers have been turned away, and nothing was expected but rest.
    np.testing.assert_allclose(
        estimator.state, estimator._first[0] @ (C @ chi), rtol=1e-6, atol=1e-9
    )
    estimator.reset()


@pytest.mark.parametrize("lost", ["mru__valid", "payload__valid"])
def test_what_is_shown_as_lost_is_not_looked_at(estimator, lost):
    model = estimator.model
    chi = np.zeros(model.size)
    part = ("mru.heave", "mru.heave_rate") if lost == "mru__valid" else MEASURED[:3]
    found = []
    for wrong in (0.0, 5.0):
        estimator.reset()
        lies = {name.replace(".", "__"): wrong for name in part}
        for _ in range(40):
            estimator.advance(model.A @ estimator.update(shown(model, chi, **lies, **{lost: 0.0})))
        found.append(estimator.state.copy())
    assert np.array_equal(*found)
    estimator.reset()
    for _ in range(3):
        state = estimator.update(
            shown(model, chi, **{name.replace(".", "__"): 5.0 for name in part})
        )
        estimator.advance(model.A @ state)
    assert np.abs(estimator.state).max() > 1.0  # valid, it counts


@pytest.mark.parametrize("later", [0.0, 0.03, 0.05])
def test_a_message_that_is_late_is_compared_with_what_was_on_its_way_then(
    estimator, later, monkeypatch
):
    """A world without errors is followed without one, whatever the age of its messages."""
    monkeypatch.setattr(SampledWinch, "extra_drag", lambda self, velocity: 0.0)
    model = estimator.model
    estimator.reset()
    rng = np.random.default_rng(3)
    chi = np.zeros(model.size)
    chi[model.sea_at] = rng.normal(size=model.sea.order)
    estimator.update(shown(model, chi))
    estimator.state, estimator.speed = chi.copy(), 0.0
    estimator.advance(model.A @ chi)
    usual, winch = model.winch.plant.delays[0], model.winch
    for _ in range(100):
        none = winch.command(0.0, float(winch.speed @ chi[: winch.size]))
        chi = model.A @ chi
        seen = estimator.update(shown(model, chi, age=usual + later, drive__applied=none))
        estimator.advance(model.A @ seen)
        assert np.abs((seen - chi) / model.scale).max() < 1e-7


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.08])
def test_drag_that_a_perfect_accelerometer_feels_comes_with_its_message(delay):
    """It is felt at once, and in what comes late it is that of the velocity that comes with it."""
    case = case_of("thesis-1975-rope", delay=delay)
    noise = WEIGHTS["thesis-1975-rope"].noise
    model = with_noise(prediction_model(sampled_winch(case, sample_time=T)), noise)
    estimator, winch = WinchEstimator(model), model.winch
    felt = winch.force_felt[0]
    assert felt > 0.0
    chi = np.zeros(model.size)
    chi[winch.plant.states.index("payload.velocity")] = 0.8  # it swings in still water
    estimator.update(shown(model, chi))
    estimator.state, estimator.speed = chi.copy(), 0.0
    estimator._drag = drag = winch.extra_drag(0.8)
    estimator.advance(model.A @ chi)
    for _ in range(60):
        none = winch.command(0.0, float(winch.speed @ chi[: winch.size]))
        ahead = model.A @ chi
        after = winch.extra_drag(float(winch.velocity @ ahead[: winch.size]))
        ahead[: winch.size] += 0.5 * (drag + after) * winch.from_constants[:, 0]
        chi, drag = ahead, winch.extra_drag(float(winch.velocity @ ahead[: winch.size]))
        now = shown(model, chi, drive__applied=none).values
        share, then = max(0.0, 1.0 - delay / T), winch.extra_drag(now[AT["payload.velocity"]])
        now[AT["payload.acceleration"]] += felt * (share * drag + (1.0 - share) * then)
        seen = estimator.update(Measurement(now))
        estimator.advance(model.A @ seen)
        assert np.abs((seen - chi) / model.scale).max() < 1e-5


def test_a_load_of_another_weight_is_known_within_seconds_of_the_start(monkeypatch):
    """The steady gain, for a constant that hardly drifts, would take minutes."""
    monkeypatch.setattr(SampledWinch, "extra_drag", lambda self, velocity: 0.0)
    model = model_of("thesis-1975")
    estimator, winch = WinchEstimator(model), model.winch
    more = 0.05 * winch.rest_tension
    chi = np.zeros(model.size)
    at = model.constants_at.start + 3
    chi[at] = more  # seen from where it hangs at rest, it is the tension that is off
    found = []
    for _ in range(round(60.0 / T)):
        none = winch.command(0.0, estimator.speed)
        state = estimator.update(shown(model, chi, drive__applied=none))
        estimator.advance(model.A @ state)
        found.append(state[at] / more)
    assert found[round(5.0 / T)] == pytest.approx(1.0, abs=0.05)
    assert found[-1] == pytest.approx(1.0, abs=0.02)


@pytest.mark.ci
def test_who_hears_the_load_by_nothing_does_as_well_as_feed_forward():
    """With telegram and load cell gone the drum's speed was taken to tell how the load swings."""
    case = models.load_case("subsea-crane")
    controller = LinearMPC(case, weights=WEIGHTS["subsea-crane"])

    class Deaf:
        name, sample_time = "deaf", controller.sample_time

        def reset(self):
            controller.reset()

        def step(self, measurement, time):
            values = measurement.values.copy()
            if 80.0 < time < 140.0:
                values[AT["payload.valid"]], values[AT["rope.tension"]] = 0.0, np.nan
            return controller.step(Measurement(values), time)

    rms = {}
    for own in (Deaf(), sh.VelocityFeedForward(case, share=1.0)):
        found = []
        for seed in (1, 2):
            (run,) = sh.simulate(case, own, seeds=[seed], duration=200.0, settle=80.0).runs
            found.append(run.statistics.value("payload rms"))
        rms[own.name] = float(np.sqrt(np.mean(np.square(found))))
    deaf, feed_forward = rms.values()
    assert deaf < 1.2 * feed_forward
    assert controller.counts["fallback"] == 0


def test_a_telegram_that_is_gone_has_a_steady_gain_however_old_it_grows(estimator):
    model = estimator.model
    chi = np.zeros(model.size)
    estimator.reset()
    for _ in range(300):
        estimator.update(shown(model, chi))
    for k in range(3000):
        gone = shown(model, chi).values.copy()
        gone[AT["payload.valid"]], gone[AT["payload.age"]] = 0.0, 0.1 + T * k
        estimator.update(Measurement(gone))
        if estimator._held is not None:
            break
    assert estimator._held is not None
    estimator.reset()


def test_telegrams_that_are_later_than_told_do_not_lose_a_load_that_moves_fast():
    """Drag of one sample ago was that of now, or that of the velocity estimated then: both did."""
    told = case_of("thesis-1975", 2.43)
    controller = LinearMPC(told, weights=WEIGHTS["thesis-1975"], predictor="kalman")
    late = told.replace({"sensors.telemetry.delay": 0.05})
    (run,) = sh.simulate(late, controller, seeds=[0], duration=45.0, store_step=0.1)
    assert controller.counts["gated"] == 0
    assert np.abs(run["payload.displacement"]).max() < 1.0


def test_messages_that_are_lost_from_the_start_do_not_lose_the_load():
    """On gains that were made for all signals the constants are not learnt any more."""
    lost = {"sensors.telemetry.dropout": 0.35, "sensors.telemetry.dropout_length": "55 ms"}
    case = models.load_case("subsea-crane").replace(lost)
    run = sh.simulate(case, LinearMPC(case), seeds=[0], duration=120.0, settle=40.0)[0]
    assert run.statistics["payload.displacement"].standard_deviation < 0.05


@pytest.mark.parametrize("heard", [0, 1, 40])
def test_the_first_gain_after_an_interrupted_start_is_the_textbooks(estimator, heard):
    estimator.reset()
    everything = np.ones(len(estimator._R), dtype=np.bool_)
    there, nothing = everything.copy(), np.zeros(len(estimator._R))
    there[:3] = False
    A, Q, P = estimator._A, estimator._Q, estimator._start
    for _ in range(heard):
        estimator.correct(np.zeros(len(estimator.state)), nothing, everything)
        gain = kalman_gain(estimator._C, np.ones(len(there)), P, everything)
        P = A @ (P - gain @ estimator._C @ P) @ A.T + Q
        P = 0.5 * (P + P.T)
    asked = estimator.innovations  # as the gate asks, of the covariance that is usual
    assert asked.shape == (len(there),)
    error = 0.01 * np.sqrt(estimator._R)
    estimator.correct(np.zeros(len(estimator.state)), error, there)
    gain = kalman_gain(estimator._C, np.ones(len(there)), P, there)
    size = estimator._back[:, 0] * np.sqrt(estimator._R[0])  # of each state
    expected = (gain * estimator._back) @ (error * there) / size
    found = estimator.state / size
    assert np.abs(found - expected).max() <= 1e-4 * np.abs(expected).max()
    estimator.reset()
