"""Tables of the 1975 thesis that a case file can point at, and the density of steel.

Table 4 gives drag coefficients by the body's shape, Table A-1 the added mass of a square prism,
Table 6 the layers of rope on the drum of an American Hoist model 1000 winch.  A case names an
entry (`drag_shape: disc`, `layers: american-hoist-1000`, `shape: {prism_side, prism_height}`)
or gives figures of its own.
"""

import math
from collections.abc import Mapping

import numpy as np

from ..basics import check_range

STEEL_DENSITY = 7850.0
"""Density of steel [kg/m3]."""

DRAG_COEFFICIENTS: Mapping[str, float] = {
    "long-square-cylinder": 2.05,
    "square-cylinder": 1.05,
    "disc": 1.17,
    "hemisphere-open-to-flow": 1.42,
    "hemisphere-open-downstream": 0.38,
    "c-section-open-to-flow": 2.30,
    "c-section-open-downstream": 1.20,
}
"""Drag coefficients [-] at a Reynolds number of at least 1000: 1975 thesis, Table 4.  The square
cylinder has b/h = 1, the long one b/h = infinity."""

ADDED_MASS_PRISM: tuple[tuple[float, float], ...] = (
    (1.0, 2.32), (2.0, 0.86), (3.0, 0.62), (4.0, 0.47), (5.0, 0.37), (6.0, 0.29), (7.0, 0.22),
    (10.0, 0.10),
)  # fmt: skip
"""(b/a, K) of a square prism, side a and height b, moving vertically: 1975 thesis, Table A-1."""

DRUM_LAYERS: Mapping[str, tuple[tuple[float, float], ...]] = {
    "american-hoist-1000": (
        (0.87, 109.0), (0.95, 228.0), (1.02, 357.0), (1.10, 495.0), (1.17, 642.0),
        (1.25, 799.0), (1.33, 966.0), (1.40, 1142.0), (1.48, 1328.0), (1.56, 1523.0),
        (1.63, 1728.0), (1.71, 1942.0), (1.78, 2166.0),
    ),
}  # fmt: skip
"""(pitch diameter [m], rope on the drum up to this layer [m]) from the bare drum outwards, for
44 mm rope: 1975 thesis, Table 6."""


def prism_added_mass(side: float, height: float, density: float) -> float:
    """Return the added mass K rho a^2 b [kg] of a square prism that moves vertically.

    K is read from Table A-1 of the 1975 thesis by a power law between its entries, which follows
    the table's steep start (K falls from 2.32 to 0.86 between b/a = 1 and 2) without kinks on
    logarithmic axes.  The table's values for short prisms are above those in use today; give
    `payload.added_mass` where a better figure is known.

    The side of the square is a [m], the height along the motion b [m], the water's density rho
    [kg/m3].

    Raises InputError if b/a lies outside the table, 1 to 10: it is not extrapolated.
    """
    slenderness = check_range(
        "prism", "height / side", height / side,
        low=ADDED_MASS_PRISM[0][0], high=ADDED_MASS_PRISM[-1][0],
    )  # fmt: skip
    ratios, factors = np.log(np.array(ADDED_MASS_PRISM)).T
    factor = math.exp(float(np.interp(math.log(slenderness), ratios, factors)))
    return factor * density * side**2 * height
