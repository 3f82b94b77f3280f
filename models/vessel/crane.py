"""The tip of a crane, from its angles; sides of the ship.

The rope leaves the vessel there, and the place decides: on an 80 m vessel in beam sea the tip of a
crane moves two and a half times as much over one side as over the other.
"""

from __future__ import annotations

import math

from ..basics import check_finite

Point = tuple[float, float, float]


def crane_tip(
    heel: Point,
    *,
    slew: float,
    boom_length: float,
    boom_angle: float,
    jib_length: float = 0.0,
    jib_angle: float = 0.0,
) -> Point:
    """Return the place of a crane's tip.

    Parameters
    ----------
    heel
        Slew axis at the height of the boom's heel, x forward, y to port, z up (3,) [m].
    slew
        Direction of the boom in plan, counter-clockwise from the bow: 0 over the bow, pi/2 over
        port [rad].
    boom_length, boom_angle
        Length of the boom [m] and its angle above the horizontal [rad].
    jib_length, jib_angle
        The second boom of a knuckle-boom crane, its angle above the horizontal too.

    Returns
    -------
    tuple
        x, y, z of the tip [m].

    Raises
    ------
    InputError
        If a number is not finite.

    Examples
    --------
    A boom of 20 m at 60 degrees over the port side:

    >>> tip = crane_tip((-25.0, 5.0, 12.0), slew=math.pi / 2, boom_length=20.0,
    ...                 boom_angle=math.radians(60.0))
    >>> [round(x, 2) for x in tip]
    [-25.0, 15.0, 29.32]
    """
    x, y, z = (float(v) for v in check_finite("crane", "heel", list(heel)))
    parts = [slew, boom_length, boom_angle, jib_length, jib_angle]
    check_finite("crane", "angles and lengths", parts)
    reach = boom_length * math.cos(boom_angle) + jib_length * math.cos(jib_angle)
    rise = boom_length * math.sin(boom_angle) + jib_length * math.sin(jib_angle)
    return (x + reach * math.cos(slew), y + reach * math.sin(slew), z + rise)


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
