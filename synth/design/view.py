"""A prepared question that is asked again and again: `prepare`, `View` and its quick `Look`.

    case, structure -> View -> evaluate(gains) -> Look, not verified
                            -> replace({...})  -> View, what did not change is kept
                            -> optimise(start) -> Design, by one descent from the start

What a slider, a notebook and a script that asks a thousand times share.  Responses and margins
are those of `synth.loop`, on nodes that are made from the poles of the loop at hand; the drag
begins where the last one agreed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError, one_thread
from models.case import Case
from models.plant import MAX_MASSES

from ..loop import Assessment, Coefficients
from ..question import (
    HOOK,
    PAYLOAD,
    DesignQuestion,
    FamilyProblem,
    Objective,
    PosedFamily,
    Values,
    on_common_masses,
    on_enough_masses,
    pose_family,
    with_masses,
)
from ..search import KEPT, Solution, glanced, settle, with_bests
from .design import Design
from .optimise import ROUNDS, checked_parameters, evaluated, seen_at, together, verified


@dataclass(frozen=True, kw_only=True, eq=False)
class Look(Design):
    """What given parameters do, at a glance: a design with its curves, not verified.

    The curves are those of the case; its further `members` are looks with their own.
    """

    growth: float  #: Largest real part of a pole, with the drag before compensation [1/s].
    #: Frequencies of the curves [rad/s], (k,); none where the loop is not stable.
    omega: FloatArray
    response: ComplexArray  #: P/Z, payload over hook, (k,).
    spectrum: FloatArray  #: One-sided density of the payload's motion [m2 s/rad], (k,).
    loop_gain: ComplexArray  #: L of the loop broken at the command (the Nyquist curve), (k,).

    @property
    def stable(self) -> bool:
        """Whether every member is; where one is not, its figures are infinite, None or empty."""
        return all(one.margins is not None for one in (self, *self.members))


@one_thread()
def prepare(
    case: Case,
    structure: str = "payload-feedback",
    *,
    members: Sequence[Mapping[str, Any] | Case] = (),
    objective: str = "worst",
) -> View:
    """Return the question of a case and a structure, posed once and kept warm.

    Parameters
    ----------
    case
        The case.
    structure
        Name of the structure, see `synth.structures.structure_names`.
    members, objective
        What else one controller is looked at for, and what is made small over all of them; as
        `optimise_gains` takes them.

    Raises
    ------
    InputError
        If there is no such structure, change or objective, or a case lacks what a design needs.
    """
    return View(pose_family(case, members, structure, objective=objective))


class View:
    """A case, others like it if there are any, and a structure, prepared for many looks.

    `posed` has the questions of all members, on the rope masses that their cases ask for; what was
    kept of each member `before` is kept where it is the same.
    """

    def __init__(self, posed: PosedFamily, before: Sequence[_Member] = ()) -> None:
        self.posed = posed
        known = [*before, *[None] * (len(posed.questions) - len(before))]
        each = zip(posed.questions, known, strict=False)
        self._members = [_Member(*one) for one in each]
        self._problems: dict[tuple[int, ...], FamilyProblem] = {}

    @property
    def case(self) -> Case:
        """The case, the first member."""
        return self.posed.first.case

    @property
    def structure(self) -> str:
        """Name of the structure."""
        return self.posed.first.structure.name

    @one_thread()
    def evaluate(self, gains: object) -> Look:
        """Return what given parameters do, by the code of the search alone.

        They are as `evaluate_gains` takes them.  Raises InputError if a parameter is missing,
        unknown or out of its range.
        """
        parameters = checked_parameters(self.posed.first, gains)
        looks = on_common_masses([partial(one.loop, parameters) for one in self._members])
        return together([_look(parameters, *look) for look in looks], self.posed)

    @one_thread()
    def replace(self, changes: Mapping[str, Any]) -> View:
        """Return the view of every member with changes by dotted path; see `Case.replace`.

        Sea, plant and the drum held are kept where the changes leave them as they are.

        Raises InputError if a change is not valid.
        """
        given = self.posed.questions[: self.posed.given]
        first, *others = (question.case.replace(dict(changes)) for question in given)
        objective = self.posed.objective
        posed = pose_family(first, others, self.structure, objective=objective, known=self.posed)
        return View(posed, self._members)

    @one_thread()
    def optimise(self, start: object = None, *, verify: bool = False) -> Design:
        """Return the optimum that one descent reaches from given parameters.

        It is never worse than a start that keeps the limits; there may be a better one elsewhere,
        which `optimise_gains` looks for.  The start is as `evaluate_gains` takes it, by default the
        gains that the case has in use; if `verify`, the design is checked as one by
        `optimise_gains` is.

        Raises InputError if a parameter is missing, unknown or out of its range, the start is
        unstable, or no gains of its own keep the limits of a member, for the regret.
        """
        given = self.case.gains if start is None else start
        parameters = checked_parameters(self.posed.first, given)
        begin, questions = [], []
        looks = on_common_masses([partial(one.loop, parameters) for one in self._members])
        for question, loop, growth in looks:
            if loop is None:
                raise InputError(
                    f"start: must be gains of a stable loop, got one that grows by {growth:.3g} 1/s"
                )
            begin.append(loop)
            questions.append(question)
        posed = replace(self.posed, questions=tuple(questions))
        reference = np.array(posed.first.values(parameters))
        solved, ended = self._descent(posed, reference, reference, begin)
        least = 0
        for _ in range(ROUNDS):
            # What a descent arrives at may ask for more masses, or for less, than where it began.
            if ended is None:
                break
            if posed.masses == MAX_MASSES:
                fitted = posed.fitted(ended)
            else:
                there = posed.first.named([float(v) for v in solved.values])
                stands, masses = seen_at([partial(one.loop, there) for one in self._members])
                least = max(least, masses)
                fitted = self.posed.on(least)
                if (stands and least <= posed.masses) or fitted.masses == posed.masses:
                    break
            if fitted is posed:
                break
            again = self._assessed(fitted, reference)
            if again is None:
                break
            posed, begin = fitted, again
            solved, ended = self._descent(posed, solved.values, reference, ended)
        how = "the descent did not converge: the start as it was"
        design = self._design(posed, parameters, begin, how=how)
        if ended is not None:
            there = posed.first.named([float(v) for v in solved.values])
            end = self._design(posed, there, ended, solved.prices, how="one descent from the start")
            reached, before = (
                self._problem(posed).total([one.payload_rms for one in (d, *d.members)])
                for d in (end, design)
            )
            better = reached <= before * (1.0 + KEPT)
            if (end.ok and (better or not design.ok)) or not (end.ok or design.ok):
                design = end
        every = (design, *design.members)
        if binding := dict.fromkeys(name for one in every for name in one.binding):
            design = replace(design, status=f"{design.status}, at {', '.join(binding)}")
        for member, one in zip(self._members, every, strict=True):
            member.begin = member.question.coefficients_of(one.drag, one.friction)
        return verified(design, None) if verify else design

    def _descent(
        self,
        posed: PosedFamily,
        values: FloatArray,
        reference: FloatArray,
        near: Sequence[Assessment],
    ) -> tuple[Solution, list[Assessment] | None]:
        """Return where a descent from some values ends, and the loops there if all are stable."""
        problem = self._problem(posed, [reference])
        known = [loop.coefficients for loop in near]
        solved = settle(problem, values, known, reference=reference, fine=True)
        ends = solved.coefficients
        if not np.isfinite(solved.objective) or not problem.stable(solved.values, ends):
            return solved, None
        return solved, self._assessed(posed, solved.values, ends)

    def _problem(self, posed: PosedFamily, guesses: Sequence[FloatArray] = ()) -> FamilyProblem:
        """Return the problem on some rope masses, for the regret with the best of each member."""
        if posed.objective is not Objective.REGRET:
            return posed.problem
        masses = tuple(question.masses for question in posed.questions)
        if masses not in self._problems:
            self._problems[masses] = with_bests(posed.problem, guesses=guesses)
        return self._problems[masses]

    def _assessed(
        self, posed: PosedFamily, values: Values, known: Sequence[Coefficients] = ()
    ) -> list[Assessment] | None:
        """Return the loop of every member; None where no drag agrees with one of them."""
        coefficients: Sequence[Coefficients | None] = known or [None] * len(posed.questions)
        each = zip(self._members, posed.questions, coefficients, strict=True)
        found = [member.assessed(question, values, own) for member, question, own in each]
        loops = [loop for loop in found if loop is not None]
        return loops if len(loops) == len(found) else None

    def _design(
        self,
        posed: PosedFamily,
        parameters: Mapping[str, float],
        loops: Sequence[Assessment],
        prices: Sequence[Mapping[str, float]] = (),
        *,
        how: str,
    ) -> Design:
        """Return the design of some parameters; prices are of logarithms, by member."""
        designs = []
        each = zip(posed.questions, loops, prices or [{}] * len(loops), strict=True)
        for question, loop, own in each:
            rms = loop.sigma(PAYLOAD)
            priced = {name: 0.01 * abs(p) * rms for name, p in own.items()}
            designs.append(evaluated(question, parameters, loop, priced, how=how))
        return together(designs, self.posed)


class _Member:
    """One member's loop, with what is kept from one look to the next."""

    def __init__(self, question: DesignQuestion, before: _Member | None) -> None:
        self.question = question
        self.begin: Coefficients | None = None if before is None else before.begin
        self._posed = {question.masses: question}
        self._known: dict[int, DesignQuestion] = {}
        if before is not None and before.question.plant is question.plant:
            # On more masses the plant is the same, too.
            self._known = {**before._known, **before._posed}

    def loop(
        self, parameters: Mapping[str, float], masses: int
    ) -> tuple[DesignQuestion, Assessment | None, float]:
        """Return the question on the masses that suit a loop, the loop (or None), its growth."""
        question = self.question
        if question.masses < masses and question.data.masses is None:
            question = self.on(question, masses)
        return on_enough_masses(question, parameters, self.assessed, self.on)

    def on(self, question: DesignQuestion, masses: int) -> DesignQuestion:
        """Return the question on some rope masses, posed once."""
        if masses not in self._posed:
            self._posed[masses] = with_masses(question, masses, self._known.get(masses))
        return self._posed[masses]

    def assessed(
        self, question: DesignQuestion, values: Values, coefficients: Coefficients | None = None
    ) -> Assessment | None:
        """Return a loop at a glance, from where coefficients agreed last; see `glanced`."""
        loop = glanced(question.problem, values, coefficients, self.begin)
        if loop is not None and coefficients is None:
            self.begin = loop.coefficients
        return loop


def _look(
    parameters: Mapping[str, float],
    question: DesignQuestion,
    loop: Assessment | None,
    growth: float,
) -> Look:
    """Return what given parameters do in a member."""
    design = evaluated(question, parameters, loop, growth=growth)
    omega = spectrum = np.zeros(0)
    response = loop_gain = omega.astype(np.complex128)
    if loop is not None:
        omega, loop_gain = loop.grid, loop.gains[0]
        response, spectrum = loop.curves(PAYLOAD, HOOK, omega)
    return Look(
        **{field.name: getattr(design, field.name) for field in fields(design)},
        growth=growth,
        omega=omega,
        response=response,
        spectrum=spectrum,
        loop_gain=loop_gain,
    )
