"""RAOs as text that anybody can write: the project's CSV file.

Lines that start with `#` say what the table means, as `# key: value`; then a header line and one
line for each frequency and heading, in any order:

    # name: supply vessel
    # origin: -5.4, 0, 0
    # rotations: deg/m
    # phase: lags
    period [s], heading, heave_amplitude, heave_phase, roll_amplitude, roll_phase, ...
    25.0, 180, 0.985, -2.1, 0.01, 3.0, ...

The keys are those of :class:`models.vessel.convention.Convention`, and `name`, `origin`,
`phase_origin`, `depth`, `speed`, `heading`, `symmetry`, `source` and `note`; what is not told is
the project's own convention.  There is a column `omega` [rad/s], `frequency` [Hz] or `period` [s],
and `heading` [deg] unless the table is of one that is told; a motion is `_amplitude` and `_phase`
[deg], or `_real` and `_imag`.  Motions without columns are zero; heave must be there.

Columns are also found by what people call them, `Heave amp (m/m)`, `Wave direction (deg)`, in any
order; behind semicolons and tabs a comma is the decimal point.
"""

import csv
import io
import math
import re
from collections.abc import Mapping

import numpy as np

from ...basics import ComplexArray, FloatArray, InputError, check_range, wave_number
from ..assemble import finished, grid, numbers
from ..convention import CHOICES, Convention, one_of
from ..raos import MODES, VesselRaos
from ..symmetry import SYMMETRIES

FORMAT = "Stillhook RAOs, version 1"

Columns = dict[str, tuple[int, str]]  # number and unit of the column of each "mode part"
Named = tuple[int, str]  # number of a column, and what its numbers are
Header = tuple[Named, Named | None, Columns]  # waves, headings in degrees or radians, the rest

_ABOUT = (
    "name", "origin", "phase_origin", "depth", "speed", "heading", "symmetry", "source", "note"
)  # fmt: skip
_KEY = re.compile(r"^#\s*([A-Za-z_ ]+?)\s*:\s*(.*?)\s*$")
_COLUMN = re.compile(r"^([a-z_ .-]+?)\s*(?:[\[(]\s*(.*?)\s*[\])])?$")
_FIRST = {
    **dict.fromkeys(("omega", "w"), "frequency (rad/s)"),
    **dict.fromkeys(("frequency", "freq", "wave_frequency", "wave_freq"), "frequency (Hz)"),
    **dict.fromkeys(("period", "t", "wave_period"), "period (s)"),
}
_HEADING = ("heading", "direction", "dir", "beta", "wave_heading", "wave_direction", "wave_dir")
_FIRST_UNITS = {"rad/s": "frequency (rad/s)", "hz": "frequency (Hz)", "s": "period (s)"}
_PARTS = {
    **dict.fromkeys(("amplitude", "amp", "ampl", "magnitude", "mag", "rao"), 0),
    **dict.fromkeys(("phase", "ph", "pha"), 1),
    **dict.fromkeys(("real", "re"), 2),
    **dict.fromkeys(("imag", "im"), 3),
}
#: Names of columns that will do, for messages.
WOULD_DO = "'Period (s)', 'Heading (deg)', 'Heave amp (m/m)', 'Heave phase (deg)'"
_NAMES = ("amplitude", "phase", "real", "imag")
_TURN_UNITS = {"deg": "degrees", "rad": "radians", "degrees": "degrees", "radians": "radians"}
_ANGLES = {"deg/m": "deg/m", "rad/m": "rad/m", "": ""}


def looks_like_csv(text: str) -> bool:
    """Say whether the first line that is no remark names a heading and a motion."""
    for line in text.splitlines()[:200]:
        if line.strip() and not line.lstrip().startswith("#"):
            if line.lower().startswith("sep="):  # Excel's
                continue
            words = [_plain(cell)[0] for cell in re.split(r"[,;\t]", line)]
            waves = any(word in _FIRST for word in words)
            return len(words) > 1 and waves and any(_motion(word) for word in words)
    return False


