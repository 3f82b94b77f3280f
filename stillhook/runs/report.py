"""The report of runs, and a folder with all of it: numbers, words, figures, time traces.

    Runs, or several to compare --> summary.json, summary.md, events.csv, figures, runs/seed-000.csv

`summary.json` is for programs: every quantity of every run, their means and intervals, versions.
With several controllers each has a folder of its own, and the summary compares them.  Every file
is written whole or not at all.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from models.basics import InputError, check_choice, shows_progress
from models.case import Case
from models.run import ERROR, FEWEST_MAXIMA, Run, write_csv, write_netcdf, write_parquet

from ..text import (
    Drawing,
    Item,
    OutputFolder,
    Report,
    ReportSection,
    Table,
    count,
    csv_text,
    data_table,
    duration,
    folder_name,
    json_text,
    markdown,
    number,
    pictures,
    quantity,
)
from .data import runs_data
from .figures import comparison, exceedance
from .runs import Runs, headline_of, speed_of
from .strip import strip
from .table import tables_of
from .trace_figure import traces

TraceFormat = Literal["csv", "parquet", "netcdf", "none"]
FORMATS: Mapping[str, tuple[str, Callable[[Run, Path], Path]]] = {
    "csv": ("csv", write_csv),
    "parquet": ("parquet", write_parquet),
    "netcdf": ("nc", write_netcdf),
}
"""Suffix and writer of each format of time traces; "none" writes none."""

_FIGURES = ("traces", "strip", "comparison", "exceedance")
_READ = "`summary.json` holds all of this for programs, `case.yaml` the case."
_EVENTS = 8  # told of a run
_RUNS = 4  # whose events are told


def runs_report(compared: Sequence[Runs]) -> Report:
    """Return what came of runs of one controller, or of several on the same case and scenario."""
    first, several = compared[0], len(compared) > 1
    name, about = f"{first.case.name}, {first.scenario.name}", first.scenario.description
    heads = [headline_of(runs) for runs in compared]
    if not several:
        name, _, about = headline_of(first).partition(": ")
        heads = [first.scenario.description]
    tables: list[Item] = [*tables_of(compared)]
    closing = [] if several else [*_missing_extremes(first), *_speed(first)]
    drawings = []
    if several:
        caption = "What is left of the motion with each controller"
        drawings.append(Drawing("comparison", caption, lambda: comparison(compared)))
    if first.stays:
        caption = "How often the payload reaches a level"
        drawings.append(Drawing("exceedance", caption, lambda: exceedance(compared)))
    for runs in compared:
        drawings += _drawings(runs, several=several)
    return Report(
        name=name,
        about=about,
        ok=all(runs.completed for runs in compared),
        sections=[
            ReportSection("", heads),
            ReportSection("", tables),
            ReportSection("", [*closing, *drawings]),
            *_events(compared),
        ],
    )


def write_traces(
    folder: OutputFolder, run: Run, format: TraceFormat = "csv", *, several: bool = False
) -> None:
    """Write the time traces of a run, of several controllers into a folder each.

    Raises InputError if the file cannot be written, as on a disk that is full, or the format takes
    a package that is not installed.
    """
    if format == "none" or not run.time.size:
        return
    suffix, write = FORMATS[format]
    place = folder.at(f"{_own(run.controller, several)}runs/seed-{run.seed:03d}.{suffix}")
    try:
        folder.keep(write(run, place))
    except ModuleNotFoundError as error:
        raise InputError(
            f"format {format}: the package {error.name} is not installed; use csv"
        ) from error


def write_summary(
    folder: OutputFolder,
    compared: Sequence[Runs],
    *,
    case: Case | None = None,
    question: Mapping[str, object] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> None:
    """Write the summary of runs, their events and their figures.

    The case is as it was given; by default that of the runs, as it is in the scenario.  The
    question is plain data, to be kept beside the answer.  `progress` is called with what is being
    done, and the share of it that is.

    Raises InputError if a file cannot be written.
    """
    tell = progress or (lambda what, share: None)
    report = runs_report(compared)
    folder.write("case.yaml", (case or compared[0].case).to_yaml())
    folder.write("summary.json", json_text(runs_data(compared, question)))
    folder.write("events.csv", csv_text(_event_table(compared)))
    drawn = folder.draw(report.drawings, progress=lambda what, done, of: tell("drawing", done / of))
    own = [_own(runs.controller, len(compared) > 1) for runs in compared]
    names = [p.relative_to(folder.path).with_suffix("").as_posix() for p in drawn]
    text = markdown(_with_each(report, compared), names)
    folder.write("summary.md", f"{text}\n{_READ}\n")
    # What an earlier simulation has left here and this one does not have.
    traces = [f"runs/seed-[0-9]*.{suffix}" for suffix, _ in FORMATS.values()]
    stale = [*pictures(*_FIGURES), *traces]
    folder.discard(*(place + name for place in ("", *own) for name in stale))


def _own(controller: str, several: bool) -> str:
    """Return what the names of a controller's files begin with."""
    return f"{folder_name(controller)}/" if several else ""


