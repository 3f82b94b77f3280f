"""Scatter diagrams as CSV files: a list of states or a matrix, read and written."""

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..basics import KINDS, InputError, check_range, read_text, write_text_atomically
from .scatter import Scatter

_NAMES = {
    "significant_height": ("significantheight", "significantwaveheight", "hs", "hm0", "swh"),
    "peak_period": ("peakperiod", "tp"),
    "zero_crossing_period": ("zerocrossingperiod", "tz", "tm02"),
    "occurrence": (
        "occurrence", "occurrences", "count", "counts", "n", "number", "share", "probability",
        "percent", "p", "frequency", "hours",
    ),
    "month": ("month",),
    "heading": ("heading", "direction"),
}  # fmt: skip
_KINDS = {
    "significant_height": "length",
    "peak_period": "time",
    "zero_crossing_period": "time",
    "heading": "angle",
}
_RANGE = re.compile(r"^\s*([0-9]*\.?[0-9]+)\s*(?:-|\u2013|to|\.\.)\s*([0-9]*\.?[0-9]+)\s*$")
# A class without an end: `<1`, `<= 1`, `below 1`, or `>6`, `>= 6`, `over 6`, `6+`.
_BELOW = re.compile(r"^\s*(?:<=?|\u2264|below|under|up to)\s*([0-9]*\.?[0-9]+)\s*$", re.IGNORECASE)
_ABOVE = re.compile(
    r"^\s*(?:(?:>=?|\u2265|above|over)\s*([0-9]*\.?[0-9]+)|([0-9]*\.?[0-9]+)\s*\+)\s*$",
    re.IGNORECASE,
)
_MOST_ROWS = 200_000


def read_scatter(path: str | Path, *, gamma: float = 1.0) -> Scatter:
    r"""Read a scatter diagram from a CSV file: a list of sea states, or a matrix.

    A list has a header that names its columns and, after it, one row per state.  Names are
    `significant_height` (or H_s, Hs, Hm0), `peak_period` (T_p, Tp) or `zero_crossing_period`
    (T_z, Tz, Tm02), `occurrence` (count, share, probability, percent) and, where there are any,
    `month` and `heading`.  A unit stands in brackets behind the name, or in a row of units under
    the header; without one it is m and s.  Headings need theirs::

        H_s [m], T_p [s], occurrence
        0.5, 5.5, 1210
        1.5, 6.5, 2380

    A matrix has heights down and periods across, or the other way about, and its corner says
    which.  Classes are given by their centres or as ranges, and the outermost may be open, as `<1`
    and `>6`: they are taken to be as wide as their neighbours, and no lower than zero::

        H_s [m] \ T_z [s], 4-5, 5-6, >6
        <1, 120, 310, 85
        1-2, 14, 402, 516

    Separators are commas, semicolons (then with decimal commas, if the file has them) or tabs;
    lines that begin with `#` are passed over.  Zero-crossing periods become peak periods by a
    JONSWAP spectrum of `gamma` [-]; 1 is Pierson-Moskowitz's, which published diagrams of T_z
    assume.

    Raises InputError if the file cannot be read, a column is missing, a figure is no number or out
    of range.
    """
    ratio = zero_crossing_ratio(gamma)
    owner = str(path)
    rows = _rows(read_text(path), owner)
    if not rows:
        raise InputError(f"{owner}: is empty; a scatter diagram is wanted")
    (line, header), body = rows[0], rows[1:]
    corner = re.split(r"\\|/(?![^\[(]*[\])])|\|", header[0])
    kinds = [_name(part)[0] for part in corner]
    periods = {"peak_period", "zero_crossing_period"}
    if len(corner) == 2 and "significant_height" in kinds and periods & set(kinds):
        columns = _matrix(corner, header[1:], body, owner, line)
    else:
        columns = _list(header, body, owner, line)
    if "zero_crossing_period" in columns:
        columns["peak_period"] = columns.pop("zero_crossing_period") / ratio
    return Scatter(**columns, source=owner)


def write_scatter(path: str | Path, scatter: Scatter) -> Path:
    """Write a diagram as a list of states with their shares, for :func:`read_scatter`."""
    names = ["significant_height [m]", "peak_period [s]", "occurrence"]
    columns = [scatter.significant_height, scatter.peak_period, scatter.occurrence]
    if scatter.month is not None:
        names.append("month")
        columns.append(scatter.month.astype(np.float64))
    if scatter.heading is not None:
        names.append("heading [deg]")
        columns.append(np.degrees(scatter.heading))
    lines = [f"# Scatter diagram: {scatter.source}".replace("\n", " "), ",".join(names)]
    lines += [",".join(f"{value:.15g}" for value in row) for row in zip(*columns, strict=True)]
    return write_text_atomically(path, "\n".join(lines) + "\n")


