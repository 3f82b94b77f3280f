"""The operator's interface: bumpless in and out, within limits, the same however it is run."""

from __future__ import annotations

import copy
import math
import pickle
from functools import cache

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given, settings
from hypothesis import strategies as st

from models.basics import InputError
from models.plant import MEAN_LOSSES, DriveLimits, build_plant
from models.sensing import HEARD, STATUSES, Controller, Measurement, recursion_of
from models.simulation import Kernel
from synth.controllers import (
    BrakeOn,
    ConstantTension,
    LinearFeedback,
    VelocityFeedForward,
    operated,
)
from synth.structures import DrumSpeedLoop
from synth.structures.recursive import at_rest

MAKERS = {
    "feedback": lambda case: LinearFeedback(
        case, {"a": 1.0, "a1": 5.0, "a2": 3.0}, sample_time=0.01
    ),
    "feed-forward": VelocityFeedForward,
    "constant-tension": ConstantTension,
}
CASES = ("thesis-1975", "subsea-crane")
every = pytest.mark.parametrize(("name", "kind"), [(n, k) for n in CASES for k in MAKERS])
AT = {name: i for i, name in enumerate(HEARD)}
APPLIED = AT["drive.applied"]


@cache
def law(name: str, kind: str) -> Controller:
    return MAKERS[kind](load_case(name))


@cache
def made(name: str, kind: str, **options: float) -> Controller:
    return operated(law(name, kind), load_case(name), **options)


class Stepped:
    """A law whose recursion is hidden, so that the interface steps it from Python."""

    def __init__(self, inner: Controller) -> None:
        self.inner, self.told = inner, [0.0]
        self.name, self.sample_time = inner.name, inner.sample_time

    def reset(self) -> None:
        self.inner.reset()

    def step(self, measurement: Measurement, time: float) -> float:
        return self.inner.step(measurement, time)

    def commanded(self, command: float) -> None:
        self.told.append(command)


@cache
def still(name: str) -> np.ndarray:
    return at_rest(build_plant(load_case(name)).operating_point(MEAN_LOSSES)).values


def seen(name: str, n: int, seed: int, size: float = 0.02) -> np.ndarray:
    """Measurements about those at rest, smooth over time, the controller enabled."""
    random, rest = np.random.default_rng(seed), still(name)
    phase = 0.02 * np.arange(n)[:, None] + random.uniform(0.0, 6.0, len(HEARD))
    rows = rest + size * np.maximum(np.abs(rest), 1.0) * np.sin(phase)
    for flag in ("payload.valid", "mru.valid", "encoder.valid", "load_cell.valid"):
        rows[:, AT[flag]] = 1.0
    for zero in ("payload.age", "mru.age", "operator.reset"):
        rows[:, AT[zero]] = 0.0
    rows[:, AT["operator.enable"]] = 1.0
    return rows


def commands(controller: Controller, rows: np.ndarray, *, closed: bool = True) -> np.ndarray:
    """Commands of a controller; if closed, the drive follows each at the next sample."""
    controller.reset()
    rows, out = rows.copy(), []
    for k, row in enumerate(rows):
        if closed and out:
            row[APPLIED] = out[-1]
        out.append(controller.step(Measurement(row), k * controller.sample_time))
    return np.array(out)


@every
def test_the_first_command_is_what_the_drive_followed_last(name: str, kind: str) -> None:
    rows = seen(name, 3, seed=1)
    rows[0, APPLIED] *= 1.7
    controller = made(name, kind)
    assert commands(controller, rows)[0] == pytest.approx(rows[0, APPLIED], rel=1e-12)
    assert controller.status == "blending"
    rows[:, AT["operator.enable"]] = 0.0
    assert commands(controller, rows)[0] == pytest.approx(rows[0, APPLIED], rel=1e-12)
    assert controller.status == "held"


@every
def test_the_command_goes_over_to_the_law_without_a_step_and_back(name: str, kind: str) -> None:
    controller, T = made(name, kind), law(name, kind).sample_time
    n = round(12.0 / T)
    rows = seen(name, 3 * n, seed=2)
    rows[:n, AT["operator.enable"]] = rows[2 * n :, AT["operator.enable"]] = 0.0
    found = commands(controller, rows)
    alone = commands(law(name, kind), rows)
    span = np.ptp(alone) + np.ptp(found[:n])
    steps, usual = np.abs(np.diff(found)), np.abs(np.diff(alone)).max()
    assert steps[n - 1] <= 1e-3 * span + np.abs(np.diff(found[:n])).max()
    assert steps[n - 1 : 2 * n - 1].max() <= 2.0 * usual + 1e-2 * span
    # As it is stopped the drive goes on with what it did, whatever the law wanted.
    assert steps[2 * n - 1] <= 2.0 * usual + 1e-3 * span


