"""From what a spread's author wrote to numbers: percentages, units, rank correlations, words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..basics import FloatArray, InputError, parse_quantity
from .distribution import Distribution, Value
from .distributions import Samples, Uniform
from .fields import Field

Pairs = Mapping[tuple[str, str], float]


def distribution_of(path: str, given: Any) -> Distribution:
    """Return a distribution; a text or a number alone is the width of a uniform one."""
    if isinstance(given, Distribution):
        return given
    if isinstance(given, str | int | float) and not isinstance(given, bool):
        return Uniform(given)
    raise InputError(f"spread: {path} must be a distribution, got {given!r}")


def resolved(distribution: Distribution, field: Field) -> Distribution:
    """Return a distribution in the field's SI unit; percentages are of its nominal value."""

    def width(value: Value) -> float:
        if not isinstance(value, str):
            return float(value)
        share = _share(value)
        if share is None:
            return parse_quantity(value, field.kind)
        if share != 0.0 and field.nominal == 0.0:
            raise InputError(
                f"is 0 in this case, so {value} of it is nothing; give a value with its unit"
            )
        return share * abs(field.nominal)

    def place(value: Value) -> float:
        if isinstance(value, str) and _share(value) is not None:
            return field.nominal + width(value)
        return parse_quantity(value, field.kind)

    return distribution.resolved(place, width)


def _share(text: str) -> float | None:
    """Return the share that a percentage stands for; None if the text is none."""
    body = text.strip()
    if not body.endswith("%"):
        return None
    try:
        return float(body[:-1].strip()) / 100.0
    except ValueError:
        raise InputError(f"must be a percentage such as '-10 %', got {text!r}") from None


def at_ends(distribution: Distribution, points: FloatArray) -> FloatArray:
    """Return values at points of [0, 1]: even steps between the ends of a range."""
    low, high = distribution.ends
    if isinstance(distribution, Samples):
        return distribution.quantile(np.minimum(points, 1.0 - 2.0**-53))
    return np.asarray(low + (high - low) * points)


def copula_factor(paths: tuple[str, ...], pairs: Pairs) -> FloatArray | None:
    """Return the Cholesky factor of the normal scores' correlation, None if there is none.

    A Gaussian copula with correlation r has the rank correlation 6/pi asin(r/2) (Pearson 1907).
    """
    if not pairs:
        return None
    matrix = np.eye(len(paths))
    for (one, other), rank in pairs.items():
        i, j = paths.index(one), paths.index(other)
        matrix[i, j] = matrix[j, i] = 2.0 * np.sin(np.pi * rank / 6.0)
    try:
        return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise InputError(
            "spread: the correlations contradict each other: no numbers can have them all"
        ) from None


def words(kind: str, values: Any) -> str:
    """Return a distribution in words."""
    if isinstance(values, dict):
        inner = ", ".join(f"{k} {short(v)}" for k, v in values.items())
    elif len(values) > 4:
        inner = f"{len(values)} values"
    else:
        inner = ", ".join(short(v) for v in values)
    return f"{kind} ({inner})"


def short(value: Any) -> str:
    """Return a value as a sentence shows it: six digits at the most."""
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)
