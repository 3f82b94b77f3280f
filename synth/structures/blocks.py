r"""Filter sections with parameters, of which controller structures are put together.

Each section is one transfer function N(s/w)/D(s/w) with named, bounded parameters.  It says its
two polynomials; what the optimiser wants (`response`, numbers or duals) and what everything wants
that runs or checks the controller (`matrices`, a state-space form) follow from them.

* `RollOffFilter`: w^2 / (s^2 + 2 z w s + w^2), static gain 1
* `LeadLag`: (1 + s/w_z) / (1 + s/w_p), static gain 1
* `Notch`: (s^2 + 2 b d w s + w^2) / (s^2 + 2 b w s + w^2), static gain 1
* `Integral`: (s + w) / s, static gain infinite
* `LeadTime`: (1 + tau s) / (1 + s/w), static gain 1
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from models.basics import FloatArray

from .structure import Parameter

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class FilterSection(ABC):
    """A transfer function with parameters.

    Parameters
    ----------
    name
        What its parameters' names begin with: a corner becomes ``<name>.corner``.
    """

    name: str

    bounded: ClassVar[tuple[tuple[str, str], ...]]
    """Field of the bounds and unit of each parameter, in the order of the values."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order in which the methods take their values."""
        found = []
        for field, unit in self.bounded:
            low, high = getattr(self, field)
            scale = float(np.sqrt(low * high)) if low > 0.0 else high
            name = f"{self.name}.{field}"
            found.append(Parameter(name=name, scale=scale, low=low, high=high, unit=unit))
        return tuple(found)

    @abstractmethod
    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w [rad/s], and N and D by rising powers of s/w; D is without its last, 1."""

    def response(self, values: Sequence[Any], s: Any) -> Any:
        """Return the transfer function at s [1/s] for numbers or `synth.loop.Dual` values."""
        w, above, below = self.fraction(values)
        x = s * (1.0 / w)
        return _polynomial(above, x) / _polynomial([*below, 1.0], x)

    def matrices(self, values: Sequence[float]) -> Matrices:
        """Return A (n, n), B (n, 1), C (1, n), D (1, 1), its states the size of the signal."""
        w, above, below = self.fraction(values)
        n = len(below)
        above = [*above, *[0.0] * (n + 1 - len(above))]
        A, B = w * np.eye(n, k=1), w * np.eye(n)[:, -1:]
        A[-1] = -w * np.array(below)
        C = np.array([[above[k] - above[n] * below[k] for k in range(n)]])
        return A, B, C, np.full((1, 1), float(above[n]))

    def guess(self, points: FloatArray) -> FloatArray:
        """Return parameter values (m, k) from uniform `points` (m, k): sizes evenly in decades."""
        found = np.empty_like(points)
        for k, parameter in enumerate(self.parameters):
            low, high = parameter.low, parameter.high
            if low > 0.0:
                found[:, k] = low * (high / low) ** points[:, k]
            else:
                found[:, k] = low + (high - low) * points[:, k]
        return found


@dataclass(frozen=True, kw_only=True)
class RollOffFilter(FilterSection):
    """Second-order low-pass w^2 / (s^2 + 2 z w s + w^2).

    Parameters
    ----------
    corner, damping
        Bounds of w [rad/s] and z [-].
    """

    corner: Range
    damping: Range = (0.2, 2.0)

    bounded = (("corner", "rad/s"), ("damping", ""))

    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w and the polynomials; see `FilterSection.fraction`."""
        w, z = values
        return w, (1.0,), (1.0, 2.0 * z)


@dataclass(frozen=True, kw_only=True)
class LeadLag(FilterSection):
    """First-order lead or lag (1 + s/w_z) / (1 + s/w_p).

    Parameters
    ----------
    zero, pole
        Bounds of w_z and w_p [rad/s]: a lead has w_z < w_p, a lag w_z > w_p.
    """

    zero: Range
    pole: Range

    bounded = (("zero", "rad/s"), ("pole", "rad/s"))

    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w and the polynomials; see `FilterSection.fraction`."""
        zero, pole = values
        return pole, (1.0, pole / zero), (1.0,)


@dataclass(frozen=True, kw_only=True)
class Notch(FilterSection):
    """Notch (s^2 + 2 b d w s + w^2) / (s^2 + 2 b w s + w^2).

    Parameters
    ----------
    frequency, width, depth
        Bounds of w [rad/s], b [-] and d [-], which is the gain at w.
    """

    frequency: Range
    width: Range = (0.05, 2.0)
    depth: Range = (0.0, 1.0)

    bounded = (("frequency", "rad/s"), ("width", ""), ("depth", ""))

    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w and the polynomials; see `FilterSection.fraction`."""
        w, b, d = values
        return w, (1.0, 2.0 * b * d, 1.0), (1.0, 2.0 * b)


@dataclass(frozen=True, kw_only=True)
class Integral(FilterSection):
    """Integral action (s + w) / s.

    Parameters
    ----------
    corner
        Bounds of w [rad/s], above zero: with w = 0 the integrator would act on nothing and be
        there all the same.
    """

    corner: Range

    bounded = (("corner", "rad/s"),)

    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w and the polynomials; see `FilterSection.fraction`."""
        return values[0], (1.0, 1.0), (0.0,)


@dataclass(frozen=True, kw_only=True)
class LeadTime(FilterSection):
    """What a signal will be a lead time ahead, as far as its bandwidth goes.

    (1 + tau s) / (1 + s/w): the extrapolation x + tau x' behind a low-pass.

    Parameters
    ----------
    lead, bandwidth
        Bounds of tau [s] and w [rad/s].
    """

    lead: Range = (0.0, 2.0)
    bandwidth: Range = (2.0, 60.0)

    bounded = (("lead", "s"), ("bandwidth", "rad/s"))

    def fraction(self, values: Sequence[Any]) -> tuple[Any, Sequence[Any], Sequence[Any]]:
        """Return w and the polynomials; see `FilterSection.fraction`."""
        time, w = values
        return w, (1.0, time * w), (1.0,)


def series(first: Matrices, then: Matrices) -> Matrices:
    """Return two systems one behind the other; the first may have many inputs."""
    A1, B1, C1, D1 = first
    A2, B2, C2, D2 = then
    n1, n2 = len(A1), len(A2)
    A = np.block([[A1, np.zeros((n1, n2))], [B2 @ C1, A2]])
    return A, np.vstack([B1, B2 @ D1]), np.hstack([D2 @ C1, C2]), D2 @ D1


def _polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """Return a polynomial of x from its coefficients by rising powers (Horner)."""
    *rest, found = coefficients
    for coefficient in reversed(rest):
        found = x * found + coefficient
    return found
