from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from former_cases import load_case
from ipopt_programme import nlp_oracle
from mpc_cases import WEIGHTS as TOLD
from mpc_cases import case_of, off
from one_sample import advanced

import stillhook as sh
from models.plant import MEAN_LOSSES, DriveLimits, PlantData, build_plant
from models.sensing import HEARD, Measurement
from mpc.linear import LinearMPC
from mpc.nonlinear import NonlinearMPC
from mpc.nonlinear.mean_torque import mean_torque, start_torque
from mpc.nonlinear.stage import force_law, make_stage
from mpc.programme import kkt_residual
from mpc.winch import ProcessNoise, Weights
from mpc.winch.sampled import sampled_winch

FloatArray = npt.NDArray[np.float64]

WEIGHTS = Weights(torque=0.02, noise=ProcessNoise(force=0.1, torque=0.02, rope=0.01))


@pytest.fixture(scope="module")
def thesis() -> sh.Case:
    return load_case("thesis-1975")


@pytest.fixture(scope="module")
def crane() -> sh.Case:
    return load_case("subsea-crane")


def a_sea(controller: LinearMPC, size: float, seed: int) -> FloatArray:
    """A state with waves of some rms and the load off its place."""
    rng, model = np.random.default_rng(seed), controller.model
    chi = np.zeros(model.size)
    chi[model.sea_at] = size * rng.normal(size=model.sea.order)
    chi[: model.winch.size] = 0.3 * size * model.winch.moved @ rng.normal(size=2)
    return chi


RIG = {"crane.tip_stiffness": 3e6, "rigging.stiffness": 5e6, "rigging.block_mass": 4e3}
FALLS = {"rope.falls": 2, "winch.drum.radius": 1.07}


@pytest.mark.parametrize(
    ("name", "rig"),
    [
        ("thesis-1975", {}),
        ("thesis-1975-rope", {}),
        ("subsea-crane", {}),
        ("subsea-crane", {**RIG, **FALLS}),
    ],
)
def test_linear_plant_and_forces_together_are_the_nonlinear_plant(
    name: str, rig: dict[str, float]
) -> None:
    winch = sampled_winch(load_case(name).replace(rig))
    plant = build_plant(winch.data, winch.masses)
    law = force_law(winch, slack=range(len(plant.chain)))
    stage = make_stage(winch, law, compiled=False)
    rest = plant.operating_point(MEAN_LOSSES)
    p, nx = plant.parameter_vector(), len(plant.states)
    rng = np.random.default_rng(0)
    size = [{"speed": 20.0, "angle": 300.0}.get(s.rsplit(".", 1)[-1], 3.0) for s in plant.states]
    known = {name: k for k, name in enumerate(winch.plant.disturbances)}
    E = winch.plant.E[:, [known["hook.heave"], known["hook.heave_rate"]]]
    slackened = 0
    for _ in range(20):
        x, w = np.zeros(winch.size), np.zeros(len(plant.disturbances))
        x[:nx], u = rng.normal(size=nx) * size, rng.normal()
        w[:2] = 2.0 * rng.normal(size=2)
        arguments = stage.law.arguments.values()
        y = np.array([a.row @ x + a.hook @ w[:2] + a.rest for a in arguments])
        n, _ = stage.forces(y[None])
        found = winch.plant.A @ x + winch.plant.B[:, 0] * u + E @ w[:2]
        found += np.column_stack(list(stage.law.columns.values())) @ n[0]
        rates, _, shown = plant.function(rest.x + x[:nx], rest.u + u, w, p)
        true = np.asarray(rates).ravel()
        if "load_cell.tension" in winch.plant.states:
            cell = winch.plant.states.index("load_cell.tension")
            line = float(shown[plant.outputs.index("rope.tension")]) - rest.tension
            bandwidth = winch.case.sensors.load_cell.bandwidth
            assert found[cell] == pytest.approx(bandwidth * (line - x[cell]), rel=1e-3, abs=1e4)
        slackened += int((n[0] > 1e5).sum())
        # What is left is the smoothing of a rope that goes slack.
        np.testing.assert_allclose(found[:nx], true, rtol=3e-4, atol=3e-4)
    assert slackened > 1


