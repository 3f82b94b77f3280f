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

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, Quadrature, read_only


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaMoments:
    """Variances m0 and second moments m2 of outputs in r sea states, each (r,).

    The limits on signals make their rows of it (`synth.limits.Limit.rows`), one for each sea state.
    """

    m0: Mapping[str, FloatArray]
    m2: Mapping[str, FloatArray]

    def moment(self, output: str, order: int) -> FloatArray:
        """Return the spectral moment of order 0 or 2 of an output (r,)."""
        return (self.m2 if order else self.m0)[output]

    def peak(self, output: str, duration: float) -> FloatArray:
        """Return the most probable maximum in `duration` [s] without the mean (r,).

        As `models.basics.metrics.peak_factor`, sigma sqrt(2 ln(T/T_z)), held at one sigma.
        """
        m0, m2 = self.m0[output], self.m2[output]
        still = (m0 <= 0.0) | (m2 <= 0.0)
        crossings = duration / (2.0 * math.pi) * np.sqrt(m2 / np.where(still, 1.0, m0))
        k = np.sqrt(np.maximum(2.0 * np.log(np.where(still, 1.0, crossings)), 1.0))
        return np.asarray(k * np.sqrt(m0), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class DragResponses:
    """Responses of a system on n nodes, with the drag coefficient as a variable.

    Attributes
    ----------
    nodes
        Frequencies and weights of the integrals (n,).
    outputs
        Names of the o outputs.
    table
        Responses of the outputs and, last, of the payload's velocity, to the w disturbances and,
        last, to a force on the payload, at the coefficient `reference` (o + 1, w + 1, n).
    reference
        Drag coefficient C_0 that the responses hold [N s/m].
    """

    nodes: Quadrature
    outputs: tuple[str, ...]
    table: ComplexArray
    reference: float

    @property
    def _vf(self) -> ComplexArray:
        return np.asarray(self.table[-1, -1])

    @cached_property
    def _update(self) -> ComplexArray:
        """G of the outputs (o, w, n)."""
        zf, vw = self.table[:-1, -1:], self.table[-1:, :-1]
        return np.asarray(self.table[:-1, :-1] * self._vf - zf * vw)

    @cached_property
    def _tables(self) -> FloatArray:
        """Coefficients of 1, D, D^2 of every output's squared modulus, (w, n, 2 x 3 x o).

        First those of the densities, then those times omega^2.
        """
        zw = self.table[:-1, :-1]
        parts = np.stack(
            [
                np.abs(zw) ** 2,
                2.0 * np.real(np.conj(zw) * self._update),
                np.abs(self._update) ** 2,
            ]
        )  # (3, o, w, n)
        both = np.stack([parts, parts * self.nodes.omega**2])
        moved = np.transpose(both, (3, 4, 0, 1, 2))
        return read_only(moved.reshape(*moved.shape[:2], -1))

    def weighted_speed(self, densities: Sequence[FloatArray]) -> FloatArray:
        """Return what `speed_variance` sums up, at the reference, (r, n).

        Parameters
        ----------
        densities
            One-sided densities of the disturbances at the nodes, each (r, n) or (1, n).
        """
        squared = np.abs(self.table[-1, :-1]) ** 2
        total = sum(row * density for row, density in zip(squared, densities, strict=True))
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

    def moments(self, densities: Sequence[FloatArray], coefficient: FloatArray) -> SeaMoments:
        """Return the moments of every output.

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
        for table, density in zip(self._tables, densities, strict=True):
            found += (weights * density) @ table
        parts = found.reshape(rows, 2, 3, len(self.outputs))
        D = (coefficient - self.reference)[:, None]
        both = parts[:, :, 0] + D[:, None] * (parts[:, :, 1] + D[:, None] * parts[:, :, 2])
        # Rounding may leave a trifle below zero where an output does not move at all.
        m0, m2 = np.maximum(both, 0.0).transpose(1, 2, 0)
        return SeaMoments(
            m0=dict(zip(self.outputs, m0, strict=True)), m2=dict(zip(self.outputs, m2, strict=True))
        )

    def gains(self, coefficient: float) -> FloatArray:
        """Return the squared moduli of the responses for one coefficient [N s/m], (o, w, n)."""
        D = coefficient - self.reference
        changed = (self.table[:-1, :-1] + D * self._update) / (1.0 + D * self._vf)
        return np.asarray(np.abs(changed) ** 2)

    def _denominator(self, coefficient: FloatArray) -> FloatArray:
        D = (coefficient - self.reference)[:, None]
        # The modulus without complex numbers: this is what the search for the drag spends.
        return np.asarray(1.0 + D * (2.0 * self._vf.real + D * np.abs(self._vf) ** 2))
