r"""The prediction over the horizon as matrices: every state eliminated, the moves blocked.

.. math::

    \min_v \; \tfrac12 v' H v + f' v \quad \text{subject to} \quad
    l \le v \le u, \quad \underline r \le R v + r_0 \le \overline r \ \text{(soft)},

with the torques d = d_peak v held over blocks of samples, the cost that of the regulator
(`mpc.winch.regulation`),

.. math::

    J = \sum_{j=1}^{N-1} p_j^2 + \rho \sum_{j=0}^{N-1} (d_j - d_\infty c)^2
        + x_N' P x_N + 2 x_N' N_\zeta \zeta_N ,

and everything divided by N times the square of the hook's rms.  Gradient f and free response r_0
are linear in what is known at the sample: the winch's state x, the constants c, and the path w of
the hook, its displacement and velocity at the N + 1 samples of the horizon.  All products that do
not change are made here, once.

Beyond the horizon the sea goes on as its model says: zeta_N holds its state there, either as the
filter expects it or as the path to there makes it most likely (`sea_at_end`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, check_range, read_only

from ..winch import PredictionModel, Regulator

IntArray = npt.NDArray[np.int64]

_OWNER = "predictive control"
#: What may be limited: motor speed [rad/s], tension at the drum [N], payload [m], and the command's
#: deviation from rest [unit of the command].
WATCHED = ("speed", "tension", "payload", "command")
_FAINT = 1e-3  # error of the path, over the hook's rms, when the sea's state is told from it


@dataclass(frozen=True, kw_only=True, eq=False)
class Condensed:
    """Matrices of the programme; `condense` makes it.

    Attributes
    ----------
    blocks
        Length of each block in samples, (nb,).
    H
        (nb, nb), per unit of `unit`.
    from_state, from_path, from_constants, from_end
        Gradient f of the winch's state, of the hook's path, of the constants, and of the sea's
        state at the end of the horizon, (nb, nx), (nb, 2 (N + 1)), (nb, 2), (nb, nh).  The path is
        z_0, z'_0, z_1, z'_1, ...
    at
        Sample of each row, (nr,).
    kind
        What each row is, a position in `WATCHED`, (nr,).
    rows, rows_state, rows_path, rows_constants
        R and r_0, (nr, nb), (nr, nx), (nr, 2 (N + 1)), (nr, 2).
    speeds
        Motor speed at the start of each block, of (x, path, constants, v),
        (nb, nx + 2 (N + 1) + 2 + nb).
    unit
        Torque of v = 1: the peak torque [N m].
    cost
        What the cost is divided by [m2].
    """

    blocks: tuple[int, ...]
    H: FloatArray
    from_state: FloatArray
    from_path: FloatArray
    from_constants: FloatArray
    from_end: FloatArray
    at: IntArray
    kind: IntArray
    rows: FloatArray
    rows_state: FloatArray
    rows_path: FloatArray
    rows_constants: FloatArray
    speeds: FloatArray
    unit: float
    cost: float

    def __post_init__(self) -> None:
        for name in (
            *("H", "from_state", "from_path", "from_constants", "from_end"),
            *("rows", "rows_state", "rows_path", "rows_constants", "speeds"),
        ):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def steps(self) -> int:
        """Number of samples N of the horizon."""
        return sum(self.blocks)


def default_blocking(horizon: float, sample_time: float) -> tuple[int, ...]:
    """Return lengths of blocks [samples] that grow over a horizon [s]: some thirty moves.

    Raises
    ------
    InputError
        If the horizon is shorter than four samples or longer than 2000.
    """
    check_range(_OWNER, "horizon", horizon, low=4 * sample_time, high=2000 * sample_time, unit="s")
    left = round(horizon / sample_time)
    blocks: list[int] = []
    # So many moves of this length [s]; the last length goes on to the end.
    for count, length in ((6, 0.0), (6, 0.1), (6, 0.2), (10**6, 0.4)):
        size = max(1, round(length / sample_time))
        for _ in range(count):
            if left <= 0:
                return tuple(blocks)
            if left < 2 * size:
                size = left
            blocks.append(size)
            left -= size
    return tuple(blocks)


def condense(
    model: PredictionModel,
    weights: Regulator,
    blocks: Sequence[int],
    watch: Sequence[str] = ("speed", "tension"),
) -> Condensed:
    """Return the matrices of the programme.

    Parameters
    ----------
    model
        The prediction model.
    weights
        The regulator, whose value function ends the horizon.
    blocks
        Length of each block in samples, (nb,).
    watch
        Signals that get rows: of `WATCHED`.
    """
    winch, n = model.winch, model.winch.size
    N, nb = sum(blocks), len(blocks)
    of = np.repeat(np.arange(nb), blocks)  # block of each sample
    unit = winch.case.winch.drive.torque_peak
    path = slice(n, n + 2 * (N + 1))
    constants = slice(path.stop, path.stop + 2)
    moves = slice(constants.stop, constants.stop + nb)

    S = np.zeros((n, moves.stop))  # the state as a linear function of (x0, path, c, v)
    S[:, :n] = np.eye(n)
    watched = _watched(N)
    H, gradient = np.zeros((nb, nb)), np.zeros((nb, moves.start))
    rows, at, kind = [], [], []

    def watch_at(j: int) -> None:
        for name, row in _rows(model, S, path, moves, j, of, unit):
            # At the first sample only the command is still open.
            if name in watch and (j > 0 or name == "command"):
                rows.append(row)
                at.append(j)
                kind.append(WATCHED.index(name))

    starts = set(np.cumsum((0, *blocks[:-1])).tolist())
    speeds = []
    for j in range(N):
        if j in watched:
            watch_at(j)
        if j in starts:
            speeds.append(winch.speed @ S)
        S = winch.A @ S
        S[:, path.start + 2 * j : path.start + 2 * j + 4] += winch.from_hook
        S[:, constants] += winch.from_constants
        S[:, moves.start + of[j]] += winch.B[:, 0] * unit
        if j + 1 < N:  # the last is in the value function
            p = winch.payload @ S
            H += np.outer(p[moves], p[moves])
            gradient += np.outer(p[moves], p[: moves.start])
    watch_at(N)
    lengths = np.array(blocks, dtype=np.float64)
    H += weights.weight * unit**2 * np.diag(lengths)
    gradient[:, constants] -= weights.weight * unit * np.outer(lengths, winch.steady)
    end = S[:, moves]
    H += end.T @ weights.P @ end
    gradient += end.T @ weights.P @ S[:, : moves.start]
    nh = model.sea.order
    gradient[:, constants] += end.T @ weights.N[:, nh:]

    cost = N * model.waves[0] ** 2
    G = np.array(rows).reshape(len(rows), moves.stop)
    return Condensed(
        blocks=tuple(blocks),
        H=(H + H.T) / cost,
        from_state=2.0 * gradient[:, :n] / cost,
        from_path=2.0 * gradient[:, path] / cost,
        from_constants=2.0 * gradient[:, constants] / cost,
        from_end=2.0 * end.T @ weights.N[:, :nh] / cost,
        at=np.array(at),
        kind=np.array(kind),
        rows=G[:, moves],
        rows_state=G[:, :n],
        rows_path=G[:, path],
        rows_constants=G[:, constants],
        speeds=np.array(speeds),
        unit=unit,
        cost=cost,
    )


def path_of_sea(model: PredictionModel, steps: int) -> FloatArray:
    """Return the path that the sea's state lets expect, (2 (steps + 1), nh)."""
    shown = model.hook[:, model.sea_at]
    over = model.A[model.sea_at, model.sea_at]
    rows, state = [], np.eye(model.sea.order)
    for _ in range(steps + 1):
        rows.append(shown @ state)
        state = over @ state
    return np.vstack(rows)