def test_derivatives_of_the_forces_are_finite_differences(crane: sh.Case) -> None:
    winch = sampled_winch(crane)
    stage = make_stage(winch, force_law(winch), compiled=False)
    rng = np.random.default_rng(1)
    scale = np.maximum(stage.rest, 1.0)
    y = stage.rest * rng.normal(0.5, 0.5, size=(40, len(stage.rest))) + rng.normal(size=(40, 1))
    _, J = stage.forces(y)
    for a, size in enumerate(scale):
        step = np.zeros(len(stage.rest))
        step[a] = 1e-6 * size
        rise = (stage.forces(y + step)[0] - stage.forces(y - step)[0]) / (2.0 * step[a])
        np.testing.assert_allclose(J[:, :, a], rise, rtol=1e-5, atol=1e-3)


def sample_errors(name: str, sample_time: float) -> tuple[float, float]:
    """Errors of one sample beside fine steps of the plant, with its forces and without."""
    winch = sampled_winch(load_case(name), sample_time=sample_time)
    data = replace(PlantData.from_case(winch.case), sensor_bandwidth=math.inf)
    plant = build_plant(data, winch.masses)
    rest, T, p = plant.operating_point(MEAN_LOSSES), winch.sample_time, plant.parameter_vector()
    shared = [winch.plant.states.index(s) for s in plant.states]
    # The load rises at 3 m/s and the drum pays out at 3 m/s: drag, and a rope that goes slack.
    x = winch.moved @ [0.2, 3.0]
    x[winch.plant.states.index("motor.speed")] *= -1.0
    z0, v0, z1, v1 = ends = np.array([0.1, -0.4, 0.09, 0.1])
    d = 0.2 * winch.rest_torque
    command = winch.command(d, float(winch.speed @ x))

    def rate(state: FloatArray, t: float) -> FloatArray:
        s = t / T
        c2 = 3.0 * (z1 - z0) - T * (2.0 * v0 + v1)
        c3 = -2.0 * (z1 - z0) + T * (v0 + v1)
        w = np.zeros(len(plant.disturbances))
        w[0] = z0 + s * (T * v0 + s * (c2 + s * c3))
        w[1] = v0 + s * (2.0 * c2 + 3.0 * s * c3) / T
        return np.asarray(plant.function(rest.x + state, command, w, p)[0]).ravel()

    true, h = x[shared].copy(), T / 200
    for k in range(200):
        t = k * h
        k1 = rate(true, t)
        k2 = rate(true + 0.5 * h * k1, t + 0.5 * h)
        k3 = rate(true + 0.5 * h * k2, t + 0.5 * h)
        true += h / 6.0 * (k1 + 2.0 * (k2 + k3) + rate(true + h * k3, t + h))

    def error(found: FloatArray) -> float:
        return float((np.abs(found[shared] - true) / (np.abs(true) + 1.0)).max())

    law = force_law(winch, slack=range(winch.masses))
    stage = make_stage(winch, law, mean=False, compiled=False)
    linear = winch.A @ x + winch.B[:, 0] * d + winch.from_hook @ ends
    return error(advanced(stage, x, d, ends, np.zeros(2))), error(linear)


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_a_sample_is_that_of_fine_steps_of_the_plant(name: str) -> None:
    (whole, linear), (fourth, _) = (sample_errors(name, T) for T in (0.05, 0.0125))
    assert whole < 0.5 * linear
    assert fourth < 0.3 * whole


def test_mean_torque_is_the_mean_that_the_linear_plant_has(crane: sh.Case) -> None:
    """The same motion by the command at the start, and the torque's integral by fine steps."""
    winch = sampled_winch(crane)
    changed, drift = mean_torque(winch)
    rng = np.random.default_rng(3)
    x, ends, c = winch.moved @ [0.3, 0.5], rng.normal(size=4), np.array([1e3, 200.0])
    d = 2000.0
    start = d + drift(x, d, ends, c)
    ahead = winch.A @ x + winch.B[:, 0] * start + winch.from_hook @ ends
    ahead += winch.from_constants @ c
    other = changed.A @ x + changed.B[:, 0] * d + changed.from_hook @ ends
    np.testing.assert_allclose(ahead, other + changed.from_constants @ c, rtol=1e-9, atol=1e-9)
    angle = winch.plant.states.index("motor.angle")
    turned = (ahead[angle] - x[angle]) / winch.sample_time
    command = winch.command(start, float(winch.speed @ x))
    assert winch.torque(command, turned) == pytest.approx(d, rel=1e-9)