@every
def test_once_it_has_taken_over_the_command_is_the_law_s(name: str, kind: str) -> None:
    controller, T = made(name, kind), law(name, kind).sample_time
    n = round(5.0 / T) + 2
    rows = seen(name, n + 400, seed=3, size=1e-3)
    found, alone = commands(controller, rows), commands(law(name, kind), rows)
    assert controller.status in ("engaged", "limited")
    if kind == "feedback":  # which has no state
        assert (found[n:] == alone[n:]).all()


def test_a_disabled_controller_holds_whatever_it_is() -> None:
    rows = seen("subsea-crane", 400, seed=4)
    rows[:, AT["operator.enable"]] = 0.0
    one = operated(VelocityFeedForward(load_case("subsea-crane")), load_case("subsea-crane"))
    other = operated(ConstantTension(load_case("subsea-crane")), load_case("subsea-crane"))
    assert (commands(one, rows) == commands(other, rows)).all()
    assert one.status == other.status == "held"


@every
def test_a_reset_in_flight_is_a_fresh_start(name: str, kind: str) -> None:
    rows = seen(name, 900, seed=5)
    rows[400, AT["operator.reset"]] = 1.0
    for controller in (made(name, kind), operated(Stepped(law(name, kind)), load_case(name))):
        whole = commands(controller, rows, closed=False)
        assert (commands(controller, rows[400:], closed=False) == whole[400:]).all()
        rows[400, AT["operator.reset"]] = 0.0
        assert (commands(controller, rows, closed=False)[400:] != whole[400:]).any()
        rows[400, AT["operator.reset"]] = 1.0


@every
def test_recursion_kernel_and_steps_from_python_agree(name: str, kind: str) -> None:
    controller = made(name, kind, rate=0.3)
    rows = seen(name, 1200, seed=6)
    rows[300:500, AT["operator.enable"]] = 0.0
    rows[700, AT["operator.reset"]] = 1.0
    rows[800:803, AT["payload.displacement"]] = math.nan
    rows[900:950, AT["reference.displacement"]] = math.nan
    expected = commands(controller, rows, closed=False)
    assert np.isfinite(expected).all()
    f = recursion_of(controller).function
    xc, m = ca.SX.sym("xc", f.numel_in(0)), ca.SX.sym("m", f.numel_in(1))
    kernel = Kernel(ca.Function("alone", [xc, m, ca.SX.sym("p", 0)], list(f(xc, m))))
    _, out = kernel.run(controller.recursion.initial, rows, np.zeros(0))
    np.testing.assert_allclose(out[:, 0], expected, rtol=1e-12)
    # Of a law without its recursion nobody knows what it hears: the payload is taken for it.
    if kind == "feedback":
        by_hand = operated(Stepped(law(name, kind)), load_case(name), rate=0.3)
        np.testing.assert_allclose(commands(by_hand, rows, closed=False), expected, rtol=1e-9)


def test_a_set_point_that_is_no_number_keeps_its_place() -> None:
    case, T = load_case("thesis-1975"), 0.01
    controller = operated(
        LinearFeedback(case, {"a": 0.0, "a1": 0.0, "a2": 1.0}, sample_time=T), case
    )
    rows = np.tile(still("thesis-1975"), (1500, 1))
    rows[:, AT["reference.displacement"]] = rows[:, AT["payload.displacement"]] = 0.4
    lost = rows.copy()
    lost[round(8.0 / T) :, AT["reference.displacement"]] = math.nan
    rows[900:, AT["payload.displacement"]] = lost[900:, AT["payload.displacement"]] = 0.5
    assert (commands(controller, lost) == commands(controller, rows)).all()
    assert controller.status in ("engaged", "limited")


def test_no_number_does_not_stay_in_the_states_of_a_law() -> None:
    controller, rows = made("thesis-1975", "feed-forward"), seen("thesis-1975", 900, seed=9)
    rows[400:403, AT["mru.heave_rate"]] = math.nan
    assert np.isfinite(commands(controller, rows)).all()
    assert controller.status in ("engaged", "limited")


def test_until_it_is_enabled_the_set_point_is_where_the_load_is() -> None:
    asked: list[float] = []

    class Heard(Stepped):
        def step(self, measurement: Measurement, time: float) -> float:
            asked.append(measurement["reference.displacement"])
            return super().step(measurement, time)

    controller = operated(Heard(law("thesis-1975", "feedback")), load_case("thesis-1975"), rate=0.1)
    rows = np.tile(still("thesis-1975"), (2000, 1))
    rows[:300, AT["operator.enable"]] = 0.0
    rows[:, AT["payload.displacement"]], rows[:, AT["drum.haul"]] = 0.7, 0.5
    commands(controller, rows)
    assert asked[:301] == pytest.approx([0.7] * 301, abs=1e-9)
    assert np.abs(np.diff(asked)).max() < 0.25 * 0.01
    assert asked[800] == pytest.approx(0.5 - 0.1 * 5.0, abs=2e-3)
    assert asked[-1] == 0.0


