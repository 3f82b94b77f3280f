r"""Gain and covariance of a Kalman filter, for measurements with white errors.

    x+ = A x + noise of covariance Q,    y = C x + errors of variances R

Every measurement is taken in units of its own error, since a state of radians, metres and newtons
and sensors of any precision would leave nothing of a common scale.
"""

from collections.abc import Mapping
from contextlib import suppress

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpotrf, dtrtri

from models.basics import FloatArray, SolverError, solve_discrete_riccati

Mask = npt.NDArray[np.bool_]

_SETTLED = 1e-5  # of a state's variance, that the steady gain in place of the right one may add
_LOST = 1e12  # times the variance at the start
_LOOKED = 16  # samples from one look at that to the next


def known(P: FloatArray) -> FloatArray:
    """Return the standard deviations of a covariance, (n,), one where there is none.

    Rounding may leave what is certain a variance a hair below zero.
    """
    variances = np.diag(P)
    return np.sqrt(np.where(variances > 0.0, variances, 1.0))


def prediction_covariance(
    A: FloatArray, C: FloatArray, G: FloatArray, R: FloatArray, scale: FloatArray
) -> FloatArray:
    """Return the covariance of the steady one-step prediction, (n, n).

    Its process has noise G n, n white and of variance one; R are the variances of the errors of its
    outputs.  For the numerics `scale` is the size of each state, (n,).

    Raises SolverError if there is none.
    """
    # Some states are known to a fiftieth of their size and less: in units of what they are known
    # to, the equation is solved an order of magnitude closer, and what no noise reaches is certain.
    for _ in range(2):
        # Each state in its own size, each measurement in units of its own error.
        P = solve_discrete_riccati(
            A / scale[:, None] * scale,
            C * scale / np.sqrt(R)[:, None],
            (G / scale[:, None]) @ (G / scale[:, None]).T,
        ) * np.outer(scale, scale)
        scale = known(P)
    return np.asarray(P)


