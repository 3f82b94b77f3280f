"""Exact sampling of a linear system whose inputs are held: what model predictive control uses."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..basics import FloatArray


def zero_order_hold(A: FloatArray, B: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Return (exp(A dt), integral of exp(A t) dt B over one sample).

    By one matrix exponential of the augmented matrix, C. Van Loan, "Computing integrals
    involving the matrix exponential", IEEE TAC 23 (1978), so that a singular A (a drum that
    integrates) needs no special case.

    Parameters
    ----------
    A, B
        Continuous matrices, (n, n) and (n, m).
    dt
        Sample time [s].
    """
    n, m = B.shape
    augmented = np.zeros((n + m, n + m))
    augmented[:n, :n] = A
    augmented[:n, n:] = B
    exponential = scipy.linalg.expm(augmented * dt)
    return exponential[:n, :n], exponential[:n, n:]
