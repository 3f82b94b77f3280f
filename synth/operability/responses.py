r"""Closed-loop responses on nodes for every drag coefficient at once, and their moments.

A payload's quadratic drag enters a linear loop as a force f = -(C - C_0) v on top of the drag C_0
that the loop holds already, so the responses for any C follow from those for C_0 by a rank-one
update (Sherman and Morrison 1950): with D = C - C_0,

.. math::

    F_{zw}(C) = F_{zw} - D\, F_{zf} F_{vw} / (1 + D\, F_{vf})
              = (F_{zw} + D\, G) / (1 + D\, F_{vf}), \qquad
    G = F_{zw} F_{vf} - F_{zf} F_{vw},

and its squared modulus is a quadratic in D over another.  Moments of all outputs, for all seas and
all coefficients, are then products of real matrices.  That is what makes a contour over sea states
cost no more than a handful of single evaluations, without an approximation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, Quadrature, read_only


@dataclass(frozen=True, kw_only=True, eq=False)
class DragResponses:
    """Responses of a loop on n nodes, with the drag coefficient as a variable.

    Attributes
    ----------
    nodes
        Frequencies and weights of the integrals (n,).
    outputs, disturbances
        Names of the o outputs and the w disturbances.
    zw, zf
        Responses of the outputs to the disturbances (o, w, n) and to a force on the payload
        (o, n), at the coefficient `reference`.
    vw, vf
        Those of the payload's velocity, (w, n) and (n,).
    reference
        Drag coefficient C_0 that the responses hold [N s/m].
    """

    nodes: Quadrature
    outputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    zw: ComplexArray
    zf: ComplexArray
    vw: ComplexArray
    vf: ComplexArray
    reference: float

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ("zw", "zf", "vw", "vf"):
            array = np.array(getattr(self, name), dtype=np.complex128)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @cached_property
    def _tables(self) -> FloatArray:
        """Coefficients of 1, D, D^2 of every output's squared modulus, (w, n, 2 x 3 x o).

        First those of the densities, then those times omega^2.
        """
        update = self.zw * self.vf - self.zf[:, None, :] * self.vw[None]
        parts = np.stack(
            [
                np.abs(self.zw) ** 2,
                2.0 * np.real(np.conj(self.zw) * update),
                np.abs(update) ** 2,
            ]
        )  # (3, o, w, n)
        both = np.stack([parts, parts * self.nodes.omega**2])
        moved = np.transpose(both, (3, 4, 0, 1, 2))
        return read_only(moved.reshape(*moved.shape[:2], -1))

    @cached_property
    def _speed(self) -> FloatArray:
        """Squared modulus of the velocity's responses at the reference (w, n)."""
        return read_only(np.abs(self.vw) ** 2)

    @cached_property
    def _vf_parts(self) -> tuple[FloatArray, FloatArray]:
        return read_only(2.0 * self.vf.real), read_only(np.abs(self.vf) ** 2)

    def weighted_speed(self, densities: Sequence[FloatArray]) -> FloatArray:
        """Return what `speed_variance` sums up, at the reference, (r, n).

        Parameters
        ----------
        densities
            One-sided densities of the disturbances at the nodes, each (r, n) or (1, n).
        """
        total = sum(self._speed[k] * densities[k] for k in range(len(self.disturbances)))
        return np.asarray(total * self.nodes.weights, dtype=np.float64)

    def speed_variance(self, weighted: FloatArray, coefficient: FloatArray) -> FloatArray:
        """Return the variance of the payload's velocity [m2/s2] (r,).

        Parameters
        ----------
        weighted
            Of :meth:`weighted_speed`, (r, n).
        coefficient
            Drag coefficients (r,) [N s/m].
        """
        return np.asarray((weighted / self._denominator(coefficient)).sum(axis=1))

    def moments(
        self, densities: Sequence[FloatArray], coefficient: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the variance m0 and the second moment m2 of every output, each (r, o).

        Parameters
        ----------
        densities
            One-sided densities of the disturbances at the nodes, each (r, n) or (1, n).
        coefficient
            Drag coefficients (r,) [N s/m].
        """
        rows = coefficient.size
        weights = self.nodes.weights / self._denominator(coefficient)  # (r, n)
        found = np.zeros((rows, self._tables.shape[-1]))
        for k in range(len(self.disturbances)):
            found += (weights * densities[k]) @ self._tables[k]
        parts = found.reshape(rows, 2, 3, len(self.outputs))
        D = (coefficient - self.reference)[:, None]
        both = parts[:, :, 0] + D[:, None] * (parts[:, :, 1] + D[:, None] * parts[:, :, 2])
        # Rounding may leave a trifle below zero where an output does not move at all.
        both = np.maximum(both, 0.0)
        return both[:, 0], both[:, 1]

    def gains(self, coefficient: float) -> FloatArray:
        """Return the squared moduli of the responses for one coefficient [N s/m], (o, w, n)."""
        D = coefficient - self.reference
        update = self.zw * self.vf - self.zf[:, None, :] * self.vw[None]
        return np.asarray(np.abs((self.zw + D * update) / (1.0 + D * self.vf)) ** 2)

    def _denominator(self, coefficient: FloatArray) -> FloatArray:
        D = (coefficient - self.reference)[:, None]
        twice_real, square = self._vf_parts
        return np.asarray(1.0 + D * (twice_real + D * square), dtype=np.float64)
