"""Programme, filter and controller of any linear plant, against statements of other kinds."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st
from stated_programme import stated

import mpc
from models import InputError, LinearPlant
from models.sensing import HEARD, Controller, Measurement
from mpc.programme import sampled

T = 0.2


def double_tank(**more) -> LinearPlant:
    """Two tanks in a row: inflow, a known flow into the lower one, and a leak of the upper."""
    return LinearPlant(
        A=[[-0.5, 0.0], [0.5, -0.2]],
        B=[[1.0], [0.0]],
        E=[[0.0, -1.0], [0.8, 0.0]],
        C=[[0.0, 1.0], [1.0, 0.0]],
        Cz=[[0.0, 1.0], [1.0, 0.0]],
        inputs=["pump"],
        disturbances=["rain", "leak"],
        measurements=["lower.seen", "upper.seen"],
        outputs=["lower", "upper"],
        **more,
    )


def random_plant(rng: np.random.Generator, n: int, nu: int, nd: int) -> LinearPlant:
    A = rng.normal(size=(n, n)) - 0.5 * np.eye(n)
    return LinearPlant(
        A=A,
        B=rng.normal(size=(n, nu)),
        E=rng.normal(size=(n, nd)),
        C=rng.normal(size=(2, n)),
        Cz=rng.normal(size=(3, n)),
        Dz=np.vstack([np.zeros((2, nu)), rng.normal(size=(1, nu))]),
        Fz=rng.normal(size=(3, nd)),
    )


def agrees(seed: int) -> None:
    """One random question, answered by the programme and by CVXPY's plain statement."""
    rng = np.random.default_rng(seed)
    n, nu, nd = int(rng.integers(1, 5)), int(rng.integers(1, 3)), int(rng.integers(0, 3))
    plant, steps = random_plant(rng, n, nu, nd), int(rng.integers(3, 9))
    blocking = None
    if rng.random() < 0.5:
        blocking = (1, *np.diff([1, *sorted(rng.choice(np.arange(2, steps), 1)), steps]).tolist())
    costs = {name: float(rng.uniform(0.5, 2.0)) for name in plant.outputs}
    costs |= {name: float(rng.uniform(0.05, 0.5)) for name in plant.inputs}
    costs |= {f"rate of {name}": float(rng.uniform(0.0, 0.02)) for name in plant.inputs[:1]}
    references = {name: rng.normal(size=steps + 1) for name in (*plant.outputs, *plant.inputs)}
    disturbances = {name: rng.normal(size=steps + 1) for name in plant.disturbances}
    previous = {name: float(rng.uniform(-0.5, 0.5)) for name in plant.inputs}
    terminal = {name: float(rng.uniform(0.0, 5.0)) for name in plant.outputs[:2]}
    limits = [(name, -1.0, float(rng.uniform(0.2, 1.0)), None) for name in plant.inputs]
    limits.append((f"rate of {plant.inputs[0]}", -6.0, 7.0, None))
    limits += [(name, -0.5, 0.7, (3.0, 20.0)) for name in plant.outputs[1:]]
    state = 0.5 * rng.normal(size=n)
    programme = mpc.Programme(
        plant,
        period=T,
        horizon=steps * T,
        costs=costs,
        constraints=[
            mpc.Constraint(signal=name, low=low, high=high, soft=price or False)
            for name, low, high, price in limits
        ],
        references=tuple(references),
        blocking=blocking,
        terminal=terminal,
    )
    plan = programme.solve(
        state, previous=previous, references=references, disturbances=disturbances
    )
    other = stated(
        plant,
        period=T,
        steps=steps,
        costs=costs,
        state=state,
        previous=previous,
        references=references,
        disturbances=disturbances,
        limits=limits,
        blocking=blocking,
        terminal=terminal,
    )
    assert plan.ok
    assert plan.residual < 1e-6
    assert plan.cost == pytest.approx(other.cost, rel=1e-6, abs=1e-9)
    for name, u in other.inputs.items():
        np.testing.assert_allclose(plan.inputs[name], u, atol=1e-5)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6))
def test_any_question_has_the_answer_of_its_plain_statement(seed):
    agrees(seed)


@pytest.mark.ci
def test_many_questions_have_the_answers_of_their_plain_statements():
    for seed in range(100):
        agrees(seed)


