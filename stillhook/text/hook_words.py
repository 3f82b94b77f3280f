"""The hook's sea, heading and place in words, for the terminal and for figures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from models.vessel import place_text

from .quantities import quantity

if TYPE_CHECKING:
    from models import Case


def heading_words(heading: float) -> str:
    """Return what sailors call waves of a heading [rad].

    Examples
    --------
    >>> heading_words(math.pi), heading_words(math.radians(150.0)), heading_words(0.0)
    ('head sea', 'bow sea from starboard', 'following sea')
    >>> heading_words(math.radians(270.0)), heading_words(math.radians(-45.0))
    ('beam sea from port', 'quartering sea from port')
    """
    degrees = math.degrees(heading) % 360.0
    off = abs(180.0 - degrees)  # from ahead
    if off < 7.5:
        return "head sea"
    if off > 172.5:
        return "following sea"
    kind = "bow sea" if off < 75.0 else "beam sea" if off <= 105.0 else "quartering sea"
    return f"{kind} from {'starboard' if degrees < 180.0 else 'port'}"


def heading_text(heading: float) -> str:
    """Return a heading in degrees and in words.

    Examples
    --------
    >>> heading_text(math.pi)
    '180 deg (head sea)'
    """
    return f"{round(math.degrees(heading) % 360.0, 1):g} deg ({heading_words(heading)})"


def sea_words(case: Case) -> str:
    """Return the sea: height, peak period, shape, spreading."""
    sea = case.sea
    words = [
        f"H_s {quantity(sea.significant_height, 'm')}",
        f"T_p {quantity(sea.spectral_peak_period, 's')}",
        sea.spectrum,
    ]
    spreading = sea.spreading
    if spreading is not None:
        words.append(f"short-crested ({spreading.kind}, {spreading.exponent:g})")
    return ", ".join(words)


def vessel_words(case: Case) -> str:
    """Return place of the hook, heading, speed and current; what is known of the hook at least."""
    vessel = case.vessel
    place = vessel.hook_point
    if place is None or vessel.heading is None:
        return "one heave RAO: one hook in one heading"
    words = [f"hook at {place_text(place)}", heading_text(vessel.heading)]
    if vessel.speed:
        words.append(f"speed {quantity(vessel.speed, 'm/s')}")
    if vessel.current is not None and vessel.current.speed:
        to = math.degrees(vessel.current.heading) % 360.0
        words.append(f"current {quantity(vessel.current.speed, 'm/s')} towards {to:.4g} deg")
    return ", ".join(words)
