"""Numbers of a case by path: every quantity that is a length, a mass, a delay and the like.

    Case -> walk over its sections -> Number(path, value, unit)

What a design has to respect (`limits`), gains in use and bounds of gains are no part of the
physical world, and neither are counts and choices.  Columns of a table (the heave operator) are
one number: a factor on the whole column.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from models.case import Case
from models.casefile import Quantity, Section

_NOT_PHYSICAL = ("stillhook", "name", "description", "sources", "limits", "gains", "gain_bounds")


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number of a case."""

    path: str  #: Dotted path of the field.
    value: float  #: Its value [SI]; of a table's column its factor, 1.
    unit: str  #: Its unit.
    #: The column itself where the number is a factor on it, else None.
    column: tuple[float, ...] | None = None

    def change(self, value: float) -> dict[str, object]:
        """Return what `Case.replace` takes to give the number another value."""
        if self.column is None:
            return {self.path: value}
        return {self.path: [value * entry for entry in self.column]}


def numbers_of(case: Case) -> tuple[Number, ...]:
    """Return every number of a case that is not zero, in the order of the file.

    A field that is zero has no elasticity: no share of nothing can be changed.
    """
    found: list[Number] = []
    for name in type(case).model_fields:
        section = getattr(case, name)
        if name not in _NOT_PHYSICAL and isinstance(section, Section):
            found += _walk(section, name)
    return tuple(found)


def _walk(section: Section, path: str) -> Iterator[Number]:
    for name, field in type(section).model_fields.items():
        value, here = getattr(section, name), f"{path}.{name}"
        if isinstance(value, Section):
            yield from _walk(value, here)
            continue
        kinds = [m for m in field.metadata if isinstance(m, Quantity)] or _kinds(field.annotation)
        if not kinds or kinds[0].kind == "count" or isinstance(value, bool | str):
            continue
        if isinstance(value, float | int):
            if float(value) != 0.0:
                yield Number(path=here, value=float(value), unit=kinds[0].shown_unit)
        elif name != "omega" and isinstance(value, tuple) and _is_column(value):
            yield Number(path=here, value=1.0, unit="-", column=value)


def _is_column(value: tuple[object, ...]) -> bool:
    return any(value) and all(isinstance(entry, float) for entry in value)


def _kinds(annotation: object) -> list[Quantity]:
    """Return the quantities inside an annotation such as `tuple[Annotated[..], ...] | None`."""
    found = [m for m in getattr(annotation, "__metadata__", ()) if isinstance(m, Quantity)]
    for inner in getattr(annotation, "__args__", ()):
        found += _kinds(inner)
    return found
