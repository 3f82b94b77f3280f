"""The recorded programmes as others want them: dense with slacks, and stage by stage.

    Recording --> slack_statement, stage_statement --> Programme: matrices, vectors of each sample

Few solvers have soft rows of their own, so for the others the same programme is stated twice:
dense, with the states eliminated and one slack a soft row; and sparse, with every state a variable,
ordered by stages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpc_questions import Recording

from mpc.linear import WATCHED, LinearMPC, path_of_sea

__all__ = [
    "Programme",
    "Vectors",
    "one_sided",
    "slack_statement",
    "stage_statement",
    "stated",
]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Vectors:
    """What changes from sample to sample: min 1/2 x'Px + q'x, Ax = b, low <= Gx <= high, box."""

    q: FloatArray
    b: FloatArray
    low: FloatArray
    high: FloatArray
    least: FloatArray
    most: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Programme:
    """A statement of the recorded programmes: matrices, and vectors of each sample.

    Attributes
    ----------
    P, A, G
        Sparse.
    first
        Position of the first move among the variables.
    vectors
        Of each sample.
    stages
        States, inputs and rows of each stage, (N + 1, 3); None if it has no stages.
    """

    P: sp.csc_matrix
    A: sp.csc_matrix
    G: sp.csc_matrix
    first: int
    vectors: tuple[Vectors, ...]
    stages: npt.NDArray[np.int64] | None = None


def slack_statement(recording: Recording) -> Programme:
    """Return the programme with the states eliminated, and one slack for each soft row."""
    qp = recording.controller.qp
    n, m = len(qp.H), len(qp.rows)
    over, under = _sides(recording)
    G = np.vstack(
        [np.hstack([qp.rows, -np.eye(m)])[over], np.hstack([qp.rows, np.eye(m)])[under]],
    )
    vectors = []
    for f, low, high in recording.questions:
        free = np.full(int(under.sum()), math.inf)
        vectors.append(
            Vectors(
                np.concatenate([f, np.full(m, qp.linear)]),
                np.zeros(0),
                np.concatenate([np.full(int(over.sum()), -math.inf), low[n:][under]]),
                np.concatenate([high[n:][over], free]),
                np.concatenate([low[:n], np.zeros(m)]),
                np.concatenate([high[:n], np.full(m, math.inf)]),
            )
        )
    return Programme(
        P=sp.csc_matrix(sp.block_diag([qp.H, qp.quadratic * np.eye(m)])),
        A=sp.csc_matrix((0, n + m)),
        G=sp.csc_matrix(G),
        first=0,
        vectors=tuple(vectors),
    )


def _sides(recording: Recording) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return which rows are bounded from above, and which from below."""
    p = recording.controller.programme
    return p.row_high < 1e19, p.row_low > -1e19


class _Stages:
    """The programme stage by stage: sizes, and where each variable is.

    A stage holds the winch's state, the move that is held (where blocks are longer than a sample,
    as one state more), the move where a block begins, and the slacks of its soft rows.
    """

    def __init__(self, controller: LinearMPC) -> None:
        p = controller.programme
        self.controller, self.N, self.n = controller, p.steps, controller.model.winch.size
        self.blocked = max(p.blocks) > 1
        self.nx = self.n + int(self.blocked)
        self.starts = set(np.cumsum((0, *p.blocks[:-1])).tolist())
        self.rows: list[list[int]] = [[] for _ in range(self.N + 1)]
        for k, j in enumerate(p.at.tolist()):
            self.rows[j].append(k)
        sizes = [self.nx + int(j in self.starts) + len(self.rows[j]) for j in range(self.N + 1)]
        self.at = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        # In units in which each state is of the size of one.
        self.unit = np.asarray(controller.model.scale[: self.n])

    def move(self, j: int) -> int:
        """Return where the move of sample j is: an input where a block begins, else a state."""
        return int(self.at[j]) + (self.nx if j in self.starts else self.n)

    def slack(self, j: int, i: int) -> int:
        return int(self.at[j]) + self.nx + int(j in self.starts) + i


