r"""Extreme values over seeds: most probable maxima of a signal, with their intervals.

Maxima of long blocks of a run follow Gumbel's law (Coles, *An Introduction to Statistical Modeling
of Extreme Values*, 2001, ch. 3; DNV-RP-C205, 3.6); beside the estimate stands that of a Gaussian
signal, whose maxima are Rayleigh's (`models/basics/metrics.py`).  Where a run is nonlinear, because
the rope snaps or the drive saturates, the second fails and the first says by how much.

The most probable maximum in a time T is the level that is exceeded once in T on average: the mode
of Gumbel's law of the maximum in T, and for a Gaussian signal sigma sqrt(2 ln(T/T_z)).

The interval of the Gumbel estimate is simulated: for a law of location and scale the error of an
estimate over the estimated scale has a distribution without unknowns (Lawless, *Statistical Models
and Methods for Lifetime Data*, 2003, app. E), so it is exact for samples of any size.  It speaks of
chance alone, not of how far the law fits: on Gaussian waves, of which the truth is known, Gumbel's
law from 20-minute blocks is 0.8 % high at 3 h and 2.6 % at 10 h.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ..basics import THREE_HOURS, FloatArray, InputError, check_finite, peak_factor
from .run import Run
from .summary import SignalStatistics, Statistics

FEWEST_MAXIMA = 8  #: Fewer block maxima than this say nothing about a law of two parameters.


@dataclass(frozen=True, kw_only=True)
class ExtremeEstimate:
    """A most probable maximum (or minimum) with its interval, in the signal's unit u."""

    duration: float  #: The time T in which it is the most probable one [s].
    #: The estimate and the ends of its interval [u]; NaN if there are too few data.
    value: float
    low: float
    high: float
    confidence: float  #: Of the interval, such as 0.95.
    #: Scale of the law of the maximum in T [u], whose location is `value`; that of a minimum is
    #: negative.
    scale: float
    count: int  #: Number of maxima that it rests on.
    #: What a Gaussian signal of the same deviation and period would have [u]; NaN if not asked.
    rayleigh: float = math.nan
    status: str = "ok"  #: "ok", or the sentence that says why there is no estimate.


def gumbel_maximum(
    maxima: npt.ArrayLike,
    *,
    block: float,
    duration: float = THREE_HOURS,
    confidence: float = 0.95,
    repetitions: int = 4000,
    seed: int = 0,
) -> ExtremeEstimate:
    """Return the most probable maximum in a duration T [s] by Gumbel's law.

    The maxima (n,) are independent, each of a block of so many seconds.  Much beyond n blocks T is
    extrapolation, and the interval says so; it comes from `repetitions` samples.

    Raises InputError if there are fewer than `FEWEST_MAXIMA`, or all are equal.
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
        duration=duration,
        value=value,
        low=value - scale * float(most),
        high=value - scale * float(least),
        confidence=confidence,
        scale=scale,
        count=x.size,
    )


def extreme_over_seeds(
    runs: Sequence[Run | Statistics],
    signal: str,
    *,
    minimum: bool = False,
    duration: float = THREE_HOURS,
    confidence: float = 0.95,
    seed: int = 0,
) -> ExtremeEstimate:
    """Return the most probable maximum, or minimum, of a signal in T [s] from runs over seeds.

    The signal must have block extremes, see `Accumulator`; T is in s, the seed that of the
    interval.  The Rayleigh estimate is beside it if the signal has cycles.  Where the data are too
    few its values are NaN and its status says why.

    Raises InputError if there are no runs, or no such signal, or no block extremes were kept of it.
    """
    found = [run if isinstance(run, Statistics) else run.statistics for run in runs]
    if not found:
        raise InputError("extremes: at least one run is wanted, got none")
    sign = -1.0 if minimum else 1.0
    each = [s[signal] for s in found]
    if any(signal not in s.blocks or s.block != found[0].block for s in found):
        raise InputError(
            f"extremes: {signal!r} must have extremes of equal blocks in every run; "
            "name it among the accumulator's block_signals"
        )
    blocks = [s.blocks[signal] for s in found]
    tops = np.concatenate([-b.minima if minimum else b.maxima for b in blocks])
    try:
        estimate = gumbel_maximum(
            tops, block=found[0].block, duration=duration, confidence=confidence, seed=seed
        )
    except InputError as error:
        nothing = dict.fromkeys(("value", "low", "high", "scale"), math.nan)
        estimate = ExtremeEstimate(
            duration=duration, confidence=confidence, count=0, status=str(error), **nothing
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
    r"""Return location and scale of Gumbel's law by maximum likelihood, (...,), of (..., n).

    The scale solves :math:`\beta = \bar x - \sum x e^{-x/\beta} / \sum e^{-x/\beta}`; Newton's
    method from the moments' estimate converges for every sample.  No sample has all its values
    equal.
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


def _rayleigh(each: Sequence[SignalStatistics], sign: float, duration: float) -> float:
    """Most probable maximum of a Gaussian signal of the same mean, deviation and period."""
    cycles = np.array([s.cycles for s in each], dtype=np.float64)
    if cycles.sum() == 0.0:
        return math.nan
    mean = float(np.mean([s.mean for s in each]))
    sigma = math.sqrt(float(np.mean([s.standard_deviation**2 for s in each])))
    period = float(np.average([s.period if s.cycles else 0.0 for s in each], weights=cycles))
    return mean + sign * sigma * peak_factor(period, duration)
