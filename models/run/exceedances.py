r"""Peaks over a threshold by the generalised Pareto law, with the level sought as a parameter.

The mathematics behind `pareto_maximum` in `models/run/extremes.py`.  Peaks above a threshold come
at random times, and their excess has a generalised Pareto law (Coles, *An Introduction to
Statistical Modeling of Extreme Values*, 2001, ch. 4 and 7).  In a time T the expected number above
x is

.. math:: \Lambda(x) = \left(1 + \xi (x - q) / \psi\right)^{-1/\xi},

one at the level q.  So q itself is a parameter, beside scale and shape, and its interval is that of
the profile likelihood: lopsided, as what is known of extremes is, and with the uncertain rate of
exceedances in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray

# The maximum-likelihood estimate of the shape is regular above -1/2 only (Smith 1985), and above 1
# the excess has no mean: no motion nor force of a winch is like that.
_LEAST_SHAPE, _LARGEST_SHAPE = -0.5, 1.0

# Stands for minus infinity, with which the simplex could not reckon.
_IMPOSSIBLE = -1e12


def cluster_maxima(values: npt.ArrayLike, threshold: float, gap: int) -> FloatArray:
    """Return the largest value of each cluster above a threshold.

    A cluster ends where `gap` values in a row stay at or below the threshold ("runs
    declustering"), so that one group of waves counts once.

    Parameters
    ----------
    values
        A record, or the crests of its cycles in their order (n,).
    threshold
        Threshold in the unit of the values.
    gap
        Number of values between clusters, at least 1.

    Examples
    --------
    >>> cluster_maxima([0, 3, 0, 4, 0, 0, 5, 2, 0], 1.0, gap=2).tolist()
    [4.0, 5.0]
    """
    x = np.asarray(values, dtype=np.float64)
    over = np.flatnonzero(x > threshold)
    if over.size == 0:
        return np.zeros(0)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(over) > gap) + 1))
    found: FloatArray = np.maximum.reduceat(x[over], starts)
    return found


class Exceedances:
    """The likelihood of peaks over a threshold, and where it is largest.

    Parameters
    ----------
    excess
        Peaks less the threshold (n,), of mean one.
    periods
        Time in which they were found, over T.

    Attributes
    ----------
    level, scale, shape
        The level q exceeded once in T on average, above the threshold, with the scale and the
        shape of the law of the maximum in T.
    """

    def __init__(self, excess: FloatArray, periods: float) -> None:
        self._peaks, self._periods = np.concatenate(([0.0], excess)), periods
        # At the largest likelihood the rate is n over the exposure, whatever the other two are.
        log_rate = math.log(excess.size / periods)

        def there(at: FloatArray) -> tuple[float, float, float]:
            """Level, logarithm of the scale, and shape, from the law of the excess."""
            shape = float(at[1])
            return math.exp(at[0]) * _power(log_rate, shape), at[0] + shape * log_rate, shape

        at = _highest(lambda p: self.log_likelihood(*there(p)), np.zeros(2))
        self.level, log_scale, self.shape = there(at)
        self.scale = math.exp(log_scale)
        self._best = self.log_likelihood(self.level, log_scale, self.shape)

    def log_likelihood(self, level: float, log_scale: float, shape: float) -> float:
        """Logarithm of the likelihood; `_IMPOSSIBLE` where the law does not allow the data."""
        if not _LEAST_SHAPE <= shape <= _LARGEST_SHAPE or abs(log_scale) > 50.0:
            return _IMPOSSIBLE
        y = (self._peaks - level) * math.exp(-log_scale)  # the threshold itself comes first
        if abs(shape) > 1e-8:
            inside = 1.0 + shape * y
            if inside.min() <= 0.0:
                return _IMPOSSIBLE
            y = np.log(inside) / shape
        threshold = float(y[0])
        if threshold < -300.0:
            return _IMPOSSIBLE
        number = self._periods * math.exp(-threshold)
        total = float(y.sum()) - threshold
        return -number - (y.size - 1) * log_scale - (1.0 + shape) * total

    def interval(self, confidence: float) -> tuple[float, float]:
        """Return the ends of the level's profile-likelihood interval; the upper may be infinite."""
        from scipy.special import chdtri

        allowed = 0.5 * float(chdtri(1, 1.0 - confidence))
        return self._end(-1.0, allowed), self._end(1.0, allowed)

    def _end(self, direction: float, allowed: float) -> float:
        """Step away from the level until the profile has fallen by `allowed`; find where it did."""
        from scipy.optimize import brentq

        near, start = self.level, np.array([math.log(self.scale), self.shape])
        step = 0.3 * self.scale
        for _ in range(60):
            far = near + direction * step
            value, at = self._lack(far, start, allowed)
            if value > 0.0:
                break
            near, start, step = far, at, 1.5 * step
        else:
            return direction * math.inf
        origin, (low, high) = start, sorted((near, far))
        return float(
            brentq(lambda q: self._lack(q, origin, allowed)[0], low, high, xtol=1e-4 * self.scale)
        )

    def _lack(self, level: float, start: FloatArray, allowed: float) -> tuple[float, FloatArray]:
        """How far the profile at a level lies below what is allowed, and where it is taken."""
        at = _highest(lambda p: self.log_likelihood(level, float(p[0]), float(p[1])), start)
        return self._best - self.log_likelihood(level, float(at[0]), float(at[1])) - allowed, at


def _power(log_rate: float, shape: float) -> float:
    """Return (rate^shape - 1) / shape, which is the logarithm of the rate at shape zero."""
    return log_rate if abs(shape) < 1e-8 else math.expm1(shape * log_rate) / shape


def _highest(value: Callable[[FloatArray], float], start: FloatArray) -> FloatArray:
    """Return where a function of two numbers is largest."""
    from scipy.optimize import minimize

    def cost(at: FloatArray) -> float:
        return -value(at)

    options: Any = {  # for the stubs; a likelihood is known well enough to 1e-6
        "initial_simplex": start + np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.05]]),
        "xatol": 1e-3,
        "fatol": 1e-6,
        "maxiter": 1000,
    }
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    best: FloatArray = found.x
    return best
