"""Designs as YAML files that load again: the case, the parameters, and every figure claimed.

A file mirrors `Design`: one key for each field, dataclasses as sections, arrays as lists, and the
case as it stands in a case file.  What a field may hold is read from its annotation, so the file
follows the class without a second description.  Reading is strict: what is missing, unknown or of
another kind is named with file, line and path.  Files of format 1, of gains or of a structure, are
read too: their figures are those that were claimed then, when gains counted no sensor noise.
"""

from __future__ import annotations

import dataclasses
import math
import os
import types
import typing
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Union, get_args, get_origin

import numpy as np

from models.basics import InputError, write_text_atomically
from models.case import Case
from models.casefile import case_text, line_of, message_line, read_yaml, suggestion, yaml_text
from synth.design import Design
from synth.question import PAYLOAD, controller_for, difference_text
from synth.verify import Verification

FORMAT = 2  #: Version of the file's format.

_KEY, _STRUCTURE = "stillhook_design", "stillhook_structure"
_WRITER = "written_by"
Place = tuple[str | int, ...]


def save_design(design: Design, path: str | Path) -> Path:
    """Write a design to a YAML file in a folder that exists, whole or not at all; return its path.

    Raises InputError if it cannot be written.
    """
    return write_text_atomically(path, design_text(design))


def design_text(design: Design) -> str:
    """Return a design as the YAML text that `load_design` reads."""
    from .._version import __version__

    content = {_KEY: FORMAT, _WRITER: f"stillhook {__version__}", **_encoded(design)}
    for other in content["alternatives"]:
        for same in (other, *other["members"]):
            del same["case"]
    for one in (content, *content["alternatives"]):
        for member in _further(one):
            del member["built_for"]
    # The case comes last: it is the longest, and the one part that is not an answer.
    content["case"] = content.pop("case")
    return (
        f"# {design.structure} by Stillhook for the case {design.case.name}, in SI units.\n"
        "# stillhook.load_design reads it; the section `case` is a case file of its own.\n"
        f"{yaml_text(content)}"
    )


def design_data(design: Design) -> dict[str, Any]:
    """Return a design as plain data, SI units: its fields by their names, but for the case.

    A member has in its place what is different in it.
    """
    data: dict[str, Any] = _encoded(design)
    del data["case"]
    for other in data["alternatives"]:
        del other["case"]
    for one, told in zip(
        (design, *design.alternatives), (data, *data["alternatives"]), strict=True
    ):
        exhibit = [] if one.exhibit is None else [one.exhibit]
        for member, fields in zip((*one.members, *exhibit), _further(told), strict=True):
            del fields["case"], fields["built_for"]
            fields["difference"] = difference_text(one.case, member.case)
    return data


