"""`tune` as an engineer would check it: against Riccati equations, closed forms, brute force."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from loop_numbers import (
    closed_matrices,
    double_integrator,
    integrator,
    loop_response,
    lyapunov_cost,
    lyapunov_variances,
    oscillator,
    two_carts,
    with_full_state,
)
from lqg_optimum import lqg
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov
from scipy.optimize import brentq, differential_evolution, minimize, minimize_scalar

from models.basics import InputError
from models.plant import MEASUREMENTS, LinearPlant
from synth import (
    DiskMargin,
    LowOrder,
    MaxSensitivity,
    PayloadFeedback,
    Rms,
    StaticGain,
    White,
    tune,
)
from synth.loop import LinearController
from synth.search import search
from synth.structures import ParametrisedController
from synth.structures.low_order import LowOrderLaw

WHITE = {"f": White(1.0), "n": White(0.01)}
WEIGHTS = {"x": 1.0, "effort": 0.1}
CART_WHITE = {"f": White(1.0), "n1": White(0.01), "n2": White(0.03)}
CART_WEIGHTS = {"x1": 1.0, "x2": 2.0, "effort1": 0.1, "effort2": 0.2}

# Keel, Bhattacharyya and Howze, IEEE TAC 33 (1988): a VTOL helicopter whose pitch rate alone is
# measured; two inputs, so two gains.  Unstable without control.
HELICOPTER = LinearPlant(
    A=[
        [-0.0366, 0.0271, 0.0188, -0.4555],
        [0.0482, -1.0100, 0.0024, -4.0208],
        [0.1002, 0.3681, -0.7070, 1.4200],
        [0.0, 0.0, 1.0, 0.0],
    ],
    B=[[0.4422, 0.1761], [3.5446, -7.5922], [-5.5200, 4.4900], [0.0, 0.0]],
    E=np.eye(4),
    C=[[0.0, 1.0, 0.0, 0.0]],
    Cz=np.vstack([np.eye(4), np.zeros((2, 4))]),
    Dz=np.vstack([np.zeros((4, 2)), np.eye(2)]),
)


def cart_problem(count: int) -> tuple[LinearPlant, dict[str, White], dict[str, float]]:
    plant = two_carts(count)
    return (
        plant,
        {name: CART_WHITE[name] for name in plant.disturbances},
        {name: CART_WEIGHTS[name] for name in plant.outputs},
    )


def white_everywhere(plant: LinearPlant) -> dict[str, White]:
    return {name: White(1.0) for name in plant.disturbances}


def gain_of(tuning) -> np.ndarray:
    return np.array(tuning.controller.D)


# ------------------------------------------------------------- known optima


@pytest.mark.parametrize(
    ("plant", "minimise"),
    [
        (with_full_state(double_integrator()), {"x": 1.0, "effort": 0.1}),
        (with_full_state(oscillator(4.0, 0.0)), {"x": 1.0, "effort": 0.1}),
        (with_full_state(oscillator(-9.0)), {"x": 1.0, "effort": 1e-3}),
        (with_full_state(two_carts(1)), {"x1": 1.0, "x2": 2.0, "effort1": 0.1}),
        (with_full_state(two_carts(2)), CART_WEIGHTS),
    ],
    ids=["double integrator", "mass on a spring", "unstable", "two carts", "two carts, two inputs"],
)
def test_gain_on_the_full_state_is_the_linear_quadratic_regulator(plant, minimise) -> None:
    weights = [minimise[name] for name in plant.outputs]
    Q, R = (plant.Cz.T * weights) @ plant.Cz, (plant.Dz.T * weights) @ plant.Dz
    X = solve_continuous_are(plant.A, plant.B, Q, R)
    exact = -np.linalg.solve(R, plant.B.T @ X)
    cost = np.sqrt(np.trace(plant.E.T @ X @ plant.E) * 2.0)
    found = tune(
        plant,
        StaticGain(),
        spectrum={name: White(2.0) for name in plant.disturbances},
        minimise=minimise,
        starts=6,
    )
    assert found.ok
    assert found.cost == pytest.approx(cost, rel=1e-8)
    if len(plant.inputs) == 1:  # unique: one noise alone does not tell all gains apart
        assert gain_of(found) == pytest.approx(exact, rel=1e-3, abs=1e-3 * np.abs(exact).max())
    assert found.agreed >= 4
    assert found.verify().ok


@pytest.mark.parametrize(
    ("plant", "spectrum", "minimise", "lower"),
    [
        (double_integrator(), WHITE, WEIGHTS, None),
        (oscillator(), WHITE, WEIGHTS, 1),
        (oscillator(4.0, 0.0), WHITE, WEIGHTS, 1),
        (oscillator(-9.0), {"f": White(1.0), "n": White(1e-3)}, {"x": 1.0, "effort": 1e-3}, None),
        (*cart_problem(1), 2),
        (*cart_problem(2), 2),
    ],
    ids=[
        "double integrator",
        "oscillator",
        "mass on a spring",
        "unstable",
        "two carts",
        "two carts, two inputs",
    ],
)
def test_controller_of_the_plants_order_is_the_lqg_optimum(
    plant, spectrum, minimise, lower: int | None
) -> None:
    best = lqg(plant, minimise=minimise, spectrum=spectrum).cost
    order = len(plant.states)
    found = tune(plant, LowOrder(order), spectrum=spectrum, minimise=minimise, starts=4)
    assert found.ok
    assert found.cost == pytest.approx(best, rel=1e-8)
    assert lyapunov_cost(plant, found.controller, spectrum, minimise) == pytest.approx(
        best, rel=1e-8
    )
    assert found.verify().ok
    if lower is not None:
        less = tune(plant, LowOrder(lower), spectrum=spectrum, minimise=minimise, starts=6)
        assert less.ok
        assert less.assessment.stable
        assert 1.003 * best < less.cost < 2.0 * best


def test_lqg_optimum_is_found_without_being_told(monkeypatch) -> None:
    # The first guess is the answer; from elsewhere the search must get there too.
    monkeypatch.setattr(LowOrderLaw, "guesses", ParametrisedController.guesses)
    plant, spectrum, minimise = cart_problem(1)
    best = lqg(plant, minimise=minimise, spectrum=spectrum).cost
    found = tune(plant, LowOrder(4), spectrum=spectrum, minimise=minimise, starts=6)
    begins = [found.problem.law.controller(list(s.begin)) for s in found.starts]
    assert all(lyapunov_cost(plant, b, spectrum, minimise) > 1.001 * best for b in begins)
    assert found.cost == pytest.approx(best, rel=1e-8)


def test_order_one_for_two_carts_is_the_global_optimum() -> None:
    plant, spectrum, minimise = cart_problem(1)
    law = LowOrder(1).bind(plant)
    scales = np.array([p.scale for p in law.parameters])

    def log_cost(y):
        controller = law.controller(list(np.sinh(y) * scales))
        cost = lyapunov_cost(plant, controller, spectrum, minimise)
        return np.log(cost) if np.isfinite(cost) else 30.0

    brute = differential_evolution(
        log_cost, [(-8.0, 8.0)] * 2, seed=1, popsize=20, tol=1e-10, polish=False
    )
    found = tune(plant, LowOrder(1), spectrum=spectrum, minimise=minimise)
    assert found.cost == pytest.approx(np.exp(brute.fun), rel=1e-5)


def test_delayed_integrator_has_the_dottie_number_for_its_best_gain() -> None:
    # x' = -k x(t - tau) + w has the variance (1 + sin k tau) / (2 k cos k tau) (Kuechler and
    # Mensch 1992), which is least where cos(k tau) = k tau.
    tau = 0.3
    dottie = brentq(lambda u: np.cos(u) - u, 0.0, 1.0, xtol=1e-15)
    found = tune(integrator(tau), StaticGain(), spectrum={"w": White(2.0)}, minimise={"x": 1.0})
    assert found.ok
    assert found.agreed == len(found.starts)
    assert -gain_of(found)[0, 0] * tau == pytest.approx(dottie, rel=1e-6)
    variance = 2.0 * (1.0 + np.sin(dottie)) / (2.0 * dottie / tau * np.cos(dottie))
    assert found.cost == pytest.approx(np.sqrt(variance), rel=1e-8)
    assert found.margins.gain == pytest.approx(np.pi / 2.0 / dottie, rel=1e-6)
    assert found.margins.delay == pytest.approx(tau * (np.pi / 2.0 / dottie - 1.0), rel=1e-6)


def test_helicopters_two_gains_are_the_best_of_a_grid() -> None:
    minimise = dict.fromkeys(HELICOPTER.outputs, 1.0)
    spectrum = white_everywhere(HELICOPTER)

    def cost(gains):
        K = np.reshape(gains, (2, 1))
        controller = LinearController.static(K, HELICOPTER.measurements, HELICOPTER.inputs)
        return lyapunov_cost(HELICOPTER, controller, spectrum, minimise)

    sizes = np.concatenate([-np.geomspace(0.03, 30.0, 12), np.geomspace(0.03, 30.0, 12)])
    grid = [(a, b) for a in sizes for b in sizes]
    costs = np.array([cost(gains) for gains in grid])
    begin = grid[int(np.nanargmin(costs))]
    brute = minimize(cost, begin, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12})
    found = tune(HELICOPTER, StaticGain(), spectrum=spectrum, minimise=minimise)
    assert found.ok
    assert found.cost == pytest.approx(brute.fun, rel=1e-8)
    assert gain_of(found).ravel() == pytest.approx(brute.x, rel=1e-3)


@pytest.mark.parametrize(
    ("A", "B", "C", "best", "second"),
    [
        (
            [[0.1, 1.9, 3.6], [1.3, -0.3, 1.1], [-1.1, -1.2, -1.3]],
            [[0.3], [1.2], [2.2]],
            [[1.3, 0.7, -0.7], [0.1, 0.5, -0.1]],
            (0.273, -9.766),
            (-0.355, 1.360),
        ),
        (
            [[-1.5, -0.4, 1.5], [0.3, 1.4, -0.7], [-2.3, 0.1, -0.6]],
            [[1.5], [0.8], [-1.2]],
            [[-2.0, 0.5, 0.6], [-0.9, -1.5, -0.2]],
            (-0.137, 0.484),
            (-1.473, 7.478),
        ),
    ],
)
def test_better_of_two_separate_stable_regions_is_found(A, B, C, best, second) -> None:
    plant = LinearPlant(
        A=A,
        B=B,
        E=np.eye(3),
        C=C,
        Cz=np.vstack([np.eye(3), np.zeros((1, 3))]),
        Dz=[[0.0], [0.0], [0.0], [1.0]],
    )
    spectrum, minimise = white_everywhere(plant), dict.fromkeys(plant.outputs, 1.0)

    def cost(gains):
        controller = LinearController.static([gains], plant.measurements, plant.inputs)
        return lyapunov_cost(plant, controller, spectrum, minimise)

    # Both are local optima, and unstable loops lie between them.
    options = {"xatol": 1e-8, "fatol": 1e-12}
    ends = [minimize(cost, at, method="Nelder-Mead", options=options) for at in (best, second)]
    assert ends[0].x == pytest.approx(best, abs=1e-3)
    assert ends[1].x == pytest.approx(second, abs=1e-3)
    line = [cost(ends[0].x + t * (ends[1].x - ends[0].x)) for t in np.linspace(0.0, 1.0, 60)]
    assert np.isinf(max(line))
    found = tune(plant, StaticGain(), spectrum=spectrum, minimise=minimise)
    assert found.cost == pytest.approx(ends[0].fun, rel=1e-8)
    assert gain_of(found).ravel() == pytest.approx(ends[0].x, rel=1e-3)
    # Told to stay in the other one, it does.
    bounds = {"K[u1,y2]": (0.5 * second[1], 2.0 * second[1])}
    there = tune(plant, StaticGain(bounds=bounds), spectrum=spectrum, minimise=minimise)
    assert there.cost == pytest.approx(ends[1].fun, rel=1e-6)


# ----------------------------------------------------------- what is claimed


@pytest.mark.parametrize("structure", [StaticGain(), LowOrder(1), LowOrder(2)])
def test_cost_and_status_are_what_other_code_finds(structure) -> None:
    plant = oscillator()
    if isinstance(structure, StaticGain):  # white noise must not reach u directly
        plant = with_full_state(plant)
    spectrum = {name: WHITE[name] for name in plant.disturbances}
    found = tune(plant, structure, spectrum=spectrum, minimise=WEIGHTS, starts=4)
    assert found.ok
    assert "optimal" in found.status
    assert found.cost == pytest.approx(
        lyapunov_cost(plant, found.controller, spectrum, WEIGHTS), rel=1e-6
    )
    assert found.verify().ok
    grid = np.geomspace(1e-3, 1e3, 5000)
    dense = np.abs(1.0 / (1.0 + loop_response(plant, found.controller)(grid))).max()
    assert found.margins.max_sensitivity == pytest.approx(dense, rel=1e-4)
    assert set(found.parameters) == {p.name for p in found.problem.law.parameters}


def test_variance_is_that_of_a_long_simulation() -> None:
    plant = double_integrator()
    found = tune(plant, LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, starts=2)
    A, E, C, _ = closed_matrices(plant, found.controller)
    step, count = 0.05, 400_000
    # Exact sampling of the noise-driven loop (Van Loan 1978).
    n = len(A)
    noise = (E * [1.0, 0.01]) @ E.T
    block = expm(np.block([[-A, noise], [np.zeros((n, n)), A.T]]) * step)
    advance = block[n:, n:].T
    root = np.linalg.cholesky(advance @ block[:n, n:] + 1e-15 * np.eye(n))
    kicks = np.random.default_rng(4).normal(size=(count, n)) @ root.T
    x = np.linalg.cholesky(solve_continuous_lyapunov(A, -noise)) @ np.ones(n)
    total = 0.0
    for kick in kicks:
        x = advance @ x + kick
        total += (C[0] @ x) ** 2 + 0.1 * (C[1] @ x) ** 2
    # The mean of z'z over T spreads by 2/T times the integral of its autocovariance,
    # 2 tr(R(t) R(t)'): twice the integral of tr(S S) over frequency.
    weights = np.diag([1.0, 0.1])
    omega = np.linspace(0.0, 60.0, 6001)
    H = np.array([C @ np.linalg.solve(1j * w * np.eye(n) - A, E) for w in omega])
    S = (
        np.sqrt(weights)
        @ (H * [1.0, 0.01])
        @ np.conj(np.transpose(H, (0, 2, 1)))
        @ np.sqrt(weights)
    )
    power = np.trapezoid(np.einsum("kij,kji->k", S, S).real, omega)
    spread = np.sqrt(2.0 * power / np.pi / (step * count))
    assert spread < 0.02 * found.cost**2
    assert total / count == pytest.approx(found.cost**2, abs=4.0 * spread)


def test_intensity_of_white_noise_follows_the_convention() -> None:
    # x' = -x + w with E[w(t) w(t+s)] = q delta(s) has the variance q/2.
    plant = LinearPlant(
        A=[[-1.0]], B=[[1.0]], E=[[1.0]], C=[[1.0]], Cz=[[1.0]], inputs=("u",), outputs=("x",)
    )
    structure = StaticGain(bounds={"K[u,y1]": (-1e-12, 1e-12)})
    found = tune(plant, structure, spectrum={"w1": White(3.0)}, minimise={"x": 1.0})
    assert found.cost == pytest.approx(np.sqrt(1.5), rel=1e-8)


def test_weighted_variances_of_independent_disturbances_add() -> None:
    plant, spectrum, minimise = cart_problem(2)
    found = tune(plant, LowOrder(1), spectrum=spectrum, minimise=minimise, starts=2)
    variances = lyapunov_variances(plant, found.controller, spectrum)
    assert found.cost**2 == pytest.approx(
        sum(w * variances[name] for name, w in minimise.items()), rel=1e-7
    )
    parts = [
        lyapunov_cost(plant, found.controller, {name: noise}, minimise) ** 2
        for name, noise in spectrum.items()
    ]
    assert found.cost**2 == pytest.approx(sum(parts), rel=1e-7)


def test_same_seed_gives_the_same_answer_and_another_seed_the_same_optimum() -> None:
    plant, spectrum, minimise = cart_problem(1)

    def run(seed: int):
        structure = LowOrder(2)
        return tune(plant, structure, spectrum=spectrum, minimise=minimise, starts=3, seed=seed)

    a, b, c = run(0), run(0), run(5)
    assert a.parameters == b.parameters
    assert a.cost == b.cost
    assert [s.cost for s in a.starts] == [s.cost for s in b.starts]
    assert not np.array_equal(a.starts[-1].begin, c.starts[-1].begin)
    assert c.cost == pytest.approx(a.cost, rel=1e-6)


@pytest.mark.parametrize("pace", [1e-2, 1e2])
def test_answer_does_not_depend_on_the_unit_of_time(pace: float) -> None:
    # The double integrator's best loop is at (1/r)^(1/4) rad/s: far from one.
    plant = with_full_state(double_integrator())
    minimise = {"x": 1.0, "effort": pace**-4}
    found = tune(plant, StaticGain(), spectrum={"f": White(1.0)}, minimise=minimise, starts=4)
    assert gain_of(found).ravel() == pytest.approx([-(pace**2), -np.sqrt(2.0) * pace], rel=1e-4)


def test_answer_does_not_depend_on_the_unit_of_a_measurement() -> None:
    plant = with_full_state(two_carts(1))
    minimise = {"x2": 1.0, "effort1": 0.1}
    units = np.array([1.0, 1e3, 1e-4, 1.0])
    changed = dataclasses.replace(plant, C=units[:, None] * plant.C)
    spectrum = {"f": White(1.0)}
    a = tune(plant, StaticGain(), spectrum=spectrum, minimise=minimise, starts=4)
    b = tune(changed, StaticGain(), spectrum=spectrum, minimise=minimise, starts=4)
    assert b.cost == pytest.approx(a.cost, rel=1e-8)
    assert gain_of(b) * units == pytest.approx(gain_of(a), rel=1e-3, abs=1e-3)


# ---------------------------------------------------------------- the plant


def test_direct_term_of_the_plant_is_a_change_of_gain() -> None:
    # With y = C x + D u, u = K y is u = (1 - K D)^-1 K C x.
    plain = with_full_state(double_integrator())
    D = np.array([[0.3], [-0.2]])
    direct = dataclasses.replace(plain, D=D)
    question = {"spectrum": {"f": White(1.0)}, "minimise": WEIGHTS}
    a, b = tune(plain, StaticGain(), **question), tune(direct, StaticGain(), **question)
    assert b.cost == pytest.approx(a.cost, rel=1e-8)
    K = gain_of(b)
    assert np.linalg.solve(np.eye(1) - K @ D, K) == pytest.approx(gain_of(a), rel=1e-3)


def test_direct_term_does_not_change_the_lqg_optimum() -> None:
    plant = double_integrator(D=[[0.4]])
    best = lqg(double_integrator(), minimise=WEIGHTS, spectrum=WHITE).cost
    found = tune(plant, LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, starts=4)
    assert found.cost == pytest.approx(best, rel=1e-6)


def test_delayed_double_integrator_is_stable_until_its_delay_margin() -> None:
    plant = dataclasses.replace(with_full_state(double_integrator()), delays=(0.2, 0.2))
    question = {"spectrum": {"f": White(1.0)}, "minimise": WEIGHTS}
    found = tune(plant, StaticGain(), **question)
    assert found.ok
    without = tune(with_full_state(double_integrator()), StaticGain(), **question)
    assert found.cost > 1.01 * without.cost
    k, d = -gain_of(found)[0]

    def swing(delay: float) -> float:
        """Largest |x| of the last fifth of 300 s over that of the fifth before."""
        step = 0.002
        late = round(delay / step)
        x, v = np.zeros(150_000), np.zeros(150_000)
        x[: late + 1] = 1.0
        for i in range(late, x.size - 1):
            # Heun: the delayed values are known at both ends of the step.
            a0 = -k * x[i - late] - d * v[i - late]
            if late:
                a1 = -k * x[i - late + 1] - d * v[i - late + 1]
            else:
                a1 = -k * (x[i] + step * v[i]) - d * (v[i] + step * a0)
            x[i + 1] = x[i] + step * v[i] + 0.5 * step**2 * a0
            v[i + 1] = v[i] + 0.5 * step * (a0 + a1)
        fifth = x.size // 5
        return float(np.abs(x[-fifth:]).max() / np.abs(x[-2 * fifth : -fifth]).max())

    margin = found.margins.delay
    assert swing(0.2) < 0.5
    assert swing(0.2 + 0.97 * margin) < 1.0
    assert swing(0.2 + 1.03 * margin) > 1.0


def test_different_delays_are_taken_one_by_one() -> None:
    plant = with_full_state(double_integrator())
    early = dataclasses.replace(plant, delays=(0.0, 0.3))
    late = dataclasses.replace(plant, delays=(0.3, 0.3))
    question = {"spectrum": {"f": White(1.0)}, "minimise": WEIGHTS, "starts": 4}
    costs = [tune(p, StaticGain(), **question).cost for p in (plant, early, late)]
    assert costs[0] < costs[1] < costs[2]


def test_controller_for_a_delay_comes_close_to_the_predictor() -> None:
    # The best there is predicts the state, u = -x(t)/sqrt(r) (Kleinman 1969): its cost is that of
    # the regulator, sqrt(r), and of the error of prediction, tau, per intensity of the noise.
    tau, r = 0.5, 0.04
    question = {"spectrum": {"w": White(2.0)}, "minimise": {"x": 1.0, "effort": r}, "starts": 4}
    bound = np.sqrt(2.0 * (np.sqrt(r) + tau))
    costs = [
        tune(integrator(tau), structure, **question).cost
        for structure in (StaticGain(), LowOrder(1, proper=True), LowOrder(2, proper=True))
    ]
    assert bound < costs[2] < costs[1] < costs[0]
    assert costs[0] > 1.03 * bound
    assert costs[2] < 1.005 * bound


@pytest.mark.parametrize("structure", [StaticGain(), LowOrder(2)])
def test_plant_that_cannot_be_stabilised_is_a_failure_with_a_sentence(structure) -> None:
    plant = LinearPlant(
        A=[[0.5, 0.0], [0.0, -1.0]],
        B=[[0.0], [1.0]],
        E=[[1.0], [1.0]],
        C=np.eye(2),
        Cz=[[0.0, 1.0]],
    )
    found = tune(plant, structure, spectrum={"w1": White(1.0)}, minimise={"z1": 1.0}, starts=3)
    assert not found.ok
    assert "no stabilising controller" in found.status
    assert found.cost == np.inf
    assert found.controller is None
    assert found.parameters == {}
    assert "no stabilising" in str(found)
    assert not found.verify().ok


def test_structure_that_is_too_poor_to_stabilise_is_a_failure_too() -> None:
    # x'' = u from the position alone: no static gain, no strictly proper filter of first order.
    for structure in (StaticGain(), LowOrder(1)):
        question = {"spectrum": WHITE, "minimise": {"x": 1.0}, "starts": 3}
        found = tune(double_integrator(), structure, **question)
        assert not found.ok
        assert "no stabilising" in found.status


# -------------------------------------------------------------- the spectrum


def low_pass(corner: float, variance: float):
    """One-sided density of x' = -corner x + w; its integral over [0, inf) is the variance."""
    return lambda omega: 2.0 / np.pi * variance * corner / (corner**2 + omega**2)


