r"""Gumbel's law of the largest of many: fitted to samples, and how far such a fit goes wrong.

The mathematics behind `gumbel_maximum` in `models/run/extremes.py`.  Maximum likelihood, for many
small samples at once, because the interval is simulated: for a law of location and scale the error
of an estimate over the estimated scale has a distribution without unknowns (Lawless, *Statistical
Models and Methods for Lifetime Data*, 2003, app. E), so an interval from it is exact for any sample
size.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray


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


def gumbel_errors(size: int, reach: float, *, repetitions: int, seed: int) -> FloatArray:
    """Return errors of the quantile location + reach * scale, each over its estimated scale.

    Parameters
    ----------
    size
        Number of maxima in a sample.
    reach
        Reduced variate of the quantile.
    repetitions, seed
        Number of samples drawn, and their seed.

    Returns
    -------
    FloatArray
        Errors (repetitions,).
    """
    drawn = np.random.default_rng(seed).gumbel(size=(repetitions, size))
    location, scale = gumbel_fit(drawn)
    errors: FloatArray = (location + reach * scale - reach) / scale
    return errors