def kalman_gain(
    C: FloatArray, R: FloatArray, P: FloatArray, there: Mask | None = None
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


class SampledFilter:
    r"""The filter of a sampled model, in matrices, whose signals come and go.

        x+ = A x + what is known + G n,    y = C x + v,    n: white, covariance one

    The gain that is right for all signals together may let a filter run away that hears some of
    them only.  Each set of signals has a steady gain; where the set changes, the covariance is
    carried from sample to sample with what is there, until it is the steady one.  While the gains
    reckon with less noise than G, for the sake of what must not be told by what is left, so does
    that covariance: what the estimate is off by is carried beside it, and taken up again with the
    next other signal.

    Parameters
    ----------
    A, C, G, R
        The model as the gains reckon with it: (n, n), (ny, n), (n, ng), and the variances of v,
        (ny,).
    P
        Covariance of the prediction that it begins with, (n, n).
    sets
        Noise as G, of each set of signals that is to be held at its steady gain, if it has one, by
        the signals that are there as bytes of (ny,) booleans.

    Attributes
    ----------
    state
        The estimate, (n,).
    unheard
        For how many samples each signal was not believed, (ny,).
    """

    def __init__(
        self,
        A: FloatArray,
        C: FloatArray,
        G: FloatArray,
        R: FloatArray,
        P: FloatArray,
        sets: Mapping[bytes, FloatArray],
    ) -> None:
        # Each state in units of what it is known to, each output in units of its own error.
        scale = known(P)
        self._A = np.ascontiguousarray(A / scale[:, None] * scale)
        self._half = 0.5 * self._A
        self._unit = scale / np.sqrt(R)[:, None]
        self._C = np.ascontiguousarray(C * self._unit)
        self._back = scale[:, None] / np.sqrt(R)
        self._outer = np.outer(scale, scale)
        self._Q, self._P0 = G @ G.T / self._outer, P / self._outer
        self._R, self._eye = R, np.eye(len(R))
        self._start = self._P0
        self._first: list[FloatArray] = []
        self._added: dict[bytes, FloatArray] = {}
        self._calmer: set[bytes] = set()  # sets whose gains reckon with less noise than there is
        self._steady: dict[bytes, tuple[FloatArray, FloatArray]] = {}
        for key, own in sets.items():
            there = np.frombuffer(key, np.bool_)
            self._added[key] = own @ own.T / self._outer
            if not np.array_equal(self._added[key], self._Q):
                self._calmer.add(key)
            with suppress(SolverError):
                P = prediction_covariance(A, C[there], own, R[there], scale) / self._outer
                self._steady[key] = P, kalman_gain(self._C, np.ones(len(R)), P, there)
        self.reset()

    def begin_with(self, P: FloatArray, samples: int) -> None:
        """Take a covariance (n, n) as that of the first prediction, and hold what follows from it.

        For so many samples the gains with all signals are made beforehand; as soon as one of the
        signals is missing among them, the covariance is carried on from what it is by then.
        """
        self._start = self._P = P / self._outer
        everything = np.ones(len(self._R), dtype=np.bool_)
        self._first = [self.at(everything) for _ in range(samples)]
        self.reset()

    def reset(self) -> None:
        """Forget everything: all is at rest."""
        self.state = np.zeros(len(self._P0))
        self.unheard = np.zeros(len(self._C), dtype=np.int64)
        self._heard = 0  # samples with gains made beforehand
        self._begin()

    def _begin(self) -> None:
        """Begin with the covariance anew."""
        self._P = self._P0
        self._there = b""
        self._held: FloatArray | None = None
        self._seen: FloatArray | None = None
        self._spread: FloatArray | None = None
        self._off: FloatArray | None = None  # what the estimate is off by, where P is not that
        self._onward: FloatArray | None = None  # A (I - K C) and A K of a gain that is held
        self._samples = 0

    def correct(
        self, ahead: FloatArray, error: FloatArray, there: Mask, C: FloatArray | None = None
    ) -> FloatArray:
        """Return the estimate of a sample, (n,), from its prediction, (n,).

        What is shown less what was expected, and which signals are to be believed, (ny,).  Where
        they tell of something else than usual, C (ny, n) says of what.
        """
        self.unheard = np.where(there, 0, self.unheard + 1)
        if self._heard < len(self._first) and not there.all():
            # What they hold of the constants would be lost on a steady gain: the covariance of now,
            # which has not been kept for each of them.
            everything, heard = np.ones_like(there), self._heard
            self._begin()
            self._P, self._heard = self._start, len(self._first)
            for _ in range(heard):
                self.at(everything)
        if self._heard < len(self._first):
            gain = self._first[self._heard]
            self._heard += 1
        else:
            gain = self.at(there, C)
        self.state = ahead + gain @ np.where(there, error, 0.0)
        if not np.isfinite(self.state).all():
            self.reset()
        return self.state

    def steady(self, there: Mask) -> FloatArray | None:
        """Return the steady gain of a set of signals, (n, ny); None if it has none."""
        found = self._steady.get(there.tobytes())
        return None if found is None else np.asarray(found[1] * self._back)

    @property
    def innovations(self) -> FloatArray:
        """Variances of what the outputs of the next sample are off their predictions by, (ny,)."""
        if self._spread is None:
            seen = self._C @ (self._P if self._off is None else self._off)
            self._seen = seen if self._off is None else None
            self._spread = self._R * (1.0 + np.einsum("ij,ij->i", seen, self._C))
        return self._spread

    def at(self, there: Mask, C: FloatArray | None = None) -> FloatArray:
        """Return the gain of a sample at which some signals are there, (n, ny), and go on.

        Where they tell of something else than usual, C (ny, n) says of what.
        """
        key = there.tobytes() if C is None else b""
        if key != self._there:
            self._there, self._held, self._onward = key, None, None
            self._samples = 0
            if key in self._calmer:
                self._off = self._P if self._off is None else self._off
            elif self._off is not None:
                self._P, self._off, self._seen = self._off, None, None
        if self._held is not None:
            if self._off is not None:
                self._carry(self._held / self._back)
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
        if self._off is not None:
            self._carry(gain)
        self._seen = self._spread = None
        self._samples += 1
        if self._samples % _LOOKED == 0 and key in self._steady:
            steady, held = self._steady[key]
            off = gain - held
            across = off @ rows
            added = np.sum((across @ P) * across, axis=1) + np.sum(off * off, axis=1)
            if np.all(added <= _SETTLED * np.diag(P)):
                self._P = steady
                self._held, self._onward = np.asarray(held * self._back), None
                return self._held
        half = self._half @ (P - told.T @ told) @ self._A.T
        self._P = half + half.T  # what is not symmetric an unstable plant would blow up
        self._P += self._added.get(key, self._Q)
        # What has not been heard of for so long that nothing is known of it is begun anew.
        if not self._P.diagonal().max() <= _LOST:
            self._begin()
        return np.asarray(gain * self._back)

    def _carry(self, gain: FloatArray) -> None:
        """Carry what the estimate is off by over a sample with a gain that is not made for it."""
        assert self._off is not None
        if self._onward is None or self._held is None:
            across = self._A @ gain
            self._onward = np.hstack([self._A - across @ self._C, across])
        kept, across = np.hsplit(self._onward, [len(gain)])
        half = 0.5 * (kept @ self._off @ kept.T + across @ across.T + self._Q)
        self._off, self._spread = half + half.T, None


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