def test_callable_on_the_half_line_is_the_shaping_filters_white_noise() -> None:
    corner, variance = 0.7, 2.0
    plant = oscillator()
    A = np.vstack([np.hstack([plant.A, plant.E[:, :1]]), [0.0, 0.0, -corner]])
    shaped = LinearPlant(
        A=A,
        B=np.vstack([plant.B, [[0.0]]]),
        E=[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]],
        C=[[1.0, 0.0, 0.0]],
        F=[[0.0, 1.0]],
        Cz=[[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        Dz=plant.Dz,
        disturbances=("f", "n"),
        outputs=("x", "effort"),
    )
    white = {"f": White(2.0 * corner * variance), "n": White(0.01)}
    best = lqg(shaped, minimise=WEIGHTS, spectrum=white).cost
    found = tune(
        plant,
        LowOrder(3),
        spectrum={"f": low_pass(corner, variance), "n": White(0.01)},
        minimise=WEIGHTS,
        starts=6,
    )
    assert found.ok
    assert found.cost == pytest.approx(best, rel=1e-6)


def test_table_object_and_callable_agree() -> None:
    peak = 0.8

    def density(omega):
        with np.errstate(over="ignore"):
            return 0.3 * omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4)

    omega = np.concatenate([np.linspace(0.2, 3.0, 1400), np.geomspace(3.01, 60.0, 600)])
    sea = SimpleNamespace(density=density, band=(0.2, 60.0), splits=(peak,))
    plant = with_full_state(oscillator())
    question = {"minimise": WEIGHTS, "starts": 3}
    by_object = tune(plant, StaticGain(), spectrum={"f": sea}, **question)
    by_callable = tune(plant, StaticGain(), spectrum={"f": density}, **question)
    by_table = tune(plant, StaticGain(), spectrum={"f": (omega, density(omega))}, **question)
    assert by_object.ok
    assert by_callable.cost == pytest.approx(by_object.cost, rel=1e-6)
    assert by_table.cost == pytest.approx(by_object.cost, rel=1e-4)
    assert gain_of(by_table) == pytest.approx(gain_of(by_object), rel=0.01)


