"""The structured singular value, the M-Delta form of a case, and `sh.robustness`."""

from __future__ import annotations

import math
import re
import warnings
from functools import cache

import cvxpy as cp
import numpy as np
import pytest
from scipy.optimize import linprog

import stillhook as sh
from models import load_case
from models.basics import InputError
from models.plant import LinearPlant
from stillhook.cli import main
from stillhook.commands.design.margins import parse_off
from synth.loop import LinearController, closed_loop_poles
from synth.robust import robustness
from synth.robust.mu_plant import UncertainLoop, UncertainNumber, uncertain_loop, uncertain_numbers
from synth.robust.mu_search import critical_point, grid_of, proved_bound
from synth.robust.mu_structured_value import UncertaintyBlock, mu_upper

GAINS = {"A": 1.0, "a": 4394.0, "a1": 2393.0, "a2": 13691.0}
RANGES = {"payload.mass": 0.3, "stiffness": 0.2, "drag": 0.5, "delay": 0.5}


@cache
def late_design() -> sh.Design:
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.02})
    return sh.evaluate_gains(case, GAINS)


def thesis_loop() -> UncertainLoop:
    design = late_design()
    doubts = uncertain_numbers(design.case, design.drag, RANGES)
    controller = design.assessment.controller
    return uncertain_loop(design.case, controller, doubts, masses=design.masses, drag=design.drag)


