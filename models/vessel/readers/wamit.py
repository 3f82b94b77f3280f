"""RAOs from WAMIT: the `.4` file, motions of bodies in waves.

A line is  PER  BETA  I  MOD  PHA  RE  IM: period [s] (or frequency [rad/s], as the run asked),
heading [deg], mode, and the motion twice over, as amplitude and phase [deg] and as a complex
number.  WAMIT Inc., user manual 7.4, sections 3.4 and 4.9:

* time factor e^{+i omega t}, z up, x and y right-handed with it, headings are where the waves
  travel towards: the project's own convention;
* motions are over A/L^n, n = 0 for surge, sway and heave, 1 for the angles, L the run's ULEN, which
  the file does not hold: 1 m unless told;
* modes 7 to 12 are the second body, and so on;
* PER = 0 and PER < 0 stand for the limits of zero and infinite period: no rows of a sea.

Each line says everything twice, which tells a file that was cut, shuffled or edited.

The exciting forces, `.2` and `.3`, have the same lines.  They are refused by their name, by the
name in their first line, and by a heave that is near 1 at neither end of the first column.
"""

import cmath
import math
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...basics import ComplexArray, FloatArray, InputError, check_range, wave_number
from ..assemble import finished, grid, numbers
from ..convention import Convention, one_of
from ..raos import VesselRaos

_COLUMNS = 7
_FORCES = {".2": "exciting forces by Haskind's relation", ".3": "exciting forces"}
_NAMED = re.compile(r"Filename\s+(\S+)")  # in the header that NUMHDR = 1 writes
_NEAR = 0.3  # of 1: heave at the end of a column that is that of the longest waves
_MISMATCH = 2e-3  # of the amplitude, between its two forms on a line: six digits are printed


def looks_like_wamit(text: str) -> bool:
    """Say whether the first two lines hold seven numbers, the third a mode."""
    for line in text.lstrip().splitlines()[:2]:
        words = line.split()
        if len(words) != _COLUMNS:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            continue
        if row[2] == int(row[2]) and 1 <= row[2] <= 600:
            return True
    return False


def parse_wamit(
    owner: str,
    text: str,
    *,
    body: int | None = None,
    length: float | None = None,
    waves: str | None = None,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    depth: float = math.inf,
) -> VesselRaos:
    """Return the motions of one body; arguments are those of `read_raos`.

    The vessel is called after the file.  WAMIT's incident wave has zero phase at the body's origin
    unless the body was moved off the global one.

    Raises InputError if a line is no line of a `.4` file or contradicts itself, rows are missing,
    or the body is not there.
    """
    _refuse_forces(owner, text)
    rows = _rows(owner, text)
    notes = ["WAMIT .4: time factor e^{+i omega t}, z up, headings towards: as here"]
    limits = rows[:, 0] <= 0.0
    if np.any(limits):
        notes.append(f"{int(limits.sum())} rows of zero or infinite period left out")
        rows = rows[~limits]
    if not rows.size:
        raise InputError(f"{owner}: there is no row of a finite period above 0 s in this file")
    rows = of_body(owner, rows, body, notes)
    scale = 1.0 if length is None else check_range(owner, "length", length, low=0.0, open_low=True)
    if length is None:
        notes.append("angles read as rad/m: ULEN taken as 1 m (length=.. if the run had another)")
    else:
        notes.append(f"angles divided by ULEN = {length:g} m")
    kinds = {"period": "period (s)", "frequency": "frequency (rad/s)"}
    kind = (
        _column_kind(owner, rows)
        if waves is None
        else kinds[one_of(owner, "waves", waves, tuple(kinds))]
    )
    notes.append(f"first column read as {kind}" + ("" if waves else ", by the heave of long waves"))
    convention = Convention(waves=kind)
    values = rows[:, 5] + 1j * rows[:, 6]
    modes = rows[:, 2].astype(int)
    scaled = np.where(modes > 3, values / scale, values)
    first, last = float(rows[:, 0].min()), float(rows[:, 0].max())
    if not (first > 1e-6 and last < 1e6):
        raise InputError(
            f"{owner}: the first column must be in (1e-6, 1e6) s or rad/s, got {first:g} to "
            f"{last:g}"
        )
    return vessel_of(
        owner, rows, scaled, convention,
        origin=origin, phase_origin=origin[:2], depth=depth, notes=notes,
    )  # fmt: skip


