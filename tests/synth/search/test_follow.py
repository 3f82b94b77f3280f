"""Steps from an answer to the next: where they arrive IPOPT arrives too, with the same prices."""

from __future__ import annotations

import numpy as np
import pytest

from models import load_case
from models.basics import one_thread
from synth.question import pose
from synth.search import Programme, SolverPace, assessment_of, cost_nodes, margin_nodes, search

CASES = {
    "one spring": ("thesis-1975", {}),
    "rope with drag": ("thesis-1975-rope", {"limits.drive": "report", "rope.length": 1000.0}),
}


@pytest.fixture(scope="module", params=CASES, ids=str)
def solved(request):
    name, changes = CASES[request.param]
    problem = pose(load_case(name).replace(changes)).problem
    with one_thread():
        found = search(problem, 3, 0)
        assert found.solved is not None
        values = found.solved.values
        views = [assessment_of(problem, found.solved)]
        programme = Programme(
            problem,
            cost_nodes(problem, views, rtol=1e-6),
            margin_nodes(problem, [views[0].poles], 250),
            reference=found.reference,
            tolerance=1e-10,
        )
        start = programme.pack(values, found.solved.coefficient)
        answer = programme.solve(start, pace=SolverPace.NEAR)
    assert answer.converged
    return programme, answer


def _start(programme, answer, factors):
    return programme.pack(answer.values * np.array(factors), answer.coefficient)


@pytest.mark.parametrize("factors", [(1.002, 0.998, 1.0), (0.999, 1.002, 1.001)])
def test_it_arrives_where_ipopt_does(solved, factors):
    programme, answer = solved
    with one_thread():
        followed = programme.follow(_start(programme, answer, factors))
    assert followed is not None
    assert followed.converged
    assert followed.iterations <= 12
    assert followed.objective == pytest.approx(answer.objective, abs=1e-7)
    assert followed.values == pytest.approx(answer.values, rel=1e-3)
    if answer.coefficient is not None:
        assert followed.coefficient == pytest.approx(answer.coefficient, rel=1e-4)
    for name, price in answer.prices.items():
        assert followed.prices[name] == pytest.approx(price, abs=1e-3 * (1.0 + abs(price))), name


def test_a_tighter_limit_is_followed_with_multipliers_and_without(solved):
    programme, answer = solved
    tighten = {"max_sensitivity": 0.01}
    with one_thread():
        start = programme.pack(answer.values, answer.coefficient)
        cold = programme.follow(start, None, tighten)
        warm = programme.follow(start, answer, tighten)
        ipopt = programme.solve(start, tighten=tighten, pace=SolverPace.NEAR)
    assert warm is not None
    assert cold is not None
    assert max(warm.iterations, cold.iterations) <= 8
    assert warm.objective == pytest.approx(ipopt.objective, abs=1e-7)
    assert cold.objective == pytest.approx(ipopt.objective, abs=1e-7)
    assert warm.objective > answer.objective


def test_an_unstable_start_leads_nowhere(solved):
    programme, answer = solved
    start = _start(programme, answer, (-1.0, -1.0, -1.0))
    assert not programme.problem.stable(-answer.values, answer.coefficient)
    assert programme.follow(start) is None


def test_what_it_says_is_stable_and_keeps_the_limits_on_the_nodes(solved):
    programme, answer = solved
    with one_thread():
        followed = programme.follow(_start(programme, answer, (1.02, 1.02, 0.99)))
        assert followed is not None
        assert assessment_of(programme.problem, followed).stable
        x = programme.pack(followed.values, followed.coefficient)
        assert all(row <= 1e-8 for row in programme.violations(x)[1].values())
