"""What keeps a predictive controller stable on a plant, and with sensors, that it does not know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from mpc_cases import WEIGHTS, case_of, controller_of

import stillhook as sh
from models.sensing import MEASURED
from mpc.winch import (
    PredictionModel,
    ProcessNoise,
    Weights,
    plan_model,
    prediction_model,
    regulator,
    with_noise,
)
from mpc.winch.regulation import feedback_row
from mpc.winch.sampled import sampled_winch
from mpc.winch.unsaturated import Unsaturated, _plant
from mpc.winch.weights import plants_off

#: Found by `tune_weights` for the rope at 1.25 m.
ROPE = Weights(
    torque=0.1056,
    noise=ProcessNoise(force=0.0022, torque=0.073, rope=0.4624, sensors=1.267e-3),
    stiffness=1.4,
)
STIFF, SAME = 1.4, 1.0


def loop_of(name: str, weights: Weights, stiffness: float) -> Unsaturated:
    model = with_noise(prediction_model(sampled_winch(case_of(name, 1.25))), weights.noise)
    return Unsaturated(
        model=model, regulator=regulator(plan_model(model, stiffness), weights.torque)
    )


def highest_growth(name: str, weights: Weights, stiffness: float, share: float) -> float:
    loop = loop_of(name, weights, stiffness)
    return max(
        loop.growth(prediction_model(sampled_winch(case_of(name, 1.25), off=off)), share=share)
        for off in plants_off()
    )


@pytest.mark.ci
@pytest.mark.parametrize(
    ("name", "weights"), [("thesis-1975", WEIGHTS["thesis-1975"]), ("thesis-1975-rope", ROPE)]
)
def test_a_plan_on_a_stiffer_rope_is_stable_on_other_loads_and_ropes_with_half_the_torque(
    name, weights
):
    assert highest_growth(name, weights, STIFF, 1.0) < 1.0
    assert highest_growth(name, weights, STIFF, 0.47) < 1.0 + 1e-6
    # without it an oscillation grows, tenfold in half a minute or faster
    assert highest_growth(name, weights, SAME, 0.47) > 1.005


def test_on_one_spring_other_loads_and_ropes_leave_the_sensitivity_far_below_two():
    loop = loop_of("thesis-1975", WEIGHTS["thesis-1975"], STIFF)
    omega = np.geomspace(0.02, 60.0, 300)
    for off in plants_off():
        plant = prediction_model(sampled_winch(case_of("thesis-1975", 1.25), off=off))
        found = np.abs(loop.sensitivity(omega, plant=plant))
        assert found.max() < 1.5
        assert found == pytest.approx(np.abs(sensitivity_on(loop, plant, omega)), rel=1e-6)


def sensitivity_on(loop: Unsaturated, plant: PredictionModel, omega: np.ndarray) -> np.ndarray:
    """S broken at the torque, the controller on a plant that is another than it believes."""
    believed = loop.model
    T = believed.winch.sample_time
    z = np.exp(1j * omega * T)
    n = plant.winch.size
    kept = np.r_[np.arange(n), np.arange(plant.constants_at.stop, plant.size)]
    A, B, C = plant.A[np.ix_(kept, kept)], plant.B[kept], plant.C[:, kept]
    Ac, Bc, _, _ = loop.controller
    row = -feedback_row(loop.regulator, believed)
    held = np.eye(believed.size) - believed.gain @ believed.C
    Cc, Dc = (row @ held)[None, :], (row @ believed.gain)[None, :]
    found = []
    for each in z:
        through = C @ np.linalg.solve(each * np.eye(len(A)) - A, B)
        back = Cc @ np.linalg.solve(each * np.eye(len(Ac)) - Ac, Bc) + Dc
        found.append(1.0 / (1.0 - (back @ through)[0, 0]))
    return np.array(found)


@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope", "subsea-crane"])
def test_what_rests_for_the_estimator_rests_for_the_plan(name):
    model = with_noise(prediction_model(sampled_winch(case_of(name))), WEIGHTS[name].noise)
    planned = plan_model(model, STIFF)
    here, there = model.winch, planned.winch
    size = model.scale[: here.size]
    # a tenth of the weight on the load, a tenth of the torque that holds it at the motor
    for k, amount in enumerate((0.1 * here.rest_tension, 0.1 * here.rest_torque)):
        state, torque = amount * here.resting[:, k], amount * here.steady[k]
        assert abs(float(here.payload @ state)) < 1e-9
        for winch in (here, there):
            ahead = winch.A @ state + winch.B[:, 0] * torque + amount * winch.from_constants[:, k]
            assert ahead / size == pytest.approx(state / size, abs=1e-8)
        assert there.steady[k] == pytest.approx(here.steady[k], rel=1e-6)
    # what pulls at the load pulls at the rope's lower end
    pulled = float(here.tension @ here.resting[:, 0]) + here.tension_from_constants[0]
    assert pulled == pytest.approx(-1.0, rel=1e-6)


def test_a_plan_on_the_rope_that_is_there_is_the_model_itself():
    model = prediction_model(sampled_winch(case_of("thesis-1975")))
    assert plan_model(model, 1.0) is model
    with pytest.raises(sh.InputError, match="stiffness"):
        replace(ROPE, stiffness=0.0)


def sea_found(doubt: float) -> float:
    """Norm of the sea's state, of covariance one, that a slow error of 5 cm is taken for."""
    weights = WEIGHTS["thesis-1975"]
    weights = replace(weights, noise=replace(weights.noise, unit=doubt))
    loop = loop_of("thesis-1975", weights, STIFF)
    A, B, C = _plant(loop.model)
    Ac, Bc, Cc, Dc = loop.controller
    closed = np.block([[A + B @ Dc @ C, B @ Cc], [Bc @ C, Ac]])
    omega, T = 0.05, loop.model.winch.sample_time
    error = np.zeros(len(MEASURED), dtype=np.complex128)
    error[MEASURED.index("mru.heave")] = 0.05
    error[MEASURED.index("mru.heave_rate")] = 0.05j * omega
    driven = np.concatenate([B @ Dc @ error, Bc @ error])
    x = np.linalg.solve(np.exp(1j * omega * T) * np.eye(len(closed)) - closed, driven)
    y, ahead = C @ x[: len(A)] + error, x[len(A) :]
    state = ahead + loop.model.gain @ (y - loop.model.C @ ahead)
    return float(np.linalg.norm(state[loop.model.sea_at]))


