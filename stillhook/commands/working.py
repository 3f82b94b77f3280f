"""The course of a command: its progress, Ctrl-C in it, the folder that it fills, and its end.

A computation that has something to keep is `stoppable`, one that swallows Ctrl-C `interruptible`.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
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
_AGAIN = 0.25  # s between two attempts to interrupt

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


@contextlib.contextmanager
def interruptible() -> Iterator[Callable[[], None]]:
    """Make Ctrl-C end a computation that swallows it.

    CasADi turns an interrupt within IPOPT into a solve that failed, and the search goes on
    with the next start.  So an interrupt is remembered, and raised again until it gets
    through: by a timer where there is one, and by the function that is yielded, which the
    computation's progress calls.
    """
    asked = False

    def interrupt(number: int, frame: object) -> None:
        nonlocal asked
        del number, frame
        asked = True
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        raise KeyboardInterrupt

    def check() -> None:
        if asked:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield check  # only the main thread may handle signals
        return
    alarm = getattr(signal, "SIGALRM", None)
    before = signal.signal(signal.SIGINT, interrupt)
    before_alarm = signal.SIG_DFL if alarm is None else signal.signal(alarm, interrupt)
    try:
        yield check
    finally:
        if alarm is not None:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(alarm, before_alarm)
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def working(arguments: argparse.Namespace) -> Iterator[Progress]:
    """Show the progress of a computation, unless asked to be quiet, and let Ctrl-C end it."""
    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        yield step


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
