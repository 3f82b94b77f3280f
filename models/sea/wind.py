"""Fully arisen seas by the wind's speed: Table 3 of the 1975 thesis.

Only its sea states 4 to 6 have survived the scan: winds of 18 to 24.5 knots.  Below, the rows are
lost; above, the one row that is left (15 ft) has lost its wind.  Neither is made up here: such a
wind needs a spectrum with H_s and T_p.

The table gives the average period; the period of the energy's maximum in such a sea (Pierson,
Neumann and James 1955) is sqrt(2) times as long, and this is what the thesis takes as T_S: 8.1 s at
20 knots, where the table has 5.7 s.
"""

from __future__ import annotations

import math

import numpy as np

from ..basics import InputError

_FOOT = 0.3048
_KNOT = 1852.0 / 3600.0

WIND_TABLE: tuple[tuple[float, float, float], ...] = (
    (18.0, 6.1, 5.1), (19.0, 6.9, 5.4), (20.0, 8.0, 5.7), (22.0, 10.0, 6.3), (24.0, 12.0, 6.8),
    (24.5, 13.0, 7.0),
)  # fmt: skip
"""Wind [knots], significant height [ft] and average period [s]: 1975 thesis, Table 3."""


def fully_arisen(wind_speed: float) -> tuple[float, float]:
    """Return the fully arisen sea of a wind, linear between the rows of the table.

    Parameters
    ----------
    wind_speed
        Wind speed [m/s].

    Returns
    -------
    significant_height, significant_period
        H_s [m] and T_S [s].

    Raises
    ------
    InputError
        If the wind is outside the table.

    Examples
    --------
    >>> height, period = fully_arisen(20 * 1852 / 3600)
    >>> round(height, 4), round(period, 2)
    (2.4384, 8.06)
    """
    wind, height, period = np.array(WIND_TABLE).T
    knots = wind_speed / _KNOT
    span = (
        f"{wind[0]:g} to {wind[-1]:g} knots ({wind[0] * _KNOT:.2f} to {wind[-1] * _KNOT:.2f} m/s)"
    )
    got = f"got {knots:.4g} knots ({wind_speed:.4g} m/s)"
    tiny = 1e-9 * knots
    if not math.isfinite(knots) or knots < wind[0] - tiny:
        raise InputError(
            f"must be {span}, {got}: the rows of the 1975 thesis's Table 3 below 18 knots are "
            "lost; give significant_height and a period instead"
        )
    if knots > wind[-1] + tiny:
        raise InputError(
            f"must be {span}, {got}: the 1975 thesis's Table 3 ends there; give "
            "significant_height and a period instead"
        )
    return (
        float(np.interp(knots, wind, height)) * _FOOT,
        math.sqrt(2.0) * float(np.interp(knots, wind, period)),
    )
