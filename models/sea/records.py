"""Measured and hindcast seas: the records of a buoy or a wave model.

    file -> reader of its format -> quality control -> `SeaRecords` -> seas, scatter diagram

Text files of NDBC buoys have a reader of our own (`models.sea.ndbc`), because the library's takes
missing codes for waves and the years of the 1990s for those of Augustus; all other formats are read
by `wavespectra` (`models.sea.library_files`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import (
    FloatArray,
    InputError,
    binary_name,
    check_ascending,
    check_choice,
    check_range,
    file_stamp,
    read_bytes,
)
from .library_files import FORMATS, read_with_library
from .ndbc import is_ndbc, read_ndbc
from .quality import QualityControl, RawRecords, TimeArray, sift
from .scatter import Scatter
from .sea import SeaSpectrum
from .series import SeaSeries, relative_heading
from .table import MOST_ROWS

_EXTENSIONS = {".spt": "datawell", ".oct": "octopus", ".mat": "xwaves"}


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaRecords:
    """The sea states of a file, in the order of time.

    Examples
    --------
    >>> records = SeaRecords.from_arrays([0.05, 0.1, 0.2, 0.3], [[0.0, 5.0, 1.0, 0.2]])
    >>> round(float(records.significant_height[0]), 2), round(float(records.peak_period[0]), 1)
    (2.79, 7.8)
    >>> round(records.sea(0, beyond="zero").statistics.significant_height, 2)
    2.79
    """

    time: TimeArray  #: Times, UTC (n,); NaT where the file has none.
    omega: FloatArray  #: Frequencies, strictly ascending (k,) [rad/s].
    density: FloatArray  #: Variance densities (n, k) [m^2 s/rad].
    #: Mean direction that the waves come from, clockwise from north (n,) [rad], NaN where it is
    #: unknown; None where the file has no directions.
    direction: FloatArray | None
    #: Where each record is from (n,), or empty where there is one place only.
    place: tuple[str, ...]
    quality: QualityControl  #: The account of what was read and rejected.
    source: str  #: The file.
    file_format: str  #: Its format, for people.

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ("time", "omega", "density", "direction"):
            array = getattr(self, name)
            if array is not None:
                array.setflags(write=False)

    def __len__(self) -> int:
        """Return the number of records."""
        return int(self.time.size)

    @classmethod
    def from_arrays(
        cls,
        frequency: npt.ArrayLike,
        density: npt.ArrayLike,
        *,
        time: npt.ArrayLike | None = None,
        source: str = "records",
    ) -> SeaRecords:
        """Return records from arrays, through the same quality control as a file's.

        Frequencies ascend strictly (k,) [Hz]; densities are (n, k) [m^2/Hz], times UTC (n,).
        """
        table = np.atleast_2d(np.asarray(density, dtype=np.float64))
        when = np.full(len(table), "NaT") if time is None else np.asarray(time)
        raw = RawRecords(
            file_format="arrays",
            time=when.astype("datetime64[s]"),
            frequency=np.asarray(frequency, dtype=np.float64),
            density=table,
        )
        return cls.from_raw(raw, source)

    @classmethod
    def from_raw(cls, raw: RawRecords, source: str) -> SeaRecords:
        """Return what is left of a reader's records after quality control.

        Raises InputError if the frequencies are no table, or no record is left.
        """
        frequency, density, notes = _without_empty_columns(raw)
        _check_frequencies(frequency, density, source)
        omega = 2.0 * math.pi * frequency
        per_radian = density / (2.0 * math.pi)
        count = len(density)
        times = [str(one).replace("T", " ") for one in raw.time]
        names = raw.names or tuple(
            f"record {index}" if name == "NaT" else name for index, name in enumerate(times)
        )
        places = raw.place or ("",) * count
        same = [
            None if when == "NaT" else (when, place)
            for when, place in zip(times, places, strict=True)
        ]
        keep, rejections = sift(omega, per_radian, names, same)
        quality = QualityControl(
            read=count + sum(one.count for one in raw.rejections),
            rejections=(*raw.rejections, *rejections),
            notes=(*raw.notes, *notes),
        )
        if not np.any(keep):
            raise InputError(f"{source}: no record is left after quality control: {quality}")
        order = np.flatnonzero(keep)
        order = order[np.argsort(raw.time[order], kind="stable")]
        return cls(
            time=raw.time[order],
            omega=omega,
            density=per_radian[order],
            direction=None if raw.direction is None else np.radians(raw.direction[order]),
            place=tuple(raw.place[i] for i in order) if raw.place else (),
            quality=quality,
            source=source,
            file_format=raw.file_format,
        )

    @cached_property
    def significant_height(self) -> FloatArray:
        """H_s = 4 sqrt(m0) over the measured band (n,) [m]."""
        return np.asarray(4.0 * np.sqrt(np.trapezoid(self.density, self.omega, axis=1)))

    @property
    def peak_period(self) -> FloatArray:
        """T_p (n,) [s], between the frequencies of the file.

        Of the parabola through each record's highest density and its neighbours, which stays within
        half a bin of it.  The bins alone would leave whole classes of T_p without a sea.
        """
        return np.asarray(2.0 * math.pi / _peaks(self.omega, self.density))

    @property
    def zero_crossing_period(self) -> FloatArray:
        """T_z = 2 pi sqrt(m0 / m2) over the measured band (n,) [s]: no tail is added to m2."""
        m0 = np.trapezoid(self.density, self.omega, axis=1)
        m2 = np.trapezoid(self.density * self.omega**2, self.omega, axis=1)
        return np.asarray(2.0 * math.pi * np.sqrt(m0 / m2))

    def sea(self, record: int, *, beyond: str = "decay") -> SeaSpectrum:
        """Return one record as a sea, counted from 0 in the order of time.

        Above the last frequency it may `decay`, falling as omega^-5, or be `zero`.

        Raises InputError if there is no such record.
        """
        last = len(self) - 1
        if not 0 <= record <= last:
            raise InputError(f"record must be in [0, {last}] in {self.source}, got {record}")
        return SeaSpectrum.from_table(self.omega, self.density[record], beyond=beyond)

    def series(self, place: str | None = None) -> SeaSeries:
        """Return H_s, T_p and direction in time, of one place where the file has several.

        Raises InputError if there are several places and none of them is named, or no times.
        """
        keep = np.ones(len(self), dtype=np.bool_)
        if self.place or place is not None:
            names = list(dict.fromkeys(self.place))
            if place is not None or len(names) > 1:
                check_choice(self.source, "place", place, names)
                keep = np.array([name == place for name in self.place])
        if np.all(np.isnat(self.time)):
            raise InputError(f"{self.source}: has no times for a series of seas")
        found = SeaSeries.from_arrays(
            self.time[keep],
            self.significant_height[keep],
            self.peak_period[keep],
            None if self.direction is None else self.direction[keep],
            rejections=self.quality.rejections,
            notes=self.quality.notes,
            source=self.source,
            file_format=self.file_format,
        )
        return found

    def scatter(
        self,
        *,
        height_step: float | None = 0.5,
        period_step: float | None = 1.0,
        vessel_heading: float | None = None,
    ) -> Scatter:
        """Return the scatter diagram of the records on classes of such widths [m], [s].

        Where a width is None every record is a state of its own.  Where the compass heading of a
        vessel's bow is given, clockwise from north [rad], each state has the direction that its
        waves travel towards, counter-clockwise from the bow.

        Raises InputError if a vessel's heading is given and the file has no directions.
        """
        heading = None
        if vessel_heading is not None:
            bow = check_range("scatter diagram", "vessel_heading", vessel_heading, unit="rad")
            if self.direction is None or np.any(np.isnan(self.direction)):
                raise InputError(f"{self.source}: has no directions for a vessel_heading")
            heading = relative_heading(bow, self.direction)
        month: npt.NDArray[Any] | None = None
        if not np.any(np.isnat(self.time)):
            month = self.time.astype("datetime64[M]").astype(np.int64) % 12 + 1
        return Scatter.from_records(
            self.significant_height,
            self.peak_period,
            month=month,
            heading=heading,
            height_step=height_step,
            period_step=period_step,
            source=self.source,
        )


def _peaks(omega: FloatArray, density: FloatArray) -> FloatArray:
    """Return the frequency of each record's peak (n,) [rad/s]: the vertex of a parabola."""
    top = np.argmax(density, axis=1)
    rows, inner = np.arange(len(density)), np.clip(top, 1, omega.size - 2)
    left, at, right = omega[inner - 1], omega[inner], omega[inner + 1]
    low, high, next_ = (density[rows, inner + k] for k in (-1, 0, 1))
    rising, falling = (high - low) / (at - left), (next_ - high) / (right - at)
    bend = falling - rising  # at most zero at a peak
    turned = np.where(bend < 0.0, bend, -1.0)
    vertex = 0.5 * (left + at) - 0.5 * rising * (right - left) / turned
    # At an end of the table, and where three densities are one, there is nothing to fit.
    peak = np.where((top == inner) & (bend < 0.0), vertex, omega[top])
    return np.asarray(np.where(peak > 0.0, peak, 0.5 * omega[1]))


