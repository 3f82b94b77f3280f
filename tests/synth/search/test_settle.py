"""Descents: where they arrive from near and far, and what they keep."""

from __future__ import annotations

import numpy as np
import pytest

from models import load_case
from models.basics import one_thread
from synth.question import FamilyProblem, Goal, pose
from synth.search import KEPT, Solution, assess, polish, search, settle, stated

CASES = {
    "one spring": ("thesis-1975", {}),
    "rope with drag": ("thesis-1975-rope", {"limits.drive": "report", "rope.length": 1000.0}),
    "gain margin down": ("landing", {}),
}


@pytest.fixture(scope="module", params=CASES, ids=str)
def solved(request):
    name, changes = CASES[request.param]
    problem = pose(load_case(name).replace(changes)).problem
    with one_thread():
        found = search(problem, 3, 0)
    assert found.solved is not None
    assert found.solved.converged
    return problem, found.solved


def near(problem, answer: Solution, factors) -> Solution:
    with one_thread():
        values = answer.values * np.array(factors)
        return settle(problem, values, answer.coefficients, reference=answer.values, fine=True)


@pytest.mark.parametrize("factors", [(1.002, 0.998, 1.0), (0.97, 1.03, 1.02)])
def test_neighbours_lead_to_the_answer_with_its_prices(solved, factors):
    problem, answer = solved
    again = near(problem, answer, factors)
    assert again.converged
    assert again.objective == pytest.approx(answer.objective, abs=1e-6)
    assert again.values == pytest.approx(answer.values, rel=1e-3)
    for name, price in answer.prices[0].items():
        assert again.prices[0][name] == pytest.approx(price, abs=1e-3 * (1.0 + abs(price))), name


def test_no_descent_from_the_answer_finds_anything_better(solved):
    # The answer is an optimum of the true margins: no stable point about it that keeps all limits
    # costs less.
    problem, answer = solved
    programme = stated(
        problem, answer.values, answer.coefficients, reference=answer.values, fine=True, exact=True
    )
    rng = np.random.default_rng(0)
    best = np.inf
    for _ in range(300):
        values = answer.values * (1.0 + 0.02 * rng.standard_normal(answer.values.size))
        x = programme.pack(values, answer.coefficients)
        if programme.stable(x):
            (cost,), rows = programme.violations(x)
            if max(rows.values()) <= 0.0:
                best = min(best, cost)
    assert best > answer.objective - 1e-4


def test_an_answer_keeps_the_measured_limits(solved):
    problem, answer = solved
    (assessment,), excess = assess(problem, answer)
    assert assessment.stable
    assert excess <= 1e-5


def test_a_tighter_limit_costs_what_its_price_says(solved):
    problem, answer = solved
    tighten = {(0, "max_sensitivity"): 1e-3}
    with one_thread():
        dearer = settle(
            problem,
            answer.values,
            answer.coefficients,
            reference=answer.values,
            fine=True,
            tighten=tighten,
        )
    price = -answer.prices[0]["max_sensitivity"]
    assert dearer.objective - answer.objective == pytest.approx(1e-3 * price, rel=0.05, abs=1e-8)


def test_an_unstable_start_leads_nowhere(solved):
    problem, answer = solved
    assert not problem.stable(-answer.values, answer.coefficient)
    with one_thread():
        found = settle(problem, -answer.values, answer.coefficients, reference=answer.values)
    assert not found.converged
    assert np.isinf(found.objective)


@pytest.fixture(scope="module", params=["payload-feedback-rolloff", "payload-feedback"])
def largest_sea(request):
    # At the load the rope would go slack in any sea whose drag holds the loop: not asked here.
    wider = {"limits.max_sensitivity": 2.5, "limits.low_frequency.ratio": 0.125}
    changes = wider if request.param == "payload-feedback" else {}
    case = load_case("thesis-1975-rope").replace({"limits.tension_ends": "drum", **changes})
    problem = pose(case, request.param).problem
    with one_thread():
        begin = search(FamilyProblem.of(problem), 2, 0).reference
        assert begin is not None
        drags = (tuple(0.1 * begin for begin in problem.begin),)
        sea = settle(problem, begin, drags, Goal.SEA, reference=begin, extra=-2.0)
        sea, (assessment,), excess = polish(problem, sea, begin, Goal.SEA)
    return problem, sea, assessment, excess


def test_the_largest_sea_of_a_drive_is_where_a_limit_of_it_binds(largest_sea) -> None:
    problem, sea, assessment, excess = largest_sea
    assert sea.converged
    assert excess <= 1e-5
    uses = [lim.use(lim.measure(assessment)) for lim in problem.limits if lim.drive]
    assert max(uses) == pytest.approx(1.0, abs=1e-4)


def test_a_descent_goes_along_the_edge_of_what_is_stable_in_small_motion(largest_sea) -> None:
    # In its largest sea the loop has next to all damping of its slowest mode from drag.
    problem, sea, _, _ = largest_sea
    assert problem.stable(sea.values, sea.coefficient)
    calm = problem.loop_poles(sea.values, problem.nothing)
    slowest = calm[(calm.imag > 0.0) & (np.abs(calm) < 2.0)]
    assert (-slowest.real / np.abs(slowest)).min() == pytest.approx(3e-4, rel=1e-3)
    # One that stopped where it came upon the edge told exp(0.82) and exp(0.12) of the sea.
    assert sea.extra == pytest.approx(1.2706 if sea.values.size > 3 else 0.3673, abs=1e-4)
    programme = stated(
        problem, sea.values, sea.coefficients, Goal.SEA, reference=sea.values, fine=True, exact=True
    )
    x = programme.pack(sea.values, sea.coefficients, sea.extra)
    at = programme.evaluate(x)
    assert np.abs(at.rows[at.firm]) == pytest.approx([0.0], abs=1e-7)
    for k in range(x.size):
        h = np.zeros(x.size)
        h[k] = 1e-4 * abs(x[k])
        above, below = programme.evaluate(x + h), programme.evaluate(x - h)
        slope = (above.rows[above.firm] - below.rows[below.firm]) / (2.0 * h[k])
        assert at.jacobian[at.firm, k] == pytest.approx(slope, rel=1e-5, abs=1e-9)


@pytest.mark.ci
def test_limits_that_only_a_loop_that_swings_by_itself_keeps_exclude_each_other() -> None:
    # Of all gains that are stable in small motion and drags up to 1e5 N s/m, differential
    # evolution finds none with M_s below 2.40 and a low frequency's ratio below 0.120.
    case = load_case("thesis-1975-rope").replace({"limits.drive": "report"})
    question = pose(case)
    with one_thread():
        found = search(FamilyProblem.of(question.problem_with(question.loop)), 2, 0)
    assert found.excess > KEPT
    assert found.solved is not None
    seen = {limit.name: limit.use(limit.worst(found.assessments[0])) for limit in question.loop}
    assert max(seen.values()) == pytest.approx(1.22, abs=0.02)
