"""The programme: slopes, objective, stability, and whether its answers are optimal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loop_numbers import (
    double_integrator,
    integrator,
    lyapunov_cost,
    oscillator,
    two_carts,
    with_full_state,
)

from models.basics import Quadrature
from models.plant import LinearPlant
from synth import (
    Continuous,
    DelayMargin,
    DragElement,
    GainMargin,
    GainMarginDown,
    Limit,
    LowFrequency,
    LowOrder,
    MaxSensitivity,
    Peak,
    Rms,
    RollOff,
    StaticGain,
    White,
)
from synth.loop import Assessment, Element, LossElement, disturbances
from synth.question import Goal, Problem
from synth.search import GainProgramme, sqp
from synth.structures import Structure

OMEGA = np.geomspace(1e-3, 1e3, 60)
LIMITS = (
    MaxSensitivity(bound=1.7),
    GainMargin(bound=3.0),
    GainMarginDown(bound=0.3),
    DelayMargin(bound=0.1),
    RollOff(bound=0.2, above=8.0),
    LowFrequency(output="x", disturbance="f", bound=0.3, below=0.1),
    Rms(output="effort", bound=1.0),
    Continuous(output="x", static=0.1, bound=1.0),
    Peak(output="x", bound=2.0, duration=600.0),
)


def problem(
    plant: LinearPlant,
    structure: Structure,
    limits: tuple[Limit, ...] = (),
    minimise: dict[str, float] | None = None,
    elements: tuple[Element, ...] = (),
) -> Problem:
    noises = {"f": White(1.0), "n": White(0.01), "w": White(1.0), "n1": White(0.01)}
    known = {name: n for name, n in noises.items() if name in plant.independent_disturbances}
    return Problem(
        plant=plant,
        law=structure.bind(plant),
        disturbances=disturbances(known, plant.independent_disturbances),
        minimise=minimise or {"x": 1.0, "effort": 0.1},
        limits=limits,
        elements=elements,
    )


def view(question: Problem, values, known: tuple[float, ...] | None = None) -> Assessment:
    return Assessment(
        question.plant,
        question.law.controller(list(values)),
        question.disturbances,
        elements=question.elements,
        coefficients=known,
    )


def programme(question: Problem, values, goal: Goal = Goal.COST, **options) -> GainProgramme:
    known = tuple(element.reference for element in question.elements)
    nodes = view(question, values, known).quadrature(question.outputs)
    return GainProgramme(question, [nodes], [OMEGA], goal, reference=np.array(values), **options)


MASS = problem(double_integrator(), LowOrder(2), LIMITS)
MASS_VALUES = np.array([7.0, 24.0, -19.0, -25.0])


def test_values_are_stable() -> None:
    assert MASS.stable(MASS_VALUES)


@pytest.mark.parametrize("exact", [False, True], ids=["on nodes", "where measured"])
@pytest.mark.parametrize("goal", [Goal.COST, Goal.FEASIBLE, Goal.SEA])
def test_slopes_are_those_of_finite_differences(goal: Goal, exact: bool) -> None:
    made = programme(MASS, MASS_VALUES, goal, exact=exact)
    x0 = made.pack(MASS_VALUES, extra=0.2)
    at = made.evaluate(x0)

    def values(x):
        found = made.evaluate(x)
        return np.concatenate([[found.objective], found.rows, found.equations])

    analytic = np.vstack([at.slope[None], at.jacobian, at.equation_slopes])
    for k in range(x0.size):
        h = np.zeros(x0.size)
        h[k] = 1e-5 * max(abs(x0[k]), 1e-2)
        numeric = (values(x0 + h) - values(x0 - h)) / (2.0 * h[k])
        scale = 1.0 + np.abs(numeric)
        assert np.abs(analytic[:, k] - numeric).max() < 1e-5 * scale.max()
        assert np.all(np.abs(analytic[:, k] - numeric) < 1e-3 * scale)


@pytest.mark.parametrize(
    ("question", "values"),
    [
        (problem(two_carts(), LowOrder(1), minimise={"x2": 1.0, "effort1": 0.1}), [0.5, 0.3]),
        (problem(integrator(0.3), StaticGain(), (DelayMargin(bound=0.1),)), [-2.0]),
    ],
    ids=["two carts, two inputs", "late integrator"],
)
def test_slopes_of_other_plants_are_those_of_finite_differences(question, values) -> None:
    made = programme(question, values, exact=True)
    x0 = made.pack(values)
    at = made.evaluate(x0)
    for k in range(x0.size):
        h = np.zeros(x0.size)
        h[k] = 1e-6 * max(abs(x0[k]), 1e-2)
        above, below = made.evaluate(x0 + h), made.evaluate(x0 - h)
        slope = (above.objective - below.objective) / (2.0 * h[k])
        assert at.slope[k] == pytest.approx(slope, rel=1e-5, abs=1e-7)
        rows = (above.rows - below.rows) / (2.0 * h[k])
        assert at.jacobian[:, k] == pytest.approx(rows, rel=1e-3, abs=1e-4)


def test_the_model_of_the_curvature_is_that_of_linear_responses() -> None:
    # Where the responses are linear in a parameter, as those to a feed-forward are, the second
    # derivative of the variance is twice the model's, and that of its logarithm less its slopes'.
    made = programme(MASS, MASS_VALUES)
    at = made.evaluate(made.pack(MASS_VALUES))
    assert at.curvature == pytest.approx(at.curvature.T, rel=1e-9, abs=1e-9)
    assert np.linalg.eigvalsh(at.curvature).min() > -1e-9


@pytest.mark.parametrize(
    ("question", "values"),
    [
        (MASS, MASS_VALUES),
        (problem(with_full_state(oscillator()), StaticGain()), [-1.0, -2.0]),
        (problem(integrator(0.3), StaticGain()), [-2.0]),
        (
            problem(two_carts(), LowOrder(1), minimise={"x2": 1.0, "effort1": 0.1}),
            [0.5, 0.3],
        ),
    ],
    ids=["mass", "oscillator", "late integrator", "two carts"],
)
def test_objective_is_the_cost_that_the_assessment_finds(question: Problem, values) -> None:
    made = programme(question, values)
    (log_cost,), _ = made.violations(made.pack(values))
    seen = view(question, values)
    exact = np.sqrt(sum(w * seen.sigma(o) ** 2 for o, w in question.minimise.items()))
    assert np.exp(log_cost) == pytest.approx(exact, rel=1e-7)
    if not any(question.plant.delays):
        noises = {d.name: White(np.pi * d.density(np.ones(1))[0]) for d in question.disturbances}
        controller = question.law.controller(list(values))
        other = lyapunov_cost(question.plant, controller, noises, question.minimise)
        assert np.exp(log_cost) == pytest.approx(other, rel=1e-7)


def test_rows_agree_with_measures_on_which_limits_are_kept() -> None:
    made = programme(MASS, MASS_VALUES)
    rows = {name: row for (_, name), row in made.violations(made.pack(MASS_VALUES))[1].items()}
    seen = view(MASS, MASS_VALUES)
    uses = {limit.name: limit.use(limit.measure(seen)) for limit in MASS.limits}
    assert set(rows) == set(uses)
    for name in ("max_sensitivity", "effort.rms", "x.continuous", "x.peak", "low_frequency"):
        assert (rows[name] > 0.0) == (uses[name] > 1.0), name
    # ... and some of each
    assert {use > 1.0 for use in uses.values()} == {True, False}


def test_sea_scales_the_disturbance() -> None:
    made = programme(MASS, MASS_VALUES, Goal.SEA)
    (calm,), _ = made.violations(made.pack(MASS_VALUES, extra=0.0))
    (rough,), rows = made.violations(made.pack(MASS_VALUES, extra=np.log(2.0)))
    assert rough - calm == pytest.approx(np.log(2.0), rel=1e-12)
    seen = view(MASS, MASS_VALUES)
    assert rows[0, "effort.rms"] == pytest.approx((2.0 * seen.sigma("effort")) ** 2 - 1.0, rel=1e-6)


def test_what_is_unstable_is_never_taken() -> None:
    made = programme(MASS, MASS_VALUES)
    for values, good in ((MASS_VALUES, True), (-MASS_VALUES, False), ([7, 24, 19, 25], False)):
        assert MASS.stable(values) is good
        assert made.stable(made.pack(values)) is good
    solved = made.solve(made.pack(-MASS_VALUES))
    assert not solved.converged
    assert solved.message == "the start is unstable"
    assert np.isinf(solved.objective)


def test_every_answer_is_stable_even_where_the_optimum_lies_at_the_edge() -> None:
    # Without a price on the effort the best loop of an undamped mass is as fast as can be; with
    # too few nodes the sum can be made small by loops that the nodes do not see.
    question = problem(with_full_state(double_integrator()), StaticGain(), minimise={"x": 1.0})
    made = GainProgramme(
        question,
        [Quadrature(omega=[0.5, 1.0, 2.0], weights=[0.5, 0.7, 1.0])],
        [OMEGA],
        reference=np.array([-1.0, -1.0]),
    )
    for start in ([-1.0, -1.0], [-10.0, -0.5], [-0.1, -3.0]):
        solved = made.solve(made.pack(start))
        assert question.stable(solved.values)


@pytest.mark.parametrize(
    ("limits", "goal", "guarded"),
    [
        ((MaxSensitivity(bound=1.7),), Goal.COST, True),
        ((MaxSensitivity(bound=1.7),), Goal.FEASIBLE, False),
        ((GainMargin(bound=3.0),), Goal.COST, False),
    ],
)
def test_only_rows_that_keep_the_curve_off_minus_one_stand_for_poles(
    limits, goal, guarded, monkeypatch
) -> None:
    told = []

    def descend(*given, **options):
        told.append(options["guarded"])
        return sqp.descend(*given, **options)

    monkeypatch.setattr("synth.search.programme.descend", descend)
    question = problem(with_full_state(double_integrator()), StaticGain(), limits)
    made = programme(question, [-1.0, -1.0], goal)
    made.solve(made.pack([-1.0, -1.0]))
    assert told == [guarded]


def test_answer_meets_the_optimality_conditions() -> None:
    limits = (MaxSensitivity(bound=1.6), Rms(output="effort", bound=0.9))
    question = problem(double_integrator(), LowOrder(2), limits)
    made = programme(question, MASS_VALUES, tolerance=1e-12)
    solved = made.solve(made.pack(MASS_VALUES))
    assert solved.converged
    at = made.evaluate(made.pack(solved.values))
    assert at.broken < 1e-7
    # The gradient of the cost is a combination of those of the rows at zero, with signs.
    near = at.rows > -1e-5
    active = at.jacobian[near]
    assert 1 <= len(active) <= 4
    multipliers, *_ = np.linalg.lstsq(active.T, -at.slope, rcond=None)
    residual = at.slope + active.T @ multipliers
    assert np.abs(residual).max() < 1e-5 * np.abs(at.slope).max()
    assert np.all(multipliers > -1e-6)
    # Prices are what these multipliers make of a change of the bounds: d log cost / d log bound.
    for name in ("max_sensitivity", "effort.rms"):
        ends = [
            made.evaluate(made.pack(solved.values), {(0, name): step}).rows[near]
            for step in (1e-6, -1e-6)
        ]
        exact = multipliers @ (ends[0] - ends[1]) / 2e-6
        assert -solved.prices[0][name] == pytest.approx(exact, rel=1e-3, abs=1e-6)
    assert max(abs(price) for price in solved.prices[0].values()) > 1e-3


def test_unconstrained_answer_is_stationary_and_a_minimum() -> None:
    question = problem(double_integrator(), LowOrder(2))
    made = programme(question, MASS_VALUES, tolerance=1e-14)
    solved = made.solve(made.pack(MASS_VALUES))
    x = made.pack(solved.values)
    assert np.abs(made.evaluate(x).slope * x).max() < 1e-6
    curvature = np.empty((x.size, x.size))
    for k in range(x.size):
        h = np.zeros(x.size)
        h[k] = 1e-5 * abs(x[k])
        curvature[k] = (made.evaluate(x + h).slope - made.evaluate(x - h).slope) / (2.0 * h[k])
    assert np.linalg.eigvalsh(curvature * np.outer(x, x)).min() > 0.0


def test_bounds_and_reach_keep_parameters_where_they_are_told() -> None:
    structure = StaticGain(bounds={"K[u,m1]": (-1.5, 0.0)})
    question = problem(with_full_state(double_integrator()), structure)
    made = programme(question, [-1.0, -1.0])
    solved = made.solve(made.pack([-1.0, -1.0]))
    assert solved.values[0] == pytest.approx(-1.5, rel=1e-6)
    near = made.solve(made.pack([-1.0, -1.0]), reach=0.1)
    assert np.all(np.abs(near.values - [-1.0, -1.0]) <= 0.1 * (1.0 + 1e-6))


def test_slow_real_pole_is_kept_away_from_zero() -> None:
    # x'' = -x - 0.2 x' + u with integral action by a slow controller pole: the row is negative
    # while all real poles are beyond the slow point, and positive with one in front of it.
    question = problem(oscillator(1.0, 0.2), LowOrder(1))
    pace = -question.slow_point
    made = programme(question, [1.0, -0.1])
    assert made.evaluate(made.pack([1.0, -0.1])).rows[-1] < 0.0
    # A static gain of just under -1/|G(0)| leaves a real pole near zero.
    static = problem(with_full_state(oscillator(1.0, 3.0)), StaticGain())
    made = programme(static, [-0.5, 0.0])
    for near_zero, sign in ((1.0 - 20.0 * pace, -1.0), (1.0 - 0.5 * pace, 1.0)):
        values = [near_zero, 0.0]
        assert static.stable(values)
        poles = np.linalg.eigvals(static.law.closed_loop_matrix(static.plant, values))
        assert np.sign(poles.real.max() - static.slow_point) == sign
        assert np.sign(made.evaluate(made.pack(values)).rows[-1]) == sign


def damped_mass() -> LinearPlant:
    return LinearPlant(
        A=[[0.0, 1.0], [-4.0, -0.3]],
        B=[[0.0], [1.0]],
        E=[[0.0], [1.0]],
        C=np.eye(2),
        Cz=[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]],
        Dz=[[0.0], [0.0], [1.0]],
        inputs=("u",),
        disturbances=("f",),
        outputs=("x", "v", "effort"),
    )


DRAG = DragElement(quadratic=0.5, velocity="v", force="f", reference=0.3)
LOSS = LossElement(torque=0.2, usual=1.0, velocity="v", force="f")


@pytest.mark.parametrize("elements", [(DRAG,), (LOSS,), (DRAG, LOSS)])
def test_elements_balance_with_the_motion_at_the_answer(elements: tuple[Element, ...]) -> None:
    question = problem(damped_mass(), StaticGain(), elements=elements)
    made = programme(question, [-1.0, -1.0])
    solved = made.solve(made.pack([-1.0, -1.0], [question.begin]))
    assert solved.converged
    seen = view(question, solved.values)  # solves the coefficients itself
    assert solved.coefficient == pytest.approx(seen.coefficients, rel=1e-3)
    variance = seen.sigma("v") ** 2
    needed = {
        DRAG: 0.5 * np.sqrt(8.0 / np.pi * variance),
        LOSS: 0.2 / np.sqrt(1.0 + 0.5 * np.pi * variance),
    }
    assert seen.coefficients == pytest.approx([needed[e] for e in elements], rel=1e-8)


@pytest.mark.parametrize("exact", [False, True], ids=["on nodes", "where measured"])
def test_slopes_by_coefficients_are_those_of_finite_differences(exact: bool) -> None:
    """Rows with the losses and without, balances, cost: by gains and by both logarithms."""
    # The roll-off's peak is sought anew at every point, to fewer digits than a difference asks for.
    limits = tuple(limit for limit in LIMITS if limit.name != "roll_off")
    question = problem(damped_mass(), StaticGain(), limits, elements=(DRAG, LOSS))
    made = programme(question, [-9.0, -3.0], exact=exact)
    x0 = made.pack([-9.0, -3.0], [(0.4, 0.15)])

    def values(x):
        found = made.evaluate(x)
        return np.concatenate([[found.objective], found.rows, found.equations])

    at = made.evaluate(x0)
    assert at.equations.size == 2
    analytic = np.vstack([at.slope[None], at.jacobian, at.equation_slopes])
    for k in range(x0.size):
        h = np.zeros(x0.size)
        h[k] = 1e-5
        numeric = (values(x0 + h) - values(x0 - h)) / 2e-5
        np.testing.assert_allclose(analytic[:, k], numeric, rtol=1e-3, atol=1e-4)


def test_margins_are_held_with_losses_and_without() -> None:
    question = problem(damped_mass(), StaticGain(), LIMITS[:1], elements=(LOSS,))
    alone = problem(damped_mass(), StaticGain(), LIMITS[:1])
    both, one = (programme(q, [-0.7, -0.6]) for q in (question, alone))
    rows = [
        made.evaluate(made.pack([-0.7, -0.6], [known])).rows
        for made, known in ((both, (0.15,)), (one, ()))
    ]
    # The limit's rows and that of slow poles, each twice; without losses as without an element.
    assert rows[0].size == 2 * rows[1].size
    half = rows[1].size - 1
    np.testing.assert_allclose(rows[0][half : 2 * half], rows[1][:half], rtol=1e-9)
    assert np.abs(rows[0][:half] - rows[1][:half]).max() > 1e-3


def test_an_answer_at_the_end_of_a_range_does_not_round_beyond_it() -> None:
    # exp(log(b)) of these ends rounds upwards, and a design with it was refused by `evaluate`.
    ends = [float(b) for b in np.linspace(0.3, 1.0, 400) if np.exp(np.log(b)) > b][:3]
    assert len(ends) == 3
    for end in ends:
        law = StaticGain(bounds={"K[u,y]": (1e-3, end)})
        question = problem(replace(integrator(0.3), B=[[-1.0]]), law)
        made = programme(question, [0.9 * end])
        solved = made.solve(made.pack([0.9 * end]))
        assert solved.values == pytest.approx([end])
        assert solved.values[0] <= end
