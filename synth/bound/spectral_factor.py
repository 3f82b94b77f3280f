r"""Rational spectral factors of seas, for the Riccati equations of a bound.

A spectrum of a table or a formula that is not rational is fitted by a stable, minimum-phase
filter,

.. math::

    \Psi(s) = g\, s^m \prod_j (s^2 + 2 \xi_j z_j s + z_j^2) \Big/
              \prod_i (s^2 + 2 \zeta_i \omega_i s + \omega_i^2) ,
    \qquad S(\omega) \approx |\Psi(i\omega)|^2 / \pi ,

two degrees short at least, so that the signal's derivative is proper as well.  The bound itself
does not rest on the fit: `synth.bound.truth` charges what the fit misses, which is the integral of
|F|^2 (S - |Psi|^2/pi)^2 / S, and just that, with |F| = 1, is about four times what is minimised
here, the squared difference of the amplitudes.  A low-pass spectrum such as that of a reference
unit's error is matched exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from models.basics import FloatArray, InputError, SolverError, check_range
from models.plant import ShapingFilter, controllable_form, sampled_density

from ..loop import Disturbance

_NODES = 300
_TAIL_WEIGHT = 0.02  # of the logarithm against the amplitude
_NEGLIGIBLE = 1e-7  # density over its peak's below which its logarithm does not matter
_WIDEST = (1e-4, 1e4)  # where a spectrum without a band is looked for [rad/s]
_DAMPING = (0.01, 3.0)
_EXACT = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectralFactor:
    """A fitted factor, which can be fitted anew with other weights."""

    #: Logarithms of the sections' frequencies over `peak` and dampings, and of the gain.
    values: FloatArray
    #: Second-order sections of the denominator, and zeros at the origin.
    sections: int
    origin: int
    #: Scales [rad/s], [unit squared].
    peak: float
    variance: float
    band: tuple[float, float]  #: Band that holds the spectrum's variance [rad/s].
    #: Frequencies [rad/s] and the true density there, (k,) each.
    omega: FloatArray
    target: FloatArray

    @cached_property
    def filter(self) -> ShapingFilter:
        """The filter, with the fit's errors."""
        A, B, C = controllable_form(*_split(self.values, self.sections), self.origin)
        order = np.argsort(self.omega)
        at, wanted = self.omega[order], self.target[order]
        inside = (at >= self.band[0]) & (at <= self.band[1])
        at, wanted = at[inside], wanted[inside]
        fitted = _shape(self.values, self.sections, self.origin, at / self.peak) ** 2
        fitted *= self.variance / self.peak
        held = float(np.trapezoid(wanted, at))
        return ShapingFilter(
            # Time in units of 1/peak becomes seconds: one root of the peak each in B and C.
            A=self.peak * A,
            B=np.sqrt(self.peak) * B,
            C=np.exp(self.values[-1]) * np.sqrt(self.variance) * np.sqrt(np.pi) * C,
            variance_error=float(np.trapezoid(fitted, at)) / held - 1.0,
            shape_error=float(np.trapezoid(np.abs(fitted - wanted), at)) / held,
        )

    def refitted(
        self, omega: FloatArray, target: FloatArray, weights: FloatArray
    ) -> SpectralFactor:
        """Return the factor that minimises sum(weights (density - target)^2), from this one.

        Nodes [rad/s], the true density and weights there are (k,) each.
        """
        x, scale = omega / self.peak, self.variance / self.peak
        root = np.sqrt(weights) * scale

        def misfit(values: FloatArray) -> FloatArray:
            return np.asarray(root * (_shape(values, self.sections, self.origin, x) ** 2 - wanted))

        wanted = target / scale
        ends = np.log(np.array(self.band) / self.peak)
        bounds = _bounds(self.sections, self.values.size, ends)
        size = float(np.linalg.norm(misfit(self.values))) or 1.0

        def scaled(values: FloatArray) -> FloatArray:
            return misfit(values) / size

        start = np.clip(self.values, *bounds)
        found = least_squares(scaled, start, bounds=bounds, max_nfev=60).x
        better = found if np.all(np.isfinite(found)) else self.values
        return replace(self, values=better, omega=omega, target=target)


def spectral_factor(disturbance: Disturbance, order: int = 8) -> SpectralFactor:
    """Return the filter whose response to white noise has about a disturbance's spectrum.

    It has `order` states, even, 2 to 12, or fewer where they are enough; the disturbance is not
    white.

    Raises InputError if the order is out of range or the spectrum holds no variance; SolverError if
    no fit converges.
    """
    band = disturbance.band or _occupied(disturbance)
    if disturbance.band is None:
        # Many an error model is a plain low-pass, which two states hold.
        simple = fit_spectral_factor(disturbance.density, band, 2)
        if simple.filter.shape_error < _EXACT:
            return simple
    return fit_spectral_factor(disturbance.density, band, order)


