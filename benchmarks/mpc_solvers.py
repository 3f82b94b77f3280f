"""The solvers that are asked for one step's quadratic programme, each by its quickest interface.

    Programme (matrices) --> set up once --> vectors of a sample --> first move

All are set up once and given the vectors that change, in the form that they want, made in advance:
what is timed is from there to the first move.  Each is left its own warm start, and asked for
about the same accuracy, 1e-6 of the peak torque in the first move where it can be had
(`mpc_speed.py` shows what came of it).  A solver that is not installed is named as absent.
"""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpc_questions import Recording, again
from mpc_reference import piqp_answer, piqp_solver
from mpc_statements import one_sided, slack_statement, stage_statement, stated
from mpc_wrappers import casadi_any, cvxpy_oracle, qpsolvers_any

__all__ = ["SOLVERS", "Solver", "version_of"]

FloatArray = npt.NDArray[np.float64]
Ask = Callable[[int], float]  # number of the question -> first move; NaN if it gives none

CONDENSED, SLACKS, STAGES = "condensed", "condensed, slacks", "stages"


@dataclass(frozen=True, kw_only=True)
class Solver:
    """A solver and its statement.

    Attributes
    ----------
    name, package
        What it is called, and the package that has to be installed for it.
    statement
        One of `CONDENSED`, `SLACKS` and `STAGES`.
    prepare
        Recording -> what answers its questions by number.
    slow
        Whether it takes milliseconds, and is asked less often.
    """

    name: str
    package: str
    statement: str
    prepare: Callable[[Recording], Ask]
    slow: bool = False


