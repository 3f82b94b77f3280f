"""The door of all RAO files: `read_raos`, `write_raos`, and the table of formats.

    path -> what is in it -> reader -> VesselRaos in the project's convention -> long-wave check

A file is known by its contents; its name only breaks ties, so that a WAMIT file that was renamed
is still one.  Whatever a reader trips over comes out as an
:class:`models.basics.checks.InputError`: what a library makes of a damaged file is anybody's guess,
and is caught here, once for all of them.
"""

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.resources import files as resources
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from ...basics import (
    InputError,
    PhysicsWarning,
    StillhookError,
    binary_name,
    check_finite,
    check_hdf5,
    read_bytes,
    write_text_atomically,
)
from ..assemble import finished, text_of
from ..convention import one_of
from ..raos import VesselRaos
from ..symmetry import SYMMETRIES
from .aqwa import looks_like_aqwa, parse_aqwa
from .capytaine_file import parse_capytaine
from .csv_file import WOULD_DO, csv_text, looks_like_csv, parse_csv
from .long_waves import check_long_waves
from .mss import parse_mss
from .netcdf_file import is_ours, parse_netcdf, write_netcdf
from .orcaflex import looks_like_orcaflex, orcaflex_text, parse_orcaflex
from .shipx import looks_like_shipx, parse_shipx
from .wamit import looks_like_wamit, parse_wamit, wamit_text
from .wamit_listing import looks_like_wamit_listing, parse_wamit_listing


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A format of RAO files, and the function that reads it."""

    about: str  #: What such a file is.
    #: From the file's path, for messages, and its contents to the table.  Its keyword-only
    #: arguments are what a user may say about such a file.
    parse: Callable[..., VesselRaos]
    text: bool = True  #: Whether the contents are text.

    @property
    def options(self) -> list[str]:
        """What a user may say about such a file, in alphabetic order."""
        every = signature(self.parse).parameters.values()
        return sorted(p.name for p in every if p.kind is p.KEYWORD_ONLY)


FORMATS: Mapping[str, Reader] = {
    "csv": Reader(
        about="the project's CSV, or one of your own with the same columns", parse=parse_csv
    ),
    "netcdf": Reader(about="the project's NetCDF", parse=parse_netcdf, text=False),
    "wamit": Reader(
        about="WAMIT .4, also written by HAMS, NEMOH converters and others", parse=parse_wamit
    ),
    "orcaflex": Reader(about="OrcaFlex text file (.yml) with a vessel type", parse=parse_orcaflex),
    "capytaine": Reader(about="Capytaine NetCDF", parse=parse_capytaine, text=False),
    "mss": Reader(
        about="MATLAB .mat with a vessel of the Marine Systems Simulator",
        parse=parse_mss,
        text=False,
    ),
    "shipx": Reader(about="ShipX/Veres .re1", parse=parse_shipx),
    "aqwa": Reader(about="listing of AQWA (.LIS)", parse=parse_aqwa),
    "wamit-listing": Reader(about="listing of WAMIT (.out)", parse=parse_wamit_listing),
}
"""The formats that are read."""

_TEXTS: Mapping[str, Callable[[VesselRaos], str]] = {
    ".csv": csv_text,
    ".4": wamit_text,
    ".yml": orcaflex_text,
}
ENDINGS = (*_TEXTS, ".nc")
"""Endings of the files that are written."""

_BUNDLED = {"osv-83m": "offshore support vessel, 83 m, from our own hull lines by Capytaine"}
_HDF5 = b"\x89HDF"
_LARGEST = 1e4  # m/m or rad/m: no vessel moves so
_LARGEST_HEAVE = 50.0  # m/m: what a case may have; forces taken for motions are larger


def read_raos(
    path: str | Path,
    *,
    file_format: str | None = None,
    symmetry: str | None = None,
    check: bool = True,
    **options: Any,
) -> VesselRaos:
    """Read the RAOs of a vessel.

    Parameters
    ----------
    path
        A file, or the name of a bundled vessel such as `osv-83m`.
    file_format
        One of :data:`FORMATS`; if left out, the contents tell.
    symmetry
        One of :data:`models.vessel.symmetry.SYMMETRIES`, to fill in headings where neither the
        file nor the table tells.
    check
        Whether a table that contradicts the limits of long waves is refused.
    options
        What the file leaves open; each format knows some of these:

        - speed: which forward speed of the file [m/s], the lowest if left out (MSS, ShipX,
          Capytaine).
        - body: which body of the file (WAMIT, AQWA: a number from 1; Capytaine: a name).
        - length: WAMIT's ULEN [m], 1 m if left out.
        - depth: water depth [m], where the file does not tell (WAMIT, OrcaFlex) or has several
          (Capytaine).
        - origin: the point whose motions these are (3,) [m], where the file does not tell (WAMIT,
          MSS, Capytaine).
        - vessel_type, draught: their names, where an OrcaFlex file has several.
        - roll_damping: damping of roll to add, over the critical [-] (Capytaine).
        - inertia, stiffness: mass and hydrostatic stiffness (6, 6), where a Capytaine file has
          none.
        - heading: the one heading of the file [deg], in its own convention, where it has no column
          of them (CSV).
        - waves: whether the first column of a WAMIT file is the `period` or the `frequency`; if
          left out, the heave of long waves tells.

    Returns
    -------
    VesselRaos
        The table in the project's convention, with `notes` of what was found and converted.

    Raises
    ------
    InputError
        If the file is not there, something else, cut off, or contradicts the long-wave limits in a
        way that one of the usual mistakes explains; the message names it.

    Warns
    -----
    PhysicsWarning
        If the motions in long waves are not those of a free-floating vessel, unexplained, or the
        table has no waves that are long.
    """
    place = _place(path)
    owner = str(path)
    data = read_bytes(place)
    if not data.strip():
        raise InputError(f"{place}: the file is empty")
    check_hdf5(place)  # a damaged one can hang whoever opens it
    if file_format is not None and file_format not in FORMATS:
        raise InputError(
            f"{owner}: format must be one of {', '.join(FORMATS)}, got {file_format!r}"
        )
    kind = ""
    try:
        kind = file_format_of(owner, data) if file_format is None else file_format
        reader = FORMATS[kind]
        given = _given(owner, kind, options)
        content = text_of(owner, data) if reader.text else data
        # Numbers of a damaged file may overflow; what is not finite is refused with its place.
        with np.errstate(all="ignore"):
            raos = reader.parse(owner, content, **given)
            if symmetry is not None:
                raos = finished(raos, symmetry=one_of(owner, "symmetry", symmetry, SYMMETRIES))
            largest = float(np.abs(raos.values).max())
    except StillhookError:
        raise
    except Exception as error:  # whatever a library makes of a damaged file
        what = f"{type(error).__name__}, {' '.join(str(error).split())[:160]}"
        about = FORMATS[kind].about if kind else "a RAO file"
        raise InputError(f"{owner}: cannot be read as {about}: {what}") from error
    if largest > _LARGEST:
        raise InputError(
            f"{owner}: RAOs must be at most {_LARGEST:g} m/m or rad/m, got {largest:.3g}"
        )
    heave = float(np.abs(raos.mode("heave")).max())
    if check and heave > _LARGEST_HEAVE:
        raise InputError(
            f"{owner}: heave must be at most {_LARGEST_HEAVE:g} m/m, got {heave:.3g} m/m: are "
            "these forces, no motions? If it is right as it is, read it without the check "
            "(check=False, --no-check)"
        )
    return _checked(owner, raos) if check else raos


def write_raos(path: str | Path, raos: VesselRaos) -> Path:
    """Write a table as the project's CSV (.csv) or NetCDF (.nc), for WAMIT (.4) or OrcaFlex (.yml).

    The project's own read back exactly, the others to twelve digits and without notes; a WAMIT file
    has no place for origin and water depth.

    Raises InputError if the name ends otherwise, the file cannot be written, or the vessel moves
    forward and the format has no speed.
    """
    place = Path(path)
    ending = place.suffix.lower()
    if ending == ".nc":
        return write_netcdf(place, raos)
    if ending not in _TEXTS:
        raise InputError(f"{place}: the name of a RAO file must end in {', '.join(ENDINGS)}")
    return write_text_atomically(place, _TEXTS[ending](raos))


def bundled_vessels() -> tuple[tuple[str, str], ...]:
    """Return the vessels that come with the toolkit: name and description."""
    return tuple(_BUNDLED.items())


def file_format_of(owner: str, data: bytes) -> str:
    """Return which of :data:`FORMATS` the contents of a file are.

    Raises InputError if they are none of them.
    """
    head = data[:8]
    if head.startswith(_HDF5):
        return "netcdf" if is_ours(data) else "capytaine"
    if head.startswith(b"CDF"):
        return "capytaine"
    if head.startswith(b"MATLAB"):
        return "mss"
    known = ", ".join(FORMATS)
    name = binary_name(data)
    if name or b"\x00" in data:
        what = name or "a binary file of no kind that is known here"
        raise InputError(f"{owner}: this is no RAO file, but {what} (formats: {known})")
    text = text_of(owner, data)
    # From the most to the least telling: a WAMIT file is bare numbers, as others' tables are.
    looks = {
        "aqwa": looks_like_aqwa,
        "wamit-listing": looks_like_wamit_listing,
        "orcaflex": looks_like_orcaflex,
        "csv": looks_like_csv,
        "shipx": looks_like_shipx,
        "wamit": looks_like_wamit,
    }
    for kind, looks_like in looks.items():
        if looks_like(text):
            return kind
    first = text.strip()[:40]
    raise InputError(
        f"{owner}: this is no RAO file of a kind that is known here (formats: {known}; a table has "
        f"columns such as {WOULD_DO}); it begins with {first!r}"
    )


def _given(owner: str, kind: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given, if the format knows them all.

    Their types are the reader's to refuse, but for a point, which several readers take.
    """
    found = {key: value for key, value in options.items() if value is not None}
    knows = FORMATS[kind].options
    strange = sorted(set(found) - set(knows))
    if strange:
        raise InputError(
            f"{owner}: {strange[0]} says nothing about a {kind} file "
            f"(its options: {', '.join(knows) or 'none'})"
        )
    if "origin" in found:
        point = check_finite(owner, "origin", list(found["origin"]))
        if point.shape != (3,):
            raise InputError(f"{owner}: origin must be 3 numbers [m], got {found['origin']!r}")
        found["origin"] = tuple(point.tolist())
    return found


