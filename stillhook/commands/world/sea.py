"""`stillhook sea`: what a file of wave spectra holds, or what the sea of a case is.

Of a file: what was read and what was rejected and why, its statistics, its scatter diagram and one
of its spectra, and how a case takes it.  Of a case: its spectrum.
"""

import argparse
import re
import shlex
from pathlib import Path

import numpy as np

from models import bundled_cases, load_case
from models.basics import InputError
from models.sea import holds_series, read_seas, read_series, write_scatter

from ...seas import records_report, records_table, sea_report, series_report
from ...text import csv_text, told_once
from ..declare import options, within
from ..working import conclude, prepared

_CASES = {".yaml", ".yml", ".toml"}
_STEP = {"low": 0.01, "high": 20.0}  # width of a class [m], [s]

ARGUMENTS = (
    options(
        """
        file  a file of wave spectra (NDBC, Spotter, SWAN, WAVEWATCH III, ERA5 and more) or of H_s,
            T_p and direction in time (NDBC standard meteorology, CSV, ERA5, Copernicus), or a case
            (bundled, .yaml or .toml) to see its sea
        --read-as NAME  format of the file (default: found out)
        --place PLACE  one place of a file of sea states that has several: LAT,LON of a grid
        --record N  record to show, counted from 0 in the order of time (default: the highest)
        --beyond {decay,zero} [decay]  what a spectrum is above its last frequency (default: decay,
            as 1/omega^5)
        --height-step M [0.5]  width of the scatter diagram's classes of H_s [m]
        --period-step S [1.0]  width of its classes of T_p [s]
        --out DIR  folder for the results (default: out/<file>-sea)
        """,
        height_step=within(**_STEP),
        period_step=within(**_STEP),
    ),
)
EXAMPLES = (("stillhook sea subsea-crane", "the sea of a case"),)


def run(arguments: argparse.Namespace) -> int:
    """Read, show and write; return 0."""
    named = {name for name, _ in bundled_cases()}
    if arguments.file in named or Path(arguments.file).suffix.lower() in _CASES:
        return _of_case(arguments)
    if arguments.read_as is None and holds_series(arguments.file):
        return _of_series(arguments)
    if arguments.place is not None:
        raise InputError("sea: --place is for a file of sea states in time, not of spectra")
    records = read_seas(arguments.file, file_format=arguments.read_as)
    chosen = arguments.record
    if chosen is None:
        chosen = int(np.argmax(records.significant_height))
    sea = records.sea(chosen, beyond=arguments.beyond)
    steps = {"height_step": arguments.height_step, "period_step": arguments.period_step}
    report = records_report(records, chosen, sea, name=arguments.file, steps=steps)
    folder = prepared(arguments, Path(arguments.file).name, "-sea")
    folder.write("records.csv", csv_text(records_table(records)))
    folder.keep(write_scatter(folder.at("scatter.csv"), records.scatter(**steps)))
    folder.draw(report.drawings)
    quoted = _quoted(arguments.file)
    file = shlex.quote(f"sea={{spectrum: measured, file: {quoted}, record: {chosen}}}")
    again = f"stillhook sea {shlex.quote(arguments.file)} --record 0"
    following = [
        ("the hook of a case in this sea", f"stillhook motion subsea-crane --set {file}"),
        ("the gains for it", f"stillhook optimise subsea-crane --set {file}"),
        ("another record, or another sea of the scatter diagram", again),
    ]
    return conclude(report, arguments, folder, following)


def _of_series(arguments: argparse.Namespace) -> int:
    if arguments.record is not None:
        raise InputError(
            f"{arguments.file}: holds H_s and T_p, not spectra, so no --record of them"
        )
    series = read_series(arguments.file, place=arguments.place)
    steps = {"height_step": arguments.height_step, "period_step": arguments.period_step}
    report = series_report(series, name=arguments.file, steps=steps)
    folder = prepared(arguments, Path(arguments.file).name, "-sea")
    folder.write("records.csv", csv_text(records_table(series)))
    folder.keep(write_scatter(folder.path / "scatter.csv", series.scatter(**steps)))
    folder.draw(report.drawings)
    seas = f"--seas {shlex.quote(arguments.file)}"
    if arguments.place is not None:
        seas += f" --place {shlex.quote(arguments.place)}"
    again = f"stillhook operability subsea-crane --held {seas} --duration 12h"
    return conclude(report, arguments, folder, [("how often one can work for 12 h", again)])


def _of_case(arguments: argparse.Namespace) -> int:
    if (arguments.record, arguments.read_as, arguments.place) != (None, None, None):
        raise InputError(
            "sea: --record and --read-as are for a file of spectra, --place for one of sea states, "
            "none for a case"
        )
    with told_once():
        case = load_case(arguments.file)
        sea = case.sea.to_spectrum()
    folder = prepared(arguments, case.name, "-sea")
    steepness = ("steepness", f"{case.sea.steepness:.3g}")
    report = sea_report(sea, name=case.name, extra=[steepness])
    folder.draw(report.drawings)
    again = ("the hook in it", f"stillhook motion {shlex.quote(arguments.file)}")
    return conclude(report, arguments, folder, [again])


def _quoted(path: str) -> str:
    """Return a path as a YAML text."""
    if re.fullmatch(r"[\w./][\w./-]*", path):
        return path
    return "'" + path.replace("'", "''") + "'"
