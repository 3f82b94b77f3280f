r"""Discrete Riccati and Lyapunov equations by doubling.

.. math::

    P = A P A' + Q - A P C' (C P C' + I)^{-1} C P A', \qquad X = A X A' + Q .

Doubling squares the recursion at every step, so that some fifteen products of matrices do what
takes a generalised Schur form ten times as long; a tuning solves hundreds of them.  The regulator's
equation is the filter's, transposed.
"""

from __future__ import annotations

import numpy as np

from models.basics import FloatArray, SolverError

_STEPS = 60
_MENDED = 4


def riccati(A: FloatArray, C: FloatArray, Q: FloatArray) -> FloatArray:
    """Return the stabilising P of the filter's equation, for measurement errors of variance one.

    The structure-preserving doubling algorithm: E. K.-W. Chu, H.-Y. Fan, W.-W. Lin and
    C.-S. Wang, Int. J. Control 77 (2004), 767-788.

    Parameters
    ----------
    A, C, Q
        (n, n), (m, n), (n, n).

    Raises
    ------
    SolverError
        If it does not converge: something grows that is not seen, or does not settle.
    """
    eye = np.eye(len(A))
    F, S, P = A.T, C.T @ C, Q
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            W = np.linalg.inv(eye + S @ P)
            F, S, after = F @ W @ F, S + F @ W @ S @ F.T, P + F.T @ P @ W @ F
            after = 0.5 * (after + after.T)
            size = float(np.abs(after).max())
            if not np.isfinite(size):
                break
            if np.abs(after - P).max() <= 1e-11 * size:
                return _polished(A, C, Q, after)
            P = after
    raise SolverError("riccati: the equation has no stabilising solution")


def _polished(A: FloatArray, C: FloatArray, Q: FloatArray, P: FloatArray) -> FloatArray:
    """Return P after steps of the recursion, which mend what is small beside the largest entry."""
    for _ in range(_MENDED):
        gain = np.linalg.solve(C @ P @ C.T + np.eye(len(C)), C @ P).T
        kept = np.eye(len(A)) - gain @ C
        P = A @ (kept @ P @ kept.T + gain @ gain.T) @ A.T + Q
    return np.asarray(0.5 * (P + P.T))


def lyapunov(A: FloatArray, Q: FloatArray) -> FloatArray | None:
    """Return the X of X = A X A' + Q; None if A is not stable.

    Parameters
    ----------
    A, Q
        (n, n).
    """
    X = Q
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
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