def parse_csv(owner: str, text: str, *, heading: float | None = None) -> VesselRaos:
    """Return the table of a CSV file; arguments are those of `read_raos`.

    Raises InputError if a key or a column is unknown, a line has another number of columns than the
    header, a word is no number, rows are missing, or there is no column of headings and none told.
    """
    told, notes, body, start = _head(owner, text)
    ((at, first), turn, columns), rows = _rows(owner, body, start)
    convention = _convention(owner, told, first, columns)
    depth = _figure(owner, "depth", told, math.inf)
    low, high = float(rows[:, at].min()), float(rows[:, at].max())
    if not (low > 1e-6 and high < 1e6):
        raise InputError(f"{owner}: {first} must be in (1e-6, 1e6), got {low:g} to {high:g}")
    omega = convention.omega(rows[:, at])
    headings = _headings(owner, rows, turn, told, heading)
    slope = wave_number(omega, depth)
    values, missing = _values(owner, rows, columns, convention, slope)
    origin = _point(owner, "origin", told, (0.0, 0.0, 0.0))
    zero = _point(owner, "phase_origin", told, origin[:2])
    w, b, table = grid(owner, omega, convention.directions(headings), values)
    found = [f"CSV: {convention.words()}"]
    if missing:
        found.append(f"no columns for {', '.join(missing)}: taken as zero")
    own = told.get("convention format", "") == FORMAT
    raos = VesselRaos(
        name=told.get("name", "vessel"), omega=w, heading=b, values=table,
        origin=(origin[0], origin[1], origin[2]), phase_origin=(zero[0], zero[1]), depth=depth,
        speed=_figure(owner, "speed", told, 0.0), source=told.get("source", "") or owner,
        notes=tuple(notes) if own and convention == Convention() else (*notes, *found),
    )  # fmt: skip
    symmetry = (
        one_of(owner, "symmetry", told["symmetry"], SYMMETRIES) if "symmetry" in told else None
    )
    # What we wrote ourselves is whole; only a file from elsewhere may be one side of a ship.
    return raos if own and symmetry is None else finished(raos, symmetry=symmetry)


def _headings(
    owner: str, rows: FloatArray, turn: Named | None, told: Mapping[str, str], given: float | None
) -> FloatArray:
    """Return the heading of each row (n,) [deg]: of its column, or the one that is told."""
    if turn is not None:
        if given is not None:
            raise InputError(f"{owner}: heading must not be given: the file has a column of them")
        found = rows[:, turn[0]]
        found = np.degrees(found) if turn[1] == "radians" else found
    elif given is not None or "heading" in told:
        one = told["heading"] if given is None else given
        found = np.full(len(rows), check_range(owner, "heading", one, unit="deg"))
    else:
        raise InputError(
            f"{owner}: there is no column of headings ('Heading (deg)'); say for which heading the "
            "table holds: heading=180, --heading 180, or a line '# heading: 180'"
        )
    if np.any(np.abs(found) > 720.0):
        worst = found[int(np.argmax(np.abs(found)))]
        raise InputError(f"{owner}: heading must be in [-720, 720] deg, got {worst:g} deg")
    return np.asarray(found, dtype=np.float64)


def csv_text(raos: VesselRaos) -> str:
    """Return a table as the text of a CSV file, in the project's convention.

    Real and imaginary parts, which read back to the last digit.
    """
    out = io.StringIO()
    out.write(f"# format: {FORMAT}\n")
    x, y, z = raos.origin
    about = [
        ("name", raos.name),
        ("source", raos.source),
        ("origin", f"{x!r}, {y!r}, {z!r}"),
        ("phase_origin", f"{raos.phase_origin[0]!r}, {raos.phase_origin[1]!r}"),
        ("depth", repr(raos.depth)),
        ("speed", repr(raos.speed)),
        *(("note", note) for note in raos.notes),
    ]
    for key, value in about:
        out.write(f"# {key}: {' '.join(str(value).split())}\n")
    writer = csv.writer(out, lineterminator="\n")
    parts = [f"{mode}_{part}" for mode in MODES for part in ("real", "imag")]
    writer.writerow(["omega [rad/s]", "heading [deg]", *parts])
    for j, heading in enumerate(raos.heading_deg):
        for i, omega in enumerate(raos.omega):
            cells = raos.values[i, j].view(np.float64)
            writer.writerow([repr(float(v)) for v in (omega, heading, *cells)])
    return out.getvalue()


