"""Problems of other fields: our answer, CVXPY's statement, and what others' controllers say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from published_problems import PROBLEMS, Published, acados_answer, do_mpc_answer
from stated_programme import stated

import mpc
from mpc.programme import sampled

ROOT = Path(__file__).parents[3]
# The optimum from the source's own initial state, by CVXPY and Clarabel.
OPTIMA = {
    "mass chain": 24.223509666843,
    "oscillating masses": 57.944607046460,
    "quadcopter": 28.033028041590,
}


def programme_of(p: Published) -> mpc.Programme:
    outputs = [name for name in p.costs if name.startswith("x")]
    return mpc.Programme(
        p.plant,
        period=p.period,
        horizon=p.steps * p.period,
        costs=p.costs,
        constraints=[
            mpc.Constraint(signal=name, low=low, high=high, samples=at)
            for name, low, high, at in p.limits
        ],
        references=[*outputs, *(name for name in p.costs if name.startswith("u"))],
        terminal=p.terminal,
    )


def answer_of(programme: mpc.Programme, p: Published, x0: np.ndarray) -> mpc.Plan:
    references = {f"x{i}": float(r) for i, r in enumerate(p.xr) if f"x{i}" in p.costs}
    return programme.solve(x0, references=references)


@pytest.fixture(params=PROBLEMS)
def problem(request):
    return PROBLEMS[request.param]()


def test_a_discrete_plant_has_a_continuous_one(problem):
    A, B, _ = sampled(problem.plant, problem.period)
    np.testing.assert_allclose(A, problem.A, atol=1e-12)
    np.testing.assert_allclose(B, problem.B, atol=1e-12)


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_optimum_is_that_of_the_plain_statement(name):
    p = PROBLEMS[name]()
    programme, rng = programme_of(p), np.random.default_rng(1)
    limited = 0
    for share in (1.0, 0.9, 0.7, 0.4):
        x0 = share * p.x0 + (share < 1.0) * 0.05 * rng.normal(size=len(p.x0))
        plan = answer_of(programme, p, x0)
        other = stated(
            p.plant,
            period=p.period,
            steps=p.steps,
            costs=p.costs,
            state=x0,
            previous={},
            references={f"x{i}": np.full(p.steps + 1, r) for i, r in enumerate(p.xr)},
            disturbances={},
            limits=[(*limit[:3], None) for limit in p.limits],
            until=p.last,
            terminal=p.terminal,
        )
        assert plan.ok
        assert other.status == "optimal"
        assert plan.residual < 1e-7
        assert plan.cost == pytest.approx(other.cost, rel=1e-9)
        for signal, u in other.inputs.items():
            np.testing.assert_allclose(plan.inputs[signal], u, atol=1e-6)
        limited += plan.solved.multipliers.any()
        if share == 1.0:
            assert plan.cost == pytest.approx(OPTIMA[name], rel=1e-9)
    assert limited >= 2


def test_do_mpc_answers_the_same(problem):
    pytest.importorskip("do_mpc", reason="do-mpc is not installed")
    plan = answer_of(programme_of(problem), problem, problem.x0)
    first = [float(u[0]) for u in plan.inputs.values()]
    np.testing.assert_allclose(first, do_mpc_answer(problem, problem.x0), atol=1e-6)


@pytest.mark.parametrize("name", ["mass chain", "quadcopter"])  # it weighs no changes of inputs
def test_acados_answers_the_same(name, monkeypatch):
    pytest.importorskip("acados", reason="acados is not installed")
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    p = PROBLEMS[name]()
    plan = answer_of(programme_of(p), p, p.x0)
    first = [float(u[0]) for u in plan.inputs.values()]
    np.testing.assert_allclose(first, acados_answer(p, p.x0), atol=1e-6)
