"""A folder with everything that a comparison has to say: tables, words, figures, traces.

    Comparison --> summary.md, summary.json, table.csv, runs.csv, traces.csv, figures

Beside these lies `cells.jsonl`, from which the comparison goes on (`stillhook.comparison.store`).
Every file is written whole or not at all.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from models.basics import InputError

from ..text import OutputFolder
from .comparison import COLUMNS, Comparison
from .store import question_of
from .words import HEADINGS, LEGEND, headline_of, left_out, rows_at

_FORMAT = 1
_FIGURES = {
    "heights": "The payload's motion with each contender",
    "worst": "Time traces around the worst moment of the best linear law",
}
_KINDS = ("svg", "png")
_DIGITS = 10  # of times in files


def write_comparison(folder: str | Path, found: Comparison, *, figures: bool = True) -> list[Path]:
    """Write a comparison into a folder, and return the files written.

    Parameters
    ----------
    folder
        The folder; it is made if need be.
    found
        The comparison.
    figures
        Whether to draw figures.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    place = OutputFolder.prepare(folder)
    written = [
        place.write("case.yaml", found.case.to_yaml()),
        place.write("table.csv", found.table.to_csv(index=False, lineterminator="\n")),
        place.write("runs.csv", _runs_text(found)),
        place.write(
            "summary.json", json.dumps(summary_of(found), indent=1, allow_nan=False) + "\n"
        ),
    ]
    if found.traces:
        written.append(place.write("traces.csv", _traces_text(found)))
    else:
        place.discard("traces.csv")
    drawn = _draw(place, found, written) if figures else []
    for name in _FIGURES:
        for kind in _KINDS:
            if name not in drawn:
                place.discard(f"{name}.{kind}")
    written.append(place.write("summary.md", _markdown(found, drawn)))
    return written


def summary_of(found: Comparison) -> dict[str, Any]:
    """Return a comparison as plain data: what was asked, who took part, the table, every run.

    Numbers are in SI; null stands for what did not occur or has no end.
    """
    table = found.table.to_dict("records")
    return {
        "stillhook_comparison": _FORMAT,
        "question": _plain(question_of(found.question)),
        "heights": list(found.heights),
        "seeds": list(found.seeds),
        "complete": found.complete,
        "units": dict(COLUMNS),
        "contenders": {
            each.name: {"what": each.what, "knows": each.knows, "group": each.group}
            for each in found.contenders
        },
        "sentences": list(found.sentences),
        "table": _plain(table),
        "designs": [
            {"contender": name, "height": height, **_plain(law.to_dict())}
            for (name, height), law in found.laws.items()
        ],
        "runs": [_plain(cell.to_dict()) for cell in found.cells],
    }


def _draw(place: OutputFolder, found: Comparison, written: list[Path]) -> list[str]:
    from ..text import picture
    from .figures import heights, worst_moment

    drawn = []
    for name, make in (("heights", heights), ("worst", worst_moment)):
        try:
            figure = make(found)
        except InputError:
            continue  # stopped before there was anything to show
        written += [place.write(f"{name}.{kind}", picture(figure, kind)) for kind in _KINDS]
        drawn.append(name)
    return drawn


def _runs_text(found: Comparison) -> str:
    """Return every run as a line of CSV."""
    names = list(dict.fromkeys(name for cell in found.cells for name in cell.quantities))
    fixed = ("contender", "height", "seed", "status", "message", "sample_time", "wall")
    target = io.StringIO()
    table = csv.writer(target, lineterminator="\n")
    steps = ("median", "p99", "max")
    table.writerow([*fixed, *names, *(f"step {name}" for name in steps), "trips", "fallbacks"])
    for cell in found.cells:
        row = [getattr(cell, name) for name in fixed]
        row += [cell.quantities.get(name, math.nan) for name in names]
        row += [cell.step.get(name, math.nan) for name in steps]
        row += [_pairs(cell.trips), _pairs(cell.fallbacks)]
        table.writerow([repr(value) if isinstance(value, float) else value for value in row])
    return target.getvalue()


def _traces_text(found: Comparison) -> str:
    """Return the traces as CSV, one line for each contender and time."""
    names = list(dict.fromkeys(name for trace in found.traces for name in trace.signals))
    target = io.StringIO()
    table = csv.writer(target, lineterminator="\n")
    table.writerow(["contender", "time [s]", *names])
    for trace in found.traces:
        columns = [trace.signals.get(name) for name in names]
        for k, time in enumerate(trace.time):
            values = ["" if column is None else f"{column[k]:.6g}" for column in columns]
            table.writerow([trace.contender, f"{time:.{_DIGITS}g}", *values])
    return target.getvalue()


def _markdown(found: Comparison, drawn: Sequence[str]) -> str:
    parts = [f"# {found.case.name}: controllers compared", f"{headline_of(found)}."]
    if not found.complete:
        parts.append("**Stopped before the end**: only the runs that were made are counted.")
    parts += ["\n".join(f"- {sentence}" for sentence in found.sentences)]
    parts += [f"![{_FIGURES[name]}]({name}.svg)" for name in drawn]
    for height in found.heights:
        rows = rows_at(found, height)
        parts += [f"## H_s {height:.4g} m", _table(HEADINGS, rows)]
    parts += ["## Who takes part"]
    about = [(each.name, each.what, each.knows) for each in found.contenders]
    parts.append(_table(("", "what it is", "what it knows"), about))
    notes = [
        (each.name, f"{height:.4g}", found.note(each, height))
        for each in found.contenders
        for height in found.heights
        if found.note(each, height)
    ]
    if notes:
        parts.append(_table(("", "H_s [m]", "note"), notes))
    parts += left_out(found)
    parts.append(
        "Every contender meets the same hook motion for the same seed, on the same nonlinear "
        f"plant with the drive's limits.  {LEGEND}, pooled over seeds.  "
        "`table.csv` has all columns, `runs.csv` every run, `summary.json` both for programs; "
        "`cells.jsonl` is what the comparison goes on from."
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def _pairs(counts: Mapping[str, float]) -> str:
    return " ".join(f"{name}={number}" for name, number in counts.items())


def _plain(value: Any) -> Any:
    """Return plain data as JSON holds it: null for NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, bool) or value is None or isinstance(value, str | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return _plain(value.item()) if hasattr(value, "item") else str(value)