@pytest.mark.parametrize("drift", [-900.0, -20.0, 0.0, 35.0, 1200.0])
@pytest.mark.parametrize("mean", [-1000.0, -950.0, -300.0, 0.0, 400.0, 990.0, 1000.0])
def test_cut_demand_has_the_mean_that_was_wanted(mean: float, drift: float) -> None:
    start = start_torque(mean, drift, 1000.0)
    over = np.linspace(start, start - 2.0 * drift, 200_001)
    cut = np.clip(over, -1000.0, 1000.0)
    # Where the demand leaves the limits at one end alone, as it does but for a drift that is larger
    # than the limits are wide.
    if not (over.max() > 1000.0 + 1e-9 and over.min() < -1000.0 - 1e-9):
        assert cut.mean() == pytest.approx(mean, abs=0.05)


def test_a_mean_at_the_peak_is_asked_for_beyond_it() -> None:
    assert start_torque(1000.0, 50.0, 1000.0) == pytest.approx(1100.0)
    assert start_torque(-1000.0, 50.0, 1000.0) == pytest.approx(-1000.0)


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_without_nonlinearities_it_is_the_linear_controller(name: str) -> None:
    case = load_case(name)
    # A linear programme has the power as bounds about the last plan.
    limits = replace(DriveLimits.from_case(case), power=math.inf)
    linear = LinearMPC(case, weights=WEIGHTS, limits=limits)
    off = NonlinearMPC(
        case,
        weights=WEIGHTS,
        limits=limits,
        drag=False,
        slack=(),
        mean_torque=False,
    )
    for seed, size in enumerate((0.1, 0.5, 1.0, 2.0)):
        chi = a_sea(linear, size, seed)
        speed = float(linear.model.winch.speed @ chi[: linear.model.winch.size])
        ahead, gradient, free = linear.products.known(chi)
        low, high = off.hard_bounds(speed)
        answer = linear.qp.solve(*linear.programme.question(gradient, free, low, high))
        off.reset()
        found, _ = off.shooting.known(chi)
        np.testing.assert_array_equal(found, ahead)
        moves = off.optimise(chi)
        np.testing.assert_allclose(moves, answer.v, rtol=0.0, atol=1e-6)


def test_condensed_linearisation_is_the_slope_of_a_simulation(thesis: sh.Case) -> None:
    """Outputs of moves that are a little different, sample by sample through `advanced`."""
    controller = NonlinearMPC(
        thesis, weights=WEIGHTS, horizon=3.0, minimum_tension=0.0, predictor="kalman"
    )
    chi, p, stage = a_sea(controller, 1.0, 5), controller.programme, controller.stage
    moves = controller.optimise(chi)
    model, n = controller.model, stage.winch.size
    over, state, path = model.A[model.sea_at, model.sea_at], chi[model.sea_at], []
    for _ in range(p.steps + 1):
        path.append(model.hook[:, model.sea_at] @ state)
        state = over @ state
    of = np.repeat(np.arange(len(p.blocks)), p.blocks)

    def simulated(v: FloatArray) -> FloatArray:
        x, seen = chi[:n], []
        for j in range(p.steps):
            ends = np.concatenate([path[j], path[j + 1]])
            x = advanced(stage, x, p.unit * float(v[of[j]]), ends, np.zeros(2))
            seen.append(stage.winch.payload @ x)
        return np.array([*seen[:-1], *x])

    known = controller.shooting.known(chi)[1]
    prepared = controller.shooting.linearise(controller.plan)
    _, free, _ = controller.shooting.free(prepared, known)
    count = p.steps - 1 + n
    foreseen = free[:count] + prepared.outputs[:count] @ moves
    np.testing.assert_allclose(foreseen, simulated(moves), rtol=1e-6, atol=1e-6)
    for block in (0, 3, len(moves) - 1):
        step = np.zeros(len(moves))
        step[block] = 1e-5
        slope = (simulated(moves + step) - simulated(moves - step)) / 2e-5
        scale = np.abs(slope).max()
        np.testing.assert_allclose(
            prepared.outputs[:count, block], slope, rtol=1e-5, atol=2e-5 * scale
        )


