r"""The linear-quadratic regulator of the sampled winch with the sea in its state.

What an unsaturated predictive controller equals, and the cost of what lies beyond its horizon.
With the winch x, the disturbance zeta = (sea, constant force, constant torque) and the input d,

.. math::

    x^+ = A x + B d + \Gamma \zeta, \qquad \zeta^+ = \Phi \zeta, \qquad
    J = \sum_k p_k^2 + \rho \, (d_k - d_\infty \zeta_k)^2,

with p the payload's displacement and d_infty the input that holds the load against the constants.
The disturbance cannot be controlled, so that the Riccati equation splits: one of the winch alone
for P, a linear equation for the cross term N (B. D. O. Anderson and J. B. Moore, *Optimal
Control: Linear Quadratic Methods*, 1990, sec. 4.3), and

.. math::

    V(x, \zeta) = x' P x + 2 x' N \zeta + \ldots, \qquad
    N = A_c' (P \tilde\Gamma + N \Phi), \qquad d = -K x - K_\zeta \zeta + d_\infty \zeta .
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from models.basics import FloatArray, SolverError, check_range, read_only

from .doubling import riccati
from .prediction import PredictionModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Regulator:
    """Gains and value function; `regulator` makes it.

    Attributes
    ----------
    weight
        rho: what an input of one newton metre costs, in metres squared [m2/(N m)2].
    P, N
        Value function, (nx, nx), (nx, nz).
    K, K_disturbance
        d = -K x - K_disturbance zeta, (nx,), (nz,); d_infty is in the latter.
    Phi, Gamma
        (nz, nz), (nx, nz).
    steady
        d_infty, (nz,).
    """

    weight: float
    P: FloatArray
    N: FloatArray
    K: FloatArray
    K_disturbance: FloatArray
    Phi: FloatArray
    Gamma: FloatArray
    steady: FloatArray

    def __post_init__(self) -> None:
        for name in (
            *("P", "N", "K", "K_disturbance"),
            *("Phi", "Gamma", "steady"),
        ):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def feedback(self, model: PredictionModel) -> FloatArray:
        """Return the row F of d = -F chi, (n,)."""
        row = np.zeros(model.size)
        row[: model.winch.size] = self.K
        row[model.sea_at] = self.K_disturbance[: model.sea.order]
        at = model.constants_at.start
        row[at : at + 2] = self.K_disturbance[model.sea.order :]
        return row


def regulator(model: PredictionModel, weight: float) -> Regulator:
    """Return the regulator for a weight on the input.

    Parameters
    ----------
    model
        The prediction model.
    weight
        What an input of the drive's peak torque costs, over a displacement of the hook's rms.

    Raises
    ------
    InputError
        If the weight is not above zero.
    SolverError
        If the Riccati equation has no solution.
    """
    check_range("regulator", "weight", weight, low=0.0, open_low=True)
    winch, nh = model.winch, model.sea.order
    heave = float(np.sqrt(_stationary(model)[0, 0]))
    rho = (weight * heave / winch.case.winch.drive.torque_peak) ** 2
    # In units of the hook's rms and the peak torque, so that the equation is well scaled.
    scale = np.maximum(np.abs(winch.moved).max(axis=1), 1e-9)
    scale[scale == 1e-9] = 1.0
    A = winch.A / scale[:, None] * scale
    B = winch.B / scale[:, None]
    Q = np.outer(winch.payload * scale, winch.payload * scale)
    P = riccati(A.T, B.T / math.sqrt(rho), Q)
    P = P / np.outer(scale, scale)
    A, B = np.asarray(winch.A), np.asarray(winch.B)
    bend = float((B.T @ P @ B)[0, 0]) + rho
    K = (B.T @ P @ A)[0] / bend
    closed = A - B @ K[None, :]
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0 - 1e-12:
        raise SolverError("regulator: the regulated winch is not stable")
    Phi = scipy.linalg.block_diag(model.A[model.sea_at, model.sea_at], np.eye(2))
    Gamma = np.hstack([model.A[: winch.size, model.sea_at], winch.from_constants])
    steady = np.concatenate([np.zeros(nh), winch.steady])
    shifted = Gamma + np.outer(B[:, 0], steady)
    # N - A_c' N Phi = A_c' P Gamma~: for each Schur vector of Phi one linear system.
    N = _cross(closed, P @ shifted, Phi)
    K_zeta = (B.T @ (P @ shifted + N @ Phi))[0] / bend
    return Regulator(
        weight=rho,
        P=P,
        N=N,
        K=K,
        K_disturbance=K_zeta - steady,
        Phi=Phi,
        Gamma=Gamma,
        steady=steady,
    )


def _cross(closed: FloatArray, right: FloatArray, Phi: FloatArray) -> FloatArray:
    """Solve N = A_c' (right + N Phi)."""
    T, Z = scipy.linalg.schur(Phi, output="complex")
    rotated = closed.T @ right @ Z
    n = len(closed)
    N = np.zeros((n, len(Phi)), dtype=np.complex128)
    for k in range(len(Phi)):
        known = rotated[:, k] + closed.T @ (N[:, :k] @ T[:k, k])
        N[:, k] = np.linalg.solve(np.eye(n) - T[k, k] * closed.T, known)
    return np.asarray((N @ Z.conj().T).real)


def _stationary(model: PredictionModel) -> FloatArray:
    """Return the covariance of the hook's displacement and velocity in the model, (2, 2)."""
    at, sea = model.sea_at, model.sea
    added = (model.G @ model.G.T)[at, at]
    covariance = scipy.linalg.solve_discrete_lyapunov(model.A[at, at], added)
    shown = np.vstack([sea.C, sea.C @ sea.A])
    return np.asarray(shown @ covariance @ shown.T)
