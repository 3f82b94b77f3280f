"""Responses over the horizon to state, path, moves and forces, as matrices that are made once.

Arguments are those of the forces (`mpc.nonlinear.stage`), outputs what cost and limits need: the
payload at samples 1 .. N - 1, the state at the end, the motor's speed at the start of each block,
the rows of the linear programme.  `mpc.nonlinear.shooting` puts them together.
"""

from dataclasses import replace

import numpy as np

from models.basics import FloatArray

from ..linear import WATCHED
from ..programme import Condensed, Signals
from .stage import Stage


def with_drift(signals: Signals, stage: Stage) -> Signals:
    """Return the signals with the command at the start of a sample, though moves are means."""
    drift, k = stage.drift, signals.names.index("command")
    C, D, F, G = (np.array(part) for part in (signals.C, signals.D, signals.F, signals.G))
    for part, over in (
        (C, drift.state), (D, drift.mean), (F, drift.hook), (G, drift.constants)
    ):  # fmt: skip
        part[k] += over / stage.winch.gain
    return replace(signals, C=C, D=D, F=F, G=G)


def linear_response(p: Condensed, stage: Stage) -> tuple[FloatArray, FloatArray]:
    """Return arguments and outputs, without rows, by the columns of the horizon."""
    horizon, payload = p.horizon, stage.winch.payload
    y, o = [], []
    for j, S in enumerate(horizon.states()):
        if 0 < j < p.steps:
            o.append(payload @ S)
        if j == p.steps:
            o.append(S)
            break
        at = stage.C @ S
        at[:, horizon.ends(j)] += stage.C_hook
        at[:, horizon.constants] += stage.C_constants
        at[:, horizon.move(j)] += stage.D[:, None] * p.unit
        y.append(at)
    return np.vstack(y), np.vstack([*o, p.traced])


def forced_response(p: Condensed, stage: Stage, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return arguments and outputs as linear functions of the forces, (K my, K m), (no, K m)."""
    winch, n, N = stage.winch, stage.winch.size, p.steps
    size, rows = stage.from_forces.shape[1], len(stage.C)
    after = [stage.from_forces]  # state so many samples after a force's own
    for _ in range(N - 1):
        after.append(winch.A @ after[-1])
    chain = np.array(after).reshape(N, n, size)
    G = np.zeros((N * rows, N * size))
    of_y = stage.C @ chain
    for j in range(N):
        here = slice(j * rows, (j + 1) * rows)
        G[here, j * size : (j + 1) * size] = stage.own
        for k in range(j):
            G[here, k * size : (k + 1) * size] = of_y[j - 1 - k]
    kinds = {"speed": winch.speed, "tension": winch.tension, "payload": winch.payload}
    kinds["command"] = winch.back * winch.reckoned + stage.drift.state / winch.gain
    wanted = [(winch.payload, j) for j in range(1, N)]
    wanted += [(row, N) for row in np.eye(n)]
    wanted += [(winch.reckoned, j) for j in p.horizon.starts]
    for kind, j, factor in zip(p.kind, p.at, scale, strict=True):
        wanted.append((factor * kinds[WATCHED[kind]], int(j)))
    Theta = np.zeros((len(wanted), N * size))
    for target, (row, j) in zip(Theta, wanted, strict=True):
        # What a row of the state at sample j feels of all forces before.
        target[: j * size] = (row @ chain)[:j][::-1].reshape(-1)
    return G, Theta
