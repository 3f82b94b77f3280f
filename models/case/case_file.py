"""Case files: reading YAML, TOML and JSON, the bundled cases, the template and the JSON Schema.

    file or bundled name -> text -> plain data with line numbers -> `Case.from_dict`

YAML is read as version 1.2; JSON is a part of it.  TOML goes through the same models; its errors
name the field alone, as the standard library does not say in which line a value stood.
"""

import os
import tomllib
import warnings
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from ..basics import InputError, PhysicsWarning
from ..casefile import Path as FieldPath
from ..casefile import case_text, line_of, message_line, read_yaml, suggestion
from .case import Case
from .plausibility import changed_meanings, remarks

_TEMPLATE = "template"


def load_case(name_or_path: str | Path) -> Case:
    """Read a bundled case by its name, or a case file by its path.

    Parameters
    ----------
    name_or_path
        A name that `bundled_cases` lists, or the path of a `.yaml`, `.json` or `.toml` file.

    Raises
    ------
    InputError
        If there is no such case, or it has errors: one line for each, with file and line.

    Warns
    -----
    PhysicsWarning
        For each implausible figure, and for what a field that is not given once meant.

    Examples
    --------
    >>> load_case("thesis-1975").rope.length
    2000.0
    """
    source = str(name_or_path)
    if isinstance(name_or_path, str) and source in _bundled_names():
        text = _bundled_text(source)
        kind = "yaml"
        folder = None  # a bundled case names bundled data only
    else:
        text = _file_text(Path(name_or_path))
        kind = Path(name_or_path).suffix.lower().lstrip(".")
        folder = Path(name_or_path).parent
    data, lines = _parsed(text, kind, source)
    if data is None:
        raise InputError(f"{source}: is empty; `stillhook new` writes a case to start from")
    if not isinstance(data, Mapping):
        what = "a list" if isinstance(data, list) else f"{data!r:.40}"
        raise InputError(
            f"{source}: must hold sections (sea:, vessel:, rope:, ...) at the top, got {what}"
        )
    case = Case.from_dict(data, source=source, lines=lines, folder=folder)
    for field, text in (*changed_meanings(case), *remarks(case)):
        where = tuple(field.split("."))
        message = message_line(source, line_of(where, lines), where, text)
        warnings.warn(message, PhysicsWarning, stacklevel=2)
    return case


def bundled_cases() -> tuple[tuple[str, str], ...]:
    """Return name and one-line description of each case that comes with the toolkit."""
    found = []
    for name in _bundled_names():
        data, _ = read_yaml(_bundled_text(name), name)
        found.append((name, " ".join(str(data["description"]).split())))
    return tuple(found)


def template_text() -> str:
    """Return a commented case file, in YAML, that runs as it is."""
    return _bundled_text(_TEMPLATE)


def case_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a case file, for editors.

    Descriptions carry the unit and the range of each field.
    """
    schema = Case.model_json_schema()
    _describe_units(schema)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Stillhook case file",
        **{key: value for key, value in schema.items() if key != "title"},
    }


def _describe_units(node: Any) -> None:
    """Append unit and range to the descriptions, where editors show them."""
    if isinstance(node, list):
        for item in node:
            _describe_units(item)
        return
    if not isinstance(node, dict):
        return
    for item in node.values():
        _describe_units(item)
    quantity = next(
        (
            part
            for part in [node, *node.get("anyOf", ())]
            if isinstance(part, dict) and "x-range" in part
        ),
        None,
    )
    if quantity is not None and "description" in node:
        sentence = " ".join(str(node["description"]).split())
        node["description"] = f"{sentence} Must be {quantity['x-range']}."
    elif isinstance(node.get("description"), str):
        node["description"] = " ".join(node["description"].split())


def _bundled_names() -> tuple[str, ...]:
    folder = resources.files("models") / "cases"
    names = (item.name.removesuffix(".yaml") for item in folder.iterdir())
    return tuple(sorted(name for name in names if "." not in name and name != _TEMPLATE))


def _bundled_text(name: str) -> str:
    return (resources.files("models") / "cases" / f"{name}.yaml").read_text(encoding="utf-8")


def _file_text(path: Path) -> str:
    if not os.path.exists(path):  # a name may be too long to be asked about
        near = suggestion(path.name, _bundled_names())
        raise InputError(f"{path}: no such case file or bundled case; {near}")
    return case_text(path)


def _parsed(text: str, kind: str, source: str) -> tuple[Any, dict[FieldPath, int]]:
    if kind != "toml":
        return read_yaml(text, source)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).partition(" (at ")
        digits = place.removeprefix("line ").partition(",")[0]
        line = int(digits) if digits.isdigit() else 0
        raise InputError(message_line(source, line, (), f"is not TOML: {problem}")) from None
    except RecursionError:
        raise InputError(f"{source}: is nested too deep; no case is") from None
    except ValueError as error:  # a whole number of thousands of digits
        raise InputError(f"{source}: is not TOML: {str(error).partition(';')[0]}") from None
    return data or None, {}