def test_wide_table_approaches_white_noise_from_below() -> None:
    plant = with_full_state(double_integrator())
    question = {"minimise": WEIGHTS, "starts": 3}
    white = tune(plant, StaticGain(), spectrum={"f": White(1.0)}, **question)
    flat = ([0.0, 5000.0], [1.0 / np.pi, 1.0 / np.pi])
    table = tune(plant, StaticGain(), spectrum={"f": flat}, **question)
    assert table.cost < white.cost
    assert table.cost == pytest.approx(white.cost, rel=1e-3)


def test_rate_of_a_disturbance_is_folded_into_it() -> None:
    # force = 4 base + 0.5 base': the density of the force is |4 + 0.5 i w|^2 that of the base.
    density = low_pass(1.0, 1.0)

    def smooth(omega):
        return density(omega) / (1.0 + (omega / 3.0) ** 2) ** 2

    plant = with_full_state(oscillator())
    based = LinearPlant(
        A=plant.A,
        B=plant.B,
        E=[[0.0, 0.0], [4.0, 0.5]],
        C=plant.C,
        Cz=plant.Cz,
        Dz=plant.Dz,
        outputs=plant.outputs,
        disturbances=("base", "base_rate"),
        rates={"base_rate": "base"},
    )
    question = {"minimise": WEIGHTS, "starts": 3}
    a = tune(based, StaticGain(), spectrum={"base": smooth}, **question)
    b = tune(
        plant,
        StaticGain(),
        spectrum={"f": lambda w: np.abs(4.0 + 0.5j * w) ** 2 * smooth(w)},
        **question,
    )
    assert a.cost == pytest.approx(b.cost, rel=1e-8)


