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


# Synthesis: plants whose best controllers are printed --------------------------------------------


@dataclass(frozen=True, kw_only=True)
class PublishedPI:
    """K (1 + 1/(T_i s)) of the largest K/T_i with a sensitivity of at most `max_sensitivity`."""

    poles: tuple[float, ...]  # of G, with G(0) = 1
    max_sensitivity: float
    gain: float
    integral_time: float

    @property
    def plant(self) -> LinearPlant:
        """G, its output and the integral of it measured, with a load disturbance at its input."""
        n = len(self.poles)
        A, B = np.diag(self.poles, 0) + np.eye(n, k=-1), np.eye(n, 1) * abs(np.prod(self.poles))
        C = np.eye(1, n, k=n - 1)
        A = np.block([[A, np.zeros((n, 1))], [C, np.zeros((1, 1))]])
        B, C = np.vstack([B, [[0.0]]]), np.eye(2, n + 1, k=n - 1)
        return LinearPlant(
            A=A, B=B, E=B, C=C, Cz=C[:1], inputs=("u",), disturbances=("load",),
            measurements=("y", "integral"), outputs=("y",),
        )  # fmt: skip

    @property
    def slow(self) -> tuple[np.ndarray, np.ndarray]:
        """A load so slow that it is answered by s/k_i alone: its least variance has most k_i."""
        return np.array([1e-4, 3e-4, 1e-3]), np.ones(3)


#: K. J. Astrom, H. Panagopoulos and T. Hagglund, "Design of PI controllers based on non-convex
#: optimization", Automatica 34, 1998: the first two processes of its table, 1/(s + 1)^3 and
#: 1/((s + 1) (1 + 0.2 s) (1 + 0.04 s) (1 + 0.008 s)).
PI_DESIGNS = {
    f"{name}, M_s {bound}": PublishedPI(
        poles=poles, max_sensitivity=bound, gain=gain, integral_time=time
    )
    for name, poles, rows in (
        ("three equal lags", (-1.0, -1.0, -1.0), ((1.4, 0.633, 1.95), (2.0, 1.22, 1.78))),
        ("four lags", (-1.0, -5.0, -25.0, -125.0), ((1.4, 1.93, 0.74), (2.0, 4.13, 0.59))),
    )
    for bound, gain, time in rows
}


@dataclass(frozen=True, kw_only=True, eq=False)
class PublishedLQG:
    """u = -F x^, x^' = A x^ + B u + K (y - C x^), of the least weighted variance."""

    plant: LinearPlant
    minimise: dict[str, float]
    noise: dict[str, float]  # intensities of white noise
    F: np.ndarray
    K: np.ndarray

    @property
    def controller(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A, B, C, D of u = +C(s) y."""
        p, F, K = self.plant, np.atleast_2d(self.F), np.reshape(self.K, (-1, 1))
        return p.A - p.B @ F - K @ p.C, K, -F, np.zeros((1, 1))


def position_servo() -> PublishedLQG:
    """H. Kwakernaak and R. Sivan, Linear Optimal Control Systems, 1972, examples 3.8 and 4.4.

    Position control by a DC motor: 0.787 rad/(V s2), 4.6 1/s, weight 0.00002 rad2/V2; a torque
    disturbance of 10 N2 m2 s on 0.1 1/(kg m2), an error of 1e-7 rad2 s of the angle.
    """
    plant = LinearPlant(
        A=[[0.0, 1.0], [0.0, -4.6]], B=[[0.0], [0.787]], E=[[0.0, 0.0], [0.1, 0.0]],
        C=[[1.0, 0.0]], F=[[0.0, 1.0]], Cz=[[1.0, 0.0], [0.0, 0.0]], Dz=[[0.0], [1.0]],
        inputs=("voltage",), disturbances=("torque", "error"), measurements=("angle",),
        outputs=("position", "effort"),
    )  # fmt: skip
    return PublishedLQG(
        plant=plant, minimise={"position": 1.0, "effort": 0.00002},
        noise={"torque": 10.0, "error": 1e-7},
        F=np.array([223.6, 18.69]), K=np.array([40.36, 814.3]),
    )  # fmt: skip


def no_margins(weight: float = 12.0) -> PublishedLQG:
    """J. C. Doyle, "Guaranteed margins for LQG regulators", IEEE TAC 23, 1978.

    x' = [1 1; 0 1] x + [0; 1] u + [1; 1] w, y = [1 0] x + v, cost weight (x1 + x2)^2 + u^2, w as
    strong as that weight: F = f [1 1] and K = f [1; 1] with f = 2 + sqrt(4 + weight).
    """
    f = 2.0 + np.sqrt(4.0 + weight)
    plant = LinearPlant(
        A=[[1.0, 1.0], [0.0, 1.0]], B=[[0.0], [1.0]], E=[[1.0, 0.0], [1.0, 0.0]],
        C=[[1.0, 0.0]], F=[[0.0, 1.0]], Cz=[[1.0, 1.0], [0.0, 0.0]], Dz=[[0.0], [1.0]],
        inputs=("u",), disturbances=("w", "v"), measurements=("y",), outputs=("sum", "effort"),
    )  # fmt: skip
    return PublishedLQG(
        plant=plant, minimise={"sum": weight, "effort": 1.0}, noise={"w": weight, "v": 1.0},
        F=f * np.ones(2), K=f * np.ones(2),
    )  # fmt: skip


def h2_example() -> tuple[LinearPlant, dict[str, float], float]:
    """K. Zhou and J. C. Doyle, Essentials of Robust Control, H2 example; its optimum is 8.9582.

    As RobustAndOptimalControl.jl states it; every noise has the intensity one.
    """
    plant = LinearPlant(
        A=[[-1.0, 0.0, 4.0], [0.0, 2.0, 0.0], [0.0, 0.0, -3.0]], B=np.ones((3, 1)),
        E=[[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], C=np.ones((1, 3)), F=[[0.0, 1.0]],
        Cz=[[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], Dz=[[0.0], [1.0]], inputs=("command",),
        disturbances=("w", "n"), outputs=("z", "u"),
    )  # fmt: skip
    return plant, {"z": 1.0, "u": 1.0}, 8.9582


def scherer(which: str) -> tuple[LinearPlant, dict[str, float], float]:
    """C. Scherer, P. Gahinet and M. Chilali, IEEE TAC 42, 1997, example 7, with its H2 optima.

    ``two outputs`` weighs x1 and u, ``three outputs`` x2, x3 and u; the noise has intensity one.
    """
    rows, optimum = {
        "two outputs": ([[1.0, 0, 0, 0], [0, 0, 0, 1.0]], 13.0752),
        "three outputs": ([[0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]], 7.7484),
    }[which]
    both = np.array(rows)
    plant = LinearPlant(
        A=[[0.0, 10.0, 2.0], [-1.0, 1.0, 0.0], [0.0, 2.0, -5.0]], B=[[0.0], [1.0], [0.0]],
        E=[[1.0], [0.0], [1.0]], C=[[0.0, 1.0, 0.0]], F=[[2.0]], Cz=both[:, :3], Dz=both[:, 3:],
    )  # fmt: skip
    return plant, dict.fromkeys(plant.outputs, 1.0), optimum
