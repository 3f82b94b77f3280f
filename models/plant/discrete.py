"""Sampled plants, which model predictive controllers predict with, and the fields of any plant.

`LinearPlant.discretise` makes them.  The same names and output matrices as the continuous
plant, and matrices that carry the state exactly over one sample when inputs and
disturbances are held constant over it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..basics import ComplexArray, FloatArray, ReadOnlyArrays


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


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpace(ReadOnlyArrays):
    """Matrices and names of a plant, sampled or not; `LinearPlant` says what they are."""

    A: FloatArray
    B: FloatArray
    E: FloatArray
    C: FloatArray
    D: FloatArray
    F: FloatArray
    Cz: FloatArray
    Dz: FloatArray
    Fz: FloatArray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    measurements: tuple[str, ...]
    outputs: tuple[str, ...]
    delays: tuple[float, ...]
    rates: Mapping[str, str]

    def poles(self) -> ComplexArray:
        """Return the eigenvalues of A, (n,): [1/s], of a sampled plant [-]; delays have none."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class DiscretePlant(StateSpace):
    """x[k+1] = A x + B u + E w; y = C x + D u + F w; z = Cz x + Dz u + Fz w.

    Shapes and names as in `LinearPlant`.  Measurement delays are not folded in: `delays`
    [s] says by how much y is late, and whoever samples it decides on the buffer.

    Parameters
    ----------
    dt
        Sample time [s].
    """

    dt: float

    def __str__(self) -> str:
        """Return a small tree of sizes."""
        return (
            f"DiscretePlant, sampled every {self.dt:g} s\n"
            f"├ states: {len(self.states)}\n"
            f"├ inputs: {', '.join(self.inputs)}\n"
            f"├ disturbances: {', '.join(self.disturbances)}\n"
            f"├ measurements: {', '.join(self.measurements)}\n"
            f"└ outputs: {', '.join(self.outputs)}"
        )
