"""The files of a report as data, and figures that say in which of them they stand, and where.

    files as plain data --> Sources.cite("design.yaml#/payload_rms", "m") --> Written
    Report of a study   --> cited                                        --> Report of such figures

A place is the name of a file and a JSON pointer (RFC 6901) in it.  A figure can only be written by
naming its place, so that there is none in a report whose origin is not known.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..text import (
    Drawing,
    Item,
    Listing,
    Report,
    ReportSection,
    Sentence,
    Table,
    Written,
    json_data,
    quantity,
)

NONE = "-"  #: What stands for a figure that there is not.
_DIGIT = re.compile(r"\d")


def value_at(data: Any, pointer: str) -> Any:
    """Return what a JSON pointer leads to in plain data.

    Raises KeyError if it leads nowhere.
    """
    found = data
    for part in pointer.split("/")[1:]:
        name = part.replace("~1", "/").replace("~0", "~")
        try:
            found = found[int(name)] if isinstance(found, list) else found[name]
        except (IndexError, KeyError, TypeError, ValueError):
            raise KeyError(pointer) from None
    return found


def step(name: object) -> str:
    """Return a name, or a number in a list, as one step of a pointer."""
    return "/" + str(name).replace("~", "~0").replace("/", "~1")


@dataclass(frozen=True, kw_only=True)
class Sources:
    """The files of a report by their names, as plain data."""

    files: Mapping[str, Any]

    def value(self, place: str) -> Any:
        """Return what stands at a place, as in ``case.yaml#/rope/length``.

        Raises KeyError if there is no such place.
        """
        file, _, pointer = place.partition("#")
        return value_at(self.files[file], pointer)

    def has(self, place: str) -> bool:
        """Return whether there is anything at a place."""
        try:
            return self.value(place) is not None
        except KeyError:
            return False

    def cite(
        self,
        place: str,
        unit: str = "",
        digits: int = 3,
        write: Callable[[Any], str] | None = None,
    ) -> Written:
        """Return the figure at a place in a unit [SI] and so many digits, or as `write` has it.

        Raises KeyError if there is no such place.
        """
        value = self.value(place)
        file, _, field = place.partition("#")
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return Written(None, NONE)
        if write is not None:
            text = write(value)
        elif isinstance(value, str):
            text = value
        elif isinstance(value, int) and not unit:
            text = str(value)
        else:
            text = quantity(float(value), unit, digits)
        return Written(value, text, unit=unit, file=file, field=field)

    def say(self, words: str, *figures: Written | str) -> Sentence:
        """Return a sentence, with ``{}`` where each of the figures stands."""
        texts = words.split("{}")
        parts: list[str | Written] = [texts[0]]
        for figure, text in zip(figures, texts[1:], strict=True):
            parts += [figure, text]
        return Sentence(tuple(part for part in parts if part != ""))


def cited(report: Report, file: str, pointer: str) -> Report:
    """Return a report whose figures say that they stand at a place of a file.

    There the report lies as `stillhook.text.json_data` has it.
    """
    sections = [
        cited_section(section, file, f"{pointer}/sections/{s}")
        for s, section in enumerate(report.sections)
    ]
    return replace(report, sections=sections)


def cited_section(section: ReportSection, file: str, pointer: str) -> ReportSection:
    """Return a section of a report as `cited` does, that lies at a place by itself."""
    items = [_item(item, file, f"{pointer}/items/{i}") for i, item in enumerate(section.items)]
    title = quoted(str(section.title), file, f"{pointer}/title")
    return ReportSection(title, items)


def _item(item: Item, file: str, pointer: str) -> Item:
    if isinstance(item, Table):
        return cited_table(item, file, pointer)
    if isinstance(item, ReportSection):
        return cited_section(item, file, pointer)
    if isinstance(item, Drawing | Listing):
        return item
    return quoted(str(item), file, pointer)


def quoted(text: str, file: str, pointer: str) -> Sentence:
    """Return a text that stands at a place; one without a figure needs none."""
    if not _DIGIT.search(text):
        return Sentence((text,))
    return Sentence((Written(text, text, file=file, field=pointer),))


def cited_table(table: Table, file: str, pointer: str) -> Table:
    """Return a table whose cells, headings and notes say where they stand."""
    heads = tuple(
        replace(column, label=Written(column.heading, column.heading, file=file, field=place))
        if _DIGIT.search(column.heading)
        else column
        for column, place in (
            (column, f"{pointer}/columns/{k}/label") for k, column in enumerate(table.columns)
        )
    )
    title = table.title
    if isinstance(title, str) and _DIGIT.search(title):
        title = quoted(title, file, f"{pointer}/title")
    rows = []
    for r, row in enumerate(table.rows):
        cells: list[Any] = []
        for column, cell in zip(table.columns, row, strict=True):
            text, place = column.text(cell), f"{pointer}/rows/{r}{step(column.name)}"
            if isinstance(cell, Written) and cell.file:
                cells.append(cell)
            elif isinstance(cell, Sentence) or not _DIGIT.search(text):
                cells.append(text if isinstance(cell, str | Written) else (text or None))
            else:
                value = json_data(cell)
                cells.append(Written(value, text, unit=column.unit, file=file, field=place))
        rows.append(cells)
    notes = tuple(
        quoted(str(note), file, f"{pointer}/notes/{n}") for n, note in enumerate(table.notes)
    )
    return replace(table, title=title, columns=heads, rows=rows, notes=notes)


def figures_of(report: Report) -> list[tuple[str, Written]]:
    """Return every figure of a report in the order in which it is read, with its section."""
    return [
        (str(section.title), figure)
        for section in report.sections
        for figure in figures_in(section)
    ]


def figures_in(item: Any) -> list[Written]:
    """Return every figure of a part of a report that says where it stands."""
    if isinstance(item, Written):
        return [item] if item.file else []
    parts: list[Any] = []
    if isinstance(item, Sentence):
        parts = [*item.parts]
    elif isinstance(item, Table):
        cells = [cell for row in item.rows for cell in row]
        parts = [item.title, *(column.label for column in item.columns), *cells, *item.notes]
    elif isinstance(item, ReportSection):
        parts = [item.title, *item.items]
    return [figure for part in parts for figure in figures_in(part)]
