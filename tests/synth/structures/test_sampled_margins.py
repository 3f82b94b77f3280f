"""Margins of sampled loops against poles, brute force, finer sampling and the continuous loop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from designs import THESIS_GAINS, structure_design, thesis_design

from models import load_case
from models.basics import InputError
from models.plant import build_plant, zero_order_hold
from models.sensing import HEARD, Recursion
from synth.controllers import LinearFeedback, VelocityFeedForward
from synth.structures import (
    BrokenLoop,
    SampledLoop,
    make_recursion,
    margins_of,
    sampled_loop,
    sampled_margins,
)

CRANE = {
    "A": 1.0,
    "a": 1.9131323291168159,
    "a1": 16.978631537992428,
    "a2": 3.337765584000905,
}
DRUM = {
    "payload.acceleration_gain": 0.3913175905215994,
    "payload.velocity_gain": 6.1366827861675874,
    "payload.position_gain": 12.610626304627434,
    "drum.position_gain": 7.5,
    "rolloff.corner": 4.550178810372445,
    "rolloff.damping": 0.2,
}


def crane_loop(T: float, **more: float) -> SampledLoop:
    """Feedback with states of payload and drum, each late by another time."""
    case = load_case("subsea-crane")
    design = structure_design(case, "drum-feedback", DRUM, 3)
    law = LinearFeedback.from_design(design, sample_time=T)
    return sampled_loop(case, build_plant(case, 3), law.recursion, T, drag=design.drag, **more)


def whole_loop(T: float = 0.02) -> SampledLoop:
    """The same with delays of whole samples, which the loop's own poles are exact for."""
    loop = crane_loop(T)
    plant = replace(loop.plant, delays=(0.04, 0.06, 0.04))
    return replace(loop, plant=plant, command_delay=0.02)


def with_gain(loop: SampledLoop, factor: float) -> SampledLoop:
    """The loop with another gain of the drive, of which the recursion does not hear."""
    p = loop.plant
    return replace(loop, plant=replace(p, B=factor * p.B, D=factor * p.D, Dz=factor * p.Dz))


def radius(loop: SampledLoop) -> float:
    return float(np.abs(loop.poles()).max())


def test_poles_are_those_of_the_loop_where_delays_are_whole_samples() -> None:
    loop = whole_loop()
    exact = BrokenLoop(loop=loop).poles
    own = loop.poles()
    for z in own[np.abs(own) > 0.05]:
        assert np.abs(exact - z).min() < 1e-8
    assert np.abs(exact).max() == pytest.approx(radius(loop), rel=1e-12)


def test_gain_margins_put_a_pole_on_the_unit_circle() -> None:
    loop = whole_loop()
    margins = BrokenLoop(loop=loop).margins
    assert margins is not None
    assert 0.0 < margins.gain_down < 1.0 < margins.gain < math.inf
    for factor in (margins.gain, margins.gain_down):
        assert radius(with_gain(loop, factor)) == pytest.approx(1.0, abs=1e-9)
    assert with_gain(loop, 0.999 * margins.gain).stable
    assert not with_gain(loop, 1.001 * margins.gain).stable
    assert not with_gain(loop, 0.999 * margins.gain_down).stable


def test_gain_margin_holds_between_samples_too() -> None:
    loop = crane_loop(0.007)  # 30 ms of telemetry are four samples and a bit
    margins = BrokenLoop(loop=loop).margins
    assert margins is not None
    for factor, below in ((margins.gain, 0.999), (margins.gain_down, 1.001)):
        assert BrokenLoop(loop=with_gain(loop, factor * below)).stable
        assert not BrokenLoop(loop=with_gain(loop, factor / below**2)).stable


