"""Places aboard: the sides of the ship that they are on, and how motions go from one to another.

The rope leaves the vessel there, and the place decides: on an 80 m vessel in beam sea the tip of a
crane moves two and a half times as much over one side as over the other.
"""

import numpy as np

from ..basics import FloatArray

Point = tuple[float, float, float]


def across(point: Point) -> Point:
    """Return the same place on the other side of the ship."""
    x, y, z = point
    return (x, -y, z)


def side_of(point: Point) -> str:
    """Return the side of the ship that a point is on: port, starboard or centre line."""
    return "centre line" if abs(point[1]) < 1e-9 else "port" if point[1] > 0.0 else "starboard"


def place_text(point: Point) -> str:
    """Return a place in words.

    Examples
    --------
    >>> place_text((-25.0, -15.0, 20.0)), place_text((10.0, 0.0, 0.0))
    ('x -25 m, y -15 m (starboard)', 'x 10 m, y 0 m (centre line)')
    """
    x, y, _ = point
    return f"x {x:.4g} m, y {0.0 if abs(y) < 1e-9 else y:.4g} m ({side_of(point)})"


def transport(point: Point) -> FloatArray:
    """Return T (6, 6): motions at the origin of small motions about `point` are T times those.

    With the motions x_P at P = `point`, those at the origin O are x_O = T x_P: the translation
    loses the rotation's cross product with the arm from O to P.

    Examples
    --------
    >>> [float(v) for v in transport((0.0, 0.0, 2.0)) @ [0, 0, 0, 0, 0.1, 0]]
    [-0.2, 0.0, 0.0, 0.0, 0.1, 0.0]
    """
    x, y, z = point
    found = np.eye(6)
    # u_O = u_P - theta x (P - O)
    found[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return found
