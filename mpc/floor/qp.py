r"""The quadratic programme over a whole record, and the solver that takes it.

    RecordPlant, hook record --> RecordProblem --> RecordQP (sparse) --> RecordSolution

Over states x[k] and inputs i[k], as deviations y and e from a payload held still
(`RecordPlant.still`),

    min  1/2 sum_k w[k] p[k]^2 + rho/2 \|e\|^2 + rho_0/2 \|y[0]\|^2
    s.t. y[k+1] = Phi y[k] + Gamma e[k] + r[k]
         \|windows (demand, motor speed)\| <= 1 at both ends of each sample
         tensions[k] >= minimum

In these coordinates zero is the answer wherever no limit binds, so that a floor of a micrometre
costs no digits.  rho and rho_0 pick one among many motions that do the same to the payload; what
they cost is part of the certificate (`mpc.floor.certificate`).

The programme is handed over in blocks of several samples, with the states inside a block
eliminated: exactly the same optimum, and matrices large enough for the solver's dense kernels.
PIQP's multistage factorisation takes it in time linear in the record's length.  Measured on a
saturated record of 300 s (6000 samples) of one spring, processor time in seconds: PIQP 0.35 to 0.9,
whatever its factorisation and the blocks' length, Clarabel 3.3, OSQP 35 without getting there; of
60 s of a rope of 15 masses, PIQP 0.3 with its multistage factorisation and blocks of 12 to 16
samples, 0.7 with the sparse one, Clarabel 6.9.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from models.basics import FloatArray, SolverError

from .plant import RecordPlant
from .problem import RHO, RHO_START, RecordProblem, RecordSolution

_LONGEST_BLOCK = 16  # samples
_ENTRY = 1e-15  # smaller entries of the matrices are rounding
# PIQP loses its way where a heavily saturated record costs 1e5, and stops too early where a calm
# one costs 1e-8: the factor on the cost is tried in this order.
_FACTORS = (1.0, 100.0)
_FINE = (1e-6, 1e4)  # below this mean square [m2] once more with this factor


def solve_record(problem: RecordProblem, *, block: int | None = None) -> RecordSolution:
    """Solve the programme, in blocks of 1 to 16 samples; by default what suits the states.

    Raises SolverError if the solver finds no solution.
    """
    n = len(problem.plant.states)
    size = block or (2 if n <= 6 else min(_LONGEST_BLOCK, max(4, n // 2)))
    qp = _Assembly(problem, min(size, problem.samples))
    found = _piqp(qp, _FACTORS)
    cost = found[0] @ (0.5 * (qp.P @ found[0]) + qp.c) + qp.constant
    if 2.0 * cost < _FINE[0] * problem.counted:
        found = _piqp(qp, (_FINE[1], *_FACTORS))
    return qp.solution(*found)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Group:
    """Blocks of equal length: `matrix` entries are those of one block."""

    first: int  # sample of the first block
    blocks: int
    length: int  # samples per block
    offset: int  # of its first variable
    rows: int  # of its first inequality
    maps: FloatArray  # block's variables to y at its samples 0..length, (length+1, n, nv)
    G: FloatArray  # inequality rows of a block (nr, nv): windows, then tensions
    drift: FloatArray  # y at the block's samples from zero, (blocks, length+1, n)


class _Assembly:
    """The sparse programme: 1/2 x'Px + c'x, A x = b, G x <= h_u, G x >= h_l."""

    def __init__(self, problem: RecordProblem, length: int) -> None:
        self._problem, plant = problem, problem.plant
        N, n, m = problem.samples, len(plant.states), plant.inputs
        # Equal blocks share their matrices, so that assembling takes a few products of arrays.
        whole = (N - 1) // length  # the last block alone holds the last sample's cost
        self._groups: list[_Group] = []
        offset = rows = 0
        for first, blocks, size in ((0, whole, length), (whole * length, 1, N - whole * length)):
            if blocks:
                group = _group(problem, first, blocks, size, offset, rows)
                self._groups.append(group)
                offset += blocks * (n + m * size)
                rows += blocks * len(group.G)
        self.variables, self._n, self._m = offset, n, m
        self.constant = 0.0
        self.P, self.c = self._cost()
        self.A, self.b = self._dynamics()
        self.G, self.low, self.high = self._limits(rows)

    def _cost(self) -> tuple[sp.csc_matrix, FloatArray]:
        problem, N = self._problem, self._problem.samples
        weight = np.where(np.arange(N + 1) >= problem.first, 1.0, 0.0)
        parts, c = [], np.zeros(self.variables)
        for g in self._groups:
            last = g.first + g.blocks * g.length == N
            at = g.first + g.length * np.arange(g.blocks)[:, None] + np.arange(g.length + 1)
            w = weight[at]
            if not last:
                w[:, -1] = 0.0  # counted by the next block
            row = np.einsum("i,jiv->jv", problem.plant.payload, g.maps)
            P = np.einsum("bj,ju,jv->buv", w, row, row, optimize=True)
            # Fast modes of the rope hardly move the payload: without RHO the solver would have
            # no reason to prefer a quiet input, and no positive definite blocks.
            P[:, range(self._n, P.shape[1]), range(self._n, P.shape[1])] += RHO
            if g.first == 0:
                P[0, range(self._n), range(self._n)] += RHO_START
            drift = g.drift @ problem.plant.payload
            self.constant += 0.5 * float((w * drift**2).sum())
            q = np.einsum("bj,bj,jv->bv", w, drift, row)
            c[g.offset : g.offset + q.size] = q.ravel()
            parts.append(_stacked(P))
        return sp.csc_matrix(sp.block_diag(parts, format="csc")), c

    def _dynamics(self) -> tuple[sp.csc_matrix, FloatArray]:
        """From block to block; the first row block fixes y[0] where the start is given."""
        problem, n = self._problem, self._n
        first = sp.block_diag([_repeated(g.maps[0], g.blocks) for g in self._groups], format="csr")
        after = sp.block_diag([_repeated(g.maps[-1], g.blocks) for g in self._groups], format="csr")
        drift = np.concatenate([g.drift[:, -1].ravel() for g in self._groups])
        # After the last block nothing follows: the end of a record is free.
        A, b = sp.csc_matrix(after[:-n] - first[n:]), -drift[:-n]
        if problem.start is not None:
            A = sp.csc_matrix(sp.vstack([first[:n], A]))
            b = np.concatenate([problem.start - problem.still[0], b])
        return A, b

    def _limits(self, rows: int) -> tuple[sp.csc_matrix, FloatArray, FloatArray]:
        problem, plant = self._problem, self._problem.plant
        windows = plant.levels(problem.still, problem.still_inputs)
        tensions = problem.still_tensions() - problem.minimum_tension
        parts, low, high = [], np.empty(rows), np.full(rows, math.inf)
        for g in self._groups:
            at = slice(g.first, g.first + g.blocks * g.length)
            # what the drift inside a block adds, then the still payload's own level
            level = np.stack(
                [
                    np.einsum("bjx,wx->bjw", g.drift[:, end : end + g.length], _state_rows(plant))
                    for end in (0, 1)
                ],
                axis=2,
            ) + windows[at].reshape(g.blocks, g.length, 2, -1)
            hang = g.drift[:, :-1] @ plant.tensions.T + tensions[at].reshape(g.blocks, g.length, -1)
            hang = hang / plant.static_tensions
            if not math.isfinite(problem.minimum_tension):
                hang = hang[..., :0]
            flat = level.reshape(g.blocks, -1)
            upper = np.full((g.blocks, len(g.G)), math.inf)
            upper[:, : flat.shape[1]] = 1.0 - flat
            lower = np.hstack([-1.0 - flat, -hang.reshape(g.blocks, -1)])
            span = slice(g.rows, g.rows + lower.size)
            low[span], high[span] = lower.ravel(), upper.ravel()
            parts.append(_repeated(g.G, g.blocks))
        return sp.csc_matrix(sp.block_diag(parts, format="csc")), low, high

    def solution(self, x: FloatArray, prices: FloatArray, iterations: int) -> RecordSolution:
        """Return the solver's answer by samples."""
        plant = self._problem.plant
        inputs, windows, tensions = [], [], []
        nwin, nt = len(plant.windows), len(plant.static_tensions)
        for g in self._groups:
            width = self._n + self._m * g.length
            own = x[g.offset : g.offset + g.blocks * width].reshape(g.blocks, width)
            inputs.append(own[:, self._n :].reshape(-1, self._m))
            size = g.blocks * len(g.G)
            price = prices[g.rows : g.rows + size].reshape(g.blocks, len(g.G))
            split = g.length * 2 * nwin
            windows.append(price[:, :split].reshape(-1, 2, nwin))
            # rows of tension were divided by the static one
            hang = (
                price[:, split:] if price.shape[1] > split else np.zeros(g.blocks * g.length * nt)
            )
            tensions.append(-hang.reshape(-1, nt) / plant.static_tensions)
        return RecordSolution(
            start=x[: self._n].copy(),
            inputs=np.concatenate(inputs),
            window_prices=np.concatenate(windows),
            tension_prices=np.maximum(np.concatenate(tensions), 0.0),
            iterations=iterations,
        )


