"""Programmes of other fields as they were published, and what others' controllers answer.

Numbers are those of the sources; states are outputs, and discrete plants have a continuous one that
gives them back.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg

from models import LinearPlant

INF = np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class Published:
    """x+ = A x + B u, sum of (x - xr)'Q(x - xr) + u'R u + du'Rd du, and x_N'QN x_N at the end."""

    A: np.ndarray
    B: np.ndarray
    period: float
    steps: int
    Q: np.ndarray  # diagonals
    R: np.ndarray
    QN: np.ndarray
    umin: np.ndarray
    umax: np.ndarray
    xmin: np.ndarray
    xmax: np.ndarray
    last: int  # sample up to which states are limited, from the first to come on
    x0: np.ndarray
    xr: np.ndarray
    Rd: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def plant(self) -> LinearPlant:
        n, m = self.B.shape
        both = np.eye(n + m)
        both[:n, :n], both[:n, n:] = self.A, self.B
        flow = scipy.linalg.logm(both).real / self.period
        return LinearPlant(
            A=flow[:n, :n],
            B=flow[:n, n:],
            E=np.zeros((n, 0)),
            C=np.eye(n),
            Cz=np.eye(n),
            outputs=[f"x{i}" for i in range(n)],
            inputs=[f"u{i}" for i in range(m)],
        )

    @property
    def costs(self) -> dict[str, float]:
        found = {f"x{i}": float(q) for i, q in enumerate(self.Q) if q}
        found |= {f"u{i}": float(r) for i, r in enumerate(self.R) if r}
        return found | {
            f"rate of u{i}": float(r) * self.period**2 for i, r in enumerate(self.Rd) if r
        }

    @property
    def terminal(self) -> dict[str, float]:
        return {f"x{i}": float(q) for i, q in enumerate(self.QN) if q}

    @property
    def limits(self) -> list[tuple[str, float, float, frozenset[int] | None]]:
        at = frozenset(range(1, self.last + 1))
        found = [
            (f"x{i}", float(a), float(b), at)
            for i, (a, b) in enumerate(zip(self.xmin, self.xmax, strict=True))
            if np.isfinite([a, b]).any()
        ]
        bounds = zip(self.umin, self.umax, strict=True)
        return found + [(f"u{i}", float(a), float(b), None) for i, (a, b) in enumerate(bounds)]


def mass_chain() -> Published:
    """acados, examples/acados_matlab_octave/linear_mass_spring_model: four masses, three forces.

    After Y. Wang and S. Boyd, "Fast model predictive control using online optimization", IEEE
    TCST 18, 2010.  Stages are half a second long and weigh as much.
    """
    k, T = 4, 0.5
    A, B = np.zeros((8, 8)), np.zeros((8, 3))
    A[:k, k:] = np.eye(k)
    A[k:, :k] = -2.0 * np.eye(k) + np.eye(k, k=1) + np.eye(k, k=-1)
    B[k : k + 3] = np.eye(3)
    both = np.zeros((11, 11))
    both[:8, :8], both[:8, 8:] = A, B
    over = scipy.linalg.expm(both * T)
    far = np.concatenate([np.full(k, 4.0), np.full(k, INF)])
    x0 = np.zeros(8)
    x0[:2] = 2.5
    return Published(
        A=over[:8, :8], B=over[:8, 8:], period=T, steps=20,
        Q=0.5 * T * np.ones(8), R=0.5 * T * np.full(3, 2.0), QN=0.5 * np.ones(8),
        umin=np.full(3, -0.5), umax=np.full(3, 0.5), xmin=-far, xmax=far, last=19,
        x0=x0, xr=np.zeros(8),
    )  # fmt: skip


def oscillating_masses() -> Published:
    """do-mpc, examples/oscillating_masses_discrete: two masses, one force, its changes weighed."""
    A = [
        [0.763, 0.460, 0.115, 0.020],
        [-0.899, 0.763, 0.420, 0.115],
        [0.115, 0.020, 0.763, 0.460],
        [0.420, 0.115, -0.899, 0.763],
    ]
    return Published(
        A=np.array(A), B=np.array([[0.014], [0.063], [0.221], [0.367]]), period=0.1, steps=20,
        Q=np.ones(4), R=np.zeros(1), QN=np.ones(4), Rd=np.array([1e-4]),
        umin=np.array([-5.0]), umax=np.array([5.0]), xmin=np.full(4, -3.0), xmax=np.full(4, 3.0),
        last=20, x0=np.array([1.5, -0.5, -1.5, 0.5]), xr=np.zeros(4),
    )  # fmt: skip


def quadcopter() -> Published:
    """OSQP, docs/examples/mpc.rst: twelve states, four rotors, a metre up."""
    A, B = np.eye(12), np.zeros((12, 4))
    for i in range(3):
        A[i, 6 + i], A[3 + i, 9 + i], A[9 + i, 9 + i] = 0.1, 0.0992, 0.9846
    for i, sign in ((0, 1.0), (1, -1.0)):
        A[3 + i, i], A[3 + i, 6 + i] = 0.0488 * sign, 0.0016 * sign
        A[9 + i, i], A[9 + i, 6 + i] = 0.9734 * sign, 0.0488 * sign
    across, along = np.array([0.0, -1.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0, 0.0])
    turn, lift = np.array([-1.0, 1.0, -1.0, 1.0]), np.ones(4)
    B[0], B[1], B[2] = 0.0726 * across, 0.0726 * along, 0.0152 * turn
    B[3], B[4], B[5] = 0.0006 * across, -0.0006 * along, 0.0106 * lift
    B[6], B[7], B[8] = 1.4512 * across, 1.4512 * along, 0.3049 * turn
    B[9], B[10], B[11] = 0.0236 * across, -0.0236 * along, 0.2107 * lift
    high = np.full(12, INF)
    high[:2] = np.pi / 6
    low = -high
    low[5] = -1.0
    xr = np.zeros(12)
    xr[2] = 1.0
    Q = np.array([0, 0, 10, 10, 10, 10, 0, 0, 0, 5, 5, 5], dtype=float)
    return Published(
        A=A, B=B, period=0.1, steps=10, Q=Q, R=np.full(4, 0.1), QN=Q,
        umin=np.full(4, 9.6 - 10.5916), umax=np.full(4, 13.0 - 10.5916), xmin=low, xmax=high,
        last=10, x0=np.zeros(12), xr=xr,
    )  # fmt: skip


PROBLEMS = {
    "mass chain": mass_chain, "oscillating masses": oscillating_masses, "quadcopter": quadcopter
}  # fmt: skip


def do_mpc_answer(p: Published, x0: np.ndarray) -> np.ndarray:
    """Return the first inputs of do-mpc's MPC."""
    import casadi as ca

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what else could be installed
        import do_mpc

        n, m = p.B.shape
        model = do_mpc.model.Model("discrete", "SX")
        x, u = model.set_variable("_x", "x", (n, 1)), model.set_variable("_u", "u", (m, 1))
        model.set_rhs("x", ca.DM(p.A) @ x + ca.DM(p.B) @ u)
        model.setup()
        x, u = model.x["x"], model.u["u"]
        peer = do_mpc.controller.MPC(model)
        peer.settings.n_horizon, peer.settings.t_step = p.steps, p.period
        peer.settings.store_full_solution = False
        peer.settings.supress_ipopt_output()
        peer.settings.nlpsol_opts |= {
            "ipopt.tol": 1e-12, "ipopt.bound_relax_factor": 0.0, "ipopt.acceptable_iter": 0
        }  # fmt: skip
        off = x - ca.DM(p.xr)
        stage = ca.dot(ca.DM(p.Q), off**2) + ca.dot(ca.DM(p.R), u**2)
        peer.set_objective(mterm=ca.dot(ca.DM(p.QN), off**2), lterm=stage)
        peer.set_rterm(u=p.Rd if len(p.Rd) else np.zeros(m))
        peer.bounds["lower", "_u", "u"], peer.bounds["upper", "_u", "u"] = p.umin, p.umax
        peer.bounds["lower", "_x", "x"], peer.bounds["upper", "_x", "x"] = p.xmin, p.xmax
        peer.setup()
        peer.x0 = x0
        peer.set_initial_guess()
        return np.asarray(peer.make_step(x0)).ravel()


