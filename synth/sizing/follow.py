r"""Optima followed from case to case: each solved again from its neighbour's answer.

    Posed (case, structure) + neighbour's Answer -> programme on inherited nodes -> Answer

A sweep over gear ratios, motors or seas solves nearly the same problem again and again.  Each
solve begins at its neighbour's answer and with the frequencies at which that one pressed a
limit, so one or two rounds of the exchange (`synth.search.polishing`) suffice.  `slope` gives the
derivative of the optimum by the envelope theorem: that of the Lagrangian at the answer,

.. math:: dJ^*/d\theta = \partial_\theta (\log J + \lambda^T g),

with the multipliers of every row, so that a limit that is pressed at several frequencies at once
is counted right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from models.basics import FloatArray, Quadrature
from models.case import Case

from ..design import Design, design_of, tuning_of, verified
from ..limits import Limit, drive_limits
from ..loop import Assessment
from ..question import PAYLOAD, DesignQuestion, Goal, Problem, pose
from ..search import (
    Found,
    Programme,
    Progress,
    Solution,
    SolverPace,
    assess,
    begin_points,
    cost_nodes,
    margin_nodes,
    polish,
    thinned,
)

EXCESS = 1e-4  # relative excess over a limit that an answer on the way may have
ROUNDS = 5  # of the exchange of nodes
_FRESH = 3  # starts where no neighbour's answer is stable
_MOST_HELD = 200  # frequencies that are inherited
_RTOL = 1e-6  # of the integrals on the way


@dataclass(frozen=True, kw_only=True, eq=False)
class Posed:
    """A case and a structure with all limits of the drive, whether the case enforces them or not.

    Attributes
    ----------
    question
        As `synth.design.optimise_gains` sees it.
    loop, drive
        Limits of the loop, and those of motor, drive and rope.
    """

    question: DesignQuestion
    loop: tuple[Limit, ...]
    drive: tuple[Limit, ...]

    @classmethod
    def of(cls, case: Case, structure: str, masses: int | None = None) -> Posed:
        """Return a case posed for a structure on a number of rope masses."""
        # Posed as one that reports: a motor may be too small for the load at rest.
        reporting = case.variant({"limits.drive": "report"})
        question = pose(reporting, structure, masses)
        drive = drive_limits(reporting, question.plant)
        return cls(question=question, loop=question.loop, drive=drive)

    @property
    def masses(self) -> int:
        """Rope masses of the plant."""
        return self.question.masses

    def problem(self, limits: Sequence[Limit]) -> Problem:
        """Return the problem with some limits."""
        return self.question.problem_with(limits)

    def asked_by(self, case: Case) -> Problem:
        """Return the problem with the limits that a case enforces."""
        drive = self.drive if case.limits.drive == "enforce" else ()
        return self.problem((*self.loop, *drive))


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """An optimum and what its neighbours need of it.

    Attributes
    ----------
    problem, solved, assessment
        The problem, the solver's answer, and its assessment.
    excess
        Largest relative excess over a limit that was to be kept.
    nodes, omega, held
        Where its spectra were integrated and its margins held, and which of those frequencies
        the exchange added [rad/s].
    vector
        The programme's vector.
    """

    problem: Problem
    solved: Solution
    assessment: Assessment
    excess: float
    nodes: Quadrature
    omega: FloatArray
    held: FloatArray
    vector: FloatArray

    @property
    def payload_rms(self) -> float:
        """Standard deviation of the payload [m]."""
        return self.assessment.sigma(PAYLOAD)

    @property
    def parameters(self) -> dict[str, float]:
        """The structure's parameters by name."""
        return self.problem.law.named([float(v) for v in self.solved.values])

    def uses(self) -> dict[str, float]:
        """Return the use of every limit by name."""
        return {lim.name: lim.use(lim.measure(self.assessment)) for lim in self.problem.limits}

    def carried(self, problem: Problem) -> FloatArray:
        """Return the parameters for another problem, each as large for it as here."""
        old, new = self.problem.law.parameters, problem.law.parameters
        ratio = np.array([b.scale / a.scale for a, b in zip(old, new, strict=True)])
        return problem.law.clipped(self.solved.values * ratio)


def begin_from(problem: Problem, design: Design) -> FloatArray:
    """Return a design's parameters as a start for a problem."""
    values = [design.parameters[p.name] for p in problem.law.parameters]
    return problem.law.clipped(np.array(values))


def follow(
    problem: Problem,
    begins: Sequence[FloatArray],
    *,
    near: Answer | None = None,
    goal: Goal = Goal.COST,
    relaxed: Sequence[str] = (),
    coefficient: float | None = None,
    extra: float = 0.0,
    fine: bool = False,
    rounds: int = ROUNDS,
) -> Answer | None:
    """Return the optimum of a problem from starts close to it, or None if none arrives.

    Parameters
    ----------
    problem
        The problem.
    begins
        Starts; those that do not stabilise the loop are left out.
    near
        A neighbour's answer, whose margin frequencies are held too.
    goal, relaxed, extra
        See `synth.search.programme.Programme`; `extra` begins the variable of the goal.
    coefficient
        Drag coefficient to begin with [N s/m].
    rounds
        Most rounds of the exchange; with one the answer is a rough one.
    fine
        Whether to polish the answer until no limit is broken by more than 1e-5.
    """
    drag = problem.drag
    if drag is not None and coefficient is None:
        coefficient = near.solved.coefficient if near is not None else drag.reference
    starts = [b for b in begins if problem.stable(b, coefficient)]
    if not starts and len(begins):
        starts = begin_points(problem, _FRESH, 0, [list(b) for b in begins])
    best: Answer | None = None
    for begin in starts:
        found = _arrived(problem, begin, near, goal, relaxed, coefficient, extra, rounds)
        if found is not None and (best is None or found.solved.objective < best.solved.objective):
            best = found
    if best is None or not fine:
        return best
    solved, assessment, excess = polish(problem, best.solved, starts[0], goal, relaxed)
    if not solved.converged or excess > max(best.excess, EXCESS):
        return best
    return replace(best, solved=solved, assessment=assessment, excess=excess)


