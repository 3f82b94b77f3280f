"""Dual numbers: arrays with their derivatives by a few variables, carried along exactly.

Forward-mode differentiation (Griewank and Walther, *Evaluating Derivatives*, 2nd ed., ch. 3) of
complex functions of real variables.  A controller's response and a limit's rows are written once,
with + - * / and the functions below; handed plain arrays they return numbers, handed `Dual` they
return the slopes too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class Dual:
    """Numbers (...,) with their derivatives by each of n variables, the slope (n, ...).

    `at` says which variables these are, ascending, where there are more of them: a chain of filters
    need not carry zeros for what others depend on.  Numbers that are added up or multiplied all say
    it or none does; the result depends on what either does.
    """

    __slots__ = ("at", "slope", "value")
    __array_ufunc__ = None  # so that an array on the left leaves the operation to this class

    def __init__(self, value: Array, slope: Array, at: tuple[int, ...] | None = None) -> None:
        self.value = value
        self.slope = slope
        self.at = at

    def __add__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            value = self.value + other.value
            return _together(value, self, self.slope, other, other.slope)
        value = self.value + other
        return Dual(value, self._spread(value), self.at)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope, self.at)

    def __sub__(self, other: Any) -> Dual:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Dual:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            value = self.value * other.value
            return _together(value, self, self.slope * other.value, other, other.slope * self.value)
        return Dual(self.value * other, self.slope * other, self.at)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        return self.__mul__(1.0 / other)

    def __rtruediv__(self, other: Any) -> Dual:
        value = other / self.value
        return Dual(value, -(value / self.value) * self.slope, self.at)

    def __matmul__(self, other: Array) -> Dual:
        """Return sums over the last axis, weighted by columns of plain numbers."""
        return Dual(self.value @ other, self.slope @ other)

    def __getitem__(self, key: Any) -> Dual:
        """Return some of the numbers, chosen along the last axis."""
        if isinstance(key, tuple):  # [..., key], as arrays with leading axes have it
            key = key[-1]
        return Dual(self.value[..., key], self.slope[..., key], self.at)

    def row(self, *index: Any) -> Dual:
        """Return some of the numbers, chosen along the first axes."""
        return Dual(self.value[index], self.slope[(slice(None), *index)], self.at)

    def _spread(self, value: Array) -> Array:
        """Return the slopes in the shape of a value that was broadcast."""
        shape = (len(self.slope), *np.shape(value))
        return self.slope if self.slope.shape == shape else np.broadcast_to(self.slope, shape)


def _together(value: Array, one: Dual, by_one: Array, other: Dual, by_other: Array) -> Dual:
    """Return a number whose slopes are the sum of two, each by what its number depends on."""
    if one.at == other.at:
        return Dual(value, by_one + by_other, one.at)
    assert one.at is not None
    assert other.at is not None
    at, rows, others = _union(one.at, other.at)
    slope = np.zeros((len(at), *value.shape), value.dtype)
    slope[rows] = by_one
    slope[others] += by_other
    return Dual(value, slope, at)


@lru_cache(maxsize=1024)
def _union(one: tuple[int, ...], other: tuple[int, ...]) -> tuple[tuple[int, ...], Any, Any]:
    """Return which variables either of two numbers depends on, and where each one's are there."""
    at = tuple(sorted({*one, *other}))

    def rows(own: tuple[int, ...]) -> Any:
        found = [at.index(i) for i in own]
        beside = slice(found[0], found[-1] + 1)
        return beside if found == list(range(len(at)))[beside] else found

    return at, rows(one), rows(other)


def real(x: Any) -> Any:
    """Return the real part."""
    return Dual(x.value.real, x.slope.real, x.at) if isinstance(x, Dual) else np.real(x)


def imag(x: Any) -> Any:
    """Return the imaginary part."""
    return Dual(x.value.imag, x.slope.imag, x.at) if isinstance(x, Dual) else np.imag(x)


def conj(x: Any) -> Any:
    """Return the complex conjugate."""
    return Dual(x.value.conj(), x.slope.conj(), x.at) if isinstance(x, Dual) else np.conj(x)


def squared(x: Any) -> Any:
    """Return the squared magnitude."""
    if not isinstance(x, Dual):
        return np.abs(x) ** 2
    return Dual(np.abs(x.value) ** 2, 2.0 * (np.conj(x.value) * x.slope).real, x.at)


def log(x: Any) -> Any:
    """Return the natural logarithm."""
    return mapped(x, np.log, lambda value, _: 1.0 / value)


def exp(x: Any) -> Any:
    """Return the exponential."""
    return mapped(x, np.exp, lambda _, result: result)


def sqrt(x: Any) -> Any:
    """Return the square root."""
    return mapped(x, np.sqrt, lambda _, result: 0.5 / result)


def where(condition: Array, x: Any, y: Any) -> Any:
    """Return x where a condition on numbers holds, y elsewhere."""
    if not isinstance(x, Dual) and not isinstance(y, Dual):
        return np.where(condition, x, y)
    slopes = [v.slope if isinstance(v, Dual) else 0.0 for v in (x, y)]
    return Dual(np.where(condition, value_of(x), value_of(y)), np.where(condition, *slopes))


def at_least(x: Any, least: float) -> Any:
    """Return x, or `least` where x is smaller."""
    return where(value_of(x) > least, x, least)


def joined(parts: Sequence[Any]) -> Any:
    """Return vectors end to end along the last axis."""
    if not any(isinstance(part, Dual) for part in parts):
        return np.concatenate(parts, axis=-1) if parts else np.zeros(0)
    count = next(len(part.slope) for part in parts if isinstance(part, Dual))
    duals = [part if isinstance(part, Dual) else constant(part, count) for part in parts]
    return Dual(
        np.concatenate([d.value for d in duals], axis=-1),
        np.concatenate([d.slope for d in duals], axis=-1),
    )


def constant(value: Any, count: int) -> Dual:
    """Return numbers that depend on none of `count` variables."""
    array = np.asarray(value)
    return Dual(array, np.zeros((count, *array.shape)))


def value_of(x: Any) -> Any:
    """Return the numbers without their slopes."""
    return x.value if isinstance(x, Dual) else x


def mapped(
    x: Any, function: Callable[[Array], Array], slope: Callable[[Array, Array], Array]
) -> Any:
    """Return a function of x, whose slope is a function of x and the function's value."""
    if not isinstance(x, Dual):
        return function(x)
    result = function(x.value)
    return Dual(result, slope(x.value, result) * x.slope, x.at)
