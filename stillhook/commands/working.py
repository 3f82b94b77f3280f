"""The course of a command: its progress, Ctrl-C in it, the folder that it fills, and its end.

A computation that has something to keep is `stoppable`.
"""

import argparse
import contextlib
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

from models.basics import StillhookError

from ..text import (
    OutputFolder,
    Progress,
    Report,
    ReportSection,
    check_own,
    commands,
    console,
    folder_name,
    json_data,
    json_text,
    number,
    progress,
    show,
    write_json,
)

_NAMED = 3  # pictures that are named

Stop = Callable[[], bool]  #: Whether the user has asked to stop.


@contextlib.contextmanager
def stoppable() -> Iterator[Stop]:
    """Remember the first Ctrl-C instead of raising, so that what runs can end and be kept.

    The computation asks between two steps.  A second Ctrl-C raises KeyboardInterrupt as always.
    """
    asked = False

    def remember(number: int, frame: object) -> None:
        nonlocal asked
        del number, frame
        if asked:
            raise KeyboardInterrupt
        asked = True

    if threading.current_thread() is not threading.main_thread():
        yield lambda: asked  # only the main thread may handle signals
        return
    before = signal.signal(signal.SIGINT, remember)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)


def working(arguments: argparse.Namespace) -> AbstractContextManager[Progress]:
    """Show the progress of a computation, unless asked to be quiet."""
    return progress(shown=not arguments.quiet)


@contextlib.contextmanager
def counting(arguments: argparse.Namespace) -> Iterator[Progress]:
    """Show how many cases are done, and how fast, until Ctrl-C ends it in order."""
    with (
        stoppable() as stop,
        progress(
            shown=not arguments.quiet, pace=lambda speed: f"{number(60.0 * speed, 2)}/min"
        ) as tell,
    ):
        yield asking(stop, tell)


def asking(stop: Stop, tell: Progress) -> Progress:
    """Return what tells the progress, and ends the computation where the user has asked to."""

    def step(what: str, done: int, total: int) -> None:
        if stop():
            raise KeyboardInterrupt
        tell(what, done, total)

    return step


@contextlib.contextmanager
def tidy(place: Path) -> Iterator[None]:
    """Take the folders of a path away again if a question was wrong: no empty ones stay behind."""
    made = [path for path in (place, *place.parents) if not path.exists()]
    try:
        yield
    except StillhookError:
        for path in made:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise


def kept_in(folder: Path) -> list[str]:
    """Return the names of the files of a folder."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def place_for(arguments: argparse.Namespace, name: str, ending: str = "") -> Path:
    """Return where results go: the place that is given, or one in ``out`` by a name.

    Raises InputError if it is a folder that holds other people's files, unless `arguments.force`.
    """
    place = Path(arguments.out or usual_place(name, ending))
    if not arguments.force:
        check_own(place)
    return place


def usual_place(name: str, ending: str = "") -> Path:
    """Return where results go unless a place is given."""
    return Path("out") / f"{folder_name(name)}{ending}"


def prepared(arguments: argparse.Namespace, place: str | Path, ending: str = "") -> OutputFolder:
    """Return the folder for the results, with the figures that the arguments ask for.

    They may name it; else it is `place`, or by that name, and the ending, as for `place_for`.
    """
    if isinstance(place, str):
        place = place_for(arguments, place, ending)
    return OutputFolder.prepare(place, _kinds(arguments))


def _kinds(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Return the kinds of figures that the arguments ask for."""
    every = ("svg", "png") if arguments.format is None else (arguments.format,)
    return every if arguments.figures else ()


def prepared_table(
    arguments: argparse.Namespace, name: str, table: str
) -> tuple[OutputFolder, Path]:
    """Return the folder for a vessel, and its table there: the file that is given, or `table`."""
    from models.vessel.readers import ENDINGS

    target = place_for(arguments, name)
    if target.suffix.lower() not in ENDINGS:
        folder = prepared(arguments, target)
        return folder, folder.at(table)
    return OutputFolder.prepare(target.parent, _kinds(arguments), listing=False), target


def conclude(
    report: Report,
    arguments: argparse.Namespace,
    folder: OutputFolder | None = None,
    following: Sequence[tuple[str, str]] = (),
    *,
    brief: Sequence[ReportSection] = (),
    result: Any = None,
) -> int:
    """Print a report, the files that were written, and what to do next; return the exit status.

    Parameters
    ----------
    report
        What came of the command.
    arguments
        If they ask to be quiet the verdict alone is printed, a list as it is; if they ask for JSON
        the report as `stillhook.text.json_data` has it, with ``written``, the files, and nothing
        else.
    folder
        Where files were written, if any were.
    following
        Commands to go on with, each with what it does.
    brief
        Sections that are the verdict, where that is no sentence.
    result
        The result itself as plain data, for JSON alone.
    """
    written = [] if folder is None else folder.written
    out = console()
    if arguments.json:
        data = json_data(report) | {"written": [str(path) for path in written]}
        write_json(json_text(data | ({} if result is None else {"result": result})))
    elif arguments.quiet and brief:
        show(replace(report, sections=brief), out)
    elif arguments.quiet and not report.status:
        show(report, out)
    elif arguments.quiet:
        out.print(f"{report.name}: {report.status}", soft_wrap=True)
    else:
        show(report, out)
        out.print()
        if folder is not None and written:
            pictures = [path for path in written if path.suffix in (".svg", ".png")]
            place = folder.path
            tops = [path.relative_to(place).parts[0] for path in written if path not in pictures]
            names = list(dict.fromkeys(tops))  # of a folder within its name alone
            names += [path.name for path in pictures] if len(pictures) <= _NAMED else ["figures"]
            out.print(f"Written to {place}: {', '.join(names)}", soft_wrap=True)
        if following:
            commands(following, out)
    return 1 if report.ok is False else 0
