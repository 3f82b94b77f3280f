"""`stillhook sea`: what a file of wave spectra holds, or what the sea of a case is.

Of a file: what was read and what was rejected and why, its statistics, its scatter diagram and one
of its spectra, and how a case takes it.  Of a case: its spectrum.
"""

from __future__ import annotations

import argparse
import math
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from models import bundled_cases, load_case
from models.basics import InputError, check_range
from models.sea import read_seas, write_scatter

from ...text import (
    OutputFolder,
    commands,
    console,
    folder_name,
    pairs,
    percent,
    picture,
    quantity,
    told_once,
)
from ...text.terminal import _put, _table

if TYPE_CHECKING:
    from models.sea import SeaRecords, SeaSpectrum

_CASES = {".yaml", ".yml", ".toml"}


def run(arguments: argparse.Namespace) -> int:
    """Read, show and write; return 0."""
    for name, unit in (("height_step", "m"), ("period_step", "s")):
        option = f"--{name.replace('_', '-')}"
        check_range("sea", option, getattr(arguments, name), low=0.01, high=20.0, unit=unit)
    named = {name for name, _ in bundled_cases()}
    if arguments.file in named or Path(arguments.file).suffix.lower() in _CASES:
        return _of_case(arguments)
    records = read_seas(arguments.file, file_format=arguments.format)
    chosen = arguments.record
    if chosen is None:
        chosen = int(np.argmax(records.significant_height))
    sea = records.sea(chosen, beyond=arguments.beyond)
    folder = OutputFolder.prepare(_folder(arguments))
    written = _write(records, sea, chosen, arguments, folder)
    out = console()
    if arguments.quiet:
        out.print(f"{arguments.file}: {records.quality}", soft_wrap=True)
        return 0
    out.print(f"{arguments.file}: {records.file_format}", style="bold", soft_wrap=True)
    out.print()
    _show_quality(records)
    out.print()
    _show_statistics(records)
    out.print()
    out.print(f"Record {chosen}, {_when(records, chosen)}:", style="bold", soft_wrap=True)
    pairs(_facts(sea), out)
    out.print()
    out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    file = shlex.quote(
        f"sea={{spectrum: measured, file: {_quoted(arguments.file)}, record: {chosen}}}"
    )
    commands(
        [
            ("the hook of a case in this sea", f"stillhook motion subsea-crane --set {file}"),
            ("the gains for it", f"stillhook optimise subsea-crane --set {file}"),
            (
                "another record, or another sea of the scatter diagram",
                f"stillhook sea {shlex.quote(arguments.file)} --record 0",
            ),
        ],
        out,
    )
    return 0


def _of_case(arguments: argparse.Namespace) -> int:
    from ...seas import spectrum_figure

    if arguments.record is not None or arguments.format is not None:
        raise InputError("sea: --record and --format are for a file of spectra, not for a case")
    with told_once():
        case = load_case(arguments.file)
        sea = case.sea.to_spectrum()
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-sea")
    figure = spectrum_figure(sea, name=f"{case.name}: {sea.kind}")
    for kind in ("svg", "png"):
        folder.write(f"spectrum.{kind}", picture(figure, kind))
    out = console()
    if arguments.quiet:
        out.print(f"{case.name}: {sea.kind}, H_s {quantity(sea.significant_height, 'm')}")
        return 0
    out.print(f"{case.name}: {sea.kind}", style="bold", soft_wrap=True)
    out.print()
    pairs([*_facts(sea), ("steepness", f"{case.sea.steepness:.3g}")], out)
    out.print()
    out.print(f"Written to {folder.path}: spectrum.svg, spectrum.png", soft_wrap=True)
    word = shlex.quote(arguments.file)
    commands([("the hook in it", f"stillhook motion {word}")], out)
    return 0


def _folder(arguments: argparse.Namespace) -> Path:
    return Path(arguments.out or Path("out") / f"{folder_name(Path(arguments.file).name)}-sea")


def _quoted(path: str) -> str:
    """Return a path as a YAML text."""
    if re.fullmatch(r"[\w./][\w./-]*", path):
        return path
    return "'" + path.replace("'", "''") + "'"


def _when(records: SeaRecords, index: int) -> str:
    time = records.time[index]
    place = f", {records.place[index]}" if records.place else ""
    text = "no time" if np.isnat(time) else f"{str(time).replace('T', ' ')} UTC"
    return f"{text}{place}"


