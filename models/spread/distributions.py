"""Distributions of one number: where its values lie, and their quantiles.

A value may be a number in SI, a text with a unit (``50 ms``), or a percentage of the case's own
value: ``-10 %`` is a tenth below it, and a width of ``10 %`` is a tenth of it.  Texts are read
when the spread meets a case (`models.spread.spread.Spread.on`), which knows units and values;
until then a distribution is only a description.

Quantiles are of our own making, from SciPy's normal integral: a frozen distribution of
`scipy.stats` knows neither a bell of no width nor one that a field's range cuts on the scale of
its logarithm, and its ends are a rounding error away from those that were asked for.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from numbers import Real
from typing import Any, ClassVar, TypeVar

import numpy as np
from scipy.special import ndtr, ndtri
from typing_extensions import override

from ..basics import FloatArray, InputError, check_finite, check_range

Value = float | str
Read = Callable[[Value], float]
D = TypeVar("D", bound="Distribution")
B = TypeVar("B", bound="Bell")

_NOMINAL = "0 %"  # the case's own value
_TAIL = 0.00135  # quantile at three standard deviations, where a corner of a bell is put


@dataclass(frozen=True)
class Distribution(ABC):
    """How one number is distributed."""

    name: ClassVar[str]
    widths: ClassVar[tuple[str, ...]] = ()  #: The fields that are distances; the others are places.

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.default is MISSING and getattr(self, field.name) is None:
                raise InputError(f"{self.name}: {field.name} is missing")
        for name, value in self._given().items():
            for each in value if isinstance(value, tuple) else (value,):
                _check_value(self.name, name, each)
        if self.numeric:
            self._check()

    def resolved(self: D, place: Read, width: Read) -> D:
        """Return the distribution in SI; `width` reads a distance from the case's own value."""
        read = {
            name: (width if name in self.widths else place)(value)
            for name, value in self._given().items()
        }
        return replace(self, **read)

    @abstractmethod
    def quantile(self, share: FloatArray) -> FloatArray:
        """Return the values that shares in (0, 1) of all draws stay below, of the same shape."""

    @property
    def support(self) -> tuple[float, float]:
        """Smallest and largest value; infinite where there is none."""
        low, high = getattr(self, "low", None), getattr(self, "high", None)
        return (
            -math.inf if low is None else _number(low),
            math.inf if high is None else _number(high),
        )

    @property
    def numeric(self) -> bool:
        """Whether all its values are numbers already."""
        return not any(isinstance(value, str) for value in self._given().values())

    @property
    def ends(self) -> tuple[float, float]:
        """The values of a corner: its ends, or of a bell those at three standard deviations."""
        return self.support

    def within(self: D, low: float, high: float) -> D:
        """Return the distribution cut to what is possible at all, where it has tails."""
        del low, high
        return self

    def to_dict(self) -> dict[str, Any]:
        """Return it as in a file, ``{name: {field: value}}``, without empty fields."""
        return {self.name: self._given()}

    def _given(self) -> dict[str, Any]:
        """Return the values that are there by their fields."""
        values = ((f.name, getattr(self, f.name)) for f in fields(self))
        return {name: value for name, value in values if value is not None}

    @abstractmethod
    def _check(self) -> None:
        """Check the values, once they are numbers."""


class Bell(Distribution):
    """A distribution with tails, which a field's own range cuts."""

    @property
    @override
    def ends(self) -> tuple[float, float]:
        low, high = self.quantile(np.array([_TAIL, 1.0 - _TAIL]))
        return float(low), float(high)

    @override
    def within(self: B, low: float, high: float) -> B:
        first, last = max(self.support[0], low), min(self.support[1], high)
        cuts: dict[str, Any] = {
            "low": first if math.isfinite(first) else None,
            "high": last if math.isfinite(last) else None,
        }
        return replace(self, **cuts)


def _check_value(kind: str, name: str, value: object) -> None:
    """Raise InputError if a value is neither a text nor a number that a float can hold."""
    if isinstance(value, str):
        return
    known = isinstance(value, Real) and not isinstance(value, bool)
    try:
        float(value if known else 0.0)  # type: ignore[arg-type]
    except OverflowError:
        known = False
    if not known:
        raise InputError(
            f"{kind}: {name} must be a number or a text with a unit, got {value!r:.60}"
        )


def _number(value: Value | None) -> float:
    """Return a value that is a number already."""
    if value is None or isinstance(value, str):
        raise InputError(
            f"spread: {value!r} means something on a case only; call Spread.on(case) first"
        )
    return float(value)


@dataclass(frozen=True)
class Uniform(Distribution):
    """Every value between two ends is as likely.

    With `low` alone it is how far the value may be off either way: ``Uniform("20 %")``,
    ``Uniform("20 ms")``.
    """

    low: Value
    high: Value | None = None
    name: ClassVar[str] = "uniform"

    @override
    def resolved(self, place: Read, width: Read) -> Uniform:
        if self.high is None:
            middle, half = place(_NOMINAL), width(self.low)
            if half < 0.0:
                raise InputError(f"must have a width of at least 0, got {self.low!r}")
            return Uniform(middle - half, middle + half)
        return super().resolved(place, width)

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        return np.asarray(low + (high - low) * share)

    @property
    @override
    def numeric(self) -> bool:
        return self.high is not None and super().numeric

    @override
    def _check(self) -> None:
        low, high = check_finite("uniform", "low and high", self.support)
        if low > high:
            raise InputError(f"uniform: low must be at most high, got {low:g} and {high:g}")


