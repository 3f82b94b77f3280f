"""Linear quadratic Gaussian designs, and their reduction to a few states or to a static gain.

A good place to start a search of free controllers from, and what a bound is made of: two Riccati
equations and a balanced truncation of what the controller makes of the innovations, in the manner
of Liu and Anderson, "Controller reduction via stable factorization and balancing" (Int. J. Control
44, 1986).

They need white noise: `shaped` takes filters of the spectra into the plant.  In a start a spectrum
with a peak becomes white noise through an oscillator (`whitened`); good enough to begin a search
from, and nothing that is reported rests on it.
"""

import contextlib
from collections.abc import Mapping, Sequence
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
from models.plant import LinearPlant, ShapingFilter

from ..loop import Disturbance, LinearController


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

    Raises SolverError if R is singular (an input is free of charge) or no feedback stabilises the
    plant.
    """
    found = solve_riccati(plant.A, plant.B, Q, R, S)
    return LqgRegulator(gain=found.gain, R=R, X=found.X)


def estimator(plant: LinearPlant, W: FloatArray, V: FloatArray, U: FloatArray) -> LqgEstimator:
    """Return the filter for noises of intensity W on x', V on y, and U between the two.

    Raises SolverError if V is singular (a measurement has no noise) or no filter is stable.
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
        Shaken by white noises of intensity 1 (`whitened`).
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


def whitened(plant: LinearPlant, disturbances: Sequence[Disturbance]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake about as the disturbances do.

    A spectrum that is not white becomes that of an oscillator with the same peak frequency,
    peak density and variance (three numbers, for a starting point); its two states are the
    disturbance and its rate.  A white noise whose rate acts too has no finite variance and
    keeps the rate out.
    """
    sources = {
        d.name: np.pi * float(d.density(np.ones(1))[0]) if _is_white(d) else _oscillator(d)
        for d in disturbances
    }
    return shaped(plant, sources)


def shaped(plant: LinearPlant, sources: Mapping[str, ShapingFilter | float]) -> LinearPlant:
    """Return a plant that white noises of intensity 1 shake as the sources do.

    The plant has no delays.  A source is, by name of a disturbance, a filter, or the intensity of
    white noise; disturbances that are not named rest.  A white noise whose rate acts too has no
    finite variance and keeps the rate out.
    """
    n, count = len(plant.states), len(sources)
    extra = sum(s.order for s in sources.values() if isinstance(s, ShapingFilter))
    A = np.zeros((n + extra, n + extra))
    A[:n, :n] = plant.A
    E, F = np.zeros((n + extra, count)), np.zeros((len(plant.measurements), count))
    Fz = np.zeros((len(plant.outputs), count))
    C, Cz = (np.hstack([m, np.zeros((len(m), extra))]) for m in (plant.C, plant.Cz))
    at = n
    for k, (name, source) in enumerate(sources.items()):
        base = plant.disturbances.index(name)
        rates = [plant.disturbances.index(r) for r, of in plant.rates.items() if of == name]
        if not isinstance(source, ShapingFilter):
            root = np.sqrt(source)
            E[:n, k], F[:, k] = root * plant.E[:, base], root * plant.F[:, base]
            Fz[:, k] = root * plant.Fz[:, base]
            continue
        states = slice(at, at + source.order)
        A[states, states], E[states, k] = source.A, source.B[:, 0]
        row, rate = source.C[0], (source.C @ source.A)[0]
        for target, columns in ((A[:n], plant.E), (C, plant.F), (Cz, plant.Fz)):
            target[:, states] += np.outer(columns[:, base], row)
            for r in rates:
                target[:, states] += np.outer(columns[:, r], rate)
        at += source.order
    return LinearPlant(
        A=A,
        B=np.vstack([plant.B, np.zeros((extra, len(plant.inputs)))]),
        E=E,
        C=C,
        D=plant.D,
        F=F,
        Cz=Cz,
        Dz=plant.Dz,
        Fz=Fz,
        inputs=plant.inputs,
        disturbances=tuple(sources),
        measurements=plant.measurements,
        outputs=plant.outputs,
    )


def _is_white(disturbance: Disturbance) -> bool:
    if disturbance.band is not None:
        return False
    density = disturbance.density(np.geomspace(1e-3, 1e3, 7))
    return bool(np.all(density == density[0]))


def _oscillator(disturbance: Disturbance) -> ShapingFilter:
    """Return an oscillator with the peak frequency, peak density and variance of a spectrum."""
    low, high = disturbance.band or (1e-3, 1e3)
    omega = np.geomspace(max(low, 1e-4 * high), high, 400)
    density = disturbance.density(omega)
    k = int(np.argmax(density))
    variance, peak = float(np.trapezoid(density, omega)), float(omega[k])
    # An oscillator's density at resonance is m0 / (pi damping peak).
    damping = variance / (np.pi * omega[k] * max(float(density[k]), 1e-300))
    damping = float(np.clip(damping, 0.01, 2.0))
    return ShapingFilter(
        A=np.array([[0.0, 1.0], [-(peak**2), -2.0 * damping * peak]]),
        B=np.array([[0.0], [np.sqrt(4.0 * damping * peak**3) * np.sqrt(variance)]]),
        C=np.array([[1.0, 0.0]]),
        variance_error=0.0,
        shape_error=np.nan,
    )
