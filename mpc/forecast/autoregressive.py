r"""Autoregression fitted on line to the record alone, as a predictor: `AdaptiveAR`.

No spectrum, no vessel, no model of the unit: what was shown over the last half minute is
regressed on what came after it.  It adapts as the sea changes, and it is what a user without
a known sea gets.

The regression works on samples `spacing` apart, about one second, with heave and heave rate at
each: two numbers a second carry all that waves have (a value and a slope every second resolve
up to 2 pi rad/s), reach back far enough with few coefficients, and are well conditioned, which
neighbours at 50 ms are not.  A few samples closer to the present average the noise.  Three knots
ahead, at 0, half and one spacing, are regressed directly; the first of them filters what the unit
shows.  Their target is the record smoothed over 1.2 s, which is known a little later.  From one
spacing on the regression is iterated.  Between the knots the forecast is the cubic that has their
displacements and velocities.

The normal equations (`KnotRegression`) are kept with exponential forgetting, and solved with a
ridge once a spacing, one part of the work a sample.

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

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import lapack

from models.basics import FloatArray, check_range, read_only

from .forecast import Forecast, leads_of

_TRAIN_EVERY = 0.2  # [s] between two regressions
_FADING = 1.0  # [s] in which a forecast fades before there is a model
_BRIDGED = 0.5  # [s]: longer gaps are not learnt from
_LARGEST = 1e3  # [m], [m/s]: what is larger is no measurement
_WORKED_OFF = 4  # samples of a gap that one new sample makes up for
_DONE: Final = object()

IndexArray = npt.NDArray[np.int64]

_RECENT = (0.1, 0.2, 0.35, 0.5)  # spacings ago: what averages the noise of the newest sample
_SMOOTHED = 0.6  # [s] before and after a target, over which a quartic is fitted
_RATE_WEIGHT = 0.1  # [s] of the rate against the heave in that fit: its noise is the larger
_RIDGE = 1e-7  # of the mean diagonal: as if the unit had noise of 0.03 % of the motion
_DIRECT = 6  # heave and rate at the three knots that are regressed directly
_LEAST_SAMPLES, _SAMPLES_PER_LAG = 24.0, 5.0  # a spacing apart, for a model and for its order
_BELIEF = 20.0  # errors of real forecasts that the model's own variances count as
_SOONER = 1.0 / 3.0  # of the memory: a new sea shows in the errors before it is learnt


class AdaptiveAR:
    """Vector autoregression of heave and heave rate with forgetting.

    Parameters
    ----------
    sample_time
        Time between samples and between leads [s].
    horizon
        Last lead [s].
    order
        Number of samples, `spacing` apart, that the regression reaches back.
    spacing
        Their distance [s], rounded to samples; at least four samples.
    memory
        Time constant of the forgetting [s]; at least as long as the regression reaches back.
    delay
        Delay of the unit [s]; 0 if it is not known: then the forecast is late by it.
    error
        Standard deviation of the unit's error in the waves' own band [m], from its data sheet:
        the record does not know it.  No standard deviation is stated below it, or for the
        velocity below it times the record's mean frequency.

    Raises
    ------
    InputError
        If a number is out of its range.

    Notes
    -----
    Standard deviations: those of the direct knots come from the regression's residuals,
    corrected for the number of coefficients; beyond, the innovations' covariance is carried
    through the model's impulse response (psi weights).  The part of the unit's error that the
    smoothing takes away is taken off, as what is foretold is the hook.  As real forecasts meet
    what they foretold, their mean square errors take over.  An error in the waves'
    own band cannot be told from waves by the record: that is what `error` is for.

    Warm-up: the first model comes when the record reaches back `order` spacings and some 25 s
    beyond, with as many coefficients as the data bear.  Until then the forecast is the newest
    sample, fading with exp(-lead/1 s), and its standard deviation the record's, 0 before the
    first sample.

    Missing samples are bridged with the forecast, and what holds a gap longer than 0.5 s is not
    learnt from.  After a gap the standard deviations are those of leads longer by the gap,
    which new samples work off four times as fast.
    """

    def __init__(
        self,
        *,
        sample_time: float,
        horizon: float,
        order: int = 20,
        spacing: float = 1.0,
        memory: float = 400.0,
        delay: float = 0.0,
        error: float = 0.0,
    ) -> None:
        owner = "adaptive AR"
        self.leads = leads_of(owner, sample_time, horizon)
        self.sample_time = Ts = float(sample_time)
        lags = int(check_range(owner, "order", order, low=4, high=200))
        spacing = check_range(owner, "spacing", spacing, low=4.0 * Ts, high=100.0, unit="s")
        late = check_range(owner, "delay", delay, low=0.0, high=60.0, unit="s")
        self._q = round(spacing / Ts)
        self._D = D = self._q * Ts
        self._error = check_range(owner, "error", error, low=0.0, unit="m")
        memory = check_range(owner, "memory", memory, low=lags * D, high=1e6, unit="s")
        self._every = max(1, round(_TRAIN_EVERY / Ts))
        self._regression = KnotRegression(
            sample_time=Ts,
            spacing=self._q,
            order=lags,
            steps=max(2, math.ceil((self.leads[-1] + late) / D - 1e-9)),
            every=self._every,
            memory=memory,
        )
        self._lags, self._span = self._regression.lags, self._regression.span
        self._share = Ts / memory
        self._at = read_only(self.leads + late)
        n, knots = self.leads.size, self._regression.knots
        weights = hermite_weights(knots, np.append(self._at, Ts))
        weights[:, 1::2] /= D  # rates are kept times the spacing
        self._weights = read_only(np.delete(weights, (n, 2 * n + 1), axis=0))
        self._next_sample = read_only(weights[[n, 2 * n + 1]] * np.array(((1.0,), (D,))))
        self._fade = read_only(np.exp(-self._at / _FADING))
        self.reset()

    @property
    def ready(self) -> bool:
        """Whether there is a model; before, forecasts fade to zero."""
        return self._regression.model is not None

    def reset(self) -> None:
        """Forget the record and the model."""
        self._regression.reset()
        self._record = np.zeros((8 * self._span, 2))  # heave, rate times the spacing [m]
        self._gaps = np.zeros(8 * self._span, dtype=np.int64)  # their number, cumulated
        self._row = self._span - 1  # of the newest sample
        self._age = self._missing = self._stale = 0
        self._power = np.zeros(2)
        self._std = np.zeros((2, self.leads.size))
        self._known: FloatArray | None = None  # the variances that `_std` is made of
        self._work: Iterator[None] = iter(())
        self._working = False

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take what the unit shows: heave [m], heave rate [m/s]; `time` plays no part."""
        del time
        # A comparison with NaN is false, so that it needs no test of its own.
        if valid and abs(heave) <= _LARGEST and abs(rate) <= _LARGEST:
            self._append((heave, rate * self._D), gap=False)
            self._missing, self._stale = 0, max(0, self._stale - _WORKED_OFF)
            # The mean while the record is short, then with the forgetting of the regression.
            newest = self._record[self._row]
            self._power += max(1.0 / (self._age + 1), self._share) * (newest**2 - self._power)
        else:
            self._missing, self._stale = self._missing + 1, self._stale + 1
            gap = self._missing * self.sample_time > _BRIDGED
            self._append(self._bridge(), gap=gap)
        self._age += 1
        if self._age < self._span:
            return
        row = self._row
        clean = self._gaps[row] == self._gaps[row - self._span + 1]
        if clean and self._age % self._every == 0:
            self._regression.learn(self._record, row)
        if self._working:
            self._working = next(self._work, _DONE) is not _DONE
        if self._age % self._q == 0:
            self._regression.judge(self._record, row, bool(clean))
            if not self._working:
                self._work, self._working = self._regression.fit(self._power.copy()), True

    def forecast(self) -> Forecast:
        """Return the motion now and at the leads: two products of a matrix and a vector."""
        n, D, model = self.leads.size, self._D, self._regression.model
        if model is None:
            heave, rate = self._record[self._row]
            rms = np.sqrt(self._power)[:, None] * np.ones(n)
            return Forecast(heave * self._fade, rate / D * self._fade, rms[0], rms[1] / D)
        mean = self._weights @ (model @ self._record[self._row - self._lags].ravel())
        std = self._standard_deviations()
        if self._stale:
            later = np.arange(self._stale, self._stale + n)
            most = np.maximum(np.sqrt(self._power)[:, None] / np.array(((1.0,), (D,))), std)
            std = np.where(later < n, std[:, np.minimum(later, n - 1)], most)
        return Forecast(mean[:n], mean[n:], std[0], std[1])

    def _standard_deviations(self) -> FloatArray:
        """Return them between the knots (2, n); the variance is taken as linear there."""
        variance = self._regression.variance
        if variance is not self._known:
            knots = self._regression.knots
            heave, rate = self._power
            least = self._error**2 * np.array((1.0, rate / heave if heave > 0.0 else 0.0))
            least = np.minimum(least, self._power)
            spread = [
                np.maximum(np.interp(self._at, knots, column), floor)
                for column, floor in zip(variance.T, least, strict=True)
            ]
            self._std = np.sqrt(np.array((spread[0], spread[1] / self._D**2)))
            self._std.setflags(write=False)
            self._known = variance
        return self._std

    def _append(self, shown: npt.ArrayLike, *, gap: bool) -> None:
        """Write the newest sample; the record moves to the front when it is full."""
        row = self._row + 1
        if row == len(self._record):
            row = self._span
            self._record[:row] = self._record[-row:].copy()
            self._gaps[:row] = self._gaps[-row:].copy()
        self._record[row] = shown
        self._gaps[row] = self._gaps[row - 1] + gap
        self._row = row

    def _bridge(self) -> FloatArray:
        """Return what stands for a missing sample."""
        model = self._regression.model
        if model is None:
            return np.asarray(self._record[self._row] * math.exp(-self.sample_time / _FADING))
        knots = model @ self._record[self._row - self._lags].ravel()
        return np.asarray(self._next_sample @ knots)


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
        self, *, sample_time: float, spacing: int, order: int, steps: int, every: int, memory: float
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

        No forecast's variance is larger than the mean squares of the record, `power` (2,) [m2].
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
    """Return the matrix (2k, 2m) from a stretch of the record to its smoothed knots (k,).

    A quartic is fitted by least squares to heave and rate of the samples from `half` before to
    `half` after each knot.  Knots are in samples from the first; rates of the record are multiplied
    with `spacing` [s].  The m samples are those from `half` before the first knot to `half` after
    the last.
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


def hermite_weights(knots: FloatArray, at: FloatArray) -> FloatArray:
    """Return the matrix that interpolates values and rates at knots [s], (k,) (cubic Hermite).

    It is (2n, 2k): [value; rate] at times within the knots' range (n,) [s] from [value, rate] of
    the first knot, the second...
    """
    each = np.eye(2 * knots.size)
    spline = CubicHermiteSpline(knots, each[0::2], each[1::2])
    return np.concatenate([spline(at), spline(at, 1)])