def _state_rows(plant: RecordPlant) -> FloatArray:
    """Return what the states add to the window rows at a given input, (nwin, n)."""
    demand = np.zeros(len(plant.states)) if plant.hold == "line" else -plant.feedback
    return np.outer(plant.windows[:, 0], demand) + np.outer(plant.windows[:, 1], plant.speed)


def _group(
    problem: RecordProblem, first: int, blocks: int, length: int, offset: int, rows: int
) -> _Group:
    plant = problem.plant
    n, m = len(plant.states), plant.inputs
    width = n + m * length
    maps = np.zeros((length + 1, n, width))
    maps[0, :, :n] = np.eye(n)
    drift = np.zeros((blocks, length + 1, n))
    residue = problem.residue[first : first + blocks * length].reshape(blocks, length, n)
    for j in range(length):
        maps[j + 1] = plant.Phi @ maps[j]
        maps[j + 1, :, n + m * j : n + m * (j + 1)] += plant.Gamma
        drift[:, j + 1] = drift[:, j] @ plant.Phi.T + residue[:, j]
    by_state = _state_rows(plant)
    windows = np.zeros((length, 2, len(plant.windows), width))
    for j in range(length):
        for end in (0, 1):
            windows[j, end] = by_state @ maps[j + end]
            windows[j, end, :, n + m * j + (end if m == 2 else 0)] += plant.windows[:, 0]
    hang = np.einsum("tx,jxv->jtv", plant.tensions / plant.static_tensions[:, None], maps[:-1])
    if not math.isfinite(problem.minimum_tension):
        hang = hang[:, :0]
    G = np.concatenate([windows.reshape(-1, width), hang.reshape(-1, width)])
    return _Group(
        first=first,
        blocks=blocks,
        length=length,
        offset=offset,
        rows=rows,
        maps=maps,
        G=G,
        drift=drift,
    )


