"""Linear quadratic Gaussian designs, and their reduction to a few states or to a static gain.

A good place to start a search of free controllers from, and what a bound is made of: two Riccati
equations and a balanced truncation of what the controller makes of the innovations, in the manner
of Liu and Anderson, "Controller reduction via stable factorization and balancing" (Int. J. Control
44, 1986).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from models.basics import (
    BoolArray,
    FloatArray,
    SolverError,
    balanced_truncation,
    solve_lyapunov,
    solve_riccati,
)
from models.plant import LinearPlant

from ..loop import LinearController


@dataclass(frozen=True, kw_only=True, eq=False)
class LqgRegulator:
    """State feedback u = `gain` x, (nu, n), from the weights R on u, and its Riccati solution X."""

    gain: FloatArray
    R: FloatArray
    X: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LqgEstimator:
    """Kalman filter for the noise intensity V on y: `gain`, (n, ny), and error covariance Y."""

    gain: FloatArray
    V: FloatArray
    Y: FloatArray


def regulator(plant: LinearPlant, Q: FloatArray, R: FloatArray, S: FloatArray) -> LqgRegulator:
    """Return the state feedback that minimises E[x'Qx + 2 x'Su + u'Ru].

    Raises
    ------
    SolverError
        If R is singular (an input is free of charge) or no feedback stabilises the plant.
    """
    found = solve_riccati(plant.A, plant.B, Q, R, S)
    return LqgRegulator(gain=found.gain, R=R, X=found.X)


def estimator(plant: LinearPlant, W: FloatArray, V: FloatArray, U: FloatArray) -> LqgEstimator:
    """Return the filter for noises of intensity W on x', V on y, and U between the two.

    Raises
    ------
    SolverError
        If V is singular (a measurement has no noise) or no filter is stable.
    """
    found = solve_riccati(plant.A.T, plant.C.T, W, V, U)
    return LqgEstimator(gain=-found.gain.T, V=V, Y=found.X)


def projected(plant: LinearPlant, feedback: LqgRegulator, mask: BoolArray) -> FloatArray:
    """Return the gain on what is measured, (nu, ny), that comes closest to a state feedback.

    Closest in the mean square of u in the loop that the state feedback makes, with the entries
    outside `mask`, (nu, ny), kept at zero; exact where the measurements hold the state.
    """
    heard = plant.C + plant.D @ feedback.gain
    loop = plant.A + plant.B @ feedback.gain
    covariance = solve_lyapunov(loop, plant.E @ plant.E.T)
    gain = np.zeros(mask.shape)
    for i, free in enumerate(mask):
        row = heard[free] @ covariance
        gain[i, free] = np.linalg.lstsq(row @ heard[free].T, row @ feedback.gain[i], rcond=1e-12)[0]
    return gain


def reduced(
    plant: LinearPlant, feedback: LqgRegulator, kalman: LqgEstimator, order: int
) -> LinearController:
    """Return the controller of a regulator and a filter, truncated to at most `order` states.

    In the loop that the state feedback makes, white innovations drive the state estimate, and
    that drives u; the states that matter least on the way from one to the other are dropped.
    Any regulator with any filter stabilises the plant at full order (the separation
    principle); a truncated one need not.
    """
    K, L = feedback.gain, kalman.gain
    A = plant.A + plant.B @ K - L @ (plant.C + plant.D @ K)
    B, C = L, K
    if order < len(A):
        loop = plant.A + plant.B @ K
        reached = solve_continuous_lyapunov(loop, -L @ kalman.V @ L.T)
        heard = solve_continuous_lyapunov(loop.T, -K.T @ feedback.R @ K)
        left, right = balanced_truncation(
            np.asarray(heard, float), np.asarray(reached, float), order
        )
        A, B, C = left @ A @ right, left @ B, C @ right
    return LinearController(
        A=A,
        B=B,
        C=C,
        D=np.zeros((len(plant.inputs), len(plant.measurements))),
        measurements=plant.measurements,
        inputs=plant.inputs,
    )


def weighing(
    C: FloatArray, D: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Q, R, S of the weighted variance of the outputs C x + D u."""
    return C.T * weights @ C, D.T * weights @ D, C.T * weights @ D


def designs(
    plant: LinearPlant, minimise: Mapping[str, float], omega: FloatArray, count: int = 7
) -> tuple[list[LqgRegulator], list[LqgEstimator]]:
    """Return regulators and filters for a problem and for harder versions of it.

    Parameters
    ----------
    plant
        Shaken by white noises of intensity 1 (`synth.structures.whitened`).
    minimise
        Weights on the variances of performance outputs by name.
    omega
        Frequencies [rad/s], (k,), at which the loop may cross over.
    count
        How many harder versions there are of either.  The inputs are charged, and the
        measurements disturbed, as much as the rest of the problem amounts to at one of the
        frequencies: beyond it the loop has nothing to win.

    Returns
    -------
    tuple
        The first of either is that of the problem itself, if it has a solution.
    """
    weights = np.array([minimise.get(name, 0.0) for name in plant.outputs])
    response = plant.response_at((1e-3 + 1j) * omega[:: max(1, omega.size // count)])
    effort = np.einsum("kzu,z->ku", np.abs(response.zu) ** 2, weights)
    heard = np.sum(np.abs(response.yw) ** 2, axis=2)
    Q, R, S = weighing(plant.Cz, plant.Dz, weights)
    W, V, U = plant.E @ plant.E.T, plant.F @ plant.F.T, plant.E @ plant.F.T
    regulators, filters = [], []
    for k in range(-1, len(effort)):
        # From the highest frequency, where the least is added, down.
        charge = np.diag(effort[-1 - k] + 1e-9 * effort.max()) if k >= 0 else 0.0
        noise = np.diag(heard[-1 - k] + 1e-9 * heard.max()) if k >= 0 else 0.0
        with contextlib.suppress(SolverError):
            regulators.append(regulator(plant, Q, R + charge, S))
        with contextlib.suppress(SolverError):
            filters.append(estimator(plant, W, V + noise, U))
    return regulators, filters
