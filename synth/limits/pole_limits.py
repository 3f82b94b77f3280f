"""Limits on the closed loop's poles: least decay rate, least damping ratio, highest frequency.

The poles are those that `synth.loop.PoleRegion` counts, with Pade models for delays.  Their rows
are on sums and products of pairs, smooth where two of them meet: a slowest or fastest pole is
often double at the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from typing_extensions import override

from models.basics import BoolArray, check_range

from ..loop import joined, log, real, squared, value_of, where
from .limits import Limit, Symbols

if TYPE_CHECKING:
    from ..loop import Assessment

_ASIDE = -1.0  # the row of a pole that does not count


@dataclass(frozen=True, kw_only=True)
class LeastDecay(Limit):
    """Every pole decays at a rate -Re s of at least `bound` [1/s]."""

    name: str = "decay"
    unit: str = "1/s"
    at_least: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_range("LeastDecay", "bound", self.bound, low=0.0, unit="1/s", open_low=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        poles, _, _ = symbols.poles
        total, product, counted = _pairs(poles, np.ones_like(value_of(poles).real, np.bool_))
        apart = (product - total * bound + bound * bound) / product  # (p1 - bound)(p2 - bound)
        return joined([where(counted, row, _ASIDE) for row in (log(2.0 * bound / total), -apart)])

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.pole_region.decay


@dataclass(frozen=True, kw_only=True)
class LeastDamping(Limit):
    """Every pole has a damping ratio -Re s/|s| of at least `bound`, up to 1."""

    name: str = "damping"
    at_least: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_range("LeastDamping", "bound", self.bound, low=0.0, high=1.0, open_low=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        poles, swinging, _ = symbols.poles
        total, product, counted = _pairs(poles, swinging)
        return where(counted, log(product) * 0.5 - log(total / (2.0 * bound)), _ASIDE)

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.pole_region.damping


@dataclass(frozen=True, kw_only=True)
class HighestFrequency(Limit):
    """No pole is faster than |s| = `bound` [rad/s]."""

    name: str = "frequency"
    unit: str = "rad/s"

    def __post_init__(self) -> None:
        check_range("HighestFrequency", "bound", self.bound, low=0.0, unit="rad/s", open_low=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        poles, _, own = symbols.poles
        total, product, counted = _pairs(poles, own)
        apart = (product - total * bound + bound * bound) / (bound * bound)
        rows = log(product / (bound * bound)) * 0.5, log(total / (2.0 * bound)), -apart
        return joined([where(counted, row, _ASIDE) for row in rows])

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.pole_region.frequency


def _pairs(poles: Any, counted: BoolArray) -> tuple[Any, Any, BoolArray]:
    """Return sum and product of pairs of rates -s, and which of the pairs count.

    Two real poles that meet and swing move infinitely fast, but not these.  So neighbours on the
    real axis are a pair as conjugates are; of many loops at once, and alone, a pole is its own.
    """
    values = value_of(poles)
    if values.ndim > 1:
        return real(poles) * -2.0, squared(poles), counted
    up = np.flatnonzero(counted & (values.imag != 0.0))
    level = np.flatnonzero(counted & (values.imag == 0.0))
    level = level[np.argsort(values[level].real)]
    first, second = (level, level) if level.size == 1 else (level[:-1], level[1:])
    one, other = real(poles)[first], real(poles)[second]
    total = joined([real(poles)[up] * -2.0, -(one + other)])
    product = joined([squared(poles)[up], one * other])
    return total, product, np.ones_like(value_of(total), np.bool_)
