"""Files of seas as time series: NDBC's standard meteorology, hindcasts as CSV and NetCDF.

    file -> columns: time, H_s, T_p, direction that waves come from -> `SeaSeries`

A file of spectra is read too (`models.sea.records`): each gives one record.
"""

from __future__ import annotations

import csv
import io
import math
import re
import warnings
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basics import (
    KINDS,
    FloatArray,
    InputError,
    check_hdf5,
    check_range,
    file_stamp,
    read_bytes,
    read_text,
)
from .ndbc import is_ndbc
from .quality import Rejection
from .records import read_seas
from .scatter_files import zero_crossing_ratio
from .series import SeaSeries

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]
    import xarray as xr

_TIME, _HEIGHT, _PERIOD, _CROSSING, _FROM = "time", "H_s", "T_p", "T_z", "direction"
_NAMES = {
    _TIME: ("time", "timeindex", "validtime", "timeutc", "date", "datetime", "timestamp", "utc"),
    _HEIGHT: (
        "significantwaveheight", "significantheight", "hs", "hm0", "swh", "vhm0", "wvht",
        "seasurfacewavesignificantheight",
    ),
    _PERIOD: (
        "peakperiod", "peakwaveperiod", "tp", "pp1d", "vtpk", "dpd", "dominantperiod",
        "dominantwaveperiod",
    ),
    _CROSSING: ("zerocrossingperiod", "tz", "tm02"),
    _FROM: (
        "meanwavedirection", "wavedirection", "mwd", "vmdr", "from", "direction", "fromdirection",
        "meandirection",
    ),
}  # fmt: skip
_KINDS = {_HEIGHT: "length", _PERIOD: "time", _CROSSING: "time", _FROM: "angle"}
_CODES = (99.0, 999.0, 9999.0)  # of NDBC, for what is missing
_GRID = {"latitude": ("latitude", "lat"), "longitude": ("longitude", "lon")}
_GAMMA = 3.3  # of the JONSWAP spectrum by which a T_z becomes a T_p [-]
_FORMS = "NDBC standard meteorology, CSV or NetCDF with time, H_s and T_p, or spectra"
_UNITS = {"second": "s", "seconds": "s", "degree": "deg", "degrees": "deg", "metre": "m",
          "meter": "m", "metres": "m", "meters": "m", "degreetrue": "deg", "degreestrue": "deg",
          "degreestruenorth": "deg"}  # fmt: skip


def read_series(path: str | Path, *, place: str | None = None) -> SeaSeries:
    """Read H_s, T_p and where the waves come from, record by record, plain or packed with gzip.

    NDBC's standard meteorology (WVHT, DPD, MWD); CSV with columns of time, H_s, T_p and, where
    there is one, direction, as hindcasts and the ``records.csv`` of `stillhook sea` have them;
    NetCDF of ERA5 (swh, pp1d, mwd) and Copernicus (VHM0, VTPK, VMDR); and every file of spectra
    that `read_seas` reads.  Times are UTC, directions are where waves come *from*, in degrees
    clockwise from north unless a unit in brackets says otherwise.  Of several places one is named:
    ``LAT,LON`` of a grid, whose nearest point is taken, or the ending of a column's name, or what
    its column ``place`` holds.

    Raises InputError if the file cannot be read, a column is missing, it holds several places and
    none is named, or no record is left.
    """
    return _read(str(path), place, file_stamp(path))


def holds_series(path: str | Path) -> bool:
    """Return whether a file holds sea states, and not spectra.

    Raises InputError if it cannot be read.
    """
    raw = read_bytes(path)
    if _is_netcdf(raw):
        check_hdf5(str(path))
        with _opened(str(path)) as data:
            return _HEIGHT in _found([str(name) for name in data.variables])
    first = _first_line(raw)
    if is_ndbc(first):
        return "WVHT" in first.split()
    return {_TIME, _HEIGHT} <= set(_found(_cells(first)))


