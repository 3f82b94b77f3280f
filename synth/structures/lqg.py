"""The linear quadratic Gaussian controller, and its reduction to a few states.

For white noise and a full-order controller it is the optimum that `synth.design.tuning` must find,
and so its test oracle; for everything else (a spectrum with a peak, delays, limits, a controller of
lower order, a static gain) it is a good place to start from.  Two Riccati equations, solved by
SciPy, and a balanced truncation of what the controller makes of the innovations, in the manner of
Liu and Anderson, "Controller reduction via stable factorization and balancing" (Int. J. Control 44,
1986).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from models.basics import (
    BoolArray,
    FloatArray,
    InputError,
    SynthesisError,
    White,
    balanced_truncation,
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


@dataclass(frozen=True, kw_only=True, eq=False)
class LQG:
    """The optimal controller of full order; `cost` is the root of the weighted variance."""

    controller: LinearController
    cost: float
    regulator: LqgRegulator
    estimator: LqgEstimator


def lqg(plant: LinearPlant, *, minimise: Mapping[str, float], spectrum: Mapping[str, White]) -> LQG:
    """Return the controller that minimises a weighted variance under white noise.

    Parameters
    ----------
    plant
        A plant without delays and rates.
    minimise
        Weights on the variances of performance outputs by name; together they must weigh
        every input.
    spectrum
        White noises by the name of their disturbance; together they must disturb every
        measurement.

    Raises
    ------
    InputError
        If a name is unknown, or the plant has delays or rates.
    SynthesisError
        If an input is free of charge, a measurement is free of noise, a weighted output
        hears white noise directly, or a Riccati equation has no stabilising solution.
    """
    if any(plant.delays) or plant.rates:
        raise InputError("LQG: the plant must have neither delays nor rates")
    for kind, known, given in (
        ("output", plant.outputs, minimise),
        ("disturbance", plant.disturbances, spectrum),
    ):
        for name in given:
            if name not in known:
                raise InputError(
                    f"LQG: there is no {kind} {name!r}; there are: {', '.join(known) or 'none'}"
                )
    weights = np.array([minimise.get(name, 0.0) for name in plant.outputs])
    noise = np.array([spectrum[n].intensity if n in spectrum else 0.0 for n in plant.disturbances])
    if np.any(weights @ plant.Fz**2 @ noise > 0.0):
        raise SynthesisError("LQG: a weighted output hears white noise directly: infinite cost")
    Q, R, S = weighing(plant.Cz, plant.Dz, weights)
    feedback = regulator(plant, Q, R, S)
    kalman = estimator(plant, *_noises(plant, noise))
    variance = np.trace(plant.E.T @ feedback.X @ plant.E * noise) + np.trace(
        feedback.gain.T @ R @ feedback.gain @ kalman.Y
    )
    return LQG(
        controller=reduced(plant, feedback, kalman, len(plant.states)),
        cost=float(np.sqrt(variance)),
        regulator=feedback,
        estimator=kalman,
    )


def regulator(plant: LinearPlant, Q: FloatArray, R: FloatArray, S: FloatArray) -> LqgRegulator:
    """Return the state feedback that minimises E[x'Qx + 2 x'Su + u'Ru].

    Raises
    ------
    SynthesisError
        If R is singular or the Riccati equation has no stabilising solution.
    """
    X, gain = _riccati("regulator", plant.A, plant.B, Q, R, S)
    return LqgRegulator(gain=gain, R=R, X=X)


def estimator(plant: LinearPlant, W: FloatArray, V: FloatArray, U: FloatArray) -> LqgEstimator:
    """Return the filter for noises of intensity W on x', V on y, and U between the two.

    Raises
    ------
    SynthesisError
        If V is singular or the Riccati equation has no stabilising solution.
    """
    Y, gain = _riccati("estimator", plant.A.T, plant.C.T, W, V, U)
    return LqgEstimator(gain=-gain.T, V=V, Y=Y)


def state_covariance(plant: LinearPlant, feedback: LqgRegulator) -> FloatArray:
    """Return the covariance of the state, (n, n), under u = K x and white noises of intensity 1."""
    covariance = solve_continuous_lyapunov(plant.A + plant.B @ feedback.gain, -plant.E @ plant.E.T)
    return np.asarray(0.5 * (covariance + covariance.T))


def projected(plant: LinearPlant, feedback: LqgRegulator, mask: BoolArray) -> FloatArray:
    """Return the gain on what is measured, (nu, ny), that comes closest to a state feedback.

    Closest in the mean square of u in the loop that the state feedback makes, with the entries
    outside `mask`, (nu, ny), kept at zero; exact where the measurements hold the state.
    """
    heard = plant.C + plant.D @ feedback.gain
    covariance = state_covariance(plant, feedback)
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
    W, V, U = _noises(plant, np.ones(len(plant.disturbances)))
    regulators, filters = [], []
    for k in range(-1, len(effort)):
        # From the highest frequency, where the least is added, down.
        charge = np.diag(effort[-1 - k] + 1e-9 * effort.max()) if k >= 0 else 0.0
        noise = np.diag(heard[-1 - k] + 1e-9 * heard.max()) if k >= 0 else 0.0
        with contextlib.suppress(SynthesisError):
            regulators.append(regulator(plant, Q, R + charge, S))
        with contextlib.suppress(SynthesisError):
            filters.append(estimator(plant, W, V + noise, U))
    return regulators, filters


def _noises(plant: LinearPlant, intensity: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return W, V, U of independent white noises."""
    return (
        (plant.E * intensity) @ plant.E.T,
        (plant.F * intensity) @ plant.F.T,
        (plant.E * intensity) @ plant.F.T,
    )


def _riccati(
    what: str, A: FloatArray, B: FloatArray, Q: FloatArray, R: FloatArray, S: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the solution X and the gain -R^-1 (B'X + S')."""
    if np.linalg.cond(R) > 1e14:
        free = "an input is free of charge" if what == "regulator" else "a measurement has no noise"
        raise SynthesisError(f"LQG: the {what}'s weight is singular: {free}")
    message = f"LQG: the {what}'s Riccati equation has no stabilising solution"
    try:
        X = solve_continuous_are(A, B, Q, R, s=S)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SynthesisError(message) from error
    gain = -np.linalg.solve(R, B.T @ X + S.T)
    # Far out of scale, or with an undamped mode that is not seen, it may not stabilise.
    poles = np.linalg.eigvals(A + B @ gain)
    if poles.real.max(initial=-1.0) > -1e-12 * np.abs(poles).max(initial=1.0):
        raise SynthesisError(message)
    return np.asarray(0.5 * (X + X.T)), np.asarray(gain, dtype=np.float64)
