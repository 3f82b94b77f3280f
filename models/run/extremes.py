r"""Extreme values over seeds: most probable maxima of a signal, with their intervals.

Two routes, and a third to judge them by.  Maxima of whole runs or of long blocks of them follow
Gumbel's law; maxima of clusters above a threshold exceed it by the generalised Pareto law (Coles,
*An Introduction to Statistical Modeling of Extreme Values*, 2001, ch. 3 and 4; DNV-RP-C205, 3.6);
a Gaussian signal has Rayleigh maxima (`models/basics/metrics.py`).  Where a run is nonlinear,
because the rope snaps or the drive saturates, the third route fails and the first two say by how
much.

The most probable maximum in a time T is the level that is exceeded once in T on average: the mode
of Gumbel's law of the maximum in T, and for a Gaussian signal sigma sqrt(2 ln(T/T_z)).

The interval of the Gumbel estimate is simulated: for a law of location and scale the error of an
estimate over the estimated scale has a distribution without unknowns (Lawless, *Statistical Models
and Methods for Lifetime Data*, 2003, app. E), so it is exact for samples of any size.  That of the
Pareto estimate is the profile likelihood's (`models/run/exceedances.py`).  Both speak of chance
alone, not of how far the law fits.  On Gaussian waves, of which the truth is known, Gumbel's law
from 20-minute blocks is 0.8 % high at 3 h and 2.6 % at 10 h; the Pareto law above the 95 % quantile
of the crests 0.6 and 0.2 %, but above the 80 % quantile 2.9 and 1.3 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..basics import THREE_HOURS, FloatArray, InputError, check_finite, check_range, peak_factor
from .exceedances import Exceedances, cluster_maxima
from .run import Run
from .summary import SignalStatistics, Statistics

FEWEST_MAXIMA = 8
"""Fewer block maxima than this say nothing about a law of two parameters."""

FEWEST_PEAKS = 50
"""Fewer peaks over the threshold than this say too little about a law of three parameters: of
intervals meant to hold in 95 of 100 cases 93 to 95 do from here on, 92 with 30 peaks."""


@dataclass(frozen=True, kw_only=True)
class ExtremeEstimate:
    """A most probable maximum (or minimum) with its interval, in the signal's unit u.

    Attributes
    ----------
    method
        "gumbel" or "pareto".
    duration
        The time T in which it is the most probable one [s].
    value, low, high
        The estimate and the ends of its interval [u]; NaN if there are too few data.
    confidence
        Of the interval, such as 0.95.
    scale, shape
        Scale [u] and shape of the law of the maximum in T, whose location is `value`; the scale
        of a minimum is negative.
    count
        Number of maxima or of peaks that it rests on.
    rayleigh
        What a Gaussian signal of the same deviation and period would have [u]; NaN if not asked.
    status
        "ok", or the sentence that says why there is no estimate.
    """

    method: str
    duration: float
    value: float
    low: float
    high: float
    confidence: float
    scale: float
    shape: float
    count: int
    rayleigh: float = math.nan
    status: str = "ok"

    def quantile(self, probability: float) -> float:
        """Return the level that the maximum in T stays within with this probability [u]."""
        p = check_range(
            "extremes", "probability", probability, low=0, high=1, open_low=True, open_high=True
        )
        reduced = -math.log(-math.log(p))
        if abs(self.shape) > 1e-9:
            reduced = math.expm1(self.shape * reduced) / self.shape
        return self.value + self.scale * reduced


def gumbel_maximum(
    maxima: npt.ArrayLike,
    *,
    block: float,
    duration: float = THREE_HOURS,
    confidence: float = 0.95,
    repetitions: int = 4000,
    seed: int = 0,
) -> ExtremeEstimate:
    """Return the most probable maximum by Gumbel's law.

    Parameters
    ----------
    maxima
        Independent maxima (n,), each of a block of equal length.
    block
        Length of the blocks [s].
    duration
        Time T [s]; much beyond n blocks it is extrapolation, and the interval says so.
    confidence
        Of the interval.
    repetitions, seed
        Samples drawn for the interval, and their seed.

    Raises
    ------
    InputError
        If there are fewer than `FEWEST_MAXIMA`, or all are equal.
    """
    x = check_finite("extremes", "maxima", maxima).ravel()
    if x.size < FEWEST_MAXIMA:
        raise InputError(
            f"extremes: Gumbel's law wants at least {FEWEST_MAXIMA} block maxima, got {x.size}; "
            "simulate more seeds or longer, or take shorter blocks"
        )
    if np.ptp(x) == 0.0:
        raise InputError(f"extremes: the {x.size} maxima must differ, all are {x[0]:g}")
    location, scale = (float(v) for v in gumbel_fit(x))
    # The maximum of m blocks is Gumbel again, further up by scale * ln m.
    reach = math.log(duration / block)
    value = location + reach * scale
    # Errors of the same estimate on samples of a law that is known, over their own scales.
    drawn = np.random.default_rng(seed).gumbel(size=(repetitions, x.size))
    locations, scales = gumbel_fit(drawn)
    errors = (locations + reach * scales - reach) / scales
    tail = 0.5 * (1.0 - confidence)
    least, most = np.quantile(errors, (tail, 1.0 - tail))
    return ExtremeEstimate(
        method="gumbel",
        duration=duration,
        value=value,
        low=value - scale * float(most),
        high=value - scale * float(least),
        confidence=confidence,
        scale=scale,
        shape=0.0,
        count=x.size,
    )


def pareto_maximum(
    peaks: npt.ArrayLike,
    threshold: float,
    *,
    exposure: float,
    duration: float = THREE_HOURS,
    confidence: float = 0.95,
) -> ExtremeEstimate:
    """Return the most probable maximum by the generalised Pareto law of peaks over a threshold.

    Parameters
    ----------
    peaks
        Independent peaks above the threshold (n,), as :func:`cluster_maxima` finds them.
    threshold
        The threshold [u].
    exposure
        Time in which they were found, over all seeds [s].
    duration
        Time T [s].
    confidence
        Of the interval.

    Raises
    ------
    InputError
        If there are fewer than `FEWEST_PEAKS`, or not all are above the threshold.
    """
    x = check_finite("extremes", "peaks", peaks).ravel()
    if x.size < FEWEST_PEAKS:
        raise InputError(
            f"extremes: the Pareto law wants at least {FEWEST_PEAKS} peaks over the threshold of "
            f"{threshold:g}, got {x.size}; simulate more seeds or longer, or lower the threshold"
        )
    if x.min() <= threshold:
        raise InputError(f"extremes: peaks must be above {threshold:g}, got {x.min():g}")
    # In units of the mean excess, so that neither the signal's unit nor its mean matters.
    unit = float((x - threshold).mean())
    law = Exceedances((x - threshold) / unit, exposure / duration)
    low, high = law.interval(confidence)
    return ExtremeEstimate(
        method="pareto",
        duration=duration,
        value=threshold + unit * law.level,
        low=threshold + unit * low,
        high=threshold + unit * high,
        confidence=confidence,
        scale=unit * law.scale,
        shape=law.shape,
        count=x.size,
    )


def extreme_over_seeds(
    runs: Sequence[Run | Statistics],
    signal: str,
    *,
    method: Literal["gumbel", "pareto"] = "gumbel",
    minimum: bool = False,
    duration: float = THREE_HOURS,
    over: float = 0.95,
    gap: int = 3,
    confidence: float = 0.95,
    seed: int = 0,
) -> ExtremeEstimate:
    """Return the most probable maximum of a signal from runs that differ in their seed alone.

    Parameters
    ----------
    runs
        The runs, or their statistics.
    signal
        The signal; it must have block extremes ("gumbel") or cycles ("pareto"), see `Accumulator`.
    method
        "gumbel": maxima of every whole block of every run.  "pareto": crests above the `over`
        quantile of all crests, those less than `gap` cycles apart taken once.
    minimum
        The most probable minimum instead.
    duration
        Time T [s].
    over, gap
        Of the Pareto law, see `method`.
    confidence, seed
        Of the interval; the seed of its random numbers ("gumbel").

    Returns
    -------
    ExtremeEstimate
        With the Rayleigh estimate beside it if the signal has cycles.  Where the data are too few
        its values are NaN and its status says why.

    Raises
    ------
    InputError
        If there are no runs, or no such signal, or nothing was kept of it for the method.
    """
    found = [run if isinstance(run, Statistics) else run.statistics for run in runs]
    if not found:
        raise InputError("extremes: at least one run is wanted, got none")
    sign = -1.0 if minimum else 1.0
    each = [s[signal] for s in found]
    try:
        if method == "gumbel":
            tops = _block_maxima(found, signal, sign)
            estimate = gumbel_maximum(
                tops, block=found[0].block, duration=duration, confidence=confidence, seed=seed
            )
        else:
            peaks, threshold = _crest_peaks(each, sign, over, gap)
            exposure = sum(s.duration for s in found)
            estimate = pareto_maximum(
                peaks, threshold, exposure=exposure, duration=duration, confidence=confidence
            )
    except _NoDataError as error:
        raise InputError(str(error)) from None
    except InputError as error:
        nothing = dict.fromkeys(("value", "low", "high", "scale", "shape"), math.nan)
        estimate = ExtremeEstimate(
            method=method,
            duration=duration,
            confidence=confidence,
            count=0,
            status=str(error),
            **nothing,
        )
    return replace(
        estimate,
        value=sign * estimate.value,
        low=estimate.low if sign > 0 else -estimate.high,
        high=estimate.high if sign > 0 else -estimate.low,
        scale=sign * estimate.scale,
        rayleigh=_rayleigh(each, sign, duration),
    )


def gumbel_fit(maxima: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Return location and scale of Gumbel's law by maximum likelihood, for many samples at once.

    The scale solves :math:`\beta = \bar x - \sum x e^{-x/\beta} / \sum e^{-x/\beta}`; Newton's
    method from the moments' estimate converges for every sample.

    Parameters
    ----------
    maxima
        Samples (..., n), each along the last axis, not all equal.

    Returns
    -------
    tuple of FloatArray
        Locations and scales (...,).
    """
    x = np.asarray(maxima, dtype=np.float64)
    mean = x.mean(axis=-1, keepdims=True)
    spread = x.std(axis=-1, keepdims=True)
    # Standardised, so that neither units nor a large mean matter to the iteration.
    z = (x - mean) / spread
    beta = np.full_like(mean, math.sqrt(6.0) / math.pi)
    for _ in range(50):
        weight = np.exp(-(z - z.min(axis=-1, keepdims=True)) / beta)
        total = weight.sum(axis=-1, keepdims=True)
        first = (z * weight).sum(axis=-1, keepdims=True) / total
        second = (z * z * weight).sum(axis=-1, keepdims=True) / total
        # f = beta + first, as the mean of z is zero; f' = 1 + variance under the weights / beta^2.
        step = (beta + first) / (1.0 + (second - first**2) / beta**2)
        beta = np.maximum(beta - step, 0.2 * beta)
        if np.all(np.abs(step) <= 1e-12 * beta):
            break
    location = -beta * np.log(np.exp(-z / beta).mean(axis=-1, keepdims=True))
    return (mean + spread * location)[..., 0], (spread * beta)[..., 0]


