"""A simple ship from its main dimensions: hull lines of our own.

Not the lines of any ship that was built, but a surface with the right displacement, waterplane
and lengths, which is what first motions hang on.  Each cross section is a superellipse

    |y / b|^n + |z / d|^n = 1,    z <= 0,

of half-breadth b, depth d and fullness n, which change along the ship:

    b   half the beam along the parallel body; it closes to the stem over the entrance, and to the
        transom over the run
    d   the draught; over the run the bottom rises to the transom
    n   from the midship coefficient; towards the stem and the transom the sections are finer

Entrance and run are as long as it takes to reach the block coefficient; where they meet amidships
and the ship is still too full, their waterlines get straighter.  They are found on the panels
themselves, so that the displacement is what was asked whatever the number of panels.
"""

import math
from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln

from ...basics import FloatArray, InputError, check_range
from .hull import Hull, patch, volumes

_RUN = 0.8  # length of the run over that of the entrance
_ENDS = (2.0, 1.1)  # how full waterlines of the ends are: 2 a parabola, 1 a wedge
_STEM = 1.8  # fullness n of the sections at the stem: slightly hollow beside an ellipse
_STERN = 3.0  # and at the transom
_ENTRANCE = (0.04, 1.0 / (1.0 + _RUN))  # over the ship's length, shortest and longest


