"""Headings of a RAO table that follow from the symmetry of the vessel.

Most programs compute waves from one side only.  A vessel whose port and starboard halves are
mirror images answers waves from the other side with the mirrored motions: surge, heave and pitch
as they are, sway, roll and yaw with the other sign.  Fore-and-aft symmetry turns surge, pitch and
yaw round; a body of revolution has one table for all headings.
"""

import math
from dataclasses import replace

import numpy as np

from ..basics import ComplexArray, FloatArray, InputError
from .raos import MIRRORED, VesselRaos

SYMMETRIES = ("none", "xz plane", "yz plane", "xz and yz planes", "circular")
"""What a vessel may be symmetric about."""

FORE_AFT = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])

_SAME = 1e-7  # rad: two headings that are one
_SMALL = 0.02  # of its largest that sway, roll and yaw may be in seas from ahead or astern
_CIRCLE = 72  # headings made of one, for a body of revolution


def completed(raos: VesselRaos, symmetry: str) -> VesselRaos:
    """Return the table with the headings that follow from one of :data:`SYMMETRIES`.

    Its origin is on the plane, or the axis, of symmetry.

    Raises InputError if the symmetry is unknown, or circular with more than one heading given.
    """
    if symmetry == "none":
        return raos
    if symmetry == "circular":
        return _circular(raos)
    if symmetry not in SYMMETRIES:
        raise InputError(f"{raos.source}: symmetry must be one of {SYMMETRIES}, got {symmetry!r}")
    heading, values = raos.heading, raos.values
    if "xz" in symmetry:
        heading, values = joined(heading, values, -heading, values * MIRRORED)
    if "yz" in symmetry:
        heading, values = joined(heading, values, math.pi - heading, values * FORE_AFT)
    return replace(raos, heading=heading, values=values)


def looks_symmetric(raos: VesselRaos) -> bool:
    """Say whether a table of one side only can be taken for half of a symmetric vessel.

    Its headings lie in one half of the circle, and waves from ahead or astern, of which there
    must be one, make next to no sway, roll and yaw.
    """
    side = np.sin(raos.heading)
    along = np.abs(side) < 1e-6
    one_side = bool(np.all(side > -1e-6) or np.all(side < 1e-6))
    if not one_side or not np.any(along) or np.all(along):
        return False
    size = np.abs(raos.values[:, :, [1, 3, 5]])
    largest = size.max(axis=(0, 1))
    return bool(np.all(size[:, along].max(axis=(0, 1)) <= _SMALL * largest))


def joined(
    heading: FloatArray, values: ComplexArray, turned: FloatArray, others: ComplexArray
) -> tuple[FloatArray, ComplexArray]:
    """Return a table (h,) [rad], (k, h, 6) with those of other headings that it does not have.

    These are of any turn (n,) [rad]; the table's own are in [0, 2 pi).
    """
    turn = 2.0 * math.pi
    new = np.mod(turned, turn)
    # Rounding leaves a heading just short of the full circle, which is the heading zero.
    new = np.where(turn - new < _SAME, 0.0, new)
    away = np.abs(new[:, None] - heading)
    fresh = np.flatnonzero(np.all(np.minimum(away, turn - away) > _SAME, axis=1))
    every = np.concatenate([heading, new[fresh]])
    order = np.argsort(every)
    return every[order], np.concatenate([values, others[:, fresh]], axis=1)[:, order]


def _circular(raos: VesselRaos) -> VesselRaos:
    """Return one heading turned round the circle: surge and sway, roll and pitch are vectors."""
    if raos.heading.size != 1:
        raise InputError(
            f"{raos.source}: a table with circular symmetry must have 1 heading, "
            f"got {raos.heading.size}"
        )
    heading = np.radians(np.arange(_CIRCLE) * 360.0 / _CIRCLE)
    turn = heading - raos.heading[0]
    c, s = np.cos(turn), np.sin(turn)
    surge, sway, heave, roll, pitch, yaw = np.moveaxis(raos.values, -1, 0)
    ones = np.ones_like(c)
    values = np.stack(
        [
            surge * c - sway * s,
            surge * s + sway * c,
            heave * ones,
            roll * c - pitch * s,
            roll * s + pitch * c,
            yaw * ones,
        ],
        axis=-1,
    )
    return replace(raos, heading=heading, values=values)
