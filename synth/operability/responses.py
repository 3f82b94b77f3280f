r"""Closed-loop responses on nodes for all coefficients of drag and losses, and their moments.

A payload's quadratic drag enters a linear loop as a force f = -(C - C_0) v on top of the drag C_0
that the loop holds already, so the responses for any C follow from those for C_0 by a rank-one
update (Sherman and Morrison 1950): with D = C - C_0,

.. math::

    F_{zw}(C) = F_{zw} - D\, F_{zf} F_{vw} / (1 + D\, F_{vf})
              = (F_{zw} + D\, G) / (1 + D\, F_{vf}), \qquad
    G = F_{zw} F_{vf} - F_{zf} F_{vw},

and its squared modulus is a quadratic in D over another.  With losses that switch as a torque -b
omega besides, numerator and denominator are the determinants

.. math::

    \begin{vmatrix} F_{zw} & D F_{zf} & b F_{zg} \\
        F_{vw} & 1 + D F_{vf} & b F_{vg} \\
        F_{\omega w} & D F_{\omega f} & 1 + b F_{\omega g} \end{vmatrix}, \qquad
    \begin{vmatrix} 1 + D F_{vf} & b F_{vg} \\ D F_{\omega f} & 1 + b F_{\omega g} \end{vmatrix},

both sums of 1, D, b and D b times what does not depend on them.  Moments of all outputs, for all
seas and all coefficients, are then products of real matrices.  That is what makes a contour over
sea states cost no more than a handful of single evaluations, without an approximation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, product

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
    """Responses of a system on n nodes, with the drag coefficient as a variable."""

    nodes: Quadrature  #: Frequencies and weights of the integrals (n,).
    outputs: tuple[str, ...]  #: Names of the o outputs.
    #: Responses of the outputs and, last, of the payload's velocity, to the w disturbances and,
    #: last, to a force on the payload, at the coefficient `reference` (o + 1, w + 1, n); with
    #: losses the motor's speed and a torque on it follow (o + 2, w + 2, n).
    table: ComplexArray
    reference: float  #: Drag coefficient C_0 that the responses hold [N s/m].
    losses: bool = False  #: Whether there are losses; the responses hold none.
    #: Gain and phase error of the reference unit over the heave at the nodes, (0 to 2, n).
    shares: ComplexArray | None = None
    error: int = 0  #: Which of the w disturbances that error is; the heave is the first.

    @cached_property
    def _updates(self) -> list[ComplexArray]:
        """What the numerators of the outputs have with 1 and D, b and D b, (o, w, n) each."""
        o, w = len(self.outputs), self.table.shape[1] - 1 - self.losses
        zw, t = self.table[:o, :w], self.table
        zf, vw, vf = t[:o, w, None], t[o, :w], t[o, w]
        found = [zw, zw * vf - zf * vw]
        if self.losses:
            zg, vg, sw, sf, sg = t[:o, w + 1, None], t[o, w + 1], t[o + 1, :w], t[-1, w], t[-1, -1]
            found.append(zw * sg - zg * sw)
            whole = zw * (vf * sg - vg * sf)
            found.append(whole - zf * (vw * sg - vg * sw) + zg * (vw * sf - vf * sw))
        return found

    @property
    def _pairs(self) -> list[tuple[int, int]]:
        """Two outputs of every moment (p): each with itself, then torque with speed."""
        pairs = [(k, k) for k in range(len(self.outputs))]
        if {*_TOGETHER} <= {*self.outputs}:
            pairs.append((self.outputs.index(_TOGETHER[0]), self.outputs.index(_TOGETHER[1])))
        return pairs

    def _products(self, one: ComplexArray, other: ComplexArray) -> FloatArray:
        """Return coefficients of Re(conj(F) F') of pairs, (w, n, 2 x products x p).

        Those of the products of any two of `_factors`; first of the densities, then times omega^2.
        F and F', times the denominator, are `one` and `other`, what goes with each of the factors,
        (2 or 4, o, w, n).
        """
        left, right = np.array(self._pairs).T
        a, b = one[:, left].conj(), other[:, right]
        parts = np.stack(
            [
                (a[i] * b[i] if i == j else a[i] * b[j] + a[j] * b[i]).real
                for i, j in combinations_with_replacement(range(len(one)), 2)
            ]
        )  # (products, p, w, n)
        both = np.stack([parts, parts * self.nodes.omega**2])
        moved = np.transpose(both, (3, 4, 0, 1, 2))
        return read_only(moved.reshape(*moved.shape[:2], -1))

    @cached_property
    def _tables(self) -> FloatArray:
        """Coefficients of the moments over the densities of the disturbances; see `_products`."""
        every = np.stack(self._updates)
        return self._products(every, every)

    @cached_property
    def _crossed(self) -> FloatArray:
        """Coefficients of what gain and phase error add over the heave's density, (0 to 2, ..)."""
        if self.shares is None or not len(self.shares):
            return np.zeros((0, 0, 0))
        every = np.stack(self._updates)
        heave, error = every[:, :, :1], every[:, :, self.error, None] * self.shares
        heave = np.broadcast_to(heave, error.shape)
        return self._products(heave, error) + self._products(error, heave)

    def _factors(self, coefficients: Sequence[FloatArray]) -> list[FloatArray]:
        """Return 1 and D, b and D b, (r,) each."""
        D = coefficients[0] - self.reference
        found = [np.ones_like(D), D]
        return found + [factor * coefficients[1] for factor in found] if self.losses else found

    def speeds(self, densities: Sequence[FloatArray]) -> list[FloatArray]:
        """Return the numerators of the spectra of payload's velocity and motor's speed, (3, r, n).

        They are quadratics, weighted for a sum over the nodes: that of the payload in the
        coefficient of losses, which is there only where there are any, that of the motor in the
        drag less `reference`.  Densities of the disturbances at the nodes are one-sided, (r, n) or
        (1, n) each.
        """
        o, w = len(self.outputs), self.table.shape[1] - 1 - self.losses
        t = self.table
        parts = [(t[o, :w], np.zeros_like(t[o, :w]))]
        if self.losses:
            parts = [
                (t[o, :w], t[o, :w] * t[-1, -1] - t[o, w + 1] * t[-1, :w]),
                (t[-1, :w], t[-1, :w] * t[o, w] - t[-1, w] * t[o, :w]),
            ]
        found = []
        for part in parts:
            sizes = np.moveaxis(_square(*part), 1, 0)  # (w, 3, n)
            each = (s[:, None] * d for s, d in zip(sizes, densities, strict=True))
            found.append(np.asarray(sum(each) * self.nodes.weights, dtype=np.float64))
        return found

    def denominators(self, slack: FloatArray) -> FloatArray:
        """Return the denominators of all spectra, quadratics in the drag less `reference`.

        `slack` is the coefficient of losses (r,), which is 0 where there are none; (3, r, n).
        """
        if not self.losses:
            vf = self.table[len(self.outputs), -1]
            return _square(np.ones_like(vf), vf)[:, None]
        whole, x = self._determinants, slack[:, None]
        return whole[:, 0, None] + x * (whole[:, 1, None] + x * whole[:, 2, None])

    @cached_property
    def _determinants(self) -> FloatArray:
        """Coefficients of the denominators by powers of drag and losses, (3, 3, n)."""
        o, w = len(self.outputs), self.table.shape[1] - 2
        vf, vg = self.table[o, w], self.table[o, w + 1]
        sf, sg = self.table[-1, w], self.table[-1, -1]
        both = vf * sg - vg * sf
        one = np.ones_like(vf)
        # |1 + b sg + D (vf + b both)|^2
        middle = [vf.real, both.real + (sg.conj() * vf).real, (sg.conj() * both).real]
        return np.stack([_square(one, sg), 2.0 * np.stack(middle), _square(vf, both)])

    def moments(
        self, densities: Sequence[FloatArray], coefficients: Sequence[FloatArray]
    ) -> SeaMoments:
        """Return the moments of every output; arguments are as in `weighted_speeds`."""
        rows, count = coefficients[0].size, len(self.outputs)
        weights = self.nodes.weights / self._denominator(coefficients)  # (r, n)
        factors = list(combinations_with_replacement(self._factors(coefficients), 2))

        def of_elements(found: FloatArray) -> FloatArray:
            parts = found.reshape(rows, 2, len(factors), -1)
            both = np.zeros((rows, 2, parts.shape[-1]))
            for k, (a, b) in enumerate(factors):
                both += parts[:, :, k] * (a * b)[:, None, None]
            return both.transpose(1, 2, 0)  # (2, p, r)

        def named(both: FloatArray, signed: Sequence[SeaMoments] = ()) -> SeaMoments:
            # Rounding may leave a trifle below zero where an output does not move at all.
            plain = np.maximum(both[:, :count], 0.0)
            m0, m2 = (dict(zip(self.outputs, part, strict=True)) for part in plain)
            together = both[0, count] if both.shape[1] > count else None
            return SeaMoments(m0=m0, m2=m2, together=together, signed=signed)

        pairs = zip(self._tables, densities, strict=True)
        mean = of_elements(sum((weights * density) @ table for table, density in pairs))
        cross = [of_elements((weights * densities[0]) @ table) for table in self._crossed]
        signs = product((1.0, -1.0), repeat=len(cross)) if cross else ()
        members = [
            named(mean + sum(s * part for s, part in zip(own, cross, strict=True))) for own in signs
        ]
        return named(mean, members)

    def gains(self, coefficients: Sequence[float]) -> FloatArray:
        """Return the squared moduli of the responses for given coefficients, (o, w, n)."""
        known = [np.array([c]) for c in coefficients]
        pairs = zip(self._factors(known), self._updates, strict=True)
        changed = sum(factor * update for factor, update in pairs)
        return np.asarray(np.abs(changed) ** 2 / self._denominator(known)[0])

    def _denominator(self, coefficients: Sequence[FloatArray]) -> FloatArray:
        slack = coefficients[1] if self.losses else np.zeros(1)
        return quadratic(self.denominators(slack), coefficients[0] - self.reference)


def quadratic(coefficients: FloatArray, x: FloatArray) -> FloatArray:
    """Return quadratics of coefficients (3, r, n) at x (r,), (r, n)."""
    x = x[:, None]
    return np.asarray(coefficients[0] + x * (coefficients[1] + x * coefficients[2]))


def _square(one: ComplexArray, other: ComplexArray) -> FloatArray:
    """Return the coefficients of |one + x other|^2, a quadratic in a real x, (3, ..)."""
    return np.stack([np.abs(one) ** 2, 2.0 * (one.conj() * other).real, np.abs(other) ** 2])
