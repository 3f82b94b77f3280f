"""The terminal: a summary that fits 80 columns, a progress bar, and where warnings go.

Results go to standard output; progress, warnings and errors to standard error, so that a
result can be piped.  Colour and progress appear only where a person looks at a terminal; rich
takes care of that, and of `NO_COLOR`.  It is imported where it is used, as it starts slowly.
"""

from __future__ import annotations

import contextlib
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from models.basics import PhysicsWarning

from .quantities import duration, percent
from .summary import (
    LimitRow,
    command_text,
    effect,
    facts,
    gain_rows,
    has_gains,
    limit_rows,
    margin_rows,
    motion_rows,
    required_rows,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from synth.design import GainDesign

Progress = Callable[[str, int, int], None]

_STAGES = {
    "starts": "searching",
    "polish": "polishing the best",
    "largest sea": "looking for the largest feasible sea",
    "verify": "checking by other code",
    "figures": "drawing",
    "bound": "comparing with the best possible",
}
_BAR = 10  # cells
_PATH = re.compile(r"^[a-z_]+(\.[\w\[\]]+)+$")


def console(*, stderr: bool = False) -> Console:
    """Return a console; on anything but a terminal it writes 80 columns without colour."""
    from rich.console import Console

    # No markup, no highlighting, no emoji codes: names and paths come from the user.
    return Console(stderr=stderr, markup=False, highlight=False, emoji=False)


def show_design(design: GainDesign, out: Console, *, bound: bool = True) -> None:
    """Write the summary of a design, with the bound beside it if it is wanted."""
    _status(design, out)
    out.print()
    table = _table("motion", "rms", "significant height", _largest(design))
    for row in motion_rows(design):
        table.add_row(row.label, row.rms, row.significant, row.largest)
    _put(table, out)
    out.print(f"  {effect(design)}")
    out.print()
    if has_gains(design):
        out.print(f"  {command_text(design)}")
        table = _table("gain", "on the payload's", "value", "A times it", "", left=(0, 1, 4))
        for gain in gain_rows(design):
            table.add_row(gain.name, gain.acts_on, gain.value, gain.product, gain.unit)
        _put(table, out)
        out.print()
    if design.margins is not None:
        table = _table("margin", "", "", left=(0, 2))
        for cells in margin_rows(design):
            table.add_row(*cells)
        _put(table, out)
        out.print()
    if design.limits:
        _show_limits(design, out)
        out.print()
    pairs(facts(design, bound=bound), out)


def pairs(rows: Sequence[tuple[str, str]], out: Console) -> None:
    """Write labels and texts in two columns."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in rows:
        table.add_row(label, text)
    _put(table, out)


def table_of(title: str, rows: Sequence[tuple[str, str, str]], out: Console) -> None:
    """Write a titled table of label, figure and remark."""
    table = _table(title, "", "", left=(0, 2))
    for cells in rows:
        table.add_row(*cells)
    _put(table, out)


def commands(rows: Sequence[tuple[str, str]], out: Console) -> None:
    """Write commands to go on with, each under its comment, never broken: they are to be copied."""
    out.print("Next:", style="bold")
    for comment, command in rows:
        out.print(f"  # {comment}", style="dim", soft_wrap=True)
        out.print(f"  {command}", soft_wrap=True)


@contextlib.contextmanager
def progress(*, shown: bool) -> Iterator[Progress]:
    """Show a progress bar on standard error while a computation runs.

    Parameters
    ----------
    shown
        Whether to show it at all; on anything but a terminal it is not shown in any case.

    Yields
    ------
    Progress
        To be called as tell(stage, done, total).
    """
    out = console(stderr=True)
    if not (shown and out.is_terminal):
        yield lambda stage, done, total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Bars(*columns, console=out, transient=True) as bars:
        task = bars.add_task("building the plant", total=None)

        def tell(stage: str, done: int, total: int) -> None:
            # One bar for all stages, so that its clock shows the whole time.
            name = _STAGES.get(stage, stage)
            bars.update(task, description=name, completed=done, total=total)

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


def _status(design: GainDesign, out: Console) -> None:
    """Write the case and the verdict, the bad news first."""
    from rich.text import Text

    about = " ".join(design.case.description.split())
    out.print(Text.assemble((design.case.name, "bold"), f": {about}" if about else ""))
    mark, style = ("ok", "bold green") if design.ok else ("NOT OK", "bold red")
    out.print(Text.assemble((mark, style), f": {design.status}"))
    rows = required_rows(design)
    if rows:
        out.print()
        wanted = f"needed in H_s {design.case.sea.significant_height:.3g} m"
        table = _table("limits that break", "is", wanted)
        for cells in rows:
            table.add_row(*cells)
        _put(table, out)
        out.print(f"  All figures below are those in H_s {design.significant_height:.3g} m.")


def _largest(design: GainDesign) -> str:
    return f"largest in {duration(design.case.limits.exposure_time)}"


def _show_limits(design: GainDesign, out: Console) -> None:
    rows = limit_rows(design)
    heading = "price" if any(row.price for row in rows) else ""
    table = _table("limit", "value", "bound", "use", "", heading, left=(0, 3))
    for row in rows:
        cells = row.label, row.value, row.bound, _bar(row), percent(row.use), row.remark
        table.add_row(*cells)
    _put(table, out)
    if heading:
        out.print("  price: what the payload's rms would lose if the bound were 1 % looser")
    if not all(row.enforced for row in rows):
        out.print("  reported: the case asks for the figure only (limits.drive: report)")


def _bar(row: LimitRow) -> Text:
    """Return a bar of the use; one that runs over has an arrow at its end."""
    from rich.text import Text

    filled = min(_BAR, max(0, round(_BAR * min(row.use, 1.0))))
    style = "red" if not row.kept else "yellow" if row.use > 0.95 else "green"
    bar = "█" * (_BAR - 1) + "▶" if not row.kept else "█" * filled
    return Text.assemble(
        (bar, style if row.enforced else f"dim {style}"), ("░" * (_BAR - len(bar)), "dim")
    )


def _table(*headings: str, left: Sequence[int] = (0,)) -> Table:
    """Return a table without lines; figures to the right, the columns `left` to the left."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for index, heading in enumerate(headings):
        last = index == len(headings) - 1
        table.add_column(
            heading,
            justify="left" if index in left else "right",
            no_wrap=not (last and index in left),
        )
    return table


def _put(table: Table, out: Console) -> None:
    from rich.padding import Padding

    out.print(Padding(table, (0, 0, 0, 2), expand=False))