# ------------------------------------------------------------ the arguments


def test_one_start_and_a_guess_are_enough() -> None:
    plant = with_full_state(double_integrator())
    found = tune(
        plant,
        StaticGain(),
        spectrum={"f": White(1.0)},
        minimise=WEIGHTS,
        starts=1,
        guesses=[[-3.0, -2.5]],
    )
    assert found.ok
    assert found.starts[0].begin.tolist() == [-3.0, -2.5]  # the guess comes first
    assert found.starts[0].converged
    assert found.starts[0].cost == pytest.approx(found.cost, rel=1e-4)


def test_bounds_of_parameters_are_kept_and_cost_something() -> None:
    plant = with_full_state(double_integrator())
    question = {"spectrum": {"f": White(1.0)}, "minimise": WEIGHTS, "starts": 4}
    free = tune(plant, StaticGain(), **question)
    bound = tune(plant, StaticGain(bounds={"K[u,m1]": (-1.0, 0.0)}), **question)
    assert free.parameters["K[u,m1]"] < -3.0
    assert bound.ok
    assert bound.parameters["K[u,m1]"] == pytest.approx(-1.0, rel=1e-5)
    assert bound.cost > 1.01 * free.cost


def test_controller_that_must_be_unstable_is_found_and_is_not_found_where_that_is_forbidden() -> (
    None
):
    # Parity interlacing (Youla, Bongiorno and Lu 1974): with one real pole, 4, to the right of
    # a real zero, 0.2, in the right half plane, no stable controller stabilises.
    plant = double_integrator(A=[[0.0, 1.0], [4.0, 3.0]], C=[[1.0, -5.0]])
    assert np.sort(plant.poles().real) == pytest.approx([-1.0, 4.0])
    minimise = {"x": 1.0, "effort": 0.01}
    best = lqg(plant, minimise=minimise, spectrum=WHITE)
    assert np.linalg.eigvals(best.controller.A).real.max() > 1.0
    free = tune(plant, LowOrder(2), spectrum=WHITE, minimise=minimise, starts=4)
    assert free.ok
    assert free.cost == pytest.approx(best.cost, rel=1e-6)
    kept = tune(plant, LowOrder(2, stable=True), spectrum=WHITE, minimise=minimise, starts=2)
    assert not kept.ok
    assert "no stabilising controller" in kept.status


