"""A structure's design as a YAML file that loads again, like `stillhook.designs.design_file`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from models.basics import InputError, write_text_atomically
from models.casefile import line_of, message_line, read_yaml, yaml_text
from synth.design import StructureDesign

from .design_file import _encoded, _Reader, _text

FORMAT = 1
"""Version of the file's format."""

_KEY = "stillhook_structure"
_WRITER = "written_by"


def save_structure(design: StructureDesign, path: str | Path) -> Path:
    """Write a structure's design to a YAML file, whole or not at all.

    Parameters
    ----------
    design
        The design.
    path
        The file; its folder must exist.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    return write_text_atomically(path, structure_text(design))


def structure_text(design: StructureDesign) -> str:
    """Return a design as the YAML text that `load_structure` reads."""
    from .._version import __version__

    content = {_KEY: FORMAT, _WRITER: f"stillhook {__version__}", **_encoded(design)}
    content["case"] = content.pop("case")
    heading = (
        f"# The structure {design.structure} by Stillhook for the case {design.case.name}, in SI\n"
        "# units. stillhook.load_structure reads it; `case` is a case file of its own.\n"
    )
    return heading + yaml_text(content)


def load_structure(path: str | Path) -> StructureDesign:
    """Read a design from a file that `save_structure` wrote.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    StructureDesign
        Equal to the one saved, to the last digit; `verify` checks it anew.

    Raises
    ------
    InputError
        If there is no such file, it is not a structure's design, or a field is missing, unknown
        or wrong.
    """
    source = str(path)
    data, lines = read_yaml(_text(Path(path)), source)
    if not isinstance(data, Mapping) or _KEY not in data:
        raise InputError(f"{source}: is not a structure's design: it has no key `{_KEY}`")
    if data[_KEY] != FORMAT:
        wanted = f"must be {FORMAT}, the format that this version reads, got {data[_KEY]!r}"
        raise InputError(message_line(source, line_of((_KEY,), lines), (_KEY,), wanted))
    content = {key: value for key, value in data.items() if key not in (_KEY, _WRITER)}
    design: StructureDesign = _Reader(source, lines).value(StructureDesign, content, ())
    return design