@lru_cache(maxsize=4)
def _read(path: str, place: str | None, stamp: tuple[int, int]) -> SeaSeries:
    del stamp  # a part of the cache's key
    if not holds_series(path):
        try:
            return read_seas(path).series(place)
        except InputError as error:
            if _is_netcdf(read_bytes(path)) or is_ndbc(_first_line(read_bytes(path))):
                raise
            words = str(error).removeprefix(f"{path}: ")
            raise InputError(f"{path}: must be {_FORMS}; {words}") from None
    raw = read_bytes(path)
    if _is_netcdf(raw):
        return _netcdf(path, place)
    if is_ndbc(_first_line(raw)):
        if place is not None:
            raise InputError(f"{path}: is of one buoy, so that no place can be chosen")
        return _stdmet(path)
    return _table(path, place)


def _is_netcdf(raw: bytes) -> bool:
    return raw.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF"))


def _first_line(raw: bytes) -> str:
    for line in raw[:20_000].decode("utf-8-sig", errors="replace").splitlines():
        # NDBC's header begins with the mark of a comment.
        if line.strip() and (is_ndbc(line) or not line.lstrip().startswith("#")):
            return line
    return ""


def _cells(line: str) -> list[str]:
    separator = max(",;\t", key=line.count)
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _found(names: Sequence[str]) -> dict[str, dict[str, tuple[int, str]]]:
    """Return by what it is, and by place, the column and the unit of each name that is known."""
    found: dict[str, dict[str, tuple[int, str]]] = {}
    for index, name in enumerate(names):
        match = re.match(r"^\s*([^\[(]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*$", name)
        words, unit = (match.group(1), match.group(2) or "") if match else (name, "")
        for text, place in ((words, ""), re.match(r"^(.*?)(?:_(\d+))?$", words).groups("")):  # type: ignore[union-attr]
            plain = re.sub(r"[^a-z0-9]", "", text.lower())
            kind = next((ours for ours, theirs in _NAMES.items() if plain in theirs), None)
            if kind is not None:
                found.setdefault(kind, {}).setdefault(place, (index, unit))
                break
    return found


def _stdmet(path: str) -> SeaSeries:
    """Read NDBC's standard meteorology, of a year or of the last 45 days."""
    import pandas as pd

    lines = [
        (number, line.split())
        for number, line in enumerate(read_text(path).splitlines(), start=1)
        if line.strip()
    ]
    header = [word.lstrip("#") for word in lines[0][1] if word != "#"]
    body = [item for item in lines[1:] if not item[1][0].startswith("#")]
    for name in ("WVHT", "DPD"):
        if name not in header:
            raise InputError(f"{path}: must have the column {name}, got {' '.join(header):.80}")
    whole = [words for _, words in body if len(words) == len(header)]
    cut = [number for number, words in body if len(words) != len(header)]
    rejections = (
        [Rejection(reason="another number of values than of columns", count=len(cut),
                   example=f"line {cut[0]}")]
        if cut
        else []
    )  # fmt: skip
    table = pd.DataFrame(whole, columns=header).apply(pd.to_numeric, errors="coerce")
    minutes = len(header) > 4 and header[4].lower() in ("mm", "mn")
    dates = table.iloc[:, : 5 if minutes else 4]
    dates.columns = ["year", "month", "day", "hour", "minute"][: dates.shape[1]]
    year = dates["year"]
    short = year < 100
    dates = dates.assign(year=year + np.where(short, np.where(year >= 70, 1900, 2000), 0))
    notes = ("two-digit years, taken as 1970 to 2069",) if bool(short.any()) else ()

    def column(name: str) -> FloatArray:
        values = table[name].to_numpy(dtype=np.float64)
        return np.where(np.isin(values, _CODES), np.nan, values)

    return SeaSeries.from_arrays(
        pd.to_datetime(dates, errors="coerce").to_numpy(),
        column("WVHT"),
        column("DPD"),
        np.radians(column("MWD")) if "MWD" in header else None,
        rejections=tuple(rejections),
        notes=notes,
        source=path,
        file_format="NDBC standard meteorology",
    )


