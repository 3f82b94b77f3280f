"""The Froude-Krylov force: that of the undisturbed wave on a hull.

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

from ...basics import GRAVITY, SEA_WATER_DENSITY, ComplexArray, wave_number
from .hull import Hull, quadrature_rule


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
    points, normals = quadrature_rule(hull.panels)
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
