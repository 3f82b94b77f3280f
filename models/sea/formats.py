"""Formats of files of spectra, told by their contents, and the reader of each.

A format is told by what is in the file; its name and extension only count for the few formats
without a mark of their own.
"""

from __future__ import annotations

from pathlib import Path

from ..basics import InputError, read_bytes
from .library_files import FORMATS, read_with_library
from .ndbc import is_ndbc, read_ndbc
from .quality import RawRecords

_EXTENSIONS = {".spt": "datawell", ".oct": "octopus", ".mat": "xwaves"}


def read_raw(path: str, file_format: str | None) -> RawRecords:
    """Read a file of a given or a guessed format.

    Raises
    ------
    InputError
        If the format is unknown, or its reader refuses the file.
    """
    if file_format is not None and file_format not in FORMATS:
        raise InputError(
            f"{path}: the format must be one of {', '.join(FORMATS)}; got {file_format!r}"
        )
    name = file_format or guess_format(path)
    if name == "ndbc":
        return read_ndbc(path)
    return read_with_library(path, name)


def guess_format(path: str) -> str:
    """Return the format of a file, one of :data:`FORMATS`.

    NetCDF files are all `netcdf` here: what they are shows when they are opened.

    Raises
    ------
    InputError
        If it is none that is known.
    """
    raw = read_bytes(path)
    if not raw.strip():
        raise InputError(f"{path}: is empty; a file of wave spectra is wanted")
    if raw.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF")):
        return "netcdf"
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
