"""The plants of a family as synthesis sees them: from a member to its scenario.

    Family + structure -> FamilyPlants -> FamilyLoop of a member, PlantStack of many

The controller is one: its law is bound to the family's nominal plant and used around every
member.  Members that differ in nothing but the sea share their plant where drag is fixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from models.basics import FloatArray, Quadrature, spectral_nodes
from models.plant import LinearPlant
from models.sensing import sensed_plant, sensed_spectra

from ..loop import Disturbance, disturbances
from ..question import HOOK, PAYLOAD, DesignQuestion, FamilyLoop, Problem, pose
from ..structures import ParametrisedController, Structure, structure_named
from .family import Family, Member
from .plant_stack import PlantStack, numbers_of, stacked_members

PAYLOAD_FEEDBACK = "payload-feedback"


class FamilyPlants:
    """A family with a controller structure, posed member by member.

    Parameters
    ----------
    family
        The family.
    structure
        ``payload-feedback``, the name of another structure of a winch, or a structure of your
        own on the plant with all its sensors.
    masses
        Rope masses of every plant; by default what each case asks for.
    """

    def __init__(
        self,
        family: Family,
        structure: str | Structure = PAYLOAD_FEEDBACK,
        masses: int | None = None,
    ) -> None:
        self.family, self.structure, self.masses = family, structure, masses
        self._questions: dict[Member, DesignQuestion] = {}
        self._scenarios: dict[Member, FamilyLoop] = {}
        self._plants: dict[tuple[object, ...], LinearPlant] = {}

    @cached_property
    def nominal(self) -> DesignQuestion:
        """The question of the nominal member in the first sea."""
        return self.question(self.family.nominal()[0])

    @cached_property
    def law(self) -> ParametrisedController:
        """The controller's law, bound to the nominal plant."""
        structure = self.structure
        if isinstance(structure, str):
            structure = structure_named(structure, self.nominal.case)
        return structure.bind(self._plant(self.family.nominal()[0]))

    @cached_property
    def guesses(self) -> list[list[float]]:
        """The gains in use, if the case has any that are this structure's."""
        gains = self.family.case.gains
        thesis = self.structure == PAYLOAD_FEEDBACK
        return [] if gains is None or not thesis else [[gains.a, gains.a1, gains.a2]]

    @cached_property
    def _sensed(self) -> bool:
        """Whether more than the payload is heard, or more than the sea shakes what is heard."""
        return self.structure != PAYLOAD_FEEDBACK or len(self.nominal.spectra) > 1

    @property
    def most_masses(self) -> int:
        """The largest number of rope masses of any member posed so far."""
        return max([self.nominal.masses, *(q.masses for q in self._questions.values())])

    def with_masses(self, masses: int) -> FamilyPlants:
        """Return the same family on plants of more rope masses."""
        return FamilyPlants(self.family, self.structure, masses)

    def question(self, member: Member) -> DesignQuestion:
        """Return the question of a member."""
        if member not in self._questions:
            self._questions[member] = pose(self.family.case_at(member), masses=self.masses)
        return self._questions[member]

    def scenario(self, member: Member) -> FamilyLoop:
        """Return the scenario of a member, its weight the sea's occurrence."""
        if member not in self._scenarios:
            question = self.question(member)
            plant = self._plant(member)
            problem = Problem(
                plant=plant,
                law=self.law,
                disturbances=disturbances(self._spectra(member), plant.independent_disturbances),
                minimise={PAYLOAD: 1.0},
                limits=question.limits,
                drag=question.drag,
            )
            self._scenarios[member] = FamilyLoop(
                name=self.family.name_of(member),
                problem=problem,
                weight=float(self.family.occurrence[member.sea]),
            )
        return self._scenarios[member]

    def stack(self, members: Sequence[Member]) -> PlantStack:
        """Return the plants of many members at once, all with the most rope masses."""
        masses = self.masses or self.most_masses
        if not self._sensed:
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

    def shaken(self, members: Sequence[Member]) -> tuple[Quadrature, dict[str, FloatArray]]:
        """Return common nodes, and each disturbance's density there for each member."""
        seas = [self._sea_sources(k) for k in range(len(self.family.seas))]
        every = [d for sources in seas for d in sources]
        bands = [d.band for d in every if d.band is not None]
        nodes = spectral_nodes(
            min(b[0] for b in bands),
            max(b[1] for b in bands),
            splits=sorted({w for d in every for w in d.splits}),
            half_line=len(bands) < len(every),
        )
        which = np.array([m.sea for m in members])
        densities = {
            d.name: np.stack([sources[k].density(nodes.omega) for sources in seas])[which]
            for k, d in enumerate(seas[0])
        }
        return nodes, densities

    def _sea_sources(self, sea: int) -> tuple[Disturbance, ...]:
        member = replace(self.family.nominal()[0], sea=sea)
        return self.scenario(member).problem.disturbances

    def _plant(self, member: Member) -> LinearPlant:
        question = self.question(member)
        key: tuple[object, ...] = member.point
        if question.drag is not None:
            key = (*member.point, member.sea)
        if key not in self._plants:
            self._plants[key] = question.plant
            if self._sensed:
                self._plants[key] = sensed_plant(
                    question.case, masses=question.masses, drag=question.drag_before
                )
        return self._plants[key]

    def _spectra(self, member: Member) -> dict[str, object]:
        question = self.question(member)
        if not self._sensed:
            return {HOOK: question.hook}
        return dict(sensed_spectra(question.case, question.hook))
