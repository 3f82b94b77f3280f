r"""The regulator of the sampled winch, with the sea and the constants as its disturbance.

What an unsaturated predictive controller equals, and the cost of what lies beyond its horizon: the
`LQRegulator` of `mpc.programme` with the winch x, zeta = (sea, constant force, constant torque),
the payload's displacement as the output, and the input that holds the load against the constants.
"""

import numpy as np
import scipy.linalg

from models.basics import FloatArray

from ..programme import LQRegulator, lq_regulator
from .prediction import PredictionModel


def regulator(model: PredictionModel, weight: float) -> LQRegulator:
    """Return the regulator for a weight on the input.

    That is what the drive's peak torque costs, over a displacement of the hook's rms.

    Raises SolverError if the Riccati equation has no solution.
    """
    winch, nh = model.winch, model.sea.order
    heave = float(np.sqrt(_stationary(model)[0, 0] / (1.0 + model.swell)))
    rho = (weight * heave / winch.case.winch.drive.torque_peak) ** 2
    # In units of the hook's rms and the peak torque, so that the equation is well scaled.
    scale = np.maximum(np.abs(winch.moved).max(axis=1), 1e-9)
    scale[scale == 1e-9] = 1.0
    scale[winch.size - winch.waiting :] = winch.case.winch.drive.torque_peak / winch.gain
    at_rest = np.zeros((2, nh + 2))  # the payload's place, and the input that holds it there
    at_rest[1, nh:] = -winch.steady
    return lq_regulator(
        np.asarray(winch.A),
        np.asarray(winch.B),
        np.vstack([winch.payload, np.zeros(winch.size)]),
        np.array([[0.0], [1.0]]),
        weights=np.array([1.0, rho]),
        scale=scale,
        Gamma=np.hstack([model.A[: winch.size, model.sea_at], winch.from_constants]),
        Phi=scipy.linalg.block_diag(model.A[model.sea_at, model.sea_at], np.eye(2)),
        M=at_rest,
    )


def feedback_row(regulator: LQRegulator, model: PredictionModel) -> FloatArray:
    """Return the row F of d = -F chi, (n,)."""
    row = np.zeros(model.size)
    row[: model.winch.size] = regulator.K[0]
    row[model.sea_at] = regulator.K_disturbance[0, : model.sea.order]
    at = model.constants_at.start
    row[at : at + 2] = regulator.K_disturbance[0, model.sea.order :]
    return row


def _stationary(model: PredictionModel) -> FloatArray:
    """Return the covariance of the hook's displacement and velocity in the model, (2, 2)."""
    at, sea = model.sea_at, model.sea
    added = (model.G @ model.G.T)[at, at]
    covariance = scipy.linalg.solve_discrete_lyapunov(model.A[at, at], added)
    shown = np.vstack([sea.C, sea.C @ sea.A])
    return np.asarray(shown @ covariance @ shown.T)
