"""A report put together, and what its pages are made of: plain parts for HTML and for PDF alike.

Findings, TitleBlock --> Document: files, Report of 16 chapters --> pages --> HTML, PDF
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from models.basics import InputError

from ..designs import design_data
from ..text import (
    Column,
    Drawing,
    Listing,
    Progress,
    Report,
    ReportSection,
    Sentence,
    Table,
    Written,
    csv_text,
    folder_name,
    inline_svg,
    json_data,
)
from .answer import design_chapter, loads, stability, utilisation
from .data import Told, results
from .findings import Findings, TitleBlock
from .question import basis, identification, summary, system, vessel_and_sea
from .sources import Sources, figures_in, figures_of
from .studies import (
    alternatives,
    appendix,
    energy,
    failures,
    operability,
    robustness,
    verification,
)
from .wording import CASE, DESIGN, OWN

_LONG = 40  # characters of a cell from which on its column shares the room that is left
FORMAT = 1  #: Version of the format of `report.json`.
TABLES = "tables"  #: Folder of the tables in a report's own.


@dataclass(frozen=True, kw_only=True, eq=False)
class Document:
    """A report: its chapters, and the files that their figures are read from."""

    sources: Sources
    report: Report
    design_text: str  #: What `design.yaml` holds.

    @classmethod
    def of(cls, findings: Findings, block: TitleBlock, *, bound: bool = True) -> Document:
        """Return the report on a design and its studies, and the best possible if `bound`.

        Raises SynthesisError, SolverError if a figure of it cannot be computed.
        """
        told, design = Told(findings=findings, wants_bound=bound), findings.design
        case = json_data(design.case.to_dict())
        own = {"results": results(findings, block, told)}
        # Infinite margins stand in a design's file, where JSON has none.
        s = Sources(files={CASE: case, DESIGN: design_data(design), OWN: own})
        chapters = [
            identification(s),
            summary(s, findings),
            basis(s, design.case),
            vessel_and_sea(s, told),
            system(s),
            design_chapter(s, findings),
            stability(s, told, findings),
            utilisation(s, told, findings),
            loads(s),
            robustness(s, told, findings),
            operability(s, told),
            alternatives(s, told),
            energy(s),
            failures(s, told),
            verification(s),
            appendix(s, told),
        ]
        told_of = s.value(f"{OWN}#/results/identification")
        report = Report(
            name=told_of["title"],
            about=told_of["description"],
            status=told_of["status"],
            ok=told_of["ok"],
            sections=chapters,
        )
        return cls(sources=s, report=report, design_text=told.design_text)

    @property
    def tables(self) -> dict[str, str]:
        """The tables as CSV in SI units, by the names of their files."""
        found = {}
        for number, chapter in enumerate(self.report.sections, 1):
            name = folder_name(str(chapter.title).lower())
            for k, table in enumerate(_tables(chapter), 1):
                found[f"{TABLES}/{number:02d}-{name}-{k}.csv"] = csv_text(table)
        return found

    @property
    def data(self) -> dict[str, Any]:
        """What `report.json` holds: every result, and every figure with the place it came from."""
        own: Mapping[str, Any] = self.sources.files[OWN]
        figures = [
            {
                "id": f"n{k + 1}",
                "chapter": title,
                "text": figure.text,
                "value": figure.value,
                "unit": figure.unit,
                "file": figure.file,
                "field": figure.field,
            }
            for k, (title, figure) in enumerate(figures_of(self.report))
        ]
        return {"stillhook_report": FORMAT, **own, "figures": figures}

    def pages(self, progress: Progress | None = None, *, figures: bool = True) -> dict[str, Any]:
        """Return the document as plain parts, each figure drawn unless none are wanted.

        A part is ``{"kind": "words", "parts": [...]}``, a ``table``, a ``figure`` with its
        ``svg``, a ``listing``, or a ``section`` with ``title`` and ``items``; parts of words are
        ``{"text": ...}``, with ``id`` and ``place`` where they are a figure, or ``{"code": ...}``.
        """
        maker = _Pages(len(self.report.drawings) if figures else 0, progress)
        chapters = [maker.section(section) for section in self.report.sections]
        head = {"title": self.report.name, "about": self.report.about}
        verdict = {"ok": self.report.ok, "status": self.report.status}
        block = self.sources.value(f"{OWN}#/results/identification")
        return {**head, **verdict, "block": block, "chapters": chapters}


def _tables(section: ReportSection) -> Iterator[Table]:
    for item in section.items:
        if isinstance(item, ReportSection):
            yield from _tables(item)
        elif isinstance(item, Table):
            yield item


class _Pages:
    """Makes plain parts, and counts the figures in the order in which they are read."""

    def __init__(self, drawings: int, progress: Progress | None) -> None:
        self._drawings, self._progress = drawings, progress
        self._drawn = self._told = 0

    def section(self, section: ReportSection) -> dict[str, Any]:
        title = _capital(self.words(section.title))
        items = [part for item in section.items for part in self.item(item)]
        return {"kind": "section", "title": title, "items": items}

    def item(self, item: Any) -> list[dict[str, Any]]:
        if isinstance(item, ReportSection):
            return [self.section(item)]
        if isinstance(item, Table):
            return [self.table(item)]
        if isinstance(item, Listing):
            return [{"kind": "listing", "name": item.name, "text": item.text.rstrip()}]
        if isinstance(item, Drawing):
            return self.drawing(item)
        return [{"kind": "words", "parts": self.words(item, whole=True)}]

    def drawing(self, drawing: Drawing) -> list[dict[str, Any]]:
        if not self._drawings:
            return []
        if self._progress is not None:
            self._progress("figures", self._drawn, self._drawings)
        self._drawn += 1
        with contextlib.suppress(InputError):  # there is nothing to draw
            svg = inline_svg(drawing)
            return [
                {"kind": "figure", "name": drawing.name, "caption": drawing.caption, "svg": svg}
            ]
        return []

    def table(self, table: Table) -> dict[str, Any]:
        # In the order of `figures_of`: title, headings, cells, notes.
        named = [column.heading for column in table.columns]
        title = [] if str(table.title) in named else self.words(table.title)
        heads = []
        for k, column in enumerate(table.columns):
            label = column.label if isinstance(column.label, Written) else column.heading
            heads.append({"parts": self.words(label), "left": column.left or k == 0})
        rows = []
        for r, row in enumerate(table.rows):
            cells = [self.cell(*pair) for pair in zip(table.columns, row, strict=True)]
            rows.append({"cells": cells, "broken": r in table.broken})
        notes = [self.words(note, whole=True) for note in table.notes]
        bare = not any(column.heading for column in table.columns)
        return {
            "kind": "table",
            "title": title,
            "heads": [] if bare else heads,
            "left": [head["left"] for head in heads],
            "weights": _weights(table),
            "rows": rows,
            "notes": notes,
            "origin": origin(table),
        }

    def cell(self, column: Column, cell: Any) -> list[dict[str, Any]]:
        return self.words(cell if isinstance(cell, Written | Sentence) else column.text(cell))

    def words(self, words: Any, *, whole: bool = False) -> list[dict[str, Any]]:
        """Return a text as parts; a `whole` one with its capital and its full stop."""
        pieces = words.parts if isinstance(words, Sentence) else (words,)
        parts: list[dict[str, Any]] = []
        for piece in pieces:
            if isinstance(piece, Written) and piece.file:
                self._told += 1
                place = f"{piece.file}#{piece.field}"
                parts.append({"text": piece.text, "id": f"n{self._told}", "place": place,
                              "value": _plain(piece.value)})  # fmt: skip
                continue
            text = piece.text if isinstance(piece, Written) else str(piece)
            if len(pieces) == 1 and text[:1] == "`":
                parts.append({"code": text.strip("`")})
            elif text:
                parts.append({"text": text})
        return _whole(parts) if whole else parts


def _weights(table: Table) -> list[int]:
    """Return how much room each column of long texts wants beside others; 0 for a column of none.

    Twice as long a text in a column twice as wide is as high: the roots of lengths keep them even.
    """
    every = [
        max((len(column.text(row[k])) for row in table.rows), default=0)
        for k, column in enumerate(table.columns)
    ]
    return [round(math.sqrt(longest)) if longest > _LONG else 0 for longest in every]


def _whole(parts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return words with a capital at the beginning and a full stop at the end."""
    if not parts or "code" in parts[0]:
        return parts
    last = _capital(parts)[-1]
    if "id" in last:
        return parts if last["text"][-1:] in ".:" else [*parts, {"text": "."}]
    if last["text"][-1:] not in ".:`":
        last["text"] += "."
    return parts


def _capital(parts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return words with a capital at the beginning; a figure begins as its file has it."""
    if parts and "id" not in parts[0] and "text" in parts[0]:
        text = parts[0]["text"]
        parts[0]["text"] = f"{text[:1].upper()}{text[1:]}"
    return parts


def _plain(value: Any) -> str:
    """Return the value of a figure for programs, nothing where it is a text or has no end."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return ""
    return repr(value)


def origin(table: Table) -> str:
    """Return where the figures of a table come from: their file, and what their fields share."""
    figures = [figure for row in table.rows for cell in row for figure in figures_in(cell)]
    found = []
    for file in dict.fromkeys(figure.file for figure in figures):
        paths = [figure.field.split("/") for figure in figures if figure.file == file]
        shared = []
        for steps in zip(*paths, strict=False):
            if len(set(steps)) > 1:
                break
            shared.append(steps[0])
        found.append(f"{file}#{'/'.join(shared)}")
    return ", ".join(found)
