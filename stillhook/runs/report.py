"""A folder with everything that runs have to say: numbers, words, figures, time traces.

    Runs, or several to compare --> summary.json, summary.md, events.csv, figures, runs/seed-000.csv

`summary.json` is for programs: every quantity of every run, their means and intervals, versions.
With several controllers each has a folder of its own, and the summary compares them.  Every file
is written whole or not at all.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

from models.basics import InputError
from models.case import Case
from models.run import Run, write_csv, write_netcdf, write_parquet

from ..text import OutputFolder, folder_name
from .json import summary_of, summary_text
from .runs import Runs
from .table import TableRow, rows_of
from .words import headline_of

TraceFormat = Literal["csv", "parquet", "netcdf", "none"]
FORMATS: Mapping[str, tuple[str, Callable[[Run, Path], Path]]] = {
    "csv": ("csv", write_csv),
    "parquet": ("parquet", write_parquet),
    "netcdf": ("nc", write_netcdf),
}
"""Suffix and writer of each format of time traces; "none" writes none."""

_KINDS = ("svg", "png")
_FIGURES = ("traces", "strip", "comparison", "exceedance")
_CAPTIONS = {
    "comparison": "What is left of the motion with each controller",
    "exceedance": "How often the payload reaches a level",
    "traces": "Time traces: the whole run, and a close-up",
    "strip": "Hook, drum, rope and payload at some moments",
}
_MOVIE = "animation.gif"


@dataclass(kw_only=True)
class RunFolder:
    """A folder that runs are written into as they come.

    Parameters
    ----------
    folder
        The folder, made and known to be writable.
    format
        Of the files with time traces.
    several
        Whether there are several controllers, each with a folder of its own.
    written
        What has been written so far.
    """

    folder: OutputFolder
    format: TraceFormat = "csv"
    several: bool = False
    written: list[Path] = field(default_factory=list)

    def add(self, run: Run) -> None:
        """Write the time traces of a run.

        Raises
        ------
        InputError
            If the file cannot be written, as on a disk that is full, or the format takes a
            package that is not installed.
        """
        if self.format == "none" or not run.time.size:
            return
        suffix, write = FORMATS[self.format]
        place = OutputFolder.prepare(self.place_of(run.controller).path / "runs")
        try:
            path = write(run, place.path / f"seed-{run.seed:03d}.{suffix}")
        except ModuleNotFoundError as error:
            raise InputError(
                f"format {self.format}: the package {error.name} is not installed; use csv"
            ) from error
        self.written.append(path)

    def place_of(self, controller: str) -> OutputFolder:
        """Return the folder of a controller."""
        if not self.several:
            return self.folder
        return OutputFolder(self.folder.path / folder_name(controller))

    def finish(
        self,
        compared: Sequence[Runs],
        *,
        case: Case | None = None,
        question: Mapping[str, object] | None = None,
        figures: bool = True,
        animate: bool = False,
        progress: Callable[[str, float], None] | None = None,
    ) -> None:
        """Write the summary of runs, their events and their figures.

        Parameters
        ----------
        compared
            Runs of one controller, or of several.
        case
            The case as it was given; by default that of the runs, as it is in the scenario.
        question
            What was asked, to be kept beside the answer; plain data.
        figures, animate
            Whether to draw figures, and a moving picture.
        progress
            Called with what is being done, and the share of it that is.

        Raises
        ------
        InputError
            If a file cannot be written.
        """
        tell = progress or _silent
        content = summary_of(compared, question)
        own = compared[0].case if case is None else case
        self._put(self.folder, "case.yaml", own.to_yaml())
        self._put(self.folder, "summary.json", summary_text(content))
        self._put(self.folder, "events.csv", _events_text(compared))
        drawn = self._draw(compared, tell) if figures else []
        if animate:
            self._animate(compared, tell)
        self._put(self.folder, "summary.md", _markdown(compared, drawn))
        self._clean(compared)

    def _put(self, place: OutputFolder, name: str, content: str | bytes) -> None:
        self.written.append(place.write(name, content))

    def _draw(self, compared: Sequence[Runs], tell: Callable[[str, float], None]) -> list[str]:
        """Write the figures; return their paths from the folder, without suffix."""
        from ..text import picture
        from .figures import comparison, exceedance, figures_of

        wanted: list[tuple[OutputFolder, str, Callable[[], Any]]] = []
        if len(compared) > 1:
            wanted.append((self.folder, "comparison", lambda: comparison(compared)))
        if compared[0].stays:
            wanted.append((self.folder, "exceedance", lambda: exceedance(compared)))
        for runs in compared:
            if figures_of(runs):
                place = OutputFolder.prepare(self.place_of(runs.controller).path)
                wanted += [(place, name, make) for name, make in figures_of(runs).items()]
        drawn = []
        for done, (place, name, make) in enumerate(wanted):
            tell("drawing", done / len(wanted))
            try:
                figure = make()
            except InputError:
                continue  # runs that were cut short have nothing to show
            for kind in self.folder.kinds:
                self._put(place, f"{name}.{kind}", picture(figure, kind))
            drawn.append((place.path / name).relative_to(self.folder.path).as_posix())
        return drawn

    def _animate(self, compared: Sequence[Runs], tell: Callable[[str, float], None]) -> None:
        from .animation import animation

        for runs in compared:
            if runs.worst.time.size < 2:
                continue
            place = OutputFolder.prepare(self.place_of(runs.controller).path)
            what = f"animating {runs.controller}"
            film = animation(runs.worst, runs.scenario, progress=partial(tell, what))
            self._put(place, _MOVIE, film)

    def _clean(self, compared: Sequence[Runs]) -> None:
        """Remove what an earlier simulation has left here and this one does not have."""
        mine = {path.resolve() for path in self.written}
        places = {self.folder.path, *(self.place_of(runs.controller).path for runs in compared)}
        suffixes = [suffix for suffix, _ in FORMATS.values()]
        for place in places:
            old = [place / f"{name}.{kind}" for name in _FIGURES for kind in _KINDS]
            old += [place / _MOVIE]
            old += [path for s in suffixes for path in (place / "runs").glob(f"seed-[0-9]*.{s}")]
            for path in old:
                if path.resolve() not in mine:
                    OutputFolder(path.parent).discard(path.name)


def write_runs(
    folder: str | Path,
    compared: Sequence[Runs],
    *,
    format: TraceFormat = "csv",
    figures: bool = True,
    animate: bool = False,
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
    figures, animate
        Whether to draw figures, and a moving picture of the worst run.
    question
        What was asked, to be kept in the summary; plain data.

    Returns
    -------
    list of Path
        The files written: ``case.yaml``, ``summary.json``, ``summary.md``, ``events.csv``, the
        figures ``exceedance``, ``comparison``, ``traces`` and ``strip`` as ``.svg`` and
        ``.png``, ``animation.gif``, and the traces in ``runs/``; with several controllers what
        belongs to one is in a folder of its name.

    Raises
    ------
    InputError
        If there are no runs, two controllers have the same name, the format is unknown, or a
        file cannot be written.
    """
    if not compared:
        raise InputError("write_runs: at least one set of runs is wanted, got none")
    if format not in (*FORMATS, "none"):
        raise InputError(
            f"write_runs: format must be one of {', '.join(FORMATS)}, none; got {format!r}"
        )
    names = [runs.controller for runs in compared]
    if len(set(names)) != len(names):
        raise InputError(
            f"write_runs: controllers must have different names, got {', '.join(names)}"
        )
    target = RunFolder(
        folder=OutputFolder.prepare(folder), format=format, several=len(compared) > 1
    )
    for runs in compared:
        for run in runs:
            target.add(run)
    target.finish(compared, question=question, figures=figures, animate=animate)
    return target.written