def test_controller_kept_stable_is_stable() -> None:
    plant, spectrum, minimise = cart_problem(1)
    found = tune(plant, LowOrder(3, stable=True), spectrum=spectrum, minimise=minimise, starts=4)
    assert found.ok
    assert np.linalg.eigvals(found.controller.A).real.max() < 0.0


def test_progress_is_told_in_order() -> None:
    told: list[tuple[str, int, int]] = []
    tune(
        with_full_state(double_integrator()),
        StaticGain(),
        spectrum={"f": White(1.0)},
        minimise=WEIGHTS,
        starts=3,
        progress=lambda stage, done, total: told.append((stage, done, total)),
    )
    starts = [t for t in told if t[0] == "starts"]
    total, steps = starts[0][2], len(starts) - 1
    assert total >= steps >= 3  # more go a part of the way; and none once most of them agree
    assert starts == [("starts", k, total) for k in (*range(steps), total)]
    assert all(0 <= done <= total for _, done, total in told)


def test_tuning_prints_as_a_tree() -> None:
    found = tune(
        with_full_state(double_integrator()),
        StaticGain(),
        spectrum={"f": White(1.0)},
        minimise=WEIGHTS,
        limits=[MaxSensitivity(bound=2.0)],
        starts=2,
    )
    text = str(found)
    assert text.startswith("Tuning: optimal")
    assert "K[u,m1] = -3.16" in text
    assert "max_sensitivity: 50.0 % of 2" in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"minimise": {}}, "minimise must give at least one output a weight above 0"),
        ({"minimise": {"x": 0.0}}, "minimise must give at least one output a weight above 0"),
        ({"minimise": {"y": 1.0}}, "minimise: there is no output 'y'; there are: x, effort"),
        ({"minimise": {"x": -1.0}}, r"minimise\[x\] must be at least 0, got -1.0"),
        ({"minimise": {"x": np.nan}}, r"minimise\[x\] must be at least 0, got nan"),
        ({"spectrum": {}}, "spectrum must name at least one disturbance, got none"),
        ({"spectrum": {"g": White(1.0)}}, "there is no disturbance 'g'; there are: f"),
        ({"starts": 0}, "starts must be at least 1, got 0"),
        (
            {"limits": [Rms(output="torque", bound=1.0)]},
            "limit torque.rms: there is no output 'torque'; there are: x, effort",
        ),
        (
            {"limits": [MaxSensitivity(bound=2.0), MaxSensitivity(bound=1.5)]},
            "limits must have different names, got 'max_sensitivity' twice",
        ),
        (
            {"structure": StaticGain(bounds={"K[u,m1]": (2.0, 1.0)})},
            r"K\[u,m1\].*\(2\.0, 1\.0\)",
        ),
    ],
)
def test_bad_arguments_are_refused_with_a_sentence(changes, message: str) -> None:
    arguments = {
        "structure": StaticGain(),
        "spectrum": {"f": White(1.0)},
        "minimise": WEIGHTS,
        **changes,
    }
    with pytest.raises(InputError, match=message):
        tune(with_full_state(double_integrator()), **arguments)


