"""Integrals over frequency by `scipy.integrate.quad_vec`, for the verification.

The optimiser integrates with `models.basics.quadrature`, panel by panel.  Here the band is cut into
panels of another kind and all of them are integrated at once, over a common coordinate from 0
to 1, by SciPy's adaptive Gauss-Kronrod rule.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.integrate

from models.basics import ComplexArray, FloatArray, SolverError

_INTERVALS = 40  # of quad_vec, each with 15 nodes on every panel
_PANELS_PER_DECADE = 4.0
_RINGING = 1e-7  # accuracy of integrals to infinity


def integrate(
    density: Callable[[FloatArray], FloatArray],
    edges: FloatArray,
    *,
    rtol: float,
    tail_panels: int = 0,
) -> FloatArray:
    """Return integrals over frequency, (m,), by quad_vec on all panels at once.

    Parameters
    ----------
    density
        omega (k,) [rad/s] -> integrands (m, k).
    edges
        Panel edges, ascending [rad/s].
    rtol
        Accuracy relative to each integral.
    tail_panels
        If above zero, go on from the first edge to zero, and from the last to infinity in so
        many panels of 1/omega: a few for a smooth tail, many for one that rings.

    Raises
    ------
    SolverError
        If quad_vec does not converge: the integral does not exist, or an integrand is wild.
    """
    half_line = tail_panels > 0
    left = np.append(0.0, edges[:-1]) if half_line else edges[:-1]
    width = np.diff(np.append(0.0, edges) if half_line else edges)
    # The tail in v = 1/omega.
    step = 1.0 / (max(1, tail_panels) * float(edges[-1]))
    tail = step * np.arange(float(tail_panels))

    def at(t: float) -> FloatArray:
        """Return the sum over all panels at their common coordinate t."""
        v = tail + t * step
        omega, weight = np.concatenate([left + t * width, 1.0 / v]), np.append(width, step / v**2)
        return np.asarray(density(omega) @ weight, dtype=np.float64)

    rule, weights = np.polynomial.legendre.leggauss(5)
    rough = np.stack([at(0.5 * (1.0 + float(t))) for t in rule], axis=1) @ (0.5 * weights)
    scale = np.where(rough > 0.0, rough, 1.0)
    # What is left of the ringing is far below the accuracy that it makes hard to prove.
    wanted = max(rtol, _RINGING) if half_line else rtol

    def scaled(t: float) -> FloatArray:
        return np.asarray(at(t) / scale, dtype=np.float64)

    result, error, info = scipy.integrate.quad_vec(
        scaled,
        0.0,
        1.0,
        epsrel=wanted,
        epsabs=0.0,
        norm="max",
        quadrature="gk15",
        limit=_INTERVALS,
        full_output=True,
    )
    # Status 2 is rounding: all that is left where a requested accuracy is beyond it.
    missed = info.status == 1 and not (half_line and error < 100.0 * wanted)
    if missed or not np.all(np.isfinite(result)):
        raise SolverError("verification: quad_vec does not converge on a spectral integral")
    return np.asarray(result * scale, dtype=np.float64)


def panels(
    low: float,
    high: float,
    splits: Sequence[float],
    marks: ComplexArray,
    longest: float = np.inf,
) -> FloatArray:
    """Return panel edges [rad/s]: even in log-frequency, at the kinks, denser near poles.

    Parameters
    ----------
    low, high
        Band [rad/s].
    splits
        Kinks [rad/s].
    marks
        Poles [1/s]; no panel is longer than twice its distance from one.
    longest
        Length that no panel exceeds [rad/s].
    """
    count = int(np.ceil(_PANELS_PER_DECADE * np.log10(high / low))) + 1
    kinks = np.asarray(splits, dtype=np.float64)
    edges = np.concatenate([np.geomspace(low, high, count), kinks])
    edges = np.unique(edges[(edges >= low) & (edges <= high)])
    at, off = np.abs(marks.imag), np.maximum(np.abs(marks.real), 1e-9 * np.abs(marks))
    at, off = at[off > 0.0], off[off > 0.0]  # an integrator is no feature above zero
    for _ in range(60):
        a, b = edges[:-1, None], edges[1:, None]
        away = np.hypot(np.maximum(np.maximum(a - at, at - b), 0.0), off)
        long = 0.5 * (b - a)[:, 0] > away.min(axis=1, initial=0.5 * longest)
        if not long.any():
            break
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])[long]]))
    return edges
