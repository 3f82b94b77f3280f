"""Constant tension: less tension variation, a payload that is free, and a gain with a margin."""

from __future__ import annotations

import numpy as np
import pytest
from former_cases import load_case
from linear_runs import linear_run, still, swell
from sampled_response import sampled_response

from models.basics import InputError, SynthesisError
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import HEARD, Measurement
from synth.controllers import ConstantTension
from synth.structures.recursive import at_rest

CASES = ("thesis-1975", "thesis-1975-rope", "subsea-crane")


def rest(name: str, **changes: float) -> Measurement:
    """What is measured at rest, some of it changed by so much."""
    m = at_rest(build_plant(load_case(name)).operating_point(MEAN_LOSSES)).values.copy()
    for key, change in changes.items():
        m[HEARD.index(key.replace("_", ".", 1))] += change
    return Measurement(m)


@pytest.mark.parametrize("name", CASES)
def test_tension_varies_less_than_with_the_drum_held(name: str) -> None:
    case, omega, drag = load_case(name), np.array([0.5, 0.8, 1.0, 1.5]), 2e4
    loop = ConstantTension(case).linear_loop(case, drag=drag)
    found = np.abs(sampled_response(case, loop, ["rope.tension"], omega)["rope.tension"])
    # The drum held: K (1 - P/Z) of a mass on a spring, the rope's inner modes being far above.
    data = build_plant(case).data
    K, m = data.stiffness, data.rope_mass
    mass = data.payload_mass + (m if data.lumping == "thesis" else m / 3.0)
    held = np.abs(K * (1.0 - K / (K - mass * omega**2 + 1j * omega * drag)))
    assert (found < 0.85 * held).all()


def test_in_a_run_with_its_dead_band_tension_stays_near_the_set_point() -> None:
    case = load_case("thesis-1975")
    controller = ConstantTension(case)
    run = linear_run(case, controller, swell(0.8, 0.8), duration=60.0, drag=2e4)
    late = run["time"] > 30.0
    assert controller.dead_band == 0.02
    variation = np.abs(run["rope.tension"][late]).max() / controller.set_point
    assert 0.02 < variation < 0.06
    K, M = 8e4, 89_888.0
    held = abs(K * (1.0 - K / (K - M * 0.64 + 0.8j * 2e4))) * 0.8 / controller.set_point
    assert variation < 0.4 * held


def test_too_much_tension_pays_out_and_too_little_hauls_in() -> None:
    controller = ConstantTension(load_case("thesis-1975"))
    static = controller.loop.static
    high = controller.step(rest("thesis-1975", rope_tension=3e4), 0.0)
    controller.reset()
    low = controller.step(rest("thesis-1975", rope_tension=-3e4), 0.0)
    assert high < static < low
    assert high - static == pytest.approx(static - low)
    # 30 kN less the dead band, times the gain: a speed of the rope, at (feed + Kp) n/r.
    loop, beyond = controller.loop, 3e4 - 0.02 * controller.set_point
    speed = controller.gain * beyond * loop.motor.per_rope_speed
    assert low - static == pytest.approx((loop.motor.feed + loop.proportional) * speed)


def test_within_the_dead_band_nothing_is_done() -> None:
    controller = ConstantTension(load_case("subsea-crane"), dead_band=0.03)
    band = 0.03 * controller.set_point
    for deviation in (0.99 * band, -0.99 * band):
        for _ in range(10):
            m = rest("subsea-crane", rope_tension=deviation)
            assert controller.step(m, 0.0) == controller.loop.static


def test_tension_is_all_that_it_hears_of_the_load() -> None:
    controller = ConstantTension(load_case("subsea-crane"))
    plain = controller.step(rest("subsea-crane", rope_tension=4e4), 0.0)
    controller.reset()
    elsewhere = rest(
        "subsea-crane",
        rope_tension=4e4,
        payload_displacement=3.0,
        payload_velocity=1.0,
        payload_acceleration=-1.0,
        mru_heave=2.0,
        mru_heave_rate=-1.0,
    )
    assert controller.step(elsewhere, 0.0) == plain


