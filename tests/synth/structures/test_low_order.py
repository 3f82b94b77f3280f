"""The free low-order controller, and the LQG designs that its search begins with."""

from __future__ import annotations

import control
import numpy as np
import pytest
from loop_numbers import (
    FloatArray,
    closed_matrices,
    double_integrator,
    integrator,
    lyapunov_cost,
    lyapunov_variances,
    oscillator,
    two_carts,
    with_full_state,
)
from lqg_optimum import lqg
from scipy.integrate import quad
from scipy.stats import qmc

from models.basics import InputError, SolverError, SynthesisError, White
from models.plant import LinearPlant
from synth.loop import Disturbance, LinearController, disturbances
from synth.question import Problem
from synth.search.starts import candidates, crossover_grid
from synth.structures import LowOrder, ParametrisedController, reduced, weighing
from synth.structures.lqg import designs, regulator, whitened

WHITE = {"f": White(1.0), "n": White(0.01)}
WEIGHTS = {"x": 1.0, "effort": 0.1}
SIZES = [(1, 1, 1), (2, 1, 1), (3, 1, 2), (4, 2, 1), (5, 2, 2), (4, 3, 2), (1, 2, 3)]


def any_plant(nu: int, ny: int) -> LinearPlant:
    rng = np.random.default_rng(2)
    return LinearPlant(
        A=rng.normal(size=(4, 4)) - 2.0 * np.eye(4),
        B=rng.normal(size=(4, nu)),
        E=np.ones((4, 1)),
        C=rng.normal(size=(ny, 4)),
    )


def any_values(law: ParametrisedController, seed: int = 9) -> FloatArray:
    scales = np.array([p.scale for p in law.parameters])
    return np.asarray(np.random.default_rng(seed).normal(size=scales.size) * scales)


def problem(
    plant: LinearPlant, law: ParametrisedController, minimise: dict[str, float], **noises: White
) -> Problem:
    return Problem(
        plant=plant,
        law=law,
        disturbances=disturbances(noises or WHITE, plant.independent_disturbances),
        minimise=minimise,
        limits=(),
    )


@pytest.mark.parametrize(("order", "nu", "ny"), SIZES)
@pytest.mark.parametrize("proper", [False, True])
def test_parameters_are_as_few_as_they_can_be(order: int, nu: int, ny: int, proper: bool) -> None:
    law = LowOrder(order, proper=proper).bind(any_plant(nu, ny))
    assert len(law.parameters) == order * (nu + ny) + proper * nu * ny
    assert len({p.name for p in law.parameters}) == len(law.parameters)
    # No combination of them leaves the response alone: the Jacobian has full column rank.
    omega = np.geomspace(0.1, 10.0, 40)
    values, scales = any_values(law), np.array([p.scale for p in law.parameters])

    def response(x: FloatArray) -> FloatArray:
        found = law.controller(list(x)).response_at(1j * omega).ravel()
        return np.concatenate([found.real, found.imag])

    steps = 1e-6 * np.diag(scales)
    columns = [(response(values + h) - response(values - h)) / 2e-6 for h in steps]
    sizes = np.linalg.svd(np.array(columns).T, compute_uv=False)
    assert sizes[-1] > 1e-7 * sizes[0]


def test_names_say_what_the_parameters_are() -> None:
    law = LowOrder(3, proper=True).bind(two_carts(2))
    names = [p.name for p in law.parameters]
    assert names[:2] == ["alpha1[1]", "alpha0[1]"]
    assert {"B[1.1,y2]", "B[1.2,y1]", "C[u2,1.1]", "C[u2,1.2]"} <= set(names)
    # the second block, of first order, is fixed in the other input's row
    assert {"alpha0[2]", "B[2.1,y1]", "C[u1,2.1]", "D[u2,y1]"} <= set(names)
    assert "alpha1[2]" not in names
    values = dict.fromkeys(names, 0.0)
    values |= {"alpha1[1]": 3.0, "alpha0[1]": 2.0, "alpha0[2]": 5.0}
    poles = np.linalg.eigvals(law.controller(list(values.values())).A)
    assert np.sort(poles.real) == pytest.approx([-5.0, -2.0, -1.0])


@pytest.mark.parametrize(("order", "nu", "ny"), SIZES)
def test_any_controller_has_parameters(order: int, nu: int, ny: int) -> None:
    plant = any_plant(nu, ny)
    law = LowOrder(order, proper=True).bind(plant)
    rng = np.random.default_rng(order + nu)
    for seed in range(5):
        controller = LinearController(
            A=rng.normal(size=(order, order)) + (seed - 2.0) * np.eye(order),
            B=rng.normal(size=(order, ny)),
            C=rng.normal(size=(nu, order)),
            D=rng.normal(size=(nu, ny)),
            measurements=plant.measurements,
            inputs=plant.inputs,
        )
        again = law.controller(list(law.values(controller)))
        s = 1j * np.geomspace(0.1, 10.0, 9)
        assert again.response_at(s) == pytest.approx(controller.response_at(s), rel=1e-6)


