"""Check of a contour by single evaluations: the same sea put into the case, one at a time.

    sea on the contour -> case in that sea -> its own plant and nodes -> value against bound,
                                                         drag coefficient against the motion

Nothing of this room is used: neither the update of low rank nor its nodes nor its root search.
"""

from dataclasses import dataclass

import numpy as np

from models.case import Case

from ..design import Design
from ..loop import Assessment
from ..question import pose
from .depths import AtDepth

_TOLERANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class ContourCheck:
    """One point of a contour, evaluated once more."""

    #: The sea: T_p [s], heading [rad] or None, the limiting H_s [m].
    period: float
    heading: float | None
    height: float
    criterion: str  #: What binds there.
    #: Of the criterion, by the single evaluation, and what it may be.
    value: float
    bound: float
    #: Drag coefficient of the contour, and of the single evaluation [N s/m].
    drag: float
    agreed: float

    @property
    def difference(self) -> float:
        """Relative difference of value and bound, or of the two drags where it is larger [-]."""
        scale = abs(self.bound) if self.bound != 0.0 else 1.0
        still = abs(self.drag - self.agreed) / self.drag if self.drag > 0.0 else 0.0
        return max(abs(self.value - self.bound) / scale, still)

    @property
    def ok(self) -> bool:
        """Whether the value meets the bound to 1e-6."""
        return self.difference <= _TOLERANCE


def evaluate_in(design: Design, case: Case, masses: int | None = None) -> Assessment:
    """Return a design's loop, its parameters kept, in the sea of a case, on its vessel and rope."""
    case, masses = case.variant({"limits.drive": "report"}), masses or design.masses
    question = pose(case, design.structure, masses, built_for=design.built_for)
    return question.assess(design.parameters)


def recheck(design: Design, at: AtDepth, count: int) -> tuple[ContourCheck, ...]:
    """Return the binding criterion at some points of a design's contour by single evaluations.

    They are spread over it; fewer where fewer have a limit.
    """
    contour = at.contours["loop"]
    limit = contour.limit
    known = np.argwhere(np.isfinite(limit) & (limit > 0.0) & (contour.binding != "stability"))
    found = []
    for place in np.unique(np.linspace(0, len(known) - 1, count).astype(int)) if len(known) else ():
        h, p = known[place]
        k = int(contour.heights[:, h, p].argmin())
        criterion = contour.criteria[k]
        height = float(limit[h, p])
        case = at.columns[p].cases[h].replace({"sea.significant_height": height})
        drag = float(contour.drag[h, p])
        assessment = evaluate_in(design, case, at.masses)
        # A coefficient that the case fixes agrees with itself.
        fixed = case.payload.fixed_drag is not None
        found.append(
            ContourCheck(
                period=float(contour.periods[p]),
                heading=None if contour.headings is None else float(contour.headings[h]),
                height=height,
                criterion=criterion.name,
                value=criterion.worst(assessment),
                bound=criterion.bound,
                drag=drag,
                agreed=drag if fixed else assessment.coefficients[0],
            )
        )
    return tuple(found)
