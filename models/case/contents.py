"""Contents of a case: its sections, and the statics that follow from several of them."""

import math
from typing import Annotated, Literal

from pydantic import Field

from ..casefile import LINE, LINES, Section
from ..rig import Crane, GainBounds, Gains, Limits, Payload, Rigging, Rope, Sensors, Winch
from ..sea import Sea
from ..vessel import Vessel


class Contents(Section):
    """What stands in a case file, each section checked by itself."""

    stillhook: Literal[1]
    """Version of the case format."""
    name: Annotated[str, Field(min_length=1, max_length=100), LINE]
    """Name of the case."""
    description: Annotated[str, LINES] = ""
    """What the case is, in a sentence or two."""
    sources: dict[Annotated[str, LINE], Annotated[str, LINES]] | None = None
    """Where the figures come from: free text under free keys."""
    sea: Sea
    """The sea state."""
    vessel: Vessel
    """The vessel: the heave of its hook, or its RAOs and the hook's place."""
    rope: Rope
    """The rope between the drum and the payload."""
    crane: Crane = Crane()
    """What the rope hangs from: a boom that gives under the load."""
    rigging: Rigging = Rigging()
    """Hook block and slings between the rope and the payload."""
    payload: Payload
    """The load at the lower end of the rope."""
    winch: Winch
    """Drum, gearbox, motor and drive."""
    sensors: Sensors = Sensors()
    """What is measured, and how."""
    limits: Limits = Limits()
    """What a design has to respect."""
    gains: Gains | None = None
    """Gains in use, if any: command = set-point - A (a P'' + a1 P' + a2 P), P in metres, the
    command in V (DC motor), rad/s (AC with a speed regulator) or N m (AC without)."""
    gain_bounds: GainBounds | None = None
    """Lowest and highest value of the gains, if bounded."""

    @property
    def drum_radius(self) -> float:
        """Pitch radius of the drum with the rope paid out [m]."""
        return self.winch.drum.radius_at(self.rope.paid_out, self.rope.diameter)

    @property
    def haul_radius(self) -> float:
        """How far the load moves with a radian of the drum: its radius over the falls [m]."""
        return self.drum_radius / self.rope.falls

    @property
    def static_tension(self) -> float:
        """Rope tension at rest above payload, block and rope in water, of each fall [N]."""
        return self.hung_weight / self.rope.falls

    @property
    def hung_weight(self) -> float:
        """Weight of payload, hook block and rope in water [N]."""
        block = self.rigging.block_weight
        return self.payload.submerged_weight + block + self.rope.submerged_weight

    @property
    def least_tension(self) -> float | None:
        """Smallest tension that a limit allows in all falls together [N]; None if there is none."""
        given = self.limits.minimum_tension
        if given is None and self.limits.tension_ends == "both":
            return self.payload.taut_tension
        return given

    @property
    def static_torque(self) -> float:
        """Motor torque that holds the static tension, without losses [N m]."""
        return self.static_tension * self.drum_radius / self.winch.gearbox.ratio

    @property
    def static_torque_budget(self) -> float:
        """Motor torque that raises the static tension through losses of gear and sheaves [N m]."""
        return self.static_torque / (self.winch.gearbox.efficiency * self.rope.sheaves_efficiency)

    @property
    def static_tension_budget(self) -> float:
        """Rope tension at the drum that raises the static tension over the sheaves [N]."""
        return self.static_tension / self.rope.sheaves_efficiency

    @property
    def moving_mass(self) -> float:
        """Mass of the one-spring model: payload, added mass, hook block, the rope's share [kg].

        A third of the rope, or all of it with the thesis's lumping.
        """
        share = 1.0 if self.rope.lumping == "thesis" else 1.0 / 3.0
        return self.payload.virtual_mass + self.rigging.block_mass + share * self.rope.mass

    @property
    def chain_stiffness(self) -> float:
        """Stiffness of tip, rope and slings in series [N/m]."""
        crane, rigging = self.crane.stiffness, self.rigging.sling_stiffness
        if math.isinf(crane) and math.isinf(rigging):
            return self.rope.stiffness
        return 1.0 / (1.0 / crane + 1.0 / self.rope.stiffness + 1.0 / rigging)
