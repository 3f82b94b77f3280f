"""The plants of a family as synthesis sees them: from a member to its scenario.

Family + structure -> FamilyPlants -> FamilyLoop of a member, PlantStack of many
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from models.basics import FloatArray, Quadrature, spectral_nodes
from models.case import Case
from models.sensing import sensed_plant

from ..loop import Assessment
from ..question import PAYLOAD_FEEDBACK, DesignQuestion, FamilyLoop, FamilyQuestion
from ..structures import ParametrisedController
from .family import Family, Member
from .plant_stack import PlantStack, numbers_of, stacked_members


class FamilyPlants:
    """A family with a controller structure, posed member by member.

    Parameters
    ----------
    family
        The family.
    structure
        Name of the structure.
    masses
        Rope masses of every plant; by default what each case asks for.
    """

    def __init__(
        self, family: Family, structure: str = PAYLOAD_FEEDBACK, masses: int | None = None
    ) -> None:
        self.family = family
        self.posed = FamilyQuestion(family.case_at(family.nominal()[0]), structure, masses)
        self._cases: dict[Member, Case] = {}
        self._scenarios: dict[Member, FamilyLoop] = {}

    @property
    def structure(self) -> str:
        """Name of the structure."""
        return self.posed.structure

    @property
    def nominal(self) -> DesignQuestion:
        """The question of the nominal member in the first sea."""
        return self.posed.nominal

    @property
    def law(self) -> ParametrisedController:
        """The controller's law, bound to the nominal plant."""
        return self.posed.law

    @property
    def guesses(self) -> list[list[float]]:
        """The gains in use, if the case has any that are this structure's."""
        return self.posed.guesses

    def for_assessed(
        self, members: Sequence[Member], assessments: Sequence[Assessment]
    ) -> FamilyPlants:
        """Return the family on as many rope masses as loops of its members ask for."""
        masses = self.posed.masses_wanted([self._case(m) for m in members], assessments)
        if masses <= self.posed.most_masses:
            return self
        return FamilyPlants(self.family, self.structure, masses)

    def question(self, member: Member) -> DesignQuestion:
        """Return the question of a member."""
        return self.posed.question(self._case(member))

    def scenario(self, member: Member) -> FamilyLoop:
        """Return the scenario of a member, its weight the sea's occurrence."""
        if member not in self._scenarios:
            self._scenarios[member] = self.posed.loop(
                self._case(member),
                self.family.name_of(member),
                float(self.family.occurrence[member.sea]),
            )
        return self._scenarios[member]

    def stack(self, members: Sequence[Member]) -> PlantStack:
        """Return the plants of many members at once, all with the most rope masses."""
        masses = self.posed.masses or self.posed.most_masses
        if self.structure == PAYLOAD_FEEDBACK:
            return stacked_members(self.family, members, masses)
        case = self.family.case
        fixed = case.payload.fixed_drag
        numbers = numbers_of(self.family, members)
        plants = [
            sensed_plant(one, masses=masses, drag=fixed or 0.0, sensors=case.sensors)
            for one in numbers
        ]
        quadratic = [one.quadratic_drag if fixed is None else 0.0 for one in numbers]
        return replace(
            PlantStack.of(plants),
            quadratic_drag=np.array(quadratic),
            linear_drag=np.full(len(members), fixed or 0.0),
        )

    @cached_property
    def _shaken(self) -> tuple[Quadrature, dict[str, FloatArray]]:
        """Common nodes, and each disturbance's density there in each sea, (seas, nodes)."""
        nominal = self.family.nominal()[0]
        members = [replace(nominal, sea=k) for k in range(len(self.family.seas))]
        seas = [self.scenario(member).problem.disturbances for member in members]
        every = [d for sources in seas for d in sources]
        bands = [d.band for d in every if d.band is not None]
        nodes = spectral_nodes(
            min(b[0] for b in bands),
            max(b[1] for b in bands),
            splits=sorted({w for d in every for w in d.splits}),
            half_line=len(bands) < len(every),
        )
        return nodes, {
            d.name: np.stack([sources[k].density(nodes.omega) for sources in seas])
            for k, d in enumerate(seas[0])
        }

    def shaken(self, members: Sequence[Member]) -> tuple[Quadrature, dict[str, FloatArray]]:
        """Return common nodes, and each disturbance's density there for each member."""
        nodes, densities = self._shaken
        which = np.array([m.sea for m in members])
        return nodes, {name: density[which] for name, density in densities.items()}

    def _case(self, member: Member) -> Case:
        if member not in self._cases:
            self._cases[member] = self.family.case_at(member)
        return self._cases[member]
