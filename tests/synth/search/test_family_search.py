"""One set of parameters for many loops: against brute force, and against what one loop gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loop_numbers import lyapunov_cost, oscillator, with_full_state
from scipy.optimize import minimize

from models.basics import InputError
from synth import MaxSensitivity, Rms, StaticGain, White
from synth.loop import LinearController, disturbances
from synth.question import FamilyLoop, FamilyProblem, Objective, Problem
from synth.search import search, with_bests

WEIGHTS = {"x": 1.0, "effort": 1e-2}
STIFFNESS = (1.0, 4.0, 9.0)


def scenarios(limits=(), weights=(1.0, 1.0, 1.0)) -> list[FamilyLoop]:
    found: list[FamilyLoop] = []
    law = None
    for stiffness, weight in zip(STIFFNESS, weights, strict=True):
        plant = with_full_state(oscillator(stiffness))
        law = law or StaticGain().bind(plant)
        noise = {name: White(1.0) for name in plant.independent_disturbances}
        problem = Problem(
            plant=plant,
            law=law,
            disturbances=disturbances(noise, plant.independent_disturbances),
            minimise=WEIGHTS,
            limits=tuple(limits),
        )
        found.append(FamilyLoop(name=f"k = {stiffness}", problem=problem, weight=weight))
    return found


def family(found, name="worst", **changes) -> FamilyProblem:
    return FamilyProblem(scenarios=tuple(found), objective=Objective.of(name), **changes)


def costs_of(gains) -> np.ndarray:
    found = []
    for stiffness in STIFFNESS:
        plant = with_full_state(oscillator(stiffness))
        controller = LinearController.static([list(gains)], plant.measurements, plant.inputs)
        noise = dict.fromkeys(plant.independent_disturbances, White(1.0))
        try:
            found.append(lyapunov_cost(plant, controller, noise, WEIGHTS))
        except ValueError:
            found.append(np.inf)
    return np.array(found)


def brute(total) -> float:
    """The least of a function of the three costs, by Nelder and Mead from several starts."""

    def value(gains) -> float:
        found = costs_of(gains)
        return float(total(found)) if np.isfinite(found).all() else 1e6

    starts = [(-1.0, -1.0), (-10.0, -5.0), (-3.0, -10.0)]
    options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000, "maxfev": 4000}
    return min(minimize(value, s, method="Nelder-Mead", options=options).fun for s in starts)


@pytest.mark.parametrize("name", ["worst", "mean", "regret"])
def test_the_objective_is_as_low_as_brute_force_finds_it(name):
    weights = (1.0, 2.0, 5.0)
    family_scenarios = scenarios(weights=weights)
    bests = np.array([brute(lambda c, i=i: c[i]) for i in range(3)])
    family_scenarios = [
        replace(s, best=float(b)) for s, b in zip(family_scenarios, bests, strict=True)
    ]
    asked = family(family_scenarios, name)
    found = search(asked, 4)
    totals = {
        "worst": lambda c: c.max(),
        "mean": lambda c: np.sqrt(np.dot(weights, c**2) / sum(weights)),
        "regret": lambda c: (c / bests).max(),
    }
    assert found.solved is not None
    mine = totals[name](costs_of(found.solved.values))
    assert mine == pytest.approx(brute(totals[name]), rel=1e-5)
    assert asked.total(found.solved.costs) == pytest.approx(mine, rel=1e-6)


def test_the_mean_is_not_above_the_worst_and_the_worst_not_above_the_means():
    worst = search(family(scenarios(), "worst"), 3).solved
    mean = search(family(scenarios(), "mean"), 3).solved
    assert worst is not None
    assert mean is not None
    assert worst.costs.max() <= mean.costs.max() * (1.0 + 1e-6)
    assert np.mean(mean.costs**2) <= np.mean(worst.costs**2) * (1.0 + 1e-6)


def test_every_loop_keeps_the_margin():
    found = search(family(scenarios([MaxSensitivity(bound=1.05)])), 4)
    assert found.excess <= 1e-5
    assert max(view.max_sensitivity for view in found.assessments) <= 1.05 * (1.0 + 1e-5)


def test_pressure_lies_on_the_scenarios_that_decide():
    solved = search(family(scenarios(), "worst"), 3).solved
    assert solved is not None
    assert solved.pressure.sum() == pytest.approx(1.0)
    for cost, pressure in zip(solved.costs, solved.pressure, strict=True):
        assert pressure < 1e-3 or cost == pytest.approx(solved.costs.max(), rel=1e-4)


def test_a_family_of_one_is_its_problem():
    one = scenarios([MaxSensitivity(bound=1.05)])[0]
    alone, found = search(one.problem, 3).solved, search(family([one]), 3).solved
    assert alone is not None
    assert found is not None
    assert found.values == pytest.approx(alone.values)
    assert found.prices == alone.prices


def test_two_members_that_are_the_same_are_one():
    one = scenarios([MaxSensitivity(bound=1.05)])[0]
    alone = search(one.problem, 3).solved
    for name in ("worst", "mean", "regret"):
        found = search(family([one, one], name), 3).solved
        assert alone is not None
        assert found is not None
        assert found.costs == pytest.approx(np.repeat(alone.costs, 2), rel=1e-6)


def test_a_member_sees_its_answer_as_its_own():
    asked = family(scenarios())
    found = search(asked, 3)
    for k, scenario in enumerate(asked.scenarios):
        own = found.member(k, scenario)
        assert own.solved is not None
        assert own.assessment is found.assessments[k]
        assert np.exp(own.solved.objective) == pytest.approx(found.costs[k])
        assert len(own.solved.prices) == len(own.solved.coefficients) == 1


def test_the_best_of_each_member_is_that_of_brute_force():
    bests = [scenario.best for scenario in with_bests(family(scenarios(), "regret")).scenarios]
    assert bests == pytest.approx([brute(lambda c, i=i: c[i]) for i in range(3)], rel=1e-5)


def test_a_member_without_gains_of_its_own_has_no_regret():
    # As still as that asks for more effort than that.
    hopeless = scenarios([Rms(output="x", bound=1e-3), Rms(output="effort", bound=1e-3)])
    with pytest.raises(InputError, match=r"regret: k = 1\.0: no gains of its own"):
        with_bests(family(hopeless, "regret"))


def test_blended_gains_are_as_good_as_brute_force_finds_them():
    # Two sets of gains, one at each end of the stiffness; the loop between has their mean.
    blends = ([1.0, 0.0], [0.5, 0.5], [0.0, 1.0])
    own = scenarios()
    parameters = own[0].problem.law.parameters
    blended = [
        replace(s, blend=np.kron(np.array(b), np.eye(2))) for s, b in zip(own, blends, strict=True)
    ]
    asked = family(blended, "mean", parameters=(*parameters, *parameters))
    found = search(asked, 3, guesses=[[-1.0, -1.0, -1.0, -1.0], [-3.0, -10.0, -3.0, -10.0]])

    def total(gains) -> float:
        sets = np.reshape(gains, (2, 2))
        costs = [costs_of(np.array(b) @ sets)[k] for k, b in enumerate(blends)]
        return float(np.sqrt(np.mean(np.square(costs)))) if np.isfinite(costs).all() else 1e6

    options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000, "maxfev": 4000}
    starts = [[-1.0, -1.0, -1.0, -1.0], [-3.0, -10.0, -3.0, -10.0]]
    least = min(minimize(total, s, method="Nelder-Mead", options=options).fun for s in starts)
    assert found.solved is not None
    assert total(found.solved.values) == pytest.approx(least, rel=1e-5)
    assert np.exp(found.solved.objective) == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("make", ["empty", "weightless", "misfit"])
def test_what_is_no_family_is_refused(make):
    own = scenarios()
    messages = {
        "empty": "at least one scenario",
        "weightless": "weight",
        "misfit": "blend of shape",
    }
    given = {
        "empty": [],
        "weightless": [replace(s, weight=0.0) for s in own],
        "misfit": [replace(own[0], blend=np.eye(3)), *own[1:]],
    }
    with pytest.raises(InputError, match=messages[make]):
        family(given[make])
