"""Whole predictive controllers that others built, on the problem of ours.

    Horizon: stages, symbolic --> do-mpc, acados, CasADi with IPOPT

All are given the estimate of the state and return the first move; they are spared the estimation,
which is part of a step of ours.  Model, cost, limits and prices of soft limits are equal to the
digit, as the first moves show.  Blocks of moves are shared variables for IPOPT; for do-mpc, which
does not know them, a move that is held is a state; acados gets a move for every sample.

do-mpc (https://www.do-mpc.com) and IPOPT build on CasADi; acados
(https://github.com/acados/acados) generates C, for which it needs a compiler.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import math
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt
from mpc_horizon import Horizon

from mpc.linear import WATCHED

__all__ = ["Peer", "acados_peer", "acados_solver", "do_mpc_peer", "ipopt_peer"]

FloatArray = npt.NDArray[np.float64]
_BEYOND = 1e3  # what a limit is moved away by where nobody looks, over the limit
_CONDENSED = 24  # stages that acados leaves of the horizon


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A controller of somebody else.

    Attributes
    ----------
    give
        Takes the estimate chi and the lowest and highest moves, (nb,).
    solve
        Returns the first move, NaN if there is none.
    """

    give: Callable[[FloatArray, FloatArray, FloatArray], None]
    solve: Callable[[], float]


def ipopt_peer(horizon: Horizon, *, tight: bool = False) -> Peer:
    """Return CasADi's IPOPT on multiple shooting, set up once, started at the last answer.

    Its tolerance is the default one, or as tight as `ipopt_programme` has it.
    """
    h = horizon
    N, n, m, nb = h.N, h.n, h.forces, len(h.starts)
    X, V, F = ca.MX.sym("X", n, N + 1), ca.MX.sym("V", 1, nb), ca.MX.sym("F", m, N)
    Q, E = ca.MX.sym("Q", h.count, N + 1), ca.MX.sym("E", h.n)
    count = int(h.watched.sum())
    S = ca.MX.sym("S", count)
    cost, gaps, rows, lbg, ubg = h.price(S), [], [], [], []
    cost += h.end_cost(X[:, N], E)
    seen = 0
    for j in range(N + 1):
        v = V[int(h.of[j])] if j < N else ca.MX(0)
        if j < N:
            cost += h.cost(X[:, j], v, Q[:, j])
            gaps.append(X[:, j + 1] - h.after(X[:, j], v, F[:, j], Q[:, j]))
            if m:
                gaps.append(h.gap(X[:, j], v, F[:, j], Q[:, j]))
        values = h.rows(X[:, j], v, Q[:, j])
        for k in np.flatnonzero(h.watched[j]).tolist():
            rows += [values[k] - S[seen], values[k] + S[seen]]
            lbg += [-math.inf, h.low[k] if h.low[k] > -1e19 else -math.inf]
            ubg += [h.high[k] if h.high[k] < 1e19 else math.inf, math.inf]
            seen += 1
    variables = ca.veccat(X, V, F, S)
    g = ca.vertcat(*gaps, *rows)
    options: dict[str, Any] = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    if tight:
        options |= {"ipopt.tol": 1e-11, "ipopt.acceptable_iter": 0, "ipopt.bound_relax_factor": 0.0}
        options |= {"ipopt.obj_scaling_factor": 1e3}
        options |= {"ipopt.honor_original_bounds": "yes", "ipopt.max_iter": 500}
    given = ca.veccat(Q, E)
    nlp = {"x": variables, "f": cost, "g": g, "p": given}
    solver = ca.nlpsol("peer", "ipopt", nlp, {**options, "error_on_fail": False})
    equations = g.numel() - len(rows)
    bounds = {
        "lbg": ca.DM(np.concatenate([np.zeros(equations), lbg])),
        "ubg": ca.DM(np.concatenate([np.zeros(equations), ubg])),
    }
    free = np.full(m * N, math.inf)
    states = np.full(n * (N + 1), math.inf)
    lbx = np.concatenate([-states, np.zeros(nb), -free, np.zeros(count)])
    ubx = np.concatenate([states, np.zeros(nb), free, np.full(count, math.inf)])
    first = n * (N + 1)
    last: dict[str, Any] = {"x0": np.zeros(len(lbx)), "p": None}

    def give(chi: FloatArray, low: FloatArray, high: FloatArray) -> None:
        x, known, end = h.parameters(chi)
        lbx[:n] = ubx[:n] = x
        lbx[first : first + nb], ubx[first : first + nb] = low, high
        last["p"] = np.concatenate([known.ravel(), end])

    def solve() -> float:
        answer = solver(lbx=lbx, ubx=ubx, **last, **bounds)
        last["x0"] = answer["x"]
        return float(answer["x"][first]) if solver.stats()["success"] else math.nan

    return Peer(give=give, solve=solve)


