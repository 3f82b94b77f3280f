r"""A shaping filter for forecasting: fitted where the motion stands out of the unit's error.

A forecast of seconds draws on what is far below the peak: with an error of 1 % a spectrum
counts down to some 1e-5 of its peak, and the flanks decide how far ahead it can be known.  The
fit of `models.plant.shaping` looks at the variance and is up to 6 % (1 % of error) or 30 % (no
error) worse than the optimum.  This one starts there, adds pairs of poles and zeros, and fits

.. math::

    H(s) = g\, s^m \prod_{i=1}^{e} (s^2 + 2 \zeta'_i \omega'_i s + \omega_i'^2) \Big/
           \prod_{i=1}^{n/2} (s^2 + 2 \zeta_i \omega_i s + \omega_i^2), \qquad
    \min \int \log^2 \frac{S + N}{|H|^2/\pi + N}\, d\omega ,

with the error's density N: the loss of a predictor for a wrong spectrum is of this kind
(Whittle, *Prediction and Regulation*, 1963; Kolmogorov's formula has the same integral).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from models.basics import FloatArray, InputError, SolverError
from models.plant import ShapingFilter, fit_shaping_filter

ORDERS = (4, 6, 8, 10, 12)
"""Orders that can be asked for; up to 8 the fit is that of `models.plant.shaping`."""

_LINEAR, _TAIL = 240, 40  # nodes up to and beyond the waves
_WAVES, _END = 4.0, 60.0  # times the peak frequency: where the waves end, and the fit
_DAMPING = (0.005, 5.0)
_ADDED_DAMPING = 0.3


def fit_for_forecast(
    density: Callable[[FloatArray], FloatArray],
    band: tuple[float, float],
    noise: Callable[[FloatArray], FloatArray],
    order: int,
) -> ShapingFilter:
    """Return a stable filter of a spectrum, for forecasts from samples with noise.

    Parameters
    ----------
    density
        One-sided variance density per rad/s at omega [rad/s], (k,) -> (k,).
    band
        Band that holds the variance [rad/s].
    noise
        One-sided density of what disturbs the measurement of the same signal, above zero.
    order
        Number of states, one of `ORDERS`: up to 8 the best in the L1 norm of those up to it.

    Raises
    ------
    InputError
        If the order is none of these, or the band is empty or holds no variance.
    SolverError
        If the fit does not converge.
    """
    if order not in ORDERS:
        raise InputError(f"sea predictor: order must be 4, 6, 8, 10 or 12, got {order!r}")
    if order <= 8:
        fits = [fit_shaping_filter(density, band, n) for n in ORDERS if n <= order]
        return min(fits, key=lambda fit: fit.shape_error)
    return _refined(density, band, noise, fit_shaping_filter(density, band, 8), (order - 8) // 2)


def _refined(
    density: Callable[[FloatArray], FloatArray],
    band: tuple[float, float],
    noise: Callable[[FloatArray], FloatArray],
    first: ShapingFilter,
    added: int,
) -> ShapingFilter:
    """Return the fit of S + N that starts from another one with pole-zero pairs added."""
    omega, width = _nodes(density, band)
    S, N = np.asarray(density(omega)), np.asarray(noise(omega))
    peak = float(omega[np.argmax(S)])
    x = omega / peak
    zeros = int(np.flatnonzero(first.C[0])[0])
    sections = _sections(first) / (peak, 1.0)
    cumulated = np.cumsum(S * width)
    quantiles = (np.arange(added) + 0.5) / added * cumulated[-1]
    # Not quite on top of each other, so that the fit feels which way to part them.
    new = np.column_stack((np.interp(quantiles, cumulated, x), np.full(added, _ADDED_DAMPING)))
    poles = np.vstack((sections, new))
    n = len(poles)
    begin = np.log(np.vstack((poles, new * (1.02, 1.1)))).ravel()
    low, high = np.full(begin.size + 1, -np.inf), np.full(begin.size + 1, np.inf)
    low[1:-1:2], high[1:-1:2] = np.log(_DAMPING)
    # The tail's nodes are far apart: none of them may count more than those of the waves.
    weight = np.sqrt(np.minimum(width, width[0]) / (_WAVES * peak))
    target = np.log(S + N)

    def spectrum(values: FloatArray) -> FloatArray:
        """Return |H|^2/pi."""
        at, damping = np.exp(values[:-1]).reshape(-1, 2).T[:, :, None]
        size = np.log((at**2 - x**2) ** 2 + (2.0 * damping * at * x) ** 2)
        log = size[n:].sum(axis=0) - size[:n].sum(axis=0) + 2.0 * zeros * np.log(x)
        return np.asarray(np.exp(np.clip(log + values[-1], -600.0, 600.0)))

    def misfit(values: FloatArray) -> FloatArray:
        return np.asarray((np.log(spectrum(values) + N) - target) * weight)

    start = np.clip(np.append(begin, 0.0), low + 1e-6, high - 1e-6)
    start[-1] = np.log(cumulated[-1] / (spectrum(start) @ width))
    found = least_squares(misfit, start, bounds=(low, high), max_nfev=200)
    if not (np.all(np.isfinite(found.x)) and np.isfinite(found.cost)):
        raise SolverError("sea predictor: no shaping filter could be fitted")
    fitted = spectrum(found.x)
    A, B, C = _companion(np.exp(found.x[:-1]).reshape(-1, 2), n, zeros)
    return ShapingFilter(
        A=peak * A,
        B=np.sqrt(peak) * B,
        # Time in units of 1/peak becomes seconds: one root of the peak each in B and C.
        C=np.sqrt(np.exp(found.x[-1]) * np.pi * peak) * C,
        variance_error=float(fitted @ width / cumulated[-1]) - 1.0,
        shape_error=float(np.abs(fitted - S) @ width / cumulated[-1]),
    )


def _nodes(
    density: Callable[[FloatArray], FloatArray], band: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return nodes over the band, dense where the waves are, and their widths [rad/s]."""
    coarse = np.geomspace(*band, 2000)
    peak = float(coarse[np.argmax(density(coarse))])
    middle, high = min(_WAVES * peak, band[1]), min(_END * peak, band[1])
    edges = np.linspace(band[0], middle, _LINEAR + 1)
    if high > middle:
        edges = np.concatenate((edges, np.geomspace(middle, high, _TAIL + 1)[1:]))
    return 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)


def _sections(fit: ShapingFilter) -> FloatArray:
    """Return frequency [rad/s] and damping ratio of the quadratic sections (n/2, 2)."""
    poles = fit.poles
    real = np.sort(poles[np.abs(poles.imag) < 1e-9].real)
    upper = poles[poles.imag >= 1e-9]
    found = [(abs(p), -p.real / abs(p)) for p in upper.tolist()]
    for a, b in zip(real[::2].tolist(), real[1::2].tolist(), strict=True):
        at = (a * b) ** 0.5
        found.append((at, -0.5 * (a + b) / at))
    return np.array(found)


def _companion(
    sections: FloatArray, poles: int, zeros: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the controllable form of s^zeros times the sections after the first `poles`."""
    below, above = np.ones(1), np.ones(1)
    for i, (at, damping) in enumerate(sections.tolist()):
        factor = [1.0, 2.0 * damping * at, at**2]
        if i < poles:
            below = np.polymul(below, factor)
        else:
            above = np.polymul(above, factor)
    order = below.size - 1
    A = np.eye(order, k=1)
    A[-1] = -below[:0:-1]
    B = np.zeros((order, 1))
    B[-1] = 1.0
    C = np.zeros((1, order))
    C[0, zeros : zeros + above.size] = above[::-1]
    return A, B, C
