"""Crane and rigging: the sections of the case file for what gives besides the rope.

Both stand in series with the rope: the boom's tip above it, between the vessel and the sheave
that the rope hangs from, the slings below it, between hook block and payload.  DNV-RP-N103 has
them as one stiffness, 1/K = 1/k_crane + 1/k_rope + 1/k_slings; here they are members of the chain.
"""

import math
from typing import Annotated

from ..basics import GRAVITY, SEA_WATER_DENSITY
from ..casefile import Quantity, Section
from .tables import STEEL_DENSITY


class Crane(Section):
    """What the rope hangs from."""

    tip_stiffness: Annotated[float, Quantity("stiffness", 1e4, 1e12)] | None = None
    """Vertical stiffness of the boom's tip under the hanging rope; none: rigid. The lead to the
    winch runs along the boom, whose length keeps: it neither loads the tip nor feels it move."""

    @property
    def stiffness(self) -> float:
        """Stiffness of the tip [N/m], infinite where it is rigid."""
        return math.inf if self.tip_stiffness is None else self.tip_stiffness


class Rigging(Section):
    """What hangs between the rope's lower end and the payload."""

    stiffness: Annotated[float, Quantity("stiffness", 1e4, 1e12)] | None = None
    """Vertical stiffness of the slings, all together; none: rigid."""
    block_mass: Annotated[float, Quantity("mass", 0.0, 1e6)] = 0.0
    """Mass of hook block and hook, between rope and slings; its weight is that of steel in sea
    water. Without `stiffness` it moves with the payload."""

    @property
    def sling_stiffness(self) -> float:
        """Stiffness of the slings [N/m], infinite where they are rigid."""
        return math.inf if self.stiffness is None else self.stiffness

    @property
    def block_weight(self) -> float:
        """Weight of the hook block less its buoyancy [N]."""
        return self.block_mass * GRAVITY * (1.0 - SEA_WATER_DENSITY / STEEL_DENSITY)