@shows_progress("drawing")
def write_runs(
    folder: str | Path,
    compared: Sequence[Runs],
    *,
    format: TraceFormat = "none",
    figures: bool = True,
    question: Mapping[str, object] | None = None,
) -> list[Path]:
    """Write everything there is to say about runs into a folder.

    Parameters
    ----------
    folder
        The folder; it is made if need be.
    compared
        Runs of one controller, or of several on the same case and scenario.
    format
        Of the files with the time traces: csv, parquet, netcdf or none.
    figures
        Whether to draw figures.
    question
        What was asked, to be kept in the summary; plain data.

    Returns
    -------
    list of Path
        The files written: ``case.yaml``, ``summary.json``, ``summary.md``, ``events.csv``, the
        figures ``exceedance``, ``comparison``, ``traces`` and ``strip`` as ``.svg`` and
        ``.png``, and the traces in ``runs/``; with several controllers what belongs to one is
        in a folder of its name.

    Raises
    ------
    InputError
        If there are no runs, two controllers have the same name, the format is unknown, or a
        file cannot be written.
    """
    if not compared:
        raise InputError("write_runs: at least one set of runs is wanted, got none")
    check_choice("write_runs", "format", format, (*FORMATS, "none"))
    names = [runs.controller for runs in compared]
    if len(set(names)) != len(names):
        raise InputError(
            f"write_runs: controllers must have different names, got {', '.join(names)}"
        )
    target = OutputFolder.prepare(folder, ("svg", "png") if figures else ())
    for runs in compared:
        for run in runs:
            write_traces(target, run, format, several=len(compared) > 1)
    write_summary(target, compared, question=question)
    return target.written


def _drawings(runs: Runs, *, several: bool) -> list[Drawing]:
    """Return the figures of one controller; of several each has a folder of its own."""
    if runs.worst.time.size < 2:
        return []
    own = _own(runs.controller, several)
    whole = "Time traces: the whole run, and a close-up"
    moments = "Hook, drum, rope and payload at some moments"
    return [
        Drawing(f"{own}traces", whole, lambda: traces(runs.worst)),
        Drawing(f"{own}strip", moments, lambda: strip(runs.worst, runs.scenario)),
    ]


def _with_each(report: Report, compared: Sequence[Runs]) -> Report:
    """Return the report of several controllers with the tables of each of them alone."""
    if len(compared) < 2:
        return report
    own = [ReportSection(runs.controller, [*tables_of([runs])]) for runs in compared]
    return replace(report, sections=[*report.sections, *own])


def _event_table(compared: Sequence[Runs]) -> Table:
    """Return the events of all runs as data."""
    names = ("controller", "seed", "time [s]", "kind", "event")
    return data_table(
        names,
        [
            (runs.controller, run.seed, event.time, event.kind, event.text)
            for runs in compared
            for run in runs
            for event in run.events
        ],
    )


def _events(compared: Sequence[Runs]) -> list[ReportSection]:
    """Return what happened: first what all runs have in common, then run by run."""
    told = {(runs.controller, run.seed): _told(run) for runs in compared for run in runs}
    common = [line for line in next(iter(told.values())) if all(line in t for t in told.values())]
    common = common if len(told) > 1 else []
    sections = [ReportSection("in every run", _first(common))] if common else []
    for runs in compared:
        own = {
            run.seed: [line for line in told[runs.controller, run.seed] if line not in common]
            for run in sorted(runs, key=lambda run: run.completed)
        }
        eventful = [(seed, lines) for seed, lines in own.items() if lines]
        for seed, lines in eventful[:_RUNS]:
            sections.append(ReportSection(f"{runs.controller}, seed {seed}", _first(lines)))
        if len(eventful) > _RUNS:
            rest = count(len(eventful) - _RUNS, "more run")
            text = f"and {rest} of {runs.controller} with events, see events.csv"
            sections.append(ReportSection("", [text]))
    return sections


def _first(lines: Sequence[str]) -> list[str]:
    rest = len(lines) - _EVENTS
    more = [f"and {count(rest, 'more event')}, see events.csv"] if rest > 0 else []
    return [*lines[:_EVENTS], *more]


def _told(run: Run) -> list[str]:
    """Return a run's events, its end and its fallbacks as lines."""
    lines = [f"at {event}" for event in run.events]
    for kind, times in run.timings.fallbacks.items():
        lines.append(f"the controller's command was not used {count(times, 'time')}: {kind}")
    if run.status not in ("completed", "diverged") and run.message:
        lines.append(run.message)
    return lines


def _missing_extremes(runs: Runs) -> list[str]:
    """Return why there is no most probable maximum, if there should be one."""
    if not runs.extremes or not math.isnan(runs.extremes["payload up"].value):
        return []
    blocks = sum(run.statistics.blocks[ERROR].maxima.size for run in runs.judged)
    length = duration(runs[0].statistics.block)
    need = f"they take {FEWEST_MAXIMA} blocks of {length}, these runs have {blocks}"
    return [f"no extremes of the payload: {need}"]


def _speed(runs: Runs) -> list[str]:
    """Return how fast the runs were, and how fast a controller in Python."""
    first, timings = runs[0], runs[0].timings
    steps = f"step {quantity(first.step, 's')}, sample {quantity(first.sample_time, 's')}"
    lines = [f"{speed_of(runs)}; {steps}"]
    if not math.isnan(timings.controller_median):
        each = (timings.controller_median, timings.controller_p99, timings.controller_max)
        median, rare, most = (
            f"{number(1e6 * s)} us" if s < 1e-3 else quantity(s, "s") for s in each
        )
        lines.append(f"a step of the controller takes {median}, {rare} in 1 of 100, at most {most}")
    return lines
