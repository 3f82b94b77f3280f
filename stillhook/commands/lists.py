"""Quantities, lists and ranges as an option is given them: names, numbers, two ends, an axis.

Each returns what was meant from the option's name, for messages, and its text
(`stillhook.commands.declare.Read`).
"""

import math
from collections.abc import Callable

from models.basics import InputError

_FINEST = 400  # points of an axis


def quantity(
    kind: str, low: float, high: float, *, open_low: bool = False
) -> Callable[[str, str], float]:
    """Return what reads a quantity of a kind with its unit, as in a case file [SI]."""

    def read(name: str, text: str) -> float:
        from models.casefile import Quantity, read_yaml

        try:
            value = Quantity(kind, low, high, open_low=open_low).read(read_yaml(text, name)[0])
        except InputError as error:
            raise InputError(f"{name} {error}") from None
        return float(value)

    return read


def names(name: str, text: str) -> tuple[str, ...]:
    """Return names with commas between."""
    found = tuple(part.strip() for part in text.split(",") if part.strip())
    if not found:
        raise InputError(f"{name}: must be names with commas between, got {text!r}")
    return found


def parse_range(name: str, text: str) -> tuple[float, float]:
    """Return the two ends of a text LOW..HIGH.

    Raises InputError if it is not of that form.

    Examples
    --------
    >>> parse_range("--schedule", "100..2000")
    (100.0, 2000.0)
    """
    low, sign, high = text.partition("..")
    try:
        if sign:
            return float(low), float(high)
    except ValueError:
        pass
    raise InputError(f"{name}: must be LOW..HIGH in SI units, as in 100..2000, got {text!r}")


def axis(
    step: float | None, low: float = -math.inf, high: float = math.inf
) -> Callable[[str, str], list[float]]:
    """Return what reads the values of an axis, from `low` to `high`: LOW..HIGH[/STEP] or A,B,..

    A range that gives no step has `step`; where that is None it must give its own.

    Examples
    --------
    >>> read = axis(1.0)
    >>> read("--tp", "6..8"), read("--tp", "6..7/0.5"), read("--tp", "6, 8.5")
    ([6.0, 7.0, 8.0], [6.0, 6.5, 7.0], [6.0, 8.5])
    """
    form = f"numbers A,B,.. or LOW..HIGH{'/STEP' if step is None else '[/STEP]'}"

    def read(name: str, text: str) -> list[float]:
        wrong = InputError(f"{name}: must be {form}, at most {_FINEST}, got {text!r}")
        first, dots, rest = text.partition("..")
        last, _, given = rest.partition("/")
        try:
            if dots:
                stride = float(given) if given or step is None else step
                count = math.floor((float(last) - float(first)) / stride + 1e-9) + 1
                values = [float(first) + stride * k for k in range(min(count, _FINEST + 1))]
            else:
                values = [float(part) for part in text.split(",")]
        except (ValueError, OverflowError, ZeroDivisionError):
            raise wrong from None
        if not 0 < len(values) <= _FINEST or not all(map(math.isfinite, values)):
            raise wrong
        for value in values:
            if not low <= value <= high:
                raise InputError(f"{name}: must be in [{low:g}, {high:g}], got {value:g}")
        return values

    return read


def numbers(count: int | None = None) -> Callable[[str, str], tuple[float, ...]]:
    """Return what reads so many numbers, or any number of them, with commas between."""

    def read(name: str, text: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in text.split(","))
        except ValueError:
            found = ()
        if not found or count not in (None, len(found)):
            many = "" if count is None else f"{count} "
            raise InputError(f"{name} must be {many}numbers with commas between, got {text!r}")
        return found

    return read