def _head(owner: str, text: str) -> tuple[dict[str, str], list[str], list[str], int]:
    """Return what the remarks tell, the notes among them, and the lines that follow."""
    told: dict[str, str] = {}
    notes = []
    lines = text.splitlines()
    body: list[str] = []
    start = 0
    for number, line in enumerate(lines, start=1):
        bare = line.strip()
        if not bare or bare.lower().startswith("sep="):
            continue
        if not bare.startswith("#"):
            body, start = lines[number - 1 :], number
            break
        match = _KEY.match(bare)
        if match is None:
            continue
        key, value = match[1].strip().lower().replace(" ", "_"), match[2]
        if key == "format":
            told["convention format"] = value
        elif key == "note":
            notes.append(value)
        elif key in CHOICES:
            told[key] = one_of(owner, key, value, CHOICES[key])
        elif key == "heading_zero" or key in _ABOUT:
            told[key] = value
        # Any other remark is a remark.
    return told, notes, body, start


def _rows(owner: str, lines: list[str], start: int) -> tuple[Header, FloatArray]:
    """Return what the columns are, and the numbers below them."""
    if not lines:
        raise InputError(f"{owner}: there is no line of column names in this file")
    mark = max(",;\t", key=lines[0].count)
    try:
        table = list(csv.reader(lines, delimiter=mark))
    except csv.Error as error:
        raise InputError(f"{owner}: cannot be read as CSV: {error}") from error
    header = _header(owner, [cell.strip() for cell in table[0]])
    width = len(table[0])
    found = []
    for number, row in enumerate(table[1:], start=start + 1):
        if not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
            continue
        if len(row) != width:
            raise InputError(
                f"{owner}, line {number}: must have {width} columns as the header has, got "
                f"{len(row)}; is the file cut off?"
            )
        cells = [cell.strip() if mark == "," else cell.strip().replace(",", ".") for cell in row]
        found.append(numbers(owner, number, cells))
    if not found:
        raise InputError(f"{owner}: there is no row of RAOs below the column names")
    return header, np.array(found, dtype=np.float64)


def _plain(name: str) -> tuple[str, str]:
    """Return the words of a column's name, joined by `_`, and its unit."""
    match = _COLUMN.match(" ".join(name.strip().strip('"').lower().split()))
    if match is None:
        return "", ""
    unit = (match[2] or "").replace("\N{DEGREE SIGN}", "deg")
    return re.sub(r"[ ._-]+", "_", match[1]).strip("_"), unit


def _motion(word: str) -> str:
    """Return the `mode part` that a column is of, or nothing."""
    mode, _, part = word.rpartition("_")
    if part in MODES:  # as in `amp heave`
        mode, part = part, mode
    return f"{mode} {_NAMES[_PARTS[part]]}" if mode in MODES and part in _PARTS else ""


