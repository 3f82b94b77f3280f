from __future__ import annotations

import math

import cvxpy as cp
import numpy as np
import pytest
from former_cases import load_case
from one_run import simulate

import stillhook as sh
from models.operation import Motion, SineMotion, SpectrumMotion
from models.plant import DriveLimits
from mpc.floor import clairvoyant
from mpc.floor.certificate import certify, rollout
from mpc.floor.plant import record_plant
from mpc.floor.problem import RHO, RecordProblem
from mpc.floor.qp import solve_record


def case_at(height: float, name: str = "thesis-1975") -> sh.Case:
    return load_case(name).replace({"sea.significant_height": height})


def record_of(case: sh.Case, duration: float, seed: int, step: float = 0.05) -> Motion:
    return SpectrumMotion.from_case(case).motion(duration, step, seed)


def posed(
    case: sh.Case, duration: float, seed: int, step: float = 0.05, **options: object
) -> RecordProblem:
    record = record_of(case, duration, seed, step)
    z, v, a = record.block(0, record.rows)
    plant = record_plant(case, sample_time=step, drag=500.0, **options)  # type: ignore[arg-type]
    return RecordProblem(
        plant=plant,
        heave=z,
        rate=v,
        acceleration=a,
        first=0,
        minimum_tension=0.0,
        start=None,
    )


def brute_force(problem: RecordProblem) -> float:
    p, N = problem.plant, problem.samples
    x, i = cp.Variable((N + 1, len(p.states))), cp.Variable((N, p.inputs))
    hook = np.stack(
        [problem.heave[:-1], problem.rate[:-1], problem.heave[1:], problem.rate[1:]], axis=1
    )
    limits = [x[1:] == x[:-1] @ p.Phi.T + i @ p.Gamma.T + hook @ p.Psi.T]
    for end in (0, 1):
        at = x[end : end + N]
        own = i[:, end] if p.hold == "line" else i[:, 0] - at @ p.feedback
        for a, b in p.windows:
            limits.append(cp.abs(a * (p.static_demand + own) + b * (at @ p.speed)) <= 1.0)
    for row, feed, static in zip(p.tensions, p.tension_feed, p.static_tensions, strict=True):
        limits.append(1.0 + (x[:-1] @ row + hook[:, :2] @ feed) / static >= 0.0)
    # The floor's own regularisation, of deviations from the still payload.
    extra = cp.sum_squares(i - problem.still_inputs) + cp.sum_squares(x[0] - problem.still[0])
    cost = 1e4 * (cp.sum_squares(x @ p.payload) + RHO * extra)
    cp.Problem(cp.Minimize(cost), limits).solve(
        solver=cp.CLARABEL, tol_gap_abs=1e-8, tol_gap_rel=1e-8, tol_feas=1e-8, max_iter=500
    )
    assert x.value is not None
    return float(np.sqrt(np.mean((x.value @ p.payload) ** 2)))


def rms(problem: RecordProblem, block: int | None = None) -> float:
    solution = solve_record(problem, block=block)
    y = rollout(problem, solution.start, solution.inputs)
    return float(np.sqrt(np.mean((y @ problem.plant.payload) ** 2)))


@pytest.mark.parametrize(
    ("name", "hold", "masses"),
    [
        ("thesis-1975", "line", None),
        ("thesis-1975", "command", None),
        ("thesis-1975-rope", "line", 4),
    ],
)
def test_the_floor_is_that_of_a_brute_force_statement_of_the_same_problem(
    name: str, hold: str, masses: int | None
) -> None:
    problem = posed(case_at(3.75, name), 20.0, 3, hold=hold, masses=masses)
    by_hand = brute_force(problem)
    assert by_hand > 0.02  # saturated
    assert rms(problem) == pytest.approx(by_hand, rel=1e-5)


def test_the_length_of_blocks_changes_nothing() -> None:
    problem = posed(case_at(3.75), 20.0, 3)
    found = [rms(problem, block=size) for size in (1, 3, 7, 16)]
    assert found == pytest.approx([found[0]] * 4, rel=1e-6)


@pytest.mark.parametrize(("name", "seconds"), [("thesis-1975", 60.0), ("thesis-1975-rope", 30.0)])
def test_the_certificate_closes_the_gap(name: str, seconds: float) -> None:
    case = case_at(3.75, name)
    floor = clairvoyant(case, record_of(case, seconds, 1), masses=None, drag=500.0)
    proof = floor.certificate
    assert proof.primal < 1e-9
    assert proof.dual < 1e-3
    assert proof.complementarity < 1e-5
    assert 0.995 * floor.payload_rms < floor.lower_bound <= floor.payload_rms


def test_a_certificate_finds_a_solution_that_is_not_optimal() -> None:
    problem = posed(case_at(3.75), 20.0, 3)
    solution = solve_record(problem)
    good = certify(problem, solution)
    solution.inputs[100] *= 0.9
    bad = certify(problem, solution)
    assert bad.lower_bound < 0.5 * good.lower_bound or bad.dual > 100.0 * good.dual


