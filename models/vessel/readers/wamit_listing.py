"""RAOs from WAMIT: the listing (`.out`), with the RESPONSE AMPLITUDE OPERATORS of each period.

It has what the `.4` file has not, ULEN, the water depth and the place of each body, but phases to a
whole degree: a `.4` file of the same run has more digits.  Convention as in
:mod:`models.vessel.readers.wamit`.
"""

import math
import re

import numpy as np

from ...basics import FloatArray, InputError
from ..convention import Convention
from ..raos import VesselRaos
from .wamit import of_body, vessel_of

_MARK = re.compile(r"WAMIT\s+Version")
_PERIOD = re.compile(r"^\s*Wave period(?: \(sec\))? =\s*(\S+)")
_HEADING = re.compile(r"^\s*Wave Heading \(deg\) :\s*(\S+)")
_TITLE = re.compile(r"^\s{2,}[A-Z][A-Z,()/-]+(?: [A-Z,()/-]+)+\s*$")
_ROW = re.compile(r"^\s*(\d+)\s+(\d\S*)\s+(-?\d+(?:\.\d*)?)\s*$")
_LENGTH = re.compile(r"Length scale:\s*(\S+)")
_GRAVITY = re.compile(r"Gravity:\s*(\S+)")
_DEPTH = re.compile(r"Water depth:\s*(\S+)")
_BODY = re.compile(r"XBODY =\s*(\S+)\s+YBODY =\s*(\S+)\s+ZBODY =\s*(\S+)\s+PHIBODY =\s*(\S+)")
_RAOS = "RESPONSE AMPLITUDE OPERATORS"
_METRIC = (9.6, 10.0)  # m/s2: a gravity that says that lengths are metres


def looks_like_wamit_listing(text: str) -> bool:
    """Say whether a text begins as WAMIT's listing does."""
    return _MARK.search(text[:4_000]) is not None


def parse_wamit_listing(owner: str, text: str, *, body: int | None = None) -> VesselRaos:
    """Return the motions of one body; arguments are those of `read_raos`.

    The vessel is called after the file; the origin is where the run has the body's own.

    Raises InputError if the listing has no RAOs, is not in metres or cut off, the body is turned
    (PHIBODY), or is not there.
    """
    rows = _rows(owner, text)
    notes = ["WAMIT .out: time factor e^{+i omega t}, phases to a degree; the .4 file has more"]
    rows = of_body(owner, rows, body, notes)
    number = body or 1
    gravity = _told(owner, _GRAVITY, text, "Gravity")
    if not _METRIC[0] < gravity < _METRIC[1]:
        raise InputError(f"{owner}: Gravity must be that of metres, 9.81, got {gravity:g}")
    length = _told(owner, _LENGTH, text, "Length scale")
    depth = _told(owner, _DEPTH, text, "Water depth")
    x, y, z = _place(owner, text, number)
    notes.append(f"angles divided by ULEN = {length:g} m")
    modes = rows[:, 2].astype(int)
    angles = np.where(modes > 3, length, 1.0)
    turned = np.exp(1j * np.radians(rows[:, 4]))
    values = np.asarray(rows[:, 3] / angles * turned, dtype=np.complex128)
    return vessel_of(
        owner, rows, values, Convention(waves="period (s)"),
        origin=(0.0, 0.0, z), phase_origin=(-x, -y), depth=depth, notes=notes,
    )  # fmt: skip


def _rows(owner: str, text: str) -> FloatArray:
    """Return period, heading, mode, modulus and phase of every motion of finite period (n, 5)."""
    found: list[list[float]] = []
    titles: list[str] = []
    period = heading = math.nan
    inside = False
    for number, line in enumerate(text.splitlines(), start=1):
        if (told := _PERIOD.match(line)) is not None:
            period = _float(owner, number, told[1], infinite=True)
            inside = False
        elif _TITLE.match(line):
            title = line.strip()
            inside = title.startswith(_RAOS)
            titles += [title] if title not in titles else []
        elif inside and (told := _HEADING.match(line)) is not None:
            heading = _float(owner, number, told[1])
        elif inside and (told := _ROW.match(line)) is not None and 0.0 < period < math.inf:
            row = [float(told[1]), *(_float(owner, number, word) for word in told.groups()[1:])]
            found.append([period, heading, *row])
    if not found:
        forces = [title for title in titles if "FORCES" in title]
        has = f"; it has {' and '.join(t.lower() for t in forces)}" if forces else ""
        raise InputError(
            f"{owner}: there are no {_RAOS} in this listing of WAMIT{has}: the run had no masses, "
            "or IOPTN(4) = 0"
        )
    rows = np.array(found, dtype=np.float64)
    if not np.all(np.isfinite(rows)):
        raise InputError(f"{owner}: RAOs must have a period and a heading; is the file cut off?")
    if np.any(np.abs(rows[:, 1]) > 720.0) or np.any((rows[:, 2] < 1) | (rows[:, 2] > 6000)):
        raise InputError(f"{owner}: headings must be in degrees, modes in [1, 6000]")
    return rows


def _told(owner: str, pattern: re.Pattern[str], text: str, name: str) -> float:
    found = pattern.search(text)
    value = math.nan if found is None else _float(owner, 0, found[1], infinite=True)
    if not value > 0.0:
        raise InputError(f"{owner}: {name} must be above 0, got {found[1] if found else 'nothing'}")
    return value


def _place(owner: str, text: str, number: int) -> tuple[float, float, float]:
    """Return where a body's origin is, in the axes of the run [m]."""
    places = _BODY.findall(text)
    if len(places) < number:
        raise InputError(f"{owner}: there is no XBODY of body {number}; is the file cut off?")
    x, y, z, turn = (_float(owner, 0, word) for word in places[number - 1])
    if turn != 0.0:
        raise InputError(f"{owner}: PHIBODY must be 0, a body that is not turned, got {turn:g} deg")
    return x, y, z


def _float(owner: str, line: int, word: str, *, infinite: bool = False) -> float:
    """Return a number; `infinite` and `zero` may be words."""
    if infinite and word in {"infinite", "zero"}:
        return math.inf if word == "infinite" else 0.0
    try:
        return float(word)
    except ValueError:
        place = f", line {line}" if line else ""
        raise InputError(f"{owner}{place}: {word[:40]!r} is no number") from None
