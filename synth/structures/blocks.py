r"""Filter sections with parameters, of which controller structures are put together.

Each section is one transfer function N(s/w)/D(s/w) with named, bounded parameters.  It says its
two polynomials; what the optimiser wants (`response`, numbers or duals) and what everything wants
that runs or checks the controller (`matrices`, a state-space form) follow from them.

* `roll_off`: w^2 / (s^2 + 2 z w s + w^2), static gain 1
* `lead_lag`: (1 + s/w_z) / (1 + s/w_p), static gain 1
* `notch`: (s^2 + 2 b d w s + w^2) / (s^2 + 2 b w s + w^2), static gain 1
* `integral`: (s + w) / s, static gain infinite
* `lead_time`: (1 + tau s) / (1 + s/w), static gain 1
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.basics import FloatArray

from .structure import Parameter

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Range = tuple[float, float]


Fraction = Callable[..., tuple[Any, Sequence[Any], Sequence[Any]]]


@dataclass(frozen=True, kw_only=True)
class FilterSection:
    """A transfer function with parameters."""

    name: str  #: What its parameters' names begin with: a corner becomes ``<name>.corner``.
    #: Bounds and unit of each parameter, in the order in which the methods take their values.
    ranges: Mapping[str, tuple[float, float, str]]
    #: From the values to w [rad/s], and N and D by rising powers of s/w; D is without its last, 1.
    fraction: Fraction

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order in which the methods take their values."""
        found = []
        for own, (low, high, unit) in self.ranges.items():
            scale = float(np.sqrt(low * high)) if low > 0.0 else high
            name = f"{self.name}.{own}"
            found.append(Parameter(name=name, scale=scale, low=low, high=high, unit=unit))
        return tuple(found)

    def response(self, values: Sequence[Any], s: Any) -> Any:
        """Return the transfer function at s [1/s] for numbers or `synth.loop.Dual` values."""
        w, above, below = self.fraction(*values)
        x = s * (1.0 / w)
        return _polynomial(above, x) / _polynomial([*below, 1.0], x)

    def matrices(self, values: Sequence[float]) -> Matrices:
        """Return A (n, n), B (n, 1), C (1, n), D (1, 1), its states the size of the signal."""
        w, above, below = self.fraction(*values)
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


def roll_off(name: str, corner: Range, damping: Range = (0.2, 2.0)) -> FilterSection:
    """Return a second-order low-pass w^2 / (s^2 + 2 z w s + w^2).

    `corner` and `damping` are the bounds of w [rad/s] and z [-].
    """
    return FilterSection(
        name=name,
        ranges={"corner": (*corner, "rad/s"), "damping": (*damping, "")},
        fraction=lambda w, z: (w, (1.0,), (1.0, 2.0 * z)),
    )


def lead_lag(name: str, zero: Range, pole: Range) -> FilterSection:
    """Return a first-order lead or lag (1 + s/w_z) / (1 + s/w_p).

    `zero` and `pole` are the bounds of w_z and w_p [rad/s]: a lead has w_z < w_p, a lag w_z > w_p.
    """
    return FilterSection(
        name=name,
        ranges={"zero": (*zero, "rad/s"), "pole": (*pole, "rad/s")},
        fraction=lambda zero, pole: (pole, (1.0, pole / zero), (1.0,)),
    )


def notch(name: str, frequency: Range) -> FilterSection:
    """Return a notch (s^2 + 2 b d w s + w^2) / (s^2 + 2 b w s + w^2).

    `frequency` are the bounds of w [rad/s]; b is the width [-], and d [-] the gain at w.
    """
    return FilterSection(
        name=name,
        ranges={
            "frequency": (*frequency, "rad/s"),
            "width": (0.05, 2.0, ""),
            "depth": (0.0, 1.0, ""),
        },
        fraction=lambda w, b, d: (w, (1.0, 2.0 * b * d, 1.0), (1.0, 2.0 * b)),
    )


def integral(name: str, corner: Range) -> FilterSection:
    """Return integral action (s + w) / s.

    `corner` are the bounds of w [rad/s], above zero: with w = 0 the integrator would act on nothing
    and be there all the same.
    """
    return FilterSection(
        name=name,
        ranges={"corner": (*corner, "rad/s")},
        fraction=lambda w: (w, (1.0, 1.0), (0.0,)),
    )


def lead_time(name: str, bandwidth: Range = (2.0, 60.0)) -> FilterSection:
    """Return what a signal will be a lead time ahead, as far as its bandwidth goes.

    (1 + tau s) / (1 + s/w): the extrapolation x + tau x' behind a low-pass.  tau [s] is the lead,
    and `bandwidth` are the bounds of w [rad/s].
    """
    return FilterSection(
        name=name,
        ranges={"lead": (0.0, 2.0, "s"), "bandwidth": (*bandwidth, "rad/s")},
        fraction=lambda time, w: (w, (1.0, time * w), (1.0,)),
    )


def series(first: Matrices, then: Matrices) -> Matrices:
    """Return two systems one behind the other; the first may have many inputs."""
    A1, B1, C1, D1 = first
    A2, B2, C2, D2 = then
    n = len(A1)
    A = np.zeros((n + len(A2), n + len(A2)))  # np.block takes ten times as long
    A[:n, :n], A[n:, :n], A[n:, n:] = A1, B2 @ C1, A2
    return A, np.concatenate([B1, B2 @ D1]), np.concatenate([D2 @ C1, C2], axis=1), D2 @ D1


def _polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """Return a polynomial of x from its coefficients by rising powers (Horner)."""
    *rest, found = coefficients
    for coefficient in reversed(rest):
        found = x * found + coefficient
    return found