# ------------------------------------------- parameters held, gains masked


def test_fixed_parameter_leaves_the_best_of_the_others() -> None:
    plant = with_full_state(oscillator())
    question = {"spectrum": {"f": White(1.0)}, "minimise": {"x": 1.0, "effort": 0.05}}
    found = tune(plant, StaticGain(), fixed={"K[u,m1]": 1.5}, starts=4, **question)
    assert found.ok, found.status

    def cost(gain: float) -> float:
        controller = LinearController.static([[1.5, gain]], plant.measurements, plant.inputs)
        return lyapunov_cost(plant, controller, question["spectrum"], question["minimise"])

    exact = minimize_scalar(cost, bounds=(-20.0, -0.01), method="bounded", options={"xatol": 1e-10})
    assert found.parameters == pytest.approx({"K[u,m1]": 1.5, "K[u,m2]": exact.x}, rel=1e-5)
    assert found.cost == pytest.approx(exact.fun, rel=1e-9)
    assert found.verify().ok


def test_masked_gain_is_a_gain_held_at_zero() -> None:
    plant = with_full_state(two_carts())
    question = {"spectrum": {"f": White(1.0)}, "minimise": {"x1": 1.0, "x2": 1.0, "effort1": 0.1}}
    masked = StaticGain(mask=((True, False, True, True),))
    found = tune(plant, masked, starts=6, **question)
    held = tune(plant, StaticGain(), fixed={"K[u1,m2]": 0.0}, starts=6, **question)
    assert found.ok, found.status
    assert held.ok, held.status
    assert "K[u1,m2]" not in found.parameters
    assert gain_of(found)[0, 1] == gain_of(held)[0, 1] == 0.0
    assert held.cost == pytest.approx(found.cost, rel=1e-8)
    all_free = tune(plant, StaticGain(), starts=4, **question)
    assert all_free.cost < found.cost
    assert lyapunov_cost(
        plant, found.controller, question["spectrum"], question["minimise"]
    ) == pytest.approx(found.cost, rel=1e-8)


