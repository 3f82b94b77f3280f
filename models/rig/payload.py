"""Payload: the section of the case file, its virtual mass and its drag.

A section holds what the file says; everything derived is a property beside it, so that a changed
field changes all that hangs on it.  The formulas are those of the 1975 thesis, eq. 5 and 13.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from ..basics import GRAVITY, SEA_WATER_DENSITY
from ..casefile import Quantity, Section
from .tables import DRAG_COEFFICIENTS, prism_added_mass


class GivenDrag(Section):
    """A linear drag coefficient that is given."""

    method: Literal["given"]
    """`given`: the linear drag coefficient is known."""
    coefficient: Annotated[float, Quantity("damping", 0.0, 1e9)]
    """Linear drag coefficient C of the payload."""


class EnergyDrag(Section):
    """Linear drag that takes the same energy from a sine of a given amplitude."""

    method: Literal["energy"]
    """`energy`: linear drag that dissipates what quadratic drag would in a sine."""
    amplitude: Annotated[float, Quantity("length", 0.0, 100.0)]
    """Amplitude of the payload's sine."""
    frequency: Annotated[float, Quantity("frequency", 0.0, 100.0, open_low=True)]
    """Frequency of the payload's sine."""


class StochasticDrag(Section):
    """Linear drag found together with the response that it belongs to."""

    method: Literal["stochastic"] = "stochastic"
    """`stochastic`: linear drag consistent with the payload's own speed in the sea."""


Drag = Annotated[GivenDrag | EnergyDrag | StochasticDrag, Field(discriminator="method")]


class Prism(Section):
    """A square prism that stands for the payload's shape."""

    prism_side: Annotated[float, Quantity("length", 0.1, 100.0)]
    """Side a of the square."""
    prism_height: Annotated[float, Quantity("length", 0.1, 200.0)]
    """Height b along the motion; b/a from 1 to 10 (Table A-1)."""


class Payload(Section):
    """The load at the lower end of the rope."""

    alternatives = (("added_mass", "shape"), ("drag_coefficient", "drag_shape"))

    mass: Annotated[float, Quantity("mass", 1.0, 1e8)]
    """Mass in air, without entrained water."""
    added_mass: Annotated[float, Quantity("mass", 0.0, 1e9)] | None = None
    """Hydrodynamic added mass in heave, or give `shape`."""
    shape: Prism | None = None
    """A square prism whose added mass is read from the 1975 thesis, Table A-1, or give
    `added_mass`."""
    area: Annotated[float, Quantity("area", 0.0, 1e4)]
    """Area projected on the horizontal plane, for the drag."""
    drag_coefficient: Annotated[float, Quantity("ratio", 0.0, 10.0)] | None = None
    """Quadratic drag coefficient C_D, or give `drag_shape`."""
    drag_shape: (
        Literal[
            "long-square-cylinder",
            "square-cylinder",
            "disc",
            "hemisphere-open-to-flow",
            "hemisphere-open-downstream",
            "c-section-open-to-flow",
            "c-section-open-downstream",
        ]
        | None
    ) = None
    """A shape whose drag coefficient is read from the 1975 thesis, Table 4, or give
    `drag_coefficient`."""
    water_density: Annotated[float, Quantity("density", 900.0, 1300.0)] = SEA_WATER_DENSITY
    """Density of the water."""
    submerged_weight: Annotated[float, Quantity("force", 1.0, 1e9)]
    """Weight in water: what the rope's lower end carries at rest."""
    weight_uncertainty: Annotated[float, Quantity("ratio", 0.0, 0.5)] = 0.05
    """By how much of itself the submerged weight may be less than stated: a rope goes slack
    first at its lower end, and first with the lightest load."""
    drag: Drag = StochasticDrag()
    """How quadratic drag is linearised for the design."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        for one, other in self.alternatives:
            given = [getattr(self, name) is not None for name in (one, other)]
            if sum(given) != 1:
                word = "both" if all(given) else "neither"
                yield ("", f"give either {one} or {other}, got {word}")
        if self.shape is not None:
            ratio = self.shape.prism_height / self.shape.prism_side
            if not 1.0 <= ratio <= 10.0:
                text = f"prism_height / prism_side must be in [1, 10] (Table A-1), got {ratio:.3g}"
                yield ("shape", text)
        if self.submerged_weight > self.mass * GRAVITY:
            text = (
                f"must be at most the weight in air, {self.mass * GRAVITY:.4g} N "
                f"({self.mass:g} kg), got {self.submerged_weight:g} N"
            )
            yield ("submerged_weight", text)

    @property
    def hydrodynamic_mass(self) -> float:
        """Added mass, given or from Table A-1 [kg]."""
        if self.shape is None:
            return 0.0 if self.added_mass is None else self.added_mass
        shape = self.shape
        return prism_added_mass(shape.prism_side, shape.prism_height, self.water_density)

    @property
    def virtual_mass(self) -> float:
        """Mass and added mass [kg]."""
        return self.mass + self.hydrodynamic_mass

    @property
    def least_weight(self) -> float:
        """Least submerged weight [N]."""
        return self.submerged_weight * (1.0 - self.weight_uncertainty)

    @property
    def taut_tension(self) -> float:
        """Tension that is to stay in the rope's lower end, a tenth of the least weight [N].

        DNV-RP-N103 asks for it in a lift through the wave zone; here it is taken by analogy.
        """
        return 0.1 * self.least_weight

    @property
    def c_d(self) -> float:
        """Drag coefficient C_D, given or from Table 4 [-]."""
        if self.drag_shape is not None:
            return DRAG_COEFFICIENTS[self.drag_shape]
        return 0.0 if self.drag_coefficient is None else self.drag_coefficient

    @property
    def quadratic_drag(self) -> float:
        """Factor of V|V| in the drag, rho C_D A / 2 [N s2/m2] (1975 thesis, eq. 5)."""
        return 0.5 * self.water_density * self.c_d * self.area

    @property
    def fixed_drag(self) -> float | None:
        """Linear drag coefficient [N s/m], or None where it depends on the response."""
        drag = self.drag
        if isinstance(drag, EnergyDrag):
            return energy_equivalent(self.quadratic_drag, drag.amplitude, drag.frequency)
        return drag.coefficient if isinstance(drag, GivenDrag) else None


def energy_equivalent(quadratic: float, amplitude: float, frequency: float) -> float:
    """Return the C that takes as much energy as q v|v| from a sine [N s/m].

    C = 8/(3 pi) q omega Y = 4/(3 pi) rho C_D A omega Y (1975 thesis, eq. 13).  Y is the
    displacement's amplitude [m], omega its frequency [rad/s], and q is rho C_D A / 2 [N s2/m2].
    """
    return 8.0 / (3.0 * math.pi) * quadratic * frequency * amplitude
