r"""Capability lines of a winch: heave height over period that it can follow, in regular heave.

A hook that heaves as a sine of double amplitude H and period T moves at up to v = pi H / T and
accelerates at up to a = 2 pi^2 H / T^2.  A winch that is to hold the rope's upper end still can do
so up to

.. math::

    H = v T / \pi, \qquad H = a T^2 / (2 \pi^2), \qquad
    a = (T_{peak} - |T_{static}| - T_{loss})\, r / (n I),

and the maker's sheet draws these lines.  Here they come from the same responses as the irregular
contours (`systems.PerfectSystem`), so friction and, of a DC motor, resistance are in them too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, Quadrature, ReadOnlyArrays

from ..limits import Breakdown, Continuous, Limit, Peak, Power, Thermal
from .systems import PerfectSystem


@dataclass(frozen=True, kw_only=True, eq=False)
class Capability(ReadOnlyArrays):
    """Largest regular heave that a winch can follow."""

    periods: FloatArray  #: Periods of the heave (p,) [s].
    criteria: tuple[Limit, ...]  #: The limits of the winch (c,).
    #: Double amplitude of the hook's heave at which each is reached (c, p) [m]; 0 where the load at
    #: rest breaks it.
    heights: FloatArray

    @property
    def limit(self) -> FloatArray:
        """The lowest of them (p,) [m]."""
        return np.asarray(self.heights.min(axis=0))


def capability(
    system: PerfectSystem, criteria: Sequence[Limit], periods: npt.ArrayLike
) -> Capability:
    """Return the largest regular heave that a winch can follow at given periods [s] (p,).

    Its limits are those of peaks, of continuous ratings, and of power (on the box of the two
    peaks).
    """
    given = np.asarray(periods, dtype=np.float64)
    order = np.argsort(-given)  # nodes ascend
    omega = 2.0 * math.pi / given[order]
    base = system.responses(Quadrature(omega=omega, weights=np.ones_like(omega)))
    shown = {name: base.table[k, 0] for k, name in enumerate(base.outputs)}
    rows = []
    for limit in criteria:
        amplitude = _amplitude(limit, shown)
        row = np.empty_like(given)
        row[order] = 2.0 * np.maximum(amplitude, 0.0)
        rows.append(row)
    return Capability(periods=given, criteria=tuple(criteria), heights=np.array(rows))


@dataclass(frozen=True, kw_only=True)
class _Sine:
    """A heave of amplitudes (p,) [m] as the limits see it (`synth.limits.Symbols`)."""

    amplitude: FloatArray
    shown: dict[str, ComplexArray]

    def moment(self, output: str, order: int) -> FloatArray:
        """Return the variance of an output."""
        del order
        return self.covariance(output, output)

    def covariance(self, one: str, other: str) -> FloatArray:
        """Return the covariance of two outputs."""
        product = (self.shown[one].conj() * self.shown[other]).real
        return np.asarray(0.5 * self.amplitude**2 * product)

    def peak(self, output: str, duration: float) -> FloatArray:
        """Return the amplitude of an output."""
        del duration
        return self.amplitude * np.abs(self.shown[output])


def _amplitude(limit: Limit, shown: dict[str, ComplexArray]) -> FloatArray:
    """Return the amplitude of the heave at which a limit is reached (p,) [m]."""
    sizes = {name: np.abs(response) for name, response in shown.items()}
    if isinstance(limit, Breakdown | Thermal):

        def excess(size: FloatArray) -> FloatArray:
            return np.asarray(limit.rows(_Sine(amplitude=size, shown=shown), limit.bound))  # type: ignore[arg-type]

        low, high = np.zeros_like(sizes[limit.speed]), np.full_like(sizes[limit.speed], 1e4)
        for _ in range(60):
            middle = 0.5 * (low + high)
            kept = excess(middle) <= 0.0
            low, high = np.where(kept, middle, low), np.where(kept, high, middle)
        return low
    if isinstance(limit, Peak):
        return (limit.bound - abs(limit.static) - limit.loss) / sizes[limit.output]
    if isinstance(limit, Continuous):
        # The rms of a sine is its amplitude over sqrt(2).
        room = max(limit.bound**2 - limit.static**2 - limit.loss**2, 0.0)
        return math.sqrt(2.0 * room) / sizes[limit.output]
    assert isinstance(limit, Power)
    # (|static| + t A) s A = bound, for the torque t and the speed s of an amplitude of one metre.
    t, s, static = sizes[limit.torque], sizes[limit.speed], abs(limit.static) + limit.loss
    root = np.sqrt((static * s) ** 2 + 4.0 * t * s * limit.bound)
    return np.asarray(2.0 * s * limit.bound / (s * (static * s + root)))