def test_delay_margin_is_that_of_further_samples() -> None:
    loop = whole_loop(0.002)
    margins = BrokenLoop(loop=loop).margins
    assert margins is not None
    count = math.floor(margins.delay / 0.002)
    assert count > 2
    for further, stable in ((count, True), (count + 1, False)):
        late = BrokenLoop(loop=loop, more_delay=further * 0.002)
        own = replace(loop, command_delay=loop.command_delay + further * 0.002)
        own = replace(
            own,
            plant=replace(
                own.plant, delays=tuple(delay + further * 0.002 for delay in own.plant.delays)
            ),
        )
        assert late.stable is stable
        assert (late.margins is not None) is stable
        assert own.stable is stable


def test_margins_are_those_of_a_dense_grid() -> None:
    broken = BrokenLoop(loop=crane_loop(0.007))
    margins = broken.margins
    assert margins is not None
    omega = np.concatenate(
        [np.geomspace(1e-3, math.pi / 0.007, 60_000), margins.peak + np.linspace(-0.01, 0.01, 2001)]
    )
    omega = np.sort(omega[(omega > 0.0) & (omega <= math.pi / 0.007)])
    L = broken.gain(omega)
    assert margins.max_sensitivity == pytest.approx(np.abs(1.0 / (1.0 + L)).max(), rel=1e-7)
    crosses = np.flatnonzero((np.abs(L[:-1]) > 1.0) != (np.abs(L[1:]) > 1.0))
    turn = np.angle(-L[crosses])
    assert margins.phase == pytest.approx(np.abs(turn).min(), abs=1e-3)
    assert margins.delay == pytest.approx(
        (np.mod(turn, 2 * np.pi) / omega[crosses]).min(), rel=1e-2
    )


def test_gain_is_that_of_a_finer_simulation_of_delays_within_a_sample() -> None:
    """By substeps: the answer of the open loop to a command that is exp(i omega t) at samples."""
    T, parts, omega = 0.03, 6, 7.0
    loop = crane_loop(T)
    delays = (0.025, 0.040, 0.010)  # of 5, 8 and 2 substeps
    loop = replace(loop, plant=replace(loop.plant, delays=delays), command_delay=0.005)
    broken = BrokenLoop(loop=loop)
    # The law hears payload and drum; each of its gains alone, by its Jacobian at that frequency.
    J, z = loop.controller, np.exp(1j * omega * T)
    heard = [HEARD.index(name) for name in loop.plant.measurements]
    heard += [HEARD.index("drum.haul"), HEARD.index("motor.speed")]
    late = [*(round(d / T * parts) for d in delays), 1, 1]
    p = loop.plant
    C = np.vstack([p.C, p.Cz[[p.outputs.index("drum.haul"), p.outputs.index("motor.speed")]]])
    assert not p.D.any()
    Phi, Gamma = zero_order_hold(p.A, p.B, T / parts)
    # Stationary: x at a sample, and at the substeps after it, with u held.
    n = len(Phi)
    whole, by = (
        np.linalg.matrix_power(Phi, parts),
        sum(np.linalg.matrix_power(Phi, k) @ Gamma for k in range(parts)),
    )
    x = [np.linalg.solve(z * np.eye(n) - whole, by)[:, 0]]
    for _ in range(parts - 1):
        x.append(Phi @ x[-1] + Gamma[:, 0])
    shown = []
    for row, count in zip(C, late, strict=True):
        back = math.ceil(count / parts)
        shown.append(row @ x[back * parts - count] * z ** (-back))
    applied = HEARD.index("drive.applied")
    m = len(J.into_state)
    inner = np.block(
        [
            [z * np.eye(m) - J.into_state, -J.into_measured[:, [applied]] / z],
            [-J.on_state, 1.0 - J.on_measured[:, [applied]] / z],
        ]
    )
    right = np.concatenate([J.into_measured[:, heard] @ shown, J.on_measured[:, heard] @ shown])
    expected = -np.linalg.solve(inner, right)[-1]
    assert broken.gain(np.array([omega]))[0] == pytest.approx(expected, rel=1e-9)


