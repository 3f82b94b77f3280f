"""Rope: the section of the case file, and its stiffness, mass and weight.

A section holds what the file says; everything derived is a property beside it, so that a changed
field changes all that hangs on it.  The formulas are those of the 1975 thesis, eq. 1.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from ..basics import GRAVITY, SEA_WATER_DENSITY
from ..casefile import Quantity, Section
from .tables import STEEL_DENSITY

_Ratio = Annotated[float, Quantity("ratio", 0.0, 0.5, open_low=True)]
_TENTH = 0.1  # of the damping ratio, which a design holds at as well
_SOLID_STEEL = 2e-4  # damping ratio of a rope that loses no more than solid steel does


class Rope(Section):
    """The rope between the drum and the payload."""

    alternatives = (("modulus", "axial_stiffness"),)

    diameter: Annotated[float, Quantity("length", 0.005, 0.3)]
    """Nominal diameter."""
    modulus: Annotated[float, Quantity("pressure", 1e8, 3e11)] | None = None
    """Young's modulus on the nominal circle of the rope (not on its metal area), or give
    `axial_stiffness`."""
    axial_stiffness: Annotated[float, Quantity("force", 1e4, 1e11)] | None = None
    """Axial stiffness EA of the rope, or give `modulus`. Under the hysteretic law that at the first
    axial mode: a slow pull meets a little less."""
    mass_per_length: Annotated[float, Quantity("mass per length", 0.01, 1000.0)]
    """Mass of the rope per length, in air."""
    submerged_weight_per_length: (
        Annotated[float, Quantity("force per length", 0.0, 10000.0)] | None
    ) = None
    """Weight of the rope per length less its buoyancy; by default that of solid steel in sea
    water."""
    length: Annotated[float, Quantity("length", 1.0, 12000.0)]
    """Length paid out, from the drum to the payload; with falls that of each."""
    falls: Annotated[int, Quantity("count", 1, 40)] = 1
    """Parallel parts of rope that the load hangs on, by a block: it moves by the rope that the drum
    takes in over falls, each part has the load's tension over falls, and what hangs is as many
    times as stiff and as heavy."""
    sheaves: Annotated[int, Quantity("count", 0, 20)] = 0
    """Number of sheaves that the rope runs over between the drum and the load."""
    sheave_efficiency: Annotated[float, Quantity("ratio", 0.8, 1.0)] = 0.98
    """Tension behind a sheave over that before it where the rope runs: bending of the rope and
    friction of the bearing. 0.98 is usual on roller bearings, 0.96 on plain ones."""
    skin_drag_coefficient: Annotated[float, Quantity("ratio", 0.0, 0.2)] = 0.0
    """C_t of the water's drag along the rope, rho C_t pi d v|v| / 2 per length; about 0.01 for wire
    rope.  By default none, which is on the safe side: it calms the load.  In a design it adds to
    payload drag that is `stochastic`; a coefficient that the case gives stands for both."""
    damping_ratio: Annotated[float, Quantity("ratio", 0.0, 0.5)] = 0.002
    """Internal damping as a fraction of critical at the first axial mode."""
    damping_law: Literal["hysteretic", "kelvin-voigt"] = "hysteretic"
    """How damping depends on frequency: `hysteretic`, about the same fraction in all modes, as of
    wire rope, and a design holds with less of it too; or `kelvin-voigt`, a fraction that rises in
    proportion to a mode's frequency, which flatters the higher ones: an exhibit."""
    damping_measured: tuple[_Ratio, _Ratio] | None = None
    """Lowest and highest damping ratio of the first axial mode, where it was measured. A design
    of a hysteretic rope holds at the lowest too; without a measurement at a tenth of
    `damping_ratio`, but at no less than solid steel has, 0.0002."""
    masses: Annotated[int | Literal["auto"], Quantity("count", 1, 40, word="auto")] = "auto"
    """Number of lumped masses that stand for the rope; `auto` takes as many as the bandwidth
    of the loop needs."""
    lumping: Literal["distributed", "thesis"] = "distributed"
    """How the rope's mass is lumped: `distributed` along the rope (a single mass takes a third
    of it), or `thesis`: all of it at the payload, with `masses: 1` only."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        if (self.modulus is None) == (self.axial_stiffness is None):
            given = "both" if self.modulus is not None else "neither"
            yield ("", f"give either modulus or axial_stiffness, got {given}")
        if self.lumping == "thesis" and self.masses != 1:
            text = (
                f"'thesis' puts all of the rope at the payload: needs masses 1, got {self.masses!r}"
            )
            yield ("lumping", text)
        if (
            self.damping_measured is not None
            and self.damping_measured[0] > self.damping_measured[1]
        ):
            low, high = self.damping_measured
            text = f"must be [low, high] with low at most high, got [{low:g}, {high:g}]"
            yield ("damping_measured", text)
        weight = self.submerged_weight_per_length
        if weight is not None and weight > self.mass_per_length * GRAVITY:
            yield (
                "submerged_weight_per_length",
                f"must be at most the weight in air, {self.mass_per_length * GRAVITY:.4g} N/m "
                f"({self.mass_per_length:g} kg/m), got {weight:g} N/m",
            )

    @property
    def least_damping_ratio(self) -> float:
        """Damping ratio of the first axial mode at which a design must hold, besides its own.

        The lowest that was measured, else a tenth of it, as wire rope's damping is not known to
        better than a factor; its own where that is lower.
        """
        least = max(_TENTH * self.damping_ratio, _SOLID_STEEL)
        if self.damping_measured is not None:
            least = self.damping_measured[0]
        return min(least, self.damping_ratio)

    @property
    def area(self) -> float:
        """Area of the nominal circle [m2]."""
        return math.pi * self.diameter**2 / 4.0

    @property
    def ea(self) -> float:
        """Axial stiffness EA [N]."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness
        return (self.modulus or 0.0) * self.area

    @property
    def stiffness(self) -> float:
        """Stiffness K = EA/L of the rope paid out, of all falls [N/m]."""
        return self.falls * self.ea / self.length

    @property
    def mass(self) -> float:
        """Mass of the rope paid out, of all falls [kg]."""
        return self.mass_per_length * self.paid_out

    @property
    def paid_out(self) -> float:
        """Rope that has left the drum, of all falls [m]."""
        return self.falls * self.length

    @property
    def submerged_weight(self) -> float:
        """Weight of the rope paid out less its buoyancy, of all falls [N]."""
        per_length = self.submerged_weight_per_length
        if per_length is None:
            buoyancy = 1.0 - SEA_WATER_DENSITY / STEEL_DENSITY
            per_length = self.mass_per_length * GRAVITY * buoyancy
        return per_length * self.paid_out

    @property
    def sheaves_efficiency(self) -> float:
        """Tension behind all sheaves over that before them where the rope runs [-]."""
        return self.sheave_efficiency**self.sheaves

    @property
    def skin_drag_area(self) -> float:
        """Area that drag along the rope acts on, per length, C_t pi d of all falls [m]."""
        return self.falls * self.skin_drag_coefficient * math.pi * self.diameter

    @property
    def wave_speed(self) -> float:
        """Speed of axial waves along the rope, sqrt(EA / mass per length) [m/s]."""
        return math.sqrt(self.ea / self.mass_per_length)

    @property
    def travel_time(self) -> float:
        """Time that an axial wave takes from the drum to the payload [s]."""
        return self.length / self.wave_speed