@pytest.mark.parametrize("repeated", [np.diag([-1.0, -1.0]), np.array([[-1.0, 1.0], [0.0, -1.0]])])
def test_repeated_pole_is_pulled_apart_no_further_than_needed(repeated: FloatArray) -> None:
    plant = any_plant(1, 1)
    law = LowOrder(2).bind(plant)
    controller = LinearController(
        A=repeated,
        B=[[1.0], [2.0]],
        C=[[3.0, 1.0]],
        D=[[0.0]],
        measurements=plant.measurements,
        inputs=plant.inputs,
    )
    again = law.controller(list(law.values(controller)))
    s = 1j * np.geomspace(0.1, 10.0, 9)
    assert again.response_at(s) == pytest.approx(controller.response_at(s), rel=1e-3)


def test_controller_of_lower_order_is_padded_without_a_change() -> None:
    plant = any_plant(2, 1)
    law = LowOrder(5).bind(plant)
    controller = LinearController(
        A=[[-1.0, 2.0], [-2.0, -1.0]],
        B=[[1.0], [0.5]],
        C=[[1.0, 2.0], [0.3, -1.0]],
        D=[[0.0], [0.0]],
        measurements=plant.measurements,
        inputs=plant.inputs,
    )
    again = law.controller(list(law.values(controller)))
    s = 1j * np.geomspace(0.1, 10.0, 9)
    assert again.response_at(s) == pytest.approx(controller.response_at(s), rel=1e-9)
    assert np.linalg.eigvals(again.A).real.max() < 0.0


def test_two_channels_apart_are_an_ordinary_point() -> None:
    plant = any_plant(2, 2)
    law = LowOrder(4).bind(plant)
    controller = LinearController(
        A=[[-1, 3, 0, 0], [-3, -1, 0, 0], [0, 0, -2, 1], [0, 0, -1, -2]],
        B=[[1, 0], [2, 0], [0, 1], [0, 3]],
        C=[[1, 1, 0, 0], [0, 0, 2, 1]],
        D=np.zeros((2, 2)),
        measurements=plant.measurements,
        inputs=plant.inputs,
    )
    values = law.values(controller)
    s = 1j * np.geomspace(0.1, 10.0, 9)
    again = law.controller(list(values)).response_at(s)
    assert again == pytest.approx(controller.response_at(s), rel=1e-9, abs=1e-12)
    assert np.abs(values).max() < 100.0


def test_first_guess_is_the_optimum_for_white_noise() -> None:
    for plant, minimise, noises in (
        (double_integrator(), WEIGHTS, WHITE),
        (
            two_carts(2),
            {"x1": 1.0, "x2": 2.0, "effort1": 0.1, "effort2": 0.3},
            {"f": White(1.0), "n1": White(0.01), "n2": White(0.02)},
        ),
    ):
        order = len(plant.states)
        law = LowOrder(order).bind(plant)
        question = problem(plant, law, minimise, **noises)
        guess = law.guesses(question, crossover_grid(question))[0]
        best = lqg(plant, minimise=minimise, spectrum=noises).cost
        cost = lyapunov_cost(plant, law.controller(list(guess)), noises, minimise)
        assert cost == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_many_candidates_are_stable_and_the_seed_decides_which(order: int) -> None:
    plant = two_carts()
    law = LowOrder(order).bind(plant)
    question = problem(plant, law, {"x2": 1.0, "effort1": 0.1}, f=White(1.0), n1=White(0.01))
    points = candidates(question, 512, seed=0)
    assert points.shape[1] == 2 * order
    stable = np.mean([question.stable(p) for p in points])
    assert stable > 0.3  # of random controllers of order 4, fewer than one in a hundred
    assert np.array_equal(points, candidates(question, 512, seed=0))
    assert not np.array_equal(points, candidates(question, 512, seed=1))


def test_candidates_for_a_late_plant_stabilise_it() -> None:
    plant = integrator(0.4)
    law = LowOrder(2).bind(plant)
    question = problem(plant, law, {"x": 1.0}, w=White(1.0))
    points = candidates(question, 256, seed=0)
    assert np.mean([question.stable(p) for p in points]) > 0.3


def test_candidates_for_a_plant_that_nothing_stabilises_are_still_proposed() -> None:
    plant = LinearPlant(A=[[1.0]], B=[[0.0]], E=[[1.0]], C=[[1.0]])
    law = LowOrder(2).bind(plant)
    points = qmc.Sobol(law.dimensions, seed=0).random_base2(4)
    omega = np.array([0.5, 2.0])
    drawn = law.draw(points, omega, plant.response(omega).yu)
    assert drawn.shape == (16, 4)
    assert np.all(np.isfinite(drawn))
    assert np.any(drawn > 0.0)
    assert np.any(drawn < 0.0)