def test_what_comes_after_the_horizon_is_the_riccati_equations():
    plant = random_plant(np.random.default_rng(3), 3, 2, 0)
    costs = {"z1": 1.0, "z2": 2.0, "z3": 0.5, "u1": 0.1, "u2": 0.3}
    programme = mpc.Programme(
        plant,
        period=T,
        horizon=4 * T,
        costs=costs,
        constraints=[mpc.Constraint(signal="u1", low=-0.2, high=0.2)],
    )
    plan = programme.solve([1.0, -1.0, 0.5])
    other = stated(
        plant,
        period=T,
        steps=4,
        costs=costs,
        state=[1.0, -1.0, 0.5],
        previous={},
        references={},
        disturbances={},
        limits=[("u1", -0.2, 0.2, None)],
    )
    assert plan.solved.multipliers.any()
    assert plan.cost == pytest.approx(other.cost, rel=1e-6)
    np.testing.assert_allclose(plan.inputs["u1"], other.inputs["u1"], atol=1e-6)


@pytest.mark.parametrize("rates", [{}, {"rain": "level"}])
def test_without_limits_the_length_of_the_horizon_changes_nothing(rates):
    """The value function holds references, disturbances and offsets that last."""
    plant = double_tank()
    if rates:
        plant = LinearPlant(
            A=plant.A, B=plant.B, E=plant.E, C=plant.C, Cz=plant.Cz,
            disturbances=["level", "rain"], outputs=["lower", "upper"], inputs=["pump"],
            rates=rates,
        )  # fmt: skip
    costs = {"lower": 1.0, "pump": 0.1, "rate of pump": 0.03}
    first = []
    for steps in (2, 5, 40):
        programme = mpc.Programme(plant, period=T, horizon=steps * T, costs=costs)
        lasts = {plant.disturbances[0]: 0.7}
        plan = programme.solve(
            [0.3, -0.2],
            previous={"pump": 0.4},
            references={"lower": 1.5},
            disturbances=lasts,
            offsets={"pump": -0.3},
        )
        first.append(float(plan.inputs["pump"][0]))
    np.testing.assert_allclose(first, first[0], rtol=1e-8)


def test_what_acts_beside_an_input_is_a_disturbance_that_lasts():
    plant = double_tank()
    other = plant.with_disturbance("spill", {"x1": 1.0}, {})
    answers = []
    for made, told in (
        (plant, {"offsets": {"pump": 0.4}}),
        (other, {"disturbances": {"spill": 0.4}}),
    ):
        programme = mpc.Programme(
            made,
            period=T,
            horizon=5 * T,
            costs={"lower": 1.0, "pump": 0.1, "rate of pump": 0.5},
            constraints=[mpc.Constraint(signal="rate of pump", low=-0.4, high=0.5)],
        )
        plan = programme.solve([0.3, -0.2], previous={"pump": 0.2}, **told)
        answers.append(plan.inputs["pump"])
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-10)


