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

import math
from dataclasses import dataclass

import numpy as np

from ..loop import Assessment

_GONE = 0.1  # loop gain below which nothing is left to trade
_NOTHING = 1e-3  # |S| below which the integral is no limit in practice
_RAISED = 1.2  # |S| from which a mode is told of
_LIGHT = 0.1  # damping ratio of one that rings
_QUANTILES = (0.05, 0.95)  # of the variance, between which a sea has its band


@dataclass(frozen=True, kw_only=True)
class BodeEstimate:
    """What feedback can do in a band, by Bode's integral."""

    band: float  #: Width of the band of the disturbance [rad/s].
    available: float  #: Frequency beyond which the loop has no gain left [rad/s].
    max_sensitivity: float  #: M_s.
    achieved: float  #: Geometric mean of |S| over the band.
    #: The lightly damped mode of the closed loop at which |S| is highest [rad/s], and |S| there;
    #: NaN without one.
    resonance: float = math.nan
    resonant: float = math.nan
    #: Damping ratios of that mode, and of the one next to it without the loop.
    damping: float = math.nan
    open_damping: float = math.nan

    @property
    def least(self) -> float:
        """The smallest |S| over the whole band that M_s and the available bandwidth allow."""
        spare = max(self.available - self.band, 0.0) / self.band
        return float(max(self.max_sensitivity, 1.0) ** -spare)

    @property
    def limits_band(self) -> bool:
        """Whether the integral alone keeps |S| in the band from what would be nothing."""
        return self.least > _NOTHING

    @property
    def pays_at_resonance(self) -> bool:
        """Whether the loop wins in the band, and makes a mode livelier for it."""
        livelier = self.damping < self.open_damping
        return self.achieved < 1.0 and livelier and self.resonant > _RAISED

    def __str__(self) -> str:
        """Return the one line; empty where the integral has nothing to say."""
        said = []
        if self.limits_band:
            said.append(
                f"with M_s {self.max_sensitivity:.3g} and {self.available:.3g} rad/s of loop, "
                f"feedback can hold |S| at {self.least:.3g} at best over {self.band:.3g} rad/s of "
                f"sea; this loop's is {self.achieved:.3g}"
            )
        if self.pays_at_resonance:
            said.append(
                f"what |S| is below one in the sea's band ({self.achieved:.2g} on average) it is "
                f"above one elsewhere: the resonance at {self.resonance:.3g} rad/s stands there at "
                f"|S| {self.resonant:.3g}, its damping {100.0 * self.damping:.2g} % instead of "
                f"{100.0 * self.open_damping:.2g} %, and cannot be damped without paying elsewhere"
            )
        return f"Bode's integral: {'; '.join(said)}" if said else ""


def bode_estimate(assessment: Assessment) -> BodeEstimate:
    """Return the estimate for a loop with one input and what shakes it first, in its band.

    The loop has something to trade up to where |L| falls below 0.1 for good.
    """
    sea = assessment.disturbances[0]
    low, high = sea.band or (1e-2, 1e2)
    edges = np.geomspace(low, high, 2000)
    omega, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    cumulated = np.cumsum(sea.density(omega) * width)
    begin, end = np.interp(_QUANTILES, cumulated / cumulated[-1], omega)
    strong = assessment.grid[np.abs(assessment.loop_gain(assessment.grid)) > _GONE]
    at = np.linspace(begin, end, 400)
    inside = np.log(np.abs(1.0 / (1.0 + assessment.loop_gain(at))))
    return BodeEstimate(
        band=float(end - begin),
        available=float(strong.max(initial=end)),
        max_sensitivity=assessment.max_sensitivity,
        achieved=float(np.exp(np.mean(inside))),
        **_resonance(assessment),
    )


def _resonance(assessment: Assessment) -> dict[str, float]:
    """Return the mode of the closed loop at which |S| is highest, if one rings."""
    closed, free = (
        p[(p.imag > 0.0) & (-p.real < _LIGHT * np.abs(p))]
        for p in (assessment.poles, assessment.plant.poles())
    )
    if not (closed.size and free.size):
        return {}
    size = 1.0 / np.abs(1.0 + assessment.loop_gain(closed.imag))
    k = int(np.argmax(size))
    mode = closed[k]
    before = free[np.argmin(np.abs(free.imag - mode.imag))]
    return {
        "resonance": float(mode.imag),
        "resonant": float(size[k]),
        "damping": float(-mode.real / abs(mode)),
        "open_damping": float(-before.real / abs(before)),
    }
