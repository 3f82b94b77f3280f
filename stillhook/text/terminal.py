"""The terminal: reports that fit 80 columns, a progress bar, and where warnings go.

Results go to standard output; progress, warnings and errors to standard error, so that a
result can be piped.  Colour and progress appear only where a person looks at a terminal; rich
takes care of that, and of `NO_COLOR`.  It is imported where it is used, as it starts slowly.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from models.basics import PhysicsWarning

from .encoding import as_written
from .table import Bar, Drawing, Listing, Report, ReportSection, Table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

Progress = Callable[[str, int, int], None]

SWITCH = "STILLHOOK_PROGRESS"  #: The variable that lets no bar be shown (0), or one anywhere (1).
_STAGES = {
    "starts": "searching",
    "polish": "polishing the best",
    "largest sea": "looking for the largest feasible sea",
    "verify": "checking by other code",
    "figures": "drawing",
    "bound": "comparing with the best possible",
}
_BAR = 10  # cells
_WIDE = 9  # columns that leave no room for an indent
_PATH = re.compile(r"^[a-z_]+(\.[\w\[\]]+)+$")


def console(*, stderr: bool = False) -> Console:
    """Return a console; on anything but a terminal it writes 80 columns without colour."""
    from rich.console import Console

    class Piped(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # not SystemExit: that the reader has gone is no failure

    # No markup, no highlighting, no emoji codes: names and paths come from the user.
    return Piped(stderr=stderr, markup=False, highlight=False, emoji=False)


def show(item: Report | Table, out: Console) -> None:
    """Write a report or a table."""
    if isinstance(item, Report):
        _show_report(item, out)
        return
    from rich.padding import Padding
    from rich.table import Table as Grid
    from rich.text import Text

    bare = not any(item.headings)
    wide = len(item.columns) >= _WIDE
    grid = Grid(box=None, pad_edge=False, padding=(0, 1 if wide else 2, 0, 0), header_style="bold")
    grid.show_header = not bare
    if str(item.title) not in ("", item.headings[0]):
        out.print(str(item.title), style="bold", soft_wrap=True)
    headings, *rows = (
        [as_written(text, out.encoding) for text in line]
        for line in (item.headings, *map(item.cells, item.shown))
    )
    texts = dict(zip(item.shown, rows, strict=True))
    # A column in which nothing stands would take room for nothing.
    used = [k for k in range(len(item.columns)) if not k or any(t[k] for t in texts.values())]
    for k in used:
        column, heading = item.columns[k], headings[k]
        # Labels and the last words give way where the line is full, and never a figure.
        words = k == 0 or (column.left and k == used[-1])
        grid.add_column(
            heading,
            justify="left" if column.left or k == 0 else "right",
            no_wrap=not words,
            overflow="fold" if words else "ellipsis",
            style="dim" if bare and k == 0 else None,
        )
    for row, cells in texts.items():
        raw = item.rows[row]
        shown = [_bar(cell) if isinstance(cell := raw[k], Bar) else cells[k] for k in used]
        grid.add_row(*shown, style="red" if row in item.broken else None)
    indent = (0, 0, 0, 0 if wide else 2)
    out.print(Padding(grid, indent, expand=False))
    for note in item.notes:
        out.print(Padding(Text(as_written(str(note), out.encoding)), indent, expand=False))


def _show_report(report: Report, out: Console) -> None:
    """Write title, verdict and sections, a line between them; drawings have files of their own."""
    from rich.text import Text

    about = f": {report.about}" if report.about else ""
    name, about = (as_written(text, out.encoding) for text in (report.name, about))
    out.print(Text.assemble((name, "bold"), about))
    if report.status:
        mark = report.verdict_mark
        style = "bold green" if mark == "ok" else "bold red"
        verdict = Text.assemble((mark, style), f": {report.status}") if mark else report.status
        out.print(verdict, soft_wrap=True)
    for section in report.sections:
        _show_section(section, out)


def _show_section(section: ReportSection, out: Console) -> None:
    from rich.padding import Padding
    from rich.text import Text

    items = [item for item in section.items if not isinstance(item, Drawing)]
    if items:
        out.print()
    if items and section.title:
        out.print(str(section.title), style="bold", soft_wrap=True)
    for k, item in enumerate(items):
        if isinstance(item, ReportSection):
            _show_section(item, out)
        elif isinstance(item, Table):
            if k and isinstance(items[k - 1], Table):
                out.print()
            show(item, out)
        else:
            words = item.text if isinstance(item, Listing) else str(item).strip("`")
            out.print(Padding(Text(as_written(words, out.encoding)), (0, 0, 0, 2), expand=False))


def commands(rows: Sequence[tuple[str, str]], out: Console) -> None:
    """Write commands to go on with, each under its comment, never broken: they are to be copied."""
    out.print("Next:", style="bold")
    for comment, command in rows:
        out.print(f"  # {comment}", style="dim", soft_wrap=True)
        out.print(f"  {command}", soft_wrap=True)


@contextlib.contextmanager
def progress(
    *,
    shown: bool,
    pace: Callable[[float], str] | None = None,
    out: Console | None = None,
    first: str = "building the plant",
) -> Iterator[Callable[[str, float, float], None]]:
    """Show a progress bar on a terminal's standard error; yield what is told (stage, done, total).

    `pace` has words for what is done in a second, beside the time that is left; without it the time
    since the beginning is shown.  `out` is another place, `first` what is being done until a stage
    is told.
    """
    if out is None:
        out, shown = console(stderr=True), shown and os.environ.get(SWITCH) != "0"
    if not (shown and out.is_terminal):
        yield lambda stage, done, total: None
        return
    from rich import progress as bars
    from rich.text import Text

    class Pace(bars.TextColumn):
        def render(self, task: bars.Task) -> Text:
            return Text(pace(task.speed) if pace is not None and task.speed else "")

    clock = [bars.TimeElapsedColumn()] if pace is None else [Pace(""), bars.TimeRemainingColumn()]
    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(bar_width=30 if pace is None else 20),
        bars.MofNCompleteColumn() if pace is None else bars.TaskProgressColumn(),
        *clock,
    )
    # The pace is that of minutes: designs and predictive controllers come in lumps.
    shows = bars.Progress(
        *columns,
        console=out,
        transient=True,
        speed_estimate_period=300.0,
        # What is printed meanwhile goes above the bar, and into a pipe where it is piped.
        redirect_stdout=sys.stdout is not None and sys.stdout.isatty(),
    )
    with shows:
        task = shows.add_task(first, total=None)
        seen = -1.0

        def tell(stage: str, done: float, total: float) -> None:
            nonlocal seen
            # One bar for all stages, so that its clock shows the whole time.
            shows.update(task, description=_STAGES.get(stage, stage or "waiting"), total=total)
            if done != seen or pace is None:  # the pace is of what is done, not of looks
                seen = done
                shows.update(task, completed=done)

        yield tell


@contextlib.contextmanager
def told_once() -> Iterator[None]:
    """Write each warning about the physics as one line on standard error, once.

    A case is checked again whenever a field is replaced, so the same remark comes again and
    again; remarks on the same field of a case are the same remark.
    """
    seen: set[str] = set()
    usual = warnings.showwarning

    def show(message, category, filename, lineno, file=None, line=None):  # type: ignore[no-untyped-def]
        if not issubclass(category, PhysicsWarning):
            usual(message, category, filename, lineno, file, line)
            return
        text = str(message)
        field = next((part for part in text.split(": ") if _PATH.match(part)), text)
        if field not in seen:
            seen.add(field)
            print(f"warning: {text}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", PhysicsWarning)
        warnings.showwarning = show
        yield


def _bar(use: Bar) -> Text:
    """Return a bar of the use and its figure; one that runs over has an arrow at its end."""
    from rich.text import Text

    filled = min(_BAR, max(0, round(_BAR * min(use.value, 1.0))))
    style = "red" if not use.kept else "yellow" if use.value > 0.95 else "green"
    bar = "█" * (_BAR - 1) + "▶" if not use.kept else "█" * filled
    rest = "░" * (_BAR - len(bar))
    shade = style if use.enforced else f"dim {style}"
    return Text.assemble((bar, shade), (rest, "dim"), f" {use.text:>6}")