def test_payload_feedback_may_hold_a_gain_at_zero() -> None:
    plant = LinearPlant(
        A=[[0.0, 1.0], [-4.0, -0.04]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=[[-4.0, -0.04], [0.0, 1.0], [1.0, 0.0]],
        D=[[1.0], [0.0], [0.0]],
        F=[[1.0], [0.0], [0.0]],
        Cz=[[1.0, 0.0], [0.0, 0.0]],
        Dz=[[0.0], [1.0]],
        measurements=MEASUREMENTS,
        inputs=("u",),
        disturbances=("f",),
        outputs=("x", "effort"),
    )
    question = {"spectrum": {"f": White(1.0)}, "minimise": {"x": 1.0, "effort": 0.05}, "starts": 4}
    found = tune(plant, PayloadFeedback(amplifier=2.0), fixed={"a": 0.0}, **question)
    assert found.ok, found.status
    assert found.parameters["a"] == 0.0
    assert gain_of(found)[0, 0] == 0.0
    exact = lqr_gain([[0.0, 1.0], [-4.0, -0.04]], [[0.0], [1.0]], np.diag([1.0, 0.0]), 0.05)
    assert gain_of(found)[0, 1:] == pytest.approx(-exact[::-1], rel=1e-5)


def lqr_gain(A, B, Q, effort) -> np.ndarray:
    R = np.array([[effort]])
    return np.linalg.solve(R, np.transpose(B) @ solve_continuous_are(A, B, Q, R)).ravel()


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"K[u,y9]": 1.0}, r"fixed: there is no parameter 'K\[u,y9\]'; there are: K\[u,y\]"),
        ({"K[u,y]": 9.0}, r"fixed: K\[u,y\] must be in \[-2, 2\], got 9.0"),
        ({"K[u,y]": 1.0}, "fixed: at least one parameter must be left free"),
    ],
)
def test_fixed_parameters_that_make_no_sense_are_refused(fixed, message) -> None:
    law = StaticGain(bounds={"K[u,y]": (-2.0, 2.0)})
    with pytest.raises(InputError, match=message):
        tune(oscillator(), law, spectrum=WHITE, minimise=WEIGHTS, fixed=fixed)


# ------------------------------------------------ the best possible beside it


def test_lqg_figure_is_the_riccati_optimum_and_is_printed_once_known() -> None:
    plant, spectrum, minimise = cart_problem(1)
    found = tune(plant, LowOrder(2), spectrum=spectrum, minimise=minimise, starts=4)
    assert "best possible" not in str(found)
    best = lqg(plant, minimise=minimise, spectrum=spectrum).cost
    assert found.lqg.cost == pytest.approx(best, rel=1e-5)
    assert found.lqg.cost <= best * (1.0 + 1e-9)
    assert found.cost > best
    assert f"best possible, whatever the margins: {found.lqg.cost:.6g}" in str(found)


def test_lqg_figure_keeps_limits_on_an_rms() -> None:
    question = {"spectrum": WHITE, "minimise": {"x": 1.0}, "starts": 4}
    limit = Rms(output="effort", bound=0.9)
    found = tune(double_integrator(), LowOrder(2), limits=[limit], **question)
    assert found.ok, found.status
    # Order two is the plant's own, so that nothing does better; a bound comes from below.
    assert found.lqg.cost == pytest.approx(found.cost, rel=1e-4)


def test_lqg_figure_that_is_not_known_says_why() -> None:
    plant = with_full_state(oscillator())
    found = tune(plant, StaticGain(), spectrum={"f": White(1.0)}, minimise=WEIGHTS, starts=2)
    assert found.lqg.cost is None
    assert "m1 must have noise of its own" in found.lqg.note
    assert "best possible, whatever the margins: not known: bound: m1" in str(found)


# ----------------------------------------------------- how far to be trusted


