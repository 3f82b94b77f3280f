"""A second-order Butterworth low-pass as one complex number.

The filter q'' + sqrt(2) w q' + w^2 q = input has the poles w (-1 +- i)/sqrt(2).  Its two real
states are the real and imaginary part of one mode, m = q' - conj(pole) q, which obeys
m' = pole m + input.  A long series then needs one recursion of the first order, which runs at
the speed of compiled code, and can be cut anywhere.  `models.sensing.mru` builds the reference
unit's heave filter and its error from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray


def low_pass_pole(corner: float) -> complex:
    """Return the pole in the upper half plane [rad/s] of a low-pass with this corner [rad/s]."""
    return corner * complex(-1.0, 1.0) / math.sqrt(2.0)


def to_mode(value: npt.ArrayLike, rate: npt.ArrayLike, pole: complex) -> ComplexArray:
    """Return the mode of a filter's value and its derivative."""
    v, r = np.asarray(value, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    return np.asarray(r - pole.conjugate() * v, dtype=np.complex128)


def from_mode(modes: ComplexArray, pole: complex) -> tuple[FloatArray, FloatArray]:
    """Return the filter's value and its derivative from its mode."""
    value = modes.imag / pole.imag
    return value, modes.real + pole.real * value


def mode_recursion(factor: complex, first: complex, drive: ComplexArray) -> ComplexArray:
    """Return x[0] = first, x[k + 1] = factor x[k] + drive[k]."""
    from scipy.signal import lfilter

    driven = np.concatenate(([first], drive)).astype(np.complex128)
    return np.asarray(lfilter([1.0], [1.0, -factor], driven), dtype=np.complex128)


def integrate_to(
    integrand: Callable[[FloatArray], ComplexArray], end: float, rate: float
) -> ComplexArray:
    """Return the integral from 0 to `end`, by Gauss-Legendre panels shorter than 1/rate."""
    panels = math.ceil(end * rate)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(0.0, end, panels + 1)
    half = 0.5 * np.diff(edges)
    t = (edges[:-1, None] + half[:, None] * (1.0 + nodes)).ravel()
    return np.asarray(integrand(t) @ (half[:, None] * weights).ravel(), dtype=np.complex128)


def noise_root(corner: float, step: float) -> FloatArray:
    """Return what a time step adds to white noise behind the low-pass, of variance 1 in all.

    Parameters
    ----------
    corner
        Corner frequency [rad/s].
    step
        Time step [s].

    Returns
    -------
    ndarray
        Lower triangular root (2, 2) of the covariance that value and derivative gain.
    """
    pole = low_pass_pole(corner)

    def integrand(t: FloatArray) -> ComplexArray:
        impulse, rate = from_mode(np.exp(pole * t), pole)
        return np.array((impulse**2, impulse * rate, rate**2), dtype=np.complex128)

    # From the integral itself: P - Phi P Phi' would lose all digits at short steps.
    strength = 2.0 * math.sqrt(2.0) * corner**3
    a, b, c = strength * integrate_to(integrand, step, abs(pole)).real
    return np.linalg.cholesky(np.array([[a, b], [b, c]]))