def test_bounds_and_stability_of_the_controller_are_kept_by_candidates() -> None:
    plant = oscillator(stiffness=-9.0)
    law = LowOrder(2, stable=True, bounds={"B[1.2,y]": (-50.0, 0.0)}).bind(plant)
    points = candidates(problem(plant, law, WEIGHTS), 128, seed=0)
    names = [p.name for p in law.parameters]
    for name in ("alpha0[1]", "alpha1[1]"):
        assert points[:, names.index(name)].min() > 0.0
    assert points[:, names.index("B[1.2,y]")].min() >= -50.0
    assert points[:, names.index("B[1.2,y]")].max() <= 0.0


@pytest.mark.parametrize("order", [0, -1, 1.5, True, "2"])
def test_order_must_be_a_whole_number(order: object) -> None:
    with pytest.raises(InputError, match="order must be a whole number of at least 1, got"):
        LowOrder(order)  # type: ignore[arg-type]


def test_bound_of_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(InputError, match=r"no parameter 'alpha9' to bound; there are: alpha1\[1\]"):
        LowOrder(2, bounds={"alpha9": (0.0, 1.0)}).bind(double_integrator())


def test_plant_without_a_measurement_is_refused() -> None:
    plant = LinearPlant(A=[[-1.0]], B=[[1.0]], E=[[1.0]], C=np.zeros((0, 1)))
    with pytest.raises(InputError, match="must have an input and a measurement"):
        LowOrder(1).bind(plant)


# ------------------------------------------------------------------- LQG


def test_lqg_cost_is_the_lyapunov_variance_of_its_loop() -> None:
    for plant, minimise, noises in (
        (double_integrator(), WEIGHTS, WHITE),
        (oscillator(-9.0), WEIGHTS, WHITE),
        (double_integrator(D=[[0.3]]), WEIGHTS, WHITE),
    ):
        design = lqg(plant, minimise=minimise, spectrum=noises)
        exact = lyapunov_cost(plant, design.controller, noises, minimise)
        assert design.cost == pytest.approx(exact, rel=1e-9)


def test_lqg_with_cross_terms_is_stationary() -> None:
    # Outputs that mix state and input, a noise that acts on state and measurement at once.
    plant = LinearPlant(
        A=[[0.0, 1.0], [-1.0, 0.2]],
        B=[[0.0], [1.0]],
        E=[[0.3, 0.0], [1.0, 0.0]],
        C=[[1.0, 0.5]],
        F=[[0.4, 0.2]],
        Cz=[[1.0, 0.0], [0.5, 1.0]],
        Dz=[[0.2], [0.6]],
    )
    noises = {"w1": White(1.0), "w2": White(0.5)}
    minimise = {"z1": 1.0, "z2": 2.0}
    design = lqg(plant, minimise=minimise, spectrum=noises)
    exact = lyapunov_cost(plant, design.controller, noises, minimise)
    assert design.cost == pytest.approx(exact, rel=1e-9)
    rng = np.random.default_rng(0)
    best = design.controller
    for _ in range(40):
        other = LinearController(
            A=best.A + 1e-3 * rng.normal(size=best.A.shape),
            B=best.B + 1e-3 * rng.normal(size=best.B.shape),
            C=best.C + 1e-3 * rng.normal(size=best.C.shape),
            D=best.D,
            measurements=best.measurements,
            inputs=best.inputs,
        )
        assert lyapunov_cost(plant, other, noises, minimise) >= exact * (1.0 - 1e-12)


def test_regulator_and_filter_are_those_of_python_control() -> None:
    plant = two_carts(2)
    minimise = {"x1": 1.0, "x2": 2.0, "effort1": 0.1, "effort2": 0.3}
    noises = {"f": White(1.0), "n1": White(0.01), "n2": White(0.02)}
    design = lqg(plant, minimise=minimise, spectrum=noises)
    Q, R = np.diag([1.0, 2.0, 0.0, 0.0]), np.diag([0.1, 0.3])
    assert -design.regulator.gain == pytest.approx(
        control.lqr(plant.A, plant.B, Q, R)[0], rel=1e-8, abs=1e-9
    )
    gain = control.lqe(plant.A, plant.E[:, :1], plant.C, [[1.0]], np.diag([0.01, 0.02]))[0]
    assert design.estimator.gain == pytest.approx(gain, rel=1e-8, abs=1e-9)