def read_seas(path: str | Path, *, file_format: str | None = None) -> SeaRecords:
    """Read the spectra of a file, plain or packed with gzip, behind quality control.

    They come in the order of time, with the account of the rest.  The format is one of
    `models.sea.library_files.FORMATS`; it is found out if left out.

    Raises InputError if the file cannot be read, its format is unknown or needs the extra `waves`,
    or no record is left after quality control.
    """
    return _read(str(path), file_format, file_stamp(path))


@lru_cache(maxsize=4)
def _read(path: str, file_format: str | None, stamp: tuple[int, int]) -> SeaRecords:
    del stamp  # a part of the cache's key: a file may change under its name
    if file_format is not None:
        check_choice(path, "the format", file_format, FORMATS)
    name = file_format or _guess_format(path)
    raw = read_ndbc(path) if name == "ndbc" else read_with_library(path, name)
    return SeaRecords.from_raw(raw, path)


def _guess_format(path: str) -> str:
    """Return the format of a file, one of :data:`FORMATS`.

    It is told by what is in the file; its name and extension only count for the few formats without
    a mark of their own.  NetCDF files are all `netcdf`: what they are shows when they are opened.

    Raises InputError if it is none that is known.
    """
    raw = read_bytes(path)
    if not raw.strip():
        raise InputError(f"{path}: is empty; a file of wave spectra is wanted")
    if raw.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF")):
        return "netcdf"
    name = binary_name(raw)
    if name and not raw.startswith(b"MATLAB"):
        raise InputError(f"{path}: is no file of wave spectra, but {name}")
    head = raw[:4000].decode("utf-8-sig", errors="replace")
    first = head.lstrip().splitlines()[0] if head.strip() else ""
    if is_ndbc(head):
        return "ndbc"
    if first.startswith("SWAN"):
        return "swan"
    if first.startswith(("{", "[")):
        spotter = any(mark in raw[:200_000] for mark in (b'"waves"', b'"spotterId"'))
        return "spotter" if spotter else "wavespectra-json"
    if "WAVEWATCH III" in first:
        return "ww3-station"
    if first.startswith("TRIAXYS"):
        return "triaxys"
    if first.startswith("Battery Voltage") or "Significant Wave Height" in first:
        return "spotter"
    if first.startswith("$PNOR"):
        return "awac"
    if "Obscape" in head or first.startswith("# Timestamp"):
        return "obscape"
    by_name = _EXTENSIONS.get(Path(path).suffix.lower())
    if by_name is not None:
        return by_name
    raise InputError(
        f"{path}: is of no format that is known here; its first line is {first!r:.60}.  If it "
        f"holds spectra all the same, name the format: {', '.join(FORMATS)}"
    )