def _checked(owner: str, raos: VesselRaos) -> VesselRaos:
    """Return the table if it can be true, with what the check has to remark among its notes."""
    found = check_long_waves(raos)
    if found.mistake:
        worst = max(found.rows, key=lambda row: row.error)
        raise InputError(
            f"{owner}: in long waves ({found.omega:.3g} rad/s) the motions look like "
            f"{found.mistake}: {worst.motion}{'' if worst.motion in _PLAIN else ' over the slope'} "
            f"towards {worst.heading_deg:.0f} deg is {_complex(worst.found)}, where "
            f"{_complex(worst.expected)} is expected; if it is right as it is, read it without the "
            "check (check=False, --no-check)"
        )
    if found.remarks and not found.ok:
        warnings.warn(f"{owner}: {found.remarks[0]}", PhysicsWarning, stacklevel=3)
    return replace(raos, notes=(*raos.notes, *(f"check: {text}" for text in found.remarks)))


_PLAIN = ("surge", "sway", "heave")


def _complex(value: complex) -> str:
    return f"{value.real:+.2f}{value.imag:+.2f}i"


def _place(path: str | Path) -> Path:
    """Return the file of a path, or of the name of a bundled vessel."""
    name, place = str(path), Path(path)
    there = "\x00" in name or bool(place.suffix) or os.path.exists(place)
    if name in _BUNDLED and not there:
        return Path(str(resources("models.vessel"))) / "data" / f"{name}.csv"
    if not there:
        raise InputError(
            f"{name}: there is no such file, and no bundled vessel of this name "
            f"(there is: {', '.join(_BUNDLED)})"
        )
    return place
