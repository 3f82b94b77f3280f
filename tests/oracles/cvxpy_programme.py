r"""The programme of the linear controller once more, as one would write it down: in CVXPY.

Every state is a variable, every limit a constraint, nothing is eliminated.  It takes milliseconds
where `mpc.programme.qp` takes microseconds, and is here to be read, and to check the other against:
the same answer by another solver from another statement (`LinearMPC` docstring for the symbols).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import clarabel
import cvxpy
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mpc.linear import WATCHED, LinearMPC

cp: Any = cvxpy  # its stubs know too few of its functions

__all__ = ["Oracle", "oracle"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Oracle:
    """The programme with its parameters; `oracle` makes it.

    Attributes
    ----------
    problem, moves
        The CVXPY problem, and its variable v.
    state, path, constants, end
        Parameters: winch's state (nx,), hook's path (N + 1, 2), constants (2,), and the sea's state
        at the end of the horizon (nh,).
    low, high
        Parameters: bounds on the moves, (nb,).
    """

    problem: Any
    moves: Any
    state: Any
    path: Any
    constants: Any
    end: Any
    low: Any
    high: Any

    def solve(self) -> tuple[FloatArray, float]:
        """Return the moves v, (nb,), and the residual of the conditions of optimality.

        Clarabel, an interior-point method, tells which constraints are active better than where the
        optimum is: costs that span many powers of ten leave it some 1e-5 off.  The equations that
        the active ones make are then solved by themselves.
        """
        data = self.problem.get_problem_data(cp.CLARABEL)[0]
        P, A, q, b = data["P"], data["A"], data["c"], data["b"]
        P = sp.triu(P, format="csc")
        zero, more = data["dims"].zero, data["dims"].nonneg
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_iter = False, 200
        settings.tol_gap_abs = settings.tol_gap_rel = 1e-13
        settings.tol_feas = 1e-11
        cones = [clarabel.ZeroConeT(zero), clarabel.NonnegativeConeT(more)]
        found = clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
        x, z, s = (np.array(part) for part in (found.x, found.z, found.s))
        full = P + sp.triu(P, 1).T
        best = x, _residual(full, q, A, b, zero, x, z)
        active = np.concatenate([np.ones(zero, dtype=bool), z[zero:] > s[zero:]])
        for k in range(60):
            x, own = _on_active(full, q, A[active], b[active])
            z = np.zeros(len(b))
            z[active] = own
            residual = _residual(full, q, A, b, zero, x, z)
            if residual < best[1]:
                best = x, residual
            off = np.where(active, -z, A @ x - b)
            off[:zero] = 0.0
            if best[1] < 1e-9 or off.max() <= 1e-9:
                break
            # All that is wrong at once may go round in circles; one at a time does not.
            active = active ^ (off > 1e-9 if k < 6 else off >= off.max())
        first = data["param_prob"].var_id_to_col[self.moves.id]
        return best[0][first : first + self.moves.size], best[1]


def oracle(controller: LinearMPC) -> Oracle:
    """Return the programme of a controller, stated plainly.

    Parameters
    ----------
    controller
        The controller.
    """
    p, winch, weights = controller.programme, controller.model.winch, controller.regulator
    N, nb, n = p.steps, len(p.blocks), winch.size
    x0, constants = cp.Parameter(n), cp.Parameter(2)
    path, end = cp.Parameter((N + 1, 2)), cp.Parameter(controller.model.sea.order)
    low, high = cp.Parameter(nb), cp.Parameter(nb)

    # Every state in its own size, so that the solver sees numbers of the size of one.
    size = controller.model.scale[:n]
    A, B = winch.A / size[:, None] * size, winch.B[:, 0] * p.unit / size
    from_hook = winch.from_hook / size[:, None]
    from_constants = winch.from_constants / size[:, None]
    v: Any = cp.Variable(nb)
    x: Any = cp.Variable((n, N + 1))
    d = v[np.repeat(np.arange(nb), p.blocks)]
    constraints = [x[:, 0] == cp.multiply(1.0 / size, x0), low <= v, v <= high]
    for j in range(N):
        moved = from_hook[:, :2] @ path[j] + from_hook[:, 2:] @ path[j + 1]
        held = from_constants @ constants
        constraints.append(x[:, j + 1] == A @ x[:, j] + B * d[j] + moved + held)
    root = _root(weights.P * np.outer(size, size) / p.cost)
    steady, nh = winch.steady / p.unit, controller.model.sea.order
    cross = weights.N * size[:, None] / p.cost
    cost: Any = cp.sum_squares((winch.payload * size) @ x[:, 1:N]) / p.cost
    cost += weights.weights[1] * p.unit**2 / p.cost * cp.sum_squares(d - steady @ constants)
    cost += cp.sum_squares(root.T @ x[:, N])
    cost += 2.0 * x[:, N] @ (cross[:, :nh] @ end + cross[:, nh:] @ constants)
    price: Any = 0.0
    for k, (j, kind) in enumerate(zip(p.at, p.kind, strict=True)):
        name = WATCHED[kind]
        if name == "tension":
            value = (winch.tension * size) @ x[:, j] + winch.tension_from_hook @ path[j]
            value += winch.tension_from_constants @ constants
        elif name == "command":
            value = winch.back * ((winch.speed * size) @ x[:, j]) + d[j] * (p.unit / winch.gain)
        else:
            value = ((winch.speed if name == "speed" else winch.payload) * size) @ x[:, j]
        lowest, highest = controller.soft_limits[name]
        scale = controller.programme.scale[k]
        for beyond in (
            (value - highest) if np.isfinite(highest) else None,
            (lowest - value) if np.isfinite(lowest) else None,
        ):
            if beyond is not None:
                s = cp.pos(beyond * scale)
                price += controller.qp.linear * s + 0.5 * controller.qp.quadratic * cp.square(s)
    problem = cp.Problem(cp.Minimize(cost + price), constraints)
    return Oracle(
        problem=problem,
        moves=v,
        state=x0,
        path=path,
        constants=constants,
        end=end,
        low=low,
        high=high,
    )


def _on_active(P: Any, q: FloatArray, A: Any, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and multipliers of min x'Px/2 + q'x on A x = b, refined as far as it goes."""
    n, faint = len(q), 1e-10
    exact = sp.bmat([[P, A.T], [A, None]], format="csc")
    near = exact + sp.diags(np.concatenate([np.full(n, faint), np.full(len(b), -faint)]))
    solve = splu(near.tocsc()).solve
    right, found = np.concatenate([-q, b]), np.zeros(n + len(b))
    for _ in range(12):
        found = found + solve(right - exact @ found)
    return found[:n], found[n:]


def _residual(
    P: Any, q: FloatArray, A: Any, b: FloatArray, zero: int, x: FloatArray, z: FloatArray
) -> float:
    """Return the largest violation of the conditions of optimality."""
    over = A @ x - b
    parts = [P @ x + q + A.T @ z, over[:zero], np.maximum(over[zero:], 0.0)]
    parts += [np.minimum(z[zero:], 0.0), np.minimum(np.abs(over[zero:]), np.abs(z[zero:]))]
    return max(float(np.abs(part).max(initial=0.0)) for part in parts)


def _root(P: FloatArray) -> FloatArray:
    """Return M of P = M M', for a P that is positive semidefinite but for rounding."""
    values, vectors = np.linalg.eigh(0.5 * (P + P.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
