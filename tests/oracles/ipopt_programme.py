r"""The programme of the nonlinear controller once more, with every state a variable, for IPOPT.

States, forces, moves and slacks are variables, and the dynamics of every sample a constraint, as
`mpc.nonlinear.stage` has them; nothing is eliminated, linearised or condensed, and derivatives are
exact, those of second order included.  It takes a hundred times as long as `NonlinearMPC` and is
here to be read, and to check its converged iterations: the same answer from another statement by
another solver (A. Waechter and L. T. Biegler, Math. Programming 106, 2006).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from one_sample import advanced

from models.basics import SolverError
from mpc.linear import WATCHED
from mpc.nonlinear import NonlinearMPC

__all__ = ["NlpAnswer", "nlp_oracle"]

FloatArray = npt.NDArray[np.float64]

_OWNER = "nonlinear oracle"


@dataclass(frozen=True, kw_only=True, eq=False)
class NlpAnswer:
    """IPOPT's answer.

    Attributes
    ----------
    v
        Moves, (nb,).
    states
        The winch's state at every sample, (N + 1, n).
    forces
        What the linear plant lacks in every sample, (N, m).
    slack
        Largest violation of a soft row, over its limit.
    iterations
        Of IPOPT.
    """

    v: FloatArray
    states: FloatArray
    forces: FloatArray
    slack: float
    iterations: int


def nlp_oracle(
    controller: NonlinearMPC, chi: FloatArray, *, start: FloatArray | None = None
) -> NlpAnswer:
    """Return the optimum for a state by IPOPT.

    Parameters
    ----------
    controller
        What is to be checked; its predictor must be its own sea.
    chi
        State of its prediction model, (n,).
    start
        Moves to start from, (nb,); by default zero.

    Raises
    ------
    SolverError
        If IPOPT does not converge.
    """
    model, p, stage, weights = (
        controller.model, controller.programme, controller.stage, controller.regulator,
    )  # fmt: skip
    winch, N, nb = stage.winch, p.steps, len(p.blocks)
    n, m = winch.size, len(stage.channels)
    over = model.A[model.sea_at, model.sea_at]
    sea = [chi[model.sea_at]]
    for _ in range(N):
        sea.append(over @ sea[-1])
    path = np.array([model.hook[:, model.sea_at] @ state for state in sea])
    at = model.constants_at.start
    c = chi[at : at + 2]
    x0 = chi[:n]
    of = np.repeat(np.arange(nb), p.blocks)

    # In units in which a metre of the load and a full torque are one.
    unit = np.maximum(np.abs(winch.moved).max(axis=1), 1e-9)
    unit[unit == 1e-9] = 1.0
    force = winch.rest_tension
    X, F, V = ca.MX.sym("X", n, N), ca.MX.sym("F", m, N), ca.MX.sym("V", nb)
    states = [ca.DM(x0)] + [ca.DM(unit) * X[:, j] for j in range(N)]
    d = [p.unit * V[int(of[j])] for j in range(N)]
    gaps: list[ca.MX] = []
    for j in range(N):
        ends = np.concatenate([path[j], path[j + 1]])
        known = winch.from_hook @ ends + winch.from_constants @ c
        after = ca.mtimes(ca.DM(winch.A), states[j]) + ca.DM(winch.B) * d[j] + ca.DM(known)
        if m > 0:
            n_j = force * F[:, j]
            after += ca.mtimes(ca.DM(stage.from_forces), n_j)
            shown = stage.C_hook @ ends + stage.C_constants @ c + stage.rest
            y = ca.mtimes(ca.DM(stage.C), states[j]) + ca.DM(stage.D) * d[j] + ca.DM(shown)
            y += ca.mtimes(ca.DM(stage.own), n_j)
            gaps.append((n_j - stage.law.function(y)) / force)
        gaps.append((states[j + 1] - after) / ca.DM(unit))

    cost = ca.MX(0)
    row = ca.DM(winch.payload).T
    for j in range(1, N):
        cost += ca.mtimes(row, states[j]) ** 2
    steady = float(winch.steady @ c)
    for j in range(N):
        cost += weights.weights[1] * (d[j] - steady) ** 2
    zeta = np.concatenate([sea[N], c])
    cost += ca.bilin(ca.DM(weights.P), states[N], states[N])
    cost += 2.0 * ca.dot(states[N], ca.DM(weights.N @ zeta))
    cost = cost / p.cost

    rows, lows, highs = _rows(controller, states, d, path, c)
    S = ca.MX.sym("S", len(rows))
    qp = controller.qp
    cost += ca.sum1(qp.linear * S + 0.5 * qp.quadratic * S**2)
    values = ca.vertcat(*rows) if rows else ca.MX(0, 1)
    speed = float(winch.speed @ x0)
    low, high = controller.hard_bounds(speed)

    variables = ca.veccat(X, F, V, S)
    g = ca.vertcat(*gaps, values - S, values + S)
    count = g.numel() - 2 * len(rows)
    lbg = np.concatenate([np.zeros(count), np.full(len(rows), -np.inf), lows])
    ubg = np.concatenate([np.zeros(count), highs, np.full(len(rows), np.inf)])
    free = np.full((n + m) * N, np.inf)
    lbx = np.concatenate([-free, low, np.zeros(len(rows))])
    ubx = np.concatenate([free, high, np.full(len(rows), np.inf)])
    options: dict[str, Any] = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-11,
        # With 1e3 it stops 6e-5 short of the optimum where the cost is flat, with 1e4 1e-9.
        "ipopt.obj_scaling_factor": 1e4,
        "ipopt.acceptable_iter": 0,
        "ipopt.max_iter": 500,
        "ipopt.honor_original_bounds": "yes",
        "ipopt.bound_relax_factor": 0.0,
        "error_on_fail": False,
    }
    solver = ca.nlpsol("oracle", "ipopt", {"x": variables, "f": cost, "g": g}, options)
    first = np.zeros(variables.numel())
    moves = np.zeros(nb) if start is None else start
    _roll_out(controller, x0, path, c, of, moves, unit, first[: n * N])
    first[(n + m) * N : (n + m) * N + nb] = moves
    answer = solver(x0=first, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
    if not solver.stats()["success"]:
        raise SolverError(f"{_OWNER}: IPOPT found no optimum: {solver.stats()['return_status']}")
    found = np.asarray(answer["x"]).ravel()
    after = found[: n * N].reshape(N, n) * unit
    forces = found[n * N : (n + m) * N].reshape(N, m) * force
    v = found[(n + m) * N :][:nb]
    return NlpAnswer(
        v=v,
        states=np.vstack([x0, after]),
        forces=forces,
        slack=float(found[(n + m) * N + nb :].max(initial=0.0)),
        iterations=int(solver.stats()["iter_count"]),
    )


def _rows(
    controller: NonlinearMPC,
    states: list[Any],
    d: list[Any],
    path: FloatArray,
    constants: FloatArray,
) -> tuple[list[Any], FloatArray, FloatArray]:
    """Return the soft rows, scaled to their limits, and these."""
    winch, p, drift = controller.model.winch, controller.programme, controller.stage.drift
    scale = controller.programme.scale
    rows: list[Any] = []
    for kind, at, factor in zip(p.kind, p.at, scale, strict=True):
        name, j = WATCHED[kind], int(at)
        if name == "tension":
            value = ca.dot(ca.DM(winch.tension), states[j])
            value += float(winch.tension_from_hook @ path[j])
            value += float(winch.tension_from_constants @ np.asarray(constants))
        elif name == "command":
            ends, c = np.concatenate([path[j], path[j + 1]]), np.asarray(constants)
            over = ca.dot(ca.DM(drift.state), states[j]) + drift.mean * d[j]
            over += float(drift.hook @ ends + drift.constants @ c)
            value = winch.back * ca.dot(ca.DM(winch.speed), states[j]) + (d[j] + over) / winch.gain
        else:
            of = winch.speed if name == "speed" else winch.payload
            value = ca.dot(ca.DM(of), states[j])
        rows.append(float(factor) * value)
    low, high = np.array(controller.programme.row_low), np.array(controller.programme.row_high)
    window = controller.window
    if window.narrows:
        starts = np.cumsum((0, *p.blocks[:-1]))[1:].tolist()
        for j in starts:
            speed = ca.dot(ca.DM(winch.speed), states[j])
            # |torque| |speed| <= P and |torque| speed^2 <= B are one row, over the lesser power.
            power = window.limits.power
            if np.isfinite(window.limits.breakdown):
                power = ca.fmin(power, window.limits.breakdown / ca.fmax(ca.fabs(speed), 1e-9))
            rows.append((winch.rest_torque + d[j]) * speed / power)
        low = np.concatenate([low, -np.ones(len(starts))])
        high = np.concatenate([high, np.ones(len(starts))])
    return rows, np.where(low < -1e19, -np.inf, low), np.where(high > 1e19, np.inf, high)


def _roll_out(
    controller: NonlinearMPC,
    x0: FloatArray,
    path: FloatArray,
    c: FloatArray,
    of: npt.NDArray[np.int64],
    moves: FloatArray,
    unit: FloatArray,
    into: FloatArray,
) -> None:
    """Write the scaled states of moves, sample by sample."""
    x, n = x0, len(x0)
    for j in range(len(of)):
        ends = np.concatenate([path[j], path[j + 1]])
        x = advanced(controller.stage, x, controller.programme.unit * float(moves[of[j]]), ends, c)
        into[j * n : (j + 1) * n] = x / unit
