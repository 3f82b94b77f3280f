"""A case, changes of it and a structure: the questions of all, and the problem of the family.

    case, structure -> FamilyQuestion -> DesignQuestion of each changed case
    case, changes, structure -> PosedFamily -> FamilyProblem

The controller is one: its law is bound to the plant of the case itself and used around every
member.  Members that differ in nothing but the sea share their plant where drag is fixed.

The damping of wire rope is not known to better than a factor: every member is joined by itself
with the least damping that a design must hold at, where M_s may be 1.25 times its limit
(`Case.with_least_damping`).  A rope by Kelvin and Voigt's law, which flatters its higher modes, is
an exhibit: what is designed for it is not held to that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from models.case import Case
from models.plant import LinearPlant

from ..limits import Limit
from ..loop import Assessment
from ..structures import ParametrisedController
from .family_problem import FamilyLoop, FamilyProblem, Objective
from .question import DesignQuestion, pose, with_masses
from .rope_masses import masses_and_reserve, masses_for

PAYLOAD_FEEDBACK = "payload-feedback"


class FamilyQuestion:
    """One structure on a case and on cases like it, posed one by one.

    The structure, named as in `synth.structures.structure_names`, is bound to the plant of the
    case.  `masses` are the rope masses of every plant, by default what each case asks for.
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

    def question(self, case: Case, known: Sequence[DesignQuestion] = ()) -> DesignQuestion:
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
    """A case and changes of it with one structure, posed."""

    questions: tuple[DesignQuestion, ...]  #: The question of each member, the case's own first.
    names: tuple[str, ...]  #: What each member is called.
    objective: Objective = Objective.WORST  #: What is made small over all of them.
    #: How many of them were given: the first; the others are these with the least damping.
    given: int = 1
    #: By member, what limits hold in reserve for the distributed rope, relative and by name.
    reserves: tuple[Mapping[str, float], ...] = ()

    @property
    def first(self) -> DesignQuestion:
        """The question of the case itself."""
        return self.questions[0]

    def alone(self, index: int) -> PosedFamily:
        """Return one member, a family of one."""
        only = slice(index, index + 1)
        return replace(
            self,
            questions=self.questions[only],
            names=self.names[only],
            given=1,
            reserves=self.reserves[only],
        )

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
        reserves = self.reserves or ({},) * len(self.questions)
        for name, question, reserve in zip(self.names, self.questions, reserves, strict=True):
            limits = question.limits if drive else question.loop
            problem = question.problem_with(
                [_reserved(limit, reserve.get(limit.name, 0.0)) for limit in limits]
            )
            plant = plants.setdefault(_loop_key(question), problem.plant)
            problem = replace(problem, plant=plant, law=self.first.law)
            loops.append(FamilyLoop(name=name, problem=problem))
        return FamilyProblem(scenarios=tuple(loops), objective=self.objective)

    def fitted(self, assessments: Sequence[Assessment]) -> PosedFamily:
        """Return the family on the masses, with the reserves, that its loops ask for; or itself."""
        each = zip(self.questions, assessments, strict=True)
        needs = [masses_and_reserve(*pair) for pair in each]
        if (masses := max(wanted for wanted, _ in needs)) > self.masses:
            return self.on(masses)
        if not any(more for _, more in needs):
            return self
        known = self.reserves or ({},) * len(needs)
        reserves = tuple(
            {name: own.get(name, 0.0) + more.get(name, 0.0) for name in {**own, **more}}
            for own, (_, more) in zip(known, needs, strict=True)
        )
        return replace(self, reserves=reserves)

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
        The further members: changes of the case by dotted path, or cases.  The case and each of
        them are followed by themselves with the least damping of the rope.
    structure, masses
        As `FamilyQuestion` takes them.
    objective
        ``worst``, ``mean`` or ``regret``; for the last see `synth.search.with_bests`.
    held
        Parameters of the structure that are not searched, by name.
    known
        Members like these, posed: what each has in common with its like is taken from it.

    Raises
    ------
    InputError
        If a change is not valid, or there is no such structure, objective or parameter.
    """
    given = [case, *(m if isinstance(m, Case) else case.replace(dict(m)) for m in members)]
    cases = [*given, *damped_least(given)]
    posed = FamilyQuestion(case, structure, masses)
    alike: list[DesignQuestion | None] = [] if known is None else [*known.questions]
    alike += [None] * (len(cases) - len(alike))
    questions: list[DesignQuestion] = []
    for one, like in zip(cases, alike, strict=False):
        questions.append(posed.question(one, [q for q in (like, *questions) if q is not None]))
    return PosedFamily(
        questions=tuple(replace(question, held=dict(held or {})) for question in questions),
        names=(case.name, *(difference_text(case, one) for one in cases[1:])),
        objective=Objective.of(objective),
        given=len(given),
    )


def damped_least(cases: Sequence[Case]) -> list[Case]:
    """Return cases with the least damping that a design must hold at, of those that ask for it."""
    least = (case.with_least_damping for case in cases if case.rope.damping_law == "hysteretic")
    return [case for case in least if case is not None]


def difference_text(case: Case, other: Case) -> str:
    """Return in what a case differs from another, as ``rope.damping_ratio 0.0003``."""
    if other == case.with_least_damping:
        return f"{least_damping_text(case)}, M_s up to {other.limits.max_sensitivity:g}"
    own, others = _flat(case.to_dict()), _flat(other.to_dict())
    paths = [path for path in {**own, **others} if own.get(path) != others.get(path)]
    told = (f"{path} {_value_text(others.get(path))}" for path in paths)
    return ", ".join(told) or "the case itself"


def least_damping_text(case: Case) -> str:
    """Return what the least damping is that a design must hold at, in words."""
    rope, least = case.rope, case.rope.least_damping_ratio
    if rope.damping_measured is not None:
        return f"the least damping measured, {least:g}"
    if math.isclose(least, 0.1 * rope.damping_ratio):
        return "a tenth of the rope's damping"
    return f"the damping of solid steel, {least:g}"


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


def _reserved(limit: Limit, share: float) -> Limit:
    """Return a limit that is held with a share of itself in reserve."""
    factor = 1.0 + share if limit.at_least else 1.0 / (1.0 + share)
    return replace(limit, bound=factor * limit.bound) if share else limit


def _loop_key(question: DesignQuestion) -> tuple[object, ...]:
    """Return what questions have in common that share their plant."""
    return question.data, question.case.sensors, question.drag_before, question.masses


def _masses_wanted(questions: Sequence[DesignQuestion], assessments: Sequence[Assessment]) -> int:
    """Return the rope masses that the most demanding stable loop asks for."""
    pairs = zip(questions, assessments, strict=True)
    return max((masses_for(q, seen) for q, seen in pairs if seen.stable), default=0)
