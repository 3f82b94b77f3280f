r"""Regression with forgetting of what came on what was shown before it, for `AdaptiveAR`.

Regressors are pairs of heave and heave rate (times the spacing, so that both are lengths) at
coarse lags a spacing apart and at a few recent ones.  Knots of the forecast are 0, half and one
spacing ahead, regressed directly on the record smoothed around them, and whole spacings beyond,
where the regression on the coarse lags is iterated,

.. math::

    y_{t+1} = \sum_{i=0}^{p-1} A_i\, y_{t-i} + \varepsilon, \qquad
    \Psi_j = \sum_{i=0}^{p-1} A_i\, \Psi_{j-1-i}, \quad \Psi_0 = 1, \qquad
    \operatorname{cov}(y_{t+j} - \hat y_{t+j}) = \sum_{i<j} \Psi_i \Sigma \Psi_i^T

(Luetkepohl, *New Introduction to Multiple Time Series Analysis*, 2005, sec. 2.2 and 3.5).  The sums
of products are kept, not their inverse: they are bounded by the data, so that neither a calm
nor a constant signal can blow them up, as happens to a covariance with forgetting.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from models.basics import FloatArray, read_only

IndexArray = npt.NDArray[np.int64]

_RECENT = (0.1, 0.2, 0.35, 0.5)  # spacings ago: what averages the noise of the newest sample
_SMOOTHED = 0.6  # [s] before and after a target, over which a quartic is fitted
_RATE_WEIGHT = 0.1  # [s] of the rate against the heave in that fit: its noise is the larger
_RIDGE = 1e-7  # of the mean diagonal: as if the unit had noise of 0.03 % of the motion
_DIRECT = 6  # heave and rate at the three knots that are regressed directly
_LEAST_SAMPLES, _SAMPLES_PER_LAG = 24.0, 5.0  # a spacing apart, for a model and for its order
_BELIEF = 20.0  # errors of real forecasts that the model's own variances count as
_SOONER = 1.0 / 3.0  # of the memory: a new sea shows in the errors before it is learnt


class KnotRegression:
    """Forgetful regression of knots ahead on a record, and how good its forecasts were.

    Parameters
    ----------
    sample_time
        Time between the record's rows [s].
    spacing
        Spacing in rows.
    order
        Number of coarse lags.
    steps
        Spacings that the knots reach ahead, at least 2.
    every
        Rows from one `learn` to the next.
    memory
        Time constant of the forgetting [s].

    Attributes
    ----------
    lags
        Rows ago of the regressors, the coarse ones first (l,).
    knots
        Times of the knots ahead [s], (k,).
    span
        Rows that a regression touches.
    model
        Knots, heave and rate times the spacing in turn, from the regressors (2k, 2l); None
        while there is none.
    variance
        Of heave and of rate times the spacing about the knots [m2], (k, 2).
    noise
        Part of the unit's error that smoothing takes away, variances [m2], (2,).
    """

    def __init__(
        self,
        *,
        sample_time: float,
        spacing: int,
        order: int,
        steps: int,
        every: int,
        memory: float,
    ) -> None:
        q, self._p, self._steps = spacing, order, steps
        recent = sorted({max(1, round(share * q)) for share in _RECENT})
        self.lags: IndexArray = np.concatenate((q * np.arange(order), recent)).astype(np.int64)
        self._n = 2 * self.lags.size
        self._q, self._half = q, max(2, round(_SMOOTHED / sample_time))
        self.span = int(self.lags.max()) + q + 2 * self._half + 1
        width = q * sample_time
        self.knots = read_only(
            np.concatenate(((0.0, q // 2 * sample_time), width * np.arange(1, steps + 1)))
        )
        self._smooth = smoother(np.array((0, q // 2, q)), self._half, sample_time, width)
        self._one = self._smooth[:2, : 2 * (2 * self._half + 1)]
        self._forget = math.exp(-every * sample_time / memory)
        self._per_spacing = every / q
        self._forget_error = math.exp(-width / (_SOONER * memory))
        # Spacings until a smoothed value is known, and the knots a whole number of them ahead.
        self._wait = -(-self._half // q)
        self._whole = np.concatenate(((0,), np.arange(2, steps + 2)))
        self._ago = self._wait + np.arange(steps + 1)
        self.reset()

    @property
    def samples(self) -> float:
        """Number of samples, a spacing apart, that the sums hold, the old ones less."""
        return self._counts[0] ** 2 / max(self._counts[1], 1e-9) * self._per_spacing

    def reset(self) -> None:
        """Forget everything."""
        size = self._n + _DIRECT
        self._gram = np.zeros((size, size))
        self._counts = (0.0, 0.0)  # sums of the weights and of their squares
        self.model: FloatArray | None = None
        self.variance = np.zeros((self.knots.size, 2))
        self.noise = np.zeros(2)
        self._made = np.full((int(self._ago[-1]) + 1, self.knots.size, 2), np.nan)
        self._turn = 0
        self._errors = np.zeros((self._whole.size, 2))
        self._error_weights = np.zeros(self._whole.size)

    def learn(self, record: FloatArray, row: int) -> None:
        """Add the newest regression whose targets are known; `row` is the newest row."""
        now = row - self._q - self._half
        seen = record[now - self.lags].ravel()
        both = np.concatenate((seen, self._smooth @ record[now - self._half : row + 1].ravel()))
        self._gram *= self._forget
        self._gram += np.outer(both, both)
        one, two = self._counts
        self._counts = (self._forget * one + 1.0, self._forget**2 * two + 1.0)

    def judge(self, record: FloatArray, row: int, clean: bool) -> None:
        """Compare what was forecast with what has come; call it once a spacing.

        A record that is not `clean` holds a gap: its forecasts are not judged.
        """
        self._turn = (self._turn + 1) % len(self._made)
        if self.model is None or not clean:
            self._made[self._turn] = np.nan
            return
        self._made[self._turn] = (self.model @ record[row - self.lags].ravel()).reshape(-1, 2)
        centre = row - self._wait * self._q
        come = self._one @ record[centre - self._half : centre + self._half + 1].ravel()
        made = self._made[(self._turn - self._ago) % len(self._made), self._whole]
        square = (come - made) ** 2
        known = np.isfinite(square[:, 0])
        weights = self._forget_error * self._error_weights + 1.0
        self._errors[known] += (square[known] - self._errors[known]) / weights[known, None]
        self._error_weights[known] = weights[known]

    def fit(self, power: FloatArray) -> Iterator[None]:
        """Solve for a new model, a part of the work at each turn of the iterator.

        Parameters
        ----------
        power
            Mean squares of the record [m2], (2,): no forecast's variance is larger.
        """
        n, N = self._n, self.samples
        if N < _LEAST_SAMPLES:
            return
        p = min(self._p, int(N / _SAMPLES_PER_LAG))
        used = np.concatenate((np.arange(2 * p), np.arange(2 * self._p, n)))
        gram = self._gram / self._counts[0]
        R, S, T = gram[np.ix_(used, used)], gram[used, n:], gram[n:, n:]
        R.flat[:: len(R) + 1] += _RIDGE * np.trace(R) / len(R)
        noise = np.diag(gram)[:2] - 2.0 * gram[(0, 1), (n, n + 1)] + np.diag(T)[:2]
        noise = np.maximum(noise, 0.0)
        yield
        _, direct, failed = lapack.dposv(R, S)
        _, A, failed_too = lapack.dposv(R[: 2 * p, : 2 * p], S[: 2 * p, -2:])
        if failed or failed_too:
            self.model = None
            return
        yield
        # Residuals are too small in the fit, and forecasts too bad, by the coefficients each.
        lost = min(used.size / N, 0.8)
        wider = (1.0 + lost) / (1.0 - lost)
        left = wider * (T - direct.T @ S)
        about = wider * (T[-2:, -2:] - A.T @ S[: 2 * p, -2:]) + np.diag(noise)
        model = np.zeros((2 * self.knots.size, n))
        model[:_DIRECT, used] = direct.T
        variance = np.empty((self.knots.size, 2))
        variance[:3] = np.diag(left).reshape(3, 2)
        yield
        with np.errstate(over="ignore", invalid="ignore"):
            first = left[-2:, -2:] + np.diag(noise)
            yield from self._iterate(A.T, model, variance, first, about, noise)
            self._finish(model, variance, np.maximum(power - noise, 0.0), noise)

    def _iterate(
        self,
        A: FloatArray,
        model: FloatArray,
        variance: FloatArray,
        first: FloatArray,
        about: FloatArray,
        noise: FloatArray,
    ) -> Iterator[None]:
        """Fill the knots beyond the first spacing, one a turn, given those up to it.

        A is (2, 2p); `first` and `about` are the covariances of what is shown about its
        forecast for the first spacing and about the iterated regression.
        """
        steps, reach = self._steps, A.shape[1]
        # Newest first, so that a step reads one stretch: steps .. 1, then the record.
        rows, psi = np.zeros((2 * steps + reach, self._n)), np.zeros((2 * steps + reach, 2))
        rows[2 * steps :, :reach] = np.eye(reach)
        rows[2 * steps - 2 : 2 * steps] = model[_DIRECT - 2 : _DIRECT]
        psi[2 * steps - 2 : 2 * steps] = np.eye(2)  # that of the first spacing's innovation
        later = np.zeros((2, 2))  # what the innovations after the first spacing have added
        for j in range(2, steps + 1):
            at = 2 * (steps - j)
            now, before = slice(at, at + 2), slice(at + 2, at + 2 + reach)
            rows[now], psi[now] = A @ rows[before], A @ psi[before]
            weight = psi[at + 2 : at + 4]
            later = later + weight @ about @ weight.T
            variance[j + 1] = np.diag(psi[now] @ first @ psi[now].T + later) - noise
            model[2 * (j + 1) : 2 * (j + 2)] = rows[now]
            yield

    def _finish(
        self, model: FloatArray, variance: FloatArray, most: FloatArray, noise: FloatArray
    ) -> None:
        """Weigh the variances with the errors made, and take the model."""
        weights = self._error_weights[:, None]
        belief = variance[self._whole]
        blend = (_BELIEF * belief + weights * self._errors) / (_BELIEF + weights)
        variance[self._whole] = blend
        variance[1] *= blend[1] / np.maximum(belief[1], 1e-300)
        # What is worse than saying nothing is drawn towards nothing.
        model *= np.minimum(1.0, most / np.maximum(variance, 1e-300)).reshape(-1, 1)
        if not np.all(np.isfinite(model)):
            self.model = None
            return
        self.model, self.noise = model, noise
        self.variance = np.clip(variance, 0.0, most)


def smoother(at: npt.NDArray[np.int64], half: int, step: float, spacing: float) -> FloatArray:
    """Return the matrix from a stretch of the record to its smoothed knots.

    A quartic is fitted by least squares to heave and rate of the samples from `half` before to
    `half` after each knot.

    Parameters
    ----------
    at
        Knots in samples from the first (k,).
    half
        Samples on either side.
    step, spacing
        Sample time, and what the record's rates are multiplied with [s].

    Returns
    -------
    ndarray
        (2k, 2m) for the m samples from `half` before the first knot to `half` after the last.
    """
    t = step * np.arange(-half, half + 1)
    powers = np.arange(5)
    value = t[:, None] ** powers
    slope = powers * t[:, None] ** np.maximum(powers - 1, 0)
    design = np.stack((value, _RATE_WEIGHT * slope), axis=1).reshape(-1, 5)
    fit = np.linalg.pinv(design)[:2].copy()
    fit[:, 1::2] *= _RATE_WEIGHT / spacing
    fit[1] *= spacing
    rows = np.zeros((2 * at.size, 2 * (int(at[-1]) + 2 * half + 1)))
    for i, knot in enumerate(at.tolist()):
        rows[2 * i : 2 * i + 2, 2 * knot : 2 * knot + fit.shape[1]] = fit
    return read_only(rows)
