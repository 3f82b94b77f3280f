r"""Certificate of a record's optimum, by code that did not solve it.

The motion is rolled out sample by sample from the first state and the inputs, and the multipliers
are put into the adjoint recursion

    l[k] = cost'(y[k]) + (rows on y[k])' prices + Phi' l[k+1]

so that dynamics and stationarity in the states hold by construction.  What is left are the limits
(primal residual), the stationarity in the inputs and the first state (dual residual) and the
products of prices and slacks (complementarity).

They also give a rigorous lower bound.  For any prices with the right sign the Lagrangian bounds
the optimum from below, and with inputs and first state as the only unknowns its Hessian is at
least rho in the inputs and rho_0 in the first state, hence

    optimum >= cost - sum(prices * slacks)
               - \|input residual\|^2/(2 rho) - \|state residual\|^2/(2 rho_0)

without solving anything.  Of this is taken off what the regularisation could cost
any demand within its limits.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray

from .problem import RHO, RHO_START, RecordProblem, RecordSolution

_START = 10.0  # [m, m/s] no first state deviates by more, or by more than twice the answer's


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """Residuals of the optimality conditions and a lower bound."""

    primal: float  #: Largest excess over a limit, in units of the limit [-].
    #: Largest stationarity residual of inputs and first state, over the largest gradient term (over
    #: rho where that is more) [-].
    dual: float
    #: Sum of the products of prices and slacks over the cost (over rho where that is more) [-].
    complementarity: float
    lower_bound: float  #: No controller keeps the payload's rms below this on the linear plant [m].

    def __str__(self) -> str:
        """Return the residuals in a line."""
        return (
            f"primal {self.primal:.1e}, dual {self.dual:.1e}, "
            f"complementarity {self.complementarity:.1e}"
        )


def rollout(problem: RecordProblem, start: FloatArray, inputs: FloatArray) -> FloatArray:
    """Return the deviations y, (N+1, n), sample by sample."""
    plant = problem.plant
    Phi, added = plant.Phi, inputs @ plant.Gamma.T + problem.residue
    y = np.empty((problem.samples + 1, len(start)))
    y[0] = start
    for k in range(problem.samples):
        y[k + 1] = Phi @ y[k] + added[k]
    return y


def certify(problem: RecordProblem, solution: RecordSolution) -> Certificate:
    """Return the certificate of a solution."""
    plant, N = problem.plant, problem.samples
    y = rollout(problem, solution.start, solution.inputs)
    payload = y @ plant.payload
    payload[: problem.first] = 0.0
    cost = 0.5 * float(payload @ payload)
    cost += 0.5 * RHO * float((solution.inputs**2).sum())
    cost += 0.5 * RHO_START * float(solution.start @ solution.start)

    # values of the rows, from the whole motion
    states, inputs = y + problem.still, solution.inputs + problem.still_inputs
    prices, hang = solution.window_prices, solution.tension_prices
    levels = plant.levels(states, inputs)
    excess = float(np.abs(levels).max()) - 1.0
    loss = float((np.maximum(prices, 0.0) * (1.0 - levels)).sum())
    loss += float((np.maximum(-prices, 0.0) * (1.0 + levels)).sum())
    on_state = np.zeros_like(y)
    on_input = RHO * solution.inputs
    for end in (0, 1):
        span = slice(end, end + N)
        own = prices[:, end]
        on_demand = own @ plant.windows[:, 0]
        on_state[span] += np.outer(own @ plant.windows[:, 1], plant.speed)
        if plant.hold == "line":
            on_input[:, end] += on_demand
        else:
            on_state[span] -= np.outer(on_demand, plant.feedback)
            on_input[:, 0] += on_demand
    if math.isfinite(problem.minimum_tension):
        left = problem.still_tensions() + y[:N] @ plant.tensions.T - problem.minimum_tension
        excess = max(excess, float((-left / plant.static_tensions).max()))
        loss += float((hang * left).sum())
        on_state[:N] -= hang @ plant.tensions
    on_state += np.outer(payload, plant.payload)

    adjoint = np.empty_like(y)
    adjoint[N] = on_state[N]
    for k in range(N - 1, -1, -1):
        adjoint[k] = on_state[k] + plant.Phi.T @ adjoint[k + 1]
    # Dynamics and stationarity in the states now hold to rounding, whatever the solver returned;
    # an answer that is not optimal shows in the inputs and the first state alone.
    pushed = adjoint[1:] @ plant.Gamma
    residual = on_input + pushed
    scale = float(np.abs(pushed).max(initial=RHO))
    dual, square = float(np.abs(residual).max()), float((residual**2).sum())
    if problem.start is None:
        first = adjoint[0] + RHO_START * solution.start
        dual = max(dual, float(np.abs(first).max()))
        square += float(first @ first) * RHO / RHO_START
    # Minimising the Lagrangian over what is left gains at most the squared residual over twice the
    # curvature, and that is at least RHO.
    lower = cost - loss - 0.5 * square / RHO
    # no input within the limits can be larger than that: demand of one, and at full speed
    largest = 1.0 + np.abs(problem.still_inputs + plant.static_demand)
    if plant.hold == "command":
        fastest = min(((1.0 + abs(a)) / abs(b) for a, b in plant.windows if b), default=math.inf)
        most = fastest * float(np.abs(plant.feedback).sum() / plant.speed.sum())
        largest += most if plant.feedback.any() else 0.0
    possible = RHO * float((largest**2).sum())
    fixed = float(solution.start @ solution.start)
    possible += RHO_START * (max(_START**2, 4.0 * fixed) if problem.start is None else fixed)
    mean = 2.0 * (lower - 0.5 * possible) / problem.counted
    return Certificate(
        primal=max(excess, 0.0),
        dual=dual / scale,
        complementarity=abs(loss) / max(cost, RHO),
        lower_bound=math.sqrt(max(mean, 0.0)),
    )
