"""Velocity feed-forward: what is left of the hook's motion, and what becomes of a lost MRU."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from linear_runs import linear_run, sine_part, still, swell
from sampled_response import sampled_response

from models import Case
from models.basics import InputError, SynthesisError
from models.plant import build_plant
from models.sensing import Measurement
from models.vessel import hook_rao
from synth.controllers import VelocityFeedForward
from synth.controllers.feed_forward import lead_of
from synth.structures import DrumSpeedLoop, sampled_loop

CASES = ("thesis-1975", "thesis-1975-rope", "subsea-crane")


def without_filter(name: str) -> Case:
    """A bundled case whose MRU shows the heave at all frequencies."""
    case = load_case(name)
    if case.sensors.mru is None:
        return case
    return case.replace({"sensors.mru.heave_filter_period": None})


def short_filter() -> Case:
    """The crane with an MRU whose heave filter is in the way."""
    return load_case("subsea-crane").replace({"sensors.mru.heave_filter_period": "30 s"})


def residual(controller: VelocityFeedForward, case: Case, omega: float) -> complex:
    """1 + X/Z: what the upper end of the rope still moves."""
    loop = sampled_loop(case, build_plant(case), controller.recursion, controller.sample_time)
    return 1.0 + complex(sampled_response(case, loop, ["drum.haul"], [omega])["drum.haul"][0])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("share", [0.5, 0.9, 1.0])
def test_slow_heave_is_left_but_for_its_share(name: str, share: float) -> None:
    case = without_filter(name)
    controller = VelocityFeedForward(case, share=share)
    loop = sampled_loop(case, build_plant(case), controller.recursion, 0.02)
    found = sampled_response(case, loop, ["payload.displacement"], [0.05])
    assert abs(found["payload.displacement"][0]) == pytest.approx(1.0 - share, abs=0.004)


@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_slow_heave_is_left_but_for_its_share_in_a_run_too(name: str) -> None:
    case, omega = without_filter(name), 0.2
    controller = VelocityFeedForward(case, position_gain=0.2)
    run = linear_run(case, controller, swell(omega), duration=120.0, drag=5e4)
    late = run["time"] > 120.0 - 2.0 * np.pi / omega
    left = sine_part(run["time"][late], run["payload.displacement"][late], omega)
    assert abs(left) == pytest.approx(0.1, abs=0.01)


def test_on_a_long_rope_the_payload_resonates_with_what_is_left() -> None:
    # 2000 m of rope: the payload's resonance, 1.0 rad/s, lies amid the waves.
    case = load_case("thesis-1975-rope")
    controller = VelocityFeedForward(case)
    loop = sampled_loop(case, build_plant(case), controller.recursion, 0.02, drag=5e3)
    found = sampled_response(case, loop, ["payload.displacement", "drum.haul"], [1.0])
    assert abs(1.0 + found["drum.haul"][0]) < 0.12
    assert abs(found["payload.displacement"][0]) > 1.0


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("sample_time", [0.01, 0.02, 0.05])
def test_drum_and_trim_are_stable_without_any_drag(name: str, sample_time: float) -> None:
    case = load_case(name)
    for controller in (
        VelocityFeedForward(case, sample_time=sample_time),
        VelocityFeedForward.with_lead(case, sample_time=sample_time),
    ):
        loop = sampled_loop(case, build_plant(case), controller.recursion, sample_time)
        moving = np.abs(loop.poles())
        assert moving.max() < 1.0


def test_lead_makes_up_for_a_late_mru() -> None:
    late = without_filter("subsea-crane").replace({"sensors.mru.delay": 0.25})
    omega = 0.77

    def haul(controller: VelocityFeedForward) -> complex:
        loop = sampled_loop(late, build_plant(late), controller.recursion, 0.02)
        return complex(sampled_response(late, loop, ["drum.haul"], [omega])["drum.haul"][0])

    # X/Z is to be -0.9; what is late turns it, what looks ahead turns it back.
    angle = omega * (0.25 + DrumSpeedLoop.from_case(late).delay_at(omega))
    without, ahead = haul(VelocityFeedForward(late)), haul(VelocityFeedForward.with_lead(late))
    assert np.angle(-without) == pytest.approx(-angle, rel=0.05)
    assert abs(np.angle(-ahead)) < 0.1 * angle
    assert abs(1.0 + ahead) < 0.1 < 0.2 < abs(1.0 + without)


def test_lead_is_the_sum_of_what_is_late() -> None:
    case = load_case("subsea-crane")
    late = case.replace({"sensors.mru.delay": 0.27})
    assert lead_of(late) - lead_of(case) == pytest.approx(0.25)
    # At the zero-crossing frequency of the hook's velocity, by moments of a plain sum.
    w = np.linspace(1e-3, 60.0, 1_200_001)
    density = abs(hook_rao(case.vessel).response(w)) ** 2 * case.sea.to_spectrum().density(w)
    omega = np.sqrt(np.sum(w**4 * density) / np.sum(w**2 * density))
    expected = 0.02 + DrumSpeedLoop.from_case(case).delay_at(omega)
    assert lead_of(case) == pytest.approx(expected, rel=1e-6)
    assert VelocityFeedForward.with_lead(case).lead == lead_of(case)
    assert VelocityFeedForward.with_lead(case).name == "feed-forward-lead"
    assert VelocityFeedForward(case).name == "feed-forward"


def test_lead_is_that_of_a_line_through_a_filtered_slope() -> None:
    # The drum standing still, the command is linear in the heave rate: with a lead it is
    # 1 + i omega lead/(1 + i omega/omega_f) times that without, the slope half a sample old.
    case, omega, T = load_case("thesis-1975"), 0.6, 0.02
    asked = []
    for lead in (0.0, 0.3):
        controller = VelocityFeedForward(case, lead=lead, position_gain=0.0)
        time, found, applied = T * np.arange(3000.0), [], controller.loop.static
        for t in time:
            m = {"mru.heave_rate": 0.1 * np.sin(omega * t), "mru.valid": 1.0}
            applied = controller.step(Measurement.of({**m, "drive.applied": applied}), t)
            found.append(applied)
        asked.append(sine_part(time[1000:], np.array(found[1000:]), omega))
    slope = 1j * omega * np.exp(-0.5j * omega * T) / (1.0 + 1j * omega / 8.0)
    assert asked[1] / asked[0] == pytest.approx(1.0 + 0.3 * slope, rel=2e-3)


def test_a_heave_filter_turns_the_waves() -> None:
    case, omega = short_filter(), 0.77
    left = abs(residual(VelocityFeedForward(case), case, omega))
    corner, s = 2.0 * np.pi / 30.0, 1j * omega
    shown = s**2 / (s**2 + np.sqrt(2.0) * corner * s + corner**2)
    assert left == pytest.approx(abs(1.0 - 0.9 * shown), rel=0.1)
    assert left > 0.35


def test_the_first_heave_rate_makes_no_acceleration() -> None:
    case = load_case("thesis-1975")
    m = Measurement.of({"mru.heave_rate": 0.3, "mru.valid": 1.0})
    plain, ahead = (VelocityFeedForward(case, lead=lead, position_gain=0.0) for lead in (0.0, 0.5))
    for _ in range(2):  # after a reset it is the first one again
        assert ahead.step(m, 0.0) == plain.step(m, 0.0)
        ahead.reset()
        plain.reset()


def test_a_lost_mru_fades_out_and_in_again() -> None:
    case = load_case("thesis-1975")
    controller = VelocityFeedForward(case, position_gain=0.0, fade=2.0)
    state, strengths = controller.recursion.initial, []
    for k in range(400):
        valid = not 100 <= k < 250
        m = Measurement.of({"mru.heave_rate": 1.0, "mru.valid": float(valid)})
        state, _ = controller.recursion.function(state, m.values)
        strengths.append(float(state[2]))
    found = np.array(strengths)
    assert (found[:100] == 1.0).all()
    assert found[100:200] == pytest.approx(1.0 - np.arange(1, 101) / 100.0)
    assert found[200:250] == pytest.approx(np.zeros(50), abs=1e-12)
    assert found[250:350] == pytest.approx(np.arange(1, 101) / 100.0)
    assert found[350:] == pytest.approx(np.ones(50))


def test_without_the_mru_the_drum_comes_to_rest_in_its_middle() -> None:
    case = without_filter("subsea-crane")
    controller = VelocityFeedForward(case, position_gain=0.2)
    run = linear_run(
        case, controller, swell(0.8), duration=70.0, drag=1e5, mru_valid=lambda t: t < 20.0
    )
    compensating = (run["time"] > 10.0) & (run["time"] < 20.0)
    assert np.abs(run["drum.haul"][compensating]).max() > 0.8
    # What is left is the drum giving way to the tension.
    assert np.abs(run["drum.haul"][run["time"] > 50.0]).max() < 0.1


def test_the_trim_brings_the_drum_back_at_its_own_rate() -> None:
    case = load_case("thesis-1975")
    controller = VelocityFeedForward(case, position_gain=0.1)
    start = {"motor.angle": 2.0 * controller.loop.motor.per_rope_speed, "payload.displacement": 2.0}
    run = linear_run(case, controller, still, duration=40.0, drag=1e5, start=start)
    at = [round(t / 0.02) for t in (10.0, 30.0)]
    ratio = run["drum.haul"][at[1]] / run["drum.haul"][at[0]]
    assert ratio == pytest.approx(np.exp(-0.1 * 20.0), rel=0.1)
    free = VelocityFeedForward(case, position_gain=0.0)
    run = linear_run(case, free, still, duration=40.0, drag=1e5, start=start)
    assert run["drum.haul"][-1] == pytest.approx(2.0, abs=1e-6)


def test_the_trim_does_not_take_waves_for_drift() -> None:
    # By a rate alone the trim would turn the phase by g/omega: 0.25 rad here.
    case = load_case("thesis-1975")
    left = [
        abs(residual(VelocityFeedForward(case, position_gain=g), load_case("thesis-1975"), 0.4))
        for g in (0.001, 0.1)
    ]
    assert left[0] == pytest.approx(left[1], abs=0.003)


def test_numbers_out_of_range_are_told() -> None:
    case = load_case("thesis-1975")
    for changes, text in (
        ({"share": 1.2}, r"feed-forward: share must be in \[0, 1\], got 1\.2"),
        ({"lead": -0.1}, r"lead must be in \[0, 10\] s, got -0\.1"),
        ({"position_gain": 2.0}, r"position_gain must be in \[0, 1\] 1/s, got 2"),
        ({"fade": -1.0}, r"fade must be in \[0, 60\] s"),
        ({"bandwidth": -3.0}, "drum-speed loop: bandwidth must be above 0 rad/s"),
    ):
        with pytest.raises(InputError, match=text):
            VelocityFeedForward(case, **changes)
    rope = load_case("thesis-1975-rope")
    with pytest.raises(SynthesisError, match=r"position gain of 1 1/s at a sample time of 5 s"):
        VelocityFeedForward(rope, position_gain=1.0, sample_time=5.0)