def stage_statement(recording: Recording) -> Programme:
    """Return the programme with every state a variable, ordered by stages."""
    controller = recording.controller
    s, p, model = _Stages(controller), controller.programme, controller.model
    winch, weights, qp = model.winch, controller.regulator, controller.qp
    N, n, unit, size = s.N, s.n, s.unit, int(s.at[-1])
    over, under = _sides(recording)
    P = sp.lil_matrix((size, size))
    A = sp.lil_matrix(((N + 1) * s.nx, size))
    payload, rho = winch.payload * unit, 2.0 * weights.weights[1] * p.unit**2 / p.cost
    for j in range(N + 1):
        x = slice(int(s.at[j]), int(s.at[j]) + n)
        if 0 < j < N:
            P[x, x] = 2.0 * np.outer(payload, payload) / p.cost
        if j == N:
            P[x, x] = 2.0 * weights.P * np.outer(unit, unit) / p.cost
        else:
            P[s.move(j), s.move(j)] = rho
        for i in range(len(s.rows[j])):
            P[s.slack(j, i), s.slack(j, i)] = qp.quadratic
    # x_0 = x, and x_{j+1} - A x_j - B v_j = what is known
    A[:n, :n] = np.eye(n)
    if s.blocked:
        A[n, n] = 1.0  # nothing is held before the first move
    over_sample = winch.A / unit[:, None] * unit
    for j in range(N):
        at, x, after = (j + 1) * s.nx, int(s.at[j]), int(s.at[j + 1])
        A[at : at + s.nx, after : after + s.nx] = -np.eye(s.nx)
        A[at : at + n, x : x + n] = over_sample
        A[at : at + n, s.move(j)] = (winch.B[:, 0] * p.unit / unit)[:, None]
        if s.blocked:
            A[at + n, s.move(j)] = 1.0
    entries: list[tuple[int, FloatArray, int]] = []  # row of the programme, left side, way
    for j in range(N + 1):
        for i, k in enumerate(s.rows[j]):
            for way, there in ((-1.0, over[k]), (1.0, under[k])):
                if there:
                    row = np.zeros(size)
                    row[int(s.at[j]) : int(s.at[j]) + n] = _watched(controller, k) * unit
                    if WATCHED[p.kind[k]] == "command":
                        row[s.move(j)] = controller.programme.scale[k] * p.unit / winch.gain
                    row[s.slack(j, i)] = way
                    entries.append((k, row, int(way)))
    kind = np.zeros((N + 1, 3), dtype=np.int64)
    for j in range(N + 1):
        count = sum(1 for k, _, _ in entries if k in s.rows[j])
        kind[j] = s.nx, s.at[j + 1] - s.at[j] - s.nx, count
    return Programme(
        P=sp.csc_matrix(P),
        A=sp.csc_matrix(A),
        G=sp.csc_matrix(np.array([row for _, row, _ in entries])),
        first=s.move(0),
        vectors=_stage_vectors(recording, s, [(k, way) for k, _, way in entries]),
        stages=kind,
    )


def _watched(controller: LinearMPC, k: int) -> FloatArray:
    """Return a soft row as a function of the winch's state at its sample, scaled."""
    winch, p = controller.model.winch, controller.programme
    name = WATCHED[p.kind[k]]
    of: Any = {"speed": winch.speed, "tension": winch.tension, "payload": winch.payload}
    row = winch.back * winch.speed if name == "command" else of[name]
    return np.asarray(controller.programme.scale[k] * row)


def _stage_vectors(
    recording: Recording, s: _Stages, entries: Sequence[tuple[int, int]]
) -> tuple[Vectors, ...]:
    """Return the vectors of each sample, made of the estimate alone."""
    controller = recording.controller
    p, model, weights = controller.programme, controller.model, controller.regulator
    winch, qp = model.winch, controller.qp
    N, n, nh, size = s.N, s.n, model.sea.order, int(s.at[-1])
    to_path = path_of_sea(model, N)
    ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], N)
    slack = np.concatenate(
        [[s.slack(j, i) for i in range(len(s.rows[j]))] for j in range(N + 1)]
    ).astype(np.int64)
    moves = np.array([s.move(j) for j in range(N)])
    free = np.array([s.move(j) for j in sorted(s.starts)])
    last = slice(int(s.at[N]), int(s.at[N]) + n)
    tension = [WATCHED[p.kind[k]] == "tension" for k, _ in entries]
    above = [way < 0 for _, way in entries]
    rows = np.array([k for k, _ in entries])
    found = []
    for chi, (_, low, high) in zip(recording.states, recording.questions, strict=True):
        at = model.constants_at.start
        c, shift = chi[at : at + 2], chi[at + 3]
        path = (to_path @ chi[model.sea_at]).reshape(N + 1, 2)
        q, b = np.zeros(size), np.zeros((N + 1, s.nx))
        q[slack] = qp.linear
        q[moves] = -2.0 * weights.weights[1] * p.unit / p.cost * float(winch.steady @ c)
        end = weights.N[:, :nh] @ (ahead @ chi[model.sea_at]) + weights.N[:, nh:] @ c
        q[last] = 2.0 * s.unit * end / p.cost
        b[0, :n] = chi[:n] / s.unit
        ends = np.hstack([path[:-1], path[1:]])
        b[1:, :n] = -(ends @ winch.from_hook.T + winch.from_constants @ c) / s.unit
        more = p.scale[rows] * (path[p.at[rows]] @ winch.tension_from_hook + shift)
        more = np.where(tension, more, 0.0)
        least, most = np.full(size, -math.inf), np.full(size, math.inf)
        least[slack] = 0.0
        least[free], most[free] = low[: len(free)], high[: len(free)]
        found.append(
            Vectors(
                q,
                b.ravel(),
                np.where(above, -math.inf, p.row_low[rows] - more),
                np.where(above, p.row_high[rows] - more, math.inf),
                least,
                most,
            )
        )
    return tuple(found)


def stated(recording: Recording, *, stages: bool) -> Programme:
    """Return the programme in one of the two statements."""
    return stage_statement(recording) if stages else slack_statement(recording)


def one_sided(qp: Programme, *, box: bool = True) -> tuple[sp.csc_matrix, list[FloatArray]]:
    """Return M and the bounds of M x = or <= bound: equations first, then every finite side."""
    v = qp.vectors[0]
    eye = sp.eye(qp.P.shape[0], format="csc")
    over, under = np.isfinite(v.high), np.isfinite(v.low)
    most, least = np.isfinite(v.most), np.isfinite(v.least)
    parts = [qp.A, qp.G[over], -qp.G[under]]
    if box:
        parts += [eye[most], -eye[least]]
    bounds = []
    for v in qp.vectors:
        sides = [v.b, v.high[over], -v.low[under]]
        if box:
            sides += [v.most[most], -v.least[least]]
        bounds.append(np.concatenate(sides))
    return sp.csc_matrix(sp.vstack(parts)), bounds
