"""The plants of a family as synthesis sees them: from a member to its scenario.

Family + structure -> FamilyPlants -> FamilyLoop of a member, SolvedRows of many
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from models.case import Case

from ..loop import Assessment
from ..question import PAYLOAD_FEEDBACK, DesignQuestion, FamilyLoop, FamilyQuestion
from ..sweeps import DesignRows, SolvedRows
from .family import Family, Member


class FamilyPlants:
    """A family with a controller structure, posed member by member, on its cases' masses."""

    def __init__(
        self, family: Family, structure: str = PAYLOAD_FEEDBACK, masses: int | None = None
    ) -> None:
        self.family = family
        self.posed = FamilyQuestion(family.case_at(family.nominal()[0]), structure, masses)
        self._cases: dict[Member, Case] = {}
        self._scenarios: dict[Member, FamilyLoop] = {}
        self._engines: dict[tuple[Any, ...], DesignRows] = {}

    @property
    def nominal(self) -> DesignQuestion:
        """The question of the nominal member in the first sea."""
        return self.posed.nominal

    def for_assessed(
        self, members: Sequence[Member], assessments: Sequence[Assessment]
    ) -> FamilyPlants:
        """Return the family on as many rope masses as loops of its members ask for."""
        masses = self.posed.masses_wanted([self._case(m) for m in members], assessments)
        if masses <= self.posed.most_masses:
            return self
        return FamilyPlants(self.family, self.posed.structure, masses)

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

    def loops(
        self,
        values: Sequence[float],
        members: Sequence[Member],
        outputs: Sequence[str],
        together: Sequence[tuple[str, str]] = (),
    ) -> Iterator[tuple[list[int], SolvedRows]]:
        """Yield the closed loops of members of one kind, and which members they are.

        All have the most rope masses.  They are closed by the engine of sweeps, which no search
        uses.  Of the outputs variances are wanted, of the pairs `together` covariances.
        """
        kinds: dict[tuple[Any, ...], list[int]] = {}
        for k, member in enumerate(members):
            kinds.setdefault(self.family.kind(member), []).append(k)
        for kind, at in kinds.items():
            asked = (tuple(values), tuple(outputs), kind)
            if asked not in self._engines:
                self._engines[asked] = DesignRows(
                    self.nominal,
                    self.nominal.named(values),
                    self.family.spread(members[at[0]]),
                    outputs=outputs,
                    second=outputs,
                    together=together,
                    peaks=True,
                    start=self.nominal.drag_before,
                    masses=self.posed.masses or self.posed.most_masses,
                )
            rows = np.array([self.family.row(members[k]) for k in at])
            yield at, self._engines[asked].solve(rows)

    def _case(self, member: Member) -> Case:
        if member not in self._cases:
            self._cases[member] = self.family.case_at(member)
        return self._cases[member]
