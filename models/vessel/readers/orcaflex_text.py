"""The part of an OrcaFlex text file (.yml) that holds a vessel type's RAOs, quickly.

Such a file may be a whole model of tens of thousands of lines, and a YAML reader in Python takes
seconds for it.  So it is pruned before it is read: blocks below a vessel type that are not on the
way to the RAOs are skipped by their indentation, and the tables of numbers are taken out and read
by numpy.  What is left, some dozens of lines of names and conventions, goes to the YAML reader.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...basics import FloatArray, InputError

TABLE_KEYS = ("RAOPeriodOrFrequency", "RAOPeriodOrFreq")
"""How the heading of a RAO table begins, in newer and in older versions."""

_KEPT = {"VesselTypes", "Draughts", "DisplacementRAOs", "LoadRAOs", "RAOs"}
_COLUMNS = 13
_KEY = re.compile(r"^(?P<indent>[ ]*(?:- +)*)(?P<key>[A-Za-z][^:#\[\]{}]*?):(?P<rest>\s.*|)$")
_ROW = re.compile(r"\[([^\[\]]*)\]")
_MARK = "@table"
_NO_TYPES = (
    "there is no list of VesselTypes in this file; is it an OrcaFlex text file with a vessel type?"
)
_LONGEST = 400_000  # lines


def read_vessel_types(owner: str, text: str) -> tuple[list[dict[str, Any]], list[FloatArray]]:
    """Return the vessel types of a file, and the tables that they point at.

    Parameters
    ----------
    owner, text
        The file's path, for messages, and what is in it.

    Returns
    -------
    tuple[list[dict], list[FloatArray]]
        The vessel types; where one of them has a table of RAOs, the text "@table 3" stands for
        the third table (rows, 13).

    Raises
    ------
    InputError
        If the file is no YAML, or has no vessel type.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    pruned, tables = _pruned(owner, text)
    try:
        found = YAML(typ="safe", pure=True).load(pruned)
    except (YAMLError, ValueError, TypeError, KeyError, RecursionError, AttributeError) as error:
        what = " ".join(str(error).split())[:160]
        raise InputError(f"{owner}: cannot be read as an OrcaFlex file (YAML): {what}") from error
    types = found.get("VesselTypes") if isinstance(found, dict) else None
    if not isinstance(types, list) or not types or not all(isinstance(t, dict) for t in types):
        raise InputError(f"{owner}: {_NO_TYPES}")
    return types, tables


def _pruned(owner: str, text: str) -> tuple[str, list[FloatArray]]:
    """Return what leads to the RAOs, with marks for the tables, and the tables."""
    lines = text.splitlines()
    if len(lines) > _LONGEST:
        raise InputError(f"{owner}: must have at most {_LONGEST} lines, got {len(lines)}")
    kept: list[str] = []
    tables: list[FloatArray] = []
    heads = (n for n, line in enumerate(lines) if line.strip().startswith("VesselTypes:"))
    i = first = next(heads, -1)
    if first < 0:
        raise InputError(f"{owner}: {_NO_TYPES}")
    base = len(lines[first]) - len(lines[first].lstrip())
    while i < len(lines):
        line = lines[i]
        indent = len(line) - len(line.lstrip())
        blank = not line.strip() or line.lstrip().startswith("#")
        if i > first and not blank and indent <= base and not line.lstrip().startswith("- "):
            break  # the next section of the model
        match = _KEY.match(line)
        i += 1
        if blank:
            continue
        if match is None:
            kept.append(line)
            continue
        column = len(match["indent"])
        key, rest = match["key"], match["rest"].split(" #")[0].strip()
        if key.startswith(TABLE_KEYS) and not rest:
            end = _end(lines, i, column)
            table = _numbers(lines[i:end])
            if table is not None:
                kept.append(f'{match["indent"]}{_heading(key)}: "{_MARK} {len(tables)}"')
                tables.append(table)
                i = end
                continue
        elif not rest and key not in _KEPT:
            i = _end(lines, i, column)
            continue
        kept.append(f"{match['indent']}{_heading(key)}: {rest}" if "," in key else line)
    return "\n".join(kept), tables


def _heading(key: str) -> str:
    return f'"{key}"' if '"' not in key else key


def _end(lines: list[str], start: int, column: int) -> int:
    """Return where the block below a key in this column ends."""
    for number in range(start, len(lines)):
        line = lines[number]
        body = line.lstrip()
        if not body or body.startswith("#"):
            continue
        indent = len(line) - len(body)
        # A list may stand in the column of its key.
        if indent < column or (indent == column and not body.startswith("- ")):
            return number
    return len(lines)


def _numbers(lines: list[str]) -> FloatArray | None:
    """Return a list of flow sequences of 13 numbers, or None if the lines are something else."""
    text = " ".join(line.split("#")[0] for line in lines)
    rows = _ROW.findall(text)
    if not rows or re.sub(r"[\s-]", "", _ROW.sub("", text)):
        return None
    try:
        table = [[float(word) for word in row.split(",") if word.strip()] for row in rows]
    except ValueError:
        return None
    if any(len(row) != _COLUMNS for row in table):
        return None
    return np.array(table, dtype=np.float64)


def table_of(owner: str, entry: object, tables: list[FloatArray]) -> FloatArray:
    """Return the table that an entry of a vessel type points at, or holds itself.

    Raises
    ------
    InputError
        If it is no table of 13 columns of finite numbers.
    """
    if isinstance(entry, str) and entry.startswith(_MARK):
        index = entry[len(_MARK) :].strip()
        if index.isdigit() and int(index) < len(tables):
            table = tables[int(index)]
            if np.all(np.isfinite(table)):
                return table
    try:
        rows = np.array(entry, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != _COLUMNS or not np.all(np.isfinite(rows)):
        raise InputError(
            f"{owner}: a table of RAOs must have 13 columns of finite numbers: period or "
            "frequency, then amplitude and phase of the six motions"
        )
    return rows
