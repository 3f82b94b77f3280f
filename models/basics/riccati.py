r"""Riccati equations of plants in physical units, in continuous and in discrete time.

The states of a winch reach from radians to newtons, and its noises over ten decades, where a
general solver loses the stabilising solution.  Here the equation

.. math::  A'X + XA - (XB + S) R^{-1} (B'X + S') + Q = 0

is brought to even scales (states by balancing, inputs by the root of R, and X as a whole, as
SLICOT's SB02RD does), solved by the ordered Schur form of its Hamiltonian matrix (Laub 1979)
and refined by Newton's method (Kleinman 1968), which also says how well it is solved.  The
discrete equations are solved by doubling.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from .arrays import FloatArray
from .checks import SolverError

_REFINEMENTS = 3
_SOLVED = 1e-13  # relative change of X below which a refinement is the last one
_TRUSTED = 1e-4  # ... and above which the solution is not trusted
_DOUBLINGS = 60
_MENDED = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Riccati:
    """The stabilising solution X, (n, n), and the gain -R^-1 (B'X + S'), (m, n).

    `change` is the relative change of X in the last refinement.
    """

    X: FloatArray
    gain: FloatArray
    change: float


def solve_riccati(
    A: FloatArray, B: FloatArray, Q: FloatArray, R: FloatArray, S: FloatArray
) -> Riccati:
    """Return the stabilising solution of the equation above; A + B gain is stable.

    The weights of x'Qx + 2 x'Su + u'Ru are (n, n), (n, m), (m, m), R positive definite; A and B are
    (n, n), (n, m).

    Raises SolverError if R is not positive definite or no stabilising solution is found.
    """
    try:
        root = scipy.linalg.cholesky(R, lower=True)
    except np.linalg.LinAlgError as error:
        raise SolverError("Riccati equation: the weight R must be positive definite") from error
    # Inputs with a unit weight and without a cross term.
    inputs = scipy.linalg.solve_triangular(root, B.T, lower=True).T
    cross = scipy.linalg.solve_triangular(root, S.T, lower=True).T
    free, rest = A - inputs @ cross.T, Q - cross @ cross.T
    scale = _state_scales(free, inputs, rest, Q)
    free = free / scale[:, None] * scale
    inputs, rest = inputs / scale[:, None], scale[:, None] * rest * scale
    given, cross = scale[:, None] * Q * scale, scale[:, None] * cross
    size = _whole(inputs, rest, given)
    X = size * _from_schur(free, size * inputs @ inputs.T, rest / size)
    plain = A / scale[:, None] * scale
    change = np.inf
    # The Schur form loses digits where noises are ten decades apart.  Newton's steps win them back,
    # each a Lyapunov equation of the loop closed so far, which must be stable for it to mean much.
    for _ in range(_REFINEMENTS):
        gain = -(inputs.T @ X + cross.T)
        weight = given + cross @ gain + gain.T @ cross.T + gain.T @ gain
        loop = plain + inputs @ gain
        if np.linalg.eigvals(loop).real.max(initial=-1.0) >= 0.0:
            raise SolverError("Riccati equation: no stabilising solution was found")
        better = solve_lyapunov(loop.T, weight)
        change = float(np.linalg.norm(better - X)) / max(float(np.linalg.norm(better)), 1e-300)
        X = better
        if change < _SOLVED:
            break
    if not change < _TRUSTED:
        raise SolverError("Riccati equation: the solution does not settle")
    gain = -(inputs.T @ X + cross.T) / scale
    return Riccati(
        X=X / scale[:, None] / scale,
        gain=scipy.linalg.solve_triangular(root.T, gain, lower=False),
        change=change,
    )


def solve_discrete_riccati(A: FloatArray, C: FloatArray, Q: FloatArray) -> FloatArray:
    r"""Return the stabilising P of the filter's equation, for measurement errors of variance one.

    .. math:: P = A P A' + Q - A P C' (C P C' + I)^{-1} C P A'

    Doubling squares the recursion at every step, so that some fifteen products of matrices do what
    takes a generalised Schur form ten times as long; a tuning solves hundreds of them (E. K.-W.
    Chu, H.-Y. Fan, W.-W. Lin and C.-S. Wang, Int. J. Control 77 (2004), 767-788).  The regulator's
    equation is the filter's, transposed.  A, C and Q are (n, n), (m, n), (n, n).

    Raises SolverError if it does not converge: something grows that is not seen, or does not
    settle.
    """
    eye = np.eye(len(A))
    F, S, P = A.T, C.T @ C, Q
    with np.errstate(all="ignore"):
        for _ in range(_DOUBLINGS):
            W = np.linalg.inv(eye + S @ P)
            F, S, after = F @ W @ F, S + F @ W @ S @ F.T, P + F.T @ P @ W @ F
            after = 0.5 * (after + after.T)
            size = float(np.abs(after).max())
            if not np.isfinite(size):
                break
            if np.abs(after - P).max() <= 1e-11 * size:
                return _polished(A, C, Q, after)
            P = after
    raise SolverError("Riccati equation: the equation has no stabilising solution")


def solve_lyapunov(A: FloatArray, Q: FloatArray) -> FloatArray:
    """Return the symmetric X of A X + X A' + Q = 0."""
    T, U = scipy.linalg.schur(A, output="real")
    Y, scale, info = scipy.linalg.lapack.dtrsyl(T, T, -U.T @ Q @ U, tranb="T")
    if info < 0 or not np.all(np.isfinite(Y)):
        raise SolverError("Lyapunov equation: it has no unique solution")
    X = U @ Y @ U.T / scale
    return np.asarray(0.5 * (X + X.T), dtype=np.float64)


def solve_discrete_lyapunov(A: FloatArray, Q: FloatArray) -> FloatArray | None:
    """Return the X of X = A X A' + Q, all (n, n), by doubling; None if A is not stable."""
    X = Q
    with np.errstate(all="ignore"):
        for _ in range(_DOUBLINGS):
            after = X + A @ X @ A.T
            size = float(np.abs(after).max())
            if not np.isfinite(size):
                return None
            A = A @ A
            # Done only when nothing is left of the transient either.
            if np.abs(after - X).max() <= 1e-12 * size and np.abs(A).max() < 1e-3:
                return np.asarray(after)
            X = after
    return None


def balanced_truncation(
    heard: FloatArray, reached: FloatArray, order: int
) -> tuple[FloatArray, FloatArray]:
    """Return projections, (order, n) and (n, order), on what two Gramians (n, n) weigh most.

    At most `order` states, fewer where the rest is of rounding size; the square-root method of
    Tombs and Postlethwaite (Int. J. Control 46, 1987).  They are of what the states do (`heard`)
    and of what drives them (`reached`).
    """
    roots = []
    for gramian in (heard, reached):
        size, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
        roots.append((vectors * np.sqrt(np.maximum(size, 0.0))).T)
    return truncation_of_roots(roots[0], roots[1], order, least=1e-10)


def truncation_of_roots(
    heard: FloatArray, reached: FloatArray, order: int, *, least: float = 1e-13
) -> tuple[FloatArray, FloatArray]:
    """Return `balanced_truncation` of Gramians R'R by their roots R, (., n).

    Where the roots are known better than their squares; a state of less than `least` of the
    first is of rounding size.
    """
    left, sizes, right = np.linalg.svd(heard @ reached.T)
    keep = max(1, min(order, int(np.sum(sizes > least * sizes[0]))))
    scale = 1.0 / np.sqrt(sizes[:keep] + 1e-300)
    return (left[:, :keep] * scale).T @ heard, reached.T @ (right[:keep].T * scale)


def _whole(B: FloatArray, Q: FloatArray, given: FloatArray) -> float:
    """Return a size of X as a whole; a weight that a cross term takes away leaves its rounding."""
    weight = max(np.abs(Q).max(initial=0.0), 1e-12 * np.abs(given).max(initial=0.0), 1e-300)
    reached = float(np.abs(B @ B.T).max(initial=0.0))
    return float(np.sqrt(weight / reached)) if reached > 1e-200 * weight else 1.0


def _state_scales(A: FloatArray, B: FloatArray, Q: FloatArray, given: FloatArray) -> FloatArray:
    """Return a size of each state, (n,), such that rows and columns are of like size."""
    n = len(A)
    size = _whole(B, Q, given)
    matrix = np.block([[A, -size * B @ B.T], [-Q / size, -A.T]])
    with np.errstate(invalid="ignore"):
        _, (scale, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    if not np.all(np.isfinite(scale) & (scale > 0.0)):
        raise SolverError("Riccati equation: its weights are too far apart")
    # A symplectic scaling has 1/d for the costate of d: the nearest one, by powers of two.
    halves = 0.5 * (np.log2(scale[:n]) - np.log2(scale[n:]))
    return np.asarray(np.exp2(np.round(halves)), dtype=np.float64)


def _from_schur(A: FloatArray, G: FloatArray, Q: FloatArray) -> FloatArray:
    """Return X of A'X + XA - XGX + Q = 0 from the stable subspace of its Hamiltonian."""
    n = len(A)
    hamiltonian = np.block([[A, -G], [-Q, -A.T]])
    try:
        _, U, count = scipy.linalg.schur(hamiltonian, output="real", sort="lhp")
        if count != n:
            raise SolverError("Riccati equation: it has a pole on the imaginary axis")
        X = np.linalg.solve(U[:n, :n].T, U[n:, :n].T).T
    except np.linalg.LinAlgError as error:
        raise SolverError("Riccati equation: no stabilising solution was found") from error
    return np.asarray(0.5 * (X + X.T), dtype=np.float64)


def _polished(A: FloatArray, C: FloatArray, Q: FloatArray, P: FloatArray) -> FloatArray:
    """Return P after steps of the recursion, which mend what is small beside the largest entry."""
    for _ in range(_MENDED):
        gain = np.linalg.solve(C @ P @ C.T + np.eye(len(C)), C @ P).T
        kept = np.eye(len(A)) - gain @ C
        P = A @ (kept @ P @ kept.T + gain @ gain.T) @ A.T + Q
    return np.asarray(0.5 * (P + P.T))
