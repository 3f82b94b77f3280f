"""A predictive controller's problem, stage by stage and symbolic, for those who solve it otherwise.

    LinearMPC or NonlinearMPC --> Horizon: after, gap, cost, rows, end_cost --> mpc_peers

The same cost, limits and prices as ours, stated by other means: nothing is eliminated or condensed.
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from mpc.linear import WATCHED, LinearMPC, path_of_sea
from mpc.nonlinear import NonlinearMPC

__all__ = ["Horizon"]

FloatArray = npt.NDArray[np.float64]


class Horizon:
    """A controller's problem as functions of one stage, in units of the size of one.

    Stage j has the state x_j, the move v_j, the forces n_j that the linear plant lacks (none if the
    controller is linear), and parameters: what hook and constants add to the state, to the forces'
    arguments and to the tension.

    Parameters
    ----------
    controller
        One with a limit on neither power nor temperature.

    Raises
    ------
    ValueError
        If it has.
    """

    def __init__(self, controller: LinearMPC) -> None:
        p, model = controller.programme, controller.model
        if controller.window.limits.power < math.inf:
            raise ValueError("peers know no limit on the power")
        self.controller, self.N, self.n = controller, p.steps, model.winch.size
        winch = model.winch
        #: Block of each sample, and the samples at which one begins.
        self.of = np.repeat(np.arange(len(p.blocks)), p.blocks)
        self.starts = np.cumsum((0, *p.blocks[:-1]))
        self.unit = np.asarray(model.scale[: self.n])
        self.stage = controller.stage if isinstance(controller, NonlinearMPC) else None
        self.forces, self.winch = 0, winch
        if self.stage is not None:
            self.forces = len(self.stage.channels)
            self.winch = self.stage.winch
        self.kinds = sorted(set(p.kind.tolist()))
        scale, watched = {}, np.zeros((self.N + 1, len(self.kinds)), dtype=np.bool_)
        limits = {}
        for k, (j, kind) in enumerate(zip(p.at.tolist(), p.kind.tolist(), strict=True)):
            watched[j, self.kinds.index(kind)] = True
            scale[kind] = float(p.scale[k])
            limits[kind] = float(p.row_low[k]), float(p.row_high[k])
        self.watched, self._scale = watched, scale
        self.low = np.array([limits[k][0] for k in self.kinds])
        self.high = np.array([limits[k][1] for k in self.kinds])
        self._maps()
        self._functions()
        self.linear_price, self.quadratic_price = controller.qp.linear, controller.qp.quadratic

    def _maps(self) -> None:
        """Make the parameters of all stages linear functions of chi."""
        model, p, weights = self.controller.model, self.controller.programme, self.controller
        winch, N, n, size = self.winch, self.N, self.n, model.size
        path = np.zeros((2 * (N + 1), size))
        path[:, model.sea_at] = path_of_sea(model, N)
        at = model.constants_at.start
        c = np.zeros((2, size))
        c[0, at] = c[1, at + 1] = 1.0
        shift = np.zeros(size)
        shift[at + 3] = 1.0
        parts, self.count = [], 0
        for j in range(N + 1):
            here = path[2 * j : 2 * j + 2]
            ends = np.vstack([here, path[2 * j + 2 : 2 * j + 4] if j < N else here])
            moved = (winch.from_hook @ ends + winch.from_constants @ c) / self.unit[:, None]
            tension = winch.tension_from_hook @ here + shift
            row = [moved, tension[None, :] / winch.rest_tension]
            row.append((winch.steady @ c / p.unit)[None, :])
            if self.stage is not None:
                drift = self.stage.drift
                over = drift.hook @ ends + drift.constants @ c
                row.append(over[None, :] / p.unit)
                row.append(self.stage.C_hook @ ends + self.stage.C_constants @ c)
            parts.append(np.vstack(row))
        self.count = len(parts[0])
        self._known = np.ascontiguousarray(np.vstack(parts))
        N_zeta, nh = weights.regulator.N, model.sea.order
        end = np.zeros((n, size))
        ahead = np.linalg.matrix_power(model.A[model.sea_at, model.sea_at], N)
        end[:, model.sea_at] = N_zeta[:, :nh] @ ahead
        end += N_zeta[:, nh:] @ c
        self._end = 2.0 * self.unit[:, None] * end / p.cost

    def parameters(self, chi: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the scaled state (n,), the stages' parameters (N + 1, count), and the end's."""
        known = (self._known @ chi).reshape(self.N + 1, self.count)
        return chi[: self.n] / self.unit, known, self._end @ chi

    def _functions(self) -> None:
        controller, winch, n = self.controller, self.winch, self.n
        p, weights, unit = controller.programme, controller.regulator, self.unit
        x, v, f = ca.SX.sym("x", n), ca.SX.sym("v"), ca.SX.sym("f", self.forces)
        q = ca.SX.sym("q", self.count)
        moved, tension, target, more = q[:n], q[n], q[n + 1], q[n + 3 :]
        real, force = ca.DM(unit) * x, f * winch.rest_tension
        after = ca.DM(winch.A / unit[:, None]) @ real + ca.DM(winch.B[:, 0] / unit) * p.unit * v
        after += moved
        gap, asked = ca.SX(0, 1), v  # of the drive, over the peak torque
        if self.stage is not None:
            s = self.stage
            asked = v * (1.0 + s.drift.mean) + q[n + 2]
            asked += ca.dot(ca.DM(s.drift.state), real) / p.unit
            after += ca.DM(s.from_forces / unit[:, None]) @ force
            y = ca.DM(s.C) @ real + ca.DM(s.D) * p.unit * v + more
            y += ca.DM(np.asarray(s.rest)) + ca.DM(s.own) @ force
            gap = f - s.law.function(y) / winch.rest_tension
        self.after = ca.Function("after", [x, v, f, q], [after])
        self.gap = ca.Function("gap", [x, v, f, q], [gap])
        payload = ca.dot(ca.DM(winch.payload), real)
        rho = weights.weights[1] * p.unit**2
        cost = (payload**2 + rho * (v - target) ** 2) / p.cost
        self.cost = ca.Function("cost", [x, v, q], [cost])
        self.residuals = ca.Function("residuals", [x, v, q], [ca.vertcat(payload, v - target)])
        self.weights = np.array([1.0, rho]) / p.cost
        e = ca.SX.sym("e", n)
        P = ca.DM(weights.P * np.outer(unit, unit) / p.cost)
        self.end_cost = ca.Function("end", [x, e], [ca.bilin(P, x, x) + ca.dot(e, x)])
        rows = []
        for kind in self.kinds:
            name = WATCHED[kind]
            if name == "command":
                value = winch.back * ca.dot(ca.DM(winch.speed), real) + asked * p.unit / winch.gain
            elif name == "tension":
                value = ca.dot(ca.DM(winch.tension), real) + winch.rest_tension * tension
            else:
                of = winch.speed if name == "speed" else winch.payload
                value = ca.dot(ca.DM(of), real)
            rows.append(self._scale[kind] * value)
        self.rows = ca.Function("rows", [x, v, q], [ca.vertcat(*rows)])

    def price(self, slack: Any) -> Any:
        """Return what slacks cost."""
        squares = 0.5 * self.quadratic_price * ca.sumsqr(slack)
        return self.linear_price * ca.sum1(slack) + squares
