r"""Shaping filters: stable, with a sea's spectrum as their response to white noise.

A spectral integral is finite for an unstable loop too, and takes the delay as a mere phase.  A
Lyapunov equation does neither: it needs states, for the sea as well.  This fits them,

.. math::

    H(s) = g\, s^m \Big/ \prod_{i=1}^{n/2} (s^2 + 2 \zeta_i \omega_i s + \omega_i^2),
    \qquad S(\omega) \approx |H(i\omega)|^2 / \pi ,

by least squares on the amplitude, the square root of the density, and a little on the logarithm
of the tail, which a stiff loop is the first to feel (the classic second-order form with n = 2
and m = 1 is that of Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2011,
sec. 8.2).  The poles are stable by construction; the m zeros at the origin take the drift out
of the waves.  White noise has intensity one, a one-sided density of 1/pi.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from ..basics import ComplexArray, FloatArray, InputError, ReadOnlyArrays, SolverError
from .resolvent import Resolvent

_NODES = 240
_TAIL_WEIGHT = 0.03  # of the tail's logarithm against the amplitude
_NEGLIGIBLE = 1e-9  # density over its peak's below which the tail does not matter
_LEAST_DAMPING, _MOST_DAMPING = 0.01, 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapingFilter(ReadOnlyArrays):
    """x' = A x + B n, signal C x, its derivative C A x; n is white noise of intensity one."""

    #: State matrices, (n, n), (n, m), (1, n).
    A: FloatArray
    B: FloatArray
    C: FloatArray
    #: Variance of the fitted spectrum over that of the given one, minus one, in the band.
    variance_error: float
    #: Integral of the difference's modulus over the given variance (an L1 measure).
    shape_error: float

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def poles(self) -> ComplexArray:
        """Poles of the filter [1/s]."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)

    def density(self, omega: npt.ArrayLike) -> FloatArray:
        """Return the one-sided density of the fitted spectrum per rad/s at `omega` [rad/s]."""
        s = 1j * np.asarray(omega, dtype=np.complex128).reshape(-1)
        gain = self._resolvent.between(self.C, self.B)(s)
        assert gain is not None  # the filter is stable
        return np.asarray(((np.abs(gain) ** 2).sum(axis=-1) / np.pi).reshape(np.shape(omega)))

    @cached_property
    def _resolvent(self) -> Resolvent:
        return Resolvent(self.A)


def fit_shaping_filter(
    density: Callable[[FloatArray], FloatArray], band: tuple[float, float], order: int = 8
) -> ShapingFilter:
    """Return the filter of 4, 6 or 8 states that fits a one-sided density per rad/s best.

    That leads from omega [rad/s], (k,), to (k,); the band holds the variance [rad/s].

    Raises InputError if the band holds no variance; SolverError if the fit does not converge.
    """
    target = sampled_density("shaping filter", density, band, _NODES)[2]
    return _fitted(target.tobytes(), band, order)


@lru_cache(maxsize=8)
def _fitted(samples: bytes, band: tuple[float, float], order: int) -> ShapingFilter:
    """Return `fit_shaping_filter` of a density's samples: many designs are for one sea."""
    known = np.frombuffer(samples)
    omega, width, target, variance = sampled_density("", lambda _: known, band, _NODES)
    low, high = band
    cumulated = np.cumsum(target * width) / variance
    peak = float(omega[np.argmax(target)])
    sections = order // 2
    # One section at each of as many quantiles of the variance.
    quantiles = (np.arange(sections) + 0.5) / sections
    begin_at = np.log(np.interp(quantiles, cumulated, omega) / peak)
    begin = np.concatenate([begin_at, np.full(sections, np.log(0.2)), [0.0]])
    lowest = np.full(2 * sections + 1, np.log(low / peak) - 1.0)
    highest = np.full(2 * sections + 1, np.log(high / peak) + 1.0)
    damping_range = slice(sections, 2 * sections)
    lowest[damping_range], highest[damping_range] = np.log(_LEAST_DAMPING), np.log(_MOST_DAMPING)
    lowest[-1], highest[-1] = -np.inf, np.inf
    x, amplitude = omega / peak, np.sqrt(target * width / variance)
    tail = (x > 1.0) & (target > _NEGLIGIBLE * target.max())
    weight = _TAIL_WEIGHT / np.sqrt(max(1, int(tail.sum())))

    def shape(values: FloatArray, zeros: int) -> FloatArray:
        """Return sqrt(S d omega) of the filter."""
        at = np.exp(values[:sections, None])
        damping = np.exp(values[damping_range, None])
        below = np.prod(np.hypot(at**2 - x**2, 2.0 * damping * at * x), axis=0)
        return np.asarray(np.exp(values[-1]) * x**zeros / below * np.sqrt(width))

    def misfit(values: FloatArray, zeros: int) -> FloatArray:
        fitted = shape(values, zeros)
        ratio = np.log(fitted[tail] / amplitude[tail])
        return np.concatenate([fitted - amplitude, weight * ratio])

    fits = []
    # At most n - 2 zeros: the signal's derivative must be proper as well.
    for zeros in range(max(1, sections - 1), order - 1):
        start = begin.copy()
        first = shape(start, zeros)
        start[-1] = np.log(first @ amplitude / (first @ first))
        found = least_squares(misfit, start, bounds=(lowest, highest), args=(zeros,), max_nfev=100)
        if np.all(np.isfinite(found.x)):
            fits.append((float(found.cost), zeros, found.x))
    if not fits:
        raise SolverError("shaping filter: no fit converged")
    _, zeros, values = min(fits, key=lambda fit: fit[0])
    poles = np.exp(values[:-1]).reshape(2, -1).T
    A, B, C = controllable_form(poles, np.empty((0, 2)), zeros)
    spectrum = variance * shape(values, zeros) ** 2 / width
    gain = np.exp(values[-1]) * np.sqrt(variance)
    return ShapingFilter(
        A=peak * A,
        B=np.sqrt(peak) * B,
        # Time in units of 1/peak becomes seconds: one root of the peak each in B and C.
        C=gain * np.sqrt(np.pi * peak) * C,
        variance_error=float(spectrum @ width) / variance - 1.0,
        shape_error=float(np.abs(spectrum - target) @ width) / variance,
    )


def sampled_density(
    owner: str, density: Callable[[FloatArray], FloatArray], band: tuple[float, float], nodes: int
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return nodes of a band evenly in the logarithm, their widths, the density, its variance.

    Raises InputError if the band holds no variance.
    """
    edges = np.geomspace(*band, nodes + 1)
    omega, width = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    target = np.asarray(density(omega), dtype=np.float64)
    variance = float(target @ width)
    if not (np.isfinite(variance) and variance > 0.0):
        raise InputError(f"{owner}: the band must hold variance, got {variance:g}")
    return omega, width, target, variance


def controllable_form(
    poles: FloatArray, zeros: FloatArray, origin: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, B, C of s^origin times sections of zeros over sections of poles, second-order each.

    A section has a frequency [rad/s] and a damping ratio, (., 2).
    """
    below, above = np.ones(1), np.ones(1)
    for at, damping in poles:
        below = np.polymul(below, [1.0, 2.0 * damping * at, at**2])
    for at, damping in zeros:
        above = np.polymul(above, [1.0, 2.0 * damping * at, at**2])
    above = np.concatenate([above, np.zeros(origin)])
    order = below.size - 1
    A = np.eye(order, k=1)
    A[-1] = -below[:0:-1]
    B = np.zeros((order, 1))
    B[-1] = 1.0
    C = np.zeros((1, order))
    C[0, : above.size] = above[::-1]
    return A, B, C