def _repeated(block: FloatArray, count: int) -> sp.csr_matrix:
    """Return a block on a diagonal, so many times."""
    kept = sp.csr_matrix(np.where(np.abs(block) > _ENTRY, block, 0.0))
    return sp.kron(sp.eye(count), kept, format="csr")


def _stacked(blocks: FloatArray) -> sp.csc_matrix:
    """Return (k, w, w) blocks on a diagonal."""
    k, w, _ = blocks.shape
    i, j = np.nonzero(np.abs(blocks).max(axis=0) > _ENTRY)
    at = w * np.arange(k)[:, None]
    entries = ((at + i).ravel(), (at + j).ravel())
    return sp.csc_matrix((blocks[:, i, j].ravel(), entries), (k * w, k * w))


def _piqp(qp: _Assembly, factors: tuple[float, ...]) -> tuple[FloatArray, FloatArray, int]:
    """Return PIQP's answer, its prices of the rows of G (upper less lower) and its steps.

    With the first factor on the cost that leads to an answer.
    """
    import piqp

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
    raise SolverError(f"clairvoyant: piqp found no solution: {_words(status)}")


def _words(status: str) -> str:
    if "INFEASIBLE" in status.upper():
        return "no motion of the drum keeps the limits over this record"
    return status.rpartition(".")[2].removeprefix("PIQP_").replace("_", " ").lower()