def test_a_slow_error_of_the_unit_is_not_taken_for_a_sea_of_thirty_deviations():
    assert sea_found(0.0) > 20.0
    assert sea_found(0.05) < 1.0


def test_a_slow_error_of_five_centimetres_that_nobody_spoke_of_does_not_lose_the_load():
    controller = controller_of("thesis-1975", 1.25)
    slow = {"noise_floor": 0.05, "noise_fraction": 0.0, "noise_bandwidth": 0.3}
    case = controller.case.replace({"sensors.mru": slow})
    run = sh.simulate(case, controller, seeds=[0], duration="4 min", settle=60.0)[0]
    assert run.statistics.value("tracking error rms") < 5e-3


@pytest.mark.ci
@pytest.mark.parametrize("mismatch", ["payload=-30%", "E=+30%"])
def test_a_lighter_load_or_a_stiffer_rope_makes_no_limit_cycle_where_the_drive_saturates(mismatch):
    from stillhook.comparison.mismatch import Mismatch

    controller = controller_of("thesis-1975-rope", 1.25, weights=ROPE)
    rms = []
    for text in (None, mismatch):
        case = Mismatch.read(text).apply(controller.case)
        run = sh.simulate(case, controller, seeds=[1], duration="4 min", settle=60.0)[0]
        rms.append(run.statistics.value("tracking error rms"))
    assert rms[1] < 2.0 * rms[0] < 0.02


@pytest.mark.ci
def test_only_who_knows_the_future_plans_on_the_rope_that_is_there():
    case = case_of("thesis-1975", 1.25)
    causal, told = (sh.LinearMPC(case, predictor=kind) for kind in ("kalman", "preview"))
    assert causal.weights.stiffness == STIFF
    plan, believed = (m.winch.data for m in (causal.model, causal.estimator.model))
    assert plan.axial_stiffness == pytest.approx(STIFF * believed.axial_stiffness)
    assert told.model is told.estimator.model


def test_the_model_shows_the_errors_that_a_unit_is_stated_with():
    stated = {"gain_error": 0.03, "phase_error": 0.04, "drift": 0.06, "drift_period": 50.0}
    case = case_of("thesis-1975", 1.25)
    exact, noisy, white = (
        prediction_model(sampled_winch(case.replace({"sensors.mru": unit})))
        for unit in ({"noise_floor": 0.0, "noise_fraction": 0.0}, stated, {"noise": 1e-4})
    )
    size = noisy.sea_at.stop
    at = slice(size, size + noisy.errors - 2)  # but for the slow one, of which nothing is said
    covariance = scipy.linalg.solve_discrete_lyapunov(
        noisy.A[at, at], (noisy.G[:, : noisy.known] @ noisy.G[:, : noisy.known].T)[at, at]
    )
    now = noisy.now[-2:, at]
    variances = np.diag(now @ covariance @ now.T)
    heave = 0.05**2 * np.diag(sea_covariance(noisy))
    slow = 2.0 * np.pi / 50.0
    assert variances == pytest.approx(heave + 0.06**2 * np.array([1.0, slow**2]), rel=1e-6)
    assert pytest.approx(exact.R, rel=1e-12) == noisy.R
    # White noise is one of the samples: N^2 w/(4 2^.5), and its differences over a sample.
    added = white.R - exact.R
    variance = 1e-8 * 20.0 * np.pi / (4.0 * np.sqrt(2.0))
    assert added[MEASURED.index("mru.heave")] == pytest.approx(variance, rel=1e-6)
    T, w = white.winch.sample_time, 20.0 * np.pi / np.sqrt(2.0)
    kept = np.exp(-w * T) * (np.cos(w * T) + np.sin(w * T))
    expected = 2.0 * variance * (1.0 - kept) / T**2
    assert added[MEASURED.index("mru.heave_rate")] == pytest.approx(expected, rel=1e-6)
    assert white.errors == exact.errors == 4


def sea_covariance(model: PredictionModel) -> np.ndarray:
    """Covariance of the hook's displacement and velocity in the model, (2, 2)."""
    at = model.sea_at
    added = (model.G @ model.G.T)[at, at]
    covariance = scipy.linalg.solve_discrete_lyapunov(model.A[at, at], added)
    return np.asarray(model.hook[:, at] @ covariance @ model.hook[:, at].T)
