r"""The condensed programme of the winch: its horizon, limited signals, and the sea beyond.

    PredictionModel, LQRegulator, blocks, limits --> `mpc.programme.condensed`

The moves are torques in units of the peak, the path is displacement and velocity of the hook
(z_0, z'_0, z_1, z'_1, ...), the cost is that of the payload over the hook's rms, and the constants
are a force on the payload and a torque at the motor.  Beyond the horizon the sea goes on as its
model says: its state there is either as the filter expects it or as the path to there makes it most
likely (`sea_at_end`).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.basics import FloatArray

from ..programme import (
    Condensed,
    Constraint,
    Horizon,
    LQRegulator,
    Signals,
    end_of_record,
    free_outputs,
)
from ..winch import PredictionModel, SampledWinch

#: What may be limited: motor speed [rad/s], tension at the payload [N], payload [m], and the
#: command's deviation from rest [unit of the command].
WATCHED = ("speed", "tension", "payload", "command")
_FAINT = 1e-3  # error of the path, over the hook's rms, when the sea's state is told from it


def winch_programme(
    model: PredictionModel,
    regulator: LQRegulator,
    blocks: Sequence[int],
    limits: Mapping[str, tuple[float, float]],
    signals: Signals | None = None,
    **solver: Any,
) -> Condensed:
    """Return the programme, with blocks of so many samples (nb,).

    The regulator's value function ends the horizon; signals of `WATCHED` have soft limits, as
    deviations from rest.  They are by default those of the winch, and what is left goes to the
    `solver` (`Condensed`).
    """
    winch, unit = model.winch, model.winch.case.winch.drive.torque_peak
    held = np.zeros((2, 2))
    held[1] = -winch.steady
    watched = _watched(sum(blocks))
    return Condensed(
        Horizon(
            A=winch.A,
            B=winch.B,
            from_path=winch.from_hook,
            from_constants=winch.from_constants,
            blocks=tuple(blocks),
            units=np.array([unit]),
        ),
        signals=winch_signals(winch) if signals is None else signals,
        cost=Signals(
            names=("payload", "torque"),
            C=np.vstack([winch.payload, np.zeros(winch.size)]),
            D=np.array([[0.0], [1.0]]),
            F=np.zeros((2, 4)),
            G=held,
        ),
        end=regulator,
        constraints=[
            Constraint(
                signal=name, low=limits[name][0], high=limits[name][1], soft=True, samples=watched
            )
            for name in WATCHED
            if name in limits
        ],
        inputs=("torque",),
        rest={},
        scale=sum(blocks) * model.waves[0] ** 2,
        traced="reckoned",
        **solver,
    )


def winch_signals(winch: SampledWinch) -> Signals:
    """Return what may be limited, `WATCHED`, and the speed that a command reckons with."""
    C = np.array([winch.speed, winch.tension, winch.payload, winch.back * winch.reckoned])
    F, G = np.zeros((5, 4)), np.zeros((5, 2))
    F[1, :2], G[1] = winch.tension_from_hook, winch.tension_from_constants
    return Signals(
        names=(*WATCHED, "reckoned"),
        C=np.vstack([C, winch.reckoned]),
        D=np.array([[0.0], [0.0], [0.0], [1.0 / winch.gain], [0.0]]),
        F=F,
        G=G,
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


def _watched(N: int) -> frozenset[int]:
    """Return the samples at which limits on the state are kept: dense at first, then rarer."""
    found, j = {0, N}, 1.0
    while j < N:
        found.add(round(j))
        j = max(j + 2.0, 1.12 * j)
    return frozenset(found)
