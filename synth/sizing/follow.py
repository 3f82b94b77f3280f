"""Optima followed from case to case: each solved again from its neighbour's answer.

    case, structure + neighbour's Answer -> descent on true margins -> Answer

A sweep over gear ratios, motors or seas solves nearly the same problem again and again.  Each
descent begins at its neighbour's answer, where a few steps suffice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from models.basics import FloatArray
from models.case import Case

from ..design import Design, Tuning, design_of, tuning_of, verified
from ..limits import drive_limits
from ..loop import Assessment, Coefficients
from ..question import PAYLOAD, DesignQuestion, Goal, Problem, pose
from ..search import KEPT, Found, Progress, Solution, assess, begin_points, polish, settle

_FRESH = 3  # starts where no neighbour's answer is stable


def posed(case: Case, structure: str, masses: int | None = None) -> DesignQuestion:
    """Return the question of a case and a structure with all limits of the drive.

    Whether the case enforces them or not.
    """
    # Posed as one that reports: a motor may be too small for the load at rest.
    question = pose(case.variant({"limits.drive": "report"}), structure, masses)
    return replace(question, drive=drive_limits(question.case, question.plant), reported=())


def asked_by(case: Case, question: DesignQuestion) -> Problem:
    """Return the problem of a posed question with the limits that a case enforces."""
    return question.problem_with(
        question.limits if case.limits.drive == "enforce" else question.loop
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """An optimum and what its neighbours need of it.

    `excess` is the largest relative excess over a limit that was to be kept, at most
    `synth.search.KEPT`.
    """

    problem: Problem
    solved: Solution
    assessment: Assessment
    excess: float

    @classmethod
    def of(cls, problem: Problem, found: Found) -> Answer | None:
        """Return what a search found, None if it keeps no limits."""
        solved, assessment, excess = found.solved, found.assessment, found.excess
        if solved is None or assessment is None or not solved.converged or excess > KEPT:
            return None
        return cls(problem=problem, solved=solved, assessment=assessment, excess=excess)

    @property
    def payload_rms(self) -> float:
        """Standard deviation of the payload [m]."""
        return self.assessment.sigma(PAYLOAD)

    @property
    def parameters(self) -> dict[str, float]:
        """The structure's parameters by name."""
        return self.problem.law.named([float(v) for v in self.solved.values])

    @property
    def prices(self) -> Mapping[str, float]:
        """Price of each limit by name: d log(cost) / d log(bound)."""
        return self.solved.prices[0]

    @property
    def tuning(self) -> Tuning:
        """The answer in words and numbers."""
        assessments = (self.assessment,)
        found = Found(solved=self.solved, assessments=assessments, excess=self.excess)
        return tuning_of(self.problem, found)

    def uses(self) -> dict[str, float]:
        """Return the use of every limit by name."""
        return {lim.name: lim.use(lim.worst(self.assessment)) for lim in self.problem.limits}

    def carried(self, problem: Problem) -> FloatArray:
        """Return the parameters for another problem, each as large for it as here.

        As they are, if the loop is unstable with them.
        """
        old, new = self.problem.law.parameters, problem.law.parameters
        ratio = np.array([b.scale / a.scale for a, b in zip(old, new, strict=True)])
        values = problem.law.clipped(self.solved.values * ratio)
        return values if problem.stable(values, self.solved.coefficient) else self.solved.values


def with_bound(problem: Problem, name: str, bound: float) -> Problem:
    """Return the problem with another bound of one of its limits."""
    limits = tuple(replace(m, bound=bound) if m.name == name else m for m in problem.limits)
    return replace(problem, limits=limits)


def follow(
    problem: Problem,
    begins: Sequence[Answer | FloatArray],
    *,
    goal: Goal = Goal.COST,
    relaxed: Sequence[str] = (),
    coefficients: Coefficients | None = None,
) -> Answer | None:
    """Return the optimum of a problem from starts close to it, or None if none arrives.

    Starts are answers of neighbours, or parameters, with the coefficients of the elements; those
    that do not stabilise the loop are left out.  For goal and relaxed see
    `synth.search.GainProgramme`.
    """
    known = tuple(coefficients or problem.begin)
    starts = [
        (b.carried(problem), b.solved.coefficient, b.solved.extra)
        if isinstance(b, Answer)
        else (b, known, 0.0)
        for b in begins
    ]
    stable = [s for s in starts if problem.stable(s[0], s[1])]
    if not stable and starts:
        fresh = begin_points(problem, _FRESH, 0, [values for values, _, _ in starts])
        stable = [(values, known, 0.0) for values in fresh]
    found = [_arrived(problem, *start, goal, relaxed) for start in stable]
    arrived = (answer for answer in found if answer is not None)
    return min(arrived, key=lambda answer: answer.solved.objective, default=None)


def _arrived(
    problem: Problem,
    begin: FloatArray,
    coefficients: Coefficients,
    extra: float,
    goal: Goal,
    relaxed: Sequence[str],
) -> Answer | None:
    solved = settle(
        problem,
        begin,
        (coefficients,),
        goal,
        reference=begin,
        relaxed=relaxed,
        extra=extra,
        fine=True,
    )
    if not np.isfinite(solved.objective) or not problem.stable(solved.values, solved.coefficient):
        return None
    assessments, excess = assess(problem, solved, goal, relaxed)
    if excess > KEPT:
        solved, assessments, excess = polish(problem, solved, begin, goal, relaxed)
    if not solved.converged or excess > KEPT:
        return None
    return Answer(problem=problem, solved=solved, assessment=assessments[0], excess=excess)


def answer_of(design: Design) -> Answer | None:
    """Return a design as the optimum that others are followed from; None if it cannot be had.

    Of a design that does not keep the limits of its drive: the optimum without them.
    """
    question = posed(design.case, design.structure, design.masses)
    problem = question.problem_with(question.loop)
    if design.drive_kept and design.feasible:
        problem = asked_by(design.case, question)
    values = np.array([design.parameters[p.name] for p in problem.law.parameters])
    known = question.coefficients_of(design.drag, design.friction)
    return follow(problem, [problem.law.clipped(values)], coefficients=known)


def designed(
    case: Case, structure: str, near: Answer, masses: int, tell: Progress
) -> Design | None:
    """Return the best gains of a case close to a known answer, verified; None if none keep it."""
    answer = follow(asked_by(case, posed(case, structure, masses)), [near])
    if answer is None:
        return None
    return verified(design_of(pose(case, structure, masses), answer.tuning), tell)


def end_text(what: str, value: float, ends: tuple[float, float], fine: float) -> str:
    """Return what is to be said of an answer at an end of its range: that it stands there.

    Ends, and the answer, are positive numbers; it is one to `fine` of its logarithm.
    """
    at_end = min(value / ends[0], ends[1] / value) < math.exp(fine)
    return (
        f"; {what} stands at an end of the range, {ends[0]:.4g} to {ends[1]:.4g}" if at_end else ""
    )


def least_between(cost: Callable[[float], float], low: float, high: float, fine: float) -> float:
    """Return where a cost of a positive number is least, to `fine` of its logarithm.

    The cost is infinite where there is no answer.
    """
    # Where a neighbour is infinite Brent's parabola is no number, and the step a golden section.
    with np.errstate(invalid="ignore"):
        found = minimize_scalar(
            lambda size: cost(float(np.exp(size))),
            bounds=(np.log(low), np.log(high)),
            method="bounded",
            options={"xatol": fine},
        )
    return float(np.exp(found.x))
