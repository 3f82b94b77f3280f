"""The frequency axis of quadrature, and its cut into panels.

Behind :mod:`models.basics.quadrature`: log-frequency, optionally continued to zero and to infinity,
cut at kinks and refined towards poles.
"""

import cmath
import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .arrays import ComplexArray, FloatArray
from .checks import InputError, check_range

_HEAP = 0.03  # how far apart on the axis poles may be that count as one cut


class FrequencyAxis:
    """The axis t on which panels live: t = ln(omega / low), continued smoothly to 0 and infinity.

    Below `low` the map is omega = low (1 + t), above `high` it is omega = high / (1 - t + t_high);
    both join the logarithm with the same slope, and each panel lies in one piece only.
    """

    def __init__(self, low: float, high: float, half_line: bool) -> None:
        self.low = check_range("quadrature", "low", low, low=0.0, unit="rad/s", open_low=True)
        self.high = check_range(
            "quadrature", "high", high, low=self.low, unit="rad/s", open_low=True
        )
        self.end = math.log(self.high / self.low)
        self.half_line = half_line

    @property
    def edges(self) -> tuple[float, ...]:
        """Where the axis begins, changes its map and ends."""
        return (-1.0, 0.0, self.end, self.end + 1.0) if self.half_line else (0.0, self.end)

    def cut(self, omega: complex) -> complex:
        """Return t at a (complex) frequency."""
        size = abs(omega)
        if self.half_line and size < self.low:
            return omega / self.low - 1.0
        if self.half_line and size > self.high:
            return self.end + 1.0 - self.high / omega
        return cmath.log(omega / self.low)

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the frequencies [rad/s] of points of panels, (p, n), and slopes d omega/dt."""
        omega = self.low * np.exp(t)
        slope = omega
        if self.half_line:
            middle = 0.5 * (t[:, :1] + t[:, -1:])
            below, above = middle <= 0.0, middle >= self.end
            inverse = 1.0 / np.where(above, 1.0 - (t - self.end), 1.0)
            far = np.where(above, self.high * inverse, omega)
            slope = np.where(below, self.low, np.where(above, self.high * inverse**2, omega))
            omega = np.where(below, self.low * (1.0 + t), far)
        return omega, slope

    def rules(
        self, panels: Sequence[tuple[float, float]] | FloatArray, counts: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Return nodes and weights [rad/s] of panels one after the other, with so many nodes each.

        `counts` is one number for all panels, or one for each.
        """
        a, b = np.array(panels, dtype=np.float64).reshape(-1, 2).T[:, :, None]
        lengths = np.broadcast_to(counts, len(a))
        first = np.cumsum(lengths) - lengths
        omega, weights = np.empty((2, int(lengths.sum())))
        for count in np.unique(lengths):
            own = np.flatnonzero(lengths == count)
            x, w = _gauss_legendre(int(count))
            at, slope = self.at(0.5 * (a[own] + b[own]) + 0.5 * (b[own] - a[own]) * x)
            places = first[own, None] + np.arange(count)
            omega[places], weights[places] = at, 0.5 * (b[own] - a[own]) * w * slope
        return omega, weights

    def poles(self, poles: Iterable[complex]) -> list[complex]:
        """Return poles s as points t with a positive imaginary part."""
        marks = []
        for pole in poles:
            s = complex(pole)
            if s == 0.0:
                continue
            if s.real == 0.0 or not math.isfinite(abs(s)):
                raise InputError(
                    "quadrature: poles must be finite and off the imaginary axis, or the "
                    f"integral diverges; got {s:.6g} rad/s"
                )
            marks.append(self.cut(complex(abs(s.imag), abs(s.real))))
        return marks


def cut_panels(
    axis: FrequencyAxis,
    splits: Iterable[float],
    marks: Sequence[complex],
    longest: float,
    clearance: float,
) -> list[tuple[float, float]]:
    """Cut the axis into panels: at the splits, at most `longest`, and short near the poles.

    A panel's half-length is at most `clearance` times its distance from each pole.  Of poles in a
    heap far from the axis, such as the real ones of a rope's many pieces, one makes a cut.
    """
    first, last = axis.edges[0], axis.edges[-1]
    far = sorted(p.real for p in marks if 0.5 * longest <= clearance * p.imag)
    near = [p for p in marks if 0.5 * longest > clearance * p.imag]
    cuts = {*axis.edges, *(p.real for p in near)}
    heap = -math.inf
    for t in far:
        if t - heap > _HEAP:
            heap = t
            cuts.add(t)
    for omega in splits:
        value = check_range("quadrature", "splits", omega, low=0.0, unit="rad/s")
        if value > 0.0:
            cuts.add(axis.cut(complex(value)).real)
    inside: list[float] = []
    for t in sorted(c for c in cuts if first <= c <= last):
        # Two cuts closer than rounding would only make an empty panel; the axis's own stay.
        if not inside or t - inside[-1] > 1e-10 or t in axis.edges:
            inside.append(t)
    stack = []
    for a, b in pairwise(inside):
        edges = np.linspace(a, b, math.ceil((b - a) / longest) + 1)
        stack += [(float(x), float(y)) for x, y in pairwise(edges)]
    done, panels = [], np.array(stack).reshape(-1, 2)
    while len(panels):
        half = 0.5 * (panels[:, 1] - panels[:, 0])
        away = distance(panels[:, :1], panels[:, 1:], np.array(near, dtype=np.complex128))
        long = half > clearance * away.min(axis=1, initial=np.inf) * (1 + 1e-9)
        done += [(float(a), float(b)) for a, b in panels[~long]]
        middle = panels[long].mean(axis=1)
        panels = np.concatenate(
            [np.column_stack([panels[long, 0], middle]), np.column_stack([middle, panels[long, 1]])]
        )
    return sorted(done)


def distance(a: npt.ArrayLike, b: npt.ArrayLike, mark: ComplexArray) -> FloatArray:
    """Return how far points of the complex t plane lie from the panels [a, b]."""
    beside = np.maximum(np.maximum(np.asarray(a) - mark.real, mark.real - np.asarray(b)), 0.0)
    return np.asarray(np.hypot(beside, mark.imag))


def longest_panel(panels_per_decade: float) -> float:
    """Return the length of a panel on the axis, given how many make a decade."""
    check_range("quadrature", "panels_per_decade", panels_per_decade, low=1.0, high=1000.0)
    return math.log(10.0) / panels_per_decade


_gauss_legendre = lru_cache(maxsize=64)(np.polynomial.legendre.leggauss)