@pytest.mark.parametrize(("agreed", "remark"), [(3, True), (4, False)])
def test_few_starts_that_agree_are_remarked_upon(agreed: int, remark: bool, monkeypatch) -> None:
    def lonely(*asked, **options):
        return dataclasses.replace(search(*asked, **options), agreed=agreed)

    monkeypatch.setattr("synth.design.tuning.search", lonely)
    found = tune(oscillator(), LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, starts=4)
    assert found.ok
    words = f"; only {agreed} of {len(found.starts)} starts reached it"
    assert found.status.endswith(words) == remark
    assert ("starts reached it" in found.status) == remark


@pytest.mark.parametrize("starts", [1, 2, 6])
def test_no_more_starts_agree_than_there_are(starts: int) -> None:
    found = tune(oscillator(), LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, starts=starts)
    assert found.ok
    assert 0 < found.agreed <= len(found.starts)


@pytest.mark.parametrize("damping", [0.0, 0.04])
def test_undamped_mass_on_a_spring_within_a_margin(damping: float) -> None:
    # Its pole lies on the axis, where a node of any grid may fall.
    plant = oscillator(4.0, damping)
    limits = [MaxSensitivity(bound=1.2)]
    found = tune(plant, LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, limits=limits, starts=4)
    assert found.ok, found.status
    grid = np.geomspace(1e-3, 1e3, 40001)
    peak = np.abs(1.0 / (1.0 + loop_response(plant, found.controller)(grid))).max()
    assert peak == pytest.approx(1.2, rel=1e-4)
    exact = lyapunov_cost(plant, found.controller, WHITE, WEIGHTS)
    assert found.cost == pytest.approx(exact, rel=1e-8)
    assert found.verify().ok


def test_two_integrators_within_a_margin() -> None:
    # The open-loop blocks 1/s^2 have no digits left at low frequency.
    limits = [DiskMargin(bound=0.9)]
    plant = double_integrator()
    found = tune(plant, LowOrder(2), spectrum=WHITE, minimise=WEIGHTS, limits=limits, starts=4)
    assert found.ok, found.status
    exact = lyapunov_cost(plant, found.controller, WHITE, WEIGHTS)
    assert found.cost == pytest.approx(exact, rel=1e-8)
    assert found.verify().ok


def four_modes(seed: int = 111) -> LinearPlant:
    """Four lightly damped modes, pushed, shaken and seen at random, and a noisy measurement."""
    rng = np.random.default_rng(seed)
    omega = np.exp(rng.uniform(np.log(0.3), np.log(6.0), 4))
    damping = rng.uniform(0.005, 0.05, 4)
    A = np.zeros((8, 8))
    for k in range(4):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [
            [0.0, 1.0],
            [-(omega[k] ** 2), -2.0 * damping[k] * omega[k]],
        ]
    B, E, C, Cz = np.zeros((8, 1)), np.zeros((8, 2)), np.zeros((1, 8)), np.zeros((2, 8))
    B[1::2, 0] = rng.choice([-1, 1], 4) * rng.uniform(0.3, 1.5, 4)
    E[1::2, 0] = rng.normal(size=4)
    C[0, ::2] = rng.choice([-1, 1], 4) * rng.uniform(0.3, 1.5, 4)
    Cz[0, ::2] = rng.normal(size=4)
    return LinearPlant(
        A=A,
        B=B,
        E=E,
        C=C,
        F=[[0.0, 1.0]],
        Cz=Cz,
        Dz=[[0.0], [1.0]],
        inputs=("u",),
        measurements=("y",),
        disturbances=("f", "n"),
        outputs=("x", "effort"),
    )


@pytest.mark.ci
def test_drawn_poles_leave_the_optimum_that_reductions_of_lqg_end_in(monkeypatch) -> None:
    question = {
        "spectrum": {"f": White(1.0), "n": White(1e-2)},
        "minimise": {"x": 1.0, "effort": 3e-2},
    }
    plant = four_modes()
    found = tune(plant, LowOrder(3), **question)
    assert found.ok, found.status
    assert lyapunov_cost(plant, found.controller, **question) == pytest.approx(found.cost, rel=1e-8)
    monkeypatch.setattr(LowOrderLaw, "others", ParametrisedController.others)
    without = tune(plant, LowOrder(3), **question)
    assert without.ok, without.status
    assert found.cost < 0.5 * without.cost


def test_drawn_poles_come_with_the_zeros_that_follow_a_state_feedback() -> None:
    # As many states as the plant has, at an LQG controller's own poles: its transfer function is
    # the best that these poles allow, if the filter is perfect.
    plant = with_full_state(two_carts())
    minimise = {"x2": 1.0, "effort1": 0.1}
    found = tune(plant, LowOrder(2), spectrum={"f": White(1.0)}, minimise=minimise, starts=1)
    law, omega = found.problem.law, np.geomspace(0.05, 30.0, 64)
    others = law.others(found.problem, omega, 0)
    assert others.shape == (64, len(law.parameters))
    sizes = np.array([np.abs(np.linalg.eigvals(law.controller(list(v)).A)) for v in others])
    assert sizes.min() < 0.2
    assert sizes.max() > 10.0
    # Fast poles let everything through: the state feedback itself.
    stable = [v for v in others if found.problem.stable(v)]
    assert len(stable) > 32
    costs = [
        lyapunov_cost(plant, law.controller(list(v)), {"f": White(1.0)}, minimise) for v in stable
    ]
    exact = lqr_gain(plant.A, plant.B, np.diag([0.0, 1.0, 0.0, 0.0]), 0.1)
    best = LinearController.static(-exact[None], plant.measurements, plant.inputs)
    assert 1.0 <= min(costs) / lyapunov_cost(plant, best, {"f": White(1.0)}, minimise) < 1.1
