"""Complex arithmetic that CasADi lacks: a real and an imaginary part that travel together.

Synthesis evaluates closed-loop responses at a few hundred frequencies, once with numbers
(NumPy's own complex arrays) and once with symbols (CasADi knows only reals).  `Phasor`
gives the symbols the same operators, so that `synth.loop.loop` states every formula once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

# What both kinds of number share; NumPy and CasADi have no common static type.
Complex = Any


@dataclass(frozen=True)
class Phasor:
    """A vector of complex numbers as two CasADi vectors (or scalars) of equal shape."""

    re: Any
    im: Any

    def __add__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re + b.re, self.im + b.im)

    __radd__ = __add__

    def __neg__(self) -> Phasor:
        return Phasor(-self.re, -self.im)

    def __sub__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re - b.re, self.im - b.im)

    def __rsub__(self, other: Complex) -> Phasor:
        return _phasor(other) - self

    def __mul__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        return Phasor(self.re * b.re - self.im * b.im, self.re * b.im + self.im * b.re)

    __rmul__ = __mul__

    def __truediv__(self, other: Complex) -> Phasor:
        b = _phasor(other)
        scale = 1.0 / (b.re * b.re + b.im * b.im)
        return Phasor(
            (self.re * b.re + self.im * b.im) * scale, (self.im * b.re - self.re * b.im) * scale
        )

    def __rtruediv__(self, other: Complex) -> Phasor:
        return _phasor(other) / self

    def squared(self) -> Any:
        """Return the squared magnitude."""
        return self.re * self.re + self.im * self.im


def _phasor(value: Complex) -> Phasor:
    if isinstance(value, Phasor):
        return value
    if isinstance(value, complex | np.complexfloating):
        return Phasor(value.real, value.imag)
    return Phasor(value, 0.0)


def constant(values: npt.NDArray[np.complex128]) -> Phasor:
    """Return numbers, (k,), as a phasor of CasADi constants."""
    return Phasor(
        ca.DM(np.ascontiguousarray(values.real)), ca.DM(np.ascontiguousarray(values.imag))
    )


def squared_magnitude(value: Complex) -> Any:
    """Return |value|^2 of a phasor or of NumPy complex numbers."""
    if isinstance(value, Phasor):
        return value.squared()
    array = np.asarray(value)
    return array.real**2 + array.imag**2