def test_more_delay_turns_the_gain_by_whole_samples() -> None:
    loop, omega = crane_loop(0.01), np.array([0.3, 2.0, 40.0, 300.0])
    before = BrokenLoop(loop=loop).gain(omega)
    after = BrokenLoop(loop=loop, more_delay=0.03).gain(omega)
    np.testing.assert_allclose(after, before * np.exp(-0.03j * omega), rtol=1e-9)


def test_margins_come_to_the_continuous_ones_in_first_order() -> None:
    case = load_case("subsea-crane")
    design = structure_design(case, "payload-feedback", CRANE, 3)
    margins = design.margins
    assert margins is not None
    assert design.friction > 0.0
    errors = []
    for T in (0.004, 0.002):
        law = LinearFeedback.from_design(design, sample_time=T)
        found = sampled_margins(
            case, law.recursion, T, masses=3, drag=design.drag, friction=design.friction
        )
        assert found is not None
        assert found.delay == pytest.approx(margins.delay - 0.5 * T, abs=0.02 * T)
        errors.append(found.max_sensitivity / margins.max_sensitivity - 1.0)
    assert abs(errors[0]) < 0.01
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.05)


def test_thesis_gains_lose_half_a_sample_of_their_delay() -> None:
    design, T = thesis_design(), 0.001
    assert design.margins is not None
    law = LinearFeedback(design.case, THESIS_GAINS, sample_time=T)
    found = sampled_margins(design.case, law.recursion, T, drag=design.drag)
    assert found is not None
    assert found.max_sensitivity == pytest.approx(design.margins.max_sensitivity, rel=2e-2)
    assert found.delay == pytest.approx(design.margins.delay - 0.5 * T, abs=2e-5)


def test_friction_counts_with_it_and_without() -> None:
    case = load_case("subsea-crane")
    law = LinearFeedback(case, CRANE, sample_time=0.02)
    both = sampled_margins(case, law.recursion, 0.02, masses=1, drag=5e3, friction=80.0)
    loops = [
        BrokenLoop(
            loop=sampled_loop(
                case, build_plant(case, 1), law.recursion, 0.02, drag=5e3, friction=own
            )
        )
        for own in (80.0, 0.0)
    ]
    alone = [loop.margins for loop in loops]
    assert both is not None
    assert alone[0] is not None
    assert alone[1] is not None
    assert alone[0].max_sensitivity != pytest.approx(alone[1].max_sensitivity, rel=1e-6)
    assert both.max_sensitivity == pytest.approx(
        max(m.max_sensitivity for m in alone if m is not None), rel=1e-9
    )
    assert margins_of(loops).delay == pytest.approx(both.delay)  # type: ignore[union-attr]


def test_a_drum_that_is_not_held_in_place_has_margins() -> None:
    case = load_case("subsea-crane")
    law = VelocityFeedForward(case)
    found = sampled_margins(case, law.recursion, 0.02)
    assert found is not None
    assert 1.0 <= found.max_sensitivity < 3.0


def test_an_unstable_loop_has_none() -> None:
    case = load_case("thesis-1975-rope")
    law = LinearFeedback(case, THESIS_GAINS)
    assert sampled_margins(case, law.recursion, 0.005) is None


def silent(case_T: float) -> tuple[SampledLoop, Recursion]:
    case = load_case("thesis-1975")
    recursion = make_recursion([0.0], lambda state, m: (state, m["reference.velocity"]))
    return sampled_loop(case, build_plant(case), recursion, case_T, drag=1e3), recursion


def test_a_law_that_hears_nothing_of_its_plant_has_no_loop() -> None:
    broken = BrokenLoop(loop=silent(0.01)[0])
    assert not broken.hears
    assert BrokenLoop(loop=crane_loop(0.01)).hears
    assert not broken.gain(np.array([1.0])).any()


def test_gain_at_a_pole_is_refused() -> None:
    loop = crane_loop(0.01)
    plant = replace(loop.plant, A=np.zeros_like(loop.plant.A))  # all integrate
    with pytest.raises(InputError, match="the gain is asked for at a pole of plant or controller"):
        BrokenLoop(loop=replace(loop, plant=plant)).gain(np.array([0.0]))
