"""Fields of a case by dotted path: kind, range, value, short names.

A spread speaks of fields of a case, of gains of a design (``gains.a``) and of the design's linear
drag coefficient (``drag``); this module is where their units are looked up.
"""

import math
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..basics import KINDS, InputError, parse_quantity
from ..case import Case
from ..casefile import Quantity, suggestion
from ..operation import PREFIX as FAULTS
from ..operation import fault_of
from .distributions import Distribution, Value

#: Short names of what is most often varied.
ALIASES: Mapping[str, str] = {
    "depth": "rope.length",
    "length": "rope.length",
    "payload": "payload.mass",
    "added_mass": "payload.added_mass",
    "stiffness": "rope.axial_stiffness",
    "radius": "winch.drum.radius",
    "delay": "sensors.telemetry.delay",
}
DRAG = "drag"  # linear drag coefficient of the design [N s/m]
GAINS = "gains."

# Fields that may be left out, and what then stands in their place.
_DERIVED: Mapping[str, Callable[[Case], float]] = {
    "rope.axial_stiffness": lambda case: case.rope.ea,
    "rope.modulus": lambda case: case.rope.ea / case.rope.area,
    "rope.submerged_weight_per_length": lambda case: (
        case.rope.submerged_weight / case.rope.paid_out
    ),
    "payload.added_mass": lambda case: case.payload.hydrodynamic_mass,
    "payload.drag_coefficient": lambda case: case.payload.c_d,
    "winch.drum.radius": lambda case: case.drum_radius,
}


@dataclass(frozen=True, kw_only=True)
class Field:
    """One number that may vary."""

    path: str  #: Its dotted path, without aliases.
    kind: str  #: A key of `models.basics.units.KINDS`.
    nominal: float  #: Its value in the case or the design.
    #: The range that the field allows.
    low: float = -math.inf
    high: float = math.inf

    @property
    def unit(self) -> str:
        """Its SI unit; empty for a pure number."""
        return KINDS[self.kind].unit


def field_of(case: Case, name: str, gains: Mapping[str, float], drag: float | None) -> Field:
    """Return the field of a dotted path, an alias, ``gains.`` and a gain's name, or ``drag``.

    The design's linear drag coefficient is in N s/m, None if there is no design.

    Raises InputError if there is no number of that name.
    """
    path = ALIASES.get(name, name)
    if path == DRAG:
        if drag is None:
            raise InputError(
                "drag is a number of a design, and there is none; vary payload.drag_coefficient"
            )
        return Field(path=path, kind="damping", nominal=drag, low=0.0)
    if path.startswith(GAINS):
        own = path.removeprefix(GAINS)
        if own not in gains:
            raise InputError(f"{path} is unknown; {suggestion(own, list(gains))}")
        return Field(path=path, kind="number", nominal=float(gains[own]))
    about: Any
    if path.startswith(FAULTS):  # of the time domain, see models/operation/faults.py
        about = fault_of(path)
        found = about.nominal
    else:
        about, found = _walk(case, path)
        if found is None and path in _DERIVED:
            found = _DERIVED[path](case)
        if about is None or isinstance(found, str | bool) or not isinstance(found, int | float):
            raise InputError(f"there is no number at {path!r} in this case, got {found!r}")
    return Field(path=path, kind=about.kind, nominal=float(found), low=about.low, high=about.high)


def _walk(case: Case, path: str) -> tuple[Quantity | None, Any]:
    """Return the quantity that a path's field is declared as, and its value."""
    found: Any = case
    quantity: Quantity | None = None
    for key in path.split("."):
        if isinstance(found, tuple | list):
            if not key.isdigit() or int(key) >= len(found):
                raise InputError(f"{path} is unknown: entries go from 0 to {len(found) - 1}")
            found = found[int(key)]
            continue
        fields = getattr(type(found), "model_fields", None)
        if fields is None:
            raise InputError(f"{path} is unknown: {key!r} has nothing above it")
        if key not in fields:
            raise InputError(f"{path} is unknown; {suggestion(key, list(fields))}")
        quantity = _quantity((fields[key].annotation, *fields[key].metadata))
        found = getattr(found, key)
    return quantity, found


def _quantity(annotation: Any) -> Quantity | None:
    """Return the first quantity within an annotation."""
    if isinstance(annotation, Quantity):
        return annotation
    parts = annotation if isinstance(annotation, tuple) else typing.get_args(annotation)
    inner = (*parts, *getattr(annotation, "__metadata__", ()))
    return next((q for part in inner if (q := _quantity(part)) is not None), None)


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
