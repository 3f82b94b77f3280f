"""RAOs from AQWA: the listing (`.LIS`) of Aqwa-Line.

The displacements stand there twice, in tables titled R.A.O.S-VARIATION WITH WAVE PERIOD/FREQUENCY
and R.A.O.S-VARIATION WITH WAVE DIRECTION; those of velocities and accelerations (VEL, ACC) are
passed over.  A row is period, frequency, direction, then amplitude and phase of the six motions;
what is as in the row before is left out.  Angles are degrees per metre.

Convention, by the long waves of real listings: phases lag (e^{-i omega t}), relative to the crest
above the centre of gravity, whose motions these are; x, y and z are those of the fixed reference
axes, z up from the still water; directions are where the waves travel towards.

The listing changes from version to version: those whose tables were tested are read, no others.
"""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...basics import FloatArray, InputError, wave_number
from ..assemble import finished, grid
from ..convention import Convention
from ..raos import VesselRaos

AQWA = Convention(phase="lags", rotations="deg/m")
"""What the numbers of a listing mean."""

TESTED = ("2023 R1",)  #: Versions of AQWA whose listings are read.

_VERSION = re.compile(r"VERSION\s+(\d{4}\s*R\d|\d+\.\d+)")
_STRUCTURE = re.compile(r"S T R U C T U R E\s+(\d+)")
_TITLE = re.compile(r"^\s*R\.A\.O\.S-VARIATION WITH WAVE (PERIOD/FREQUENCY|DIRECTION)\s*$")
_HEAD = re.compile(r"^\s*PERIOD\s+FREQ\s+DIRECTION\s+X\s+Y\s+Z\s+RX\s+RY\s+RZ\s*$")
_CENTRE = re.compile(r"STRUCTURE C\.O\.G\.\s+GX=\s*(\S+)\s+GY=\s*(\S+)\s+GZ=\s*(\S+)")
_DEPTH = re.compile(r"^\s*WATER\s+DEPTH[ .]*=\s*(\S+)\s*$", re.MULTILINE)
_GRAVITY = re.compile(r"^\s*ACCELERATION\s+DUE\s+TO\s+GRAVITY[ .]*=\s*(\S+)\s*$", re.MULTILINE)
_NUMBER = re.compile(r"-?\d+\.\d+(?:E[+-]\d+)?")
_METRIC = (9.6, 10.0)  # m/s2: a gravity that says that lengths are metres
_ROWS_TO_HEAD = 8  # lines from a title to its first row
_DIGITS = (0.005, 0.0005)  # to which period [s] and frequency [rad/s] are printed
_SAME = 2e-3  # m/m, deg/m: between the two tables


@dataclass
class _Structure:
    """What a listing has of one structure: its centre of gravity, and rows of each table."""

    centre: tuple[float, float, float] | None = None
    tables: dict[str, dict[tuple[float, float, float], list[float]]] = field(default_factory=dict)


def looks_like_aqwa(text: str) -> bool:
    """Say whether a text is a listing of AQWA."""
    return "AQWA" in text[:20_000].upper() and "* * * *" in text


def parse_aqwa(owner: str, text: str, *, body: int | None = None) -> VesselRaos:
    """Return the motions of one structure; arguments are those of `read_raos`.

    The vessel is called after the file.

    Raises InputError if the listing is of a version that is not read, is cut off, has no tables of
    RAOs, or contradicts itself, or the structure is not there.
    """
    found = _VERSION.search(text)
    version = " ".join(found[1].split()) if found else ""
    if version not in TESTED:
        raise InputError(
            f"{owner}: a listing of AQWA {version or 'of unknown version'}: those of "
            f"{', '.join(TESTED)} are read, as the tables change from version to version; write "
            "the RAOs as CSV instead"
        )
    _check_metres(owner, text)
    structures = {n: one for n, one in _structures(owner, text).items() if one.tables}
    if not structures:
        raise InputError(
            f"{owner}: there is no table R.A.O.S-VARIATION WITH WAVE PERIOD/FREQUENCY in this "
            "listing; it holds no motions, or is cut off"
        )
    if body is None and len(structures) > 1:
        raise InputError(
            f"{owner}: there are structures {', '.join(map(str, structures))}: say which, as in "
            "body=1"
        )
    chosen = next(iter(structures)) if body is None else body
    if chosen not in structures:
        raise InputError(
            f"{owner}: body must be one of {', '.join(map(str, structures))}, got {body!r}"
        )
    depths = _DEPTH.findall(text)
    return _assembled(owner, structures[chosen], version, chosen, depths[-1] if depths else "")


