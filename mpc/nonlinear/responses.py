"""What the horizon shows of state, path, moves and forces, as matrices: made once.

Arguments are those of the forces (`mpc.nonlinear.stage`), outputs what cost and limits need: the
payload at samples 1 .. N - 1, the state at the end, the motor's speed at the start of each block,
the rows of the linear programme.  `mpc.nonlinear.shooting` puts them together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.basics import FloatArray

from ..linear import WATCHED, Condensed
from ..winch import PredictionModel
from .stage import Stage


def with_drift(p: Condensed, stage: Stage) -> Condensed:
    """Return the programme with the command at the start of a sample, though moves are means."""
    winch, drift, n = stage.winch, stage.drift, stage.winch.size
    of = np.repeat(np.arange(len(p.blocks)), p.blocks)
    path, constants = 2 * (p.steps + 1), n + 2 * (p.steps + 1)
    rows = np.hstack([p.rows_state, p.rows_path, p.rows_constants, p.rows])
    S = np.eye(n, rows.shape[1])
    for j in range(p.steps):
        ends = slice(n + 2 * j, n + 2 * j + 4)
        over = drift.state @ S
        over[ends] += drift.hook
        over[constants : constants + 2] += drift.constants
        over[constants + 2 + of[j]] += drift.mean * p.unit
        for k in np.flatnonzero((p.at == j) & (p.kind == WATCHED.index("command"))):
            rows[k] += over / winch.gain
        S = winch.A @ S
        S[:, ends] += winch.from_hook
        S[:, constants : constants + 2] += winch.from_constants
        S[:, constants + 2 + of[j]] += winch.B[:, 0] * p.unit
    parts = np.split(rows, [n, n + path, n + path + 2], axis=1)
    of_state, of_path, of_constants, of_moves = parts
    return replace(
        p, rows_state=of_state, rows_path=of_path, rows_constants=of_constants, rows=of_moves
    )


def linear_response(
    model: PredictionModel, p: Condensed, stage: Stage
) -> tuple[FloatArray, FloatArray]:
    """Return arguments and outputs, without rows, as linear functions of (x0, path, c, v)."""
    winch, n = model.winch, model.winch.size
    N, nb = p.steps, len(p.blocks)
    of = np.repeat(np.arange(nb), p.blocks)
    constants = n + 2 * (N + 1)
    moves = constants + 2
    S = np.zeros((n, moves + nb))
    S[:, :n] = np.eye(n)
    y, o = [], []
    for j in range(N):
        path = slice(n + 2 * j, n + 2 * j + 4)
        at = stage.C @ S
        at[:, path] += stage.C_hook
        at[:, constants:moves] += stage.C_constants
        at[:, moves + of[j]] += stage.D * p.unit
        y.append(at)
        S = winch.A @ S
        S[:, path] += winch.from_hook
        S[:, constants:moves] += winch.from_constants
        S[:, moves + of[j]] += winch.B[:, 0] * p.unit
        o.append(winch.payload @ S)
    return np.vstack(y), np.vstack([*o[:-1], S, p.speeds])


def forced_response(
    model: PredictionModel, p: Condensed, stage: Stage, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return arguments and outputs as linear functions of the forces, (K my, K m), (no, K m)."""
    winch, n, N = model.winch, model.winch.size, p.steps
    size, rows = stage.from_forces.shape[1], len(stage.C)
    after = [stage.from_forces]  # state so many samples after a force's own
    for _ in range(N - 1):
        after.append(winch.A @ after[-1])
    chain = np.array(after).reshape(N, n, size)
    G = np.zeros((N * rows, N * size))
    of_y = stage.C @ chain

    def into(target: FloatArray, row: FloatArray, j: int) -> None:
        """Write what a row of the state at sample j feels of all forces before."""
        felt = (row @ chain)[:j][::-1]
        target[: j * size] = felt.reshape(-1)

    for j in range(N):
        here = slice(j * rows, (j + 1) * rows)
        G[here, j * size : (j + 1) * size] = stage.own
        for k in range(j):
            G[here, k * size : (k + 1) * size] = of_y[j - 1 - k]
    kinds = {"speed": winch.speed, "tension": winch.tension, "payload": winch.payload}
    kinds["command"] = winch.back * winch.speed + stage.drift.state / winch.gain
    starts = np.cumsum((0, *p.blocks[:-1])).tolist()
    wanted = [(winch.payload, j) for j in range(1, N)]
    wanted += [(row, N) for row in np.eye(n)]
    wanted += [(winch.speed, j) for j in starts]
    for kind, j, factor in zip(p.kind, p.at, scale, strict=True):
        wanted.append((factor * kinds[WATCHED[kind]], int(j)))
    Theta = np.zeros((len(wanted), N * size))
    for target, (row, j) in zip(Theta, wanted, strict=True):
        into(target, row, j)
    return G, Theta
