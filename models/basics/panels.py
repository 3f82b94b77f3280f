"""The frequency axis of quadrature, and its cut into panels.

Behind :mod:`models.basics.quadrature`: log-frequency, optionally continued to zero and to infinity,
cut at kinks and refined towards poles.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from .arrays import ComplexArray, FloatArray
from .checks import InputError, check_range

_STRAIGHT = 1e6j  # a pole so far off that a rule about it is as good as one about none


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

    def cut(self, omega: ComplexArray) -> ComplexArray:
        """Return t at (complex) frequencies."""
        found = np.log(omega / self.low)
        if self.half_line:
            size = np.abs(omega)
            found = np.where(size < self.low, omega / self.low - 1.0, found)
            found = np.where(size > self.high, self.end + 1.0 - self.high / omega, found)
        return np.asarray(found, dtype=np.complex128)

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
        self,
        panels: Sequence[tuple[float, float]] | FloatArray,
        counts: npt.ArrayLike,
        about: ComplexArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Return nodes and weights [rad/s] of panels one after the other, with so many nodes each.

        `counts` is one number for all panels, or one for each; panels are of t,
        or of u where it is t = c + d sinh(u), `about` c + i d for each.
        """
        a, b = np.array(panels, dtype=np.float64).reshape(-1, 2).T[:, :, None]
        lengths = np.broadcast_to(counts, len(a))
        first = np.cumsum(lengths) - lengths
        omega, weights = np.empty((2, int(lengths.sum())))
        for count in np.unique(lengths):
            own = np.flatnonzero(lengths == count)
            x, w = _gauss_legendre(int(count))
            half = 0.5 * (b[own] - a[own])
            t, w = 0.5 * (a[own] + b[own]) + half * x, half * w
            if about is not None:
                c, d = about[own, None].real, about[own, None].imag
                t, w = c + d * np.sinh(t), w * d * np.cosh(t)
            at, slope = self.at(t)
            places = first[own, None] + np.arange(count)
            omega[places], weights[places] = at, w * slope
        return omega, weights

    def poles(self, poles: Iterable[complex]) -> ComplexArray:
        """Return poles s as points t with a positive imaginary part."""
        every = np.array([complex(pole) for pole in poles], dtype=np.complex128)
        every = every[every != 0.0]
        for s in every[(every.real == 0.0) | ~np.isfinite(every)]:
            raise InputError(
                "quadrature: poles must be finite and off the imaginary axis, or the "
                f"integral diverges; got {s:.6g} rad/s"
            )
        return self.cut(np.abs(every.imag) + 1j * np.abs(every.real))


def cut_panels(
    axis: FrequencyAxis,
    splits: Iterable[float],
    marks: ComplexArray,
    longest: float,
    clearance: float,
) -> list[tuple[float, float]]:
    """Cut the axis into panels: at splits and poles, at most `longest`, and short near the poles.

    A panel's half-length is at most `clearance` times its distance from each pole.
    """
    near = marks[0.5 * longest > clearance * marks.imag]
    done, panels = [], _at_most(longest, axis, splits, marks.real)
    while len(panels):
        half = 0.5 * (panels[:, 1] - panels[:, 0])
        away = _distance(panels, near)
        long = half > clearance * away.min(axis=1, initial=np.inf) * (1 + 1e-9)
        done += [(float(a), float(b)) for a, b in panels[~long]]
        middle = panels[long].mean(axis=1)
        panels = np.concatenate(
            [np.column_stack([panels[long, 0], middle]), np.column_stack([middle, panels[long, 1]])]
        )
    return sorted(done)


def stretched_panels(
    axis: FrequencyAxis, splits: Iterable[float], marks: ComplexArray, longest: float
) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Cut the axis into panels, (p, 2), at most `longest`, at the splits and between the poles.

    They are of u, see `FrequencyAxis.rules`, in which the pole that each is about lies at i pi/2.
    Also return these poles, and how far any is then off, in half-lengths, (p,).  What is smooth is
    as if it had a pole at half the longest panel.
    """
    marks = np.unique(marks[marks.imag < 0.5 * longest])
    lone = np.zeros(0, np.complex128)
    for mark in marks[np.argsort(marks.imag)]:
        # Stretched about a narrow one, wider ones near it are as far off as it is.
        if np.all(np.abs(mark.real - lone.real) > mark.imag):
            lone = np.append(lone, mark)
    places = np.sort(lone.real)
    thirds = np.diff(places) / 3.0
    panels = _at_most(longest, axis, splits, [*(places[:-1] + thirds), *(places[1:] - thirds)])
    half = 0.5 * (panels[:, 1:] - panels[:, :1])
    away = np.column_stack([half, _distance(panels, lone)])
    about = np.append(_STRAIGHT, lone)[away.argmin(axis=1)]
    smooth = panels.mean(axis=1) + 0.5j * longest
    every = np.column_stack([np.broadcast_to(marks, (len(panels), marks.size)), smooth])
    c, d = about[:, None].real, about[:, None].imag
    ends = np.arcsinh((panels - c) / d)
    away = _distance(ends, np.arcsinh((every - c) / d))
    return ends, about, away.min(axis=1) / (0.5 * (ends[:, 1] - ends[:, 0]))


def _at_most(
    longest: float, axis: FrequencyAxis, splits: Iterable[float], cuts: list[float] | FloatArray
) -> FloatArray:
    """Return panels of a length at most, (p, 2), that end at the splits and at other cuts."""
    kinks = [check_range("quadrature", "splits", omega, low=0.0, unit="rad/s") for omega in splits]
    places = axis.cut(np.array([omega for omega in kinks if omega > 0.0], dtype=np.complex128)).real
    first, *_, last = axis.edges
    every = np.unique(np.concatenate([axis.edges, cuts, places]).clip(first, last))
    # Two cuts closer than rounding would only make an empty panel; the axis's own stay.
    ends = every[(np.diff(every, prepend=-np.inf) > 1e-10) | np.isin(every, axis.edges)]
    count = np.cumsum([0.0, *np.ceil(np.diff(ends) / longest)])
    edges = np.interp(np.arange(count[-1] + 1), count, ends)
    return np.column_stack([edges[:-1], edges[1:]])


def _distance(panels: FloatArray, mark: ComplexArray) -> FloatArray:
    """Return how far points of the complex t plane, (m,) or (p, m), lie from panels, (p, 2)."""
    beside = np.maximum(np.maximum(panels[:, :1] - mark.real, mark.real - panels[:, 1:]), 0.0)
    return np.asarray(np.hypot(beside, mark.imag))


def longest_panel(panels_per_decade: float) -> float:
    """Return the length of a panel on the axis, given how many make a decade."""
    check_range("quadrature", "panels_per_decade", panels_per_decade, low=1.0, high=1000.0)
    return math.log(10.0) / panels_per_decade


_gauss_legendre = lru_cache(maxsize=64)(np.polynomial.legendre.leggauss)