def version_of(package: str) -> str | None:
    """Return the version of a package, None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def daqp_soft(recording: Recording, *, warm: bool = True) -> Ask:
    """DAQP on the condensed programme with soft rows of its own: `mpc.programme.qp.SoftQP`."""
    qp, asked = again(recording.controller.qp), recording.questions
    sense = qp._sense.copy()

    def kept(k: int) -> float:
        solved = qp.solve(*asked[k])
        return float(solved.v[0]) if solved.ok else math.nan

    def forgetting(k: int) -> float:
        qp._model.update(sense=sense)  # takes every row out of the active set
        return kept(k)

    return kept if warm else forgetting


def daqp_slacks(recording: Recording) -> Ask:
    """DAQP on the condensed programme with a variable for each slack."""
    import daqp

    qp = slack_statement(recording)
    n, m = qp.P.shape[0], qp.G.shape[0]
    model: Any = daqp.Model()
    wide = np.full(n + m, 1e20)
    G, P = np.ascontiguousarray(qp.G.toarray()), np.ascontiguousarray(qp.P.toarray())
    model.setup(P, np.zeros(n), G, wide, -wide, np.zeros(n + m, dtype=np.int32))
    model.settings = {"eps_prox": 0.0, "primal_tol": 1e-9}
    cut = [
        (
            v.q,
            np.minimum(np.concatenate([v.most, v.high]), 1e20),
            np.maximum(np.concatenate([v.least, v.low]), -1e20),
        )
        for v in qp.vectors
    ]

    def ask(k: int) -> float:
        f, upper, lower = cut[k]
        model.update(f=f, bupper=upper, blower=lower)
        x, _, flag, _ = model.solve()
        return float(x[0]) if flag > 0 else math.nan

    return ask


def piqp_any(recording: Recording, *, stages: bool, tolerance: float) -> Ask:
    """PIQP, dense on the condensed programme or with its multistage factorisation."""
    qp = stated(recording, stages=stages)
    solver = piqp_solver(qp, stages=stages, tolerance=tolerance)

    def ask(k: int) -> float:
        return piqp_answer(solver, qp, k)

    return ask


def osqp_any(recording: Recording, *, stages: bool, tolerance: float) -> Ask:
    """OSQP, its limits stacked."""
    import osqp

    qp = stated(recording, stages=stages)
    stacked = sp.csc_matrix(sp.vstack([qp.A, qp.G, sp.eye(qp.P.shape[0])]))
    cut = [
        (
            v.q,
            np.concatenate([v.b, v.low, v.least]),
            np.concatenate([v.b, v.high, v.most]),
        )
        for v in qp.vectors
    ]
    solver: Any = osqp.OSQP()
    solver.setup(
        sp.triu(qp.P, format="csc"),
        cut[0][0],
        stacked,
        cut[0][1],
        cut[0][2],
        verbose=False,
        eps_abs=tolerance,
        eps_rel=tolerance,
        max_iter=20_000,
    )

    def ask(k: int) -> float:
        q, low, high = cut[k]
        solver.update(q=q, l=low, u=high)
        answer = solver.solve(raise_error=False)
        return float(answer.x[qp.first]) if answer.info.status_val == 1 else math.nan

    return ask


def proxqp_any(recording: Recording, *, stages: bool) -> Ask:
    """ProxQP, dense or sparse, warm-started with the answer before."""
    from proxsuite import proxqp

    qp = stated(recording, stages=stages)
    n, box = qp.P.shape[0], sp.eye(qp.P.shape[0], format="csc")
    G = sp.csc_matrix(sp.vstack([qp.G, box]))
    cut = [
        (
            v.q,
            v.b,
            np.maximum(np.concatenate([v.low, v.least]), -1e20),
            np.minimum(np.concatenate([v.high, v.most]), 1e20),
        )
        for v in qp.vectors
    ]
    kind: Any = proxqp.sparse if stages else proxqp.dense
    solver = kind.QP(n, qp.A.shape[0], G.shape[0])
    solver.settings.eps_abs = 1e-7
    q, b, low, high = cut[0]
    if stages:
        solver.init(qp.P, q, qp.A, b, G, low, high)
    else:
        solver.init(qp.P.toarray(), q, np.zeros((0, n)), b, G.toarray(), low, high)
    solver.solve()
    solver.settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT

    def ask(k: int) -> float:
        q, b, low, high = cut[k]
        if stages:
            solver.update(g=q, b=b, l=low, u=high)
        else:
            solver.update(g=q, l=low, u=high)
        solver.solve()
        solved = solver.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return float(solver.results.x[qp.first]) if solved else math.nan

    return ask


def clarabel_any(recording: Recording, *, stages: bool) -> Ask:
    """Clarabel, its vectors updated."""
    import clarabel

    qp = stated(recording, stages=stages)
    matrix, bounds = one_sided(qp)
    settings: Any = clarabel.DefaultSettings()
    settings.verbose, settings.presolve_enable, settings.max_threads = False, False, 1
    count = qp.A.shape[0]
    cones = [clarabel.NonnegativeConeT(matrix.shape[0] - count)]
    if count:
        cones.insert(0, clarabel.ZeroConeT(count))
    vectors, P = qp.vectors, sp.triu(qp.P, format="csc")
    solver: Any = clarabel.DefaultSolver(P, vectors[0].q, matrix, bounds[0], cones, settings)

    def ask(k: int) -> float:
        solver.update(q=vectors[k].q, b=bounds[k])
        answer = solver.solve()
        return float(answer.x[qp.first]) if str(answer.status) == "Solved" else math.nan

    return ask


def qoco_any(recording: Recording) -> Ask:
    """QOCO on the stages, its vectors updated."""
    import qoco

    qp = stage_statement(recording)
    matrix, bounds = one_sided(qp)
    count = qp.A.shape[0]
    n, m = qp.P.shape[0], matrix.shape[0] - count
    solver: Any = qoco.QOCO()
    G = sp.csc_matrix(matrix[count:])
    v = qp.vectors[0]
    P = sp.triu(qp.P, format="csc")
    solver.setup(n, m, count, P, v.q, qp.A, v.b, G, bounds[0][count:], m, 0, None, verbose=0)

    def ask(k: int) -> float:
        solver.update_vector_data(c=qp.vectors[k].q, b=bounds[k][:count], h=bounds[k][count:])
        answer = solver.solve()
        solved = str(answer.status) == "QOCO_SOLVED"
        return float(np.asarray(answer.x)[qp.first]) if solved else math.nan

    return ask


# With its own infinity of 1e8 it does not converge: what is large here is 100.
_HPIPM = {"inf": 1e4, "hpipm": {"mode": "speed", "iter_max": 60}}
_QPOASES = partial(casadi_any, plugin="qpoases", options={"printLevel": "none"})

_QUICK: Sequence[tuple[str, str, str, Callable[[Recording], Ask]]] = (
    ("DAQP, soft rows", "daqp", CONDENSED, daqp_soft),
    ("DAQP, soft rows, cold", "daqp", CONDENSED, partial(daqp_soft, warm=False)),
    ("DAQP", "daqp", SLACKS, daqp_slacks),
    ("PIQP", "piqp", SLACKS, partial(piqp_any, stages=False, tolerance=1e-10)),
    ("PIQP, multistage", "piqp", STAGES, partial(piqp_any, stages=True, tolerance=1e-8)),
)
_SLOW: Sequence[tuple[str, str, str, Callable[[Recording], Ask]]] = (
    ("ProxQP", "proxsuite", SLACKS, partial(proxqp_any, stages=False)),
    ("ProxQP", "proxsuite", STAGES, partial(proxqp_any, stages=True)),
    ("OSQP, 1e-3", "osqp", STAGES, partial(osqp_any, stages=True, tolerance=1e-3)),
    ("OSQP, 1e-5", "osqp", SLACKS, partial(osqp_any, stages=False, tolerance=1e-5)),
    ("Clarabel", "clarabel", SLACKS, partial(clarabel_any, stages=False)),
    ("Clarabel", "clarabel", STAGES, partial(clarabel_any, stages=True)),
    ("QOCO", "qoco", STAGES, qoco_any),
    ("HPIPM by CasADi", "casadi", STAGES, partial(casadi_any, plugin="hpipm", options=_HPIPM)),
    ("qpOASES by CasADi", "casadi", SLACKS, _QPOASES),
    ("DAQP by qpsolvers", "qpsolvers", SLACKS, partial(qpsolvers_any, solver="daqp")),
    ("CVXPY, Clarabel", "cvxpy", STAGES, cvxpy_oracle),
)
SOLVERS: Sequence[Solver] = tuple(
    Solver(name=name, package=package, statement=statement, prepare=begin, slow=rows is _SLOW)
    for rows in (_QUICK, _SLOW)
    for name, package, statement, begin in rows
)