@dataclass(frozen=True, kw_only=True)
class ShipLines:
    """Main dimensions of a simple ship.

    Raises InputError if a dimension is out of range.  A block coefficient that these lines cannot
    have is told by :meth:`hull`.

    Examples
    --------
    >>> lines = ShipLines(length=80.0, beam=18.0, draught=6.0, block=0.7)
    >>> hull = lines.hull(panels=300)
    >>> round(lines.block * 80.0 * 18.0 * 6.0, 1)
    6048.0
    >>> from models.vessel.hull.hydrostatics import Waterplane
    >>> round(Waterplane.of(hull).volume, 1)
    6048.0
    """

    length: float  #: Of the waterline [m].
    beam: float  #: Of the waterline [m].
    draught: float  #: Down to the keel [m].
    block: float = 0.70  #: Block coefficient: displaced volume over length x beam x draught [-].
    midship: float = 0.96  #: Area of the midship section over beam x draught [-].
    #: Of the transom, over the beam [-]; none: a stern as sharp as the bow.
    transom_width: float = 0.9
    transom_depth: float = 0.3  #: Of the transom, over the draught [-].

    def __post_init__(self) -> None:
        """Check each dimension."""
        check_range("ship", "length", self.length, low=1.0, high=1000.0, unit="m")
        check_range("ship", "beam", self.beam, low=0.2, high=200.0, unit="m")
        check_range("ship", "draught", self.draught, low=0.1, high=100.0, unit="m")
        check_range("ship", "block", self.block, low=0.3, high=0.98)
        check_range("ship", "midship", self.midship, low=0.7, high=0.998)
        check_range("ship", "transom_width", self.transom_width, low=0.0, high=1.0)
        check_range("ship", "transom_depth", self.transom_depth, low=0.05, high=1.0)

    def hull(self, *, panels: int = 400, name: str | None = None) -> Hull:
        """Return the wetted surface in some `panels`, called after its dimensions by default.

        Raises InputError if no entrance and run give the block coefficient.
        """
        check_range("ship", "panels", panels, low=40, high=20_000)
        wanted = self.block * self.length * self.beam * self.draught

        def surplus(fineness: float) -> float:
            return float(volumes(self._surface(fineness, panels))[2]) / wanted - 1.0

        fullest, finest = surplus(0.0), surplus(2.0)
        if not fullest > 0.0 > finest:
            low, high = ((1.0 + s) * self.block for s in (finest, fullest))
            raise InputError(
                f"ship: block must be in ({low:.3f}, {high:.3f}) with this midship section and "
                f"transom, got {self.block:g}"
            )
        fineness = float(brentq(surplus, 0.0, 2.0, xtol=1e-12))
        return Hull(
            name=name or f"ship {self.length:g} x {self.beam:g} x {self.draught:g} m",
            panels=self._surface(fineness, panels),
            inputs={"shape": "ship", **asdict(self), "panels": int(panels)},
        )

    def _surface(self, fineness: float, panels: int) -> FloatArray:
        """Return the panels for a given fineness of the ends.

        From 0 to 1 entrance and run get longer, from 1 to 2 their waterlines get straighter.
        """
        short, long = _ENTRANCE
        entrance = short + (long - short) * min(fineness, 1.0)
        parabola, wedge = _ENDS
        power = parabola + (wedge - parabola) * max(fineness - 1.0, 0.0)
        girth = self.beam + 2.0 * self.draught
        size = math.sqrt(0.9 * self.length * girth / panels)
        side = max(2, round(self.draught / size))
        bottom = max(2, round(self.beam / 2.0 / size))
        stations = 1 + max(6, round(panels / (2.0 * (side + bottom))))
        t = np.linspace(-1.0, 1.0, stations)
        # Somewhat closer at the ends, where the shape changes.
        along = 0.5 * (0.7 * t + 0.3 * np.sin(0.5 * math.pi * t))
        breadth, depth, fullness = self._shape(along, entrance, power)
        starboard = np.empty((side + bottom + 1, stations, 3))
        for i, u in enumerate(along):
            y, z = _section(breadth[i], depth[i], fullness[i], side, bottom)
            starboard[:, i] = np.stack([np.full_like(y, u * self.length), -y, z], axis=1)
        found = [patch(starboard), patch(_mirrored(starboard)[:, ::-1])]
        if self.transom_width > 1e-6:
            corner = _transom(starboard[:, 0], side)
            found += [patch(corner), patch(_mirrored(corner)[:, ::-1])]
        return np.concatenate(found)

    def _shape(
        self, along: FloatArray, entrance: float, power: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return half-breadth [m], depth [m] and fullness of the sections at x / length."""
        fore = np.clip((along - (0.5 - entrance)) / entrance, 0.0, 1.0)
        run = _RUN * entrance
        aft = np.clip((run - 0.5 - along) / run, 0.0, 1.0)
        breadth = (1.0 - fore**power) * (1.0 - (1.0 - self.transom_width) * aft**power)
        depth = 1.0 - (1.0 - self.transom_depth) * aft**1.5
        middle = section_exponent(self.midship)
        fullness = middle + (_STEM - middle) * fore + (min(_STERN, middle) - middle) * aft
        return 0.5 * self.beam * breadth, self.draught * depth, fullness


def section_coefficient(exponent: float) -> float:
    """Return the area of a superellipse over that of the box around it [-].

    Gamma(1 + 1/n)^2 / Gamma(1 + 2/n): 1/2 for a wedge (n = 1), pi/4 for an ellipse (n = 2).

    Examples
    --------
    >>> round(section_coefficient(1.0), 6), round(4.0 * section_coefficient(2.0), 6)
    (0.5, 3.141593)
    """
    n = exponent
    return math.exp(2.0 * float(gammaln(1.0 + 1.0 / n)) - float(gammaln(1.0 + 2.0 / n)))


def section_exponent(coefficient: float) -> float:
    """Return the exponent of the superellipse with this area coefficient."""
    return float(brentq(lambda n: section_coefficient(n) - coefficient, 0.5, 200.0, xtol=1e-12))


def _section(
    breadth: float, depth: float, fullness: float, side: int, bottom: int
) -> tuple[FloatArray, FloatArray]:
    """Return points of a section from the waterline to the keel: half-breadths and heights [m].

    Equal arcs from the waterline to the corner where y / b = -z / d, and from there to the keel,
    so that the points of neighbouring sections belong together.
    """
    angle = np.linspace(0.0, 0.5 * math.pi, 2001)
    # Near 0 and pi/2 a full section's points crowd; the arc between them is straight there.
    y = breadth * np.cos(angle) ** (2.0 / fullness)
    z = -depth * np.sin(angle) ** (2.0 / fullness)
    y[-1] = 0.0
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    corner = arc[1000]
    wanted = np.concatenate(
        [np.linspace(0.0, corner, side + 1), np.linspace(corner, arc[-1], bottom + 1)[1:]]
    )
    return np.interp(wanted, arc, y), np.interp(wanted, arc, z)


def _transom(section: FloatArray, side: int) -> FloatArray:
    """Return a grid of points on half the transom, between centreline, waterline and section.

    A Coons patch: straight along the waterline and the centreline, the section on the other two
    sides, whose common corner is the section's own.
    """
    outer, lower = section[: side + 1], section[side:][::-1]  # waterline to corner; keel to corner
    waterline = outer[0] * np.array([1.0, 0.0, 1.0])
    q = np.linspace(0.0, 1.0, side + 1)[:, None, None]  # down
    p = np.linspace(0.0, 1.0, len(lower))[None, :, None]  # out from the centreline
    top = waterline + p * (outer[0] - waterline)
    inner = waterline + q * (lower[0] - waterline)
    corners = (
        (1 - p) * (1 - q) * waterline
        + p * (1 - q) * outer[0]
        + (1 - p) * q * lower[0]
        + p * q * outer[-1]
    )
    grid = (1 - q) * top + q * lower[None] + (1 - p) * inner + p * outer[:, None] - corners
    # Seen from astern, starboard is on the right.
    return np.asarray(grid, dtype=np.float64)


def _mirrored(points: FloatArray) -> FloatArray:
    return np.asarray(points * np.array([1.0, -1.0, 1.0]), dtype=np.float64)