def _header(owner: str, names: list[str]) -> Header:
    """Return which column has the waves, which the headings, and where each `mode part` is."""
    waves: Named | None = None
    turn: Named | None = None
    columns: Columns = {}
    for index, name in enumerate(names):
        word, unit = _plain(name)
        key = _motion(word)
        if word in _FIRST and waves is None and (not unit or unit in _FIRST_UNITS):
            waves = index, _FIRST_UNITS[unit] if unit else _FIRST[word]
        elif word in _HEADING and turn is None and (not unit or unit in _TURN_UNITS):
            turn = index, _TURN_UNITS[unit] if unit else "degrees"
        elif key and key not in columns:
            columns[key] = (index, unit)
        else:
            raise InputError(
                f"{owner}: a column must be omega [rad/s], frequency [Hz] or period [s], heading "
                f"[deg] or [rad], or a motion ({', '.join(MODES)}) with _amplitude, _phase, _real "
                f"or _imag, each once; got {name!r}. Names such as {WOULD_DO} will do"
            )
    if waves is None:
        raise InputError(
            f"{owner}: there must be a column omega [rad/s], frequency [Hz] or period [s]; names "
            f"such as {WOULD_DO} will do"
        )
    return waves, turn, columns


def _convention(owner: str, told: Mapping[str, str], first: str, columns: Columns) -> Convention:
    """Return the convention of the remarks, and of the units in the column names."""
    choices = {key: value for key, value in told.items() if key in CHOICES}
    choices["waves"] = first
    for key, (_, unit) in columns.items():
        if not unit:
            continue
        mode, part = key.split()
        if part == "phase" and unit in _TURN_UNITS:
            field, value = "phase_unit", _TURN_UNITS[unit]
        elif mode in MODES[3:] and part != "phase" and unit in _ANGLES:
            field, value = "rotations", _ANGLES[unit]
        elif mode in MODES[:3] and part != "phase" and unit in {"m/m", "-"}:
            continue
        else:
            raise InputError(f"{owner}: the unit [{unit}] of {mode}_{part} is not known")
        if choices.setdefault(field, value) != value:
            raise InputError(
                f"{owner}: {field} is told twice: {choices[field]}, and {value} at {mode}_{part}"
            )
    return Convention(**choices, heading_zero=_figure(owner, "heading_zero", told, 0.0))


def _values(
    owner: str, rows: FloatArray, columns: Columns, convention: Convention, slope: FloatArray
) -> tuple[ComplexArray, list[str]]:
    """Return the operators of each row (n, 6), and the motions that have no columns."""
    table = np.zeros((len(rows), len(MODES)), dtype=np.complex128)
    turn = 1.0 if convention.phase_unit == "radians" else math.pi / 180.0
    missing = []

    for i, mode in enumerate(MODES):
        places = [columns.get(f"{mode} {part}") for part in _NAMES]
        amplitude, phase, real, imag = (None if at is None else rows[:, at[0]] for at in places)
        if real is not None and imag is not None and amplitude is None and phase is None:
            table[:, i] = real + 1j * imag
        elif amplitude is not None and phase is not None and real is None and imag is None:
            if np.any(amplitude < 0.0):
                raise InputError(
                    f"{owner}: {mode}_amplitude must be at least 0, got {amplitude.min():g}"
                )
            table[:, i] = amplitude * np.exp(1j * turn * phase)
        elif all(part is None for part in (amplitude, phase, real, imag)):
            missing.append(mode)
        else:
            raise InputError(
                f"{owner}: {mode} must have the columns _amplitude and _phase, or _real and _imag"
            )
    if "heave" in missing:
        raise InputError(f"{owner}: there are no columns for heave")
    return convention.complex_values(table, slope), missing


def _figure(owner: str, name: str, told: Mapping[str, str], default: float) -> float:
    if name not in told:
        return default
    if name == "depth" and told[name].strip().lower() in {"inf", "infinite", "deep"}:
        return math.inf
    return check_range(owner, name, told[name], low=-1e4, high=1e4)


def _point(
    owner: str, name: str, told: Mapping[str, str], default: tuple[float, ...]
) -> tuple[float, ...]:
    if name not in told:
        return default
    words = told[name].replace(",", " ").split()
    if len(words) != len(default):
        raise InputError(f"{owner}: {name} must be {len(default)} numbers [m], got {told[name]!r}")
    return tuple(check_range(owner, name, word, low=-1e4, high=1e4) for word in words)