@pytest.mark.parametrize("hold", ["line", "command"])
@pytest.mark.parametrize("name", ["thesis-1975", "subsea-crane"])
def test_another_route_confirms_the_motion(name: str, hold: str) -> None:
    case = case_at(3.75, name)
    masses = None if name == "thesis-1975" else 3
    floor = clairvoyant(case, record_of(case, 30.0, 4), hold=hold, masses=masses)  # type: ignore[arg-type]
    found = floor.verify()
    assert found.passed
    assert found.payload_error < 1e-5
    assert "confirmed" in str(found)


def test_where_no_limit_binds_the_payload_can_be_held_still() -> None:
    case = case_at(0.6)
    floor = clairvoyant(case, record_of(case, 60.0, 0))
    assert floor.payload_rms < 1e-6
    assert max(floor.shares.values()) == 0.0
    assert "no limit binds" in floor.status
    np.testing.assert_allclose(floor.haul, -floor.hook, atol=1e-6)


def test_wider_limits_never_raise_the_floor() -> None:
    case = case_at(3.0)
    record = record_of(case, 60.0, 3)
    base = DriveLimits.from_case(case)
    found = []
    for factor in (0.8, 1.0, 1.3):
        limits = DriveLimits(
            torque=factor * base.torque, speed=factor * base.speed, voltage=factor * 805.0
        )
        found.append(clairvoyant(case, record, limits=limits, drag=0.0).payload_rms)
    assert found[0] > 1.1 * found[1] > 1.21 * found[2]


def test_more_freedom_never_raises_the_floor() -> None:
    case = case_at(3.0)
    record = record_of(case, 60.0, 3)
    free = clairvoyant(case, record, drag=0.0)
    started = clairvoyant(case, record, drag=0.0, start="hook")
    held = clairvoyant(case, record, drag=0.0, hold="command")
    slack = clairvoyant(case, record, drag=0.0, minimum_tension=-math.inf)
    tight = clairvoyant(case, record, drag=0.0, minimum_tension=4.2e5)
    assert free.payload_rms <= started.payload_rms
    assert free.payload_rms <= held.payload_rms
    assert slack.payload_rms <= free.payload_rms * (1.0 + 1e-6)
    assert tight.payload_rms > free.payload_rms
    assert tight.tension_least == pytest.approx(4.2e5, rel=1e-4)
    assert tight.shares["tension"] > 0.0


def test_a_start_with_the_hook_is_that_of_a_simulation() -> None:
    case = case_at(3.0, "thesis-1975-rope")
    record = record_of(case, 20.0, 3)
    heave, rate, _ = record.block(0, 1)
    floors = {
        start: clairvoyant(case, record, drag=0.0, masses=2, start=start)  # type: ignore[arg-type]
        for start in ("free", "hook")
    }
    assert abs(float(heave[0])) > 0.05
    begun = floors["hook"]
    assert begun.start == "hook"
    assert begun.haul[0] == pytest.approx(0.0, abs=1e-12)
    assert begun.speed[0] == pytest.approx(0.0, abs=1e-12)
    names = begun.problem.plant.states
    state = dict(zip(names, begun.solution.start, strict=True))
    moving = {name: value for name, value in state.items() if not name.startswith("motor.")}
    assert len(moving) == 4  # a rope mass and the payload
    for name, value in moving.items():
        expected = float((heave if name.endswith("displacement") else rate)[0])
        assert value == pytest.approx(expected, abs=1e-12)
    assert begun.payload[0] == pytest.approx(float(heave[0]), abs=1e-12)
    # It costs the time that the winch needs to catch up, so what is asked for has been done.
    assert begun.payload_rms > 1.01 * floors["free"].payload_rms


def test_power_is_limited_on_the_outside_of_its_hyperbola() -> None:
    case = case_at(3.75)
    limits = DriveLimits(torque=11880.0, speed=125.0, power=4e5)
    plant = record_plant(case, sample_time=0.05, drag=0.0, limits=limits)
    rows = plant.windows[[name == "power" for name in plant.window_names]]
    assert len(rows) == 2
    speed = np.linspace(4e5 / 11880.0, 127.5, 200)
    allowed = 4e5 / speed / plant.peak
    for a, b in rows:
        for sign in (1.0, -1.0):
            assert np.abs(a * allowed + sign * b * speed).max() <= 1.0 + 1e-12
    ends = np.abs(rows[0, 0] * allowed + rows[0, 1] * speed)
    assert ends[[0, -1]] == pytest.approx([1.0, 1.0])


@pytest.mark.ci
def test_simulated_feedback_stays_above_the_floor() -> None:
    case = case_at(1.6)
    source = SpectrumMotion.from_case(case)
    design = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    run = simulate(
        case,
        sh.LinearFeedback.from_design(design, sample_time=0.05),
        hook=source,
        duration=120.0,
        seed=5,
        settle=30.0,
        parameters={"payload.quadratic_drag": 0.0, "payload.linear_drag": 1187.2},
    )
    record = source.motion(120.0, 0.05, 5).eased(30.0)
    floor = clairvoyant(case, record, settle=30.0, drag=1187.2)
    assert run.status == "completed"
    assert run.statistics["payload.displacement"].rms > 1e-3
    assert floor.payload_rms < run.statistics["payload.displacement"].rms