def _without_empty_columns(raw: RawRecords) -> tuple[FloatArray, FloatArray, list[str]]:
    """Drop frequencies at which no record has a value: another hull did not measure them."""
    empty = ~np.isfinite(raw.density).any(axis=0)
    # Where no record has any value, there is no column to tell from the others.
    if not np.any(empty) or np.all(empty):
        return raw.frequency, raw.density, []
    gone = ", ".join(f"{f:.4g}" for f in raw.frequency[empty][:5])
    note = f"{int(empty.sum())} frequencies without any value left out ({gone} Hz)"
    return raw.frequency[~empty], raw.density[:, ~empty], [note]


def _check_frequencies(frequency: FloatArray, density: FloatArray, source: str) -> None:
    if density.ndim != 2 or density.shape[1] != frequency.size:
        raise InputError(
            f"{source}: must have one density per frequency ({frequency.size}), "
            f"got shape {density.shape}"
        )
    if not 3 <= frequency.size <= MOST_ROWS:
        raise InputError(f"{source}: must have 3 to {MOST_ROWS} frequencies, got {frequency.size}")
    check_ascending(source, "frequency", frequency)
    for end in (float(frequency[0]), float(frequency[-1])):
        check_range(source, "frequency", end, low=0.0, high=9.5, unit="Hz")
