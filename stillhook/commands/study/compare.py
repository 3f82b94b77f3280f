"""`stillhook compare`: controllers side by side in the same seas, on the same nonlinear plant.

Exit status 0 if every run was made, 1 if one failed or nobody could take part, 130 after Ctrl-C;
what was simulated until then is kept, and the same command goes on with it.
"""

from __future__ import annotations

import argparse
import contextlib
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError, check_range

from ...comparison import Comparison
from ...text import commands, console, count, folder_name, number, pairs
from ..given import case_words, given_case
from ..run import Stop, stoppable

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

_MANY = 10_000  # seeds: more than anybody wants on purpose
_SMALL = 0.3  # of a bar's width


def run(arguments: argparse.Namespace) -> int:
    """Compare, show and save; return the exit status."""
    from ...comparison import compare

    if arguments.list:
        return _list()
    check_range("compare", "--seeds", arguments.seeds, low=1, high=_MANY)
    wanted = _controllers(arguments.controllers)
    heights = _heights(arguments.hs)
    case = given_case(arguments)
    place = Path(arguments.out or Path("out") / f"{folder_name(case.name)}-compare")
    made = [path for path in (place, *place.parents) if not path.exists()]
    out = console()
    try:
        with stoppable() as stop, _progress(stop, shown=not arguments.quiet) as tell:
            found = compare(
                case,
                wanted,
                seeds=arguments.seeds,
                duration=arguments.duration,
                heights=heights,
                mismatch=arguments.mismatch,
                masses=arguments.masses,
                settle=arguments.settle,
                design_at=arguments.design_at,
                starts=arguments.starts,
                jobs=arguments.jobs,
                out=place,
                traces=arguments.figures,
                progress=tell,
            )
    except InputError:
        for path in made:  # a question that was wrong leaves no empty folders behind
            with contextlib.suppress(OSError):
                path.rmdir()
        raise
    if not found.cells:
        if not found.complete:
            raise KeyboardInterrupt("no run was finished")
        for line in found.refused.values():
            out.print(line, soft_wrap=True)
        return 1
    found.save(place, figures=arguments.figures)
    _show(found, place, arguments, out)
    if not found.complete:
        raise KeyboardInterrupt(
            f"{count(len(found.cells), 'run')} kept in {place}; the same command goes on"
        )
    return 1 if any(cell.status in ("failed", "died") for cell in found.cells) else 0


def _list() -> int:
    from ...controllers import CONTENDERS, DEFAULTS

    out = console()
    for name, each in CONTENDERS.items():
        mark = "" if name in DEFAULTS else "  (if asked for)"
        out.print(f"{name}{mark}", style="bold")
        pairs([("  is", each.what), ("  knows", each.knows)], out)
    return 0


def _controllers(text: str | None) -> list[object] | None:
    """Return the contenders of a text: names, and files of designs.

    Raises
    ------
    InputError
        If a file is no design; unknown names are told where they are looked up.
    """
    if text is None:
        return None
    found: list[object] = []
    for name in (part.strip() for part in text.split(",")):
        if not name.endswith((".yaml", ".yml")):
            found.append(name)
            continue
        from ...designs import load_design, load_structure

        try:
            found.append((Path(name).stem, load_design(name)))
        except InputError as error:
            try:
                found.append((Path(name).stem, load_structure(name)))
            except InputError:
                raise error from None
    return found


def _heights(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"--hs: must be heights [m] with commas between, as in 1.25,1.9,2.43; got {text!r}"
        ) from None


@contextlib.contextmanager
def _progress(stop: Stop, *, shown: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Show how far the comparison is on standard error, how fast, and how long it will take."""
    out = console(stderr=True)
    if not (shown and out.is_terminal):

        def ask(what: str, done: int, total: int) -> None:
            del what, done, total
            if stop():
                raise KeyboardInterrupt

        yield ask
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(TextColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{number(60.0 * task.speed, 2)}/min" if task.speed else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        Rate(""),
        TimeRemainingColumn(),
    )
    # The rate is that of minutes: designs and predictive controllers come in lumps.
    with Progress(*columns, console=out, transient=True, speed_estimate_period=300.0) as bars:
        task = bars.add_task("starting", total=None)
        seen = -1

        def tell(what: str, done: int, total: int) -> None:
            nonlocal seen
            if stop():
                raise KeyboardInterrupt
            # The rate is of runs that end, not of looks at the clock.
            bars.update(task, description=what or "waiting", total=total)
            if done != seen:
                seen = done
                bars.update(task, completed=done)

        yield tell


def _show(found: Comparison, place: Path, arguments: argparse.Namespace, out: Console) -> None:
    from rich.table import Table

    from ...comparison import HEADINGS, LEGEND, headline_of, left_out, rows_at

    out.print(headline_of(found), style="bold", soft_wrap=True)
    for height in found.heights if not arguments.quiet else ():
        rows = rows_at(found, height)
        if not rows:
            continue
        out.print()
        table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
        used = [i for i in range(len(HEADINGS)) if i == 0 or any(row[i] for row in rows)]
        for i in used:
            heading = f"H_s {height:.4g} m" if i == 0 else HEADINGS[i]
            table.add_column(heading, justify="left" if i == 0 else "right", no_wrap=True)
        for row in rows:
            table.add_row(*(row[i] for i in used))
        out.print(table)
    if not arguments.quiet:
        out.print()
        out.print(LEGEND, style="dim")
    out.print()
    for line in left_out(found):
        out.print(line, style="dim")
    for sentence in found.sentences:
        out.print(sentence)
    if arguments.quiet:
        return
    out.print()
    files = "summary.md, summary.json, table.csv, runs.csv"
    out.print(
        f"Written to {place}: {files}{', figures' if arguments.figures else ''}", soft_wrap=True
    )
    words = case_words(arguments)
    more = [("who took part, and what they know", "stillhook compare --list " + words)]
    if found.question.mismatch.text == "":
        off = (
            f"stillhook compare {words} --mismatch payload=+30% --out {shlex.quote(f'{place}-off')}"
        )
        more.append(("the plant not as the controllers think", off))
    commands(more, out)
