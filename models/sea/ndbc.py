r"""Spectra of NDBC buoys as text, as published from the 1970s to now.

Two forms.  A historical file has the frequencies in its header and a row of densities for each
hour; the header begins with `#` or not, has minutes or not, and its years have two digits or four::

    YY MM DD hh  .030  .040  .050 ...
    96 01 01 00  0.00  0.12  3.41 ...

A real-time file (`.data_spec`) gives each density with its frequency::

    #YY  MM DD hh mm Sep_Freq  < spec_1 (freq_1) spec_2 (freq_2) ... >
    2020 06 08 03 50 0.225 0.000 (0.033) 0.060 (0.063) ...

Missing values are exactly 999.00 or 9999, and 99.00 where the whole row has nothing else; a
threshold would delete storms (`models.sea.quality`).  Both files may be packed with gzip, and
their columns separated by blanks or commas.
"""

import datetime
import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..basics import InputError, read_text
from .quality import RawRecords, Rejection

_CODES = (999.0, 9999.0)
_WHOLE_ROW = 99.0
_PAIR = re.compile(r"([^\s()]+)\s*\(\s*([^\s()]+)\s*\)")
_HEADER = re.compile(r"\s*#?\s*(?:yyyy|yy|yr)\b", re.IGNORECASE)


def is_ndbc(head: str) -> bool:
    """Tell whether a text begins as a file of NDBC does."""
    return _HEADER.match(head) is not None


def read_ndbc(path: str | Path) -> RawRecords:
    """Read a file of spectral densities.

    Raises InputError if it cannot be read, has no such header, or holds something else than
    densities.
    """
    lines = [
        (number, line.replace(",", " "))
        for number, line in enumerate(read_text(path).splitlines(), start=1)
        if line.strip(" ,\t")
    ]
    if not lines or not is_ndbc(lines[0][1]):
        raise InputError(f"{path}: must begin with a header of NDBC, '#YY MM DD hh ...'")
    header = lines[0][1].replace("#", " ").split()
    # A second header line, with units, has no number in it.
    body = [item for item in lines[1:] if not item[1].lstrip().startswith("#")]
    minutes = len(header) > 4 and header[4].lower() in ("mm", "mn")
    dates = 5 if minutes else 4
    if "(freq_1)" in header or "<" in header:
        kinds = [word for word in header if re.fullmatch(r"[A-Za-z]\w*_1", word)]
        if "spec_1" not in kinds:
            held = kinds[0].removesuffix("_1") if kinds else "no spec_1"
            raise InputError(f"{path}: must hold spectral densities (spec_1), got {held}")
        rows = [(number, *_paired(line, dates)) for number, line in body]
    else:
        frequencies = _frequencies(header[dates:], path)
        rows = [
            (number, words[:dates], frequencies, words[dates:])
            for number, words in ((number, line.split()) for number, line in body)
        ]
    if not rows:
        raise InputError(f"{path}: has a header but no records")
    return _assembled(rows, path)


def _frequencies(words: Sequence[str], path: str | Path) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in words)
    except ValueError:
        found = ()
    if len(found) < 3 or not all(math.isfinite(f) for f in found):
        shown = " ".join(words[:6])
        raise InputError(
            f"{path}: the header must give frequencies in Hz, got {shown!r:.60}: this is no file "
            "of spectra (NDBC's have the extension .data_spec, or 'swden' in their names)"
        )
    return found


def _paired(line: str, dates: int) -> tuple[list[str], tuple[float, ...], list[str]]:
    """Split a real-time row into its date, its frequencies and its densities."""
    words, pairs = line.split(None, dates)[:dates], _PAIR.findall(line)
    try:
        return words, tuple(float(f) for _, f in pairs), [s for s, _ in pairs]
    except ValueError:
        return words, (), []


def _assembled(
    rows: list[tuple[int, list[str], tuple[float, ...], list[str]]], path: str | Path
) -> RawRecords:
    """Turn rows into arrays; those that are no records are rejected with a reason."""
    (grid, _), *_ = Counter(row[2] for row in rows).most_common(1)
    wrong: dict[str, list[int]] = {}
    times, values, numbers, notes = [], [], [], []
    two_digits = False
    for number, date, frequencies, words in rows:
        when = _time(date)
        row = _densities(words)
        if frequencies != grid:
            why = "other frequencies than the rest of the file"
        elif when is None:
            why = "no date"
        elif row is None:
            why = "a value that is no number"
        elif len(row) != len(grid):
            why = "another number of values than of frequencies"
        else:
            two_digits = two_digits or len(date[0]) == 2
            times.append(when)
            values.append(row)
            numbers.append(number)
            continue
        wrong.setdefault(why, []).append(number)
    rejections = tuple(
        Rejection(reason=why, count=len(at), example=f"line {at[0]}") for why, at in wrong.items()
    )
    if not values:
        told = "; ".join(f"{one.count} x {one.reason} ({one.example})" for one in rejections)
        raise InputError(f"{path}: holds no record: {told}")
    if two_digits:
        notes.append("two-digit years, taken as 1970 to 2069")
    order = np.argsort(grid, kind="stable")
    return RawRecords(
        file_format="NDBC text",
        time=np.array(times, dtype="datetime64[s]"),
        frequency=np.array(grid)[order],
        density=np.array(values)[:, order],
        names=tuple(f"line {number}" for number in numbers),
        rejections=rejections,
        notes=tuple(notes),
    )


def _time(words: Sequence[str]) -> datetime.datetime | None:
    try:
        year, *rest = (int(word) for word in words)
        if len(words[0]) <= 2:
            year += 1900 if year >= 70 else 2000
        return datetime.datetime(year, *rest)  # type: ignore[arg-type]
    except (ValueError, TypeError, OverflowError):
        return None


def _densities(words: Sequence[str]) -> list[float] | None:
    """Return the densities with NaN for missing ones [m^2/Hz]; None where one is no number."""
    try:
        row = [float(word) for word in words]
    except ValueError:
        return None
    if row and all(value == _WHOLE_ROW for value in row):
        return [math.nan] * len(row)
    return [math.nan if value in _CODES else value for value in row]