class _NoDataError(InputError):
    """What was asked for was never gathered, which no longer run would change."""


def _block_maxima(found: Sequence[Statistics], signal: str, sign: float) -> FloatArray:
    if any(signal not in s.blocks or s.block != found[0].block for s in found):
        raise _NoDataError(
            f"extremes: {signal!r} must have extremes of equal blocks in every run; "
            "name it among the accumulator's block_signals"
        )
    blocks = [s.blocks[signal] for s in found]
    return np.concatenate([b.maxima if sign > 0.0 else -b.minima for b in blocks])


def _crest_peaks(
    each: Sequence[SignalStatistics], sign: float, over: float, gap: int
) -> tuple[FloatArray, float]:
    """Peaks over the threshold, and the threshold, which all runs share."""
    if any(s.cycles != s.crests.size or math.isnan(s.level) for s in each):
        raise _NoDataError(
            f"extremes: the cycles of {each[0].name!r} were not kept in every run; "
            "give the accumulator a level for it, and room for all its cycles"
        )
    check_range("extremes", "over", over, low=0, high=1, open_low=True, open_high=True)
    crests = [
        sign * (s.level + (s.crests if sign > 0.0 else s.troughs).astype(np.float64)) for s in each
    ]
    together = np.concatenate(crests)
    threshold = float(np.quantile(together, over)) if together.size else math.nan
    return np.concatenate([cluster_maxima(c, threshold, gap) for c in crests]), threshold


def _rayleigh(each: Sequence[SignalStatistics], sign: float, duration: float) -> float:
    """Most probable maximum of a Gaussian signal of the same mean, deviation and period."""
    cycles = np.array([s.cycles for s in each], dtype=np.float64)
    if cycles.sum() == 0.0:
        return math.nan
    mean = float(np.mean([s.mean for s in each]))
    sigma = math.sqrt(float(np.mean([s.standard_deviation**2 for s in each])))
    period = float(np.average([s.period if s.cycles else 0.0 for s in each], weights=cycles))
    return mean + sign * sigma * peak_factor(period, duration)
