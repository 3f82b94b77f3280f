"""Point of a Pareto front: a design at a bound, with what it takes to check it again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import SolverError

from ..design import tuning_of
from ..loop import Assessment
from ..question import PAYLOAD, Problem
from ..search import KEPT, Found, Solution, assessment_of
from ..verify import Verification


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoPoint:
    """One point of a front.

    Attributes
    ----------
    bound, value
        What the other quantity was held to, and what it is.
    payload_rms
        Standard deviation of the payload [m].
    parameters
        The gains by name.
    max_sensitivity, torque_rms
        M_s [-] and rms of the dynamic motor torque [N m].
    price
        Relative change of the payload's rms per relative change of the bound.
    excess
        Largest relative excess over a limit.
    """

    bound: float
    value: float
    payload_rms: float
    parameters: Mapping[str, float]
    max_sensitivity: float
    torque_rms: float
    price: float
    excess: float
    solved: Solution
    problem: Problem

    @property
    def ok(self) -> bool:
        """Whether the loop is stable, the solver arrived and every limit is kept."""
        return bool(self.solved.converged and self.excess <= KEPT and np.isfinite(self.payload_rms))

    def verify(self) -> Verification:
        """Check the point by code that no search uses."""
        assessment = assessment_of(self.problem, self.solved)
        return tuning_of(
            self.problem, Found(solved=self.solved, assessment=assessment, excess=self.excess)
        ).verify()


def point_of(
    problem: Problem,
    name: str,
    bound: float,
    solved: Solution,
    assessment: Assessment | None = None,
    made_with: float | None = None,
) -> ParetoPoint:
    """Return the point of an answer; `name` is the limit whose bound moves, if there is one.

    `made_with` is the bound that the programme of the answer was made with: its prices are per
    share of that one.
    """
    assessment = assessment_of(problem, solved) if assessment is None else assessment
    payload, torque = _sigmas(assessment, (PAYLOAD, "motor.torque"))
    measured = {limit.name: limit.measure(assessment) for limit in problem.limits}
    uses = [limit.use(measured[limit.name]) - 1.0 for limit in problem.limits]
    return ParetoPoint(
        bound=bound,
        value=measured.get(name, bound),
        payload_rms=payload,
        parameters=problem.law.named([float(v) for v in solved.values]),
        max_sensitivity=assessment.max_sensitivity,
        torque_rms=torque,
        price=float(solved.prices.get(name, 0.0) * bound / (made_with or bound or 1.0)),
        excess=float(max(uses, default=0.0)),
        solved=solved,
        problem=problem,
    )


def _sigmas(assessment: Assessment, outputs: Sequence[str]) -> list[float]:
    """Return the standard deviations of outputs, on one set of nodes for all."""
    try:
        nodes = assessment.quadrature(outputs)
    except SolverError:
        return [np.inf for _ in outputs]
    found = [nodes.integrate(assessment.spectrum(output, nodes.omega)) for output in outputs]
    return [float(np.sqrt(variance)) for variance in found]