def zero_crossing_ratio(gamma: float) -> float:
    """Return T_z / T_p of a JONSWAP spectrum of gamma 1 to 7 [-] (DNV-RP-C205, 3.5.5.5).

    Examples
    --------
    >>> round(zero_crossing_ratio(1.0), 4), round(zero_crossing_ratio(3.3), 4)
    (0.7118, 0.7777)
    """
    g = check_range("sea", "gamma", gamma, low=1.0, high=7.0)
    return 0.6673 + 0.05037 * g - 0.006230 * g**2 + 0.0003341 * g**3


def _rows(text: str, owner: str) -> list[tuple[int, list[str]]]:
    """Split the text into cells, with the number of each line."""
    kept = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip(" \t,;") and not line.lstrip().startswith("#")
    ]
    if not kept:
        return []
    if len(kept) > _MOST_ROWS:
        raise InputError(f"{owner}: must have at most {_MOST_ROWS} rows, got {len(kept)}")
    first = kept[0][1]
    separator = max(",;\t", key=first.count)
    if separator == ";" and "." not in "".join(line for _, line in kept[1:]):
        kept = kept[:1] + [(number, line.replace(",", ".")) for number, line in kept[1:]]
    found = []
    for number, line in kept:
        try:
            cells = next(csv.reader([line], delimiter=separator, strict=True))
        except (csv.Error, StopIteration) as error:
            raise InputError(f"{owner}:{number}: is not a row of a CSV file: {error}") from None
        found.append((number, [cell.strip() for cell in cells]))
    return found


def _name(header: str) -> tuple[str, str]:
    """Return the column's name, ours if it is known, and its unit."""
    match = re.match(r"^\s*([^\[(]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*$", header)
    name, unit = (match.group(1), match.group(2) or "") if match else (header, "")
    plain = re.sub(r"[^a-z0-9]", "", name.lower())
    if plain.endswith("deg") and plain.removesuffix("deg") in _NAMES["heading"]:
        return "heading", "deg"
    known = next((ours for ours, theirs in _NAMES.items() if plain in theirs), name)
    return known, "%" if plain == "percent" else unit


def _factor(name: str, unit: str, owner: str) -> float:
    """Return the factor to SI of a column."""
    kind = _KINDS.get(name)
    if kind is None:
        return 1.0  # occurrences are made shares whatever they are in
    if not unit:
        if name == "heading":
            raise InputError(f"{owner}: the column of headings must say its unit: heading [deg]")
        return 1.0
    known = KINDS[kind].units
    if unit not in known:
        raise InputError(
            f"{owner}: the unit of {name} must be one of {', '.join(known)}; got {unit!r}"
        )
    return known[unit]


def _list(
    header: Sequence[str], body: list[tuple[int, list[str]]], owner: str, line: int
) -> dict[str, Any]:
    named = [_name(cell) for cell in header]
    if body and _is_units_row(body[0][1]):
        units = [cell.strip("[]() ") for cell in body[0][1]]
        units += [""] * (len(named) - len(units))
        named = [(name, unit or other) for (name, unit), other in zip(named, units, strict=False)]
        body = body[1:]
    at: dict[str, int] = {}
    for index, (name, _) in enumerate(named):
        if name in _NAMES:
            if name in at:
                raise InputError(f"{owner}:{line}: has two columns of {name}")
            at[name] = index
    period = "peak_period" if "peak_period" in at else "zero_crossing_period"
    for name in ("significant_height", period, "occurrence"):
        if name not in at:
            wanted = "peak_period (or zero_crossing_period)" if name == period else name
            raise InputError(
                f"{owner}:{line}: must have the columns significant_height, peak_period (or "
                f"zero_crossing_period) and occurrence; {wanted} is missing among "
                f"{', '.join(header)!r:.80}"
            )
    if period == "peak_period":
        at.pop("zero_crossing_period", None)
    factors = {
        name: _factor(name, named[index][1], f"{owner}:{line}") for name, index in at.items()
    }
    texts: dict[str, list[str]] = {name: [] for name in at}
    for number, cells in body:
        if len(cells) <= max(at.values()):
            raise InputError(f"{owner}:{number}: must have {len(header)} columns, got {len(cells)}")
        for name, index in at.items():
            texts[name].append(cells[index])
    lines = [number for number, _ in body]
    columns: dict[str, list[float]] = {}
    for name, column in texts.items():
        if any(_BELOW.match(cell) or _ABOVE.match(cell) for cell in column):
            values = _centres(column, owner, lines, name)
        else:
            values = [
                check_range(f"{owner}:{n}", name, c) for n, c in zip(lines, column, strict=True)
            ]
        columns[name] = [value * factors[name] for value in values]
    return {name: np.array(values) for name, values in columns.items()}


