r"""Gain and covariance of a Kalman filter, for measurements with white errors.

    x+ = A x + noise of covariance Q,    y = C x + errors of variances R

Every measurement is taken in units of its own error, since a state of radians, metres and newtons
and sensors of any precision would leave nothing of a common scale.
"""

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, solve_discrete_riccati


def prediction_covariance(
    A: FloatArray, C: FloatArray, G: FloatArray, R: FloatArray, scale: FloatArray
) -> FloatArray:
    """Return the covariance of the steady one-step prediction, (n, n).

    Its process has noise G n, n white and of variance one; R are the variances of the errors of its
    outputs.  For the numerics `scale` is the size of each state, (n,).

    Raises SolverError if there is none.
    """
    # Each state in its own size, each measurement in units of its own error.
    P = solve_discrete_riccati(
        A / scale[:, None] * scale,
        C * scale / np.sqrt(R)[:, None],
        (G / scale[:, None]) @ (G / scale[:, None]).T,
    )
    return np.asarray(P * np.outer(scale, scale))


def kalman_gain(
    C: FloatArray, R: FloatArray, P: FloatArray, there: npt.NDArray[np.bool_] | None = None
) -> FloatArray:
    """Return the gain of the measurements that are there, (n, ny); zero columns of the others.

    Their rows C are (ny, n), variances R (ny,), the prediction's covariance P (n, n); `there` is
    (ny,), all by default.
    """
    gain = np.zeros((len(P), len(R)))
    there = np.ones(len(R), dtype=np.bool_) if there is None else there
    if there.any():
        error = np.sqrt(R[there])
        scaled = C[there] / error[:, None]
        innovation = scaled @ P @ scaled.T + np.eye(len(scaled))
        gain[:, there] = np.linalg.solve(innovation, scaled @ P).T / error
    return gain


def corrected(P: FloatArray, C: FloatArray, R: FloatArray, gain: FloatArray) -> FloatArray:
    """Return the covariance of an estimate after measurements.

    In Joseph's form, which stays positive whatever the gain, and is right for any gain.
    """
    kept = np.eye(len(P)) - gain @ C
    return np.asarray(kept @ P @ kept.T + (gain * R) @ gain.T)


def end_of_record(
    A: FloatArray, C: FloatArray, Q: FloatArray, R: FloatArray, P: FloatArray, steps: int
) -> tuple[FloatArray, FloatArray]:
    """Return the state at the end of a record as a linear function of record and first estimate.

    The conditional mean of the state after outputs at samples 0 .. N are known.  They are (n, ny (N
    + 1)) and (n, n), for N steps and the first estimate's covariance P (n, n).  R are the variances
    of the outputs' errors.
    """
    n, ny = len(A), len(C)
    record, estimate = np.zeros((n, ny * (steps + 1))), np.eye(n)
    for j in range(steps + 1):
        if j > 0:
            record, estimate, P = A @ record, A @ estimate, A @ P @ A.T + Q
        gain = np.asarray(np.linalg.solve(C @ P @ C.T + np.diag(R), C @ P).T, dtype=np.float64)
        kept = np.eye(n) - gain @ C
        record, estimate = kept @ record, kept @ estimate
        record[:, ny * j : ny * (j + 1)] += gain
        P = corrected(P, C, R, gain)
    return record, estimate