def test_drag_agrees_with_the_motion_of_the_answer() -> None:
    case = case_at(3.75)
    record = record_of(case, 60.0, 1)
    floor = clairvoyant(case, record)
    velocity = np.gradient(floor.payload, 0.05)
    expected = case.payload.quadratic_drag * math.sqrt(8.0 / math.pi) * velocity.std()
    assert floor.drag == pytest.approx(expected, rel=0.06)
    assert clairvoyant(case, record, drag=0.0).payload_rms == pytest.approx(
        floor.payload_rms, rel=0.03
    )


def test_settling_time_is_not_counted() -> None:
    case = case_at(3.75)
    record = record_of(case, 60.0, 1)
    late = clairvoyant(case, record, drag=0.0, settle=20.0)
    assert late.payload_rms == pytest.approx(np.sqrt(np.mean(late.payload[400:] ** 2)))
    whole = clairvoyant(case, record, drag=0.0)
    assert late.payload_rms <= np.sqrt(np.mean(whole.payload[400:] ** 2)) * (1.0 + 1e-9)
    assert late.payload_rms > whole.payload_rms  # the calm beginning is not counted


def test_records_may_be_finer_than_the_samples() -> None:
    case = case_at(3.75)
    coarse = clairvoyant(case, record_of(case, 20.0, 3), drag=0.0)
    fine = clairvoyant(case, record_of(case, 20.0, 3, 0.01), drag=0.0)
    assert fine.payload_rms == pytest.approx(coarse.payload_rms, rel=1e-4)


def test_wrong_questions_are_answered_with_one_sentence() -> None:
    case = case_at(2.43)
    record = record_of(case, 5.0, 0)
    for changes, message in (
        ({"sample_time": 0.07}, "whole fraction"),
        ({"sample_time": 0.0}, "sample_time must be above 0 s"),
        ({"settle": 6.0}, "settle must be"),
        ({"hold": "zoh"}, "hold must be one of line, command"),
        ({"start": "there"}, "start must be one of free, hook"),
        ({"drag": -1.0}, "drag must be"),
        ({"minimum_tension": math.nan}, "minimum_tension must be"),
        ({"limits": DriveLimits(torque=5000.0)}, "cannot hold the load"),
        ({"limits": DriveLimits()}, "finite peak torque"),
    ):
        with pytest.raises(sh.InputError, match=message):
            clairvoyant(case, record, **changes)  # type: ignore[arg-type]


def test_limits_that_nothing_can_keep_are_said_to_be_so() -> None:
    case = case_at(3.75)
    with pytest.raises(sh.SolverError, match="clairvoyant: piqp found no solution"):
        clairvoyant(case, record_of(case, 20.0, 0), drag=0.0, minimum_tension=4.6e5)


def test_a_sine_within_the_limits_is_followed_exactly() -> None:
    case = case_at(2.43)
    floor = clairvoyant(case, SineMotion(amplitude=0.5, period=10.0).motion(60.0, 0.05, 0))
    assert floor.payload_rms < 1e-6
    omega = 2.0 * math.pi / 10.0
    per_haul = case.winch.gearbox.ratio / case.drum_radius
    swing = case.winch.inertia * per_haul * 0.5 * omega**2
    assert floor.torque_peak == pytest.approx(case.static_torque + swing, rel=2e-2)
    assert floor.speed_peak == pytest.approx(0.5 * omega * per_haul, rel=1e-3)


def test_it_prints_as_a_tree() -> None:
    case = case_at(3.75)
    text = str(clairvoyant(case, record_of(case, 20.0, 3), drag=0.0))
    assert "cannot be held stiller than" in text
    assert text.count("\n") == 5
    assert "piqp" in text


@pytest.mark.parametrize("masses", [1, 4])
def test_tensions_of_two_falls_are_those_of_one_line(masses: int) -> None:
    case = load_case("subsea-crane").replace({"rigging.block_mass": 2e3})
    radius, rope = case.drum_radius, case.rope
    peak = {"limits.rope_tension_peak": None}
    two = case.replace({"rope.falls": 2, "winch.drum.radius": radius, **peak})
    one = case.replace(
        {
            "winch.drum.radius": 0.5 * radius,
            "rope.axial_stiffness": 2.0 * rope.ea,
            "rope.mass_per_length": 2.0 * rope.mass_per_length,
            "rope.submerged_weight_per_length": 2.0 * rope.submerged_weight / rope.length,
            **peak,
        }
    )
    found, expected = (
        record_plant(c, sample_time=0.05, drag=1e3, masses=masses) for c in (two, one)
    )
    for name in ("Phi", "Gamma", "tensions", "tension_feed", "static_tensions"):
        mine, same = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(mine, same, rtol=1e-6, atol=1e-9 * np.abs(same).max())
