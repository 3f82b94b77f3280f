"""Tables and reports of results, and three of the forms they take: Markdown, CSV and JSON.

    result --> Report(sections of tables, drawings, sentences) --> terminal, Markdown, JSON

A study says what came of it as a `Report` and nothing else; the fourth form, the terminal, is in
`stillhook.text.terminal`.  Figures are in SI units: a column says how they are written.
"""

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from .quantities import percent, quantity
from .style import Figure


@dataclass(frozen=True)
class Written:
    """A figure in words of its own, as ``no bound`` for infinity, and where it came from.

    A place is a JSON pointer (RFC 6901), as in ``/limits/motor.torque.peak/value``.
    """

    value: Any
    text: str
    _: KW_ONLY
    unit: str = ""  #: SI unit of the value, where it is told.
    file: str = ""  #: The file that holds it, where that is told.
    field: str = ""  #: Its place in that file.


@dataclass(frozen=True)
class Sentence:
    """Words and figures in a row, read as one text."""

    parts: tuple[str | Written, ...]

    def __str__(self) -> str:
        return "".join(part if isinstance(part, str) else part.text for part in self.parts)


@dataclass(frozen=True)
class Listing:
    """A text as it stands in a file, with the name of that."""

    name: str
    text: str


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    name: str  #: Its name in data: CSV, JSON.
    label: str | Written | None = None  #: What people call it; by default its name.
    _: KW_ONLY
    unit: str = ""  #: SI unit of its figures, or what `quantities.scale` makes of it.
    digits: int = 3  #: Digits that count.
    left: bool = False  #: Whether it stands to the left, as words do.
    #: Writes a figure, where unit and digits do not say how.
    write: Callable[[Any], str] | None = None

    @property
    def heading(self) -> str:
        """What stands above it."""
        if isinstance(self.label, Written):
            return self.label.text
        return self.name if self.label is None else self.label

    def text(self, cell: Any) -> str:
        """Return a cell as people read it: nothing for None and NaN."""
        if isinstance(cell, Written | Bar):
            return cell.text
        if isinstance(cell, Sentence):
            return str(cell)
        if cell is None or (isinstance(cell, float) and math.isnan(cell)):
            return ""
        if isinstance(cell, str):
            return cell
        if self.write is not None:
            return self.write(cell)
        whole = isinstance(cell, int) and not self.unit
        return str(cell) if whole else quantity(float(cell), self.unit, self.digits)


def columns(text: str) -> tuple[Column, ...]:
    """Return columns from their headings with semicolons between, ``name=heading [unit digits] <``.

    The name in data is the heading where none is given; ``[%]`` writes a share in percent, and
    ``<`` stands words to the left.

    Examples
    --------
    >>> gear, power, by = columns("gear; power=rated power [W 4]; by=limited by <")
    >>> gear.text(14.8123), power.heading, power.text(70.0), by.left
    ('14.8', 'rated power', '70.00 W', True)
    """
    found = []
    for part in text.split(";"):
        name, _, heading = part.rpartition("=")
        heading, left = heading.strip().removesuffix("<").rstrip(), heading.rstrip().endswith("<")
        heading, _, inside = heading.removesuffix("]").partition("[")
        unit, _, last = inside.rpartition(" ")
        unit, digits = (unit, int(last)) if last.isdigit() else (inside, 3)
        heading, write = heading.rstrip(), percent if unit == "%" else None
        unit = "" if write else unit
        key = name.strip() or heading
        found.append(Column(key, heading, unit=unit, digits=digits, left=left, write=write))
    return tuple(found)


