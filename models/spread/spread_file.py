"""Spread files: YAML with `vary:` and, if wanted, `correlations:`.

vary:
  payload.mass: 20 %                          # uniform, 20 % of the case's value either way
  sensors.telemetry.delay: [10 ms, 60 ms]     # uniform in between
  rope.axial_stiffness: {normal: {sd: 10 %}}  # about the case's own
  sea.significant_height: {samples: [1.2 m, 1.5 m, 2.1 m]}
correlations:
  - [payload.mass, rope.axial_stiffness, 0.4]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..basics import InputError
from ..casefile import line_of, message_line, read_yaml, suggestion
from .distributions import KINDS, Distribution, Samples, Uniform

Lines = dict[tuple[str | int, ...], int]
Pairs = dict[tuple[str, str], float]


def read_spread(
    given: Mapping[str, Any] | Path, source: str
) -> tuple[dict[str, Distribution], Pairs]:
    """Return distributions and correlations of a spread file or its contents.

    Raises
    ------
    InputError
        If it is no spread; the message names file, line and path.
    """
    lines: Lines = {}
    data: Any = given
    if isinstance(given, Path):
        try:
            text = given.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{source}: the spread cannot be read: {error}") from None
        data, lines = read_yaml(text, source)
    if not isinstance(data, Mapping) or not isinstance(data.get("vary"), Mapping):
        raise InputError(
            f"{source}: must hold a section `vary:` with what varies, by path of the case"
        )
    for key in data:
        if key not in ("vary", "correlations"):
            text = f"is unknown; {suggestion(key, ['vary', 'correlations'])}"
            raise InputError(_at(source, lines, (str(key),), text))
    found = {}
    for name, value in data["vary"].items():
        try:
            found[str(name)] = _distribution(value)
        except InputError as error:
            raise InputError(_at(source, lines, ("vary", str(name)), str(error))) from None
    pairs: Pairs = {}
    for k, entry in enumerate(data.get("correlations") or ()):
        if not isinstance(entry, list | tuple) or len(entry) != 3:
            text = f"must be [path, path, rank correlation], got {entry!r}"
            raise InputError(_at(source, lines, ("correlations", k), text))
        pairs[str(entry[0]), str(entry[1])] = entry[2]
    return found, pairs


def _distribution(value: Any) -> Distribution:
    """Return the distribution that an entry of `vary:` stands for."""
    if isinstance(value, str | int | float) and not isinstance(value, bool):
        return Uniform(value)
    if isinstance(value, list | tuple):
        if len(value) != 2:
            raise InputError(
                f"must be [low, high] or {{samples: [...]}}, got a list of {len(value)}"
            )
        return Uniform(*value)
    if not isinstance(value, Mapping) or len(value) != 1:
        raise InputError(f"must be one of {', '.join(KINDS)} with its values, got {value!r}")
    (name, inner), *_ = value.items()
    if name not in KINDS:
        raise InputError(f"{name!r} is unknown; {suggestion(name, list(KINDS))}")
    kind: Any = KINDS[name]
    if kind is Samples:
        if not isinstance(inner, list | tuple):
            raise InputError(f"samples must be a list of values, got {inner!r}")
        return Samples(inner)
    if isinstance(inner, list | tuple):
        return _made(kind, name, dict(zip((f.name for f in fields(kind)), inner, strict=False)))
    if not isinstance(inner, Mapping):
        return _made(kind, name, {_width(kind): inner})
    return _made(kind, name, dict(inner))


def _made(kind: Any, name: str, values: dict[str, Any]) -> Distribution:
    known = [f.name for f in fields(kind)]
    for key, value in values.items():
        if key not in known:
            raise InputError(f"{name}: {key} is unknown; {suggestion(key, known)}")
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise InputError(f"{name}: {key} must be a number or a text with a unit, got {value!r}")
    try:
        made: Distribution = kind(**values)
    except TypeError:
        raise InputError(f"{name}: needs {', '.join(known)}; got {', '.join(values)}") from None
    return made


def _width(kind: Any) -> str:
    """Return the field that a single value stands for."""
    return {"normal": "sd", "lognormal": "sigma"}.get(kind.name, fields(kind)[0].name)


def _at(source: str, lines: Lines, path: tuple[str | int, ...], text: str) -> str:
    return message_line(source, line_of(path, lines), path, text)
