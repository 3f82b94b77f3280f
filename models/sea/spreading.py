r"""Directional spreading: how the energy of a short-crested sea divides over headings.

A short-crested sea has the density S(omega) D(theta - mean), the integral of D over the circle
being one.  Two laws are in use (DNV-RP-C205, 3.5.8.4):

.. math::
    D(\theta) = C \cos^{2s}(\theta / 2), \qquad |\theta| \le \pi,
    \quad C = \frac{\Gamma(s + 1)}{2 \sqrt\pi\,\Gamma(s + 1/2)}

    D(\theta) = C \cos^{n} \theta, \qquad |\theta| \le \pi / 2,
    \quad C = \frac{\Gamma(n/2 + 1)}{\sqrt\pi\,\Gamma(n/2 + 1/2)}

the first `cos-2s` (Longuet-Higgins, Cartwright and Smith 1963), the second `cos-n`; close to the
mean heading s = 2 n + 1 makes them alike.

A motion's variance in such a sea is a mean of |H(omega, heading)|^2 over headings.
:meth:`Spreading.nodes` gives that mean as a weighted sum: the Gauss rule of the weight
(1 - x^2)^p, x the angle over its largest value and p the law's own power at the ends, because
what is left of the law, (cos / (1 - x^2))^p, is analytic also where p is no integer.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_choice, check_range

SPREADINGS = ("cos-2s", "cos-n")  #: The spreading laws by their names in a case file.

# With so many nodes every harmonic of the heading up to the 24th is integrated to 1e-9 at any
# exponent; the square of a motion has harmonics up to about four times the wave number times the
# distance of its point from the origin.
_NODES = {"cos-2s": 65, "cos-n": 33}


@dataclass(frozen=True, kw_only=True)
class Spreading:
    """A spreading law, `cos-2s` or `cos-n`, of an exponent s or n [-], 0 to 500.

    Wind seas have s about 5 to 15 (n 2 to 6), swell s of 30 and more.

    Raises InputError if the kind is unknown or the exponent out of range.

    Examples
    --------
    >>> law = Spreading(kind="cos-2s", exponent=7)
    >>> headings, weights = law.nodes(math.pi)
    >>> round(float(weights.sum()), 12)
    1.0
    >>> round(float(weights @ np.cos(headings)), 12)  # -s / (s + 1) about a head sea
    -0.875
    """

    kind: str
    exponent: float

    def __post_init__(self) -> None:
        """Check the values."""
        check_choice("spreading", "kind", self.kind, SPREADINGS)
        check_range("spreading", "exponent", self.exponent, low=0.0, high=500.0)

    def density(self, angle: npt.ArrayLike) -> FloatArray:
        """Return the share of the energy per radian at angles from the mean, any shape [rad]."""
        from scipy.special import gammaln  # here, so that a long-crested sea does not load it

        turned = np.asarray(angle, dtype=np.float64)
        offset = np.mod(turned + math.pi, 2.0 * math.pi) - math.pi
        base = np.maximum(np.cos(self._scale * offset), 0.0)
        inside = np.abs(offset) <= self._half_width
        power = self._power
        # C of both laws, in logarithms: the gamma functions overflow at an exponent of 171.
        log_c = gammaln(0.5 * power + 1.0) - gammaln(0.5 * power + 0.5)
        factor = self._scale * math.exp(float(log_c)) / math.sqrt(math.pi)
        result: FloatArray = np.where(inside, factor * base**power, 0.0)
        return result

    def nodes(self, mean_heading: float, count: int | None = None) -> tuple[FloatArray, FloatArray]:
        """Return headings in [0, 2 pi) [rad] and weights [-] of the mean over directions, (n,).

        They are in the order of their angle from the mean heading, where most waves travel towards,
        counter-clockwise from the bow [rad]; ``weights @ f(headings)`` is the mean of f.  By
        default they are 65 for `cos-2s` and 33 for `cos-n`; odd numbers include the mean heading.

        Raises InputError if the heading is not finite or the count below one.
        """
        from scipy.special import roots_gegenbauer

        mean = check_range("spreading", "mean_heading", mean_heading, unit="rad")
        number = _NODES[self.kind] if count is None else count
        if number < 1:
            raise InputError(f"spreading: count must be at least 1, got {count!r}")
        power = self._power
        x, rule = roots_gegenbauer(number, power + 0.5)
        ends = 1.0 - x * x
        weights = rule * (np.cos(0.5 * math.pi * x) / ends) ** power
        weights /= weights.sum()
        turned = np.mod(mean + self._half_width * x, 2.0 * math.pi)
        # A heading a hair below zero is rounded up to a whole turn.
        headings: FloatArray = np.where(turned < 2.0 * math.pi, turned, 0.0)
        return headings, weights

    @property
    def deviation(self) -> float:
        """Circular standard deviation, sqrt(2 (1 - r)) with r the first harmonic [rad]."""
        headings, weights = self.nodes(0.0, 129)
        return math.sqrt(max(2.0 * (1.0 - float(weights @ np.cos(headings))), 0.0))

    @property
    def _scale(self) -> float:
        return 0.5 if self.kind == "cos-2s" else 1.0

    @property
    def _half_width(self) -> float:
        return math.pi if self.kind == "cos-2s" else 0.5 * math.pi

    @property
    def _power(self) -> float:
        return 2.0 * self.exponent if self.kind == "cos-2s" else self.exponent
