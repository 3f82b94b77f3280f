"""Confidence intervals of a mean, a probability or a rate from a few repetitions.

The mean of independent values has Student's interval; a share the exact one of Clopper and Pearson
(1934); the rate at which something happens, with some runs ended before it did, the chi-square
interval of Epstein and Sobel (1953).  `models/run/metrics.py` applies them to runs that differ in
their seed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray
from .checks import InputError, check_finite, check_range


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A mean over seeds with its confidence interval, in `unit`."""

    #: The mean and the ends of its interval; the ends are NaN with a single value.
    mean: float
    low: float
    high: float
    #: Of the values, with n - 1 in the denominator; NaN with a single value.
    standard_deviation: float
    count: int  #: Number of values; runs in which the quantity did not occur have none.
    unit: str = ""  #: The unit.


@dataclass(frozen=True, kw_only=True)
class Share:
    """How many of `total` runs something happened in, with the interval of its probability."""

    count: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share itself, 0 to 1."""
        return self.count / self.total


@dataclass(frozen=True, kw_only=True)
class FallTime:
    """How long runs keep lock."""

    falls: int  #: Number of runs that lost lock.
    exposure: float  #: Time that all runs together kept it [s].
    #: Falls per second if they come at a constant rate, and its interval [1/s].
    rate: float
    rate_low: float
    rate_high: float

    @property
    def mean(self) -> tuple[float, float, float]:
        """Mean time to a fall at a constant rate, and its interval [s]; may be infinite."""
        mean, low, high = (
            1.0 / rate if rate > 0.0 else math.inf
            for rate in (self.rate, self.rate_high, self.rate_low)
        )
        return mean, low, high


def mean_interval(
    values: Sequence[float] | FloatArray, *, unit: str = "", confidence: float = 0.95
) -> Interval:
    """Return the mean of independent values with Student's interval; NaN values are left out.

    Examples
    --------
    >>> found = mean_interval([9.0, 10.0, 11.0])
    >>> print(f"{found.mean:g} ({found.low:.3f} to {found.high:.3f})")
    10 (7.516 to 12.484)
    """
    x = np.asarray(values, dtype=np.float64)
    x = x[~np.isnan(x)]
    n = x.size
    mean = float(x.mean()) if n else math.nan
    if n < 2 or not np.isfinite(x).all():
        half = deviation = math.nan
    else:
        from scipy.special import stdtrit

        deviation = float(x.std(ddof=1))
        half = float(stdtrit(n - 1, 0.5 + 0.5 * confidence)) * deviation / math.sqrt(n)
    return Interval(
        mean=mean,
        low=mean - half,
        high=mean + half,
        standard_deviation=deviation,
        count=n,
        unit=unit,
    )


def pooled_interval(
    values: npt.ArrayLike,
    over: npt.ArrayLike | None = None,
    *,
    unit: str = "",
    confidence: float = 0.95,
) -> Interval:
    """Return the pooled rms of independent runs, or its ratio to others', with its interval.

    Both have a root mean square for each run, (n,), in the same order: pairs, so that what makes a
    run easy for both leaves the ratio alone.  Student's interval is that of the logarithm, whose
    error is half that of the mean squares, each over its mean (the delta method): its ends are
    positive, and those of the inverse ratio are inverse.  Runs with a NaN are left out; without a
    finite answer above zero all are NaN.

    Examples
    --------
    >>> found = pooled_interval([9.0, 10.0, 11.0])
    >>> print(f"{found.mean:.2f} ({found.low:.2f} to {found.high:.2f})")
    10.03 (7.84 to 12.84)
    >>> found = pooled_interval([9.0, 10.0, 11.0], [4.5, 5.0, 5.5])
    >>> print(f"{found.mean:g} ({found.low:g} to {found.high:g})")
    2 (2 to 2)
    """
    x = np.asarray(values, dtype=np.float64)
    y = np.ones_like(x) if over is None else np.asarray(over, dtype=np.float64)
    known = ~(np.isnan(x) | np.isnan(y))
    # In units of the largest, so that squares neither overflow nor vanish.
    sizes = [float(np.abs(z[known]).max(initial=0.0)) for z in (x, y)]
    if not all(0.0 < size < math.inf for size in sizes):
        # Without end where runs are, beside others that have one.
        endless = known.any() and sizes[0] == math.inf and 0.0 < sizes[1] < math.inf
        centre = math.inf if endless else math.nan
        return replace(mean_interval([]), mean=centre, count=int(known.sum()), unit=unit)
    squares = [(z[known] / size) ** 2 for z, size in zip((x, y), sizes, strict=True)]
    means = [float(square.mean()) for square in squares]
    spread = mean_interval(squares[0] / means[0] - squares[1] / means[1], confidence=confidence)
    centre = sizes[0] / sizes[1] * math.sqrt(means[0] / means[1])
    far = math.exp(0.25 * (spread.high - spread.low))
    return Interval(
        mean=centre,
        low=centre / far,
        high=centre * far,
        standard_deviation=0.5 * spread.standard_deviation * centre,
        count=spread.count,
        unit=unit,
    )


def share(count: int, total: int, *, confidence: float = 0.95) -> Share:
    """Return a share with the exact interval of Clopper and Pearson, which covers at least that.

    Examples
    --------
    >>> found = share(2, 10)
    >>> print(f"{found.value:g} ({found.low:.4f} to {found.high:.4f})")
    0.2 (0.0252 to 0.5561)
    """
    from scipy.stats import binomtest

    check_range("share", "total", total, low=1)
    check_range("share", "count", count, low=0, high=total)
    ends = binomtest(count, total).proportion_ci(confidence, method="exact")
    return Share(count=count, total=total, low=float(ends.low), high=float(ends.high))


def fall_time(times: npt.ArrayLike, fell: npt.ArrayLike, *, confidence: float = 0.95) -> FallTime:
    """Return how long runs keep lock, from their times [s], those that kept it to the end censored.

    The interval of the rate is that of falls counted over a fixed exposure, from chi-square with
    2 r degrees of freedom at the low end and 2 r + 2 at the high one; without any fall the high
    end alone says something (three falls in the exposure, roughly).

    Raises InputError if there is no run, or a time is negative.

    Examples
    --------
    >>> found = fall_time([300.0, 1200.0, 900.0, 1200.0], [True, False, True, False])
    >>> print(f"{found.rate:.2e} per second, {found.rate_low:.2e} to {found.rate_high:.2e}")
    5.56e-04 per second, 6.73e-05 to 2.01e-03
    """
    from scipy.special import chdtri

    kept = check_finite("fall time", "times", times)
    falls = np.asarray(fell, dtype=np.bool_)
    if kept.ndim != 1 or kept.size == 0 or kept.shape != falls.shape or kept.min() < 0.0:
        raise InputError(
            "fall time: times must be at least 0 s, one for each run of at least one, "
            f"got {kept!r} and {falls!r}"
        )
    r, exposure = int(falls.sum()), float(kept.sum())
    tail = 0.5 * (1.0 - confidence)
    if exposure > 0.0:
        rate = r / exposure
        low = float(chdtri(2 * r, 1.0 - tail)) / (2.0 * exposure) if r else 0.0
        high = float(chdtri(2 * r + 2, tail)) / (2.0 * exposure)
    else:
        rate, low, high = (math.inf, 0.0, math.inf) if r else (0.0, 0.0, math.inf)
    return FallTime(falls=r, exposure=exposure, rate=rate, rate_low=low, rate_high=high)