def vessel_of(
    owner: str,
    rows: FloatArray,
    values: ComplexArray,
    convention: Convention,
    *,
    origin: tuple[float, float, float],
    phase_origin: tuple[float, float],
    depth: float,
    notes: list[str],
) -> VesselRaos:
    """Return the RAOs of rows (n, 3 or more) of wave, heading and mode, with a value each (n,).

    Raises InputError if a mode is missing or a row stands twice.
    """
    omega, heading, table = six_modes(
        owner, convention.omega(rows[:, 0]), rows[:, 1], rows[:, 2].astype(int), values
    )
    motions = convention.complex_values(table, wave_number(omega, depth))
    w, b, found = grid(owner, omega, convention.directions(heading), motions)
    return finished(
        VesselRaos(
            name=Path(owner).stem, omega=w, heading=b, values=found, origin=origin,
            phase_origin=phase_origin, depth=depth, source=owner, notes=tuple(notes),
        )
    )  # fmt: skip


def wamit_text(raos: VesselRaos) -> str:
    """Return a table as the text of a `.4` file of periods, ULEN 1 m.

    The file has no place for origin, water depth and forward speed: who reads it tells the former.

    Raises InputError if the vessel moves forward.
    """
    found = at_rest(raos, "a WAMIT file").with_phase_origin(raos.origin[:2])
    lines = [" Stillhook: PER BETA I MOD PHA RE IM"]
    for i, omega in enumerate(found.omega):
        for j, degrees in enumerate(found.heading_deg):
            for mode, value in enumerate(found.values[i, j], start=1):
                cells = (
                    abs(value), math.degrees(cmath.phase(value)), value.real, value.imag
                )  # fmt: skip
                first = f"{2.0 * math.pi / omega:.12E} {degrees:.9E} {mode:5d}"
                lines.append(f" {first} {' '.join(f'{cell:.12E}' for cell in cells)}")
    return "\n".join(lines) + "\n"


def at_rest(raos: VesselRaos, what: str) -> VesselRaos:
    """Return a table that a format without forward speed can hold.

    Raises InputError if it holds at one.
    """
    if raos.speed != 0.0:
        raise InputError(f"{raos.name}: {what} has no forward speed, got {raos.speed:g} m/s")
    return raos


def _refuse_forces(owner: str, text: str) -> None:
    """Raise InputError if the file's name, or the name in its first line, is one of forces."""
    named = _NAMED.search(text.partition("\n")[0])
    for name in (owner, named[1] if named else ""):
        what = _FORCES.get(Path(name).suffix)
        if what:
            inside = "" if name == owner else f" is called {name!r} inside:"
            raise InputError(
                f"{owner}:{inside} WAMIT writes {what} to a {Path(name).suffix} file, in the same "
                "columns as motions, which are in the .4 file of the same run"
            )