def acados_answer(p: Published, x0: np.ndarray) -> np.ndarray:
    """Return the first inputs of acados' SQP with HPIPM, generated and compiled."""
    import casadi as ca
    from mpc_peers import acados_solver

    n, m = p.B.shape
    x, u = ca.SX.sym("x", n), ca.SX.sym("u", m)
    limited = np.flatnonzero(np.isfinite(p.xmin) | np.isfinite(p.xmax))

    def state(ocp: Any) -> None:
        ocp.model.name, ocp.model.x, ocp.model.u = "published", x, u
        ocp.model.disc_dyn_expr = ca.DM(p.A) @ x + ca.DM(p.B) @ u
        ocp.dims.N, ocp.solver_options.tf = p.steps, float(p.steps)  # so that stages weigh one
        ocp.cost.cost_type, ocp.cost.cost_type_e = "NONLINEAR_LS", "NONLINEAR_LS"
        ocp.model.cost_y_expr, ocp.model.cost_y_expr_e = ca.vertcat(x - ca.DM(p.xr), u), x - p.xr
        ocp.cost.W, ocp.cost.W_e = np.diag(2.0 * np.r_[p.Q, p.R]), np.diag(2.0 * p.QN)
        ocp.cost.yref, ocp.cost.yref_e = np.zeros(n + m), np.zeros(n)
        c = ocp.constraints
        c.lbu, c.ubu, c.idxbu = p.umin, p.umax, np.arange(m)
        far = 1e6
        c.lbx, c.ubx, c.idxbx = (
            np.maximum(p.xmin, -far)[limited], np.minimum(p.xmax, far)[limited], limited
        )  # fmt: skip
        if p.last == p.steps:
            c.lbx_e, c.ubx_e, c.idxbx_e = c.lbx, c.ubx, c.idxbx
        c.x0 = x0
        ocp.solver_options.nlp_solver_type = "SQP"
        ocp.solver_options.qp_solver_cond_N = p.steps

    solver = acados_solver(state)
    if solver.solve() != 0:
        raise ValueError("acados found no optimum")
    return np.asarray(solver.get(0, "u"))