def sea_at_end(
    model: PredictionModel, steps: int, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the sea's state at the end of a path as a linear function of path and state.

    The conditional mean of the Gaussian sea, given its estimate at the start and displacement and
    velocity of the hook at every sample but for a faint error.

    Parameters
    ----------
    model
        The model.
    steps
        N.
    covariance
        Of the estimate at the start, (nh, nh).

    Returns
    -------
    from_path, from_sea
        (nh, 2 (N + 1)), (nh, nh).
    """
    over = model.A[model.sea_at, model.sea_at]
    shown = model.hook[:, model.sea_at]
    added = (model.G @ model.G.T)[model.sea_at, model.sea_at]
    R = np.diag([(_FAINT * size) ** 2 for size in model.waves[:2]])
    nh, P = model.sea.order, covariance
    told, kept_sea = np.zeros((nh, 2 * (steps + 1))), np.eye(nh)
    for j in range(steps + 1):
        if j > 0:
            told, kept_sea, P = over @ told, over @ kept_sea, over @ P @ over.T + added
        gain = np.linalg.solve(shown @ P @ shown.T + R, shown @ P).T
        kept = np.eye(nh) - gain @ shown
        told, kept_sea = kept @ told, kept @ kept_sea
        told[:, 2 * j : 2 * j + 2] += gain
        P = kept @ P @ kept.T + gain @ R @ gain.T
    return told, kept_sea


def _watched(N: int) -> set[int]:
    """Return the samples at which limits on the state are kept: dense at first, then rarer."""
    found, j = {0}, 1.0
    while j < N:
        found.add(round(j))
        j = max(j + 2.0, 1.12 * j)
    return found


def _rows(
    model: PredictionModel,
    S: FloatArray,
    path: slice,
    moves: slice,
    j: int,
    of: IntArray,
    unit: float,
) -> list[tuple[str, FloatArray]]:
    """Return the signals that may be limited, at sample j, as functions of (x0, path, c, v)."""
    winch = model.winch
    speed, tension = winch.speed @ S, winch.tension @ S
    tension[path.start + 2 * j : path.start + 2 * j + 2] += winch.tension_from_hook
    found = [("speed", speed), ("tension", tension), ("payload", winch.payload @ S)]
    if j < len(of):
        command = winch.back * speed
        command[moves.start + of[j]] += unit / winch.gain
        found.append(("command", command))
    return found
