r"""Gain and covariance of a Kalman filter, for measurements with white errors.

    x+ = A x + noise of covariance Q,    y = C x + errors of variances R

Every measurement is taken in units of its own error, since a state of radians, metres and newtons
and sensors of any precision would leave nothing of a common scale.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpotrf, dtrtri

from models.basics import FloatArray, solve_discrete_riccati

_SETTLED = 1e-5  # of a state's variance, that the steady gain in place of the right one may add
_CERTAIN = 1e-12  # of the square of a state's size: a variance below which it is as good as known
_LOOKED = 16  # samples from one look at that to the next


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


class ChangingGains:
    """Gains of a Kalman filter whose signals come and go.

    The gain that is right for all signals together may let a filter run away that hears some of
    them only.  Each set of signals has a steady gain; where the set changes, the covariance is
    carried from sample to sample with what is there, until it is the steady one.

    Parameters
    ----------
    A, C, Q, R
        The process and its outputs: (n, n), (ny, n), the covariance (n, n) of what a sample adds,
        and the variances (ny,) of the outputs' errors.
    steady
        Of each set of signals that has one, by the signals that are there as bytes of (ny,)
        booleans: what a sample adds with them, (n, n), and the covariance of the steady one-step
        prediction, (n, n), None if it has none.
    scale
        Size of each state, (n,), for the numerics.
    """

    def __init__(
        self,
        A: FloatArray,
        C: FloatArray,
        Q: FloatArray,
        R: FloatArray,
        steady: Mapping[bytes, tuple[FloatArray, FloatArray | None]],
        scale: FloatArray,
    ) -> None:
        # Each state in its own size, each output in units of its own error.
        self._A = np.ascontiguousarray(A / scale[:, None] * scale)
        self._unit = scale / np.sqrt(R)[:, None]
        self._C = np.ascontiguousarray(C * self._unit)
        self._Q = Q / np.outer(scale, scale)
        self._back = scale[:, None] / np.sqrt(R)
        self._outer = np.outer(scale, scale)
        self._R, self._eye = R, np.eye(len(R))
        self._added, self._steady = {}, {}
        for there, (added, P) in steady.items():
            self._added[there] = added / self._outer
            if P is not None:
                P = P / self._outer
                gain = kalman_gain(self._C, np.ones(len(R)), P, np.frombuffer(there, np.bool_))
                self._steady[there] = P, gain
        self.begin(Q)

    def begin(self, P: FloatArray) -> None:
        """Begin with the covariance of a prediction, (n, n)."""
        self._P = P / self._outer
        self._there = b""
        self._held: FloatArray | None = None
        self._seen: FloatArray | None = None
        self._spread: FloatArray | None = None
        self._samples = 0

    def steady(self, there: npt.NDArray[np.bool_]) -> FloatArray | None:
        """Return the steady gain of a set of signals, (n, ny); None if it has none."""
        found = self._steady.get(there.tobytes())
        return None if found is None else np.asarray(found[1] * self._back)

    @property
    def covariance(self) -> FloatArray:
        """The covariance of the prediction for the next sample, (n, n)."""
        return np.asarray(self._P * self._outer)

    @property
    def innovations(self) -> FloatArray:
        """Variances of what the outputs of the next sample are off their predictions by, (ny,)."""
        if self._spread is None:
            seen = self._seen = self._C @ self._P
            self._spread = self._R * (1.0 + np.einsum("ij,ij->i", seen, self._C))
        return self._spread

    def at(self, there: npt.NDArray[np.bool_], C: FloatArray | None = None) -> FloatArray:
        """Return the gain of a sample at which some signals are there, (n, ny), and go on.

        Where they tell of something else than usual, C (ny, n) says of what.
        """
        key = there.tobytes() if C is None else b""
        if key != self._there:
            self._there, self._held = key, None
            self._samples = 0
        if self._held is not None:
            return self._held
        P, seen = self._P, self._seen
        rows = self._C if C is None else C * self._unit
        if seen is None or C is not None:
            seen = rows @ P
        # What is not there tells nothing: a row of zeros, and so a column of the gain.
        seen = seen * there[:, None]
        root = dtrtri(dpotrf(seen @ rows.T * there + self._eye, lower=1)[0], lower=1)[0]
        told = root @ seen
        gain = told.T @ root
        self._seen = self._spread = None
        self._samples += 1
        if self._samples % _LOOKED == 0:
            P = 0.5 * (P + P.T)
            if key in self._steady:
                steady, held = self._steady[key]
                off = gain - held
                added = np.sum((off @ rows @ P) * (off @ rows), axis=1) + np.sum(off * off, axis=1)
                if np.all(added <= _SETTLED * np.maximum(np.diag(P), _CERTAIN)):
                    self._P = steady
                    self._held = np.asarray(held * self._back)
                    return self._held
        self._P = self._A @ (P - told.T @ told) @ self._A.T
        self._P += self._added.get(key, self._Q)
        return np.asarray(gain * self._back)


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