def _rows(owner: str, text: str) -> FloatArray:
    """Return the file's lines as numbers (n, 7), each checked against itself."""
    lines = text.splitlines()
    found: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        if number == 1 and not _is_number(words[0]):
            continue  # the header that NUMHDR = 1 writes
        if len(words) != _COLUMNS:
            raise InputError(
                f"{owner}, line {number}: a line of a WAMIT .4 file has 7 columns (PER, BETA, I, "
                f"MOD, PHA, RE, IM), got {len(words)}; is the file cut off?"
            )
        found.append(numbers(owner, number, words))
    rows = np.array(found, dtype=np.float64).reshape(-1, _COLUMNS)
    if not rows.size:
        raise InputError(f"{owner}: there is no row of RAOs in this file")
    both = rows[:, 3] * np.exp(1j * np.radians(rows[:, 4])) - (rows[:, 5] + 1j * rows[:, 6])
    modes = rows[:, 2]
    # What is nothing but rounding, yaw in head seas, agrees with itself in nothing.
    largest = np.array([np.abs(rows[modes == m, 3]).max() for m in np.unique(modes)])
    noise = 1e-6 * largest[np.searchsorted(np.unique(modes), modes)]
    wrong = np.abs(both) > _MISMATCH * np.abs(rows[:, 3]) + noise
    wrong |= (modes != np.round(modes)) | (modes < 1) | (modes > 6000) | (np.abs(rows[:, 1]) > 720)
    if np.any(wrong):
        row = rows[int(np.argmax(wrong))]
        raise InputError(
            f"{owner}: the row PER {row[0]:g}, BETA {row[1]:g}, I {row[2]:g} contradicts itself: "
            f"MOD {row[3]:g} and PHA {row[4]:g} are not RE {row[5]:g} and IM {row[6]:g}"
        )
    return rows


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def of_body(owner: str, rows: FloatArray, body: int | None, notes: list[str]) -> FloatArray:
    """Return the rows of one body, its modes counted from 1."""
    modes = rows[:, 2].astype(int)
    bodies = sorted(set(((modes - 1) // 6 + 1).tolist()))
    if body is None:
        if len(bodies) > 1:
            raise InputError(
                f"{owner}: there are modes 1 to {modes.max()}, that is {len(bodies)} bodies (or "
                "one with modes of its own): say which, as in body=1"
            )
        body = bodies[0]
    if body not in bodies:
        raise InputError(
            f"{owner}: body must be one of {', '.join(map(str, bodies))}, got {body!r}"
        )
    if bodies != [1]:
        rest = [str(other) for other in bodies if other != body]
        left = f"; left out: body {' and '.join(rest)}" if rest else ", the only ones in the file"
        notes.append(f"body {body}: modes {6 * body - 5} to {6 * body}{left}")
    mine: FloatArray = rows[(modes - 1) // 6 + 1 == body].copy()
    mine[:, 2] -= 6 * (body - 1)
    return mine


def _column_kind(owner: str, rows: FloatArray) -> str:
    """Say whether the first column is a period or a frequency: in long waves heave is 1.

    Raises InputError if it is near 1 at neither end.
    """
    heave = rows[rows[:, 2] == 3]
    if not heave.size:
        return "period (s)"
    amplitude = np.hypot(heave[:, 5], heave[:, 6])
    first = amplitude[heave[:, 0] == heave[:, 0].min()].mean()
    last = amplitude[heave[:, 0] == heave[:, 0].max()].mean()
    off_first, off_last = abs(first - 1.0), abs(last - 1.0)
    if not min(off_first, off_last) <= _NEAR:
        raise InputError(
            f"{owner}: heave must be near 1 in the longest waves, which are at one end of the "
            f"first column; it is {first:.3g} and {last:.3g} there. Are these forces (WAMIT's .2 "
            "and .3), or waves that are all short? In that case say waves=period or "
            "waves=frequency (--waves)"
        )
    return "frequency (rad/s)" if off_first < off_last else "period (s)"


def six_modes(
    owner: str,
    omega: FloatArray,
    beta: FloatArray,
    modes: npt.NDArray[np.int_],
    values: npt.NDArray[np.complex128],
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.complex128]]:
    """Return one row for each frequency and heading with all six modes."""
    keys = np.column_stack([omega, beta])
    unique, which = np.unique(keys, axis=0, return_inverse=True)
    table = np.full((len(unique), 6), np.nan, dtype=np.complex128)
    which = np.ravel(which)
    table[which, modes - 1] = values
    fixed = [int(m) for m in range(1, 7) if not np.any(modes == m)]
    # A mode that no row has was held fixed in the run.
    table[:, [m - 1 for m in fixed]] = 0.0
    if 3 in fixed:
        raise InputError(f"{owner}: there is no row of heave (I = 3) in this file")
    lost = np.argwhere(np.isnan(table.real))
    if lost.size:
        row, mode = (int(n) for n in lost[0])
        raise InputError(
            f"{owner}: there is no row of mode {mode + 1} for {unique[row, 0]:.6g} rad/s, heading "
            f"{unique[row, 1]:.6g} deg, where other modes have one; is the file cut off?"
        )
    return unique[:, 0], unique[:, 1], table