def test_any_regulator_with_any_filter_is_stable_and_truncation_keeps_the_best_part() -> None:
    plant = two_carts()
    minimise, noises = {"x2": 1.0, "effort1": 0.1}, {"f": White(1.0), "n1": White(0.01)}
    shaken = whitened(plant, disturbances(noises, plant.independent_disturbances))
    regulators, filters = designs(shaken, minimise, np.geomspace(0.1, 10.0, 30))
    assert len(regulators) > 4
    assert len(filters) > 4
    for r in regulators:
        for f in filters:
            A = closed_matrices(plant, reduced(plant, r, f, 4))[0]
            assert np.linalg.eigvals(A).real.max() < 0.0
    full = lyapunov_cost(plant, reduced(plant, regulators[0], filters[0], 4), noises, minimise)
    half = [
        lyapunov_cost(plant, reduced(plant, r, f, 2), noises, minimise)
        for r in regulators
        for f in filters
    ]
    assert np.mean(np.isfinite(half)) > 0.5
    assert full < min(half) < 1.25 * full


@pytest.mark.parametrize(
    ("plant", "minimise", "spectrum", "message"),
    [
        (double_integrator(), {"x": 1.0}, WHITE, "R must be positive definite"),
        (double_integrator(), WEIGHTS, {"f": White(1.0)}, "R must be positive definite"),
        (
            double_integrator(Fz=[[0.0, 1.0], [0.0, 0.0]]),
            WEIGHTS,
            WHITE,
            "hears white noise directly: infinite cost",
        ),
        (
            double_integrator(B=[[0.0], [0.0]]),
            WEIGHTS,
            WHITE,
            "pole on the imaginary axis",
        ),
        (
            double_integrator(C=[[0.0, 0.0]]),
            WEIGHTS,
            WHITE,
            "pole on the imaginary axis",
        ),
    ],
)
def test_problems_without_an_lqg_solution_say_so(plant, minimise, spectrum, message: str) -> None:
    with pytest.raises((SolverError, SynthesisError), match=message):
        lqg(plant, minimise=minimise, spectrum=spectrum)


@pytest.mark.parametrize(
    ("plant", "minimise", "spectrum", "message"),
    [
        (double_integrator(), {"y": 1.0}, WHITE, "no output 'y'; there are: x, effort"),
        (double_integrator(), WEIGHTS, {"g": White(1.0)}, "no disturbance 'g'; there are: f, n"),
        (double_integrator(delays=(0.1,)), WEIGHTS, WHITE, "neither delays nor rates"),
    ],
)
def test_lqg_checks_what_it_is_given(plant, minimise, spectrum, message: str) -> None:
    with pytest.raises(InputError, match=message):
        lqg(plant, minimise=minimise, spectrum=spectrum)


def test_regulator_refuses_a_solution_that_does_not_stabilise() -> None:
    # An undamped oscillator that no weight sees: the equation has a solution, the loop no damping.
    plant = with_full_state(oscillator(4.0, 0.0))
    Q, R, S = weighing(np.zeros((1, 2)), np.ones((1, 1)), np.ones(1))
    with pytest.raises(SolverError, match="pole on the imaginary axis"):
        regulator(plant, Q, R, S)


def test_whitened_spectrum_keeps_peak_and_variance() -> None:
    def density(omega):
        return 2.0 / ((1.0 - (omega / 0.8) ** 2) ** 2 + (0.3 * omega / 0.8) ** 2)

    variance = quad(density, 0.01, 50.0, limit=500, points=[0.8])[0]
    plant = LinearPlant(
        A=[[-1.0]],
        B=[[1.0]],
        E=[[0.0, 0.0, 1.0]],
        C=[[1.0]],
        Cz=[[0.0], [0.0], [1.0]],
        Fz=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]],
        disturbances=("base", "base_rate", "force"),
        rates={"base_rate": "base"},
        outputs=("base", "rate", "x"),
    )
    base = Disturbance(name="base", density=density, band=(0.01, 50.0))
    shaken = whitened(plant, (base, *disturbances({"force": White(3.0)}, ("base", "force"))))
    assert shaken.disturbances == ("base", "force")
    assert not shaken.rates
    still = LinearController.static([[0.0]], shaken.measurements, shaken.inputs)
    found = lyapunov_variances(shaken, still, {"base": White(1.0), "force": White(1.0)})
    assert found["base"] == pytest.approx(variance, rel=0.01)
    assert found["x"] == pytest.approx(1.5, rel=1e-9)
    peak = np.abs(shaken.response([0.8]).column("base", "base")[0]) ** 2 / np.pi
    assert peak == pytest.approx(density(0.8), rel=0.1)
    # Its second state is the rate.
    response = shaken.response([0.3, 2.0])
    assert response.column("rate", "base") == pytest.approx(
        1j * np.array([0.3, 2.0]) * response.column("base", "base"), rel=1e-12
    )