def fit_spectral_factor(
    density: Callable[[FloatArray], FloatArray], band: tuple[float, float], order: int = 8
) -> SpectralFactor:
    """Return the stable, minimum-phase filter that fits a one-sided density per rad/s best.

    That leads from omega [rad/s], (k,), to (k,); the band holds the variance [rad/s].  The order,
    of states, is even, 2 to 12.

    Raises InputError if the order is out of range, or the band is empty or holds no variance;
    SolverError if no fit converges.
    """
    check_range("spectral factor", "order", order, low=2, high=12)
    if order % 2:
        raise InputError(f"spectral factor: order must be even, 2 to 12, got {order!r}")
    omega, width, target, variance = sampled_density("spectral factor", density, band, _NODES)
    peak = float(omega[np.argmax(target * omega)])
    sections = order // 2
    x = omega / peak
    amplitude, root = np.sqrt(target * width / variance), np.sqrt(width / peak)
    seen = target > _NEGLIGIBLE * target.max()
    weight = _TAIL_WEIGHT / np.sqrt(max(1, int(seen.sum())))
    at = np.interp((np.arange(sections) + 0.5) / sections, np.cumsum(amplitude**2), x)
    # The misfit has one basin for each number of zeros at the origin and elsewhere: all that leave
    # the derivative proper are tried, from poles spread evenly over the variance.
    found: list[tuple[float, int, FloatArray]] = []
    for quadratics in range(min(1, sections - 1) + 1):
        start = np.concatenate(
            [np.log(at), np.full(sections, np.log(0.3)), np.zeros(quadratics), np.zeros(quadratics)]
        )
        low_at, high_at = _bounds(sections, start.size + 1, np.log(x[[0, -1]]))
        most = 2 * (sections - quadratics) - 2
        for origin in range(min(most, sections - 1), most + 1):

            def misfit(values: FloatArray, origin: int = origin) -> FloatArray:
                fitted = _shape(values, sections, origin, x) * root
                ratio = np.log(np.maximum(fitted[seen], 1e-300) / amplitude[seen])
                return np.concatenate([fitted - amplitude, weight * ratio])

            first = _shape(np.append(start, 0.0), sections, origin, x) * root
            gain = np.log(max(float(first @ amplitude) / float(first @ first), 1e-300))
            begin = np.clip(np.append(start, gain), low_at, high_at)
            fit = least_squares(misfit, begin, bounds=(low_at, high_at), max_nfev=80)
            if np.all(np.isfinite(fit.x)):
                found.append((float(fit.cost), origin, fit.x))
    if not found:
        raise SolverError("spectral factor: no fit converged")
    _, origin, values = min(found, key=lambda entry: entry[0])
    return SpectralFactor(
        values=values,
        sections=sections,
        origin=origin,
        peak=peak,
        variance=variance,
        band=band,
        omega=omega,
        target=target,
    )


def _bounds(sections: int, size: int, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of the parameters; frequencies stay about the band."""
    zeros = (size - 1 - 2 * sections) // 2
    about, damping = (ends[0] - 1.0, ends[1] + 1.0), tuple(np.log(_DAMPING))
    pairs = [about] * sections + [damping] * sections + [about] * zeros + [damping] * zeros
    low, high = np.array([*pairs, (-np.inf, np.inf)], dtype=np.float64).T
    return low, high


def _split(values: FloatArray, sections: int) -> tuple[FloatArray, FloatArray]:
    """Return (frequency, damping) of the sections of poles, and of zeros, (., 2)."""
    poles, zeros = np.exp(values[: 2 * sections]), np.exp(values[2 * sections : -1])
    return poles.reshape(2, -1).T, zeros.reshape(2, -1).T


def _shape(values: FloatArray, sections: int, origin: int, x: FloatArray) -> FloatArray:
    """Return sqrt(S) of a filter, for a variance and a peak of one."""
    size = np.ones_like(x)
    for rows, sign in zip(_split(values, sections), (-1.0, 1.0), strict=True):
        for at, damping in rows:
            size *= np.hypot(at**2 - x**2, 2.0 * damping * at * x) ** sign
    return np.asarray(np.exp(values[-1]) * x**origin * size)


def _occupied(disturbance: Disturbance) -> tuple[float, float]:
    """Return the band in which a spectrum without one has its variance [rad/s]."""
    omega = np.geomspace(*_WIDEST, 800)
    density = disturbance.density(omega)
    if not np.any(density > 0.0):
        raise InputError(f"spectral factor: {disturbance.name} must hold variance, got none")
    there = np.flatnonzero(density * omega > 1e-6 * np.max(density * omega))
    return float(omega[there[0]]), float(omega[there[-1]])