@pytest.mark.parametrize(
    ("name", "seed", "size"),
    [("thesis-1975", 5, 1.0), ("thesis-1975", 8, 2.0), ("subsea-crane", 6, 0.3)],
)
def test_converged_iterations_are_ipopts_answer(name: str, seed: int, size: float) -> None:
    case = load_case(name)
    controller = NonlinearMPC(
        case, weights=WEIGHTS, horizon=2.0, masses=1, minimum_tension=0.0, predictor="kalman"
    )
    chi = a_sea(controller, size, seed)
    moves = controller.optimise(chi)
    answer = nlp_oracle(controller, chi)
    low, high = controller.hard_bounds(float(controller.model.winch.speed @ answer.states[0]))
    assert ((moves < low + 1e-9) | (moves > high - 1e-9)).any()  # saturated
    assert np.abs(answer.forces[:, 0]).max() > 500.0  # with drag
    np.testing.assert_allclose(moves, answer.v, rtol=0.0, atol=1e-6)
    assert controller.question is not None
    assert controller.solved is not None
    assert kkt_residual(controller.qp, *controller.question, controller.solved) < 1e-9


@pytest.mark.parametrize(("seed", "size", "rising"), [(5, 0.5, 1.0), (8, 0.3, 0.0)])
def test_converged_iterations_are_ipopts_answer_with_a_slack_rope(
    thesis: sh.Case, seed: int, size: float, rising: float
) -> None:
    controller = NonlinearMPC(
        thesis, weights=WEIGHTS, horizon=2.0, minimum_tension=0.0, predictor="kalman"
    )
    chi, states = a_sea(controller, size, seed), controller.model.winch.plant.states
    chi[states.index("payload.displacement")] += 6.0  # more than the static stretch
    chi[states.index("payload.velocity")] += rising
    moves = controller.optimise(chi)
    answer = nlp_oracle(controller, chi)
    low, high = controller.hard_bounds(float(controller.model.winch.speed @ answer.states[0]))
    assert ((moves < low + 1e-9) | (moves > high - 1e-9)).any()
    drag, slack = np.abs(answer.forces).max(axis=0)
    assert drag > 5e4
    assert slack > 1e4
    np.testing.assert_allclose(moves, answer.v, rtol=0.0, atol=1e-6)


def test_commands_are_finite_whatever_is_shown(crane: sh.Case) -> None:
    controller = NonlinearMPC(crane, weights=WEIGHTS, masses=1, horizon=3.0)
    rng = np.random.default_rng(7)
    for k in range(200):
        values = rng.normal(size=len(HEARD)) * 10.0 ** rng.integers(-1, 7)
        spoilt = rng.random(len(HEARD)) < 0.2
        values[spoilt] = rng.choice([np.nan, np.inf, -np.inf], size=int(spoilt.sum()))
        values[HEARD.index("reference.displacement") :] = 0.0
        assert math.isfinite(controller.step(Measurement(values), 0.05 * k))
    assert controller.counts["steps"] == 200


def test_a_plan_beyond_all_numbers_is_forgotten(thesis: sh.Case) -> None:
    controller = NonlinearMPC(thesis, weights=WEIGHTS, horizon=3.0)
    shown = Measurement.of({"rope.tension": case_tension(controller), "mru.heave": 0.5})
    controller.step(shown, 0.0)
    before = controller.qp.H.copy()
    controller.plan[:] = np.nan
    controller.prepare()
    assert controller.counts["forgotten"] == 1
    assert np.isfinite(controller.qp.H).all()
    assert math.isfinite(controller.step(shown, 0.05))
    controller.reset()
    controller.step(shown, 0.0)
    np.testing.assert_array_equal(controller.qp.H, before)