def _is_units_row(cells: Sequence[str]) -> bool:
    """Whether a row holds no number at all, and something."""

    def number(cell: str) -> bool:
        try:
            float(cell)
        except ValueError:
            return False
        return True

    return any(cells) and not any(number(cell) for cell in cells)


def _matrix(
    corner: Sequence[str],
    across: Sequence[str],
    body: list[tuple[int, list[str]]],
    owner: str,
    line: int,
) -> dict[str, Any]:
    (down_name, down_unit), (across_name, across_unit) = (_name(part) for part in corner)
    across = [cell for cell in across if cell.lower() not in ("", "sum", "total", "all")]
    factor = _factor(across_name, across_unit, f"{owner}:{line}")
    columns = [factor * c for c in _centres(across, owner, [line] * len(across))]
    heads, table = [], []
    for number, cells in body:
        if cells[0].lower() in ("sum", "total", "all"):
            continue
        if len(cells) <= len(columns):
            raise InputError(
                f"{owner}:{number}: must have {len(columns)} occurrences, got {len(cells) - 1}"
            )
        heads.append((number, cells[0]))
        # An empty cell of a diagram is one that never occurs.
        table.append(
            [
                check_range(f"{owner}:{number}", "occurrence", cell or 0.0)
                for cell in cells[1 : len(columns) + 1]
            ]
        )
    if not table or not columns:
        raise InputError(f"{owner}: the matrix must have at least one row and one column")
    factor = _factor(down_name, down_unit, f"{owner}:{heads[0][0]}")
    found = _centres([cell for _, cell in heads], owner, [number for number, _ in heads])
    rows, cols = np.meshgrid([factor * c for c in found], columns, indexing="ij")
    by_name = {down_name: rows, across_name: cols, "occurrence": np.array(table)}
    return {name: values.ravel() for name, values in by_name.items()}


def _centres(
    cells: Sequence[str], owner: str, lines: Sequence[int], what: str = "a class of the matrix"
) -> list[float]:
    """Return the centres of classes, given as themselves, as ranges or open at one end."""
    closed: list[tuple[float, float]] = []  # of each that has two ends, its centre and its width
    centres, open_ = [], []
    for k, (cell, line) in enumerate(zip(cells, lines, strict=True)):
        ranged, below, above = _RANGE.match(cell), _BELOW.match(cell), _ABOVE.match(cell)
        centres.append(math.nan)
        if below or above:
            edge = float(below.group(1)) if below else float(next(filter(None, above.groups())))  # type: ignore[union-attr]
            open_.append((k, edge, below is not None))
            continue
        if ranged:
            low, high = float(ranged.group(1)), float(ranged.group(2))
            closed.append((0.5 * (low + high), high - low))
        else:
            value = check_range(f"{owner}:{line}", what, cell)
            closed.append((value, math.nan))
        centres[-1] = closed[-1][0]
    for k, edge, downward in open_:
        # A class without an end is as wide as the next one; none begins below zero.
        width = min(edge, _width(closed, edge)) if downward else _width(closed, edge)
        if math.isnan(width):
            raise InputError(
                f"{owner}:{lines[k]}: the open class {cells[k]!r} must have a class beside it that "
                "says how wide it is"
            )
        centres[k] = edge + (-0.5 if downward else 0.5) * width
    return centres


def _width(closed: Sequence[tuple[float, float]], edge: float) -> float:
    """Return the width of the class nearest an edge; NaN where nothing tells it."""
    near = sorted(set(closed), key=lambda one: abs(one[0] - edge))
    if not near:
        return math.nan
    centre, width = near[0]
    if math.isnan(width):  # told by the centres
        width = min((abs(c - centre) for c, _ in closed if c != centre), default=math.nan)
    return width
