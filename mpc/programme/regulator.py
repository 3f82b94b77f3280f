r"""The linear-quadratic regulator of a sampled plant with a disturbance that it cannot touch.

With the plant x, the disturbance zeta and the inputs d,

.. math::

    x^+ = A x + B d + \Gamma \zeta, \qquad \zeta^+ = \Phi \zeta, \qquad
    J = \sum_k s_k' W s_k, \qquad s = C x + D d + M \zeta,

with s whatever costs: outputs as they differ from their references, inputs from those that hold
the outputs there (`steady_inputs`), rates of inputs.  The disturbance cannot be controlled, so that
the Riccati equation splits: one of the plant alone for P, a linear equation for the cross term N
(B. D. O. Anderson and J. B. Moore, *Optimal Control: Linear Quadratic Methods*, 1990, sec. 4.3),

.. math::

    V(x, \zeta) = x' P x + 2 x' N \zeta + \ldots, \qquad
    N = A_c' (P \Gamma + N \Phi) + C_c' W M, \qquad d = -K x - K_\zeta \zeta,

with A_c = A - B K and C_c = C - D K.  It is what a predictive controller without active limits
equals, and its value function is the cost of what lies beyond a horizon.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from models.basics import FloatArray, ReadOnlyArrays, SolverError, solve_discrete_riccati


@dataclass(frozen=True, kw_only=True, eq=False)
class LQRegulator(ReadOnlyArrays):
    """Gains and value function; `lq_regulator` makes it."""

    weights: FloatArray  #: Diagonal of W: what the square of each s costs.
    #: Value function, (nx, nx), (nx, nz).
    P: FloatArray
    N: FloatArray
    #: d = -K x - K_disturbance zeta, (nu, nx), (nu, nz).
    K: FloatArray
    K_disturbance: FloatArray


def lq_regulator(
    A: FloatArray,
    B: FloatArray,
    C: FloatArray,
    D: FloatArray,
    *,
    weights: FloatArray,
    scale: FloatArray,
    Gamma: FloatArray,
    Phi: FloatArray,
    M: FloatArray,
) -> LQRegulator:
    """Return the regulator of a plant, for the numerics with the size of each state, (nx,).

    Raises SolverError if inputs may be had for nothing, the Riccati equation has no solution, or
    the regulated plant is not stable.
    """
    bend, cross = D.T * weights @ D, C.T * weights @ D
    try:
        root = scipy.linalg.cholesky(bend, lower=True)
    except np.linalg.LinAlgError as error:
        raise SolverError("regulator: some input costs nothing") from error
    # Each state in its own size; inputs such that they cost one, and nothing with state and zeta.
    taken, steady = np.linalg.solve(bend, cross.T), np.linalg.solve(bend, D.T * weights @ M)
    free, scaled = A - B @ taken, (C - D @ taken) * scale
    Gamma, M = Gamma - B @ steady, M - D @ steady
    P = solve_discrete_riccati(
        (free / scale[:, None] * scale).T,
        scipy.linalg.solve_triangular(root, (B / scale[:, None]).T, lower=True),
        scaled.T * weights @ scaled,
    )
    P = P / np.outer(scale, scale)
    bend = bend + B.T @ P @ B
    K = np.asarray(np.linalg.solve(bend, B.T @ P @ A + cross.T), dtype=np.float64)
    closed = A - B @ K
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0 - 1e-12:
        raise SolverError("regulator: the regulated plant is not stable")
    N = _cross(closed, P @ Gamma, (C - D @ K).T * weights @ M, Phi)
    pull = B.T @ (P @ Gamma + N @ Phi) + D.T * weights @ M
    K_zeta = np.asarray(np.linalg.solve(bend, pull) + steady, dtype=np.float64)
    return LQRegulator(weights=weights, P=P, N=N, K=K, K_disturbance=K_zeta)


def steady_inputs(
    A: FloatArray,
    B: FloatArray,
    C: FloatArray,
    D: FloatArray,
    *,
    weights: FloatArray,
    Gamma: FloatArray,
    M: FloatArray,
) -> FloatArray:
    """Return the inputs that hold s next to zero against each zeta that lasts, (nu, nz).

    Of those that do as well, the smallest with its state.
    """
    n = len(A)
    left, sizes, right = np.linalg.svd(np.hstack([A - np.eye(n), B]))
    rank = int(np.sum(sizes > 1e-10 * sizes[0]))
    at_rest = -(right[:rank].T / sizes[:rank]) @ left[:, :rank].T @ Gamma
    free, root = right[rank:].T, np.sqrt(weights)[:, None]
    rows = root * np.hstack([C, D])
    more = np.linalg.lstsq(rows @ free, -root * M - rows @ at_rest, rcond=1e-10)[0]
    return np.asarray((at_rest + free @ more)[n:])


def unreached(A: FloatArray, B: FloatArray) -> complex | None:
    """Return an eigenvalue of A that neither dies away nor is moved by B; None without any."""
    for value in np.linalg.eigvals(A):
        if abs(value) >= 1.0 - 1e-9:
            sizes = np.linalg.svd(np.hstack([A - value * np.eye(len(A)), B]), compute_uv=False)
            if sizes[-1] < 1e-10 * sizes[0]:
                return complex(value)
    return None


def pole_text(value: complex, period: float) -> str:
    """Return an eigenvalue of a plant sampled with a period [s] as its pole, in words."""
    s = np.log(value) / period
    return f"s = {s.real + 0.0:.3g} 1/s" if abs(s.imag) < 1e-9 else f"s = {s:.3g} 1/s"


def _cross(closed: FloatArray, moved: FloatArray, known: FloatArray, Phi: FloatArray) -> FloatArray:
    """Solve N = A_c' (moved + N Phi) + known.

    One linear system for each Schur vector of Phi: a Kronecker product would have nx nz rows.
    """
    T, Z = scipy.linalg.schur(Phi, output="complex")
    rotated = (closed.T @ moved + known) @ Z
    n = len(closed)
    N = np.zeros((n, len(Phi)), dtype=np.complex128)
    for k in range(len(Phi)):
        right = rotated[:, k] + closed.T @ (N[:, :k] @ T[:k, k])
        N[:, k] = np.linalg.solve(np.eye(n) - T[k, k] * closed.T, right)
    return np.asarray((N @ Z.conj().T).real)