def test_the_payload_may_be_anywhere() -> None:
    case = load_case("thesis-1975")
    start = {"motor.angle": 37.0 / 0.413, "payload.displacement": 1.0}  # all is 1 m higher
    free = ConstantTension(case, centring=0.0)
    run = linear_run(case, free, still, duration=60.0, drag=2e4, start=start)
    assert run["payload.displacement"][-1] == pytest.approx(1.0, abs=1e-9)
    # But for an operator who winds it back: the same exponential whatever the tension says.
    wound = ConstantTension(case, centring=0.05)
    run = linear_run(case, wound, still, duration=60.0, drag=2e4, start=start)
    halves = run["payload.displacement"][[1000, 2000]]
    assert halves[1] / halves[0] == pytest.approx(np.exp(-0.05 * 20.0), rel=0.1)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("sample_time", [0.01, 0.02, 0.05])
def test_gain_has_a_margin_of_two_without_any_drag(name: str, sample_time: float) -> None:
    case = load_case(name)
    controller = ConstantTension(case, sample_time=sample_time)
    fastest = 0.25 * controller.loop.bandwidth / build_plant(case).data.stiffness
    assert 0.0 < controller.gain <= fastest * (1.0 + 1e-12)
    for factor in (0.5, 1.0, 2.0):
        assert controller.linear_loop(case, gain=factor * controller.gain).stable


def test_a_gain_that_shakes_the_rope_is_refused() -> None:
    case = load_case("subsea-crane")
    gain = 10.0 * ConstantTension(case).gain
    with pytest.raises(SynthesisError, match=r"the tension is not stable on the linear plant"):
        ConstantTension(case, gain=gain)


def test_where_no_gain_will_do_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    # Without any damping, and with a drum that is late, hardly any gain suits the rope's modes.
    case = load_case("thesis-1975-rope").replace({"rope.damping_ratio": 0.0})
    assert ConstantTension(case, sample_time=0.1).gain * build_plant(case).data.stiffness < 0.01
    monkeypatch.setattr("synth.controllers.constant_tension._TRIES", 5)
    with pytest.raises(SynthesisError, match=r"no gain is stable .* sample time of 0\.1 s"):
        ConstantTension(case, sample_time=0.1)


def test_dead_band_covers_the_load_cells_noise() -> None:
    case = load_case("subsea-crane")
    assert ConstantTension(case).dead_band == 0.02
    noisy = case.replace({"sensors.load_cell.noise_fraction": 0.04})
    assert ConstantTension(noisy).dead_band == 0.08
    assert ConstantTension(load_case("thesis-1975")).dead_band == 0.02


def test_set_point_is_the_load_at_rest_unless_given() -> None:
    case = load_case("thesis-1975")
    assert ConstantTension(case).set_point == pytest.approx(case.static_tension)
    higher = ConstantTension(case, set_point=5.5e5)
    assert higher.step(rest("thesis-1975"), 0.0) > higher.loop.static


def test_numbers_out_of_range_are_told() -> None:
    case = load_case("thesis-1975")
    for changes, text in (
        ({"set_point": -1.0}, r"constant tension: set_point must be in \[0, 4\.52.*e\+06\] N"),
        ({"dead_band": 1.5}, r"dead_band must be in \[0, 1\], got 1\.5"),
        ({"gain": 0.0}, "gain must be above 0 m/s/N, got 0"),
        ({"centring": -0.1}, r"centring must be in \[0, 1\] 1/s, got -0\.1"),
    ):
        with pytest.raises(InputError, match=text):
            ConstantTension(case, **changes)


def test_the_gain_is_that_of_the_load_at_rest_whatever_the_set_point() -> None:
    # Far from its set-point the speed limit was all that the linear loop saw.
    case = load_case("landing")
    usual = ConstantTension(case)
    assert ConstantTension(case, set_point=0.3 * usual.set_point).gain == usual.gain