def designed(
    case: Case, structure: str, near: Answer, masses: int, tell: Progress
) -> Design | None:
    """Return the best gains of a case close to a known answer, verified; None if none keep it."""
    posed = Posed.of(case, structure, masses)
    problem = posed.asked_by(case)
    begins = [near.carried(problem), near.solved.values]
    answer = follow(problem, begins, near=near, fine=True)
    if answer is None:
        return None
    found = Found(solved=answer.solved, assessment=answer.assessment, excess=answer.excess)
    tuning = tuning_of(problem, found)
    return verified(design_of(pose(case, structure, masses), tuning), tell)


def least_between(cost: Callable[[float], float], low: float, high: float, fine: float) -> float:
    """Return where a cost of a positive number is least between two ends.

    Parameters
    ----------
    cost
        The cost; infinite where there is no answer.
    low, high
        The ends.
    fine
        Of the number's logarithm, to which the least is found.
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


def slope(answer: Answer, changed: Problem, step: float) -> float:
    """Return d log(cost) of the optimum per `step`, by the envelope theorem.

    Parameters
    ----------
    answer
        An optimum with the goal COST.
    changed
        The same problem with one figure changed by `step` [unit of the figure].
    step
        By how much.
    """
    here = _lagrangian(answer, answer.problem, answer.vector)
    vector = answer.vector.copy()
    parameters = answer.problem.law.parameters
    for k, (old, new) in enumerate(zip(parameters, changed.law.parameters, strict=True)):
        vector[k] *= old.scale / new.scale  # the same parameter in the units of its new size
    return (_lagrangian(answer, changed, vector) - here) / step


def _lagrangian(answer: Answer, problem: Problem, vector: FloatArray) -> float:
    programme = Programme(problem, answer.nodes, answer.omega, reference=answer.solved.values)
    bounds = np.array([limit.bound for limit in problem.limits], dtype=np.float64)
    cost, rows = programme.evaluate(vector, bounds)
    flat = np.array(rows, dtype=np.float64).ravel()
    assert answer.solved.multipliers is not None
    prices = answer.solved.multipliers.copy()
    # The row that keeps slow poles off is normalised by the reference: it has no price.
    prices[-1 if problem.drag is None else -2] = 0.0
    return float(cost) + float(np.dot(prices, flat))


def _arrived(
    problem: Problem,
    begin: FloatArray,
    near: Answer | None,
    goal: Goal,
    relaxed: Sequence[str],
    coefficient: float | None,
    extra: float,
    rounds: int,
) -> Answer | None:
    assessment = problem.assess(begin, coefficient)
    held = near.held if near is not None else np.zeros(0)
    solved: Solution | None = None
    best: Answer | None = None
    for k in range(rounds):
        nodes = cost_nodes(problem, [assessment], rtol=_RTOL)
        omega = np.union1d(margin_nodes(problem, [assessment.poles], 40), held)
        programme = Programme(
            problem, nodes, omega, goal, reference=begin, relaxed=relaxed, tolerance=1e-8
        )
        values = begin if solved is None else solved.values
        start = programme.pack(
            values,
            coefficient if solved is None else solved.coefficient,
            extra if solved is None else solved.extra,
        )
        again = _solved(programme, start, first=k == 0 and near is None)
        if again is None:
            break
        solved = again
        assessment, excess = assess(problem, solved, goal, relaxed)
        answer = Answer(
            problem=problem,
            solved=solved,
            assessment=assessment,
            excess=excess,
            nodes=nodes,
            omega=omega,
            held=_fewer(assessment, problem, held),
            vector=programme.pack(solved.values, solved.coefficient, solved.extra),
        )
        if best is None or answer.excess < best.excess:
            best = answer
        if excess <= 0.5 * EXCESS:
            return answer
        held = _fewer(assessment, problem, held)
    rough = rounds < ROUNDS
    return best if best is not None and (rough or best.excess <= 10.0 * EXCESS) else None


def _fewer(assessment: Assessment, problem: Problem, held: FloatArray) -> FloatArray:
    """Return the frequencies that a neighbour should hold: where limits are pressed, and were."""
    extremes = [f(assessment) for limit in problem.limits for f in (limit.critical, limit.worst)]
    recent = held[:: 1 + held.size // _MOST_HELD]
    return np.union1d(recent, thinned(extremes))


def _solved(programme: Programme, start: FloatArray, *, first: bool) -> Solution | None:
    for pace in (SolverPace.FAR, SolverPace.NEAR) if first else (SolverPace.NEAR, SolverPace.FAR):
        solved = programme.solve(start, pace=pace)
        if solved.converged and programme.problem.stable(solved.values, solved.coefficient):
            return solved
    return None
