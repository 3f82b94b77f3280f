"""The solvers of a record's programme: PIQP, and Clarabel for a second opinion.

Measured on a saturated record of 300 s (6000 samples) of one spring, processor time in seconds:
PIQP 0.35 to 0.9, whatever its factorisation and the blocks' length, Clarabel 3.3, OSQP 35 without
getting there; of 60 s of a rope of 15 masses, PIQP 0.3 with its multistage factorisation and
blocks of 12 to 16 samples, 0.7 with the sparse one, Clarabel 6.9.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from models.basics import FloatArray, InputError, SolverError

SOLVERS = ("piqp", "clarabel")
_OWNER = "clairvoyant"
# PIQP loses its way where a heavily saturated record costs 1e5, and stops too early where a calm
# one costs 1e-8: the factor on the cost is tried in this order.
_FACTORS = (1.0, 100.0)
_FINE = (1e-6, 1e4)  # below this mean square [m2] once more with this factor


class SparseProgramme(Protocol):
    """min 1/2 x'P x + c'x + constant, subject to A x = b and low <= G x <= high."""

    P: sp.csc_matrix
    c: FloatArray
    constant: float
    A: sp.csc_matrix
    b: FloatArray
    G: sp.csc_matrix
    low: FloatArray
    high: FloatArray


def solve_programme(
    qp: SparseProgramme, solver: str, counted: int
) -> tuple[FloatArray, FloatArray, int]:
    """Return the answer, the prices of the rows of G (upper less lower), and the steps taken.

    Parameters
    ----------
    qp, solver
        The programme, and one of `SOLVERS`.
    counted
        Number of squares in the cost [m2].

    Raises
    ------
    InputError
        If the solver is not installed.
    SolverError
        If it finds no solution.
    """
    if solver == "clarabel":
        return _clarabel(qp)
    found = _piqp(qp, _FACTORS)
    cost = found[0] @ (0.5 * (qp.P @ found[0]) + qp.c) + qp.constant
    if 2.0 * cost < _FINE[0] * counted:
        return _piqp(qp, (_FINE[1], *_FACTORS))
    return found


def _piqp(qp: SparseProgramme, factors: tuple[float, ...]) -> tuple[FloatArray, FloatArray, int]:
    """Return PIQP's answer with the first factor on the cost that leads to one."""
    try:
        import piqp
    except ImportError as error:
        raise InputError(
            f"{_OWNER}: the solver piqp is not installed; pip install piqp, or solver='clarabel'"
        ) from error
    status = ""
    for factor in factors:
        solver: Any = piqp.SparseSolver()
        s = solver.settings
        s.kkt_solver = piqp.KKTSolver.sparse_multistage
        s.eps_abs, s.eps_rel = 1e-8, 1e-9
        s.eps_duality_gap_abs, s.eps_duality_gap_rel = 1e-6, 1e-6
        s.max_iter = 100
        solver.setup(factor * qp.P, factor * qp.c, qp.A, qp.b, qp.G, qp.low, qp.high)
        status, result = str(solver.solve()), solver.result
        near = result.info.primal_res < 1e-6 and result.info.duality_gap_rel < 1e-4
        if status.endswith("PIQP_SOLVED") or (status.endswith("MAX_ITER_REACHED") and near):
            prices = (result.z_u - result.z_l) / factor
            return result.x.copy(), prices, int(result.info.iter)
        if status.endswith("PRIMAL_INFEASIBLE"):
            break
    raise SolverError(f"{_OWNER}: piqp found no solution: {_words(status)}")


def _clarabel(qp: SparseProgramme) -> tuple[FloatArray, FloatArray, int]:
    import clarabel  # type: ignore[import-untyped]

    upper, lower = np.isfinite(qp.high), np.isfinite(qp.low)
    A = sp.csc_matrix(sp.vstack([qp.A, qp.G[upper], -qp.G[lower]]))
    b = np.concatenate([qp.b, qp.high[upper], -qp.low[lower]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    settings.max_iter = 500
    cones = [clarabel.ZeroConeT(len(qp.b)), clarabel.NonnegativeConeT(len(b) - len(qp.b))]
    answer = clarabel.DefaultSolver(
        sp.triu(qp.P, format="csc"), qp.c, A, b, cones, settings
    ).solve()
    status = str(answer.status)
    if status not in ("Solved", "AlmostSolved"):
        raise SolverError(f"{_OWNER}: clarabel found no solution: {_words(status)}")
    z = np.asarray(answer.z)[len(qp.b) :]
    prices = np.zeros(len(qp.low))
    prices[upper] = z[: upper.sum()]
    prices[lower] -= z[upper.sum() :]
    return np.asarray(answer.x), prices, int(answer.iterations)


def _words(status: str) -> str:
    if "INFEASIBLE" in status.upper():
        return "no motion of the drum keeps the limits over this record"
    return status.rpartition(".")[2].removeprefix("PIQP_").replace("_", " ").lower()
