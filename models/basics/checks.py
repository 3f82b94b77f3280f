"""Errors, the one warning, and the few checks made at every door.

Everything that enters the toolkit (a case file, a table, an argument) is checked where it
enters, and a bad value is answered with one sentence that names its owner, the field, the
range that is allowed with its unit, and the value that came.  This module holds the one
exception family and the helpers that word those sentences; it imports nothing of ours, so
every other module may use it.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from .arrays import ComplexArray, FloatArray


class StillhookError(Exception):
    """Base of every error that the toolkit raises on purpose."""


class InputError(StillhookError, ValueError):
    """The user's input is wrong; the message says where, what is allowed and what came."""


class SynthesisError(StillhookError):
    """A design problem is stated in a way that cannot be solved at all."""


class SolverError(StillhookError):
    """A numerical solver failed in a way that says nothing about the user's input."""


class PhysicsWarning(UserWarning):
    """The input is allowed but physically implausible, or a result leans on an assumption.

    A sea steeper than breaking, a phase that looks like degrees, a spectrum that reaches beyond the
    vessel's table: the run goes on, and the user is told.  One category, to filter on.
    """


def how_to_install(extra: str) -> str:
    """Return what to do where an extra is not installed; no index has Stillhook under its name."""
    return (
        f"run `make {extra}` in Stillhook's source folder, or pip install -e '.[{extra}]' there; "
        f"of a wheel, pip install 'FILE.whl[{extra}]'"
    )


def check_range(
    owner: str,
    name: str,
    value: object,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    open_low: bool = False,
    open_high: bool = False,
) -> float:
    """Return `value`, a number or a text that is one, as a float if finite and within the range.

    `open_low` and `open_high` exclude the ends [unit]; the message calls the value `name` of
    `owner`.

    Raises InputError if the value is not a finite number within the range.
    """
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    inside = (number > low if open_low else number >= low) and (
        number < high if open_high else number <= high
    )
    if not (math.isfinite(number) and inside):
        raise InputError(
            f"{owner}: {name} must be {range_text(low, high, unit, open_low, open_high)}, "
            f"got {value!r}"
        )
    return number


def check_finite(owner: str, name: str, values: npt.ArrayLike) -> FloatArray:
    """Return `values` as a float array if every entry is finite.

    Raises InputError if an entry is NaN or infinite, or is no number; its index is named.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{owner}: {name} must be numbers, got {values!r}") from error
    finite = np.isfinite(array)
    if not finite.all():
        bad = np.argwhere(~finite)
        where = ", ".join(str(int(i)) for i in bad[0])
        raise InputError(
            f"{owner}: {name} must be finite numbers, got {array[tuple(bad[0])]} at index {where}"
        )
    return array


def check_ascending(owner: str, name: str, values: Sequence[float] | FloatArray) -> FloatArray:
    """Return `values` as an array if they are finite and strictly ascending.

    Raises InputError if two neighbours are equal or in the wrong order; both are named.
    """
    array = check_finite(owner, name, values)
    fault = ascending_fault(array)
    if fault:
        raise InputError(f"{owner}: {name} {fault}")
    return array


def ascending_fault(values: Sequence[float] | FloatArray) -> str:
    """Return what is wrong with numbers that must be strictly ascending; nothing if they are."""
    array = np.asarray(values, dtype=np.float64)
    wrong = np.flatnonzero(np.diff(array) <= 0.0)
    if not wrong.size:
        return ""
    i = int(wrong[0])
    kind = "repeated" if array[i + 1] == array[i] else "out of order"
    return (
        f"must be strictly ascending, got {array[i]:g} followed by {array[i + 1]:g} "
        f"({kind}, index {i + 1})"
    )


def check_choice(owner: str, name: str, value: object, choices: Collection[str]) -> None:
    """Refuse a value that is none of a few words.

    Raises InputError if it is none of them; they are told.
    """
    if value not in choices:
        raise InputError(f"{owner}: {name} must be one of {', '.join(choices)}; got {value!r}")


def check_seed(owner: str, seed: int) -> int:
    """Return the seed if it is a whole number of at least 0.

    Raises InputError if it is not.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"{owner}: seed must be a whole number of at least 0, got {seed!r}")
    return int(seed)


def read_only(array: npt.ArrayLike) -> FloatArray:
    """Return a float copy of `array` that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


class ReadOnlyArrays:
    """Base of frozen dataclasses: FloatArray and ComplexArray fields become read-only copies."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            kind = _KINDS.get(field.type)
            if kind is not None:
                copy: npt.NDArray[Any] = np.array(getattr(self, field.name), dtype=kind)
                copy.setflags(write=False)
                object.__setattr__(self, field.name, copy)


# Annotations are texts where a file puts off their evaluation.
_KINDS: dict[Any, Any] = {
    **dict.fromkeys((FloatArray, "FloatArray"), np.float64),
    **dict.fromkeys((ComplexArray, "ComplexArray"), np.complex128),
}


def digits_apart(value: float, bound: float, least: int = 3) -> int:
    """Return how many significant digits tell a value from its bound; `least` of equal ones.

    Equal are those that part by less than 1e-5 of the bound, to which limits are kept.

    Examples
    --------
    >>> digits_apart(2.0005, 2.0), digits_apart(1.8, 2.0), digits_apart(2.0 + 1e-9, 2.0)
    (5, 3, 3)
    """
    if not abs(value - bound) > 1e-5 * abs(bound) or math.isinf(value) or math.isinf(bound):
        return least
    apart, digits = value - bound, least
    # Parted by about as much as they are, not by what rounding adds.
    while abs(_rounded(value, digits) - _rounded(bound, digits) - apart) > 0.5 * abs(apart):
        digits += 1
    return digits


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")


def range_text(
    low: float, high: float, unit: str, open_low: bool = False, open_high: bool = False
) -> str:
    """Return a range in words, as in `in [0, 2) m` or `above 0 kg`."""
    tail = f" {unit}" if unit else ""
    if math.isinf(low) and math.isinf(high):
        return f"a finite number{' in' + tail if unit else ''}"
    if math.isinf(high):
        return f"{'above' if open_low else 'at least'} {low:g}{tail}"
    if math.isinf(low):
        return f"{'below' if open_high else 'at most'} {high:g}{tail}"
    left, right = "(" if open_low else "[", ")" if open_high else "]"
    return f"in {left}{low:g}, {high:g}{right}{tail}"
