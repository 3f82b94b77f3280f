"""Pade models of a pure delay, as a well-scaled chain of all-pass sections.

Frequency responses carry delays exactly; eigenvalues and Lyapunov equations cannot, so
`LinearPlant.without_delays` and `LinearPlant.to_control` put this model in their place.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..basics import FloatArray


def pade_state_space(
    delay: float, order: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (A, B, C, D) of the [order/order] Pade approximant of exp(-s delay).

    The denominator's roots are found at unit delay and scaled, and every pair becomes one section
    (s^2 - b s + c)/(s^2 + b s + c) = 1 - 2 b s/(s^2 + b s + c).  The companion form of the same
    polynomial has entries that differ by delay^order and spoils eigenvalues.  A (order, order), B
    (order, 1), C (1, order), D (1, 1), for a delay above zero [s] and an order from 1 to 12.  The
    phase error at omega is about (omega delay)^(2 order + 1) (order! / (2 order)!)^2 / (2 order +
    1) [rad].
    """
    coefficients = [
        math.factorial(2 * order - k)
        / (math.factorial(k) * math.factorial(order - k))
        / math.factorial(order)
        for k in range(order, -1, -1)
    ]
    roots = np.roots(coefficients) / delay
    A = np.zeros((0, 0))
    B = np.zeros((0, 1))
    C = np.zeros((1, 0))
    D = np.ones((1, 1))
    for root in roots[roots.imag >= 0.0]:
        if root.imag > 1e-9 * abs(root):
            b, w = -2.0 * root.real, abs(root)
            section = (
                np.array([[0.0, w], [-w, -b]]),
                np.array([[0.0], [1.0]]),
                np.array([[0.0, -2.0 * b]]),
                np.array([[1.0]]),
            )
        else:  # the one real root of an odd order: (r - s)/(r + s)
            r = -root.real
            section = (
                np.array([[-r]]),
                np.array([[1.0]]),
                np.array([[2.0 * r]]),
                np.array([[-1.0]]),
            )
        A2, B2, C2, D2 = section
        A = np.block([[A, np.zeros((A.shape[0], A2.shape[0]))], [B2 @ C, A2]])
        B = np.vstack([B, B2 @ D])
        C = np.hstack([D2 @ C, C2])
        D = D2 @ D
    return A, B, C, D


def pade_bank(
    delays: Sequence[float], order: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (A, B, C, D) of the block-diagonal Pade model of several channels, of delays [s].

    Each delay above zero has `order` states, 1 to 12; a zero delay is a wire.
    """
    late = [i for i, delay in enumerate(delays) if delay > 0.0]
    n, m = order * len(late), len(delays)
    A, B, C, D = np.zeros((n, n)), np.zeros((n, m)), np.zeros((m, n)), np.eye(m)
    for k, i in enumerate(late):
        block = slice(k * order, (k + 1) * order)
        a, b, c, d = _kept(delays[i], order)
        A[block, block], B[block, i], C[i, block], D[i, i] = a, b[:, 0], c[0], d[0, 0]
    return A, B, C, D


_kept = lru_cache(maxsize=64)(pade_state_space)  # a loop is closed many times with one delay
