r"""How well a long Gaussian record knows its own variance.

Neighbouring samples say nearly the same, so the variance of a record of n samples is far less
certain than n independent ones would make it.  Its standard error hangs on the sum of the squared
autocovariance over all lags, which is taken from the record itself or, by Parseval, from the
spectrum: :math:`\mathrm{var}(s^2) = (2/n) \sum_k R_k^2`, or
:math:`(2 \pi / T) \int_0^\infty S^2 d\omega` (Bartlett 1946; Priestley 1981, 5.3.4).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from models.basics import InputError, Quadrature, check_finite, check_range
from models.basics.metrics import Density

__all__ = ["spectral_standard_error", "standard_error_of_variance"]

# Lags are summed up to this many times the correlation time that they give (Sokal 1997 takes 5 for
# a plain exponential; squares of an oscillation average to half their envelope).
_CORRELATION_TIMES = 10.0


def standard_error_of_variance(record: npt.ArrayLike) -> float:
    r"""Return the standard error of the variance of a correlated Gaussian record [u^2].

    The variance of a record of n samples itself varies by :math:`(2/n) \sum_k (1-|k|/n) R_k^2`
    (Bartlett 1946; Priestley 1981, 5.3.4), with the record's own autocovariance R.  Estimated lags
    carry noise, whose squares add up; the sum ends where the correlation has (Sokal's window), and
    is freed from the noise of the lags in it.

    Parameters
    ----------
    record
        The record (n,) [u], in equal steps, long against its correlation time.

    Raises
    ------
    InputError
        If the record holds less than 100 samples or is not finite, or is too short against its
        correlation time to tell.

    Examples
    --------
    White noise of unit variance: sqrt(2/n).

    >>> white = np.random.default_rng(1).standard_normal(20_000)
    >>> print(f"{standard_error_of_variance(white):.3f}")
    0.010
    """
    x = check_finite("standard error", "record", record)
    if x.ndim != 1 or x.size < 100:
        raise InputError(f"standard error: record must have 100 samples or more, got {x.shape}")
    n = x.size
    x = x - x.mean()
    size = 1 << (2 * n - 1).bit_length()
    squared = np.abs(np.fft.rfft(x, size)) ** 2
    covariance = np.fft.irfft(squared, size)[:n] / n
    if covariance[0] == 0.0:
        return 0.0
    # covariance[k] already holds the factor 1 - k/n once; the formula wants it once on R^2.
    lag = np.arange(n)
    terms = np.square(covariance) / (1.0 - lag / n)
    sums = 2.0 * np.cumsum(terms) - terms[0]
    times = 0.5 * sums / terms[0]
    ends = np.flatnonzero(lag >= _CORRELATION_TIMES * times)
    if ends.size == 0 or (2 * ends[0] + 1) > 0.25 * n:
        raise InputError(
            "standard error: record is too short against its correlation time: it must hold more "
            f"than {8 * _CORRELATION_TIMES:.0f} of them, got {n} samples"
        )
    end = int(ends[0])
    noise = (2.0 * end + 1.0) / n
    return math.sqrt(2.0 / n * float(sums[end]) / (1.0 + noise))


def spectral_standard_error(
    quadrature: Quadrature, density: Density | npt.ArrayLike, duration: float
) -> float:
    r"""Return the standard error of a Gaussian record's variance, by its spectrum [u^2].

    The integral of the squared autocovariance over all lags is that of the squared spectrum:
    :math:`\mathrm{var}(s^2) = (2 \pi / T) \int_0^\infty S^2 d\omega`.

    Parameters
    ----------
    quadrature
        Nodes and weights that resolve the square of the spectrum.
    density
        One-sided variance density [u^2 s/rad]: a function of omega, or its values at the nodes.
    duration
        Length T of the record [s], long against its correlation time.
    """
    time = check_range("standard error", "duration", duration, low=0.0, unit="s", open_low=True)
    values = density(quadrature.omega) if callable(density) else density
    power = quadrature.integrate(np.square(np.asarray(values, dtype=np.float64)))
    return math.sqrt(2.0 * math.pi * float(power) / time)