def do_mpc_peer(horizon: Horizon) -> Peer:
    """Return do-mpc's MPC, which steps by IPOPT."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what else could be installed
        import do_mpc

        h = horizon
        N, n, nk = h.N, h.n, len(h.kinds)
        model = do_mpc.model.Model("discrete", "SX")
        x = model.set_variable("_x", "x", (n, 1))
        held = model.set_variable("_x", "held")
        v = model.set_variable("_u", "v")
        begins = model.set_variable("_tvp", "begins")
        # Slacks as inputs, because do-mpc's own cost in proportion only.
        s = model.set_variable("_u", "s", (nk, 1))
        q = model.set_variable("_tvp", "q", (h.count, 1))
        then = model.set_variable("_tvp", "q_after", (h.count, 1))
        off = model.set_variable("_tvp", "off", (nk, 1))
        end = model.set_variable("_tvp", "end", (n, 1))
        f = model.set_variable("_z", "f", (h.forces, 1)) if h.forces else ca.SX(0, 1)
        move = begins * v + (1 - begins) * held
        model.set_rhs("x", h.after(x, move, f, q))
        model.set_rhs("held", move)
        if h.forces:
            model.set_alg("gap", h.gap(x, move, f, q))
        model.setup()
        # From here on its symbols are others.
        x, s, begins = model.x["x"], model.u["s"], model.tvp["begins"]
        q, then, off, end = (model.tvp[name] for name in ("q", "q_after", "off", "end"))
        move = begins * model.u["v"] + (1 - begins) * model.x["held"]
        after = h.after(x, move, model.z["f"] if h.forces else ca.SX(0, 1), q)
        peer = do_mpc.controller.MPC(model)
        peer.settings.n_horizon = N
        peer.settings.t_step = h.controller.sample_time
        peer.settings.store_full_solution = False
        peer.settings.supress_ipopt_output()
        peer.settings.nlpsol_opts |= {"error_on_fail": False}
        # do-mpc asks for the last cost of everything that its stages know.
        peer.set_objective(mterm=h.end_cost(x, end), lterm=h.cost(x, move, q) + h.price(s))
        peer.set_rterm(v=0.0)
        now, later = h.rows(x, move, q), h.rows(after, 0, then)
        for k, kind in enumerate(h.kinds):
            # do-mpc has no limits at the end: those on the state are looked at a sample ahead.
            value = now[k] if WATCHED[kind] == "command" else later[k]
            away = _BEYOND * off[k]
            if h.high[k] < 1e19:
                peer.set_nl_cons(f"high{k}", value - s[k] - away, ub=float(h.high[k]))
            if h.low[k] > -1e19:
                peer.set_nl_cons(f"low{k}", -value - s[k] - away, ub=-float(h.low[k]))
        # Where no block begins the input is fixed; elsewhere bounds come with every sample.
        peer.bounds["lower", "_u", "v"] = peer.bounds["upper", "_u", "v"] = 0.0
        peer.bounds["lower", "_u", "s"] = 0.0
        template = peer.get_tvp_template()
        unseen = np.ones((N + 1, nk))
        for k, kind in enumerate(h.kinds):
            seen = h.watched[:-1, k] if WATCHED[kind] == "command" else h.watched[1:, k]
            unseen[:-1, k] = ~seen
        for j in range(N + 1):
            template["_tvp", j, "off"] = unseen[j]
            template["_tvp", j, "begins"] = float(j in h.starts)
        peer.set_tvp_fun(lambda now: template)
        peer.setup()
    # One assignment for all stages: entry by entry it would take as long as the solution.
    flat = np.array(template.cat).reshape(-1)
    at_q, at_then, at_end = (
        np.array([template.f["_tvp", j, name] for j in range(N + 1)], dtype=np.int64)
        for name in ("q", "q_after", "end")
    )
    at = [int(peer.opt_x.f["_u", j, 0, "v"][0]) for j in h.starts.tolist()]
    now_at: dict[str, Any] = {"state": None}

    def give(chi: FloatArray, low: FloatArray, high: FloatArray) -> None:
        bare, known, last = h.parameters(chi)
        state = np.append(bare, 0.0)  # nothing is held before the first move
        flat[at_q], flat[at_then[:-1]], flat[at_end] = known, known[1:], last
        template.master = ca.DM(flat)
        peer._lb_opt_x.master[at], peer._ub_opt_x.master[at] = low, high
        if now_at["state"] is None:
            peer.x0 = state
            peer.set_initial_guess()
        now_at["state"] = state

    def solve() -> float:
        u = peer.make_step(now_at["state"])
        return float(u[0, 0]) if peer.solver_stats["success"] else math.nan

    return Peer(give=give, solve=solve)


def acados_peer(horizon: Horizon, *, condensed: int = _CONDENSED) -> Peer:
    """Return acados' real-time iteration with HPIPM, generated and compiled."""
    h = horizon
    if len(h.starts) < h.N:
        raise ValueError("acados gets a move for every sample")
    if h.forces:
        raise ValueError("forces that depend on themselves are no explicit step for acados")
    N, n, nk = h.N, h.n, len(h.kinds)
    x, v = ca.SX.sym("x", n), ca.SX.sym("v")
    q = ca.SX.sym("q", h.count + n)
    here, end = q[: h.count], q[h.count :]
    none = ca.SX(0, 1)
    rows = h.rows(x, v, here)
    states = [k for k, kind in enumerate(h.kinds) if WATCHED[kind] != "command"]

    def state(ocp: Any) -> None:
        ocp.model.name, ocp.model.x, ocp.model.u, ocp.model.p = "winch", x, v, q
        ocp.model.disc_dyn_expr = h.after(x, v, none, here)
        ocp.parameter_values = np.zeros(h.count + n)
        o, c = ocp.solver_options, ocp.constraints
        ocp.dims.N, o.tf = N, float(N)  # so that stages weigh one
        ocp.cost.cost_type = "NONLINEAR_LS"
        ocp.model.cost_y_expr = h.residuals(x, v, here)
        ocp.cost.W = np.diag(2.0 * h.weights)
        ocp.cost.yref = np.zeros(2)
        ocp.cost.cost_type_e = "EXTERNAL"
        ocp.model.cost_expr_ext_cost_e = h.end_cost(x, end)
        ocp.model.con_h_expr = rows
        ocp.model.con_h_expr_e = h.rows(x, 0, here)[states]
        for tail, of in (("", list(range(nk))), ("_e", states)):
            many = len(of)
            setattr(c, f"lh{tail}", np.maximum(h.low[of], -_BEYOND))
            setattr(c, f"uh{tail}", np.minimum(h.high[of], _BEYOND))
            setattr(c, f"idxsh{tail}", np.arange(many))
            for side in "lu":
                setattr(ocp.cost, f"z{side}{tail}", np.full(many, h.linear_price))
                setattr(ocp.cost, f"Z{side}{tail}", np.full(many, h.quadratic_price))
        c.lbu, c.ubu, c.idxbu = np.array([-9.0]), np.array([9.0]), np.array([0])
        c.x0 = np.zeros(n)
        o.nlp_solver_type, o.qp_solver_cond_N = "SQP_RTI", condensed

    solver = acados_solver(state)
    for j in range(N + 1):
        of = states if j == N else list(range(nk))
        seen = h.watched[j, of]
        solver.constraints_set(j, "lh", np.where(seen, np.maximum(h.low[of], -_BEYOND), -_BEYOND))
        solver.constraints_set(j, "uh", np.where(seen, np.minimum(h.high[of], _BEYOND), _BEYOND))
    given = np.zeros((N + 1, h.count + n))
    # Its Python's `set` checks every stage's array: that alone would take longer than the solver.
    update = solver.shared_lib.winch_acados_update_params
    update.argtypes = [
        *(ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_double), ctypes.c_int)
    ]
    capsule, width = solver.capsule, h.count + n
    stages = [(j, given[j].ctypes.data_as(ctypes.POINTER(ctypes.c_double))) for j in range(N + 1)]

    constrain = solver.constraints_set

    def give(chi: FloatArray, low: FloatArray, high: FloatArray) -> None:
        state, known, last = h.parameters(chi)
        given[:, : h.count], given[:, h.count :] = known, last
        for j, row in stages:
            update(capsule, j, row, width)
        for j in range(N):
            constrain(j, "lbu", low[j : j + 1])
            constrain(j, "ubu", high[j : j + 1])
        solver.set(0, "lbx", state)
        solver.set(0, "ubx", state)

    def solve() -> float:
        status = solver.solve()
        return float(solver.get(0, "u")[0]) if status in (0, 5) else math.nan

    return Peer(give=give, solve=solve)