def _table(path: str, place: str | None) -> SeaSeries:
    """Read a CSV file with a header."""
    import pandas as pd

    text = read_text(path)
    separator = max(",;\t", key=_first_line(text.encode()).count)
    try:
        table = pd.read_csv(
            io.StringIO(text), sep=separator, comment="#", skipinitialspace=True, dtype=str
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        words = str(error).strip().removeprefix("Error tokenizing data. C error: ")
        raise InputError(f"{path}: is not a table with a header: {words}") from None
    names = [str(name) for name in table.columns]
    columns = _found(names)
    if "place" in names and table["place"].notna().any():
        held = sorted(set(table["place"].dropna()))
        table = table[table["place"] == _chosen(path, place, held)]
        place = None
    places = sorted(columns[_HEIGHT])
    at = _chosen(path, place, places) if len(places) > 1 or place is not None else places[0]
    period, ratio = _period(path, columns, at, names)
    decimal = separator == ";" and "." not in "".join(table.iloc[:5].fillna("").to_numpy().ravel())

    def column(kind: str) -> FloatArray:
        index, unit = columns[kind].get(at) or columns[kind][""]
        cells = table.iloc[:, index]
        cells = cells.str.replace(",", ".") if decimal else cells
        values = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=np.float64)
        return np.asarray(values * _factor(path, names[index], kind, unit))

    return SeaSeries.from_arrays(
        _times(path, table.iloc[:, columns[_TIME][""][0]]),
        column(_HEIGHT),
        column(period) / ratio,
        column(_FROM) if {at, ""} & set(columns.get(_FROM, {})) else None,
        notes=_period_note(ratio),
        source=path,
        file_format="CSV",
    )


def _period(
    path: str, columns: dict[str, dict[str, tuple[int, str]]], at: str, names: Sequence[str]
) -> tuple[str, float]:
    """Return the kind of period that a file has, and what makes a T_p of it."""
    for kind, ratio in ((_PERIOD, 1.0), (_CROSSING, zero_crossing_ratio(_GAMMA))):
        if {at, ""} & set(columns.get(kind, {})):
            return kind, ratio
    raise InputError(
        f"{path}: must have a peak period (or a zero-crossing period) beside the significant "
        f"height, got {', '.join(names)!r:.120}"
    )


def _period_note(ratio: float) -> tuple[str, ...]:
    return () if ratio == 1.0 else (f"T_z made T_p by a JONSWAP spectrum of gamma {_GAMMA:g}",)


def _factor(path: str, name: str, kind: str, unit: str) -> float:
    """Return the factor to SI of a column; directions are in degrees unless they say otherwise."""
    if kind not in _KINDS or not unit:
        return math.radians(1.0) if kind == _FROM else 1.0
    known = KINDS[_KINDS[kind]].units
    unit = _UNITS.get(re.sub(r"[^a-z]", "", unit.lower()), unit)
    if unit not in known:
        raise InputError(
            f"{path}: the unit of {name} must be one of {', '.join(known)}; got {unit!r}"
        )
    return known[unit]


def _times(path: str, cells: pd.Series[Any]) -> Any:
    """Return times, UTC; NaT for those that cannot be read."""
    import pandas as pd

    found = pd.to_datetime(cells, utc=True, format="ISO8601", errors="coerce")
    if len(found) and not found.notna().any():
        raise InputError(
            f"{path}: times must be written as 2019-04-02 13:50, in UTC unless they say "
            f"otherwise; got {str(cells.iloc[0])!r:.40}"
        )
    return found.dt.tz_localize(None).to_numpy()


def _chosen(path: str, place: str | None, held: Sequence[str]) -> str:
    if place in held:
        return str(place)
    if place is None and len(held) == 1:
        return held[0]
    if list(held) == [""]:
        raise InputError(f"{path}: is of one place, so that none can be chosen; got {place!r}")
    shown = ", ".join(held[:6]) + (", .." if len(held) > 6 else "")
    came = "none was named" if place is None else f"got {place!r}"
    raise InputError(f"{path}: place must be one of {shown}; {came}")