def test_a_load_at_rest_is_left_at_rest(crane: sh.Case) -> None:
    controller = NonlinearMPC(crane, weights=WEIGHTS, horizon=3.0)
    winch = controller.model.winch
    shown = {"rope.tension": winch.rest_tension, "payload.valid": 1.0, "mru.valid": 1.0}
    shown |= {"drive.applied": winch.rest_command, "payload.age": 0.03}
    for k in range(20):
        command = controller.step(Measurement.of(shown), 0.05 * k)
    assert command == pytest.approx(winch.rest_command, abs=1e-6)


def test_a_plan_that_is_late_is_replaced_and_counted(thesis: sh.Case) -> None:
    controller = NonlinearMPC(thesis, weights=WEIGHTS, horizon=3.0, deadline=1e9)
    shown = Measurement.of({"rope.tension": case_tension(controller), "mru.heave": 0.5})
    controller.step(shown, 0.0)
    controller._deadline = 0.0
    assert math.isfinite(controller.step(shown, 0.05))
    assert controller.counts["late"] == controller.counts["fallback"] == 1
    assert controller.status == "fallback"


def case_tension(controller: LinearMPC) -> float:
    return controller.model.winch.rest_tension


@pytest.mark.ci
def test_torque_that_is_a_mean_is_worth_having_where_the_drive_saturates(thesis: sh.Case) -> None:
    rms = {}
    for mean in (False, True):
        controller = NonlinearMPC(rough(thesis), weights=WEIGHTS, mean_torque=mean)
        run = sh.simulate(rough(thesis), controller, seeds=[1], duration=65.0, settle=35.0)[0]
        assert controller.counts["fallback"] == 0
        rms[mean] = run.statistics.value("tracking error rms")
    assert rms[True] < 0.99 * rms[False]


def test_a_run_is_repeated_to_the_bit(thesis: sh.Case) -> None:
    controller = NonlinearMPC(rough(thesis), weights=WEIGHTS, horizon=4.0)
    first, again = (
        sh.simulate(rough(thesis), controller, seeds=[1], duration=15.0, settle=1.0)[0]
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.values, again.values)


def rough(case: sh.Case) -> sh.Case:
    """A sea that saturates the drive often."""
    return case.model_copy(update={"sea": case.sea.model_copy(update={"significant_height": 3.0})})


def test_preparation_and_feedback_are_timed(thesis: sh.Case) -> None:
    controller = NonlinearMPC(thesis, weights=WEIGHTS)
    controller.step(Measurement.of({"rope.tension": case_tension(controller)}), 0.0)
    assert set(controller.seconds) == {"feedback", "preparation"}
    assert all(0.0 < value < 1.0 for value in controller.seconds.values())


def test_arguments_out_of_range_are_refused(thesis: sh.Case) -> None:
    with pytest.raises(sh.InputError, match="springs from 0 to 0"):
        NonlinearMPC(thesis, weights=WEIGHTS, slack=(1,))
    with pytest.raises(sh.InputError, match="iterations"):
        NonlinearMPC(thesis, weights=WEIGHTS, iterations=0)


@pytest.mark.ci
def test_an_inertia_other_than_told_is_learnt_and_planned_with() -> None:
    case, weights = case_of("thesis-1975", 1.9), TOLD["thesis-1975"]
    true = off(case, inertia=1.3)

    def left(controller: NonlinearMPC) -> float:
        (run,) = sh.simulate(true, controller, seeds=[1], duration=120.0, settle=60.0)
        return run.statistics.value("payload rms")

    told, learning = (NonlinearMPC(known, weights=weights) for known in (true, case))
    # Not knowing better it leaves 452 mm.
    assert left(learning) < 2.0 * left(told)
    assert learning.inertia.ratio == pytest.approx(1.3, abs=0.03)
    # Nor is what the drive cuts at the beginning of a sample taken for inertia.
    assert told.inertia.ratio == pytest.approx(1.0, abs=0.01)
