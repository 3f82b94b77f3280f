"""Late commands and late, held readings: the prediction is the plant that hears them so late."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
from mpc_cases import WEIGHTS, case_of

from models import Case
from models.operation import Scenario
from models.plant import MEASUREMENTS, zero_order_hold
from models.sensing import HEARD, MEASURED, Measurement, SensorModel
from models.simulation import SimulationOptions, prepare, run_simulation
from mpc.linear import LinearMPC
from mpc.nonlinear import NonlinearMPC
from mpc.programme import ages
from mpc.winch import (
    ProcessNoise,
    WinchEstimator,
    prediction_model,
    regulator,
    sampled_winch,
    with_noise,
)
from mpc.winch.regulation import feedback_row
from mpc.winch.unsaturated import Unsaturated

DELAYS = (0.03, 0.05, 0.12)
T = 0.05


def late_case(name: str, delay: float, height: float | None = None) -> Case:
    return case_of(name, height).replace({"winch.drive.command_delay": delay})


def rms_of(case: Case, controller: LinearMPC | NonlinearMPC, duration: float = 120.0) -> float:
    """Root mean square of the payload over two seeds [m]."""
    simulation = prepare(case, controller, options=SimulationOptions(duration=duration))
    runs = [run_simulation(simulation, seed=seed) for seed in (1, 2)]
    found = [run.statistics["payload.displacement"].standard_deviation for run in runs]
    return float(np.sqrt(np.mean(np.square(found))))


@pytest.mark.parametrize("delay", [0.0, *DELAYS, 0.13])
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_late_commands_do_what_they_do_to_the_continuous_plant(name: str, delay: float) -> None:
    winch = sampled_winch(late_case(name, delay), sample_time=T)
    plant, n, rng = winch.plant, len(winch.plant.states), np.random.default_rng(5)
    assert winch.waiting == math.ceil(delay / T - 1e-9)
    # The plant at every millisecond, with the commands switched where they arrive.
    system = np.zeros((n + 1, n + 1))
    system[:n, :n], system[:n, n] = plant.A, plant.B[:, 0]
    step = scipy.linalg.expm(system * 1e-3)
    true, x = np.zeros(n), np.zeros(winch.size)
    given: list[float] = []
    per, late = round(T / 1e-3), round(delay / 1e-3)
    for k in range(40):
        command = 0.1 * float(rng.normal())
        d = winch.torque(winch.rest_command + command, float(winch.reckoned @ x))
        given.append(command)
        for i in range(k * per, (k + 1) * per):
            acts = (i - late) // per
            held = given[acts] if acts >= 0 else 0.0
            true = (step @ np.append(true, held))[:n]
        x = winch.A @ x + winch.B[:, 0] * d
        assert np.abs(x[:n] - true).max() <= 1e-9 * np.abs(true).max() + 1e-15
        on_the_way = given[::-1][: winch.waiting]
        assert x[n:][: len(on_the_way)] == pytest.approx(on_the_way, abs=1e-9)


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_the_unsaturated_controller_is_the_regulator_of_late_commands(
    name: str, delay: float
) -> None:
    weights = WEIGHTS[name]
    controller = LinearMPC(
        late_case(name, delay), weights=weights, horizon=3.0, blocking=(1,) * 60, predictor="kalman"
    )
    model, rng = controller.model, np.random.default_rng(2)
    chi = np.zeros(model.size)
    n = model.winch.size
    chi[:n] = 1e-4 * rng.normal(size=n) * model.scale[:n]
    chi[model.sea_at] = 1e-3 * rng.normal(size=model.sea.order)
    _, gradient, free = controller.products.known(chi)
    speed = float(model.winch.reckoned @ chi[:n])
    bounds = controller.window.bounds(speed, np.zeros(60), math.inf)
    solved = controller.qp.solve(*controller.programme.question(gradient, free, *bounds))
    assert not (solved.multipliers != 0.0).any()
    wanted = -float(feedback_row(controller.regulator, model) @ chi)
    assert solved.v[0] * controller.programme.unit == pytest.approx(wanted, rel=1e-6, abs=1e-6)
    # The law closed on the plant has the poles of regulator and filter, each by itself.
    believed = with_noise(prediction_model(sampled_winch(late_case(name, delay))), weights.noise)
    loop = Unsaturated(model=believed, regulator=regulator(believed, weights.torque))
    row = feedback_row(loop.regulator, believed)
    filtered = believed.A @ (np.eye(believed.size) - believed.gain @ believed.C)
    regulated = believed.A - believed.B @ row[None, :]
    radius = max(np.abs(np.linalg.eigvals(part)).max() for part in (filtered, regulated))
    assert loop.growth() <= radius + 1e-9
    assert loop.growth() < 1.0


@pytest.mark.parametrize("delay", DELAYS)
def test_a_filter_that_trusts_its_model_has_to_know_of_late_commands(delay: float) -> None:
    noise = ProcessNoise(force=1e-3, torque=1e-3, rope=1e-3, sensors=1e-3)
    truth, prompt = (
        with_noise(prediction_model(sampled_winch(late_case("subsea-crane", late))), noise)
        for late in (delay, 0.0)
    )
    told, untold = (
        Unsaturated(model=believed, regulator=regulator(believed, 0.03))
        for believed in (truth, prompt)
    )
    assert untold.rms_under(prompt)[0] < told.rms_under(truth)[0]
    assert told.rms_under(truth)[0] < 1.4 * untold.rms_under(prompt)[0]
    assert untold.growth(truth) > 1.0


@pytest.mark.ci
@pytest.mark.parametrize("delay", DELAYS)
def test_who_is_told_of_late_commands_leaves_little_more_than_without(delay: float) -> None:
    name = "thesis-1975"
    case, late = case_of(name), late_case(name, delay)
    untold = LinearMPC(case, weights=WEIGHTS[name])
    without, ignored = rms_of(case, untold), rms_of(late, untold)
    told = rms_of(late, LinearMPC(late, weights=WEIGHTS[name]))
    assert told < 1.12 * without
    assert ignored > {0.03: 1.25, 0.05: 1.9, 0.12: 5.0}[delay] * told


@pytest.mark.ci
def test_nonlinear_control_is_told_of_late_commands() -> None:
    name = "thesis-1975"
    case, late = case_of(name), late_case(name, 0.05)
    untold = NonlinearMPC(case, weights=WEIGHTS[name])
    without, ignored = rms_of(case, untold, 60.0), rms_of(late, untold, 60.0)
    told = rms_of(late, NonlinearMPC(late, weights=WEIGHTS[name]), 60.0)
    assert told < 1.15 * without
    assert ignored > 1.7 * told


@pytest.mark.ci
@pytest.mark.parametrize(
    ("changes", "most", "least"),
    [
        ({"latency": "100 ms"}, 1.3, 4.0),
        ({"rate": "5 Hz"}, 1.3, 3.0),
        ({"rate": "5 Hz", "latency": "100 ms"}, 1.7, 8.0),
    ],
    ids=["late", "held", "both"],
)
def test_late_and_held_readings_are_taken_for_what_they_are(
    changes: dict[str, str], most: float, least: float
) -> None:
    name = "subsea-crane"
    case = case_of(name)
    late = case.replace(
        {
            f"sensors.payload.{signal.partition('.')[2]}_{what}": value
            for signal in MEASUREMENTS
            for what, value in changes.items()
        }
    )
    untold = LinearMPC(case, weights=WEIGHTS[name])
    without, ignored = rms_of(case, untold, 90.0), rms_of(late, untold, 90.0)
    told = rms_of(late, LinearMPC(late, weights=WEIGHTS[name]), 90.0)
    assert told < most * without
    assert ignored > least * told


def test_a_held_reading_is_as_old_as_it_is_in_the_mean() -> None:
    case = case_of("subsea-crane").replace(
        {
            "sensors.payload.velocity_rate": "5 Hz",
            "sensors.payload.velocity_latency": "100 ms",
            "sensors.payload.acceleration_rate": "50 Hz",
            "winch.drive.command_delay": "70 ms",
        }
    )
    winch = sampled_winch(case, sample_time=T)
    # Telemetry takes 30 ms; a hold of 200 ms is shown at 0, 50, 100 and 150 ms, one of 20 ms once.
    found = dict(zip(MEASURED, T * ages(winch.plant, T), strict=True))
    assert found["payload.velocity"] == pytest.approx(0.03 + 0.1 + 0.075)
    assert found["payload.acceleration"] == pytest.approx(0.03)
    # A late command is on its way in the state, and delays no sensor.
    assert found["mru.heave"] == pytest.approx(0.02)
    assert found["motor.speed"] == 0.0
    model = prediction_model(winch)
    # Four times the same, and off by its age as if the load moved like the hook.
    spread = np.var(T * np.arange(4)) * model.waves[2] ** 2
    noise = SensorModel.from_case(case, T).noise_rms("velocity")
    held = model.R[MEASURED.index("payload.velocity")]
    assert held == pytest.approx(4.0 * noise**2 + spread, rel=1e-3)


def test_what_a_drive_cuts_it_cuts_now_of_a_command_given_before() -> None:
    winch = sampled_winch(late_case("thesis-1975", 0.07), sample_time=T)
    estimator = WinchEstimator(prediction_model(winch))
    shown = np.full(len(HEARD), math.nan)
    given, cut, n = winch.rest_command + 3.0, 2.0, len(winch.plant.states)
    estimator.update(Measurement(shown))
    estimator.given = given
    shown[HEARD.index("drive.applied")] = given - cut
    found = estimator.update(Measurement(shown))
    # The command has only begun its way; what is missing from those before acts over the sample.
    missing = zero_order_hold(winch.plant.A, winch.plant.B[:, :1], T)[1][:, 0]
    np.testing.assert_allclose(found[:n], -cut * missing, rtol=2e-3)  # but for quadratic drag
    np.testing.assert_allclose(found[n : winch.size], [3.0, 0.0], rtol=1e-9)


def test_a_torque_that_was_cut_for_a_part_of_the_sample_is_that_of_late_commands() -> None:
    controller = NonlinearMPC(
        late_case("thesis-1975", 0.03), weights=WEIGHTS["thesis-1975"], compiled=False
    )
    controller.estimator.given = 5.0
    # (asked, what would do as much uncut, how far the drive may say to be off), the newest first:
    # of 0.6 of the sample the one before, of the rest the newest.
    controller._cuts = [(7.0, 6.5, 1.0), (10.0, 8.0, 0.5)]
    assert controller._uncut(5.8) == pytest.approx(5.0 - 0.6 * 2.0 - 0.4 * 0.5)
    assert math.isnan(controller._uncut(6.1))


class Restless:
    """A controller that asks for one command after the other, and notes what was followed."""

    name, sample_time = "restless", T

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.followed: list[float] = []

    def reset(self) -> None:
        """Have nothing to forget."""

    def step(self, measurement: Measurement, time: float) -> float:
        """Return a command."""
        self.followed.append(float(measurement.values[HEARD.index("drive.applied")]))
        self.asked.append(math.sin(3.0 * time))
        return self.asked[-1]


def test_a_drive_that_is_not_engaged_has_left_out_all_that_arrived() -> None:
    case, controller = late_case("thesis-1975", 0.07), Restless()
    aside = Scenario(name="aside", description="", duration=3.0, warm_up=3.0)
    options = SimulationOptions(duration=2.0)
    run_simulation(prepare(case, controller, aside, options=options), seed=1)
    hold = sampled_winch(case, sample_time=T).rest_command
    asked = np.array(controller.asked)
    arrived = 0.4 * asked[:-2] + 0.6 * asked[1:-1]  # of 1.4 samples before
    told = np.array(controller.followed)[3:] - asked[2:-1]
    assert told == pytest.approx(hold - arrived[:-1], abs=1e-9)
