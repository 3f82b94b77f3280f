"""The drum-speed loop against the closed form of a motor, and with a drive that does not obey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from former_cases import load_case
from linear_runs import linear_run, still
from sampled_response import sampled_response

from models import Case
from models.basics import InputError, SynthesisError
from models.plant import build_plant
from models.sensing import Measurement
from synth.structures import DrumSpeedLoop, RecursiveController, sampled_loop


def torque_commanded() -> Case:
    """The crane's drive without its speed regulator: the command is a torque."""
    changes = {"winch.motor.speed_gain": 0.0, "winch.motor.torque_bandwidth": 5000.0}
    return load_case("subsea-crane").replace(changes)


def controller(loop: DrumSpeedLoop) -> RecursiveController:
    return RecursiveController(
        name="drum speed", sample_time=loop.sample_time, recursion=loop.recursion()
    )


@pytest.mark.parametrize("case", [load_case("thesis-1975"), torque_commanded()])
def test_bandwidth_is_that_asked_for(case: Case) -> None:
    # Sampled fast, and above the frequencies at which the load matters, the loop is
    # (w s + w^2/4)/(s + w/2)^2: critically damped, and w its crossover but for the integral.
    loop = DrumSpeedLoop.from_case(case, sample_time=5e-4, bandwidth=10.0)
    assert loop.bandwidth == 10.0
    omega = np.array([6.0, 10.0, 20.0, 40.0])
    made = sampled_loop(case, build_plant(case), loop.recursion(), 5e-4)
    found = sampled_response(case, made, ["drum.haul"], omega, source="reference.displacement")[
        "drum.haul"
    ]
    s = 1j * omega
    assert np.abs(found - (10.0 * s + 25.0) / (s + 5.0) ** 2).max() < 0.02


def test_a_regulated_drive_gets_the_reference_and_what_a_load_takes() -> None:
    case = load_case("subsea-crane")
    loop = DrumSpeedLoop.from_case(case)
    gain, friction = case.winch.motor.speed_gain, case.winch.motor.viscous_friction
    assert loop.proportional == 0.0
    assert loop.bandwidth == pytest.approx((gain + friction) / case.winch.inertia)
    speed = 0.4 * loop.motor.per_rope_speed
    m = Measurement.of(
        {"reference.velocity": 0.4, "motor.speed": speed, "drive.applied": loop.static}
    )
    asked = controller(loop).step(m, 0.0)
    assert asked == pytest.approx(speed * (1.0 + friction / gain) + loop.static, rel=1e-12)
    # The regulator of the drive droops under the static torque by that much.
    efficiency = case.winch.gearbox.efficiency
    hanging = case.static_torque * 0.5 * (1.0 / efficiency + efficiency)
    assert loop.static == pytest.approx(hanging / gain, rel=1e-6)


def test_bandwidth_follows_from_the_delays_in_the_loop() -> None:
    case = torque_commanded().replace({"winch.motor.torque_bandwidth": 100.0})
    loop = DrumSpeedLoop.from_case(case, sample_time=0.02)
    assert loop.bandwidth == pytest.approx(0.25 / (0.02 + 0.01))
    assert DrumSpeedLoop.from_case(case, sample_time=0.04).bandwidth == pytest.approx(5.0)


@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope", "subsea-crane", "torque"])
@pytest.mark.parametrize("sample_time", [0.005, 0.02, 0.05, 0.1, 1.0])
def test_by_default_it_is_stable_without_any_drag(name: str, sample_time: float) -> None:
    case = torque_commanded() if name == "torque" else load_case(name)
    loop = DrumSpeedLoop.from_case(case, sample_time=sample_time)
    poles = sampled_loop(case, build_plant(case), loop.recursion(), sample_time).poles()
    assert np.sort(np.abs(poles))[-1] == pytest.approx(1.0, abs=1e-9)  # the drum's position
    assert np.sort(np.abs(poles))[-2] < 1.0


@pytest.mark.parametrize("case", [load_case("thesis-1975"), load_case("subsea-crane")])
def test_a_wrong_static_command_is_made_up_for(case: Case) -> None:
    loop = DrumSpeedLoop.from_case(case)
    wrong = replace(loop, static=0.9 * loop.static)
    run = linear_run(case, controller(wrong), still, duration=60.0, drag=3e4)
    speed, last = run["motor.speed"], run["time"] > 50.0
    assert speed.min() < -0.05  # the load comes down at first
    assert np.abs(speed[last]).max() < 1e-3
    assert run["command"][-1] == pytest.approx(0.0, abs=1e-3 * loop.static)


def test_anti_windup_spares_the_overshoot_after_saturation() -> None:
    case = load_case("thesis-1975")
    own = DrumSpeedLoop.from_case(case, bandwidth=12.0)
    peaks = []
    for loop in (own, replace(own, tracking=0.0)):
        run = linear_run(
            case,
            controller(loop),
            still,
            reference=lambda t: (0.0, 0.5 if t > 1.0 else 0.0),
            duration=8.0,
            drag=3e4,
            limits=(-280.0, 280.0),  # little more than what 0.5 m/s takes
        )
        wanted = 0.5 * loop.motor.per_rope_speed
        assert run["command"].max() > 280.0
        peaks.append(run["motor.speed"].max() / wanted - 1.0)
    assert peaks[0] < 0.5 * peaks[1]


@pytest.mark.parametrize("sample_time", [0.01, 0.02])
def test_the_delay_is_that_of_the_sampled_loop(sample_time: float) -> None:
    case = torque_commanded()
    loop = DrumSpeedLoop.from_case(case, sample_time=sample_time)
    omega = np.array([6.0, 9.0])
    made = sampled_loop(case, build_plant(case), loop.recursion(), sample_time)
    found = sampled_response(case, made, ["drum.haul"], omega, source="reference.displacement")[
        "drum.haul"
    ]
    expected = [loop.delay_at(w) for w in omega]
    assert -np.angle(found) / omega == pytest.approx(expected, rel=0.05)


def test_no_more_speed_is_asked_for_than_the_motor_turns() -> None:
    case = load_case("thesis-1975")
    loop = DrumSpeedLoop.from_case(case)
    top = case.winch.speed_limit
    rest = {"drive.applied": loop.static, "motor.speed": top}
    m = Measurement.of({**rest, "reference.velocity": 100.0})
    assert controller(loop).step(m, 0.0) == pytest.approx(loop.static + loop.motor.feed * top)


def test_what_is_wrong_is_told() -> None:
    case = load_case("thesis-1975")
    with pytest.raises(InputError, match="bandwidth must be above 0 rad/s, got 0"):
        DrumSpeedLoop.from_case(case, bandwidth=0.0)
    with pytest.raises(InputError, match="drum-speed loop: sample_time must be in"):
        DrumSpeedLoop.from_case(case, sample_time=0.0)
    # Sampled, the double pole -w/2 lies at 1 - w T/2: within the circle up to w = 200 rad/s.
    for bandwidth, which in ((250.0, "with a"), (180.0, "with 2 times the gains of a")):
        text = (
            f"drum-speed loop: {which} bandwidth of {bandwidth:g} rad/s at a sample time of "
            r"0\.02 s the loop is unstable .* shorter"
        )
        with pytest.raises(SynthesisError, match=text):
            DrumSpeedLoop.from_case(case, bandwidth=bandwidth)
    DrumSpeedLoop.from_case(case, bandwidth=60.0)