@dataclass(frozen=True)
class Bar:
    """A share that is used of something, as a bar; broken above one, pale where none was asked."""

    value: float
    kept: bool = True
    enforced: bool = True

    @property
    def text(self) -> str:
        """The share in percent."""
        return percent(self.value)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of figures and words under headings."""

    #: What it is about; the heading of the first column where that has none.
    title: str | Sentence = ""
    #: Columns, and for each row a cell for each of them: a number, a text, `Written`, `Bar`, or
    #: None.
    columns: tuple[Column, ...]
    rows: Sequence[Sequence[Any]]
    notes: tuple[str | Sentence, ...] = ()  #: Sentences that stand below it.
    #: Rows that carry a star, and those that are not as they should be.
    marked: tuple[int, ...] = ()
    broken: tuple[int, ...] = ()
    #: Rows on the terminal at most, the others are passed over evenly; all by default.
    most: int | None = None

    @property
    def headings(self) -> list[str]:
        """Texts above the columns."""
        first, *rest = (column.heading for column in self.columns)
        return [first or str(self.title), *rest]

    def cells(self, row: int) -> list[str]:
        """Return a row as texts."""
        texts = [c.text(v) for c, v in zip(self.columns, self.rows[row], strict=True)]
        if row in self.marked:
            texts[0] += " *"
        return texts

    @property
    def shown(self) -> list[int]:
        """The rows that the terminal shows."""
        count = len(self.rows)
        every = 1 if self.most is None else max(1, -(-count // self.most))
        return [k for k in range(count) if k % every == 0 or k in self.marked]


def pairs(rows: Sequence[tuple[str, str]], title: str = "") -> Table:
    """Return a table of labels and texts."""
    return Table(
        title=title, columns=(Column("name", ""), Column("text", "", left=True)), rows=rows
    )


def remarks(title: str, rows: Sequence[tuple[str, str, str]]) -> Table:
    """Return a table of labels, figures and remarks."""
    return Table(title=title, columns=columns("name=; figure=; remark=<"), rows=rows)


def data_table(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    """Return a table whose columns have names and nothing more, to be written as data."""
    return Table(columns=tuple(Column(name) for name in names), rows=rows)


@dataclass(frozen=True)
class Drawing:
    """A figure by the name of its file, with what it shows and the function that draws it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class ReportSection:
    """A part of a report: tables, drawings, listings and sentences under a title, and parts."""

    title: str | Sentence
    items: Sequence["Item"]


Item = Table | Drawing | Listing | ReportSection | Sentence | str


@dataclass(frozen=True, kw_only=True)
class Report:
    """What came of a study."""

    name: str  #: Name of the case, or of what was looked at.
    about: str = ""  #: What was asked.
    status: str = ""  #: The verdict, in a sentence.
    ok: bool | None = None  #: Whether all is well; None where that is not the question.
    mark: str = ""  #: What stands before the verdict instead of ok or NOT OK.
    sections: Sequence[ReportSection] = ()  #: All else, in the order in which it is read.

    @property
    def verdict_mark(self) -> str:
        """The word before the verdict."""
        return self.mark or {True: "ok", False: "NOT OK", None: ""}[self.ok]

    @property
    def drawings(self) -> list[Drawing]:
        """Every drawing."""
        return [drawing for part in self.sections for drawing in _drawings(part)]


def _drawings(section: ReportSection) -> list[Drawing]:
    found = []
    for item in section.items:
        if isinstance(item, ReportSection):
            found += _drawings(item)
        elif isinstance(item, Drawing):
            found.append(item)
    return found


def markdown(item: Report | Table, drawn: Sequence[str] | None = None) -> str:
    """Return a report or a table as Markdown.

    It shows the drawings named in `drawn`, whose files lie beside it; by default all.
    """
    if isinstance(item, Table):
        return "\n\n".join([_grid(item), *(f"{note}." for note in item.notes)]) + "\n"
    parts = [f"# {item.name}", item.about]
    if item.status:
        mark = {"ok": "Ok", "NOT OK": "Not ok"}.get(item.verdict_mark, item.verdict_mark)
        parts.append(f"**{mark}**: {item.status}." if mark else f"{item.status}.")
    for section in item.sections:
        parts += _section(section, drawn, "##")
    return "\n\n".join(part for part in parts if part) + "\n"


