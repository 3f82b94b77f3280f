r"""The linear-quadratic regulator of a sampled plant with a disturbance that it cannot touch.

With the plant x, the disturbance zeta and one input d,

.. math::

    x^+ = A x + B d + \Gamma \zeta, \qquad \zeta^+ = \Phi \zeta, \qquad
    J = \sum_k p_k^2 + \rho \, (d_k - d_\infty \zeta_k)^2,

with p = q x an output and d_infty the input that holds it against the disturbance at rest.  The
disturbance cannot be controlled, so that the Riccati equation splits: one of the plant alone for
P, a linear equation for the cross term N (B. D. O. Anderson and J. B. Moore, *Optimal Control:
Linear Quadratic Methods*, 1990, sec. 4.3), and

.. math::

    V(x, \zeta) = x' P x + 2 x' N \zeta + \ldots, \qquad
    N = A_c' (P \tilde\Gamma + N \Phi), \qquad d = -K x - K_\zeta \zeta + d_\infty \zeta .

It is what a predictive controller without active limits equals, and its value function is the cost
of what lies beyond a horizon.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from models.basics import FloatArray, ReadOnlyArrays, SolverError, solve_discrete_riccati


@dataclass(frozen=True, kw_only=True, eq=False)
class LQRegulator(ReadOnlyArrays):
    """Gains and value function; `lq_regulator` makes it."""

    weight: float  #: rho: what an input of one costs, in squares of the output's unit.
    #: Value function, (nx, nx), (nx, nz).
    P: FloatArray
    N: FloatArray
    #: d = -K x - K_disturbance zeta, (nx,), (nz,); d_infty is in the latter.
    K: FloatArray
    K_disturbance: FloatArray
    #: (nz, nz), (nx, nz).
    Phi: FloatArray
    Gamma: FloatArray
    steady: FloatArray  #: d_infty, (nz,).


def lq_regulator(
    A: FloatArray,
    B: FloatArray,
    output: FloatArray,
    *,
    weight: float,
    scale: FloatArray,
    Gamma: FloatArray,
    Phi: FloatArray,
    steady: FloatArray,
) -> LQRegulator:
    """Return the regulator of a plant: A (nx, nx), B (nx, 1), and the row q, (nx,), of its output.

    `weight`, `Gamma`, `Phi` and `steady` are as for `LQRegulator`; for the numerics of the Riccati
    equation `scale` is the size of each state, (nx,).

    Raises SolverError if the Riccati equation has no solution, or the regulated plant is not
    stable.
    """
    # Each state in its own size, and the weight in B, so that an input of one costs one.
    scaled = output * scale
    P = solve_discrete_riccati(
        (A / scale[:, None] * scale).T,
        (B / scale[:, None]).T / math.sqrt(weight),
        np.outer(scaled, scaled),
    )
    P = P / np.outer(scale, scale)
    bend = float((B.T @ P @ B)[0, 0]) + weight
    K = (B.T @ P @ A)[0] / bend
    closed = A - B @ K[None, :]
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0 - 1e-12:
        raise SolverError("regulator: the regulated plant is not stable")
    # About the steady input: a constant disturbance that is held would else cost something for
    # ever, and a horizon without end would have no finite cost.
    shifted = Gamma + np.outer(B[:, 0], steady)
    N = _cross(closed, P @ shifted, Phi)
    K_zeta = (B.T @ (P @ shifted + N @ Phi))[0] / bend
    return LQRegulator(
        weight=weight,
        P=P,
        N=N,
        K=K,
        K_disturbance=K_zeta - steady,
        Phi=Phi,
        Gamma=Gamma,
        steady=steady,
    )


def _cross(closed: FloatArray, right: FloatArray, Phi: FloatArray) -> FloatArray:
    """Solve N = A_c' (right + N Phi).

    One linear system for each Schur vector of Phi: a Kronecker product would have nx nz rows.
    """
    T, Z = scipy.linalg.schur(Phi, output="complex")
    rotated = closed.T @ right @ Z
    n = len(closed)
    N = np.zeros((n, len(Phi)), dtype=np.complex128)
    for k in range(len(Phi)):
        known = rotated[:, k] + closed.T @ (N[:, :k] @ T[:k, k])
        N[:, k] = np.linalg.solve(np.eye(n) - T[k, k] * closed.T, known)
    return np.asarray((N @ Z.conj().T).real)
