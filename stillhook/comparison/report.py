"""The report of a comparison, and a folder with all of it: tables, words, figures, traces.

    Comparison --> Report --> summary.md, summary.json, table.csv, runs.csv, traces.csv, figures

Beside these lies `cells.jsonl`, from which the comparison goes on (`stillhook.comparison.store`).
Every file is written whole or not at all.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from models.basics import shows_progress

from ..text import (
    Drawing,
    OutputFolder,
    Report,
    ReportSection,
    Table,
    columns,
    csv_text,
    data_table,
    json_data,
    json_text,
    markdown,
    pictures,
)
from .comparison import COLUMNS, Comparison
from .figures import heights, worst_moment
from .store import question_of
from .words import LEGEND, about_of, left_out, sentences_of, tables_at

_FORMAT = 1
_DIGITS = 10  # of times in files
_SAME = (
    "Every contender meets the same hook motion for the same seed, on the same nonlinear plant "
    f"with the drive's limits.  {LEGEND}.  `table.csv` has all columns, "
    "`runs.csv` every run, `summary.json` both for programs; `cells.jsonl` is what the comparison "
    "goes on from."
)


def comparison_report(found: Comparison) -> Report:
    """Return what contenders came to: sentences, figures, a table for each height."""
    stopped = "stopped before the end: only the runs that were made are counted"
    caption = "Time traces around the worst moment of the best linear law"
    drawings = [
        Drawing("heights", "The payload's motion with each contender", lambda: heights(found)),
        Drawing("worst", caption, lambda: worst_moment(found)),
    ]
    tables = [table for height in found.heights for table in tables_at(found, height)]
    return Report(
        name=found.case.name,
        about=about_of(found),
        status="" if found.complete else stopped,
        ok=not any(cell.status in ("failed", "died") for cell in found.cells),
        sections=[
            ReportSection("", [*sentences_of(found), *drawings]),
            ReportSection("", [*tables, LEGEND]),
            ReportSection("", left_out(found)),
        ],
    )


@shows_progress("drawing")
def write_comparison(
    folder: str | Path | OutputFolder,
    found: Comparison,
    *,
    figures: bool = True,
    traces: bool = False,
) -> list[Path]:
    """Write a comparison into a folder, made if need be, and return the files written.

    `figures` says whether to draw figures, `traces` whether to write the time traces around the
    worst moment, some megabytes.  Raises InputError if a file cannot be written.
    """
    place = OutputFolder.prepare(folder)
    report = comparison_report(found)
    place.write("case.yaml", found.case.to_yaml())
    place.write("table.csv", found.table.to_csv(index=False, lineterminator="\n"))
    place.write("runs.csv", csv_text(_runs(found)))
    place.write("summary.json", json_text(comparison_data(found)))
    if traces and found.traces:
        place.write("traces.csv", csv_text(_traces(found)))
    drawn = place.draw(report.drawings) if figures else []
    text = markdown(_with_contenders(report, found), [path.stem for path in drawn])
    place.write("summary.md", f"{text}\n{_SAME}\n")
    place.discard("traces.csv", *pictures(*(drawing.name for drawing in report.drawings)))
    return place.written


def comparison_data(found: Comparison) -> dict[str, Any]:
    """Return a comparison as plain data: what was asked, who took part, the table, every run.

    Numbers are in SI; null stands for what did not occur or has no end.
    """
    table = found.table.to_dict("records")
    return {
        "stillhook_comparison": _FORMAT,
        "question": json_data(question_of(found.question)),
        "heights": list(found.heights),
        "seeds": list(found.seeds),
        "complete": found.complete,
        "units": dict(COLUMNS),
        "contenders": {
            each.name: {"what": each.what, "knows": each.knows, "group": each.group}
            for each in found.contenders
        },
        "sentences": list(sentences_of(found)),
        "table": table,
        "designs": [
            {"contender": name, "height": height, **law.to_dict()}
            for (name, height), law in found.laws.items()
        ],
        "runs": [cell.to_dict() for cell in found.cells],
    }


def _with_contenders(report: Report, found: Comparison) -> Report:
    """Return the report with who took part, what they know, and how their designs came about."""
    about = [(each.name, each.what, each.knows) for each in found.contenders]
    notes = [
        (each.name, height, found.note(each, height))
        for each in found.contenders
        for height in found.heights
        if found.note(each, height)
    ]
    tables = [Table(columns=columns("contender=; what it is; what it knows"), rows=about)]
    if notes:
        tables.append(Table(columns=columns("contender=; H_s [m]; note"), rows=notes))
    return replace(report, sections=[*report.sections, ReportSection("Who takes part", tables)])


def _runs(found: Comparison) -> Table:
    """Return every run as data."""
    names = list(dict.fromkeys(name for cell in found.cells for name in cell.quantities))
    fixed = ("contender", "height", "seed", "status", "message", "sample_time", "wall")
    steps = ("median", "p99", "max")
    rows = [
        [
            *(getattr(cell, name) for name in fixed),
            *(cell.quantities.get(name, math.nan) for name in names),
            *(cell.step.get(name, math.nan) for name in steps),
            _pairs(cell.trips),
            _pairs(cell.fallbacks),
        ]
        for cell in found.cells
    ]
    ends = [*(f"step {name}" for name in steps), "trips", "fallbacks"]
    return data_table([*fixed, *names, *ends], rows)


def _traces(found: Comparison) -> Table:
    """Return the traces as data, a row for each contender and time."""
    names = list(dict.fromkeys(name for trace in found.traces for name in trace.signals))
    rows = []
    for trace in found.traces:
        columns = [trace.signals.get(name) for name in names]
        for k, time in enumerate(trace.time):
            values = ["" if column is None else f"{column[k]:.6g}" for column in columns]
            rows.append([trace.contender, f"{time:.{_DIGITS}g}", *values])
    return data_table(["contender", "time [s]", *names], rows)


def _pairs(counts: Mapping[str, float]) -> str:
    return " ".join(f"{name}={number}" for name, number in counts.items())
