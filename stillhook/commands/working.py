"""The course of a command: its progress, Ctrl-C in it, the folder that it fills, and its end.

A computation that has something to keep is `stoppable`.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from models.basics import StillhookError

from ..text import (
    OutputFolder,
    Progress,
    Report,
    commands,
    console,
    folder_name,
    json_data,
    json_text,
    number,
    progress,
    show,
)

_NAMED = 3  # pictures that are named

Stop = Callable[[], bool]
"""Whether the user has asked to stop."""


@contextlib.contextmanager
def stoppable() -> Iterator[Stop]:
    """Remember the first Ctrl-C instead of raising, so that what runs can end and be kept.

    The computation asks between two steps.  A second Ctrl-C raises KeyboardInterrupt as always.

    Yields
    ------
    Stop
        To be asked.
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

        def step(what: str, done: int, total: int) -> None:
            if stop():
                raise KeyboardInterrupt
            tell(what, done, total)

        yield step


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
    """Return where results go: the place that is given, or one in ``out`` by a name."""
    return Path(arguments.out or Path("out") / f"{folder_name(name)}{ending}")


def prepared(arguments: argparse.Namespace, name: str, ending: str = "") -> OutputFolder:
    """Return the folder for the results, with the figures that the arguments ask for."""
    return OutputFolder.prepare(place_for(arguments, name, ending), figure_kinds(arguments))


def prepared_table(
    arguments: argparse.Namespace, name: str, table: str
) -> tuple[OutputFolder, Path]:
    """Return the folder for a vessel, and its table there: the file that is given, or `table`."""
    target = place_for(arguments, name)
    alone = target.suffix.lower() in {".csv", ".nc"}
    folder = OutputFolder.prepare(target.parent if alone else target, figure_kinds(arguments))
    return folder, target if alone else folder.path / table


def figure_kinds(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Return the endings of the files of a figure; none where none is to be drawn."""
    if not arguments.figures:
        return ()
    return ("svg", "png") if arguments.format is None else (arguments.format,)


def conclude(
    report: Report,
    arguments: argparse.Namespace,
    *,
    written: Sequence[Path] = (),
    following: Callable[[], Sequence[tuple[str, str]]] = tuple,
    result: Callable[[], Any] | None = None,
) -> int:
    """Print a report, the files that were written, and what to do next; return the exit status.

    Parameters
    ----------
    report
        What came of the command.
    arguments
        If they ask to be quiet the verdict alone is printed; if they ask for JSON the report as
        `stillhook.text.json_data` has it, with ``written``, the files, and nothing else.
    written
        The files.
    following
        Returns commands to go on with, each with what it does.
    result
        Returns the result itself as plain data, for JSON alone.
    """
    if arguments.json:
        data = json_data(report) | {"written": [str(path) for path in written]}
        if result is not None:
            data["result"] = result()
        sys.stdout.write(json_text(data))
        return 1 if report.ok is False else 0
    out = console()
    if arguments.quiet:
        out.print(f"{report.name}: {report.status}", soft_wrap=True)
        return 1 if report.ok is False else 0
    show(report, out)
    out.print()
    if written:
        pictures = [path for path in written if path.suffix in (".svg", ".png")]
        names = [path.name for path in written if path not in pictures]
        names += [path.name for path in pictures] if len(pictures) <= _NAMED else ["figures"]
        out.print(f"Written to {written[0].parent}: {', '.join(names)}", soft_wrap=True)
    if rows := following():
        commands(rows, out)
    return 1 if report.ok is False else 0
