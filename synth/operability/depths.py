"""State and contours of one length of rope paid out: `RopeState`, `AtDepth`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from models.case import Case

from .capability import Capability
from .columns import SeaColumn
from .contour import Contour
from .workable import Workable

STAGES: Mapping[str, str] = {
    "loop": "with the design",
    "held": "with the drum held",
    "perfect": "of a winch that follows the hook perfectly",
    "reoptimised": "with gains found anew for each sea",
}
"""The systems that have contours, in words."""


@dataclass(frozen=True, kw_only=True)
class RopeState:
    """Rope and drum with a length paid out.

    Attributes
    ----------
    length
        Rope paid out [m].
    layer, layers
        Layer of the drum from which the rope leaves, 1 the bare drum, and how many the full drum
        has; 0 where the case gives a radius instead of layers.
    radius
        Pitch radius of the drum [m].
    tension, torque
        Rope tension at the winch [N] and motor torque with the gear's losses [N m], at rest.
    stiffness
        EA/L [N/m].
    """

    length: float
    layer: int
    layers: int
    radius: float
    tension: float
    torque: float
    stiffness: float

    def __str__(self) -> str:
        """Return the state in a line."""
        layer = f"layer {self.layer} of {self.layers}, " if self.layers else ""
        return (
            f"{self.length:g} m: {layer}drum radius {self.radius:.4g} m, torque at rest "
            f"{1e-3 * self.torque:.3g} kN m, stiffness {1e-3 * self.stiffness:.3g} kN/m"
        )


def rope_state(case: Case) -> RopeState:
    """Return the state of rope and drum in a case.

    Raises
    ------
    InputError
        If the drum does not hold so much rope.
    """
    drum, length = case.winch.drum, case.rope.length
    radius = case.drum_radius
    layer = layers = 0
    if drum.radius is None:
        lays = drum.lays(case.rope.diameter)  # the bare drum first
        # Layers that never hold rope, because the drum is not full, do not count.
        layers = sum(1 for k in range(len(lays)) if k == 0 or lays[k - 1][0] > 0.0)
        layer = 1 + next((k for k, (start, _) in enumerate(lays) if length >= start), len(lays) - 1)
    return RopeState(
        length=length,
        layer=layer,
        layers=layers,
        radius=radius,
        tension=case.static_tension,
        torque=case.static_torque_budget,
        stiffness=case.rope.stiffness,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class AtDepth:
    """The contours with one length of rope paid out.

    Attributes
    ----------
    rope
        Length, layer of the drum, torque at rest, stiffness.
    contours
        By name of the system, see `STAGES`: ``loop`` where there is a design, ``held``,
        ``perfect``, and ``reoptimised`` where it was asked for.
    columns
        The seas, one column for each period.
    capability
        The maker's lines: what the winch can follow in regular heave.
    workable
        Shares of the year by name of the system; empty without a scatter diagram.
    max_sensitivity
        M_s of the design's loop with this rope, at the drag of the contour nearest the case's own
        sea; infinite where it is unstable, NaN without a design.
    """

    rope: RopeState
    contours: Mapping[str, Contour]
    columns: tuple[SeaColumn, ...]
    capability: Capability
    workable: Mapping[str, Workable]
    max_sensitivity: float = math.nan

    @property
    def main(self) -> Contour:
        """The design's contour, or that of the held drum where there is no design."""
        return self.contours.get("loop", self.contours["held"])
