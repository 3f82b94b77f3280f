"""Weather windows as a report, tables and files, written and loaded again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from models.basics import InputError, check_hdf5, read_bytes, replace_atomically
from synth.operability import HOUR, LEAST_WINDOWS, RecordCheck, Spell, WeatherWindows

from ..text import (
    Column,
    Drawing,
    ReportSection,
    Table,
    columns,
    data_table,
    duration,
    pairs,
    percent,
)
from .operability import MONTHS, WHO, netcdf
from .window_figures import calendar_figure, months_figure

WINDOW_FIGURES = ("windows-months", "windows-calendar")
"""Names of the figures of weather windows."""


def windows_section(windows: WeatherWindows, checks: Sequence[RecordCheck] = ()) -> ReportSection:
    """Return weather windows as a part of a report: the question, a table for each system, figures.

    `checks` are of `recheck_records`.
    """
    seas = windows.seas
    first, last = (str(time).partition("T")[0] for time in seas.time[[0, -1]])
    times = f"T_POP {duration(windows.planned)} + T_C {duration(windows.contingency)}"
    rows = [
        ("window", f"T_R {duration(windows.needed)} = {times}"),
        ("seas", f"{seas.source}, {len(seas)} records of {first} to {last}"),
        ("heading", windows.heading),
        ("alpha on H_s", windows.alpha),
    ]
    left = ", ".join(f"{one.count} x {one.reason}" for one in seas.quality.rejections)
    if left:
        rows.insert(2, ("left out", left))
    if windows.alpha_beyond > 0.0:
        text = f"{percent(windows.alpha_beyond)} of the limits lie beyond the heights of its table"
        rows.append(("", f"{text}: its end rows hold there"))
    for text in windows.criteria:
        rows.append(("wanted", text))
    if checks:
        worst = max(check.difference for check in checks)
        text = f"{len(checks)} records by single evaluations: at the limit what binds uses"
        rows.append(("checked", f"{text} its bound to {percent(worst)}"))
    tables = [_table(windows, name) for name in _shown(windows)]
    drawings = [
        Drawing("windows-months", "Weather windows by month", lambda: months_figure(windows)),
        Drawing("windows-calendar", "Weather windows in time", lambda: calendar_figure(windows)),
    ]
    return ReportSection("weather windows", [pairs(rows), *tables, *drawings])


def windows_table(windows: WeatherWindows) -> Table:
    """Return the figures by month as data: a row for each system and month, and one for all."""
    names = (
        "system", "month", "hours", "workable", "inside_windows", "windows", "mean_length_h",
        "longest_h", "mean_wait_h", "wait_10_h", "wait_50_h", "wait_90_h", "cut_off",
    )  # fmt: skip
    rows = []
    for name in windows.systems:
        for one in (*windows.months(name), windows.whole(name)):
            lengths = (one.mean_length, one.longest, one.mean_wait, *one.waits)
            rows.append(
                (
                    name,
                    one.month,
                    one.hours / HOUR,
                    one.workable,
                    one.inside,
                    one.count,
                    *(None if math.isnan(value) else value / HOUR for value in lengths),
                    one.cut_off,
                )
            )
    return data_table(names, rows)


def window_list(windows: WeatherWindows) -> Table:
    """Return every window as data: system, beginning and end (UTC), length [h]."""
    rows = []
    for name in windows.systems:
        for begin, end in windows.windows(name):
            both = windows.seas.time[0] + np.round([begin, end]).astype("timedelta64[s]")
            rows.append((name, str(both[0]), str(both[1]), (end - begin) / HOUR))
    return data_table(("system", "begin", "end", "length_h"), rows)


def save_windows(path: str | Path, windows: WeatherWindows) -> Path:
    """Write weather windows as NetCDF, for `load_windows`; return the path.

    Raises InputError if the file cannot be written.
    """
    data = netcdf(windows.dataset)
    return replace_atomically(path, lambda temporary: temporary.write_bytes(data))


def load_windows(path: str | Path) -> WeatherWindows:
    """Read weather windows that `save_windows` or `stillhook operability` wrote.

    Raises InputError if there is no such file, or it is none of weather windows.
    """
    import xarray as xr

    if not read_bytes(path).startswith(b"\x89HDF"):
        raise InputError(f"{path}: is no NetCDF 4 file of weather windows")
    check_hdf5(str(path))
    try:
        with xr.open_dataset(path, engine="h5netcdf") as data:
            return WeatherWindows.from_dataset(data.load())
    except (OSError, ValueError, KeyError, TypeError) as error:
        words = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: holds no weather windows: {words:.160}") from None


def _shown(windows: WeatherWindows) -> list[str]:
    """Return the systems that the report shows: before and after compensation."""
    return [name for name in ("held", "loop") if name in windows.systems]


def _table(windows: WeatherWindows, name: str) -> Table:
    rows = [_row(MONTHS[(one.month or 1) - 1], one) for one in windows.months(name)]
    whole = windows.whole(name)
    cut = [one for one in windows.months(name) if one.cut_off > 0.0]
    notes = [
        f"lengths and waits in hours; 90 % only of months with {LEAST_WINDOWS} windows or more"
    ]
    if cut:
        names = ", ".join(MONTHS[(one.month or 1) - 1] for one in cut)
        notes.append(
            f"waits of {percent(whole.cut_off)} of the time run past the end of the series "
            f"({names}), and count as far as it goes"
        )
    heads = (
        Column("month", WHO[name], left=True),
        *columns(
            "workable [%]; inside=in windows [%]; count=windows; mean_length=mean; "
            "longest; mean_wait=mean wait; wait_10=10 %; wait_50=50 %; wait_90=90 %"
        ),
    )
    return Table(columns=heads, rows=[*rows, _row("all", whole)], notes=tuple(notes))


def _row(name: str, one: Spell) -> tuple[object, ...]:
    hours = [
        "" if math.isnan(value) else f"{value / HOUR:.0f}"
        for value in (one.mean_length, one.longest, one.mean_wait, *one.waits)
    ]
    return (name, one.workable, one.inside, str(one.count), *hours)
