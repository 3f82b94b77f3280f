"""Runs on the terminal: a table, what happened, and the progress of a long simulation.

The counterpart of `stillhook.text.terminal`, for what `stillhook.runs.table` and
`stillhook.runs.words` say.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Literal

from models.run import ERROR, FEWEST_MAXIMA, Run

from ..text import console, count, duration, number, quantity
from .runs import Runs
from .table import TableRow, rows_of
from .words import headline_of, speed_of

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

Ticker = Callable[[str, float], None]
"""Takes what is being done, and how much of the whole is done [s of simulated time]."""

_EVENTS = 8  # shown of a run
_RUNS = 4  # whose events are shown
_LONG = 11  # characters of a heading that is not broken


def show_runs(runs: Runs, out: Console) -> None:
    """Write the table of one controller's runs."""
    out.print(headline_of(runs), style="bold" if runs.completed else "bold red", soft_wrap=True)
    several = len(runs.judged) > 1
    for group, rows in _groups(rows_of([runs])):
        out.print()
        headings = ("mean", "95 % interval") if several else ("", "")
        table = _table(group, *headings, "", left=(0, 3))
        for row in rows:
            table.add_row(row.label, row.full(0), row.interval(0) if several else "", row.note)
        _put(table, out)
    missing = _missing_extremes(runs)
    if missing:
        out.print(f"  {missing}", style="dim")
    out.print()
    for line in _speed(runs):
        out.print(f"  {line}", style="dim", soft_wrap=True)


def show_comparison(compared: Sequence[Runs], out: Console) -> None:
    """Write one table of several controllers: means, and the interval of the payload's rms."""
    for runs in compared:
        style = "" if runs.completed else "bold red"
        out.print(headline_of(runs), style=style, soft_wrap=True)
    for group, rows in _groups(rows_of(compared)):
        out.print()
        table = _table(group, *(_heading(runs.controller) for runs in compared))
        for place, row in enumerate(rows):
            cells = [row.cell(at) or "-" for at in range(len(compared))]
            unit = f" [{row.shown_unit}]" if row.shown_unit else ""
            table.add_row(f"{row.label}{unit}", *cells)
            intervals = [row.interval(at) for at in range(len(compared))]
            if group == "payload" and place == 0 and any(intervals):
                table.add_row("  95 % interval", *(_stacked(text) for text in intervals))
        _put(table, out)


def show_events(compared: Sequence[Runs], out: Console) -> None:
    """Write what happened: first what all runs have in common, then run by run."""
    told = {(runs.controller, run.seed): _told(run) for runs in compared for run in runs}
    common = [line for line in next(iter(told.values())) if all(line in t for t in told.values())]
    if len(told) == 1:
        common = []
    if common:
        out.print()
        out.print("in every run", style="bold")
        _put_lines(common, out)
    for runs in compared:
        own = [
            (run, [line for line in told[runs.controller, run.seed] if line not in common])
            for run in sorted(runs, key=lambda run: run.completed)
        ]
        own = [(run, lines) for run, lines in own if lines]
        for run, lines in own[:_RUNS]:
            out.print()
            out.print(f"{runs.controller}, seed {run.seed}", style="bold", soft_wrap=True)
            _put_lines(lines, out)
        if len(own) > _RUNS:
            rest = count(len(own) - _RUNS, "more run")
            out.print(f"  and {rest} of {runs.controller} with events, see events.csv", style="dim")


@contextlib.contextmanager
def run_progress(total: float, *, shown: bool) -> Iterator[Ticker]:
    """Show how far a simulation is on standard error, how fast it goes and how long it will take.

    Parameters
    ----------
    total
        Simulated time of all runs together [s].
    shown
        Whether to show it at all; on anything but a terminal it is not shown in any case.
    """
    out = console(stderr=True)
    if not (shown and out.is_terminal):
        yield lambda what, done: None
        return
    from rich.progress import BarColumn, Progress, Task, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Rate(TextColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{number(task.speed, 2)} x real time" if task.speed else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:>3.0f} %"),
        Rate(""),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=out, transient=True) as bars:
        task = bars.add_task("preparing", total=total)

        def tick(what: str, done: float) -> None:
            bars.update(task, description=what, completed=done)

        yield tick


def _groups(rows: Sequence[TableRow]) -> list[tuple[str, list[TableRow]]]:
    found: dict[str, list[TableRow]] = {}
    for row in rows:
        found.setdefault(row.group, []).append(row)
    return list(found.items())


def _put_lines(lines: Sequence[str], out: Console) -> None:
    for line in lines[:_EVENTS]:
        out.print(f"  {line}", soft_wrap=True)
    if len(lines) > _EVENTS:
        out.print(f"  and {count(len(lines) - _EVENTS, 'more event')}, see events.csv", style="dim")


def _told(run: Run) -> list[str]:
    """Return a run's events, its end and its fallbacks as lines."""
    lines = [f"at {event}" for event in run.events]
    for kind, times in run.timings.fallbacks.items():
        lines.append(f"the controller's command was not used {count(times, 'time')}: {kind}")
    if run.status not in ("completed", "diverged") and run.message:
        lines.append(run.message)
    return lines


def _missing_extremes(runs: Runs) -> str:
    """Return why there is no most probable maximum, if there should be one."""
    if not runs.extremes:
        return ""
    estimates = [runs.extremes["payload up"][method] for method in ("gumbel", "pareto")]
    if any(not math.isnan(estimate.value) for estimate in estimates):
        return ""
    blocks = sum(run.statistics.blocks[ERROR].maxima.size for run in runs.judged)
    length = duration(runs[0].statistics.block)
    return (
        f"no extremes of the payload: they take {FEWEST_MAXIMA} blocks of {length}, "
        f"these runs have {blocks}"
    )


def _speed(runs: Runs) -> list[str]:
    """Return how fast the runs were, and how fast a controller in Python."""
    lines = [speed_of(runs)]
    first = runs[0]
    lines[0] += f"; step {quantity(first.step, 's')}, sample {quantity(first.sample_time, 's')}"
    timings = first.timings
    if not math.isnan(timings.controller_median):
        lines.append(
            f"a step of the controller takes {_short(timings.controller_median)}, "
            f"{_short(timings.controller_p99)} in 1 of 100, at most "
            f"{_short(timings.controller_max)}"
        )
    return lines


def _short(seconds: float) -> str:
    return f"{number(1e6 * seconds)} us" if seconds < 1e-3 else quantity(seconds, "s")


def _heading(name: str) -> str:
    """Return a controller's name broken at its hyphens, if it is long."""
    return name if len(name) <= _LONG else name.replace("-", "-\n")


def _stacked(interval: str) -> str:
    return interval.replace(" to ", " to\n")


def _table(*headings: str, left: Sequence[int] = (0,)) -> Table:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for index, heading in enumerate(headings):
        side: Literal["left", "right"] = "left" if index in left else "right"
        table.add_column(heading, justify=side, no_wrap=index < 3)
    return table


def _put(table: Table, out: Console) -> None:
    from rich.padding import Padding

    out.print(Padding(table, (0, 0, 0, 2), expand=False))
