"""The assembly of RAO tables from rows in any order.

What the readers share: text out of a file that may be anything, rows sorted into a grid, the
wave's point of zero phase brought to the origin, the headings that symmetry gives.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray, InputError, binary_name
from .raos import VesselRaos
from .symmetry import completed, looks_symmetric

MOST_ROWS = 2_000_000  #: Most cells of a table, frequencies times headings.

_SAME_FREQUENCY = 1e-9  # relative
_SAME_HEADING = 1e-7  # rad
_SAME_VALUE = 1e-3  # of the largest, for a heading that is there twice, as 0 and 360 deg


def text_of(owner: str, data: bytes) -> str:
    """Return bytes as text: UTF-8, with or without a byte order mark, or else Latin-1.

    Raises InputError if they are no text.
    """
    name = binary_name(data)
    if name or b"\x00" in data:
        what = name or "a binary file"
        raise InputError(f"{owner}: this is no text, as was expected, but {what}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def decoded(value: object) -> str:
    """Return a text that HDF5 may hold as bytes."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def numbers(owner: str, line: int, words: Sequence[str]) -> list[float]:
    """Return words as finite numbers; Fortran's 1.0D+00 is one too.

    Raises InputError if a word is no finite number; the line is told.
    """
    found = []
    for word in words:
        try:
            value = float(word.replace("D", "E").replace("d", "e"))
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or "_" in word:
            raise InputError(f"{owner}, line {line}: {word[:40]!r} is no finite number")
        found.append(value)
    return found


def grid(
    owner: str, omega: npt.ArrayLike, heading: npt.ArrayLike, values: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return rows in any order as frequencies (k,), headings (h,) and operators (k, h, 6).

    A row (n,) has a frequency [rad/s], a direction in [0, 2 pi) [rad] and six operators.

    Raises InputError if a frequency lacks a heading that others have, or a row is there twice with
    other numbers.
    """
    w = np.asarray(omega, dtype=np.float64)
    b = np.asarray(heading, dtype=np.float64)
    rows = np.asarray(values, dtype=np.complex128)
    if not w.size:
        raise InputError(f"{owner}: there is no row of RAOs in this file")
    b = np.where(2.0 * math.pi - b < _SAME_HEADING, 0.0, b)
    frequencies, i = _merged(w, _SAME_FREQUENCY * float(np.max(np.abs(w))))
    headings, j = _merged(b, _SAME_HEADING)
    if frequencies.size * headings.size > max(MOST_ROWS, 4 * w.size):
        raise InputError(
            f"{owner}: {w.size} rows cannot fill a table of {frequencies.size} frequencies by "
            f"{headings.size} headings"
        )
    table = np.full((frequencies.size, headings.size, 6), np.nan, dtype=np.complex128)
    table[i, j] = rows
    again = np.abs(table[i, j] - rows).max(axis=1)
    allowed = _SAME_VALUE * float(np.abs(rows).max(initial=0.0))
    if np.any(again > allowed):
        r = int(np.argmax(again))
        raise InputError(
            f"{owner}: the row of {w[r]:.6g} rad/s, heading {math.degrees(b[r]):.6g} deg is there "
            "twice, with other numbers"
        )
    lost = np.argwhere(np.isnan(table[:, :, 0].real))
    if lost.size:
        row, column = (int(n) for n in lost[0])
        raise InputError(
            f"{owner}: there is no row for {frequencies[row]:.6g} rad/s, heading "
            f"{math.degrees(headings[column]):.6g} deg, which the other rows ask for: "
            f"{len(lost)} of {frequencies.size * headings.size} are missing; is the file cut off?"
        )
    return frequencies, headings, table


def finished(raos: VesselRaos, *, symmetry: str | None = None) -> VesselRaos:
    """Return a table in the project's convention as every reader hands it over.

    The wave's phase is brought to the origin of the motions, and the headings that follow from the
    vessel's symmetry are filled in: the symmetry that the file tells, or port and starboard where
    the table itself shows it.  That is one of :data:`models.vessel.symmetry.SYMMETRIES`, or None.
    """
    notes = list(raos.notes)
    found = raos
    if found.phase_origin != found.origin[:2]:
        x, y = found.phase_origin
        notes.append(
            f"phases were relative to the wave at x = {x:g} m, y = {y:g} m; brought to the origin "
            f"of the motions, x = {found.origin[0]:g} m, y = {found.origin[1]:g} m"
        )
        found = found.with_phase_origin(found.origin[:2])
    before = found.heading.size
    if symmetry is None and looks_symmetric(found):
        found = completed(found, "xz plane")
        notes.append(
            f"one side only, and no sway, roll and yaw in seas from ahead or astern: taken as "
            f"symmetric, {found.heading.size - before} mirrored headings added"
        )
    elif symmetry is not None and symmetry != "none":
        found = completed(found, symmetry)
        added = found.heading.size - before
        notes.append(f"symmetric ({symmetry}): {added} headings added" if added else
                     f"symmetric ({symmetry})")  # fmt: skip
    return replace(found, notes=tuple(notes))


def _merged(values: FloatArray, tolerance: float) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return the distinct values, ascending, and which of them each value is."""
    unique, which = np.unique(values, return_inverse=True)
    new = np.concatenate([[True], np.diff(unique) > tolerance])
    group = np.cumsum(new) - 1
    return unique[new], group[which]
