"""Solvers behind somebody else's interface: CasADi's `conic`, qpsolvers, CVXPY.

What they cost beyond the solver is the point: a hundred times the solution, where it is DAQP's.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpc_questions import Recording
from mpc_statements import Programme, one_sided, slack_statement, stated

from mpc.linear import path_of_sea

__all__ = ["casadi_any", "cvxpy_oracle", "qpsolvers_any"]

ORACLES = Path(__file__).resolve().parents[1] / "tests" / "oracles"

FloatArray = npt.NDArray[np.float64]
Ask = Callable[[int], float]


def casadi_any(recording: Recording, *, plugin: str, options: Mapping[str, Any]) -> Ask:
    """Ask a solver that CasADi brings along, by its `conic`."""
    import casadi as ca

    stages = plugin == "hpipm"
    qp = stated(recording, stages=stages)
    chosen: dict[str, Any] = {"error_on_fail": False, "print_problem": False, **options}
    tied, order = 0, np.arange(qp.A.shape[0] + qp.G.shape[0])
    P, rows = qp.P, sp.csr_matrix(sp.vstack([qp.A, qp.G]))
    if stages:
        order, sizes = _by_stages(qp)
        chosen |= sizes
        tied = sizes["nx"][0]  # the state at the start is bounded instead of tied
        # Its last stage may have no slacks: one more with a state that is zero.
        P = sp.block_diag([P, sp.csc_matrix((1, 1))])
        rows = sp.block_diag([rows, sp.csc_matrix([[-1.0]])], format="csr")
    H, A = ca.DM(sp.csc_matrix(P)), ca.DM(sp.csc_matrix(rows[order]))
    solver = ca.conic("solver", plugin, {"h": H.sparsity(), "a": A.sparsity()}, chosen)
    cut = []
    more, free = np.zeros(int(stages)), np.full(int(stages), math.inf)
    for v in qp.vectors:
        low, high = np.concatenate([v.b, v.low, more]), np.concatenate([v.b, v.high, more])
        least, most = np.concatenate([v.least, -free]), np.concatenate([v.most, free])
        least[:tied] = most[:tied] = v.b[:tied]
        q = np.concatenate([v.q, more])
        cut.append(tuple(map(ca.DM, (q, low[order], high[order], least, most))))
    last: dict[str, Any] = {}

    def ask(k: int) -> float:
        q, low, high, least, most = cut[k]
        answer = solver(h=H, g=q, a=A, lba=low, uba=high, lbx=least, ubx=most, **last)
        last.update(x0=answer["x"], lam_x0=answer["lam_x"], lam_a0=answer["lam_a"])
        solved = solver.stats()["success"]
        return float(answer["x"][qp.first]) if solved else math.nan

    return ask


def _by_stages(qp: Programme) -> tuple[npt.NDArray[np.int64], dict[str, Any]]:
    """Return the order of rows that HPIPM wants, stage by stage, and its options."""
    sizes = qp.stages
    if sizes is None:
        raise ValueError("the programme has no stages")
    nx, equations = int(sizes[0, 0]), qp.A.shape[0]
    first = equations + np.concatenate([[0], np.cumsum(sizes[:, 2])])
    order: list[int] = []
    for j in range(len(sizes)):
        following = range((j + 1) * nx, (j + 2) * nx)
        order += following if j + 1 < len(sizes) else [equations + qp.G.shape[0]]
        order += range(int(first[j]), int(first[j + 1]))
    return np.array(order), {
        "N": len(sizes),
        "nx": [*sizes[:, 0].tolist(), 1],
        "nu": [*sizes[:, 1].tolist(), 0],
        "ng": [*sizes[:, 2].tolist(), 0],
    }


def qpsolvers_any(recording: Recording, *, solver: str) -> Ask:
    """Ask a solver behind qpsolvers' one function, on the condensed programme."""
    import qpsolvers

    qp = slack_statement(recording)
    matrix, bounds = one_sided(qp, box=False)
    P, G = qp.P.toarray(), matrix.toarray()
    last: list[FloatArray | None] = [None]

    def ask(k: int) -> float:
        v = qp.vectors[k]
        x = qpsolvers.solve_qp(
            P, v.q, G, bounds[k], lb=v.least, ub=v.most, solver=solver, initvals=last[0]
        )
        last[0] = x
        return math.nan if x is None else float(x[0])

    return ask


def cvxpy_oracle(recording: Recording) -> Ask:
    """Ask the plain statement in CVXPY, compiled once, with its parameters set."""
    import cvxpy

    sys.path.insert(0, str(ORACLES))
    from cvxpy_programme import oracle

    stated, controller = oracle(recording.controller), recording.controller
    model, winch, p = controller.model, controller.model.winch, controller.programme
    to_path = path_of_sea(model, p.steps)
    ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], p.steps)
    at, nb = model.constants_at.start, len(p.blocks)

    def ask(k: int) -> float:
        chi, (_, low, high) = recording.states[k], recording.questions[k]
        sea = chi[model.sea_at]
        stated.state.value = chi[: winch.size]
        stated.path.value = (to_path @ sea).reshape(-1, 2)
        stated.constants.value = chi[at : at + 2]
        stated.end.value = ahead @ sea
        stated.low.value, stated.high.value = low[:nb], high[:nb]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an inaccurate answer, which is counted below
            try:
                stated.problem.solve(solver=cvxpy.CLARABEL)
            except cvxpy.SolverError:
                return math.nan
        solved = stated.problem.status == "optimal"
        return float(stated.moves.value[0]) if solved else math.nan

    return ask