def acados_solver(state: Callable[[Any], None]) -> Any:
    """Return acados' solver of a problem, which is stated into an `AcadosOcp`; HPIPM, discrete."""
    folder = Path(tempfile.mkdtemp(prefix="acados-"))
    _lay_out(folder / "acados")
    from acados.acados_template import AcadosOcp, AcadosOcpSolver

    ocp: Any = AcadosOcp()
    o = ocp.solver_options
    o.integrator_type, o.qp_solver = "DISCRETE", "PARTIAL_CONDENSING_HPIPM"
    o.hessian_approx, o.hpipm_mode, o.print_level = "GAUSS_NEWTON", "BALANCE", 0
    o.qp_solver_warm_start = 0  # HPIPM, an interior-point method, goes astray warm
    o.qp_solver_iter_max, o.qp_tol = 100, 1e-9
    state(ocp)
    ocp.code_export_directory = str(folder / "code")
    with _within(folder), contextlib.redirect_stdout(io.StringIO()):
        solver = AcadosOcpSolver(ocp, json_file=str(folder / "ocp.json"), verbose=False)
    shutil.rmtree(folder)  # it is loaded
    return solver


def _lay_out(root: Path) -> None:
    """Lay the wheel's files out as those of the sources, where acados looks for them."""
    import acados

    of, template = Path(acados.DIR), root / "interfaces" / "acados_template"
    template.mkdir(parents=True)
    for name in ("lib", "include", "bin"):
        (root / name).symlink_to(of / name)
    (template / "acados_template").symlink_to(acados.TEMPLATE_DIR)
    for name in ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1"):
        # Loaded by name, they are found again by the libraries that need them.
        ctypes.CDLL(str(of / "lib" / name), mode=ctypes.RTLD_GLOBAL)
    os.environ["ACADOS_SOURCE_DIR"], os.environ["TERA_PATH"] = str(root), acados.TERA_PATH


@contextlib.contextmanager
def _within(folder: Path) -> Iterator[None]:
    """Work in a folder: acados writes into the current one."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
