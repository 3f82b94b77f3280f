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

The normal equations (`mpc.forecast.regression`) are kept with exponential forgetting, and solved
with a ridge once a spacing, one part of the work a sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, check_range, read_only

from .forecast import Forecast, hermite_weights, leads_of, usable
from .regression import KnotRegression

_TRAIN_EVERY = 0.2  # [s] between two regressions
_FADING = 1.0  # [s] in which a forecast fades before there is a model
_BRIDGED = 0.5  # [s]: longer gaps are not learnt from
_LARGEST = 1e3  # [m], [m/s]: what is larger is no measurement
_WORKED_OFF = 4  # samples of a gap that one new sample makes up for
_DONE: Final = object()


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
        weights = hermite_weights(owner, knots, np.append(self._at, Ts))
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
        if usable(heave, rate, valid, _LARGEST):
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
