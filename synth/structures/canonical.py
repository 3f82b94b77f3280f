r"""A controller of given order in as few numbers as there can be: parallel canonical blocks.

Second-order blocks (and one of first order if the order is odd), each in observable canonical
form as seen from one of the inputs, which leaves no redundant scale:

.. math::

    A_k = \begin{bmatrix} -\alpha_1 & 1 \\ -\alpha_0 & 0 \end{bmatrix},\quad
    B_k \text{ free},\quad C_k \text{ free but for one row, } [1\ 0]

so n (nu + ny) numbers describe order n.  The row that is fixed alternates between the inputs:
two channels that have nothing to do with each other, each with its own controller, are then an
ordinary point.  Complex and real poles meet within a block without a singularity; only a pole
that repeats across blocks is out of reach, which nothing that is optimised asks for.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.basics import ComplexArray, FloatArray

_NEAR = 1e-6  # poles closer than this, relatively, are pulled apart
_FAINT = 1e-6  # least share of a mode that a fixed row must hear


@dataclass(frozen=True, kw_only=True)
class CanonicalBlock:
    """Where the numbers of one block stand among the parameters, and which row of C is fixed."""

    size: int
    row: int
    alpha: slice  #: alpha1, alpha0; alpha0 alone for a block of first order
    B: slice  #: `size` rows of ny
    C: slice  #: nu - 1 rows of `size`


class BlockForm:
    """The form for an order, nu inputs and ny measurements, without a direct term."""

    def __init__(self, order: int, nu: int, ny: int) -> None:
        self.order, self.nu, self.ny = order, nu, ny
        self.blocks: list[CanonicalBlock] = []
        at = 0
        for k in range((order + 1) // 2):
            size = min(2, order - 2 * k)
            ends = np.cumsum([at, size, size * ny, (nu - 1) * size]).tolist()
            alpha, B, C = (slice(a, b) for a, b in itertools.pairwise(ends))
            self.blocks.append(CanonicalBlock(size=size, row=k % nu, alpha=alpha, B=B, C=C))
            at = ends[-1]
        self.count = at  #: of the numbers

    def matrices(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, B, C."""
        A, B = np.zeros((self.order, self.order)), np.empty((self.order, self.ny))
        C = np.zeros((self.nu, self.order))
        at = 0
        for block in self.blocks:
            states = slice(at, at + block.size)
            A[states, at] = -values[block.alpha]
            if block.size == 2:
                A[at, at + 1] = 1.0
            B[states] = values[block.B].reshape(block.size, self.ny)
            C[block.row, at] = 1.0
            if self.nu > 1:
                others = [i for i in range(self.nu) if i != block.row]
                C[others, states] = values[block.C].reshape(self.nu - 1, block.size)
            at += block.size
        return A, B, C

    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        """Return C (s - A)^-1 B, nu lists of ny entries, for numbers or symbols."""
        measured = range(self.ny)
        result: list[list[Any]] = [[0.0] * self.ny for _ in range(self.nu)]
        for block in self.blocks:
            alpha, B = values[block.alpha], values[block.B]
            free = iter(values[block.C])
            # The block's states, each as a response to every measurement.
            if block.size == 2:
                below = s * (s + alpha[0]) + alpha[1]
                # x1' = x2 - alpha1 x1 + B1 y gives the second from the first.
                first = [(s * B[j] + B[self.ny + j]) / below for j in measured]
                second = [(s + alpha[0]) * first[j] - B[j] for j in measured] * (self.nu > 1)
                states = [first, second]
            else:
                states = [[B[j] / (s + alpha[0]) for j in measured]]
            for i in range(self.nu):
                weights = [1.0] if i == block.row else [next(free) for _ in range(block.size)]
                for weight, state in zip(weights, states, strict=False):
                    for j in measured:
                        result[i][j] = state[j] * weight + result[i][j]
        return result

    def values(self, A: FloatArray, B: FloatArray, C: FloatArray) -> FloatArray:
        """Return the numbers of a controller of this order.

        Poles that repeat are pulled apart a little, and a mode that its block's fixed row does
        not hear is lent a whisper of it.
        """
        poles, into, out = _modes(A, B, C)
        result = np.empty(self.count)
        for block, at in zip(self.blocks, self._assigned(poles, out), strict=True):
            _fill(result, block, poles[at], into[at], out[:, at])
        return result

    def _assigned(self, poles: ComplexArray, C: ComplexArray) -> list[list[int]]:
        """Return the modes of each block, such that each is well heard through its fixed row."""
        groups = [[int(i), int(i) + 1] for i in np.flatnonzero(poles.imag > 0.0)]
        real = [int(i) for i in np.flatnonzero(poles.imag == 0.0)]
        real.sort(key=lambda i: poles[i].real)
        single = [[real.pop(0)]] if len(real) % 2 else []  # the fastest one
        groups += [real[i : i + 2] for i in range(0, len(real), 2)]
        heard = np.abs(C) / np.maximum(np.linalg.norm(C, axis=0), 1e-300)
        rows = [block.row for block in self.blocks[: len(groups)]]
        price = [[-np.log(heard[row, g].min() + 1e-12) for row in rows] for g in groups]
        result = groups + single
        if groups:
            for g, b in zip(*linear_sum_assignment(price), strict=True):
                result[b] = groups[g]
        return result


def _fill(
    result: FloatArray, block: CanonicalBlock, poles: ComplexArray, B: ComplexArray, C: ComplexArray
) -> None:
    """Write one block's numbers: its modes in observable canonical form."""
    fixed, size = C[block.row].copy(), np.linalg.norm(C, axis=0)
    faint = np.abs(fixed) < _FAINT * size
    fixed[faint] = _FAINT * size[faint] + 1e-300
    if block.size == 2:
        alpha = np.array([-(poles[0] + poles[1]), poles[0] * poles[1]])
        to_canonical = np.array([fixed, fixed * poles]) + np.outer([0.0, alpha[0]], fixed)
    else:
        alpha, to_canonical = -poles, np.diag(fixed)
    others = np.delete(C, block.row, axis=0)
    result[block.alpha] = alpha.real
    result[block.B] = (to_canonical @ B).real.ravel()
    result[block.C] = np.linalg.solve(to_canonical.T, others.T).T.real.ravel()


def _modes(
    A: FloatArray, B: FloatArray, C: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return poles, inputs and outputs of the modes, conjugates next to each other."""
    size = float(np.linalg.norm(A, 2)) or 1.0
    for nudge in (0.0, 1e-6, 1e-5, 1e-4, 1e-3):
        # A repeated pole has no modes of its own: pull it apart by an uneven nudge.
        uneven = np.diag(np.linspace(-1.0, 1.0, len(A)) if len(A) > 1 else [1.0])
        poles, vectors = np.linalg.eig(A + nudge * size * uneven)
        gaps = np.abs(poles[:, None] - poles) + size * np.eye(len(A))
        if gaps.min() > _NEAR * size and np.linalg.cond(vectors) < 1e10:
            break
    poles = poles.astype(np.complex128)
    order = np.lexsort((-poles.imag, np.abs(poles.imag), poles.real))
    poles, vectors = poles[order], vectors[:, order]
    return poles, np.linalg.solve(vectors, B.astype(np.complex128)), C @ vectors
