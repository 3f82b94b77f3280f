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
from itertools import product

import numpy as np

from models.basics import ComplexArray, FloatArray, Quadrature, read_only

_TOGETHER = ("motor.torque", "motor.speed")  # whose covariance heats a motor


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaMoments:
    """Variances m0 and second moments m2 of outputs in r sea states, each (r,).

    `together` is the covariance of torque and speed, where both are among the outputs (r,).
    `signed` has the same for each combination of signs that the reference unit's error may have.
    The limits on signals make their rows of it (`synth.limits.Limit.rows`), one for each sea state.
    """

    m0: Mapping[str, FloatArray]
    m2: Mapping[str, FloatArray]
    together: FloatArray | None = None
    signed: Sequence[SeaMoments] = ()

    def moment(self, output: str, order: int) -> FloatArray:
        """Return the spectral moment of order 0 or 2 of an output (r,)."""
        return (self.m2 if order else self.m0)[output]

    def covariance(self, one: str, other: str) -> FloatArray:
        """Return the covariance of the motor's torque and speed (r,)."""
        assert {one, other} == {*_TOGETHER}
        assert self.together is not None
        return self.together

    @property
    def members(self) -> Sequence[SeaMoments]:
        """The same for each combination of signs of the reference unit's error; or this alone."""
        return self.signed or (self,)

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
    shares
        Gain and phase error of the reference unit over the heave at the nodes, (0 to 2, n).
    error
        Which of the w disturbances that error is; the heave is the first.
    """

    nodes: Quadrature
    outputs: tuple[str, ...]
    table: ComplexArray
    reference: float
    shares: ComplexArray | None = None
    error: int = 0

    @property
    def _vf(self) -> ComplexArray:
        return np.asarray(self.table[-1, -1])

    @cached_property
    def _update(self) -> ComplexArray:
        """G of the outputs (o, w, n)."""
        zf, vw = self.table[:-1, -1:], self.table[-1:, :-1]
        return np.asarray(self.table[:-1, :-1] * self._vf - zf * vw)

    @property
    def _pairs(self) -> list[tuple[int, int]]:
        """Two outputs of every moment (p): each with itself, then torque with speed."""
        pairs = [(k, k) for k in range(len(self.outputs))]
        if {*_TOGETHER} <= {*self.outputs}:
            pairs.append((self.outputs.index(_TOGETHER[0]), self.outputs.index(_TOGETHER[1])))
        return pairs

    def _products(self, one: ComplexArray, other: ComplexArray) -> FloatArray:
        """Return coefficients of 1, D, D^2 of Re(conj(F) F') of pairs, (w, n, 2 x 3 x p).

        First those of the densities, then those times omega^2; F and F', times the denominator, are
        `one` and `other`, (2, o, w, n): what they are at the reference, and what D adds.
        """
        left, right = np.array(self._pairs).T
        a, b = one[:, left].conj(), other[:, right]
        parts = np.stack([a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[1] * b[1]]).real  # (3, p, w, n)
        both = np.stack([parts, parts * self.nodes.omega**2])
        moved = np.transpose(both, (3, 4, 0, 1, 2))
        return read_only(moved.reshape(*moved.shape[:2], -1))

    @cached_property
    def _tables(self) -> FloatArray:
        """Coefficients of the moments over the densities of the disturbances; see `_products`."""
        every = np.stack([self.table[:-1, :-1], self._update])
        return self._products(every, every)

    @cached_property
    def _crossed(self) -> FloatArray:
        """Coefficients of what gain and phase error add over the heave's density, (0 to 2, ..)."""
        if self.shares is None or not len(self.shares):
            return np.zeros((0, 0, 0))
        every = np.stack([self.table[:-1, :-1], self._update])
        heave, error = every[:, :, :1], every[:, :, self.error, None] * self.shares
        heave = np.broadcast_to(heave, error.shape)
        return self._products(heave, error) + self._products(error, heave)

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
        rows, count = coefficient.size, len(self.outputs)
        weights = self.nodes.weights / self._denominator(coefficient)  # (r, n)
        D = (coefficient - self.reference)[:, None, None]

        def of_drag(found: FloatArray) -> FloatArray:
            parts = found.reshape(rows, 2, 3, -1)
            both = parts[:, :, 0] + D * (parts[:, :, 1] + D * parts[:, :, 2])
            return both.transpose(1, 2, 0)  # (2, p, r)

        def named(both: FloatArray, signed: Sequence[SeaMoments] = ()) -> SeaMoments:
            # Rounding may leave a trifle below zero where an output does not move at all.
            plain = np.maximum(both[:, :count], 0.0)
            m0, m2 = (dict(zip(self.outputs, part, strict=True)) for part in plain)
            together = both[0, count] if both.shape[1] > count else None
            return SeaMoments(m0=m0, m2=m2, together=together, signed=signed)

        pairs = zip(self._tables, densities, strict=True)
        mean = of_drag(sum((weights * density) @ table for table, density in pairs))
        cross = [of_drag((weights * densities[0]) @ table) for table in self._crossed]
        signs = product((1.0, -1.0), repeat=len(cross)) if cross else ()
        members = [
            named(mean + sum(s * part for s, part in zip(own, cross, strict=True))) for own in signs
        ]
        return named(mean, members)

    def gains(self, coefficient: float) -> FloatArray:
        """Return the squared moduli of the responses for one coefficient [N s/m], (o, w, n)."""
        D = coefficient - self.reference
        changed = (self.table[:-1, :-1] + D * self._update) / (1.0 + D * self._vf)
        return np.asarray(np.abs(changed) ** 2)

    def _denominator(self, coefficient: FloatArray) -> FloatArray:
        D = (coefficient - self.reference)[:, None]
        # The modulus without complex numbers: this is what the search for the drag spends.
        return np.asarray(1.0 + D * (2.0 * self._vf.real + D * np.abs(self._vf) ** 2))
