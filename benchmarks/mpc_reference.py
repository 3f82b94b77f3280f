"""The right answers, by which all are measured: PIQP's, polished till they are optimal to rounding.

None of it is ours: another algorithm finds which limits are met, and a sparse factorisation solves
what is left.  DAQP agrees with it to 2e-9 of the peak torque on 2000 questions.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpc_questions import Recording
from mpc_statements import Programme, slack_statement
from scipy.sparse.linalg import splu

from models.basics import SolverError

__all__ = ["piqp_answer", "piqp_solver", "reference", "tight_answers"]

FloatArray = npt.NDArray[np.float64]

_CORRECTIONS = 30


def piqp_solver(qp: Programme, *, stages: bool, tolerance: float) -> Any:
    """Return PIQP, set up for a programme; `stages` for its multistage factorisation."""
    import piqp

    solver: Any = piqp.SparseSolver() if stages else piqp.DenseSolver()
    s = solver.settings
    if stages:
        s.kkt_solver = piqp.KKTSolver.sparse_multistage
    s.eps_abs, s.eps_rel = tolerance, tolerance
    s.eps_duality_gap_abs, s.eps_duality_gap_rel = tolerance, tolerance
    v = qp.vectors[0]
    of = (lambda matrix: matrix) if stages else (lambda matrix: matrix.toarray())
    A, b = (of(qp.A), v.b) if qp.A.shape[0] else (None, None)
    solver.setup(of(qp.P), v.q, A, b, of(qp.G), v.low, v.high, v.least, v.most)
    return solver


def piqp_answer(solver: Any, qp: Programme, k: int) -> float:
    """Return its first move for a sample's vectors, NaN if it has none."""
    v = qp.vectors[k]
    b = v.b if len(v.b) else None
    solver.update(c=v.q, b=b, h_l=v.low, h_u=v.high, x_l=v.least, x_u=v.most)
    status = str(solver.solve())
    return float(solver.result.x[qp.first]) if status.endswith("PIQP_SOLVED") else math.nan


def tight_answers(qp: Programme) -> FloatArray:
    """Return the first moves by PIQP at the tightest tolerance it meets, polished, (steps,).

    The cost is flat, and a tolerance on it says little about the moves: so the limits that are met
    are read off the prices, and the equations that are left are solved directly.

    Raises
    ------
    SolverError
        If it meets no tolerance.
    """
    solvers = [
        piqp_solver(qp, stages=qp.stages is not None, tolerance=t)
        for t in (1e-12, 1e-11, 1e-10, 1e-9)
    ]
    found = []
    for k in range(len(qp.vectors)):
        for solver in solvers:
            if not math.isnan(piqp_answer(solver, qp, k)):
                break
        else:
            raise SolverError(f"reference: no tight answer to question {k}")
        found.append(_polished(qp, k, solver.result))
    return np.array(found)


def _polished(qp: Programme, k: int, result: Any) -> float:
    """Return the first move with the limits met that the prices tell, corrected where they err."""
    v, n = qp.vectors[k], qp.P.shape[0]
    x, equations = np.array(result.x), len(v.b)
    G = sp.vstack([qp.G, sp.eye(n)], format="csr")
    low, high = np.concatenate([v.low, v.least]), np.concatenate([v.high, v.most])
    at_low = np.concatenate([result.z_l, result.z_bl]) > G @ x - low
    at_high = np.concatenate([result.z_u, result.z_bu]) > high - G @ x
    for _ in range(_CORRECTIONS):
        active = sp.vstack([qp.A, G[at_low], G[at_high]])
        right = np.concatenate([v.b, low[at_low], high[at_high]])
        # A faint weight keeps limits apart that are met twice over; refinement takes it out again.
        exact = sp.bmat([[qp.P, active.T], [active, None]], format="csc")
        faint = sp.diags(np.concatenate([np.full(n, 1e-12), np.full(len(right), -1e-10)]))
        factor = splu(sp.csc_matrix(exact + faint))
        wanted = np.concatenate([-v.q, right])
        both = factor.solve(wanted)
        for _ in range(20):
            both += factor.solve(wanted - exact @ both)
        value, price = G @ both[:n], both[n + equations :]
        first = int(at_low.sum())
        below, above = value < low - 1e-9, value > high + 1e-9
        kept = at_low.copy(), at_high.copy()
        at_low[kept[0]] = price[:first] < 1e-9
        at_high[kept[1]] = price[first:] > -1e-9
        at_low |= below
        at_high |= above
        if np.array_equal(at_low, kept[0]) and np.array_equal(at_high, kept[1]):
            return float(both[qp.first])
    return float(x[qp.first])


@lru_cache
def reference(recording: Recording) -> FloatArray:
    """Return the right first moves, (steps,): those of `tight_answers` on the dense statement."""
    return tight_answers(slack_statement(recording))
