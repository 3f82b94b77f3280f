"""The programme of any linear plant once more, as one would write it down: in CVXPY.

Every state is a variable and every limit a constraint; the plant is sampled by SciPy.  Nothing is
shared with `mpc.programme` but the plant.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import cvxpy
import numpy as np
import scipy.linalg
import scipy.signal

cp: Any = cvxpy

__all__ = ["Stated", "stated"]


class Stated:
    """The optimum: its cost and its inputs by name, (N,)."""

    def __init__(self, cost: float, inputs: dict[str, np.ndarray], status: str) -> None:
        self.cost, self.inputs, self.status = cost, inputs, status


def stated(
    plant: Any,
    *,
    period: float,
    steps: int,
    costs: Mapping[str, float],
    state: Sequence[float],
    previous: Mapping[str, float],
    references: Mapping[str, np.ndarray],
    disturbances: Mapping[str, np.ndarray],
    limits: Sequence[tuple[str, float, float, Any]] = (),
    blocking: Sequence[int] | None = None,
    terminal: Mapping[str, float] | None = None,
    until: int | None = None,
    solver: str = "CLARABEL",
) -> Stated:
    """Return the optimum.

    An input without a reference is weighed as it is; references and disturbances are (N + 1,) each,
    limits (signal, low, high, price), the price None for a hard one; those of outputs are kept up
    to the sample `until`.  Without a terminal cost the
    end is weighed by SciPy's Riccati equation of the outputs and inputs that cost, which asks for
    references and disturbances of zero and no cost on rates.
    """
    n, nu = plant.B.shape
    inputs = np.hstack([plant.B, plant.E])
    A, BE, *_ = scipy.signal.cont2discrete(
        (plant.A, inputs, np.eye(n), np.zeros((n, inputs.shape[1]))), period
    )
    B, E = BE[:, :nu], BE[:, nu:]
    w = np.zeros((len(plant.disturbances), steps + 1))
    for name, path in disturbances.items():
        w[plant.disturbances.index(name)] = path
    x, u = cp.Variable((n, steps + 1)), cp.Variable((nu, steps))
    rules = [x[:, 0] == np.asarray(state)]
    rules += [x[:, 1:] == A @ x[:, :-1] + B @ u + E @ w[:, :-1]]
    at = 0
    for length in blocking or ():
        rules += [u[:, k] == u[:, at] for k in range(at + 1, at + length)]
        at += length
    before = np.array([previous.get(name, 0.0) for name in plant.inputs])

    def signal(name: str, j: int) -> Any:
        if name.startswith("rate of "):
            i = plant.inputs.index(name.removeprefix("rate of "))
            return (u[i, j] - (u[i, j - 1] if j else before[i])) / period
        if name in plant.inputs:
            return u[plant.inputs.index(name), j]
        k = plant.outputs.index(name)
        found = plant.Cz[k] @ x[:, j] + plant.Fz[k] @ w[:, j]
        return found if not plant.Dz[k].any() else found + plant.Dz[k] @ u[:, j]

    def known_at(name: str, j: int) -> bool:
        ends = name in plant.outputs and not plant.Dz[plant.outputs.index(name)].any()
        return j < steps or ends

    cost: Any = 0.0
    for name, weight in costs.items():
        wanted = references.get(name, np.zeros(steps + 1))
        cost += sum(weight * cp.square(signal(name, j) - wanted[j]) for j in range(steps))
    if terminal is None:
        rows = [plant.outputs.index(name) for name in costs if name in plant.outputs]
        heavy = np.array([costs[plant.outputs[k]] for k in rows])
        R = np.diag([costs.get(name, 0.0) for name in plant.inputs])
        C, D = plant.Cz[rows], plant.Dz[rows]
        P = scipy.linalg.solve_discrete_are(
            A, B, C.T * heavy @ C, R + D.T * heavy @ D, s=C.T * heavy @ D
        )
        cost += cp.quad_form(x[:, steps], cp.psd_wrap(0.5 * (P + P.T)))
    for name, weight in (terminal or {}).items():
        wanted = references.get(name, np.zeros(steps + 1))
        cost += weight * cp.square(signal(name, steps) - wanted[steps])
    for name, low, high, price in limits:
        for j in range(steps + 1):
            # At the first sample outputs of the state are past.
            past = j == 0 and name in plant.outputs and known_at(name, steps)
            late = until is not None and name in plant.outputs and j > until
            if past or late or not known_at(name, j):
                continue
            value = signal(name, j)
            sides = [value - high] if np.isfinite(high) else []
            sides += [low - value] if np.isfinite(low) else []
            for side in sides:
                if price is None:
                    rules.append(side <= 0.0)
                else:
                    over = cp.pos(side)
                    cost += price[0] * over + price[1] * cp.square(over)
    problem = cp.Problem(cp.Minimize(cost), rules)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Solution may be inaccurate")
        problem.solve(solver=solver, **_TIGHT[solver])
    found = {} if u.value is None else dict(zip(plant.inputs, np.asarray(u.value), strict=True))
    return Stated(float(problem.value), found, problem.status)


_TIGHT: dict[str, dict[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-11, "max_iter": 300},
    "OSQP": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 400_000, "polishing": True},
}