@dataclass(frozen=True)
class Normal(Bell):
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

    mean: Value = _NOMINAL
    sd: Value | None = None
    low: Value | None = None
    high: Value | None = None
    name: ClassVar[str] = "normal"
    widths: ClassVar[tuple[str, ...]] = ("sd",)

    def __post_init__(self) -> None:
        if self.sd is None:
            raise InputError('normal: sd is missing, as in Normal(sd="10 %")')
        super().__post_init__()

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        mean, sd = _number(self.mean), _number(self.sd)
        first, last = (ndtr((v - mean) / sd) if sd else float(v > mean) for v in self.support)
        value = mean + sd * ndtri(first + (last - first) * share) if sd else mean + 0.0 * share
        return np.asarray(np.clip(value, *self.support))

    @override
    def _check(self) -> None:
        mean, sd = _number(self.mean), _number(self.sd)
        check_finite("normal", "mean", [mean])
        check_range("normal", "sd", sd, low=0.0)
        low, high = self.support
        below, above = (ndtr((end - mean) / (sd or 1.0)) for end in (low, high))
        if not (low < high and below < above):
            raise InputError(
                f"normal: nothing of it is left between {low:g} and {high:g} "
                f"(mean {mean:g}, standard deviation {sd:g})"
            )


@dataclass(frozen=True)
class LogNormal(Bell):
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

    median: Value = _NOMINAL
    sigma: float | None = None
    low: Value | None = None
    high: Value | None = None
    name: ClassVar[str] = "lognormal"
    widths: ClassVar[tuple[str, ...]] = ("sigma",)

    def __post_init__(self) -> None:
        if self.sigma is None:
            raise InputError("lognormal: sigma is missing, as in LogNormal(sigma=0.1)")
        check_range("lognormal", "sigma", self.sigma, low=0.0, high=10.0)
        super().__post_init__()

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        median = _number(self.median)
        cuts = [math.log(max(v, 0.0) / median) if v > 0.0 else -math.inf for v in (low, high)]
        bell = Normal(0.0, self.sigma, *cuts)
        return np.asarray(np.clip(median * np.exp(bell.quantile(share)), low, high))

    @property
    @override
    def support(self) -> tuple[float, float]:
        low, high = super().support
        return max(low, 0.0), high

    @override
    def _check(self) -> None:
        check_range("lognormal", "median", _number(self.median), low=0.0, open_low=True)
        low, high = self.support
        if not low < high:
            raise InputError(f"lognormal: low must be below high, got {low:g} and {high:g}")


@dataclass(frozen=True)
class Triangular(Distribution):
    """Likeliest at `mode`, by default the case's own, falling in lines to both ends."""

    low: Value
    high: Value
    mode: Value = _NOMINAL
    name: ClassVar[str] = "triangular"

    @override
    def quantile(self, share: FloatArray) -> FloatArray:
        low, high = self.support
        mode, width = _number(self.mode), high - low
        if width == 0.0:
            return np.asarray(low + 0.0 * share)
        turn = (mode - low) / width
        rising = low + np.sqrt(share * width * (mode - low))
        falling = high - np.sqrt((1.0 - share) * width * (high - mode))
        return np.asarray(np.where(share < turn, rising, falling))

    @override
    def _check(self) -> None:
        low, high = self.support
        mode = _number(self.mode)
        check_finite("triangular", "low, mode and high", [low, mode, high])
        if not low <= mode <= high:
            raise InputError(
                f"triangular: mode must be between low and high, got {low:g}, {mode:g} and {high:g}"
            )


@dataclass(frozen=True)
class Samples(Distribution):
    """Values that were measured or chosen, each as likely: drawn again, never in between."""

    values: tuple[Value, ...]
    name: ClassVar[str] = "samples"

    def __init__(self, values: Sequence[Value] | FloatArray) -> None:
        if isinstance(values, str):
            raise InputError(f"samples: must be a list of values, got {values!r}")
        for value in values:
            _check_value("samples", "a value", value)
        own = tuple(v if isinstance(v, str) else float(v) for v in values)
        object.__setattr__(self, "values", own)
        if not own:
            raise InputError("samples: must have at least one value, got none")
        self.__post_init__()

    @override
    def resolved(self, place: Read, width: Read) -> Samples:
        return Samples([place(v) if isinstance(v, str) else v for v in self.values])

    @property
    def numbers(self) -> FloatArray:
        """The values in their order, (n,)."""
        return np.array([_number(v) for v in self.values])

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


def at_ends(distribution: Distribution, points: FloatArray) -> FloatArray:
    """Return values at points of [0, 1]: even steps between the ends of a range."""
    low, high = distribution.ends
    if isinstance(distribution, Samples):
        return distribution.quantile(np.minimum(points, 1.0 - 2.0**-53))
    return np.asarray(low + (high - low) * points)