def _opened(path: str) -> xr.Dataset:
    import xarray as xr

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that nobody asks for
            return xr.open_dataset(path)
    except (OSError, ValueError, TypeError, KeyError) as error:
        words = " ".join(str(error).split())
        raise InputError(f"{path}: cannot be read as NetCDF: {words:.120}") from None


def _netcdf(path: str, place: str | None) -> SeaSeries:
    """Read ERA5, Copernicus and their like."""
    with _opened(path) as data:
        names = [str(name) for name in data.variables]
        columns = _found(names)
        if _TIME not in columns:
            raise InputError(f"{path}: has no time, only {', '.join(names)!r:.120}")
        period, ratio = _period(path, columns, "", names)
        time = names[columns[_TIME][""][0]]
        notes = _period_note(ratio)
        data, where = _at_place(path, data, time, place)
        found = {}
        for kind in (_HEIGHT, period, _FROM):
            if kind not in columns:
                continue
            name = names[columns[kind][""][0]]
            values = data[name].squeeze(drop=True)
            if values.dims != data[time].dims:
                left = ", ".join(str(dim) for dim in values.dims if dim not in data[time].dims)
                raise InputError(
                    f"{path}: {name} must be over time at one place, it is over {left} too"
                )
            unit = str(values.attrs.get("units", ""))
            if kind == _FROM and unit not in ("rad", "radian", "radians"):
                unit = "deg"
            array = np.asarray(values.values, dtype=np.float64).reshape(-1)
            found[kind] = array * _factor(path, name, kind, unit)
        return SeaSeries.from_arrays(
            np.asarray(data[time].values).reshape(-1),
            found[_HEIGHT],
            found[period] / ratio,
            found.get(_FROM),
            notes=(*notes, *where),
            source=path,
            file_format="NetCDF",
        )


def _at_place(
    path: str, data: xr.Dataset, time: str, place: str | None
) -> tuple[xr.Dataset, tuple[str, ...]]:
    """Return the data of one grid point, and a note on which."""
    axes = {}
    for what, names in _GRID.items():
        name = next((n for n in names if n in data.dims), None)
        if name is not None:
            axes[what] = name
    several = any(data.sizes[name] > 1 for name in axes.values())
    if place is None:
        if several:
            ends = "; ".join(
                f"{what} {float(data[name].min()):g} to {float(data[name].max()):g}"
                for what, name in axes.items()
            )
            raise InputError(f"{path}: place must be LAT,LON of one grid point ({ends}), got none")
        return data, ()
    if len(axes) < 2:
        raise InputError(f"{path}: has no grid of which a place could be chosen, got {place!r}")
    wanted = place.split(",")
    if len(wanted) != 2:
        raise InputError(f"{path}: place must be LAT,LON in degrees, got {place!r}")
    latitude = check_range(path, "latitude", wanted[0], low=-90.0, high=90.0, unit="deg")
    longitude = check_range(path, "longitude", wanted[1], low=-180.0, high=360.0, unit="deg")
    rows, cols = (np.asarray(data[axes[what]].values, dtype=np.float64) for what in _GRID)
    # Longitudes run from -180 or from 0.
    away = np.abs(np.mod(cols - longitude + 180.0, 360.0) - 180.0)
    row, col = int(np.abs(rows - latitude).argmin()), int(away.argmin())
    coarse = 1.5 * max(
        float(np.abs(np.diff(axis)).max()) if axis.size > 1 else 1.0 for axis in (rows, cols)
    )
    if abs(rows[row] - latitude) > coarse or away[col] > coarse:
        raise InputError(
            f"{path}: place {place} is not on the grid, latitude {rows.min():g} to {rows.max():g}, "
            f"longitude {cols.min():g} to {cols.max():g}"
        )
    point = data.isel({axes["latitude"]: row, axes["longitude"]: col})
    return point, (f"the grid point {rows[row]:g}, {cols[col]:g}",)
