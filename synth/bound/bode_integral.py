r"""Bode's integral, and the estimate of what feedback can do in a band by it: `bode_estimate`.

For a stable loop gain that falls off at least as 1/s^2 (Bode 1945),

.. math::  \int_0^\infty \ln|S(i\omega)|\, d\omega = \pi \sum \mathrm{Re}\, p_k = 0 ,

p_k the unstable poles of L.  What ln|S| is below zero in the band of the waves it has to be above
zero elsewhere; with |S| <= M_s, and nothing left to give beyond the frequency `available` at
which the loop gain has gone (delay, rope modes, drive), an attenuation to eps over a band B needs

.. math::  \ln(1/\epsilon)\, B \le \ln(M_s)\, (\Omega - B) .

An estimate, for feedback alone: a sensor that hears the sea before the payload does (a motion
reference unit) is outside of it.  `synth.bound.bound` has the figure that counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.basics import ComplexArray, FloatArray, adaptive_nodes, check_range

from ..loop import Assessment

_GONE = 0.1  # loop gain below which nothing is left to trade
_QUANTILES = (0.05, 0.95)  # of the variance, between which a sea has its band


@dataclass(frozen=True, kw_only=True)
class BodeEstimate:
    """What feedback can do in a band, by Bode's integral.

    Attributes
    ----------
    band
        Width of the band of the disturbance [rad/s].
    available
        Frequency beyond which the loop has no gain left [rad/s].
    max_sensitivity
        M_s.
    least
        The smallest |S| over the whole band that these allow.
    achieved
        Geometric mean of |S| over the band; NaN if no loop was given.
    """

    band: float
    available: float
    max_sensitivity: float
    least: float
    achieved: float = math.nan

    def __str__(self) -> str:
        """Return the one line."""
        text = (
            f"Bode: with M_s {self.max_sensitivity:.3g} and {self.available:.3g} rad/s of loop, "
            f"feedback can hold |S| at {self.least:.3g} at best over {self.band:.3g} rad/s of sea"
        )
        return text if math.isnan(self.achieved) else f"{text}; this loop's is {self.achieved:.3g}"


def least_sensitivity(max_sensitivity: float, available: float, band: float) -> float:
    """Return the smallest |S| over a band [rad/s] for an M_s and an available bandwidth [rad/s].

    Raises
    ------
    InputError
        If M_s is below 1, or a frequency is not above zero.
    """
    peak = check_range("Bode integral", "max_sensitivity", max_sensitivity, low=1.0)
    width = check_range("Bode integral", "band", band, low=0.0, unit="rad/s", open_low=True)
    high = check_range(
        "Bode integral", "available", available, low=0.0, unit="rad/s", open_low=True
    )
    return math.exp(-math.log(peak) * max(high - width, 0.0) / width)


def bode_integral(
    log_sensitivity: Callable[[FloatArray], FloatArray],
    poles: ComplexArray,
) -> float:
    """Return the integral of ln|S| over the half line [rad/s].

    Parameters
    ----------
    log_sensitivity
        omega (k,) [rad/s] -> ln|S|.
    poles
        Poles of the loop [1/s], about which it varies.
    """
    sizes = np.abs(poles)
    sizes = sizes[sizes > 0.0]
    low, high = 1e-4 * float(sizes.min(initial=1.0)), 1e4 * float(sizes.max(initial=1.0))
    # ln|S| changes its sign, so the nodes are chosen by its size.
    nodes = adaptive_nodes(
        lambda w: np.abs(log_sensitivity(w)) ** 2 + 1e-300,
        low,
        high,
        poles=[complex(p) for p in poles if p.imag > 0.0 and p.real < 0.0],
        rtol=1e-9,
    )
    inside = float(nodes.integrate(log_sensitivity(nodes.omega)))
    ends = log_sensitivity(np.array([low, high]))
    # Even (or a mild logarithm) below; above, as 1/omega^2.
    return inside + low * float(ends[0]) + high * float(ends[1])


def bode_estimate(assessment: Assessment, *, available: float | None = None) -> BodeEstimate:
    """Return the estimate for a loop with one input and what shakes it first.

    Parameters
    ----------
    assessment
        The closed loop; its first disturbance has a band.
    available
        Frequency beyond which the loop has nothing to trade [rad/s]; by default where |L| falls
        below 0.1 for good.
    """
    sea = assessment.disturbances[0]
    low, high = sea.band or (1e-2, 1e2)
    edges = np.geomspace(low, high, 2000)
    omega, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    cumulated = np.cumsum(sea.density(omega) * width)
    begin, end = np.interp(_QUANTILES, cumulated / cumulated[-1], omega)
    top = available
    if top is None:
        strong = assessment.grid[np.abs(assessment.loop_gain(assessment.grid)) > _GONE]
        top = float(strong.max(initial=end))
    at = np.linspace(begin, end, 400)
    inside = np.log(np.abs(1.0 / (1.0 + assessment.loop_gain(at))))
    peak = assessment.margins.max_sensitivity
    return BodeEstimate(
        band=float(end - begin),
        available=top,
        max_sensitivity=peak,
        least=least_sensitivity(max(peak, 1.0), top, float(end - begin)),
        achieved=float(np.exp(np.mean(inside))),
    )