def test_the_set_point_moves_at_the_operators_rate() -> None:
    case = load_case("thesis-1975")
    asked: list[float] = []

    class Heard(Stepped):
        def step(self, measurement: Measurement, time: float) -> float:
            asked.append(measurement["reference.displacement"])
            return super().step(measurement, time)

    controller = operated(Heard(law("thesis-1975", "feedback")), case, rate=0.25, ramp=0.0)
    rows = np.tile(still("thesis-1975"), (1000, 1))
    rows[500:, AT["reference.displacement"]] = 1.0
    commands(controller, rows)
    steps = np.diff(asked)
    assert steps.max() == pytest.approx(0.25 * 0.01, rel=1e-6)
    assert asked[-1] == 1.0
    assert np.flatnonzero(steps > 0.0).size == 400


def test_the_command_stays_within_value_and_rate() -> None:
    case = load_case("thesis-1975")
    loud = LinearFeedback(case, {"a": 0.0, "a1": 0.0, "a2": 1e6}, sample_time=0.01)
    controller = operated(loud, case, ramp=0.0, slew=1000.0)
    rows = seen("thesis-1975", 500, seed=7, size=1.0)
    found = commands(controller, rows)
    voltage = DriveLimits.from_case(case).voltage
    assert np.abs(found).max() == voltage
    assert np.abs(np.diff(found)).max() <= 1000.0 * 0.01 * (1.0 + 1e-9)
    assert controller.status == "limited"


def test_status_tells_blind_fallback_and_held() -> None:
    controller, name = made("thesis-1975", "feedback"), "thesis-1975"
    row = still(name).copy()
    controller.reset()
    told = []
    for k in range(700):
        row[AT["payload.age"]] = 5.0 if 560 < k <= 570 else 0.0
        row[AT["payload.acceleration"]] = math.nan if 570 < k <= 580 else 0.0
        row[AT["operator.enable"]] = float(k <= 600)
        controller.step(Measurement(row.copy()), 0.01 * k)
        told.append(controller.status)
    assert set(told[:490]) == {"blending"}
    assert told[560] == "engaged"
    assert set(told[561:571]) == {"blind"}
    assert set(told[571:581]) == {"fallback"}
    assert set(told[581:601]) == {"blending"}
    assert set(told[601:]) == {"held"}
    assert set(told) <= set(STATUSES)


def test_without_a_sensor_the_laws_do_without_its_numbers() -> None:
    for kind, flag, signal in (
        ("constant-tension", "load_cell.valid", "rope.tension"),
        ("feed-forward", "encoder.valid", "drum.haul"),
    ):
        controller = made("subsea-crane", kind)
        row = still("subsea-crane").copy()
        row[AT[flag]], row[AT[signal]] = 0.0, 0.0
        held = row.copy()
        held[AT["operator.enable"]] = 0.0
        found = commands(controller, np.tile(row if kind[0] == "c" else held, (900, 1)))
        assert found == pytest.approx(still("subsea-crane")[APPLIED], rel=1e-9)


def lost_from(name: str, first: int, last: int, n: int) -> np.ndarray:
    """Measurements without encoder in between, which then shows zero."""
    rows = seen(name, n, seed=10, size=1e-3)
    rows[first:last, AT["encoder.valid"]] = 0.0
    rows[first:last, [AT["motor.speed"], AT["drum.haul"]]] = 0.0
    return rows


