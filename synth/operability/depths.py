"""State and contours of one length of rope paid out: `AtDepth`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from models.basics import FloatArray
from models.case import Case

from .capability import Capability
from .columns import SeaColumn
from .contour import Contour
from .record_limits import fine_contours
from .workable import Workable

STAGES: Mapping[str, str] = {
    "loop": "with the design",
    "held": "with the drum held",
    "perfect": "of a winch that follows the hook perfectly",
    "reoptimised": "with gains found anew for each sea",
}
"""The systems that have contours, in words."""


def drum_layer(case: Case) -> tuple[int, int]:
    """Return the layer of the drum from which the rope leaves, and how many the full drum has.

    The bare drum is 1; both are 0 where the case gives a radius instead of layers.

    Raises InputError if the drum does not hold so much rope.
    """
    drum, length = case.winch.drum, case.rope.paid_out
    if drum.radius is not None:
        return 0, 0
    lays = drum.lays(case.rope.diameter)  # the bare drum first
    # Layers that never hold rope, because the drum is not full, do not count.
    layers = sum(1 for k in range(len(lays)) if k == 0 or lays[k - 1][0] > 0.0)
    return 1 + next(
        (k for k, (start, _) in enumerate(lays) if length >= start), len(lays) - 1
    ), layers


@dataclass(frozen=True, kw_only=True)
class OwnSea:
    """What the case's own sea says: of its H_s, peak period and heading, between no points."""

    limit: float  #: The limiting H_s at its period and heading [m].
    binding: str  #: Name of the criterion that sets it; empty where none does.
    #: Names of the criteria that are broken in it, by the rule and the tolerance of designs.
    broken: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class AtDepth:
    """The contours with one length of rope paid out."""

    #: The case with this length of rope paid out, its limits reported rather than enforced.
    case: Case
    #: Of the drum, see `drum_layer`.
    layer: int
    layers: int
    #: By name of the system, see `STAGES`: ``loop`` where there is a design, ``held``, ``perfect``,
    #: and ``reoptimised`` where it was asked for.
    contours: Mapping[str, Contour]
    columns: tuple[SeaColumn, ...]  #: The seas, one column for each period.
    #: Gains of the systems' signals by name, with which `fine` goes between the seas.
    gains: Mapping[str, FloatArray]
    capability: Capability  #: The maker's lines: what the winch can follow in regular heave.
    #: Shares of the year by name of the system; empty without a scatter diagram.
    workable: Mapping[str, Workable]
    own: OwnSea  #: The case's own sea, with the design or else with the drum held.
    masses: int  #: Rope masses of the design's loop.
    #: M_s of the design's loop with this rope, at the drag in the case's own sea; infinite where it
    #: is unstable, NaN without a design.
    max_sensitivity: float = math.nan

    def __str__(self) -> str:
        """Return the state of rope and drum in a line."""
        layer = f"layer {self.layer} of {self.layers}, " if self.layers else ""
        torque, stiffness = self.case.static_torque_budget, self.case.rope.stiffness
        return (
            f"{self.length:g} m: {layer}drum radius {self.case.drum_radius:.4g} m, torque at rest "
            f"{1e-3 * torque:.3g} kN m, stiffness {1e-3 * stiffness:.3g} kN/m"
        )

    @property
    def length(self) -> float:
        """Rope paid out [m]."""
        return self.case.rope.length

    @cached_property
    def fine(self) -> Mapping[str, Contour]:
        """The contours every few degrees and half a second, for seas between their points."""
        return fine_contours(self.contours, self.columns, self.gains)

    @property
    def main(self) -> Contour:
        """The design's contour, or that of the held drum where there is no design."""
        return self.contours.get("loop", self.contours["held"])