def cubic(gain: float) -> UncertainLoop:
    """s^3 + (3 + d1) s^2 + (3 + d2) s + 1 with u = -gain x1."""
    down = np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, -1.0]])
    plant = LinearPlant(
        A=[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -3.0, -3.0]],
        B=[[0.0], [0.0], [1.0]],
        E=down,
        C=[[1.0, 0.0, 0.0]],
        Cz=[[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        inputs=("u",),
        measurements=("y",),
    )
    return UncertainLoop(
        case=load_case("thesis-1975"),
        masses=1,
        drag=0.0,
        controller=LinearController.static([[-gain]], ["y"], ["u"]),
        doubts=(
            UncertainNumber(path="d1", nominal=0.0, half=1.0),
            UncertainNumber(path="d2", nominal=0.0, half=1.0),
        ),
        plant=plant,
        sizes=(1, 1),
    )


def random_matrix(size: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(size, size)) + 1j * rng.normal(size=(size, size))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_rank_one_with_independent_reals_has_a_closed_form(seed: int) -> None:
    # I - k Delta a b' is singular if k sum delta_i b_i a_i = 1: a linear programme in k delta.
    rng = np.random.default_rng(seed)
    a, b = (rng.normal(size=5) + 1j * rng.normal(size=5) for _ in range(2))
    c = a * b
    sides = np.block([[np.eye(5), -np.ones((5, 1))], [-np.eye(5), -np.ones((5, 1))]])
    least = linprog(
        np.append(np.zeros(5), 1.0),
        A_ub=sides,
        b_ub=np.zeros(10),
        A_eq=np.column_stack([np.array([c.real, c.imag]), np.zeros(2)]),
        b_eq=[1.0, 0.0],
        bounds=[(None, None)] * 5 + [(0.0, None)],
    )
    found = mu_upper(np.outer(a, b), [UncertaintyBlock()] * 5).bound
    assert found == pytest.approx(1.0 / least.fun, rel=1e-5)


def test_one_complex_scalar_gives_the_spectral_radius() -> None:
    M = random_matrix(5, 3)
    radius = np.abs(np.linalg.eigvals(M)).max()
    assert mu_upper(M, [UncertaintyBlock(size=5, real=False)]).bound == pytest.approx(
        radius, rel=5e-3
    )


def test_one_real_scalar_sees_only_real_eigenvalues() -> None:
    rotated = np.array([[0.5, -2.0], [2.0, 0.5]])  # eigenvalues 0.5 +- 2i
    assert mu_upper(rotated, [UncertaintyBlock(size=2)]).bound < 1e-3
    diagonal = np.diag([1.5, -3.0]) + np.triu(np.ones((2, 2)), 1)
    assert mu_upper(diagonal, [UncertaintyBlock(size=2)]).bound == pytest.approx(3.0, rel=5e-3)


def test_bound_is_that_of_a_semidefinite_programme() -> None:
    blocks = [UncertaintyBlock(size=2), UncertaintyBlock(), UncertaintyBlock(size=2, real=False)]
    M = random_matrix(5, 4)
    found = mu_upper(M, blocks).bound

    def slack(beta: float) -> float:
        D = cp.bmat(
            [
                [cp.Variable((2, 2), hermitian=True), np.zeros((2, 1)), np.zeros((2, 2))],
                [np.zeros((1, 2)), cp.Variable((1, 1), hermitian=True), np.zeros((1, 2))],
                [np.zeros((2, 2)), np.zeros((2, 1)), cp.Variable((2, 2), hermitian=True)],
            ]
        )
        G = cp.bmat(
            [
                [cp.Variable((2, 2), hermitian=True), np.zeros((2, 3))],
                [np.zeros((1, 2)), cp.Variable((1, 1), hermitian=True), np.zeros((1, 2))],
                [np.zeros((2, 5))],
            ]
        )
        E = M.conj().T @ D @ M + 1j * (G @ M - M.conj().T @ G) - beta**2 * D
        t = cp.Variable()
        rows = [0.5 * (E + E.H) << t * np.eye(5), D >> 1e-3 * np.eye(5), t >= -1.0]
        rows.append(cp.real(cp.trace(D)) <= 100.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cp.Problem(cp.Minimize(t), rows).solve(solver="CLARABEL")
        return float(t.value)

    assert slack(1.003 * found) < -1e-6  # the programme proves the bound, ...
    assert slack(0.99 * found) > -1e-6  # ... and not one per cent less


def test_two_parameters_of_a_cubic_have_hurwitz_limit() -> None:
    # (3 + d1)(3 + d2) > 1 + K: with K = 7 both may fall by 3 - sqrt 8.
    loop, exact = cubic(7.0), 3.0 - math.sqrt(8.0)
    grid = grid_of(loop)
    point = critical_point(loop, grid)
    assert point is not None
    assert point.size == pytest.approx(exact, rel=1e-6)
    assert point.delta == pytest.approx((-exact, -exact), rel=1e-6)
    assert point.omega == pytest.approx(math.sqrt(math.sqrt(8.0)), rel=1e-6)
    upper, at = proved_bound(loop, grid, [point.omega])
    assert exact * 0.985 < 1.0 / upper <= exact * (1.0 + 1e-9)
    assert at == pytest.approx(point.omega, rel=0.05)


def test_form_is_the_plant_and_its_determinant_the_loop() -> None:
    loop = thesis_loop()
    assert loop.error < 1e-9
    omega = np.array([0.3, 1.9, 9.0])
    delta = np.array([0.4, -0.7, 0.9, 0.0])
    spread = loop.spread(delta)
    whole = np.eye(4) - loop.matrix(omega) * np.append(spread, 0.0)
    channels = loop.plant.response(omega).zw
    alone = np.linalg.det(np.eye(3) - channels * spread)
    ratio = loop.difference(omega, delta) / loop.difference(omega, 0.0 * delta)
    assert np.linalg.det(whole) == pytest.approx(alone * ratio, rel=1e-9)
    quick, true = loop.quick(delta), loop.plant_at(delta)
    assert quick.response(omega).yu == pytest.approx(true.response(omega).yu, rel=1e-9)


def test_form_holds_on_a_rope_with_every_sensor() -> None:
    case = load_case("subsea-crane")
    names = ["payload.velocity", "mru.heave_rate", "rope.tension"]
    controller = LinearController.static([[10.0, 1.0, 1e-5]], names, ["drive.command"])
    ranges = {"payload.mass": 0.3, "stiffness": 0.2, "winch.motor.inertia": 0.3, "drag": 1.0}
    loop = uncertain_loop(
        case, controller, uncertain_numbers(case, 6e3, ranges), masses=4, drag=6e3, seed=1
    )
    assert loop.sizes[0] == loop.sizes[-1] == 1
    assert loop.error < 1e-8


def test_proof_and_search_meet_and_the_true_plant_agrees() -> None:
    found = robustness(late_design(), RANGES, draws=300)
    assert found.proved <= found.found < 1.06 * found.proved
    assert found.confirmed
    assert found.unstable == 0
    assert not found.ok
    assert found.gain_radius is not None
    assert found.margins.disk == late_design().margins.disk
    assert "unstable within the ranges" in str(found)
    # The critical case, written down as anyone would: unstable a little beyond, stable before.
    for share, stable in ((1.02, False), (0.97, True)):
        values = {
            d.path: d.nominal + share * (found.critical[d.path] - d.nominal) for d in found.doubts
        }
        drag = values.pop("drag")
        virtual = values["payload.mass"] / late_design().case.payload.mass
        values["payload.added_mass"] = virtual * late_design().case.payload.hydrodynamic_mass
        values["payload.drag"] = {"method": "given", "coefficient": drag}
        there = sh.evaluate_gains(late_design().case.variant(values), GAINS)
        assert (there.margins is not None) == stable


@pytest.mark.slow
def test_none_of_ten_thousand_draws_inside_is_unstable() -> None:
    found = robustness(late_design(), RANGES, draws=10_000, seed=3)
    assert (found.draws, found.unstable) == (10_000, 0)


def test_draws_beyond_the_critical_size_are_unstable_at_times() -> None:
    loop = thesis_loop()
    rng = np.random.default_rng(5)
    unstable = 0
    for _ in range(100):
        plant = loop.quick([1.2 * float(np.sign(x)) for x in rng.normal(size=4)])
        poles = closed_loop_poles(plant.without_delays(8), loop.controller)
        unstable += poles.real.max() > 0.0
    assert unstable > 0


def test_delay_alone_reaches_the_delay_margin() -> None:
    design = late_design()
    found = robustness(design, {"delay": 0.5}, draws=0)
    assert design.margins is not None
    later = found.critical["sensors.telemetry.delay"] - 0.02
    assert later == pytest.approx(design.margins.delay, rel=1e-6)
    assert 0.9 * found.found < found.proved <= found.found


@pytest.mark.slow
def test_a_structure_is_analysed_as_gains_are() -> None:
    case = load_case("thesis-1975").replace({"sensors.telemetry.delay": 0.02})
    design = sh.optimise_gains(case, "payload-feedback", starts=2)
    names = {"a": "a", "a1": "a1", "a2": "a2"}
    gains = {"A": case.gains.A, **{k: design.parameters[v] for k, v in names.items()}}
    ranges = {"payload.mass": 0.2, "drag": 0.5}
    one = robustness(design, ranges, draws=20)
    other = robustness(sh.evaluate_gains(case, gains), ranges, draws=20)
    assert one.found == pytest.approx(other.found, rel=1e-4)
    assert one.proved == pytest.approx(other.proved, rel=0.02)


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({}, "must name what may be off"),
        ({"payload.colour": 0.1}, "payload.colour is unknown"),
        ({"payload.mass": 1.5}, "must be less uncertain than its value"),
        ({"payload.mass": -0.1}, r"uncertainty\[payload.mass\] must be"),
        ({"payload.mass": 0.1, "payload": 0.2}, "given twice"),
        ({"sensors.mru.delay": 0.1}, "sensors.mru.delay"),
    ],
)
def test_ranges_without_meaning_are_refused(ranges: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        robustness(late_design(), ranges)


def test_an_unstable_design_and_a_wrong_matrix_are_refused() -> None:
    unstable = sh.evaluate_gains(load_case("thesis-1975"), {**GAINS, "A": -1.0})
    with pytest.raises(InputError, match="must be stable"):
        robustness(unstable, {"payload.mass": 0.1})
    with pytest.raises(InputError, match="shape"):
        mu_upper(np.eye(3), [UncertaintyBlock()])
    with pytest.raises(InputError, match="size"):
        UncertaintyBlock(size=0)
    no_delay = sh.evaluate_gains(load_case("thesis-1975"), GAINS)
    with pytest.raises(InputError, match="a share of it is nothing"):
        robustness(no_delay, {"delay": 0.5})


def test_margins_command(capsys: pytest.CaptureFixture[str]) -> None:
    gains = ",".join(f"{k}={v:g}" for k, v in GAINS.items())
    words = ["margins", "thesis-1975", "--gains", gains, "--draws", "20"]
    assert main([*words, "--off", "payload.mass=0.1", "--off", "drag=0.2"]) == 0
    told = capsys.readouterr().out
    assert "stable over the ranges" in told
    low, high = (float(v) for v in re.search(r"mu between (\S+) and ([\d.]+)", told).groups())
    assert 0.0 < low <= high < 1.0
    assert "--vary payload.mass=" in told
    assert main([*words, "--off", "payload.mass=0.4", "--off", "stiffness=0.4", "--quiet"]) == 1
    assert "unstable within the ranges" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["thesis-1975", "--off", "payload.mass"], "--off: must be PATH=SHARE"),
        (["thesis-1975", "--off", "a=1", "--off", "a=2"], "a is given twice"),
        (["thesis-1975", "--draws", "-1"], "--draws must be"),
        (["thesis-1975", "--design", "x", "--gains", "a=1,a1=1,a2=1"], "not both"),
    ],
)
def test_margins_command_refuses(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["margins", *words]) == 2
    assert message in capsys.readouterr().err


def test_ranges_from_the_command_line() -> None:
    assert parse_off(["payload.mass=0.3", "delay = 20 ms"]) == {
        "payload.mass": 0.3,
        "delay": "20 ms",
    }
