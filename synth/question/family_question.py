"""`FamilyQuestion`: a case, changes of it and a structure, as the problem of a family.

    case, structure -> FamilyQuestion -> DesignQuestion of each changed case -> FamilyProblem

The controller is one: its law is bound to the plant of the case itself and used around every
member.  Members that differ in nothing but the sea share their plant where drag is fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from models.case import Case
from models.plant import LinearPlant

from ..loop import Assessment
from ..structures import ParametrisedController
from .family_problem import FamilyLoop, FamilyProblem, Objective
from .problem import Problem
from .question import DesignQuestion, pose
from .rope_masses import masses_for

PAYLOAD_FEEDBACK = "payload-feedback"


class FamilyQuestion:
    """One structure on a case and on cases like it, posed one by one.

    Parameters
    ----------
    case
        The case whose plant the structure is bound to.
    structure
        Name of the structure, see `synth.structures.structure_names`.
    masses
        Rope masses of every plant; by default what each case asks for.
    """

    def __init__(
        self, case: Case, structure: str = PAYLOAD_FEEDBACK, masses: int | None = None
    ) -> None:
        self.case, self.structure, self.masses = case, structure, masses
        self._posed: dict[Case, tuple[DesignQuestion, Problem]] = {}
        self._plants: dict[tuple[object, ...], LinearPlant] = {}

    @property
    def nominal(self) -> DesignQuestion:
        """The question of the case itself."""
        return self.question(self.case)

    @cached_property
    def law(self) -> ParametrisedController:
        """The controller's law, bound to the plant of the case itself."""
        return self._pose(self.case)[1].law

    @property
    def guesses(self) -> list[list[float]]:
        """The gains in use, if the case has any that are this structure's."""
        gains = self.case.gains
        if gains is None or self.structure != PAYLOAD_FEEDBACK:
            return []
        return [[gains.a, gains.a1, gains.a2]]

    @property
    def most_masses(self) -> int:
        """The largest number of rope masses of any case posed so far."""
        return max([self.nominal.masses, *(q.masses for q, _ in self._posed.values())])

    def question(self, case: Case) -> DesignQuestion:
        """Return the question of a case like this one."""
        return self._pose(case)[0]

    def loop(self, case: Case, name: str = "", weight: float = 1.0) -> FamilyLoop:
        """Return the member that a case like this one is."""
        question, problem = self._pose(case)
        plant = self._plants.setdefault(
            (question.data, case.sensors, question.drag_before, question.masses), problem.plant
        )
        problem = replace(problem, plant=plant, law=self.law)
        return FamilyLoop(name=name, problem=problem, weight=weight)

    def masses_wanted(self, cases: Sequence[Case], assessments: Sequence[Assessment]) -> int:
        """Return the rope masses that the most demanding loop of any member asks for."""
        most = self.most_masses
        if self.masses is not None:
            return most
        loops = zip(cases, assessments, strict=True)
        return max(
            [most, *(masses_for(self.question(c), loop) for c, loop in loops if loop.stable)]
        )

    def _pose(self, case: Case) -> tuple[DesignQuestion, Problem]:
        if case not in self._posed:
            self._posed[case] = _posed(case, self.structure, self.masses)
        return self._posed[case]


def pose_family(
    case: Case,
    members: Sequence[Mapping[str, Any]],
    structure: str = PAYLOAD_FEEDBACK,
    *,
    objective: str | Objective = Objective.WORST,
    masses: int | None = None,
) -> FamilyProblem:
    """Return the problem of a case together with changes of it.

    Parameters
    ----------
    case
        The case, the first member of the family.
    members
        Changes of the case by dotted path, a mapping for each further member.
    structure, masses
        As `FamilyQuestion` takes them.
    objective
        ``worst``, ``mean`` or ``regret``; for the last see `synth.search.with_bests`.

    Raises
    ------
    InputError
        If a change is not valid, or there is no such structure or objective.
    """
    posed = FamilyQuestion(case, structure, masses)
    changed = [posed.loop(case.replace(dict(m)), _named(m)) for m in members]
    return FamilyProblem(
        scenarios=(posed.loop(case, case.name), *changed), objective=Objective.of(objective)
    )


def _named(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{path} {value}" for path, value in changes.items())


def _posed(case: Case, structure: str, masses: int | None) -> tuple[DesignQuestion, Problem]:
    """Return the question of a case, and its problem with a structure."""
    question = pose(case, structure, masses)
    return question, question.problem