def test_a_plan_is_what_becomes_of_the_plant():
    plant = random_plant(np.random.default_rng(5), 3, 2, 2)
    programme = mpc.Programme(
        plant,
        period=T,
        horizon=6 * T,
        costs={"z1": 1.0, "u1": 0.1, "u2": 0.1},
        constraints=[mpc.Constraint(signal="u1", low=-0.3, high=0.3)],
        blocking=(1, 2, 3),
    )
    rain = np.array([1.0, 0.0, -1.0])  # and no more: the last one holds on
    plan = programme.solve([1.0, 0.0, -1.0], disturbances={"w1": rain, "w2": 0.5})
    assert all(u[1] == u[2] and u[3] == u[4] == u[5] for u in plan.inputs.values())
    w1 = np.array([1.0, 0.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    A, BE, *_ = scipy.signal.cont2discrete(
        (plant.A, np.hstack([plant.B, plant.E]), np.eye(3), np.zeros((3, 4))), T
    )
    x = np.array([1.0, 0.0, -1.0])
    for j in range(6):
        u, w = np.array([v[j] for v in plan.inputs.values()]), np.array([w1[j], 0.5])
        shown = plant.Cz @ x + plant.Dz @ u + plant.Fz @ w
        np.testing.assert_allclose([plan.outputs[f"z{k}"][j] for k in (1, 2, 3)], shown, atol=1e-9)
        x = A @ x + BE @ np.concatenate([u, w])
    np.testing.assert_allclose(plan.states[-1][:3], x, atol=1e-9)
    assert math.isnan(plan.outputs["z3"][-1])  # it depends on an input that is not planned
    assert math.isfinite(plan.outputs["z1"][-1])


def test_a_motion_that_comes_with_its_rate_is_followed_within_the_sample():
    plant = LinearPlant(
        A=[[0.0, 1.0], [-4.0, -0.4]], B=[[0.0], [1.0]], E=[[0.0, 0.0], [4.0, 0.4]],
        C=[[1.0, 0.0]], disturbances=["ground", "ground.rate"], rates={"ground.rate": "ground"},
    )  # fmt: skip
    programme_plant = LinearPlant(
        A=plant.A, B=plant.B, E=plant.E, C=plant.C, Cz=[[1.0, 0.0]], outputs=["place"],
        disturbances=plant.disturbances, rates=plant.rates,
    )  # fmt: skip
    programme = mpc.Programme(
        programme_plant, period=T, horizon=20 * T, costs={"place": 1e-6, "u1": 1.0},
        references=["place", "u1"],
    )  # fmt: skip
    t = T * np.arange(21)
    moved = {"ground": np.sin(3.0 * t), "ground.rate": 3.0 * np.cos(3.0 * t)}
    plan = programme.solve([0.0, 0.0], disturbances=moved)
    fine = np.arange(0.0, 20 * T + 1e-9, T / 400)
    push = 4.0 * np.sin(3.0 * fine) + 0.4 * 3.0 * np.cos(3.0 * fine)
    system = scipy.signal.StateSpace(plant.A, [[0.0], [1.0]], plant.C, [[0.0]])
    true = scipy.signal.lsim(system, push, fine)[1][::400]
    assert np.abs(plan.outputs["place"] - true).max() < 2e-3
    # A rate that is not told is that of the path.
    other = programme.solve([0.0, 0.0], disturbances={"ground": moved["ground"]})
    assert 0.0 < np.abs(other.outputs["place"] - true).max() < 0.1


def test_multipliers_are_what_a_looser_limit_would_save():
    def cost(more: float = 0.0, lower: float = 0.0, at_most: float = 0.0, steep: float = 0.0):
        programme = mpc.Programme(
            double_tank(),
            period=T,
            horizon=8 * T,
            costs={"lower": 1.0, "pump": 0.01},
            constraints=[
                mpc.Constraint(signal="pump", low=-0.5 + lower, high=0.9 + more),
                mpc.Constraint(signal="rate of pump", high=3.0 + steep),
                mpc.Constraint(signal="upper", high=0.6 + at_most, soft=(0.5, 2.0)),
            ],
        )
        return programme.solve([1.5, -1.0], references={"lower": 1.0})

    plan, e = cost(), 1e-5
    for name, change in (("pump", "more"), ("upper", "at_most"), ("rate of pump", "steep")):
        slope = (cost(**{change: e}).cost - cost(**{change: -e}).cost) / (2.0 * e)
        pushes = plan.multipliers[name]
        assert slope == pytest.approx(-pushes[pushes > 0.0].sum(), rel=1e-4, abs=1e-8)
    assert plan.multipliers["upper"].any()
    assert plan.status == "optimal, beyond soft limits"


def test_rates_are_limited_from_the_input_before_on():
    programme = mpc.Programme(
        double_tank(),
        period=T,
        horizon=10 * T,
        costs={"lower": 1.0, "pump": 1e-4},
        constraints=[mpc.Constraint(signal="rate of pump", low=-1.0, high=0.5)],
    )
    plan = programme.solve([0.0, 0.0], previous={"pump": 0.7}, references={"lower": 3.0})
    steps = np.diff([0.7, *plan.inputs["pump"]]) / T
    np.testing.assert_allclose(steps[:4], 0.5, atol=1e-8)
    assert steps.min() >= -1.0 - 1e-8
    assert plan.outputs["rate of pump"][:-1] == pytest.approx(steps)


def test_a_soft_limit_gives_way_only_where_it_must_and_less_at_a_higher_price():
    def beyond(price) -> float:
        programme = mpc.Programme(
            double_tank(),
            period=T,
            horizon=20 * T,
            costs={"lower": 1.0, "pump": 0.01},
            constraints=[
                mpc.Constraint(signal="pump", low=-1.0, high=1.0),
                mpc.Constraint(signal="upper", high=0.8, soft=price),
            ],
        )
        plan = programme.solve([1.5, 0.0], references={"lower": 2.0})
        return float(np.maximum(plan.outputs["upper"][1:] - 0.8, 0.0).sum())

    free, cheap, dear, usual = (beyond(p) for p in ((1e-9, 1e-9), (0.1, 0.1), (10.0, 10.0), True))
    assert free > 1.1 * cheap > 1.1 * dear
    # What cannot be helped: all of the pump, downwards.
    forced = beyond((1e6, 1e6))
    assert usual == pytest.approx(forced, rel=1e-6)
    assert dear == pytest.approx(forced, rel=1e-2)


def test_blocks_of_one_are_no_blocks_and_longer_ones_cost_more():
    def plan(blocking):
        programme = mpc.Programme(
            double_tank(),
            period=T,
            horizon=8 * T,
            costs={"lower": 1.0, "pump": 0.01},
            constraints=[mpc.Constraint(signal="pump", low=-1.0, high=1.0)],
            blocking=blocking,
        )
        return programme.solve([0.0, 0.0], references={"lower": 0.4})

    free, ones, few = plan(None), plan((1,) * 8), plan((1, 3, 4))
    assert ones.cost == free.cost
    assert few.cost > free.cost * (1.0 + 1e-6)
    assert set(np.diff(few.inputs["pump"]).nonzero()[0]) <= {0, 3}


def simulate(controller, plant, *, steps, signals, unknown=None, noise=0.0, x=None, seed=0):
    """The plant under a controller, sampled by SciPy; outputs and commands at each sample."""
    nu, n = len(plant.inputs), len(plant.A)
    everything = np.hstack([plant.B, plant.E])
    A, BE, *_ = scipy.signal.cont2discrete(
        (plant.A, everything, np.eye(n), np.zeros((n, everything.shape[1]))), controller.sample_time
    )
    rng, x = np.random.default_rng(seed), np.zeros(n) if x is None else np.array(x)
    seen, commands = [], []
    controller.reset()
    for k in range(steps):
        told = signals(k)
        w = np.array([(unknown or {}).get(name, 0.0) for name in plant.disturbances])
        w += [float(np.ravel(told.get(name, 0.0))[0]) for name in plant.disturbances]
        y = plant.C @ x + noise * rng.normal(size=len(plant.C))
        heard = dict(zip(plant.measurements, y.tolist(), strict=True)) | told
        u = np.atleast_1d(controller.step(heard, k * controller.sample_time))
        seen.append(plant.Cz @ x)
        commands.append(u)
        push = np.array([(unknown or {}).get(name, 0.0) for name in plant.inputs])
        x = A @ x + BE @ np.concatenate([u + push, w])
    assert len(u) == nu
    return np.array(seen), np.array(commands)


def tank_controller(constants, **options) -> mpc.PredictiveController:
    plant = double_tank()
    options = {
        "period": T,
        "horizon": 20 * T,
        "costs": {"lower": 1.0, "pump": 0.02},
        "constraints": [mpc.Constraint(signal="pump", low=-3.0, high=3.0)],
        **options,
    }
    noise = {"lower.seen": 0.01, "upper.seen": 0.01, "pump": 0.05, "leak": 0.05}
    return mpc.PredictiveController(
        mpc.Programme(plant, **options),
        mpc.KalmanFilter(plant, period=options["period"], noise=noise, constants=constants),
    )


@pytest.mark.parametrize("which", ["leak", "pump", "rain"])
def test_a_constant_that_nobody_told_of_leaves_no_error(which):
    def error(constants):
        controller = tank_controller(constants)
        seen, _ = simulate(
            controller,
            controller.kalman.plant,
            steps=600,
            signals=lambda k: {"reference of lower": 1.0, "rain": 0.1},
            unknown={which: 0.6},
        )
        return float(seen[-1, 0] - 1.0), controller

    off, controller = error({which: 0.1})
    assert abs(off) < 1e-6
    assert controller.kalman.constants[which] == pytest.approx(0.6, abs=1e-6)
    assert controller.status == "engaged"
    assert abs(error({})[0]) > 1e-2


def test_preview_lowers_the_cost():
    rain = np.zeros(300)
    rain[60:90] = 1.5

    def cost(ahead: int) -> float:
        controller = tank_controller({})
        seen, commands = simulate(
            controller,
            controller.kalman.plant,
            steps=250,
            signals=lambda k: {"rain": rain[k : k + ahead], "reference of lower": 0.0},
        )
        return float((seen[:, 0] ** 2).sum() + 0.02 * (commands[:, 0] ** 2).sum())

    now, some, all_of_it = cost(1), cost(5), cost(21)
    assert all_of_it < some < now
    assert all_of_it < 0.7 * now


def test_a_reference_that_is_no_number_keeps_its_place_and_what_is_not_heard_is_left_out():
    controller = tank_controller({"leak": 0.1})

    def signals(k):
        told = {"reference of lower": 1.0 if k < 200 else math.nan}
        if 220 < k < 260:
            told |= {"lower.seen": math.nan, "upper.seen": math.inf}
        if k == 259:
            statuses.append(controller.status)
        return told

    statuses: list[str] = []
    seen, _ = simulate(
        controller, controller.kalman.plant, steps=300, signals=signals, unknown={"leak": 0.3}
    )
    np.testing.assert_allclose(seen[199:, 0], 1.0, atol=1e-3)
    assert statuses == ["blind"]
    assert controller.status == "engaged"


def test_two_inputs_are_commanded_together_and_the_protocol_is_that_of_all_controllers():
    plant = random_plant(np.random.default_rng(8), 3, 2, 1)
    programme = mpc.Programme(
        plant, period=T, horizon=10 * T, costs={"z1": 1.0, "z2": 1.0, "u1": 0.1, "u2": 0.1}
    )
    kalman = mpc.KalmanFilter(
        plant, period=T, noise={"y1": 0.1, "y2": 0.1, "w1": 0.1, "u1": 0.1, "u2": 0.1}
    )
    controller = mpc.PredictiveController(programme, kalman, name="mine")
    assert isinstance(controller, Controller)
    assert (controller.name, controller.sample_time) == ("mine", T)
    command = controller.step({"y1": 0.3, "y2": -0.1}, 0.0)
    assert command.shape == (2,)
    # Told as a winch's sensors are, its names are not among them: nothing was heard.
    controller.reset()
    assert not controller.step(Measurement(np.ones(len(HEARD))), 0.0).any()


def test_where_there_is_no_answer_the_law_without_limits_is_cut_off_or_another_commands():
    walls = [
        mpc.Constraint(signal="pump", low=-1.0, high=1.0),
        mpc.Constraint(signal="upper", low=-0.2, high=0.2),
    ]
    controller = tank_controller({}, constraints=walls)
    far = {"upper.seen": 30.0, "lower.seen": 30.0}
    assert controller.step(far, 0.0) == -1.0
    assert controller.status == "fallback"
    assert controller.plan.status.startswith("infeasible")
    assert controller.step({"upper.seen": 0.0, "lower.seen": 0.0}, T) is not None

    class Other:
        name, sample_time = "other", T

        def reset(self):
            heard.clear()

        def step(self, signals, time):
            heard.append(time)
            return 0.123

    heard: list[float] = []
    handed = mpc.PredictiveController(controller.programme, controller.kalman, fallback=Other())
    assert handed.step(far, 0.0) == 0.123
    handed.kalman.reset()
    assert handed.step({"upper.seen": 0.0, "lower.seen": 0.0}, T) != 0.123
    assert heard == [0.0, T]


def test_everything_is_told_as_it_is_about_the_operating_point():
    rest = {"pump": 2.0, "lower": 5.0, "upper": 3.0, "lower.seen": 5.0, "upper.seen": 3.0}
    rest |= {"rain": 0.4}
    about = double_tank(static=rest)
    noise = {"lower.seen": 0.01, "upper.seen": 0.01, "pump": 0.05, "leak": 0.05}
    answers = []
    for plant, at in ((double_tank(), {}), (about, rest)):

        def off(name, at=at):
            return at.get(name, 0.0)

        programme = mpc.Programme(
            plant,
            period=T,
            horizon=10 * T,
            costs={"lower": 1.0, "pump": 0.02},
            constraints=[
                mpc.Constraint(signal="pump", low=-0.5 + off("pump"), high=0.5 + off("pump")),
                mpc.Constraint(
                    signal="upper",
                    low=-9.0 + off("upper"),
                    high=0.6 + off("upper"),
                    soft=(1.0, 1.0),
                ),
            ],
        )
        kalman = mpc.KalmanFilter(plant, period=T, noise=noise, constants={"leak": 0.1})
        controller = mpc.PredictiveController(programme, kalman)
        for k in range(5):
            command = controller.step(
                {
                    "lower.seen": 0.2 + 0.1 * k + off("lower.seen"),
                    "upper.seen": 0.4 + off("upper.seen"),
                    "rain": 0.3 + off("rain"),
                    "reference of lower": 1.0 + off("lower"),
                },
                k * T,
            )
        plan = controller.plan
        answers.append([command - off("pump"), plan.cost, plan.outputs["lower"][3] - off("lower")])
    np.testing.assert_allclose(answers[0], answers[1], rtol=1e-9)


# The filter --------------------------------------------------------------------------------------


def test_the_gain_in_the_end_is_that_of_scipys_riccati_equation():
    plant = double_tank()
    noise = {"lower.seen": 0.02, "upper.seen": 0.1, "pump": 0.3, "x2": 0.05}
    kalman = mpc.KalmanFilter(plant, period=T, noise=noise)
    A, B, _ = sampled(plant, T)
    Q = 0.09 * B @ B.T + np.diag([0.0, 0.05**2])
    R = np.diag([0.02**2, 0.1**2])
    P = scipy.linalg.solve_discrete_are(A.T, plant.C.T, Q, R)
    gain = P @ plant.C.T @ np.linalg.inv(plant.C @ P @ plant.C.T + R)
    state = kalman.step({"lower.seen": 1.0, "upper.seen": -2.0})
    np.testing.assert_allclose(state, gain @ [1.0, -2.0], rtol=1e-7)


@pytest.mark.parametrize("late", [0.0, T, 3 * T])
def test_late_measurements_tell_of_earlier_times(late):
    """A known push on a plant without noise: whoever gets the time right is right from then on."""
    plant = double_tank(delays=[late, 0.0], D=[[0.3], [0.0]], F=[[0.1, 0.0], [0.0, 0.0]])
    noise = {"lower.seen": 1e-3, "upper.seen": 1e3, "pump": 0.1, "leak": 0.1}
    kalman = mpc.KalmanFilter(plant, period=T, noise=noise)
    A, B, from_path = sampled(double_tank(), T)
    behind, shown, x = round(late / T), [], np.array([1.0, -0.5])
    before = 0.0
    for k in range(200):
        u, rain = math.sin(0.3 * k), math.cos(0.2 * k)
        shown.append(x[1] + 0.3 * before + 0.1 * rain)
        reading = {"lower.seen": shown[-1 - behind]} if k >= behind else {}
        state = kalman.step(reading, {"pump": before}, {"rain": rain})
        true = x
        x = A @ x + B[:, 0] * u + from_path[:, 0] * rain
        before = u
    np.testing.assert_allclose(state, true, atol=2e-5)


def test_a_delay_between_two_samples_is_met_in_between():
    off = []
    for told in (0.3, 0.2, 0.4):
        plant = double_tank(delays=[told, told])
        noise = {"lower.seen": 0.01, "upper.seen": 0.01, "pump": 0.1, "leak": 0.1}
        kalman = mpc.KalmanFilter(plant, period=T, noise=noise)
        fine, sub = T / 20, round(0.3 / (T / 20))
        A, B, _ = sampled(double_tank(), fine)
        x, xs, before, errors = np.zeros(2), [], 0.0, []
        for k in range(150):
            u = math.sin(0.5 * k)
            then = xs[-sub] if len(xs) >= sub else np.zeros(2)
            state = kalman.step({"lower.seen": then[1], "upper.seen": then[0]}, {"pump": before})
            errors.append(np.abs(state - x).max())
            for _ in range(20):
                xs.append(x)
                x = A @ x + B[:, 0] * u
            before = u
        off.append(max(errors[50:]))
    assert off[0] < 0.25 * min(off[1:])


def test_an_estimate_is_as_good_as_its_covariance_says():
    plant, rng = double_tank(), np.random.default_rng(2)
    sizes = {"lower.seen": 0.05, "upper.seen": 0.2, "pump": 0.3, "leak": 0.2}
    kalman = mpc.KalmanFilter(plant, period=T, noise=sizes)
    A, B, from_path = sampled(plant, T)
    held = np.hstack([B, from_path[:, 1:2]])
    x, errors = np.zeros(2), []
    for k in range(20_000):
        y = plant.C @ x + [0.05, 0.2] * rng.normal(size=2)
        heard = {"lower.seen": y[0]} | ({"upper.seen": y[1]} if k % 3 else {})
        errors.append(kalman.step(heard) - x)
        x = A @ x + held @ ([0.3, 0.2] * rng.normal(size=2))
    # A third of the readings of one are missing: between the steady covariances with and without.
    Q = held @ np.diag([0.09, 0.04]) @ held.T
    said = []
    for rows in ([0, 1], [0]):
        C, R = plant.C[rows], np.diag(np.array([0.05, 0.2])[rows] ** 2)
        P = scipy.linalg.solve_discrete_are(A.T, C.T, Q, R)
        said.append(np.diag(P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P)))
    found = np.var(errors[100:], axis=0)
    assert (0.95 * said[0] < found).all()
    assert (found < 1.05 * said[1]).all()


def test_an_unstable_plant_that_nobody_hears_of_for_long_is_found_again():
    plant = LinearPlant(A=[[2.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], Cz=[[1.0]])
    kalman = mpc.KalmanFilter(plant, period=T, noise={"y1": 0.01, "w1": 0.1})
    for _ in range(3000):
        kalman.step({})
    assert kalman.blind == 3000
    for _ in range(10):
        state = kalman.step({"y1": 0.5}, {"u1": -1.0})  # which holds it there
    assert state[0] == pytest.approx(0.5, abs=1e-3)


# What is refused ---------------------------------------------------------------------------------

PUSHED = {"period": T, "horizon": 10 * T, "costs": {"lower": 1.0, "pump": 0.1}}
UNREACHED = LinearPlant(
    A=[[0.5, 0.0], [0.0, -1.0]], B=[[0.0], [1.0]], E=[[1.0], [0.0]], C=np.eye(2), Cz=np.eye(2)
)
CART = LinearPlant(
    A=[[0.0, 1.0], [0.0, 0.0]], B=[[0.0], [1.0]], E=[[0.0], [1.0]], C=np.eye(2), Cz=np.eye(2)
)


@pytest.mark.parametrize(
    ("plant", "changes", "text"),
    [
        (None, {"period": 0.0}, "programme: period must be above 0 s, got 0.0"),
        (None, {"horizon": 0.0}, r"programme: horizon must be in \[0.2, 400\] s, got 0.0"),
        (None, {"horizon": 0.5}, "must be a whole number of periods of 0.2 s, got 0.5 s"),
        (None, {"costs": {"middle": 1.0, "pump": 1.0}}, "no output, input or rate 'middle'"),
        (None, {"costs": {"lower": 1.0, "pump": -1.0}}, "cost of pump must be at least 0, got -1"),
        (None, {"costs": {"lower": 1.0}}, "must weigh every input or its rate, got none for pump"),
        (None, {"references": ["upper"]}, "no output or input with a cost 'upper'"),
        (None, {"blocking": (5, 4)}, r"at least 1 with the sum 10, got \(5, 4\)"),
        (None, {"blocking": (10, 0)}, "blocking must be whole numbers of at least 1"),
        (None, {"terminal": {"upper": 1.0}}, r"no output with a cost \(in terminal\) 'upper'"),
        (None, {"terminal": {"pump": 1.0}}, "outputs that no input acts on at once, got 'pump'"),
        (None, {"sizes": {"rain": 1.0}}, r"no input \(in sizes\) 'rain'"),
        (None, {"constraints": [("middle", 0.0, 1.0)]}, "no output, input or rate 'middle'"),
        (
            None,
            {"constraints": [("pump", 0.0, 1.0), ("pump", 2.0, 3.0)]},
            "constraints of pump must not exclude each other",
        ),
        (
            UNREACHED,
            {"costs": {"z1": 1.0, "u1": 1.0}},
            r"inputs \(u1\) must reach every mode .* one at s = 0.5 1/s",
        ),
        (
            CART,
            {"costs": {"z2": 1.0, "u1": 1.0}},
            "without a terminal cost costs must tell of every mode .* one at s = 0 1/s",
        ),
        (
            LinearPlant(A=[[5.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], Cz=[[1.0]]),
            {"costs": {"z1": 1.0, "u1": 1.0}, "horizon": 20 * T},
            r"horizon must be at most 3.68 s, over which the unstable plant grows 1e\+08 times",
        ),
    ],
)
def test_what_a_programme_cannot_be_made_of_gets_one_clear_sentence(plant, changes, text):
    limits = [
        mpc.Constraint(signal=name, low=low, high=high)
        for name, low, high in changes.pop("constraints", ())
    ]
    with pytest.raises(InputError, match=text):
        mpc.Programme(plant or double_tank(), **(PUSHED | changes), constraints=limits)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"low": 2.0, "high": 1.0}, "upper must have low <= high, got 2 and 1"),
        ({"low": math.nan, "high": 1.0}, "upper must have low <= high, got nan and 1"),
        ({"low": math.inf}, "upper must have low <= high"),
        ({}, "upper must have a finite limit, got none"),
        ({"high": 1.0, "soft": (0.0, 1.0)}, "price must be above 0, got 0.0"),
    ],
)
def test_a_constraint_that_is_none_is_refused(given, text):
    with pytest.raises(InputError, match=f"constraint: {text}"):
        mpc.Constraint(signal="upper", **given)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"state": [1.0]}, r"state must be 2 numbers, got \(1,\)"),
        ({"state": [1.0, math.nan]}, "state must be finite numbers, got nan at index 1"),
        ({"previous": {"rain": 1.0}}, r"no input \(in previous\) 'rain'"),
        ({"previous": {"pump": math.inf}}, "previous pump must be a finite number, got inf"),
        ({"offsets": {"lower": 1.0}}, r"no input \(in offsets\) 'lower'"),
        ({"references": {"upper": 1.0}}, "no reference 'upper'; there are: lower"),
        ({"references": {"lower": [1.0, math.nan]}}, "reference lower must be finite"),
        ({"disturbances": {"snow": 1.0}}, "no disturbance 'snow'; there are: rain, leak"),
        ({"disturbances": {"rain": []}}, "disturbance rain must be at least one number"),
    ],
)
def test_what_cannot_be_asked_gets_one_clear_sentence(given, text):
    programme = mpc.Programme(double_tank(), **PUSHED)
    with pytest.raises(InputError, match=f"programme: .*{text}"):
        programme.solve(given.pop("state", [0.0, 0.0]), **given)


