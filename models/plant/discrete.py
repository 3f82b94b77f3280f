"""Exact sampling of a linear system: inputs that are held, motions that are cubic, white noise.

Each is one matrix exponential of the system with what drives it behind it (C. Van Loan, "Computing
integrals involving the matrix exponential", IEEE TAC 23, 1978).
"""

import math

import numpy as np
import scipy.linalg

from ..basics import FloatArray

_ROUNDING = 1e-9  # of a sample


def zero_order_hold(A: FloatArray, B: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return (exp(A dt), integral of exp(A t) dt B over one sample of dt [s]), A (n, n), B (n, m).

    By one matrix exponential of the augmented matrix, C. Van Loan, "Computing integrals
    involving the matrix exponential", IEEE TAC 23 (1978), so that a singular A (a drum that
    integrates) needs no special case.
    """
    n, m = B.shape
    augmented = np.zeros((n + m, n + m))
    augmented[:n, :n] = A
    augmented[:n, n:] = B
    exponential = scipy.linalg.expm(augmented * dt)
    return exponential[:n, :n], exponential[:n, n:]


def late_hold(samples: float) -> tuple[int, float]:
    """Return how many held inputs are on their way, and how long the oldest acts [samples].

    Of inputs that are late by so many samples.  Rounding of a multiple of the sample time is none.
    """
    count = math.ceil(samples - _ROUNDING)
    return count, min(1.0, samples - count + 1.0)


def hermite_hold(
    A: FloatArray, E: FloatArray, dt: float, at: float
) -> tuple[FloatArray, FloatArray]:
    """Return what a motion that is cubic over a sample has done to x at a time, and is there.

    x' = A x + E [z, z'], with z the cubic through (z0, z0') and (z1, z1'); the columns of both
    results, (n, 4) and (2, 4) for z and z', belong to z0, z0', z1, z1'.  A is (n, n) [1/s], E (n,
    2); the time `at` is that since the sample's start [s].
    """
    n, T = len(A), dt
    chain = np.zeros((n + 4, n + 4))
    chain[:n, :n] = A
    chain[:n, n : n + 2] = E
    chain[n, n + 1] = chain[n + 1, n + 2] = chain[n + 2, n + 3] = 1.0
    # second and third derivative of the cubic at its start, from the values at its ends
    ends = np.array(
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [-6.0 / T**2, -4.0 / T, 6.0 / T**2, -2.0 / T],
            [12.0 / T**3, 6.0 / T**2, -12.0 / T**3, 6.0 / T**2],
        ]
    )
    moved = scipy.linalg.expm(chain * at)[:, n:] @ ends
    return np.asarray(moved[:n]), np.asarray(moved[n : n + 2])


def noisy_hold(A: FloatArray, B: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return (exp(A dt), covariance of what white noise of intensity one adds over dt [s]).

    It is that of x' = A x + B n, (n, n), (n, m).
    """
    n = len(A)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -A, B @ B.T, A.T
    exponential = scipy.linalg.expm(block * dt)
    over = exponential[n:, n:].T
    added = over @ exponential[:n, n:]
    return over, 0.5 * (added + added.T)


def root_of(covariance: FloatArray) -> FloatArray:
    """Return a root M of a covariance M M', without the directions that hold nothing."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 1e-14 * max(float(values[-1]), 1e-300)
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))
