"""The linear predictive controller: its programme, its answers, and what it never does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cvxpy_programme import oracle
from former_cases import load_case
from mpc_cases import WEIGHTS, case_of, controller_of, off
from sea_predictor import SeaPredictor

import models
import stillhook as sh
from models.case import bundled_cases
from models.operation import scenario_named
from models.operation.faults import with_faults
from models.plant import DriveLimits
from models.sensing import HEARD, Measurement
from models.simulation import prepare
from mpc.linear import WATCHED, LinearMPC, path_of_sea, sea_at_end
from mpc.programme import SoftQP, kkt_residual
from mpc.winch import ProcessNoise, Weights
from mpc.winch.regulation import feedback_row
from synth.controllers import VelocityFeedForward

_NAN = float("nan")
BUNDLED = [name for name, _ in bundled_cases()]


def state_of(controller: LinearMPC, rng: np.random.Generator, size: float) -> np.ndarray:
    model = controller.model
    chi = np.zeros(model.size)
    n = model.winch.size
    chi[:n] = size * rng.normal(size=n) * model.scale[:n]
    chi[model.sea_at] = rng.normal(size=model.sea.order)
    at = model.constants_at.start
    chi[at : at + 2] = rng.normal(size=2) * [1e4, 100.0]
    return chi


def question_of(controller: LinearMPC, chi: np.ndarray):
    _, gradient, free = controller.products.known(chi)
    speed = float(controller.model.winch.speed @ chi[: controller.model.winch.size])
    moves = len(controller.programme.blocks)
    low, high = controller.window.bounds(speed, np.zeros(moves), math.inf)
    return controller.programme.question(gradient, free, low, high), low, high


def simulated_cost(controller: LinearMPC, chi: np.ndarray, v: np.ndarray) -> tuple[float, dict]:
    """The cost of moves and the watched signals, by stepping the model sample by sample."""
    p, model, weights = controller.programme, controller.model, controller.regulator
    winch = model.winch
    d = p.unit * np.repeat(v, p.blocks)
    at = model.constants_at.start
    c = chi[at : at + 2]
    x, sea = chi[: winch.size], chi[model.sea_at]
    shown = model.hook[:, model.sea_at]
    over = model.A[model.sea_at, model.sea_at]
    cost, seen = 0.0, {}
    steady = winch.steady @ c
    of_force = winch.tension_from_constants @ c
    for j in range(p.steps):
        seen["speed", j] = winch.speed @ x
        feed = winch.tension_from_hook @ (shown @ sea)
        seen["tension", j] = winch.tension @ x + feed + of_force
        seen["command", j] = winch.back * (winch.speed @ x) + d[j] / winch.gain
        after = over @ sea
        ends = np.concatenate([shown @ sea, shown @ after])
        x = winch.A @ x + winch.B[:, 0] * d[j] + winch.from_hook @ ends + winch.from_constants @ c
        sea = after
        cost += weights.weights[1] * (d[j] - steady) ** 2
        if j + 1 < p.steps:
            cost += (winch.payload @ x) ** 2
    seen["speed", p.steps] = winch.speed @ x
    seen["tension", p.steps] = (
        winch.tension @ x + winch.tension_from_hook @ (shown @ sea) + of_force
    )
    zeta = np.concatenate([sea, c])
    cost += x @ weights.P @ x + 2.0 * x @ weights.N @ zeta
    return cost / p.cost, seen


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_programme_is_the_cost_of_stepping_the_model(name):
    controller = controller_of(name, horizon=2.0, predictor="kalman")
    rng = np.random.default_rng(0)
    chi = state_of(controller, rng, 1.0)
    (f, lower, _), _, _ = question_of(controller, chi)
    p, n = controller.programme, len(controller.programme.blocks)
    base, _ = simulated_cost(controller, chi, np.zeros(n))
    for _ in range(4):
        v = rng.normal(size=n)
        cost, seen = simulated_cost(controller, chi, v)
        assert 0.5 * v @ p.H @ v + f @ v == pytest.approx(cost - base, rel=1e-8, abs=1e-8 * base)
        rows = controller.programme.qp.rows @ v
        for k, (j, kind) in enumerate(zip(p.at, p.kind, strict=True)):
            # row + free response = signal, in units of its limit
            free = controller.programme.row_low[k] - lower[n + k]
            if WATCHED[kind] == "command" and not controller.model.winch.dc:
                continue
            wanted = seen[WATCHED[kind], j] * controller.programme.scale[k]
            assert rows[k] + free == pytest.approx(wanted, rel=1e-7, abs=1e-9)


def test_gradient_and_hessian_agree_with_finite_differences_of_the_cost():
    controller = controller_of("thesis-1975", horizon=1.0, predictor="kalman")
    chi = state_of(controller, np.random.default_rng(1), 1.0)
    (f, _, _), _, _ = question_of(controller, chi)
    n = len(f)
    for k in range(0, n, 3):
        e = np.zeros(n)
        e[k] = 0.5
        up, down = (simulated_cost(controller, chi, s * e)[0] for s in (1.0, -1.0))
        middle = simulated_cost(controller, chi, np.zeros(n))[0]
        assert up - down == pytest.approx(f[k], rel=1e-6, abs=1e-9)
        assert 4.0 * (up + down - 2.0 * middle) == pytest.approx(
            controller.programme.H[k, k], rel=1e-6
        )


@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope", "subsea-crane"])
def test_without_active_limits_it_is_the_linear_quadratic_regulator(name):
    controller = controller_of(name, horizon=3.0, blocking=(1,) * 60, predictor="kalman")
    rng = np.random.default_rng(2)
    for _ in range(20):
        chi = 1e-3 * state_of(controller, rng, 0.1)
        question, _, _ = question_of(controller, chi)
        solved = controller.qp.solve(*question)
        if (solved.multipliers != 0.0).any():
            continue
        wanted = -float(feedback_row(controller.regulator, controller.model) @ chi)
        assert solved.v[0] * controller.programme.unit == pytest.approx(wanted, rel=1e-6, abs=1e-6)
        break
    else:
        pytest.fail("every state was limited")


@pytest.mark.parametrize("name", BUNDLED)
def test_it_agrees_with_the_plain_statement_in_cvxpy(name):
    _compare_with_oracle(name, states=12, horizon=0.6)


@pytest.mark.ci
@pytest.mark.parametrize("name", BUNDLED)
def test_it_agrees_with_the_plain_statement_in_cvxpy_on_a_thousand_states(name):
    _compare_with_oracle(name, states=1000, horizon=1.0)


def _compare_with_oracle(name: str, *, states: int, horizon: float) -> None:
    """All moves are equal, to 1e-6 of the peak torque, wherever CVXPY has found the optimum.

    States are far off: some violate their limits a thousandfold, at prices that leave the residual
    of our answer 1e-5 where the moves are right to 1e-7.
    """
    weights = WEIGHTS.get(name, WEIGHTS["subsea-crane"])
    controller = LinearMPC(
        models.load_case(name), weights=weights, horizon=horizon, predictor="kalman"
    )
    plain, model = oracle(controller), controller.model
    p, winch = controller.programme, model.winch
    rng = np.random.default_rng(3)
    active = lost = 0
    ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], p.steps)
    for _ in range(states):
        chi = state_of(controller, rng, float(rng.choice([0.1, 0.5, 1.0])))
        question, low, high = question_of(controller, chi)
        solved = controller.qp.solve(*question)
        plain.state.value = chi[: winch.size]
        at = model.constants_at.start
        plain.constants.value = chi[at : at + 2]
        plain.path.value = (path_of_sea(model, p.steps) @ chi[model.sea_at]).reshape(-1, 2)
        plain.end.value = ahead @ chi[model.sea_at]
        plain.low.value, plain.high.value = low, high
        moves, residual = plain.solve()
        assert kkt_residual(controller.qp, *question, solved) < 1e-4
        if residual < 1e-9:
            np.testing.assert_allclose(solved.v, moves, rtol=0.0, atol=1e-6)
        lost += int(residual >= 1e-9)
        active += int((solved.multipliers != 0.0).any())
    assert active > states / 2
    assert lost <= 0.005 * states  # where Clarabel's answer is too far off to be finished


def test_states_far_from_any_sea_are_solved_within_half_of_the_iterations():
    """With 400 of them some had no answer."""
    controller = controller_of("thesis-1975-rope", 3.75)
    rng, taken = np.random.default_rng(0), []
    for _ in range(300):
        question, _, _ = question_of(controller, state_of(controller, rng, 3.0))
        solved = controller.qp.solve(*question)
        assert solved.ok
        taken.append(solved.iterations)
    assert 400 < max(taken) < 750


def test_a_soft_limit_that_costs_more_is_violated_less():
    controller = controller_of("thesis-1975", horizon=2.0, excursion=0.02)
    rng = np.random.default_rng(4)
    chi = state_of(controller, rng, 0.3)
    question, _, _ = question_of(controller, chi)
    rows, H = controller.programme.qp.rows, controller.programme.H
    n = len(H)
    beyond = []
    for price in (1e-8, 1e-4, 1.0):
        qp = SoftQP(H, rows, quadratic=price, linear=1e-2 * price)
        v = qp.solve(*question).v
        value = rows @ v
        over = np.maximum(value - question[2][n:], 0.0) + np.maximum(question[1][n:] - value, 0.0)
        beyond.append(float((over**2).sum()))
    assert beyond[0] > beyond[1] > beyond[2] > 0.0


def test_cold_and_warm_starts_agree():
    controller = controller_of("thesis-1975")
    rng = np.random.default_rng(5)
    for _ in range(50):
        question, _, _ = question_of(controller, state_of(controller, rng, 1.0))
        warm = controller.qp.solve(*question).v
        cold = SoftQP(
            controller.qp.H,
            controller.qp.rows,
            quadratic=controller.qp.quadratic,
            linear=controller.qp.linear,
        ).solve(*question)
        assert cold.v == pytest.approx(warm, abs=1e-9)


def test_the_path_tells_the_state_of_the_sea_at_its_end():
    controller = controller_of("thesis-1975", predictor="kalman")
    model = controller.model
    rng = np.random.default_rng(6)
    over = model.A[model.sea_at, model.sea_at]
    added = (model.G @ model.G.T)[model.sea_at, model.sea_at]
    root = np.linalg.cholesky(added + 1e-15 * np.eye(len(added)))
    known = controller.estimator.model.sea_covariance
    doubt = np.linalg.cholesky(known + 1e-12 * np.eye(len(known)))
    shown = model.hook[:, model.sea_at]
    from_path, from_sea = sea_at_end(model, 120, known)
    later = np.linalg.matrix_power(over, 40)
    errors, without = [], []
    for _ in range(300):
        sea, path = rng.normal(size=len(over)), []
        estimate = sea + doubt @ rng.normal(size=len(over))
        for j in range(121):
            if j > 0:
                sea = over @ sea + root @ rng.normal(size=len(over))
            path.append(shown @ sea)
        guess = from_path @ np.concatenate(path) + from_sea @ estimate
        blind = np.linalg.matrix_power(over, 120) @ estimate
        errors.append(float(shown[0] @ later @ (sea - guess)))
        without.append(float(shown[0] @ later @ (sea - blind)))
    # two seconds on, next to all that matters of the state is known
    assert np.std(errors) < 0.25 * np.std(without)


def run_of(controller: object, seconds: float = 120.0, case: object = None, **options: object):
    wanted = {"seeds": [1], "duration": seconds, "settle": 40.0, **options}
    return sh.simulate(controller.case if case is None else case, controller, **wanted).runs[0]  # type: ignore[arg-type]


def test_every_answer_of_a_saturated_run_is_optimal_and_within_the_drives_limits():
    controller = controller_of("thesis-1975", 2.43)
    worst, commands = 0.0, []

    class Watched:
        name, sample_time = controller.name, controller.sample_time
        foresee = staticmethod(controller.foresee)

        def reset(self) -> None:
            controller.reset()

        def step(self, measurement: Measurement, time: float) -> float:
            nonlocal worst
            command = controller.step(measurement, time)
            assert controller.question is not None
            assert controller.solved is not None
            worst = max(worst, kkt_residual(controller.qp, *controller.question, controller.solved))
            commands.append(command)
            return command

    run = sh.simulate(controller.case, Watched(), seeds=[1], duration=120.0, settle=40.0).runs[0]
    assert worst < 1e-6
    assert run.statistics.value("payload rms") < 0.4
    assert np.abs(commands).max() <= 805.0
    counts = controller.counts
    assert counts["fallback"] == counts["late"] == 0
    torque = run["motor.torque"]
    assert np.abs(torque).max() <= 11_880.0 * (1.0 + 1e-9)
    assert np.mean(np.abs(torque) > 11_000.0) > 0.2


def test_it_holds_where_the_thesis_loses_lock():
    case = case_of("thesis-1975", 1.25)
    controller = controller_of("thesis-1975", 1.25)
    free = {"limits": DriveLimits(torque=11_880.0), "lock_limit": 0.5}
    thesis = sh.simulate(
        case.replace({"winch.drive.speed": 1000.0, "winch.drive.voltage": None}),
        "feedback",
        seeds=[0],
        duration=240.0,
        settle=30.0,
        sample_time=0.005,
        **free,
    ).runs[0]
    ours = sh.simulate(case, controller, seeds=[0], duration=240.0, settle=30.0).runs[0]
    assert not math.isnan(thesis.statistics.value("lost lock at"))
    assert ours.statistics.value("payload rms") < 0.01


@pytest.mark.ci
def test_preview_beats_the_seas_own_forecast_and_that_beats_none():
    case = case_of("thesis-1975", 1.9)
    rms = {}
    for predictor in ("kalman", "preview", "ar"):
        controller = LinearMPC(case, weights=WEIGHTS["thesis-1975"], predictor=predictor)
        assert controller.name == {"kalman": "mpc"}.get(predictor, f"mpc-{predictor}")
        run = run_of(controller, 240.0, settle=120.0)
        rms[predictor] = run.statistics.value("payload rms")
    short = controller_of("thesis-1975", 1.9, horizon=1.0)
    rms["short"] = run_of(short, 240.0, settle=120.0).statistics.value("payload rms")
    assert rms["preview"] < 0.6 * rms["kalman"]
    assert rms["kalman"] < rms["short"]
    assert rms["ar"] < 3.0 * rms["kalman"]


def test_a_predictor_of_the_users_own_gives_what_the_name_gives():
    case = case_of("thesis-1975", 1.25)
    own = SeaPredictor(case, sample_time=0.05, horizon=8.0)
    controller = LinearMPC(case, weights=WEIGHTS["thesis-1975"], predictor=own)
    assert run_of(controller, 90.0).statistics.value("payload rms") < 0.03
    with pytest.raises(sh.InputError, match=r"must forecast 161 leads every 0\.05 s, got 81"):
        LinearMPC(
            case,
            weights=WEIGHTS["thesis-1975"],
            predictor=SeaPredictor(case, sample_time=0.05, horizon=4.0),
        )


def test_a_run_can_be_repeated_to_the_bit():
    controller = controller_of("thesis-1975", 2.43)
    first, again = run_of(controller, 60.0), run_of(controller, 60.0)
    assert np.array_equal(first["drive.command"], again["drive.command"])


@pytest.mark.parametrize("weight", [0.9, 1.1])
def test_a_load_of_another_weight_is_held_in_its_place(weight):
    controller = controller_of("thesis-1975", 0.5)
    weight_of = controller.case.payload.submerged_weight
    run = run_of(controller, 240.0, parameters={"payload.submerged_weight": weight * weight_of})
    last = run["payload.displacement"][len(run.time) // 2 :]
    assert abs(float(last.mean())) < 2e-3
    # counted from where it hangs at rest, it is the tension that is more than expected
    found = controller.estimator.state[controller.model.constants_at][3]
    assert found == pytest.approx((weight - 1.0) * weight_of, rel=0.05)


def test_the_rope_is_to_stay_tight_at_the_payload_with_its_least_weight():
    controller = controller_of("subsea-crane", 0.5)
    payload, winch = controller.case.payload, controller.model.winch
    low, high = controller.soft_limits["tension"]
    assert low == pytest.approx(-0.9 * 0.95 * payload.submerged_weight)
    assert high == math.inf
    # Where all moves together no piece of rope is stretched: the load alone pulls, by its drag.
    assert abs(winch.tension @ winch.moved[:, 0]) < 1e-3


def test_a_load_is_lowered_as_it_is_asked():
    case = case_of("subsea-crane")
    controller = controller_of("subsea-crane")
    runs = sh.simulate(
        case,
        controller,
        scenario="lower",
        options={"distance": 1.0, "speed": 0.1},
        seeds=[0],
        duration=120.0,
    )
    run = runs.runs[0]
    error = run["payload.displacement"] - run["reference.displacement"]
    assert run["reference.displacement"].min() < -0.9
    assert float(np.sqrt(np.mean(error**2))) < 0.02


def test_estimate_is_as_good_as_the_filter_says():
    controller = controller_of("thesis-1975", 1.0)
    states = []

    class Watched:
        name, sample_time = "watched", controller.sample_time

        def reset(self) -> None:
            controller.reset()

        def step(self, measurement: Measurement, time: float) -> float:
            command = controller.step(measurement, time)
            states.append(controller.estimator.state.copy())
            return command

    run = sh.simulate(
        controller.case, Watched(), seeds=[3], duration=300.0, settle=60.0, store_step=0.05
    ).runs[0]
    model, n = controller.model, controller.model.winch.size
    chi = np.array(states)
    hook = chi @ model.hook[0]
    payload = chi[:, :n] @ model.winch.payload
    later = slice(1200, None)
    believed = controller.estimator.model
    P = believed.covariance - believed.gain @ believed.C @ believed.covariance
    # The filter doubts more than is true here: it is better than it says, but not by much.
    said = math.sqrt(float(model.hook[0] @ P @ model.hook[0]))
    assert 0.1 * said < np.std((hook - run["hook.heave"])[later]) < 1.1 * said
    assert np.std((payload - run["payload.displacement"])[later]) < 1e-4
    # two seconds ahead: the error of the forecast is what its covariance says
    steps = 40
    for _ in range(steps):
        P = model.A @ P @ model.A.T + model.G @ model.G.T
    ahead = path_of_sea(model, steps)[2 * steps]
    error = (chi[:, model.sea_at] @ ahead)[1200:-steps] - run["hook.heave"][1200 + steps :]
    said = math.sqrt(float(model.hook[0] @ P @ model.hook[0]))
    assert np.std(error) == pytest.approx(said, rel=0.15)


def random_measurement(rng: np.random.Generator, controller: LinearMPC) -> Measurement:
    winch = controller.model.winch
    size = float(rng.choice([0.1, 1.0, 5.0]))
    values = {
        "payload.acceleration": rng.normal() * size,
        "payload.velocity": rng.normal() * size,
        "payload.displacement": rng.normal() * size,
        "payload.age": float(rng.choice([0.0, 0.0, 0.1, 3.0])),
        "payload.valid": float(rng.random() > 0.3),
        "mru.heave": rng.normal() * size,
        "mru.heave_rate": rng.normal() * size,
        "mru.valid": float(rng.random() > 0.1),
        "drum.haul": rng.normal() * size,
        "motor.speed": rng.normal() * 80.0,
        "rope.tension": winch.rest_tension * (1.0 + 0.3 * rng.normal()),
        "motor.torque": rng.normal() * 8000.0,
        "drive.applied": winch.rest_command + rng.normal() * 300.0,
    }
    for name in values:
        if rng.random() < 0.05:
            values[name] = float(rng.choice([_NAN, math.inf, -math.inf]))
    return Measurement.of(values)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_whatever_is_measured_every_command_is_finite_and_within_limits(name):
    controller = controller_of(name, thermal=True)
    rng = np.random.default_rng(7)
    winch, limits = controller.model.winch, DriveLimits.from_case(controller.case)
    steps = 10_000 if name == "thesis-1975" else 2_000
    for k in range(steps):
        if k % 50 == 0:
            controller.reset()
        command = controller.step(random_measurement(rng, controller), 0.05 * k)
        assert math.isfinite(command)
        assert abs(command) <= limits.voltage or not winch.dc
        torque = winch.torque(command, controller.estimator.speed) + winch.rest_torque
        # beyond the peak by no more than keeps the drive there to the end of the sample
        inside = abs(torque) <= 1.5 * limits.torque
        # beyond the speed that the voltage can brake, the drive cuts the rest
        assert inside or abs(command) == limits.voltage
    counts = controller.counts
    assert counts["steps"] == (k % 50) + 1


CRANE = models.load_case("subsea-crane")


class Failing:
    """A controller whose solver has no answer where `fails(time)`."""

    def __init__(self, controller, fails):
        self.name, self.sample_time = controller.name, controller.sample_time
        self._controller, self._fails, self._time = controller, fails, 0.0
        solve = controller.qp.solve
        controller.qp.solve = lambda *asked: replace(
            solve(*asked), flag=-1 if self._fails(self._time) else 1
        )

    @property
    def status(self):
        return self._controller.status

    def reset(self):
        self._controller.reset()

    def step(self, measurement, time):
        self._time = time
        return self._controller.step(measurement, time)


def test_without_an_answer_the_law_without_limits_goes_on_as_if_nothing_were():
    """Where nothing saturates the programme is that law: a drum that is held leaves 800 mm."""
    left = []
    for fails in (lambda time: False, lambda time: time > 30.0):
        controller = LinearMPC(CRANE, weights=WEIGHTS["subsea-crane"])
        run = run_of(Failing(controller, fails), 90.0, case=CRANE)
        left.append(run.statistics.value("tracking error rms"))
        counts, told = controller.counts, run.timings.statuses
        assert counts["fallback"] == told.get("fallback", 0)
    assert counts["fallback"] == counts["steps"] - 601
    assert left[1] < 1.2 * left[0]
    assert [event.text for event in run.events if event.kind == "controller"][-1].startswith(
        "the controller had no answer in time"
    )


def test_a_plan_that_the_limits_held_goes_on_for_a_second():
    """The law alone is cut off at the limits and swings: it leaves half a metre here."""
    controller = controller_of("thesis-1975", 1.9)
    rng = np.random.default_rng(3)
    failing = Failing(controller, lambda time: rng.random() < 0.2)
    left = run_of(failing, 120.0, case=controller.case).statistics.value("tracking error rms")
    assert controller.counts["fallback"] > 400
    assert left < 0.05


def test_a_controller_that_was_handed_in_takes_over_and_has_heard_everything():
    case = case_of("thesis-1975", 2.43)
    alone = VelocityFeedForward(case, sample_time=0.05)
    left = []
    for given in (None, VelocityFeedForward(case, sample_time=0.05)):
        controller = LinearMPC(case, weights=WEIGHTS["thesis-1975"], fallback=given)
        run = run_of(Failing(controller, lambda time: True), 90.0, case=case)
        left.append(run.statistics.value("tracking error rms"))
        assert controller.counts["fallback"] == controller.counts["steps"]
    usual = run_of(alone, 90.0, case=case).statistics.value("tracking error rms")
    assert left[1] == pytest.approx(usual, rel=1e-6)
    assert left[1] < 0.5 * left[0]
    with pytest.raises(sh.InputError, match=r"fallback must have the sample time 0.05 s, got 0.02"):
        LinearMPC(
            case,
            weights=WEIGHTS["thesis-1975"],
            fallback=VelocityFeedForward(case, sample_time=0.02),
        )


def test_a_deadline_that_is_missed_is_counted_and_the_drive_has_its_command():
    controller = controller_of("thesis-1975", 1.9, deadline=1e-7)
    run = run_of(controller, 20.0, settle=5.0)
    counts = controller.counts
    assert counts["fallback"] == counts["steps"] == run.timings.statuses["fallback"]
    assert run.completed


@pytest.mark.parametrize("extra", [0.02, 0.08, 0.3])
def test_telegrams_that_become_later_do_not_lose_the_load(extra):
    """The gain for telegrams of the usual age lost it, by 50 m; what is older than is remembered
    is not heard at all."""
    controller = LinearMPC(CRANE)
    late = replace(scenario_named("hold", CRANE), telemetry_delays=((50.0, 90.0, extra),))
    runs = sh.simulate(CRANE, controller, scenario=late, seeds=[1], duration=110.0, settle=50.0)
    assert runs[0].statistics.value("tracking error rms") < 0.05
    assert ("blind" in runs[0].timings.statuses) == (extra == 0.3)


def test_a_run_tells_how_long_its_controller_was_blind():
    controller = LinearMPC(CRANE, weights=WEIGHTS["subsea-crane"])
    runs = sh.simulate(
        CRANE,
        controller,
        scenario=replace(scenario_named("hold", CRANE), telemetry_outages=((50.0, 60.0),)),
        seeds=[1],
        duration=80.0,
        settle=20.0,
    )
    # Told after a second, and over with the first telegram.
    assert 170 <= runs[0].timings.statuses["blind"] <= 185
    assert controller.counts["blind"] == runs[0].timings.statuses["blind"]
    assert "the controller was blind for" in str(runs)


def test_the_thermal_budget_keeps_the_windings_within_their_rating():
    case = case_of("thesis-1975", 2.43).replace({"winch.motor.thermal_time_constant": "60 s"})
    hot = LinearMPC(case, weights=WEIGHTS["thesis-1975"])
    kept = LinearMPC(case, weights=WEIGHTS["thesis-1975"], thermal=True)
    rises = []
    for controller in (hot, kept):
        run = sh.simulate(case, controller, seeds=[0], duration=300.0, settle=30.0).runs[0]
        rises.append(float(run["motor.temperature"].max()) / case.winch.motor.temperature_rise)
    assert rises[0] > 1.15
    # never less than what holds the load: 1.2 times the static torque, squared over the rating
    assert rises[1] < 1.06


def test_the_torque_changes_no_faster_than_it_may():
    rate = 20_000.0
    controller = controller_of("thesis-1975", 1.9, torque_rate=rate, prove=True)
    free = controller_of("thesis-1975", 1.9)
    fastest = {}
    for one in (controller, free):
        heard: list[float] = []

        class Watched:
            name, sample_time = "watched", 0.05

            def reset(self) -> None:
                one.reset()  # noqa: B023

            def step(self, measurement: Measurement, time: float) -> float:
                command = one.step(measurement, time)  # noqa: B023
                heard.append(one._asked)  # noqa: B023
                return command

        sh.simulate(one.case, Watched(), seeds=[1], duration=90.0, settle=40.0)
        fastest["slow" if one is controller else "free"] = np.abs(np.diff(heard)).max() / 0.05
    assert fastest["slow"] <= rate * (1.0 + 1e-6)
    assert fastest["free"] > 2.0 * rate
    assert controller.counts["unproved"] == 0


def test_the_names_of_what_it_hears_are_those_of_the_simulator():
    assert len(HEARD) == len(set(HEARD))
    simulation = prepare(case_of("thesis-1975"), controller_of("thesis-1975"))
    assert simulation.controller.name == "mpc"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"sample_time": 0.0}, "sample_time must be above 0 s"),
        ({"horizon": 0.1}, "horizon must be in"),
        ({"blocking": (1, 0)}, "blocking must be whole numbers of at least 1"),
        ({"predictor": "crystal ball"}, "one of bank, kalman, ar, preview"),
        ({"excursion": -1.0}, "excursion must be above 0 m"),
        ({"deadline": 0.0}, "deadline must be above 0 s"),
        ({"torque_rate": 0.0}, "torque_rate must be above 0 N m/s"),
    ],
)
def test_bad_arguments_get_one_clear_sentence(options, text):
    with pytest.raises(sh.InputError, match=text):
        controller_of("thesis-1975", **options)


def test_moves_stay_below_the_breakdown_torque_at_the_planned_speeds() -> None:
    base = 60.0
    case = load_case("subsea-crane").variant(
        {"winch.motor.kind": "induction", "winch.motor.base_speed": base}
    )
    controller = LinearMPC(case, weights=WEIGHTS["subsea-crane"])
    speeds = np.full(len(controller.programme.blocks), 2.0 * base)
    low, high = controller.window.bounds(2.0 * base, speeds, math.inf)
    unit, rest = controller.programme.unit, controller.model.winch.rest_torque
    most = 2.5 * case.winch.drive.torque_continuous / 4.0
    assert most < case.winch.power_limit / (2.0 * base)
    assert high * unit + rest == pytest.approx(most, rel=1e-9)
    assert low * unit + rest == pytest.approx(-most, rel=1e-9)


def test_a_torque_limit_that_is_lower_than_told_is_learnt_and_told_of():
    case, seconds = case_of("thesis-1975", 1.9), 80.0
    true = off(case, torque=0.8)
    controller = controller_of("thesis-1975", 1.9)
    runs = sh.simulate(true, controller, seeds=[1], duration=seconds, settle=40.0)
    told = run_of(LinearMPC(true, weights=WEIGHTS["thesis-1975"]), seconds)
    run, peak = runs.runs[0], true.winch.drive.torque_peak
    assert controller.window.peak == pytest.approx(peak, rel=0.03)
    assert run.statistics.value("payload rms") < 1.5 * told.statistics.value("payload rms")
    assert run.timings.statuses["derated"] == controller.counts["derated"] > 1000
    assert any("less torque than its limits say" in event.text for event in run.events)
    # One that is as told is not thought to be any less.
    own = run_of(controller, seconds)
    assert controller.counts["derated"] == 0
    assert "derated" not in own.timings.statuses


def test_a_peak_is_learnt_from_what_is_followed_for_some_samples_and_probed():
    window, winch = controller_of("thesis-1975").window, controller_of("thesis-1975").model.winch
    told = window.peak
    asked = 0.2 * told / winch.gain  # left out, in volts

    def follow(torque: float, left_out: float, speed: float = 0.0, samples: int = 1) -> float:
        for _ in range(samples):
            window.follow(torque * told, left_out, speed)
        return window.peak / told

    assert follow(0.8, asked, samples=2) == 1.0  # a spike
    assert follow(0.8, 0.0) == 1.0
    assert follow(0.1, asked, samples=9) == 1.0  # the brake
    assert follow(-0.8, asked, samples=9) == 1.0  # more than asked, by another hand
    assert follow(0.8, _NAN, samples=9) == follow(_NAN, asked, samples=9) == 1.0
    assert follow(0.8, asked, 0.99 * window.limits.speed, samples=9) == 1.0  # near overspeed
    assert follow(-0.8, -asked, samples=3) == pytest.approx(0.8)
    assert window.derated
    unit, low, high = told / 11_880.0, *window.bounds(0.0, np.zeros(9), math.inf)
    rest = winch.rest_torque / told
    assert high == pytest.approx(unit * (0.8 - rest))
    assert low == pytest.approx(unit * (-0.8 - rest))
    assert follow(0.5, 0.0, samples=99) == pytest.approx(0.8)  # tells nothing
    assert 0.8 < follow(0.8, 0.0) < 0.82  # follows there: probed
    assert follow(0.9, asked, samples=4) == pytest.approx(0.9)
    assert follow(1.0, 0.0) == 1.0
    assert not window.derated


def test_half_the_power_is_no_lower_peak_and_the_load_is_held():
    """Taken for a torque it once was a peak that could not hold the load, which fell by metres."""
    controller = controller_of("subsea-crane")
    case, seconds = controller.case, 60.0
    faults = {"fault.at": 20.0, "fault.lasting": 60.0, "fault.power_limit": 0.5}
    halved = with_faults(scenario_named("hold", case), faults, case, seconds)
    options = {"scenario": halved, "seeds": [5], "settle": 20.0}
    run = run_of(controller, seconds, **options)
    window, told = controller.window, case.winch.power_limit
    assert np.abs(run["payload.displacement"]).max() < 0.05
    assert window.limits.power == pytest.approx(0.5 * told, rel=0.03)
    assert window.peak == case.winch.drive.torque_peak
    assert run["motor.speed"].min() > -0.5 * told / controller.model.winch.rest_torque
    assert controller.counts["derated"] > 100
    # The plan looks after the speed of lowering by what that power holds.
    assert window.lowering == pytest.approx(102.0, rel=0.03)
    controller.reset()
    assert window.limits.power == told
    assert not window.derated


def test_a_power_is_learnt_from_a_torque_that_falls_as_the_speed_rises_and_probed():
    window = controller_of("subsea-crane").window
    peak, told = window.peak, window.limits.power

    def short(torques: list[float], speeds: list[float], left_out: float = 1e3) -> None:
        for torque, speed in zip(torques, speeds, strict=True):
            window.follow(torque, left_out, speed)

    speeds = [-60.0, -70.0, -80.0]
    short([0.5 * told / abs(speed) for speed in speeds], speeds)
    assert (window.peak, window.limits.power) == (peak, pytest.approx(0.5 * told))
    short([0.5 * told / 70.0] * 3, [-70.0] * 3)  # the same limit, at a speed that stays
    assert window.peak == peak
    for _ in range(9):
        window.follow(0.0, 0.0, -70.0)  # tells nothing
    assert window.limits.power == pytest.approx(0.5 * told)
    window.follow(0.5 * told / 80.0, 0.0, -80.0)  # follows there: probed
    assert window.limits.power == pytest.approx(0.505 * told)
    short([0.8 * peak] * 3, [-30.0, -20.0, -10.0])  # the torque stays: that is the peak
    assert window.peak == pytest.approx(0.8 * peak)
    window.follow(told / 100.0, 0.0, -100.0)
    assert window.limits.power == told
    window.reset()
    # What is less than its weight is no peak: the plan would have no way to hold the load.
    short([0.32 * peak] * 3, [-30.0, -20.0, -10.0])
    assert window.peak == pytest.approx(controller_of("subsea-crane").model.winch.rest_torque)


@pytest.mark.parametrize("inertia", [1.3, 0.7])
def test_an_inertia_other_than_told_is_learnt_and_planned_with(inertia):
    case, seconds = case_of("thesis-1975", 1.9), 120.0
    true, weights = off(case, inertia=inertia), WEIGHTS["thesis-1975"]
    controller = controller_of("thesis-1975", 1.9)
    run = run_of(controller, seconds, case=true, settle=60.0)
    told = run_of(LinearMPC(true, weights=weights), seconds, settle=60.0)
    assert controller.inertia.ratio == pytest.approx(inertia, abs=0.03)
    assert run.statistics.value("payload rms") < 2.0 * told.statistics.value("payload rms")
    run_of(controller, 60.0)
    assert controller.inertia.ratio == pytest.approx(1.0, abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("height", [1.25, 1.9, 2.43, 3.75])
def test_a_drive_that_is_not_as_told_costs_less_than_a_factor_of_two(height):
    case, weights = case_of("thesis-1975", height), WEIGHTS["thesis-1975"]

    def left(true: models.Case, known: models.Case) -> float:
        controller = LinearMPC(known, weights=weights)
        runs = sh.simulate(true, controller, seeds=3, duration=360.0, settle=60.0).runs
        return math.sqrt(sum(run.statistics.value("payload rms") ** 2 for run in runs))

    for other in ({"inertia": 1.3}, {"inertia": 0.7}, {"torque": 0.8}):
        true = off(case, **other)
        assert left(true, case) < 2.0 * left(true, true), other


@pytest.mark.parametrize(
    ("name", "error"), [("thesis-1975", 0.01), ("thesis-1975-rope", 0.01), ("subsea-crane", 0.1)]
)
def test_the_inertia_of_a_case_is_found_to_be_what_it_is(name, error):
    controller = controller_of(name)
    run_of(controller, 60.0)
    assert controller.inertia.ratio == pytest.approx(1.0, abs=error)


def test_a_set_point_that_is_no_number_keeps_its_place_and_the_estimate():
    """One NaN once wiped the filter: the load moved by 1.8 m."""
    controller = controller_of("thesis-1975", 0.5)

    class Told:
        name, case, sample_time = "told", controller.case, controller.sample_time

        def reset(self):
            controller.reset()

        def step(self, measurement, time):
            values[:] = measurement.values  # one array for every sample, as a loop on a drive has
            at = HEARD.index("reference.displacement")
            values[at] = 1.0
            if 60.0 < time < 60.1 or 70.0 < time < 75.0:
                values[at : at + 2] = _NAN, 0.3
            states.append(controller.estimator.state.copy())
            return controller.step(Measurement(values), time)

    values = np.zeros(len(HEARD))
    states: list[np.ndarray] = []
    run = run_of(Told(), 120.0)
    late = run.time > 50.0
    assert np.abs(run["payload.displacement"][late] - 1.0).max() < 0.02
    assert controller.counts["fallback"] == 0
    assert min(np.abs(state).max() for state in states[400:]) > 0.0


def test_a_drive_that_holds_its_peak_is_no_surprise_to_the_filter(monkeypatch):
    """It gives more over a sample than the command that it is cut from, and the filter is told."""
    controller = controller_of("thesis-1975", 2.43)
    estimator, winch = controller.estimator, controller.model.winch
    at = HEARD.index("motor.speed")
    surprises: list[float] = []
    update = type(estimator).update

    def watched(self, measurement, applied=_NAN):
        state = update(self, measurement, applied=applied)
        if told:  # the drive has held its peak over the last sample
            surprises.append(float(measurement.values[at] - winch.speed @ before[0]))
        return state

    held = LinearMPC._held

    def noted(self, torque, speed):
        found = held(self, torque, speed)
        told[:] = [found] if math.isfinite(found) else []
        used = found if honest else _NAN
        # What the filter expects of the speed, once it knows what the drive has done.
        applied = used if math.isfinite(used) else shown_applied(self)
        ahead = estimator._ahead + estimator._B * winch.torque(applied, estimator.speed)
        before[0] = ahead[: winch.size]
        return used

    def shown_applied(self):
        return float(last[0].values[HEARD.index("drive.applied")])

    step = LinearMPC.step

    def stepped(self, measurement, time):
        last[0] = measurement
        return step(self, measurement, time)

    told: list[float] = []
    before: list[np.ndarray] = [np.zeros(winch.size)]
    last: list[Measurement] = [Measurement(np.zeros(len(HEARD)))]
    monkeypatch.setattr(type(estimator), "update", watched)
    monkeypatch.setattr(LinearMPC, "_held", noted)
    monkeypatch.setattr(LinearMPC, "step", stepped)
    rms = {}
    for honest in (True, False):
        surprises.clear()
        run_of(controller, 60.0, settle=20.0)
        assert len(surprises) > 20
        rms[honest] = float(np.std(surprises))
    assert rms[True] < 0.5 * rms[False]


@pytest.mark.ci
def test_what_is_learnt_of_the_hook_has_not_the_units_errors():
    """The load followed them: 53 mm on this unit of 5 cm, once the model was there."""
    case = models.load_case("landing")
    noise = ProcessNoise(force=0.0036, torque=0.0158, rope=0.0106, sensors=2.4e-4)
    controller = LinearMPC(case, weights=Weights(torque=0.025, noise=noise), predictor="ar")
    (run,) = sh.simulate(case, controller, seeds=[0], duration=140.0)
    learnt = run["payload.displacement"][run.time > 80.0]
    assert math.sqrt(float((learnt**2).mean())) < 0.02
