"""What every distribution of a number can do, and the few helpers that all of them share."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import fields
from typing import Any, ClassVar, TypeVar

from ..basics import FloatArray, InputError

Value = float | str
Read = Callable[[Value], float]
D = TypeVar("D", bound="Distribution")

NOMINAL = "0 %"
"""The case's own value."""
TAIL = 0.00135
"""Quantile at three standard deviations, where a corner of a bell is put."""


class Distribution(ABC):
    """How one number is distributed."""

    name: ClassVar[str]

    @abstractmethod
    def resolved(self: D, place: Read, width: Read) -> D:
        """Return the distribution in plain numbers.

        Parameters
        ----------
        place, width
            Read a value, and a distance from the case's own value, in SI.
        """

    @abstractmethod
    def quantile(self, share: FloatArray) -> FloatArray:
        """Return the values that shares in (0, 1) of all draws stay below, of the same shape."""

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Smallest and largest value; infinite where there is none."""

    @property
    def numeric(self) -> bool:
        """Whether all its values are numbers already."""
        return not any(isinstance(getattr(self, f.name), str) for f in fields(self))  # type: ignore[arg-type]

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
        values = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return {self.name: {k: v for k, v in values.items() if v is not None}}

    @abstractmethod
    def _check(self) -> None:
        """Check the values, once they are numbers."""


def number(value: Value | None) -> float:
    """Return a value that is a number already."""
    if value is None or isinstance(value, str):
        raise InputError(
            f"spread: {value!r} means something on a case only; call Spread.on(case) first"
        )
    return float(value)


def ends_of(low: Value | None, high: Value | None) -> tuple[float, float]:
    """Return cuts as numbers, infinite where there are none."""
    return (
        -math.inf if low is None else number(low),
        math.inf if high is None else number(high),
    )


def cuts_of(
    low: Value | None, high: Value | None, place: Read
) -> tuple[float | None, float | None]:
    """Return cuts, read in SI."""
    return (None if low is None else place(low)), (None if high is None else place(high))


def narrowed(
    support: tuple[float, float], low: float, high: float
) -> tuple[float | None, float | None]:
    """Return the cuts that keep a distribution within a field's range."""
    first, last = max(support[0], low), min(support[1], high)
    return (first if math.isfinite(first) else None), (last if math.isfinite(last) else None)
