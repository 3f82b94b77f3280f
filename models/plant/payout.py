"""Rope paid out and the drum's radius as functions of the motor's angle.

Holding station the rope keeps its length and the drum its radius, which is what the linear
plant assumes.  Over a lowering the rope grows, and the drum's radius falls from layer to layer.
Within a layer the haul is proportional to the angle, so over several it is a continuous,
piecewise linear function of it, written here with hinges max(0, angle - angle_j): exact, and
differentiable wherever the radius is.  `models.plant.equations` uses it where the plant is asked to
pay out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from ..case import Case


@dataclass(frozen=True, kw_only=True)
class DrumTravel:
    """Where, seen from the static position, the rope's layer on the drum changes.

    Each pair of `inward` and `outward` is where that happens, as a positive number of haul in or
    paid out, ascending [m], and the radius from there on [m].
    """

    outward: tuple[tuple[float, float], ...] = ()
    inward: tuple[tuple[float, float], ...] = ()

    @classmethod
    def from_case(cls, case: Case) -> DrumTravel:
        """Return the layer changes around the rope length of a case."""
        paid_out, falls = case.rope.length, case.rope.falls
        # Innermost first, by falling rope paid out; as the load moves.
        lays = [(s / falls, r / falls) for s, r in case.winch.drum.lays(case.rope.diameter)]
        here = next((i for i, (start, _) in enumerate(lays) if paid_out >= start), len(lays) - 1)
        outward = tuple(
            (paid_out - lays[i - 1][0], lays[i][1])
            for i in range(here + 1, len(lays))
            if lays[i - 1][0] > 0.0
        )
        inward = tuple((lays[i][0] - paid_out, lays[i][1]) for i in range(here - 1, -1, -1))
        return cls(outward=outward, inward=inward)

    def haul(self, angle: ca.SX, radius: ca.SX, ratio: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return (rope hauled in [m], radius in use [m]) at a motor angle from rest [rad].

        Hauling in is positive; the radius given is that at angle zero [m], the ratio turns of the
        motor per turn of the drum.
        """
        turned = angle / ratio  # of the drum [rad]
        haul, in_use = radius * turned, radius
        for sign, changes in ((1.0, self.outward), (-1.0, self.inward)):
            at, before, last = ca.SX(0), radius, 0.0
            for travel, after in changes:
                at = at + (travel - last) / before
                excess = ca.fmax(0, sign * turned - at)
                haul = haul + sign * (after - before) * excess
                in_use = in_use + (after - before) * (excess > 0)
                before, last = ca.SX(after), travel
        return haul, in_use