HEARS = {"lower.seen": 0.1, "upper.seen": 0.1, "pump": 0.1}


@pytest.mark.parametrize(
    ("plant", "given", "text"),
    [
        (None, {"period": -1.0}, "period must be above 0 s, got -1.0"),
        (None, {"noise": {"lower.seen": 0.1}}, "noise of upper.seen must be above 0, got None"),
        (None, {"noise": HEARS | {"lower": 1.0}}, "no measurement, input, disturbance or state"),
        (None, {"noise": HEARS | {"leak": -1.0}}, "noise of leak must be at least 0, got -1"),
        (None, {"constants": {"lower": 1.0}}, r"no input or disturbance \(in constants\) 'lower'"),
        (None, {"constants": {"leak": -1.0}}, "drift of leak must be at least 0, got -1"),
        (
            None,
            {"constants": {"leak": 0.1, "rain": 0.1, "pump": 0.1}},
            r"measurements \(lower.seen, upper.seen\) must tell of every mode .* s = 0 1/s",
        ),
        (None, {"constants": {"leak": 0.0}}, "noise must reach every mode .* one at s = 0 1/s"),
        (CART, {"noise": {"y1": 0.1, "y2": 0.1}}, "noise must reach every mode"),
    ],
)
def test_what_a_filter_cannot_be_made_of_gets_one_clear_sentence(plant, given, text):
    with pytest.raises(InputError, match=f"Kalman filter: .*{text}"):
        mpc.KalmanFilter(plant or double_tank(), **({"period": T, "noise": HEARS} | given))


def test_a_filter_refuses_what_it_does_not_know():
    kalman = mpc.KalmanFilter(double_tank(), period=T, noise=HEARS)
    with pytest.raises(InputError, match="Kalman filter: there is no measurement 'lower'"):
        kalman.step({"lower": 1.0})
    with pytest.raises(InputError, match="Kalman filter: there is no input 'rain'"):
        kalman.step({}, {"rain": 1.0})
    with pytest.raises(InputError, match="Kalman filter: disturbance rain must be a finite"):
        kalman.step({}, {}, {"rain": math.nan})


def test_programme_filter_and_fallback_have_to_fit():
    programme = mpc.Programme(double_tank(), **PUSHED)
    with pytest.raises(InputError, match=r"filter must have the sample time 0.2 s, got 0.1 s"):
        mpc.PredictiveController(
            programme, mpc.KalmanFilter(double_tank(), period=0.1, noise=HEARS)
        )
    other = mpc.KalmanFilter(CART, period=T, noise={"y1": 0.1, "y2": 0.1, "w1": 0.1})
    with pytest.raises(InputError, match="must have the same inputs, got pump and u1"):
        mpc.PredictiveController(programme, other)
