"""One door for all RAO files: what a file is, who reads it, whether it can be true.

    path -> what is in it -> reader -> VesselRaos in the project's convention -> long-wave check

A file is known by its contents; its name only breaks ties, so that a WAMIT file that was renamed
is still one.  Whatever a reader trips over comes out as an
:class:`models.basics.checks.InputError`.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files as resources
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...basics import (
    InputError,
    PhysicsWarning,
    StillhookError,
    check_finite,
    check_hdf5,
    write_text_atomically,
)
from ..assemble import finished, read_bytes, text_of
from ..convention import one_of
from ..raos import VesselRaos
from ..symmetry import SYMMETRIES
from .long_waves import check_long_waves

FORMATS = {
    "csv": "the project's CSV, or one of your own with the same columns",
    "netcdf": "the project's NetCDF",
    "wamit": "WAMIT .4, also written by HAMS, NEMOH converters and others",
    "orcaflex": "OrcaFlex text file (.yml) with a vessel type",
    "capytaine": "Capytaine NetCDF",
    "mss": "MATLAB .mat with a vessel of the Marine Systems Simulator",
    "shipx": "ShipX/Veres .re1",
}
"""The formats that are read, and what they are."""

_OPTIONS = {
    "csv": set(),
    "netcdf": set(),
    "wamit": {"body", "length", "depth", "origin", "waves"},
    "orcaflex": {"vessel_type", "draught", "depth"},
    "capytaine": {"body", "depth", "speed", "origin", "roll_damping", "inertia", "stiffness"},
    "mss": {"speed", "origin"},
    "shipx": {"speed"},
}  # type: dict[str, set[str]]

_BUNDLED = {
    "osv-83m": "offshore support vessel, 83 m, from our own hull lines by Capytaine",
}
_SUFFIXES = (".nc", ".csv")
_HDF5 = b"\x89HDF"
_LARGEST = 1e4  # m/m or rad/m: no vessel moves so


@dataclass(frozen=True, kw_only=True)
class _Options:
    """What a user may say about a file; each format knows some of it."""

    speed: float | None = None
    body: int | str | None = None
    length: float | None = None
    depth: float | None = None
    origin: Sequence[float] | None = None
    vessel_type: str | None = None
    draught: str | None = None
    roll_damping: float | None = None
    inertia: npt.ArrayLike | None = None
    stiffness: npt.ArrayLike | None = None
    waves: str | None = None

    def given(self, owner: str, kind: str) -> dict[str, object]:
        """Return those that were given, checked against the format."""
        found = {key: value for key, value in vars(self).items() if value is not None}
        strange = sorted(set(found) - _OPTIONS[kind])
        if strange:
            knows = ", ".join(sorted(_OPTIONS[kind])) or "none"
            raise InputError(
                f"{owner}: {strange[0]} says nothing about a {kind} file (its options: {knows})"
            )
        if "origin" in found:
            point = check_finite(owner, "origin", list(self.origin or ()))
            if point.shape != (3,):
                raise InputError(f"{owner}: origin must be 3 numbers [m], got {self.origin!r}")
            found["origin"] = tuple(float(x) for x in point)
        return found


def read_raos(
    path: str | Path,
    *,
    file_format: str | None = None,
    speed: float | None = None,
    body: int | str | None = None,
    length: float | None = None,
    depth: float | None = None,
    origin: Sequence[float] | None = None,
    vessel_type: str | None = None,
    draught: str | None = None,
    roll_damping: float | None = None,
    inertia: npt.ArrayLike | None = None,
    stiffness: npt.ArrayLike | None = None,
    waves: str | None = None,
    symmetry: str | None = None,
    check: bool = True,
) -> VesselRaos:
    """Read the RAOs of a vessel.

    Parameters
    ----------
    path
        A file, or the name of a bundled vessel such as `osv-83m`.
    file_format
        One of :data:`FORMATS`; if left out, the contents tell.
    speed
        Which forward speed of the file [m/s] (MSS, ShipX, Capytaine).
    body
        Which body of the file (WAMIT: a number from 1; Capytaine: a name).
    length
        WAMIT's ULEN [m], 1 m if left out.
    depth
        Water depth [m], where the file does not tell (WAMIT, OrcaFlex) or has several (Capytaine).
    origin
        The point whose motions these are [m], where the file does not tell (WAMIT, MSS,
        Capytaine).
    vessel_type, draught
        Their names, where an OrcaFlex file has several.
    roll_damping
        Damping of roll to add, over the critical [-] (Capytaine).
    inertia, stiffness
        Mass and hydrostatic stiffness (6, 6), where a Capytaine file has none.
    waves
        Whether the first column of a WAMIT file is the `period` or the `frequency`; if left out,
        the heave of long waves tells.
    symmetry
        One of :data:`models.vessel.symmetry.SYMMETRIES`, to fill in headings where neither the
        file nor the table tells.
    check
        Whether a table that contradicts the limits of long waves is refused.

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
        If the motions in long waves are not those of a free-floating vessel, unexplained.
    """
    options = _Options(
        speed=speed, body=body, length=length, depth=depth, origin=origin,
        vessel_type=vessel_type, draught=draught, roll_damping=roll_damping, inertia=inertia,
        stiffness=stiffness, waves=waves,
    )  # fmt: skip
    place = _place(path)
    owner = str(path)
    data = read_bytes(place)
    check_hdf5(place)  # a damaged one can hang whoever opens it
    if file_format is not None and file_format not in FORMATS:
        raise InputError(
            f"{owner}: format must be one of {', '.join(FORMATS)}, got {file_format!r}"
        )
    kind = ""
    try:
        kind = file_format_of(owner, data) if file_format is None else file_format
        given = options.given(owner, kind)
        # Numbers of a damaged file may overflow; what is not finite is refused with its place.
        with np.errstate(all="ignore"):
            raos = _read(owner, place, data, kind, given)
            if symmetry is not None:
                raos = finished(raos, symmetry=one_of(owner, "symmetry", symmetry, SYMMETRIES))
            largest = float(np.abs(raos.values).max())
    except StillhookError:
        raise
    except Exception as error:  # whatever a library makes of a damaged file
        what = f"{type(error).__name__}, {' '.join(str(error).split())[:160]}"
        raise InputError(
            f"{owner}: cannot be read as {FORMATS.get(kind, 'a RAO file')}: {what}"
        ) from error
    if largest > _LARGEST:
        raise InputError(
            f"{owner}: RAOs must be at most {_LARGEST:g} m/m or rad/m, got {largest:.3g}"
        )
    return _checked(owner, raos) if check else raos


def write_raos(path: str | Path, raos: VesselRaos) -> Path:
    """Write a table as the project's CSV (.csv) or NetCDF (.nc); both read back exactly.

    Raises
    ------
    InputError
        If the name ends otherwise, or the file cannot be written.
    """
    place = Path(path)
    if place.suffix.lower() == ".csv":
        from .csv_file import csv_text

        return write_text_atomically(place, csv_text(raos))
    if place.suffix.lower() == ".nc":
        from .netcdf_file import write_netcdf

        return write_netcdf(place, raos)
    raise InputError(f"{place}: the name of a RAO file must end in .csv or .nc")


def bundled_vessels() -> tuple[tuple[str, str], ...]:
    """Return the vessels that come with the toolkit: name and description."""
    return tuple((name, about) for name, about in _BUNDLED.items() if _bundled(name) is not None)


def file_format_of(owner: str, data: bytes) -> str:
    """Return which of :data:`FORMATS` the contents of a file are.

    Raises
    ------
    InputError
        If they are none of them.
    """
    from .csv_file import looks_like_csv
    from .netcdf_file import is_ours
    from .orcaflex import looks_like_orcaflex
    from .shipx import looks_like_shipx
    from .wamit import looks_like_wamit

    head = data[:8]
    if head.startswith(_HDF5):
        return "netcdf" if is_ours(owner, data) else "capytaine"
    if head.startswith(b"CDF"):
        return "capytaine"
    if head.startswith(b"MATLAB"):
        return "mss"
    known = ", ".join(FORMATS)
    if b"\x00" in data:
        raise InputError(
            f"{owner}: this is a binary file of no kind that is known here (formats: {known})"
        )
    text = text_of(owner, data)
    looks = {
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
        f"{owner}: this is no RAO file of a kind that is known here (formats: {known}); it begins "
        f"with {first!r}"
    )


def _read(owner: str, place: Path, data: bytes, kind: str, given: dict[str, object]) -> VesselRaos:
    """Let the reader of a format read; what it may raise is anything."""
    # The options were checked against the format; their types are the readers' to refuse.
    options: dict[str, object] = given
    if kind == "netcdf":
        from .netcdf_file import parse_netcdf

        return parse_netcdf(owner, data)
    if kind == "capytaine":
        from .capytaine_file import read_capytaine

        return read_capytaine(place, **options)  # type: ignore[arg-type]
    if kind == "mss":
        from .mss import parse_mss

        return parse_mss(owner, data, **options)  # type: ignore[arg-type]
    text = text_of(owner, data)
    if kind == "csv":
        from .csv_file import parse_csv

        return parse_csv(owner, text)
    if kind == "orcaflex":
        from .orcaflex import parse_orcaflex

        return parse_orcaflex(owner, text, **options)  # type: ignore[arg-type]
    if kind == "shipx":
        from .shipx import parse_shipx

        return parse_shipx(owner, text, **options)  # type: ignore[arg-type]
    from .wamit import parse_wamit

    return parse_wamit(owner, text, name=place.stem, **options)  # type: ignore[arg-type]


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
    if found.remarks and not found.ok and found.long:
        warnings.warn(f"{owner}: {found.remarks[0]}", PhysicsWarning, stacklevel=3)
    return replace(raos, notes=(*raos.notes, *(f"check: {text}" for text in found.remarks)))


_PLAIN = ("surge", "sway", "heave")


def _complex(value: complex) -> str:
    return f"{value.real:+.2f}{value.imag:+.2f}i"


def _place(path: str | Path) -> Path:
    """Return the file of a path, or of the name of a bundled vessel."""
    name = str(path)
    bundled = _bundled(name) if name in _BUNDLED and not Path(path).exists() else None
    if bundled is not None:
        return bundled
    if name in _BUNDLED:
        return Path(path)
    if not Path(name).suffix and "\x00" not in name and not Path(name).exists():
        every = ", ".join(known for known, _ in bundled_vessels())
        raise InputError(
            f"{name}: there is no such file, and no bundled vessel of this name "
            f"(there is: {every or 'none'})"
        )
    return Path(path)


def _bundled(name: str) -> Path | None:
    folder = Path(str(resources("models.vessel"))) / "data"
    return next((f for s in _SUFFIXES if (f := folder / f"{name}{s}").is_file()), None)
