r"""The condensed programme of the winch: its horizon, limited signals, and the sea beyond.

    PredictionModel, LQRegulator, blocks --> Horizon --> `mpc.programme.horizon` --> Condensed

The moves are torques in units of the peak, the path is displacement and velocity of the hook
(z_0, z'_0, z_1, z'_1, ...), the cost is that of the payload over the hook's rms, and the constants
are a force on the payload and a torque at the motor.  Beyond the horizon the sea goes on as its
model says: its state there is either as the filter expects it or as the path to there makes it most
likely (`sea_at_end`).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from models.basics import FloatArray

from ..programme import Condensed, Horizon, LQRegulator, condense, end_of_record, free_outputs
from ..winch import PredictionModel

#: What may be limited: motor speed [rad/s], tension at the payload [N], payload [m], and the
#: command's deviation from rest [unit of the command].
WATCHED = ("speed", "tension", "payload", "command")
_FAINT = 1e-3  # error of the path, over the hook's rms, when the sea's state is told from it


def winch_programme(
    model: PredictionModel,
    regulator: LQRegulator,
    blocks: Sequence[int],
    watch: Sequence[str] = ("speed", "tension"),
) -> Condensed:
    """Return the matrices of the programme, with blocks of so many samples (nb,).

    The regulator's value function ends the horizon; signals of `WATCHED` get rows.
    """
    winch = model.winch
    horizon = Horizon(
        A=winch.A,
        B=winch.B,
        from_path=winch.from_hook,
        from_constants=winch.from_constants,
        blocks=tuple(blocks),
        unit=winch.case.winch.drive.torque_peak,
    )
    watched = _watched(horizon.steps)

    def signals(j: int, S: FloatArray) -> Iterator[tuple[int, FloatArray]]:
        """Give the signals that are limited at sample j."""
        if j not in watched:
            return
        for name, row in _rows(model, horizon, j, S):
            # At the first sample only the command is still open.
            if name in watch and (j > 0 or name == "command"):
                yield WATCHED.index(name), row

    return condense(
        horizon,
        regulator,
        output=winch.payload,
        scale=model.waves[0] ** 2,
        speed=winch.reckoned,
        signals=signals,
    )


def by_chi(model: PredictionModel, horizon: Horizon, rows: FloatArray) -> FloatArray:
    """Return rows by the horizon's columns as rows by chi, (., n): of the winch and the constants.

    The path is left out, as it may be another than that of the model's own sea.
    """
    found, at = np.zeros((len(rows), model.size)), model.constants_at.start
    found[:, : model.winch.size] = rows[:, horizon.state]
    found[:, at : at + 2] = rows[:, horizon.constants]
    return found


def path_of_sea(model: PredictionModel, steps: int) -> FloatArray:
    """Return the path that the sea's state lets expect, (2 (steps + 1), nh)."""
    at = model.sea_at
    return free_outputs(model.A[at, at], model.hook[:, at], steps)


def sea_at_end(
    model: PredictionModel, steps: int, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the sea's state at the end of a path as a linear function of path and state.

    The conditional mean of the Gaussian sea, given its estimate at the start and displacement and
    velocity of the hook at every sample but for a faint error.  They are (nh, 2 (N + 1)), (nh, nh),
    for N steps and the covariance of the estimate at the start (nh, nh).
    """
    at = model.sea_at
    added = (model.G @ model.G.T)[at, at]
    R = np.array([(_FAINT * size) ** 2 for size in model.waves[:2]])
    return end_of_record(model.A[at, at], model.hook[:, at], added, R, covariance, steps)


def _watched(N: int) -> set[int]:
    """Return the samples at which limits on the state are kept: dense at first, then rarer."""
    found, j = {0, N}, 1.0
    while j < N:
        found.add(round(j))
        j = max(j + 2.0, 1.12 * j)
    return found


def _rows(
    model: PredictionModel, horizon: Horizon, j: int, S: FloatArray
) -> list[tuple[str, FloatArray]]:
    """Return the signals that may be limited, at sample j, by the horizon's columns."""
    winch = model.winch
    speed, tension = winch.speed @ S, winch.tension @ S
    here = horizon.ends(j).start
    tension[here : here + 2] += winch.tension_from_hook
    tension[horizon.constants] += winch.tension_from_constants
    found = [("speed", speed), ("tension", tension), ("payload", winch.payload @ S)]
    if j < horizon.steps:
        command = winch.back * (winch.reckoned @ S)
        command[horizon.move(j)] += horizon.unit / winch.gain
        found.append(("command", command))
    return found