@every
def test_without_encoder_the_command_goes_over_to_what_holds_the_load(name: str, kind: str) -> None:
    T = law(name, kind).sample_time
    n, second = round(8.0 / T), round(1.0 / T)
    loop = DrumSpeedLoop.from_case(load_case(name), sample_time=T)
    static, motor = loop.static, loop.motor
    rows = lost_from(name, n, 2 * n, 3 * n)
    # What the law asked last is far from that.
    rows[:n, AT["motor.speed"]] += 2.0
    for controller in (made(name, kind), operated(Stepped(law(name, kind)), load_case(name))):
        found = commands(controller, rows)
        assert controller.status == "braked"
        far = np.abs(found[n - 1 : n + second] - static).max()
        steps = np.abs(np.diff(found[n - 1 :]))
        assert steps[0] < 0.01 * far
        # The steepest of 3 s^2 - 2 s^3 is 1.5 in a second; the torque that stops the drum goes by
        # its second derivative, 6 at the ends.
        turned = rows[n - 1, AT["motor.speed"]]
        stops = 6.0 * turned * motor.inertia / motor.torque_gain
        assert steps[1:second].max() <= T * max(5.0 * far, 1.05 * stops)
        # What holds the load, under the brake, though the encoder is back.
        assert found[n + second :] == pytest.approx(static, rel=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_the_drum_is_slowed_down_from_the_speed_it_had(name: str) -> None:
    controller, T = made(name, "feedback"), law(name, "feedback").sample_time
    n, half = round(2.0 / T), round(0.5 / T)
    rows = np.tile(still(name), (2 * n, 1))
    rows[:, AT["operator.enable"]] = rows[n:, AT["encoder.valid"]] = 0.0
    rows[n - 1, AT["motor.speed"]] = 10.0
    loop = DrumSpeedLoop.from_case(load_case(name), sample_time=T)
    # It is to turn half as fast then, and to slow down by 1.5 times that in a second.
    motor = loop.motor
    wanted = 5.0 * motor.feed - 15.0 * motor.inertia / motor.torque_gain
    found = commands(controller, rows)[n + half - 1] - loop.static
    # Half of it by then; the loop that held the drum follows the command that goes out.
    assert 0.4 * wanted < found < wanted


def test_the_brake_is_asked_for_until_the_operator_says_otherwise() -> None:
    name, kind = "thesis-1975", "feedback"
    told: dict[str, list[str]] = {}
    for case in ("lost", "glitch", "reset", "disabled", "still lost"):
        controller = made(name, kind)
        rows = lost_from(name, 100, 150 if case == "glitch" else 300, 1200)
        if case == "reset":
            rows[500, AT["operator.reset"]] = 1.0
        elif case == "disabled":
            rows[500:510, AT["operator.enable"]] = 0.0
        elif case == "still lost":
            rows[200, AT["operator.reset"]] = rows[300:, AT["encoder.valid"]] = 0.0
            rows[500:510, AT["operator.enable"]] = 0.0
        controller.reset()
        told[case] = []
        for k, row in enumerate(rows):
            controller.step(Measurement(row), 0.01 * k)
            told[case].append(controller.status)
    for case, own in told.items():
        assert set(own[100:149]) == {"stopping"}, case
        if case != "glitch":
            assert own[198] == "stopping"
            assert set(own[200:500]) == {"braked"}, case
    assert set(told["lost"][500:]) == set(told["still lost"][520:]) == {"braked"}
    # Back before the drum was stopped: the law takes over again, without the brake.
    assert "braked" not in told["glitch"]
    assert told["glitch"][-1] in ("engaged", "limited")
    assert told["reset"][500] == "blending"
    assert set(told["reset"][1010:]) <= {"engaged", "limited"}
    assert "braked" not in told["disabled"][500:]
    assert set(told["disabled"][1130:]) <= {"engaged", "limited"}


@pytest.mark.parametrize("kind", MAKERS)
@settings(deadline=None, max_examples=30)
@given(
    st.lists(st.tuples(st.booleans(), st.booleans(), st.booleans()), min_size=1, max_size=40),
    st.integers(0, 1000),
)
def test_any_switching_leaves_finite_commands_within_limits(
    kind: str, switches: list[tuple[bool, bool, bool]], seed: int
) -> None:
    name = "thesis-1975"
    rows = seen(name, 10 * len(switches), seed=seed, size=0.3)
    for k, (enable, reset, lost) in enumerate(switches):
        part = rows[10 * k : 10 * k + 10]
        part[:, AT["operator.enable"]] = enable
        part[0, AT["operator.reset"]] = reset
        if lost:
            part[3:6, np.random.default_rng(seed + k).integers(len(HEARD))] = math.nan
    found = commands(made(name, kind), rows)
    assert np.isfinite(found).all()
    assert np.abs(found).max() <= DriveLimits.from_case(load_case(name)).voltage


def test_a_controller_in_python_is_told_what_went_to_the_drive() -> None:
    inner = Stepped(law("thesis-1975", "feedback"))
    found = commands(operated(inner, load_case("thesis-1975")), seen("thesis-1975", 50, seed=8))
    assert inner.told[1:] == found.tolist()


def test_brakes_and_operated_controllers_come_back_as_they_are() -> None:
    case = load_case("thesis-1975")
    brake = BrakeOn(case)
    assert operated(brake, case) is brake
    for one in (made("thesis-1975", "feedback"), operated(Stepped(brake), case)):
        assert operated(one, case) is one
        for twin in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
            assert twin.name == one.name


def test_numbers_out_of_range_are_told() -> None:
    case = load_case("thesis-1975")
    for options in ({"ramp": -1.0}, {"rate": 0.0}, {"slew": -1.0}):
        with pytest.raises(InputError, match="interface: "):
            operated(law("thesis-1975", "feedback"), case, **options)
