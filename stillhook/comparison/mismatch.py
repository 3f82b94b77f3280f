"""Mismatch of a plant (`Mismatch`): changes of the case that its controllers do not know of.

    "payload=+30%,E=-30%,delay=+50ms" --> Mismatch --> apply(case) --> the case that is simulated

A value with a sign changes what the case has, by a share or by an amount; one without replaces
it.  `payload` is what moves and not what hangs: the weight is known from the load cell.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from models.basics import GRAVITY, InputError, parse_quantity
from models.case import Case
from models.casefile import read_yaml
from models.spread import Field, field_of

SHORT: Mapping[str, str] = {
    "payload": "mass of the payload, by a share the water that moves with it too; not its weight",
    "weight": "weight of the payload in water; not its mass",
    "stiffness": "axial stiffness of the rope, or its modulus",
    "E": "the same as stiffness",
    "delay": "delay of the telemetry",
    "sea": "significant height of the sea",
    "period": "period of the sea",
    "spectrum": "shape of the spectrum, with the same peak period",
}
"""Short names of what may be off."""

# Paths of the short names that lead to the same place in every case.
_PATHS: Mapping[str, tuple[str, ...]] = {
    "payload": ("payload.mass", "payload.added_mass"),
    "weight": ("payload.submerged_weight",),
    "delay": ("sensors.telemetry.delay",),
    "sea": ("sea.significant_height",),
    "spectrum": ("sea",),
}
_OWNER = "--mismatch"
_HEAVIEST = 1.0 + 1e-6  # of its weight in air may a payload weigh in water
_SIGNED = re.compile(r"^[+-]\s*[0-9.]")


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """What of the plant is not as in the case that the controllers are made for.

    `changes` are values by short name of `SHORT` or dotted path of the case, as they were given.
    """

    changes: Mapping[str, object]

    @classmethod
    def read(cls, given: str | Mapping[str, object] | None) -> Mismatch:
        """Return a mismatch from a text such as ``"payload=+30%,delay=+50 ms"`` or a mapping.

        Raises InputError if the text is not of that form, or a name comes twice.

        Examples
        --------
        >>> dict(Mismatch.read("payload=+30%, delay=+50ms").changes)
        {'payload': '+30%', 'delay': '+50ms'}
        """
        if given is None:
            return cls(changes={})
        if not isinstance(given, str):
            return cls(changes=dict(given))
        changes: dict[str, object] = {}
        for part in given.split(","):
            name, sign, value = (piece.strip() for piece in part.partition("="))
            if not sign or not name or not value:
                raise InputError(
                    f"{_OWNER}: must be NAME=VALUE, as in payload=+30%,delay=+50ms, got {part!r}"
                )
            if name in changes:
                raise InputError(f"{_OWNER}: {name} is given twice")
            changes[name] = value
        return cls(changes=changes)

    @property
    def text(self) -> str:
        """What is off, as it is given on the command line; empty if nothing is."""
        return ",".join(f"{name}={value}" for name, value in self.changes.items())

    def apply(self, case: Case) -> Case:
        """Return the case with the changes.

        Raises InputError if a name is unknown, a value cannot be read, or the changed case is not
        valid.
        """
        if not self.changes:
            return case
        wanted: dict[str, Any] = {}
        for name, value in self.changes.items():
            paths = _paths(name, case)
            share = isinstance(value, str) and value.strip().endswith("%")
            for path in paths if share else paths[:1]:
                wanted[path] = _value(name, path, value, case)
        if "payload.mass" in wanted and "payload.added_mass" in wanted:
            _not_below_its_weight(wanted, case)
        return case.replace(wanted)


def _paths(name: str, case: Case) -> tuple[str, ...]:
    if name in _PATHS:
        return _PATHS[name]
    if name in ("stiffness", "E"):
        given = getattr(case.rope, "axial_stiffness", None)
        return ("rope.modulus" if given is None else "rope.axial_stiffness",)
    if name == "period":
        own = case.sea.spectrum == "bretschneider-1975"
        return ("sea.significant_period" if own else "sea.peak_period",)
    if "." not in name:
        raise InputError(
            f"{_OWNER}: there is no {name!r}; there are {', '.join(SHORT)}, and paths of the case "
            "such as winch.motor.inertia"
        )
    return (name,)


def _not_below_its_weight(wanted: dict[str, Any], case: Case) -> None:
    """Let the water alone be less where a mass would be too small for the weight that stays."""
    mass, water = wanted["payload.mass"], wanted["payload.added_mass"]
    weight = wanted.get("payload.submerged_weight", case.payload.submerged_weight)
    lacking = min(_HEAVIEST * weight / GRAVITY, case.payload.mass) - mass
    if 0.0 < lacking <= water:
        wanted["payload.mass"], wanted["payload.added_mass"] = mass + lacking, water - lacking


def _value(name: str, path: str, value: object, case: Case) -> object:
    if name == "spectrum":
        return {
            "spectrum": value,
            "significant_height": case.sea.significant_height,
            "peak_period": case.sea.spectral_peak_period,
        }
    text = value.strip() if isinstance(value, str) else ""
    if not _SIGNED.match(text):
        return read_yaml(text, f"{_OWNER} {name}")[0] if text else value
    field = _field(path, case)
    sign = -1.0 if text[0] == "-" else 1.0
    size = text[1:].strip()
    try:
        if size.endswith("%"):
            return field.nominal * (1.0 + sign * float(parse_quantity(size, "ratio")))
        return field.nominal + sign * float(parse_quantity(size, field.kind))
    except InputError as error:
        raise InputError(f"{_OWNER} {name}: {error}") from None


def _field(path: str, case: Case) -> Field:
    """Return the number that a path leads to, with its kind."""
    try:
        found = field_of(case, path, {}, None)
    except InputError:
        found = None
    if found is None or not math.isfinite(found.nominal):
        raise InputError(
            f"{_OWNER}: {path} is not a number in the case {case.name}, so it cannot be changed by "
            "a share or an amount"
        )
    return found