def _further(told: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the members, and the exhibit, of a design as plain data."""
    return [*told["members"], *([told["exhibit"]] if "exhibit" in told else [])]


def load_design(path: str | Path) -> Design:
    """Read a design from a file that `save_design` wrote, of this version or an older one.

    It is equal to the one saved, to the last digit; `verify` checks it anew.

    Raises InputError if there is no such file, it is not a design, or a field is missing, unknown
    or wrong.
    """
    source = str(path)
    data, lines = read_yaml(_text(Path(path)), source)
    key = next((k for k in (_KEY, _STRUCTURE) if isinstance(data, Mapping) and k in data), None)
    if key is None:
        raise InputError(f"{source}: is not a design file: it has no key `{_KEY}`")
    formats = (1, FORMAT) if key == _KEY else (1,)
    if data[key] not in formats:
        wanted = f"must be {' or '.join(map(str, formats))}, the format that this version reads, "
        wanted += f"got {data[key]!r}"
        raise InputError(message_line(source, line_of((key,), lines), (key,), wanted))
    fields = {name: value for name, value in data.items() if name not in (key, _WRITER)}
    reader = _Reader(source, lines)
    if data[key] == 1:
        fields = _of_format_1(fields, reader, structure=key == _STRUCTURE)
    _complete(fields)
    design: Design = reader.value(Design, fields, ())
    if design.parameters:
        try:
            controller_for(design.case, design.structure, design.parameters)
        except KeyError as error:
            where = ("gains" if "gains" in data else "parameters", str(error.args[0]))
            raise reader.error(where, "is missing; it must be a number") from None
    return design


def is_design_file(path: str | Path) -> bool:
    """Return whether a file is there that calls itself a design."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return any(line.startswith((_KEY, _STRUCTURE)) for line in file)
    except (OSError, ValueError):
        return False


def _complete(fields: Mapping[str, Any]) -> None:
    """Put the cases back that alternatives and members have in common with the design."""

    def designs(of: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
        return [one for one in of.get(name) or () if isinstance(one, dict)]

    own, others = designs(fields, "members"), designs(fields, "alternatives")
    for other in others:
        other.setdefault("case", fields.get("case"))
        for member, same in zip(designs(other, "members"), own, strict=False):
            member.setdefault("case", same.get("case"))
            member.setdefault("built_for", fields.get("case"))
    exhibits = [o["exhibit"] for o in (fields, *others) if isinstance(o.get("exhibit"), dict)]
    for member in (*own, *exhibits):
        member.setdefault("built_for", fields.get("case"))


def _of_format_1(data: dict[str, Any], reader: _Reader, *, structure: bool) -> dict[str, Any]:
    """Return the fields of an older file as this version has them."""
    fields = dict(data)
    case = reader.case(fields.get("case"), ("case",))
    if not structure:
        if "gains" not in fields:
            raise reader.error(("gains",), "is missing")
        fields["parameters"] = fields.pop("gains")
        return {"structure": "payload-feedback", "units": {}, "shares": {}, **fields}
    given = fields.get("parameters")
    of_gains = str(fields.get("structure")).startswith("payload-feedback")
    if of_gains and given and isinstance(given, Mapping):
        own = case.gains.A if case.gains is not None else 1.0
        fields["parameters"] = {"A": own, **given}
    fields["shares"] = {PAYLOAD: fields.pop("parts", {})}
    fields["significant_height"] = case.sea.significant_height
    # It kept the number of starts only.
    return {**fields, "starts": [], "agreed": 0}


def _text(path: Path) -> str:
    if os.path.isdir(path):
        hint = f"; did you mean {path / 'design.yaml'}?" if (path / "design.yaml").exists() else ""
        raise InputError(f"{path}: is a folder; a design file is wanted{hint}")
    if not os.path.exists(path):
        raise InputError(f"{path}: no such design file")
    return case_text(path)


def _encoded(value: Any) -> Any:
    """Return plain data: dicts, lists, texts, numbers; fields that are None are left out."""
    if isinstance(value, Case):
        return value.to_dict()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        pairs = [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
        return {name: _encoded(item) for name, item in pairs if item is not None}
    if isinstance(value, Mapping):
        return {str(key): _encoded(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple | list):
        return [_encoded(item) for item in value]
    return value


@dataclasses.dataclass(frozen=True)
class _Reader:
    """Makes values of annotated types from plain data, and words what is wrong with the data."""

    source: str
    lines: Mapping[Place, int]

    def error(self, place: Place, text: str) -> InputError:
        return InputError(message_line(self.source, line_of(place, self.lines), place, text))

    def value(self, kind: Any, data: Any, place: Place) -> Any:
        """Return `data` as a value of the type `kind`."""
        origin, arguments = get_origin(kind), get_args(kind)
        if origin in (Union, types.UnionType):
            (inner,) = [item for item in arguments if item is not type(None)]
            return None if data is None else self.value(inner, data, place)
        if kind is Case:
            return self.case(data, place)
        if dataclasses.is_dataclass(kind):
            return self.record(kind, data, place)
        if origin is not None and issubclass(origin, Mapping):
            section = self.section(data, place)
            return {k: self.value(arguments[1], v, (*place, k)) for k, v in section.items()}
        if origin is tuple:
            rows = self.rows(data, place)
            return tuple(self.value(arguments[0], v, (*place, i)) for i, v in enumerate(rows))
        if origin is np.ndarray:
            rows = self.rows(data, place)
            array = np.array([self.number(v, (*place, i)) for i, v in enumerate(rows)])
            array.setflags(write=False)
            return array
        if kind is float:
            return self.number(data, place)
        names = {bool: "true or false", int: "a whole number", str: "text"}
        if type(data) is not kind:
            raise self.error(place, f"must be {names[kind]}, got {_got(data)}")
        return data

    def record(self, kind: Any, data: Any, place: Place) -> Any:
        """Return a dataclass from a section with a key for each of its fields."""
        section = self.section(data, place)
        hints = typing.get_type_hints(kind, localns={"Verification": Verification})
        fields = {field.name: field for field in dataclasses.fields(kind)}
        for key in section:
            if key not in fields:
                where = (*place, key)
                raise self.error(where, f"unknown key; {suggestion(key, list(fields))}")
        values: dict[str, Any] = {}
        for name, field in fields.items():
            if name in section:
                values[name] = self.value(hints[name], section[name], (*place, name))
            elif type(None) in get_args(hints[name]):
                values[name] = None
            elif field.default is field.default_factory is dataclasses.MISSING:
                raise self.error((*place, name), "is missing")
        return kind(**values)

    def case(self, data: Any, place: Place) -> Case:
        """Return the case, checked like a case file of its own, with the physics that it had."""
        section = self.section(data, place)
        depth = len(place)
        lines = {path[depth:]: line for path, line in self.lines.items() if path[:depth] == place}
        return Case.from_stored(section, source=self.source, lines=lines)

    def section(self, data: Any, place: Place) -> Mapping[str, Any]:
        if not isinstance(data, Mapping):
            raise self.error(place, f"must be a section with keys of its own, got {_got(data)}")
        return data

    def rows(self, data: Any, place: Place) -> list[Any]:
        if not isinstance(data, list):
            raise self.error(place, f"must be a list, got {_got(data)}")
        return data

    def number(self, data: Any, place: Place) -> float:
        if isinstance(data, int | float) and not isinstance(data, bool):
            with suppress(OverflowError):  # an integer of more digits than a number has
                if not math.isnan(found := float(data)):
                    return found
        raise self.error(place, f"must be a number, got {_got(data)}")


def _got(data: Any) -> str:
    if isinstance(data, Mapping | list):
        return "a section" if isinstance(data, Mapping) else "a list"
    return "nothing" if data is None else f"{data!r:.60}"
