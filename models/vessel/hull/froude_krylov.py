"""The force of the undisturbed wave on a hull: the Froude-Krylov force.

It could come from the panel method, by the pressure in the middle of each panel.  For roll that is
not good enough: the moment of long waves is a small difference of large parts, as is the
metacentric height, and eight panels across the beam put it off by 4 %.  Here the pressure is
integrated by a rule that is exact for polynomials of the second degree, as the hydrostatics are,
so that long waves roll the ship as they must, whatever the panels.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ...basics import GRAVITY, SEA_WATER_DENSITY, ComplexArray, FloatArray, wave_number
from .hull import Hull


def froude_krylov(
    hull: Hull,
    *,
    omega: float,
    heading: npt.ArrayLike,
    point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    depth: float = math.inf,
    density: float = SEA_WATER_DENSITY,
) -> ComplexArray:
    """Return force and moment of the undisturbed wave per metre of amplitude (h, 6) [N/m, N].

    Parameters
    ----------
    hull
        Its wetted surface.
    omega
        Frequency [rad/s].
    heading
        Where the waves travel towards (h,) [rad].
    point
        About which the moments are [m].
    depth
        Water depth [m].
    density
        Of the water [kg/m3].

    Returns
    -------
    ComplexArray
        Time factor e^{+i omega t}, against the elevation at the frame's origin.
    """
    k = float(wave_number(omega, depth))
    direction = np.atleast_1d(np.asarray(heading, dtype=np.float64))
    points, normals = _rule(hull.panels)
    arms = np.cross(points - np.asarray(point), normals)
    generalised = np.concatenate([normals, arms], axis=1)  # (q, 6), with the weights
    z = points[:, 2]
    if math.isinf(depth) or k * depth > 20.0:
        decay = np.exp(k * z)
    else:
        decay = np.cosh(k * (z + depth)) / math.cosh(k * depth)
    along = points[:, 0] * np.cos(direction)[:, None] + points[:, 1] * np.sin(direction)[:, None]
    pressure = density * GRAVITY * decay * np.exp(-1j * k * along)
    # Pressure pushes inwards, against the outward normal.
    force: ComplexArray = -(pressure @ generalised)
    return force


def _rule(panels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (q, 3) and outward normals times weights (q, 3) of the integration rule."""
    points, normals = [], []
    for corners in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)):
        a, b, c = (panels[:, i, :] for i in corners)
        normal = 0.25 * np.cross(b - a, c - a)
        for middle in (a + b, b + c, c + a):
            points.append(0.5 * middle)
            normals.append(normal / 3.0)
    return np.concatenate(points), np.concatenate(normals)
