"""Share of the year in which the work can be done: contours against a scatter diagram.

    scatter diagram, contour -> workable or not, state by state -> share of the year, of each month

A sea state is workable where its H_s is at most the limit at its T_p (and heading).  A diagram of
classes knows their centres only: its seas are taken to be spread evenly over each class, so that a
limit within a class makes that part of it workable.  Seas whose period lies outside the contour are
not workable: nothing is known of them.

Beside it stand the wave heights at which work stops by rule of thumb: the 1975 thesis, Table 2.
The table is of wave heights, "average maximum waves", not of H_s, and knows no period.  It is read
here as the mean of the highest tenth of the waves, H_1/10 = 1.27 H_s in a Rayleigh sea
(Longuet-Higgins, J. Marine Res. 11, 1952): another reading moves all its figures by one factor.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray
from models.sea import Scatter

from .contour import Contour

HIGHEST_TENTH = 1.27  #: H_1/10 over H_s [-].
_MOST_CLASSES = 80  # of H_s: more are measured heights


RULES: Mapping[str, tuple[float, float]] = {
    "crew boat 20-30 m, crew transfer at a platform": (0.9, 1.5),
    "supervisor's boat 10-16 m, personnel transfer": (0.6, 1.2),
    "cargo vessel at a platform": (0.9, 1.2),
    "cargo vessel at floating equipment": (1.2, 1.5),
    "buoy laying, small derrick barge": (0.6, 0.9),
    "platform building, ship-mounted derrick": (1.2, 1.8),
    "platform building, large derrick barge": (0.9, 1.5),
}
"""Wave heights [m] up to which an operation of the table is safe, and up to which marginal."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Workable:
    """Shares of the time in which one system can work [-]."""

    #: Of the whole diagram: in the case's heading, or in those of the diagram where it has them.
    share: float
    #: The same for a vessel that turns to its best heading in each sea; None without headings.
    best_heading: float | None
    by_month: Mapping[int, float]  #: Share of each month that the diagram knows, by number.
    #: Share in each heading of the contour held all year [rad]: of the waves relative to the bow,
    #: or (where the diagram has directions) of the bow relative to the diagram's axis.
    by_heading: Mapping[float, float]
    outside: float  #: Share of the time whose periods lie outside the contour.
    #: Share of the time lost to each criterion, by name: that of the lowest limit.
    binding: Mapping[str, float]


def workable(contour: Contour, scatter: Scatter, heading: float | None = None) -> Workable:
    """Return the shares of the time in which a contour lets work be done.

    Where it has headings, the vessel's [rad] is the waves' relative to the bow, or (where the
    diagram has directions) the bow's relative to the diagram's axis.
    """
    height, period, share = scatter.significant_height, scatter.peak_period, scatter.occurrence
    width = class_width(scatter)
    known = contour.headings is not None

    def limit_for(turned: float | None) -> FloatArray:
        return contour.at(period, _relative(contour, scatter, turned))

    def kept(limit: FloatArray) -> FloatArray:
        return _part_below(height, width, np.where(np.isfinite(limit), limit, 0.0))

    own = limit_for(heading)
    works = kept(own)
    by_month: dict[int, float] = {}
    if scatter.month is not None:
        for month in np.unique(scatter.month):
            mine = scatter.month == month
            by_month[int(month)] = float(share[mine] @ works[mine] / share[mine].sum())
    by_heading: dict[float, float] = {}
    if contour.headings is not None:
        for angle in contour.headings:
            by_heading[float(angle)] = float(share @ kept(limit_for(float(angle))))
    lost: dict[str, float] = {}
    inside = np.isfinite(own)
    names = contour.binding_at(period, _relative(contour, scatter, heading))
    for name in np.unique(names[inside & (works < 1.0)]):
        mine = inside & (names == name)
        lost[str(name)] = float(share[mine] @ (1.0 - works[mine]))
    return Workable(
        share=float(share @ works),
        best_heading=float(share @ kept(contour.at(period))) if known else None,
        by_month=by_month,
        by_heading=by_heading,
        outside=float(share[~inside].sum()),
        binding=dict(sorted(lost.items(), key=lambda item: -item[1])),
    )


def _relative(contour: Contour, scatter: Scatter, turned: float | None) -> FloatArray | None:
    """Return the heading of the waves to the bow in each sea state (n,) [rad]; None without."""
    if contour.headings is None:
        return None
    if scatter.heading is not None:
        return np.asarray(scatter.heading - (turned or 0.0))
    if contour.headings.size == 1:
        turned = float(contour.headings[0])  # it was the one asked for
    return np.full(scatter.peak_period.size, turned or 0.0)


def rule_shares(scatter: Scatter) -> list[tuple[str, float, float]]:
    """Return the operations of the thesis's Table 2 with the shares safe, and safe or marginal."""
    height, width = scatter.significant_height, class_width(scatter)

    def share(highest_tenth: float) -> float:
        limit = highest_tenth / HIGHEST_TENTH
        return float(scatter.occurrence @ _part_below(height, width, np.full(height.size, limit)))

    return [(name, share(safe), share(marginal)) for name, (safe, marginal) in RULES.items()]


def class_width(scatter: Scatter) -> float:
    """Return the width of the classes of H_s [m]; 0 where the states are no classes.

    Classes are told by their centres: few, and all at multiples of the least distance.
    """
    centres = np.unique(np.round(scatter.significant_height, 9))
    if not 2 < centres.size <= _MOST_CLASSES:
        return 0.0
    steps = np.diff(centres)
    width = float(steps.min())
    even = np.allclose(steps / width, np.round(steps / width), rtol=0.0, atol=1e-3)
    # The lowest class does not reach below a flat sea.
    return width if even and centres[0] >= 0.5 * width * (1.0 - 1e-6) else 0.0


def _part_below(height: FloatArray, width: float, limit: FloatArray) -> FloatArray:
    """Return which part of each sea state lies at or below a limit (n,) [-]."""
    if width == 0.0:
        # A state on the limit is workable, whatever the last digit of either.
        return np.where(height <= limit * (1.0 + 1e-9), 1.0, 0.0)
    return np.clip((limit - height) / width + 0.5, 0.0, 1.0)
