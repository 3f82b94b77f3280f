"""A lid on the water inside a hull, which keeps irregular frequencies out of the panel method.

The equations for the water outside a closed hull have no single answer at the frequencies at which
water sloshing *inside* it would resonate.  Panels on the inner surface settle that, if they cover
it whole: with gaps along the hull, as a lid of squares has them, the first irregular frequencies
still show.  So the lid here is spanned between the two sides of the waterline.
"""

from __future__ import annotations

import math

import numpy as np

from ...basics import FloatArray
from .hull import Hull, panel_areas, patch


def waterplane_lid(hull: Hull) -> FloatArray | None:
    """Return panels that cover the waterplane (n, 4, 3), or nothing if it is no simple one.

    Parameters
    ----------
    hull
        One whose waterline is cut twice by every line across the ship; not so for a catamaran,
        a moonpool or a hull that is wholly submerged.
    """
    segments = _waterline(hull)
    if not len(segments):
        return None
    low, high = float(segments[..., 0].min()), float(segments[..., 0].max())
    size = math.sqrt(panel_areas(hull.panels).mean())
    length = high - low
    corners = np.unique(np.round(segments[..., 0], 6))
    # The hull's own stations where they are as far apart as its panels.
    if 0.5 * length / size < corners.size < 2.0 * length / size + 2.0:
        stations = corners
    else:
        stations = np.linspace(low, high, 2 + math.ceil(length / size))
    nudge = 1e-7 * length
    inside = np.clip(stations + nudge, low + nudge, high - nudge)
    sides = []
    for x in inside:
        a, b = segments[:, 0], segments[:, 1]
        crossed = (np.minimum(a[:, 0], b[:, 0]) <= x) & (x < np.maximum(a[:, 0], b[:, 0]))
        a, b = a[crossed], b[crossed]
        part = (x - a[:, 0]) / (b[:, 0] - a[:, 0])
        y = np.sort(a[:, 1] + part * (b[:, 1] - a[:, 1]))
        if y.size != 2:
            return None
        sides.append(y)
    across = np.array(sides)
    # An even number, so that a panel is on one side of a symmetric ship or on the other.
    count = 2 * max(1, round(float(np.ptp(across, axis=1).max()) / size / 2.0))
    t = np.linspace(0.0, 1.0, count + 1)
    y = across[:, :1] * (1.0 - t) + across[:, 1:] * t
    points = np.stack([np.broadcast_to(stations[:, None], y.shape), y, np.zeros_like(y)], axis=-1)
    return patch(points)


def _waterline(hull: Hull) -> FloatArray:
    """Return the panels' edges that lie in the waterline, each once (n, 2, 3)."""
    panels = hull.panels
    tolerance = 1e-6 * max(hull.length, hull.beam)
    edges = np.stack([panels, np.roll(panels, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    long = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) > tolerance
    there = np.all(edges[..., 2] > -tolerance, axis=1)
    return np.asarray(edges[long & there])
