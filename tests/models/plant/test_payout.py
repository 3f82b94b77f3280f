"""Layers of the drum, and what the gear takes: what only a drum that moves far shows."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from former_cases import load_case
from hypothesis import given
from hypothesis import strategies as st
from one_run import simulate
from still_motion import StillMotion

from models.operation import Scenario, scenario_named
from models.operation.profile import Move, Profile
from models.plant import DrumTravel
from synth.controllers import LinearFeedback

CRANE = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.41}
RATIO, RADIUS = 100.0, 1.0


def evaluate(travel: DrumTravel, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x = ca.SX.sym("x")
    function = ca.Function("haul", [x], [*travel.haul(x, ca.SX(RADIUS), ca.SX(RATIO))])
    haul, radius = function.map(len(angle))(angle)
    return np.asarray(haul).ravel(), np.asarray(radius).ravel()


layers = st.lists(st.tuples(st.floats(0.5, 20.0), st.floats(0.5, 2.0)), max_size=3)


@pytest.mark.ci
@given(layers, layers)
def test_haul_is_the_integral_of_the_radius_in_use(
    outward: list[tuple[float, float]], inward: list[tuple[float, float]]
) -> None:
    def changes(steps: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        at = np.cumsum([step for step, _ in steps])
        return tuple((float(a), radius) for a, (_, radius) in zip(at, steps, strict=True))

    travel = DrumTravel(outward=changes(outward), inward=changes(inward))
    angle = np.linspace(-5000.0, 5000.0, 20001)
    haul, radius = evaluate(travel, angle)
    middle = 0.5 * (angle[1:] + angle[:-1])
    _, between = evaluate(travel, middle)
    # Trapezoid of a piecewise constant radius: off by at most one grid cell at every change.
    walked = np.concatenate([[0.0], np.cumsum(between * np.diff(angle) / RATIO)])
    walked -= walked[10000]
    cells = 2.0 * (angle[1] - angle[0]) / RATIO * (len(outward) + len(inward) + 1)
    np.testing.assert_allclose(haul, walked, atol=cells)
    assert (np.diff(haul) > 0.0).all()
    assert haul[10000] == 0.0
    assert radius[10000] == RADIUS


@given(layers.filter(bool))
def test_the_radius_changes_where_the_layer_ends(steps: list[tuple[float, float]]) -> None:
    at = np.cumsum([step for step, _ in steps])
    radii = [RADIUS, *(radius for _, radius in steps)]
    pairs = tuple((float(a), r) for a, (_, r) in zip(at, steps, strict=True))
    angle = np.linspace(0.0, 2.0 * RATIO * at[-1] / min(radii), 4001)
    for travel, sign in ((DrumTravel(outward=pairs), 1.0), (DrumTravel(inward=pairs), -1.0)):
        haul, radius = evaluate(travel, sign * angle)
        edges = np.abs(haul)[:, np.newaxis] - at
        clear = (np.abs(edges) > 1e-6).all(axis=1)
        expected = np.array(radii)[np.searchsorted(at, np.abs(haul))]
        np.testing.assert_allclose(radius[clear], expected[clear])


def test_the_layers_of_a_case_lie_around_its_rope_length() -> None:
    case = load_case("subsea-crane")
    travel = DrumTravel.from_case(case)
    drum, length, diameter = case.winch.drum, case.rope.length, case.rope.diameter
    for sign, changes in ((-1.0, travel.outward), (1.0, travel.inward)):
        assert changes
        before = case.drum_radius
        for haul, radius in changes:
            at = length + sign * haul
            assert drum.radius_at(at + sign * 1e-6, diameter) == pytest.approx(radius)
            assert drum.radius_at(at - sign * 1e-6, diameter) == pytest.approx(before)
            before = radius
    assert all(after < case.drum_radius for _, after in travel.inward)


def test_a_drum_with_a_given_radius_has_no_layers() -> None:
    assert DrumTravel.from_case(load_case("thesis-1975")) == DrumTravel()


def test_a_lowering_over_a_layer_changes_the_speed_of_the_rope() -> None:
    # At constant motor speed the rope slows with the radius, from layer to layer.
    case = load_case("subsea-crane")
    travel = DrumTravel.from_case(case)
    ends = travel.inward[0][0]
    move = Move(start=1.0, distance=-(ends + 40.0), speed=1.5, acceleration=0.3)
    down = Scenario(
        name="down", description="down", duration=move.end + 30.0, profile=Profile(moves=(move,))
    )
    controller = LinearFeedback(case, CRANE, sample_time=0.02)
    run = simulate(case, controller, scenario=down, hook=StillMotion())
    haul, time, speed = run["drum.haul"], run.time, run["motor.speed"]
    per_angle = np.gradient(haul, time)[2:-2] / speed[2:-2]
    turning = np.abs(speed[2:-2]) > 20.0
    first = turning & (haul[2:-2] > -ends + 5.0)
    second = turning & (haul[2:-2] < -ends - 5.0)
    ratio = case.winch.gearbox.ratio
    assert per_angle[first].mean() * ratio == pytest.approx(case.drum_radius, rel=1e-3)
    assert per_angle[second].mean() * ratio == pytest.approx(travel.inward[0][1], rel=1e-3)
    assert run.completed


@pytest.mark.parametrize(("distance", "loss"), [(30.0, "hauling"), (-30.0, "lowering")])
def test_the_gear_takes_its_share_in_both_directions(distance: float, loss: str) -> None:
    case = load_case("subsea-crane")
    move = Move(start=1.0, distance=distance, speed=1.0, acceleration=0.5)
    scenario = Scenario(name=loss, description=loss, duration=28.0, profile=Profile(moves=(move,)))
    controller = LinearFeedback(case, CRANE, sample_time=0.02)
    run = simulate(case, controller, scenario=scenario, hook=StillMotion())
    steady = (run.time > 15.0) & (run.time < 28.0)
    speed = run["motor.speed"][steady].mean()
    torque = run["motor.torque"][steady].mean() - case.winch.viscous_friction * speed
    load = (run["rope.tension"] * case.drum_radius / case.winch.gearbox.ratio)[steady].mean()
    efficiency = case.winch.gearbox.efficiency
    expected = load / efficiency if distance > 0.0 else load * efficiency
    assert torque == pytest.approx(expected, rel=2e-3)


def test_engaging_is_without_a_bump() -> None:
    # The command is taken up over the ramp: at no sample by more than the ramp's own slope of it,
    # where without a ramp it jumps at once.
    case = load_case("subsea-crane")
    controller = LinearFeedback(case, CRANE, sample_time=0.02)
    jumps = {}
    for ramp in ("20 s", "0 s"):
        scenario = scenario_named("engage", case, ramp=ramp)
        run = simulate(case, controller, scenario=scenario, seed=3, store_step=0.02)
        command = run["drive.command"]
        around = (run.time > 59.0) & (run.time < 85.0)
        jumps[ramp] = np.abs(np.diff(command[around])).max()
        # the brake was on before, and is on again after it has disengaged
        assert (run["motor.speed"][run.time < 59.9] == 0.0).all()
        assert (run["motor.speed"][-50:] == 0.0).all()
    assert jumps["20 s"] < 0.2 * jumps["0 s"]
