"""Distributions of one number: where its values lie, and their quantiles.

A value may be a number in SI, a text with a unit (``50 ms``), or a percentage of the case's own
value: ``-10 %`` is a tenth below it, and a width of ``10 %`` is a tenth of it.  Texts are read
when the spread meets a case (`models.spread.spread.Spread.on`), which knows units and values;
until then a distribution is only a description.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from scipy.special import ndtr, ndtri
from typing_extensions import override

from ..basics import FloatArray, InputError, check_finite, check_range
from .distribution import (
    NOMINAL,
    TAIL,
    Distribution,
    Read,
    Value,
    cuts_of,
    ends_of,
    narrowed,
    number,
)


@dataclass(frozen=True)
class Uniform(Distribution):
    """Every value between two ends is as likely.

    Parameters
    ----------
    low, high
        The ends.  With `low` alone it is how far the value may be off either way:
        ``Uniform("20 %")``, ``Uniform("20 ms")``.
    """

    low: Value
    high: Value | None = None
    name: ClassVar[str] = "uniform"

    def __post_init__(self) -> None:
        if self.numeric:
            self._check()

    @override
    def resolved(self, place: Read, width: Read) -> Uniform:
        if self.high is None:
            middle, half = place(NOMINAL), width(self.low)
            if half < 0.0:
                raise InputError(f"must have a width of at least 0, got {self.low!r}")
            return Uniform(middle - half, middle + half)
        return Uniform(place(self.low), place(self.high))

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        return np.asarray(low + (high - low) * share)

    @property
    @override
    def support(self) -> tuple[float, float]:
        return number(self.low), number(self.high)

    @property
    @override
    def numeric(self) -> bool:
        return not isinstance(self.low, str) and isinstance(self.high, int | float)

    @override
    def _check(self) -> None:
        low, high = self.support
        check_finite("uniform", "low and high", [low, high])
        if low > high:
            raise InputError(f"uniform: low must be at most high, got {low:g} and {high:g}")


@dataclass(frozen=True)
class Normal(Distribution):
    """Gauss's bell, cut at `low` and `high`.

    Parameters
    ----------
    mean
        Its middle; the case's own value if left out.
    sd
        Standard deviation before it is cut.
    low, high
        Where it is cut; else where the field's own range ends.
    """

    mean: Value = NOMINAL
    sd: Value | None = None
    low: Value | None = None
    high: Value | None = None
    name: ClassVar[str] = "normal"

    def __post_init__(self) -> None:
        if self.sd is None:
            raise InputError('normal: sd is missing, as in Normal(sd="10 %")')
        if self.numeric:
            self._check()

    @override
    def resolved(self, place: Read, width: Read) -> Normal:
        assert self.sd is not None
        return Normal(place(self.mean), width(self.sd), *cuts_of(self.low, self.high, place))

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        mean, sd = number(self.mean), number(self.sd)
        first, last = (ndtr((v - mean) / sd) if sd else float(v > mean) for v in self.support)
        value = mean + sd * ndtri(first + (last - first) * share) if sd else mean + 0.0 * share
        return np.asarray(np.clip(value, *self.support))

    @property
    @override
    def support(self) -> tuple[float, float]:
        return ends_of(self.low, self.high)

    @property
    @override
    def ends(self) -> tuple[float, float]:
        low, high = self.quantile(np.array([TAIL, 1.0 - TAIL]))
        return float(low), float(high)

    @override
    def within(self, low: float, high: float) -> Normal:
        first, last = narrowed(self.support, low, high)
        return replace(self, low=first, high=last)

    @override
    def _check(self) -> None:
        check_finite("normal", "mean", [number(self.mean)])
        check_range("normal", "sd", number(self.sd), low=0.0)
        mean, sd = number(self.mean), number(self.sd)
        low, high = self.support
        if not (
            low < high and ndtr((high - mean) / (sd or 1.0)) > ndtr((low - mean) / (sd or 1.0))
        ):
            raise InputError(
                f"normal: nothing of it is left between {low:g} and {high:g} "
                f"(mean {mean:g}, standard deviation {sd:g})"
            )


@dataclass(frozen=True)
class LogNormal(Distribution):
    """The logarithm is normal: for what is known to a factor, and positive.

    Parameters
    ----------
    median
        Its median; the case's own value if left out.
    sigma
        Standard deviation of the natural logarithm [-]; 0.1 is about 10 %.
    low, high
        Where it is cut; else where the field's own range ends.
    """

    median: Value = NOMINAL
    sigma: float | None = None
    low: Value | None = None
    high: Value | None = None
    name: ClassVar[str] = "lognormal"

    def __post_init__(self) -> None:
        if self.sigma is None:
            raise InputError("lognormal: sigma is missing, as in LogNormal(sigma=0.1)")
        check_range("lognormal", "sigma", self.sigma, low=0.0, high=10.0)
        if self.numeric:
            self._check()

    @override
    def resolved(self, place: Read, width: Read) -> LogNormal:
        return LogNormal(place(self.median), self.sigma, *cuts_of(self.low, self.high, place))

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        median = number(self.median)
        cuts = [math.log(max(v, 0.0) / median) if v > 0.0 else -math.inf for v in (low, high)]
        bell = Normal(0.0, self.sigma, *cuts)
        return np.asarray(np.clip(median * np.exp(bell.quantile(share)), low, high))

    @property
    @override
    def support(self) -> tuple[float, float]:
        low, high = ends_of(self.low, self.high)
        return max(low, 0.0), high

    @override
    def within(self, low: float, high: float) -> LogNormal:
        first, last = narrowed(self.support, low, high)
        return replace(self, low=first, high=last)

    @property
    @override
    def ends(self) -> tuple[float, float]:
        low, high = self.quantile(np.array([TAIL, 1.0 - TAIL]))
        return float(low), float(high)

    @override
    def _check(self) -> None:
        check_range("lognormal", "median", number(self.median), low=0.0, open_low=True)
        low, high = self.support
        if not low < high:
            raise InputError(f"lognormal: low must be below high, got {low:g} and {high:g}")


@dataclass(frozen=True)
class Triangular(Distribution):
    """Likeliest at `mode`, falling in straight lines to both ends.

    Parameters
    ----------
    low, high
        The ends.
    mode
        The likeliest value; the case's own if left out.
    """

    low: Value
    high: Value
    mode: Value = NOMINAL
    name: ClassVar[str] = "triangular"

    def __post_init__(self) -> None:
        if self.numeric:
            self._check()

    @override
    def resolved(self, place: Read, width: Read) -> Triangular:
        return Triangular(place(self.low), place(self.high), place(self.mode))

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        mode, width = number(self.mode), high - low
        if width == 0.0:
            return np.asarray(low + 0.0 * share)
        turn = (mode - low) / width
        rising = low + np.sqrt(share * width * (mode - low))
        falling = high - np.sqrt((1.0 - share) * width * (high - mode))
        return np.asarray(np.where(share < turn, rising, falling))

    @property
    @override
    def support(self) -> tuple[float, float]:
        return number(self.low), number(self.high)

    @override
    def _check(self) -> None:
        low, high = self.support
        mode = number(self.mode)
        check_finite("triangular", "low, mode and high", [low, mode, high])
        if not low <= mode <= high:
            raise InputError(
                f"triangular: mode must be between low and high, got {low:g}, {mode:g} and {high:g}"
            )


@dataclass(frozen=True)
class Samples(Distribution):
    """Values that were measured or chosen, each as likely: drawn again, never in between.

    Parameters
    ----------
    values
        The values, at least one.
    """

    values: tuple[Value, ...]
    name: ClassVar[str] = "samples"

    def __init__(self, values: Sequence[Value] | FloatArray) -> None:
        if isinstance(values, str):
            raise InputError(f"samples: must be a list of values, got {values!r}")
        object.__setattr__(
            self, "values", tuple(v if isinstance(v, str) else float(v) for v in values)
        )
        if not self.values:
            raise InputError("samples: must have at least one value, got none")
        if self.numeric:
            self._check()

    @override
    def resolved(self, place: Read, width: Read) -> Samples:
        return Samples([place(v) if isinstance(v, str) else v for v in self.values])

    @property
    def numbers(self) -> FloatArray:
        """The values in their order, (n,)."""
        return np.array([number(v) for v in self.values])

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        ranked = np.sort(self.numbers)
        at = np.minimum((share * ranked.size).astype(np.intp), ranked.size - 1)
        return np.asarray(ranked[at])

    @property
    @override
    def support(self) -> tuple[float, float]:
        numbers = self.numbers
        return float(numbers.min()), float(numbers.max())

    @property
    @override
    def numeric(self) -> bool:
        return not any(isinstance(v, str) for v in self.values)

    @override
    def to_dict(self) -> dict[str, Any]:
        return {self.name: list(self.values)}

    @override
    def _check(self) -> None:
        check_finite("samples", "values", self.values)


KINDS: dict[str, type[Distribution]] = {
    kind.name: kind for kind in (Uniform, Normal, LogNormal, Triangular, Samples)
}
"""The distributions by their names in a file."""