def _events_text(compared: Sequence[Runs]) -> str:
    """Return the events of all runs as CSV."""
    target = io.StringIO()
    table = csv.writer(target, lineterminator="\n")
    table.writerow(("controller", "seed", "time [s]", "kind", "event"))
    for runs in compared:
        for run in runs:
            for event in run.events:
                table.writerow((run.controller, run.seed, repr(event.time), event.kind, event.text))
    return target.getvalue()


def _markdown(compared: Sequence[Runs], drawn: Sequence[str]) -> str:
    """Return the summary as Markdown; its figures are those of the same folder."""
    first = compared[0]
    parts = [f"# {first.case.name}, {first.scenario.name}", f"{_sentence(first)}"]
    parts += [f"{headline_of(runs)}." for runs in compared]
    if len(compared) > 1:
        rows = rows_of(compared)
        headings = ("", *(runs.controller for runs in compared))
        cells = [(_label(row), *(row.cell(i) for i in range(len(compared)))) for row in rows]
        parts.append(_table(headings, cells))
    parts += [
        _picture(name) for name in drawn if "/" not in name and name not in ("traces", "strip")
    ]
    for runs in compared:
        parts.append(f"## {runs.controller}")
        cells = [(r.group, r.label, r.full(0), r.interval(0), r.note) for r in rows_of([runs])]
        parts.append(_table(("", "", "mean", "95 % interval", ""), cells))
        own = folder_name(runs.controller) + "/" if len(compared) > 1 else ""
        own_names = [f"{own}traces", f"{own}strip"]
        parts += [_picture(name) for name in drawn if name in own_names]
    parts.append("`summary.json` holds all of this for programs, `case.yaml` the case.")
    return "\n\n".join(parts) + "\n"


def _sentence(runs: Runs) -> str:
    """Return what the scenario is, as a sentence."""
    text = runs.scenario.description
    return f"{text[:1].upper()}{text[1:]}."


def _label(row: TableRow) -> str:
    return f"{row.label} [{row.shown_unit}]" if row.shown_unit else row.label


def _picture(name: str) -> str:
    return f"![{_CAPTIONS[name.rpartition('/')[2]]}]({name}.svg)"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def _silent(what: str, share: float) -> None:
    """Tell nobody."""
