"""Interpolation between the rows and headings of a table of RAOs, and beyond its ends.

The rules are told, with their reasons, at :meth:`models.vessel.raos.VesselRaos.response`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..basics import ComplexArray, FloatArray, InputError, check_range

WIDEST_GAP = math.pi / 2.0
"""Widest gap between two headings of a table that is filled by interpolation [rad]."""

_HEAVE = 2
_ANGLES = (3, 4, 5)


def between_rows(
    omega: FloatArray,
    values: ComplexArray,
    wanted: FloatArray,
    wave_number: Callable[[npt.ArrayLike], FloatArray],
) -> ComplexArray:
    """Interpolate a table along its frequencies.

    Parameters
    ----------
    omega, values
        The table's frequencies (k,) [rad/s] and operators (k, h, 6).
    wanted
        Frequencies (n,), at least zero [rad/s].
    wave_number
        Wave number of a frequency, for the angles below the table.

    Returns
    -------
    ComplexArray
        Operators (n, h, 6).
    """
    check_range("RAOs", "omega", float(wanted.min(initial=0.0)), low=0.0, unit="rad/s")
    inside = np.clip(wanted, omega[0], omega[-1])
    left = np.clip(np.searchsorted(omega, inside, side="right") - 1, 0, omega.size - 2)
    part = ((inside - omega[left]) / (omega[left + 1] - omega[left]))[:, None, None]
    # The phase step of each panel to the nearer side: the same as unwrapping the column.
    a, b = values[left], values[left + 1]
    before, after = np.abs(a), np.abs(b)
    turn = np.angle(b * np.conj(a))
    # A row of exactly zero has no phase of its own; it takes that of its neighbour.
    first = np.where(before > 0.0, np.angle(a), np.angle(b))
    turn = np.where((before > 0.0) & (after > 0.0), turn, 0.0)
    amplitude = before + part * (after - before)
    found = amplitude * np.exp(1j * (first + part * turn))
    # Exactly the table's own numbers at its rows.
    found = np.where(part == 0.0, a, np.where(part == 1.0, b, found))

    under, over = wanted < omega[0], wanted > omega[-1]
    if np.any(under):
        # Long waves: heave as the water does; the angles as its slope.
        share = (wanted[under] / omega[0])[:, None]
        start = values[0, :, _HEAVE]
        level = 1.0 + (np.abs(start) - 1.0) * share
        found[under, :, _HEAVE] = level * np.exp(1j * np.angle(start) * share)
        slope = wave_number(wanted[under]) / wave_number(omega[0])
        for mode in _ANGLES:
            found[under, :, mode] = values[0, :, mode] * slope[:, None]
    if np.any(over):
        found[over] *= ((omega[-1] / wanted[over]) ** 2)[:, None, None]
    return found


def between_headings(
    owner: str, heading: FloatArray, table: ComplexArray, row: npt.NDArray[np.intp], b: FloatArray
) -> ComplexArray:
    """Interpolate along the headings, round the circle.

    Parameters
    ----------
    owner
        Whose table it is, for messages.
    heading
        The table's headings (h,) [rad].
    table
        Operators (n, h, 6).
    row
        Which of the n frequencies each point has (m,).
    b
        Heading of each point (m,) [rad].

    Returns
    -------
    ComplexArray
        Operators (m, 6).

    Raises
    ------
    InputError
        If a heading lies in a gap wider than :data:`WIDEST_GAP`.
    """
    turn = 2.0 * math.pi
    wrapped = np.mod(b, turn)
    left = np.searchsorted(heading, wrapped, side="right") - 1  # -1: between the last and the first
    right = np.mod(left + 1, heading.size)
    start = heading[left] - np.where(left < 0, turn, 0.0)
    gap = np.mod(heading[right] - heading[left], turn)
    gap = np.where(gap == 0.0, turn, gap)
    part = (wrapped - start) / gap
    # Rounding (180 deg in radians, 359.9999..) must not ask for a neighbour far away.
    part = np.where(part * gap < 1e-9, 0.0, np.where((1.0 - part) * gap < 1e-9, 1.0, part))
    lost = (gap > WIDEST_GAP * (1.0 + 1e-9)) & (part > 0.0) & (part < 1.0)
    if np.any(lost):
        i = int(np.argmax(lost))
        raise InputError(
            f"{owner}: no RAO for waves towards {math.degrees(wrapped[i]):.4g} deg: the table has "
            f"no heading between {math.degrees(heading[left[i]]):.4g} and "
            f"{math.degrees(heading[right[i]]):.4g} deg, a gap wider than "
            f"{math.degrees(WIDEST_GAP):g} deg"
        )
    share = part[:, None]
    found: ComplexArray = np.where(
        share == 0.0,
        table[row, left],
        np.where(
            share == 1.0,
            table[row, right],
            (1.0 - share) * table[row, left] + share * table[row, right],
        ),
    )
    return found