def _assembled(
    owner: str, structure: _Structure, version: str, number: int, depth: str
) -> VesselRaos:
    rows = _checked(owner, structure)
    if structure.centre is None:
        raise InputError(f"{owner}: the line STRUCTURE C.O.G. of structure {number} is missing")
    omega = np.array([_frequency(row[0], row[1]) for row in rows])
    amplitude, phase = rows[:, 3::2], rows[:, 4::2]
    values = AQWA.values(amplitude, phase, wave_number(omega))
    w, b, table = grid(owner, omega, AQWA.directions(rows[:, 2]), values)
    x, y, z = structure.centre
    notes = (
        f"AQWA {version}, structure {number}: {AQWA.words()}",
        f"motions of the centre of gravity, ({x:g}, {y:g}, {z:g}) m; phases relative to the crest "
        "there",
    )
    try:
        water = float(depth)
    except ValueError:
        raise InputError(f"{owner}: WATER DEPTH must be a number, got {depth!r}") from None
    return finished(
        VesselRaos(
            name=Path(owner).stem, omega=w, heading=b, values=table, origin=(x, y, z),
            phase_origin=(x, y), depth=water, source=owner, notes=notes,
        )
    )  # fmt: skip


def _check_metres(owner: str, text: str) -> None:
    gravity = _GRAVITY.search(text)
    try:
        value = float(gravity[1]) if gravity else math.nan
    except ValueError:
        value = math.nan
    if not _METRIC[0] < value < _METRIC[1]:
        got = gravity[1] if gravity else "nothing"
        raise InputError(
            f"{owner}: ACCELERATION DUE TO GRAVITY must be that of metres, 9.81, got {got}"
        )


def _structures(owner: str, text: str) -> dict[int, _Structure]:
    """Return what the listing has of each structure, by its number."""
    found: dict[int, _Structure] = {}
    lines = text.splitlines()
    number = 0
    for at, line in enumerate(lines):
        if (named := _STRUCTURE.search(line)) is not None:
            number = int(named[1])
        elif (centre := _CENTRE.search(line)) is not None:
            place = tuple(_float(owner, at + 1, word) for word in centre.groups())
            found.setdefault(number, _Structure()).centre = (place[0], place[1], place[2])
        elif (title := _TITLE.match(line)) is not None:
            table = found.setdefault(number, _Structure()).tables.setdefault(title[1], {})
            _read_table(owner, lines, at + 1, table)
    return found


def _read_table(
    owner: str, lines: list[str], start: int, table: dict[tuple[float, float, float], list[float]]
) -> None:
    """Add the rows below a title to a table, by period, frequency and direction."""
    if not any(_HEAD.match(line) for line in lines[start : start + _ROWS_TO_HEAD]):
        raise InputError(
            f"{owner}, line {start}: the columns must be PERIOD, FREQ, DIRECTION, X, Y, Z, RX, RY, "
            "RZ, as in the versions that are read"
        )
    period = frequency = direction = math.nan
    begun = False
    for at in range(start, len(lines)):
        line = lines[at]
        bare = _NUMBER.sub("", line).strip()
        if bare or not line.strip():
            if begun and bare:
                if bare != "1":
                    text_ = line.strip()[:60]
                    raise InputError(f"{owner}, line {at + 1}: is no row of RAOs: {text_}")
                return
            continue
        row = [float(word) for word in _NUMBER.findall(line)]
        if len(row) == 15:
            period, frequency, direction = row[:3]
        elif len(row) == 14:
            period, frequency = row[:2]
        elif len(row) == 13:
            direction = row[0]
        if len(row) not in (13, 14, 15) or math.isnan(period + frequency + direction):
            raise InputError(
                f"{owner}, line {at + 1}: a row of RAOs has amplitude and phase of six motions, "
                f"got {len(row)} numbers; is the file cut off?"
            )
        begun = True
        table[period, frequency, direction] = row[-12:]


def _checked(owner: str, structure: _Structure) -> FloatArray:
    """Return the rows (n, 15), the two tables held against each other."""
    first, *others = structure.tables.values()
    for other in others:
        for key in {*first, *other}:
            a, b = first.get(key), other.get(key)
            if a is None or b is None:
                raise InputError(
                    f"{owner}: one of the two tables has no row of {key[0]:g} s, direction "
                    f"{key[2]:g}; is the file cut off?"
                )
            one, two = (np.array(r[::2]) * np.exp(1j * np.radians(r[1::2])) for r in (a, b))
            if np.any(np.abs(one - two) > _SAME * (1.0 + np.abs(one))):
                raise InputError(
                    f"{owner}: the two tables of RAOs differ at {key[0]:g} s, direction {key[2]:g}"
                )
    rows = np.array([[*key, *values] for key, values in first.items()], dtype=np.float64)
    if not rows.size:
        raise InputError(f"{owner}: there is no row of RAOs in this listing")
    if np.any(rows[:, 1] <= 0.0) or np.any(rows[:, 0] <= 0.0) or np.any(np.abs(rows[:, 2]) > 720):
        raise InputError(f"{owner}: periods and frequencies must be above 0, directions in degrees")
    return rows


def _frequency(period: float, frequency: float) -> float:
    """Return the frequency [rad/s] of what is printed to more digits, period or frequency."""
    by_period = _DIGITS[0] / period < _DIGITS[1] / frequency
    return 2.0 * math.pi / period if by_period else frequency


def _float(owner: str, line: int, word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise InputError(f"{owner}, line {line}: {word[:40]!r} is no number") from None