def _write(
    records: SeaRecords,
    sea: SeaSpectrum,
    chosen: int,
    arguments: argparse.Namespace,
    folder: OutputFolder,
) -> list[str]:
    from ...seas import spectrum_figure
    from ...seas.sea_plot import scatter_figure

    steps = {"height_step": arguments.height_step, "period_step": arguments.period_step}
    scatter = records.scatter(**steps)
    folder.write("records.csv", _records_csv(records))
    write_scatter(folder.path / "scatter.csv", scatter)
    name = Path(arguments.file).name
    count = f"{len(records)} records"
    figures = {
        "scatter": scatter_figure(scatter, name=f"{name}: {count}", **steps),
        "spectrum": spectrum_figure(sea, name=f"{name}, record {chosen}: {_when(records, chosen)}"),
    }
    written = ["records.csv", "scatter.csv"]
    for stem, figure in figures.items():
        for kind in ("svg", "png"):
            folder.write(f"{stem}.{kind}", picture(figure, kind))
            written.append(f"{stem}.{kind}")
    return written


def _records_csv(records: SeaRecords) -> str:
    lines = ["record,time,place,significant_height [m],peak_period [s],zero_crossing_period [s],"
             "from [deg]"]  # fmt: skip
    columns = (records.significant_height, records.peak_period, records.zero_crossing_period)
    for index, figures in enumerate(zip(*columns, strict=True)):
        time = "" if np.isnat(records.time[index]) else str(records.time[index])
        place = records.place[index].replace(",", ";") if records.place else ""
        bearing = ""
        if records.direction is not None and not np.isnan(records.direction[index]):
            bearing = f"{math.degrees(records.direction[index]):.1f}"
        cells = [str(index), time, place, *(f"{value:.4g}" for value in figures), bearing]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def _show_quality(records: SeaRecords) -> None:
    quality, out = records.quality, console()
    table = _table("records", "", "first", left=(0, 2))
    table.add_row("read", str(quality.read), "")
    for one in quality.rejections:
        table.add_row(f"rejected: {one.reason}", str(one.count), one.example)
    table.add_row("kept", str(quality.kept), "")
    _put(table, out)
    for note in quality.notes:
        out.print(f"  {note}", soft_wrap=True)


def _show_statistics(records: SeaRecords) -> None:
    out = console()
    times = records.time[~np.isnat(records.time)]
    if times.size:
        first, last = (str(time).replace("T", " ") for time in (times[0], times[-1]))
        out.print(f"  {first} to {last} UTC, {records.omega.size} frequencies from "
                  f"{records.omega[0] / (2.0 * math.pi):.3g} to "
                  f"{records.omega[-1] / (2.0 * math.pi):.3g} Hz", soft_wrap=True)  # fmt: skip
    table = _table("", "mean", "lowest", "median", "highest")
    rows = (
        ("H_s [m]", records.significant_height),
        ("T_p [s]", records.peak_period),
        ("T_z [s]", records.zero_crossing_period),
    )
    for label, values in rows:
        figures = (np.mean(values), np.min(values), np.median(values), np.max(values))
        table.add_row(label, *(f"{float(value):.3g}" for value in figures))
    _put(table, out)


def _facts(sea: SeaSpectrum) -> list[tuple[str, str]]:
    statistics = sea.statistics
    found = [
        ("H_s", quantity(sea.significant_height, "m")),
        ("T_p", quantity(2.0 * math.pi / sea.peak_frequency, "s")),
        ("T_z, T_1", f"{quantity(statistics.zero_crossing_period, 's')}, "
                     f"{quantity(statistics.mean_period, 's')}"),
        ("highest crest in 3 h", quantity(statistics.most_probable_maximum(), "m")),
        ("band", f"{sea.band[0]:.3g} to {sea.band[1]:.3g} rad/s"),
    ]  # fmt: skip
    if sea.table is not None:
        found.append(
            ("above the last frequency", f"{percent(sea.table.tail_share)} of the variance")
        )
    if sea.spreading is not None:
        law = sea.spreading
        spread = f"{law.kind}, exponent {law.exponent:g}: {math.degrees(law.deviation):.0f} deg"
        found.append(("spreading", spread))
    return found