def _section(section: ReportSection, drawn: Sequence[str] | None, marks: str) -> list[str]:
    """Return a section in Markdown, part by part; one without anything in it is left out."""
    parts = []
    for one in section.items:
        if isinstance(one, ReportSection):
            parts += _section(one, drawn, f"{marks}#")
        elif isinstance(one, Drawing):
            shown = drawn is None or one.name in drawn
            parts += [f"![{one.caption}]({one.name}.svg)"] * shown
        elif isinstance(one, Listing):
            parts.append(f"`{one.name}`:\n\n```\n{one.text.rstrip()}\n```")
        else:
            parts.append(markdown(one).strip() if isinstance(one, Table) else _sentence(str(one)))
    return [f"{marks} {section.title}", *parts] if section.title and parts else parts


def csv_text(table: Table) -> str:
    """Return a table as CSV, SI units: the names of its columns with their units, and all rows."""
    target = io.StringIO()
    out = csv.writer(target, lineterminator="\n")
    out.writerow([f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns])
    for row in table.rows:
        plain = [cell.value if isinstance(cell, Written | Bar) else cell for cell in row]
        plain = [str(cell) if isinstance(cell, Sentence) else cell for cell in plain]
        out.writerow([repr(float(cell)) if isinstance(cell, float) else cell for cell in plain])
    return target.getvalue()


def json_data(item: Any) -> Any:
    """Return anything as plain data that JSON can hold: null for NaN and infinity.

    A report is ``name``, ``about``, ``ok``, ``status`` and ``sections``, each with ``title`` and
    ``items``; of these a table is ``title``, ``columns`` with ``name``, ``label`` and ``unit``,
    ``rows`` with a value for each name of a column, and ``notes``; a drawing is ``figure`` and
    ``caption``; a listing is ``name`` and ``text``; a sentence is a text.
    """
    if isinstance(item, Report):
        head = {"name": item.name, "about": item.about, "ok": item.ok, "status": item.status}
        return {**head, "sections": [json_data(section) for section in item.sections]}
    if isinstance(item, ReportSection):
        return {"title": json_data(item.title), "items": [json_data(each) for each in item.items]}
    if isinstance(item, Drawing):
        return {"figure": item.name, "caption": item.caption}
    if isinstance(item, Listing):
        return {"name": item.name, "text": item.text}
    if isinstance(item, Sentence):
        return str(item)
    if isinstance(item, Table):
        names = [column.name for column in item.columns]
        return {
            "title": json_data(item.title),
            "columns": [{"name": c.name, "label": c.heading, "unit": c.unit} for c in item.columns],
            "rows": [dict(zip(names, map(json_data, row), strict=True)) for row in item.rows],
            "notes": json_data(item.notes),
        }
    if isinstance(item, Written | Bar):
        return json_data(item.value)
    if isinstance(item, Mapping):
        return {str(key): json_data(each) for key, each in item.items()}
    if isinstance(item, list | tuple):
        return [json_data(each) for each in item]
    if item is None or isinstance(item, bool | str | int):
        return item
    if isinstance(item, float):
        return float(item) if math.isfinite(item) else None
    return json_data(item.item()) if hasattr(item, "item") else str(item)


def json_text(item: Any) -> str:
    """Return anything as JSON, see `json_data`."""
    return json.dumps(json_data(item), indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _grid(table: Table) -> str:
    """Return rows in Markdown; a bar in a text would end its cell."""
    lines = [table.headings, ["---"] * len(table.columns)]
    lines += [table.cells(k) for k in range(len(table.rows))]
    text = "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |"
        for line in ([c.replace("-\n", "-").replace("\n", " ") for c in line] for line in lines)
    )
    # The title stands above, where the first heading is taken.
    title = str(table.title)
    alone = title and title not in table.headings
    return f"**{title}**\n\n{text}" if alone else text


def _sentence(text: str) -> str:
    """Return a text with a capital and a full stop; one that is code, or a list, as it is."""
    if text[:1] in "`-*":
        return text
    return f"{text[:1].upper()}{text[1:]}{'' if text[-1:] in '.:`' else '.'}"
