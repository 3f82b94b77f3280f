"""The way from the project's convention of RAOs to any other, for tests of the way back."""

from __future__ import annotations

import math

import numpy as np

from models.vessel.convention import Convention

LEAD = {"crest": 1, "trough": -1, "zero up-crossing": 1j, "zero down-crossing": -1j}


def written(
    convention: Convention, values: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitudes, phases and complex numbers as a program of a convention writes operators."""
    per_angle = {
        "rad/m": np.ones_like(slope), "deg/m": np.full_like(slope, math.pi / 180.0),
        "max wave slope": slope, "wave steepness": slope / math.pi,
    }  # fmt: skip
    found = np.array(values / LEAD[convention.phase_relative_to] * convention.signs)
    found[..., 3:] /= per_angle[convention.rotations][..., None]
    found = np.conj(found) if convention.phase == "lags" else found
    unit = math.degrees(1.0) if convention.phase_unit == "degrees" else 1.0
    return np.abs(found), np.angle(found) * unit, found


def first_column(convention: Convention, omega: np.ndarray) -> np.ndarray:
    """Frequencies [rad/s] as the table's first column has them."""
    turns = 2.0 * math.pi
    kinds = {"frequency (rad/s)": omega, "period (s)": turns / omega}
    return kinds.get(convention.waves, omega / turns)


def headings(convention: Convention, directions: np.ndarray) -> np.ndarray:
    """Headings [deg] in [0, 360) of where waves travel towards [rad]."""
    turn = 1.0 if convention.turning == "counter-clockwise" else -1.0
    flip = 180.0 if convention.headings == "from" else 0.0
    wrapped = np.mod(turn * (np.degrees(directions) - convention.heading_zero - flip), 360.0)
    return np.where(wrapped >= 360.0, 0.0, wrapped)
