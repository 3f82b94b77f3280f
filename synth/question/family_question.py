"""A case, changes of it and a structure: the questions of all, and the problem of the family.

    case, structure -> FamilyQuestion -> DesignQuestion of each changed case
    case, changes, structure -> PosedFamily -> FamilyProblem

The controller is one: its law is bound to the plant of the case itself and used around every
member.  Members that differ in nothing but the sea share their plant where drag is fixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from models.case import Case
from models.plant import LinearPlant

from ..loop import Assessment
from ..structures import ParametrisedController
from .family_problem import FamilyLoop, FamilyProblem, Objective
from .question import DesignQuestion, pose, with_masses
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
        self._posed: dict[Case, DesignQuestion] = {}
        self._plants: dict[tuple[object, ...], LinearPlant] = {}

    @property
    def nominal(self) -> DesignQuestion:
        """The question of the case itself."""
        return self.question(self.case)

    @cached_property
    def law(self) -> ParametrisedController:
        """The controller's law, bound to the plant of the case itself."""
        return self.nominal.law

    @property
    def most_masses(self) -> int:
        """The largest number of rope masses of any case posed so far."""
        return max([self.nominal.masses, *(q.masses for q in self._posed.values())])

    def question(self, case: Case, known: DesignQuestion | None = None) -> DesignQuestion:
        """Return the question of a case like this one; what is `known` as `pose` takes it."""
        if case not in self._posed:
            posed = pose(case, self.structure, self.masses, known, built_for=self.case)
            self._posed[case] = posed
        return self._posed[case]

    def loop(self, case: Case, name: str = "", weight: float = 1.0) -> FamilyLoop:
        """Return the member that a case like this one is."""
        question = self.question(case)
        plant = self._plants.setdefault(_loop_key(question), question.plant)
        problem = replace(question.problem, plant=plant, law=self.law)
        return FamilyLoop(name=name, problem=problem, weight=weight)

    def masses_wanted(self, cases: Sequence[Case], assessments: Sequence[Assessment]) -> int:
        """Return the rope masses that the most demanding loop of any member asks for."""
        if self.masses is not None:
            return self.most_masses
        questions = [self.question(case) for case in cases]
        return max(self.most_masses, _masses_wanted(questions, assessments))


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedFamily:
    """A case and changes of it with one structure, posed.

    Attributes
    ----------
    questions
        The question of each member, the case's own first.
    names
        What each member is called.
    objective
        What is made small over all of them.
    """

    questions: tuple[DesignQuestion, ...]
    names: tuple[str, ...]
    objective: Objective = Objective.WORST

    @property
    def first(self) -> DesignQuestion:
        """The question of the case itself."""
        return self.questions[0]

    @property
    def alone(self) -> PosedFamily:
        """The case itself, a family of one."""
        return replace(self, questions=self.questions[:1], names=self.names[:1])

    @property
    def masses(self) -> int:
        """The most rope masses of any member."""
        return max(question.masses for question in self.questions)

    @cached_property
    def problem(self) -> FamilyProblem:
        """The problem with all limits that bind."""
        return self._problem(drive=True)

    @cached_property
    def without_drive(self) -> FamilyProblem:
        """The problem with the limits of the loop only, as if the drive were large enough."""
        return self._problem(drive=False)

    def _problem(self, *, drive: bool) -> FamilyProblem:
        plants: dict[tuple[object, ...], LinearPlant] = {}
        loops = []
        for name, question in zip(self.names, self.questions, strict=True):
            problem = question.problem_with(question.limits if drive else question.loop)
            plant = plants.setdefault(_loop_key(question), problem.plant)
            problem = replace(problem, plant=plant, law=self.first.law)
            loops.append(FamilyLoop(name=name, problem=problem))
        return FamilyProblem(scenarios=tuple(loops), objective=self.objective)

    def masses_wanted(self, assessments: Sequence[Assessment]) -> int:
        """Return the rope masses that the most demanding loop of any member asks for."""
        return max(self.masses, _masses_wanted(self.questions, assessments))

    def on(self, masses: int) -> PosedFamily:
        """Return the family on a number of rope masses, where members have fewer."""
        finer = (
            with_masses(question, masses)
            if question.masses < masses and question.data.lumping != "thesis"
            else question
            for question in self.questions
        )
        return replace(self, questions=tuple(finer))


def pose_family(
    case: Case,
    members: Sequence[Mapping[str, Any] | Case],
    structure: str = PAYLOAD_FEEDBACK,
    *,
    objective: str | Objective = Objective.WORST,
    masses: int | None = None,
    held: Mapping[str, float] | None = None,
    known: PosedFamily | None = None,
) -> PosedFamily:
    """Return a case together with changes of it, posed for a structure.

    Parameters
    ----------
    case
        The case, the first member of the family.
    members
        The further members: changes of the case by dotted path, or cases.
    structure, masses
        As `FamilyQuestion` takes them.
    objective
        ``worst``, ``mean`` or ``regret``; for the last see `synth.search.with_bests`.
    held
        Parameters of the structure that are not searched, by name.
    known
        As many members like these, posed: what each has in common with its like is taken from it.

    Raises
    ------
    InputError
        If a change is not valid, or there is no such structure, objective or parameter.
    """
    cases = [m if isinstance(m, Case) else case.replace(dict(m)) for m in members]
    posed = FamilyQuestion(case, structure, masses)
    alike = [None] * (1 + len(cases)) if known is None else known.questions
    questions = map(posed.question, (case, *cases), alike)
    return PosedFamily(
        questions=tuple(replace(question, held=dict(held or {})) for question in questions),
        names=(case.name, *(difference_text(case, one) for one in cases)),
        objective=Objective.of(objective),
    )


def difference_text(case: Case, other: Case) -> str:
    """Return in what a case differs from another, as ``rope.damping_ratio 0.0003``."""
    own, others = _flat(case.to_dict()), _flat(other.to_dict())
    paths = [path for path in {**own, **others} if own.get(path) != others.get(path)]
    told = (f"{path} {_value_text(others.get(path))}" for path in paths)
    return ", ".join(told) or "the case itself"


def _flat(data: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return what stands in nested sections by dotted path."""
    found: dict[str, Any] = {}
    for name, value in data.items():
        path = f"{above}{name}"
        found |= _flat(value, f"{path}.") if isinstance(value, Mapping) else {path: value}
    return found


def _value_text(value: Any) -> str:
    if isinstance(value, list):
        return "changed"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _loop_key(question: DesignQuestion) -> tuple[object, ...]:
    """Return what questions have in common that share their plant."""
    return question.data, question.case.sensors, question.drag_before, question.masses


def _masses_wanted(questions: Sequence[DesignQuestion], assessments: Sequence[Assessment]) -> int:
    """Return the rope masses that the most demanding stable loop asks for."""
    pairs = zip(questions, assessments, strict=True)
    return max((masses_for(q, seen) for q, seen in pairs if seen.stable), default=0)
