r"""The loop on frequencies in numbers: responses, moments and return differences with slopes.

::

                 w ---->+-----------+----> z
                        |   plant   |
              +--> u -->|           |----> y --+
              |         +-----------+          |
              +----------- C(s) <--------------+

With the plant's blocks at a frequency and u = C y,

.. math::

    G = (I - C P_{yu})^{-1}, \quad v = G C P_{yw}, \quad y = P_{yw} + P_{yu} v,
    \quad F = P_{zw} + P_{zu} v

is the closed loop from w to z; L = -C P_yu is the gain of the loop broken at u, and one over a
diagonal entry of G is 1 + L_i of loop i broken with all others closed.  Every slope follows from
that of the controller alone,

.. math::

    dF = P_{zu} G \, dC \, y, \quad dG = G \, dC \, P_{yu} G .

Reports and the optimiser look through the same lines; the verification does not.  Given many laws
at once and no slopes, they screen candidates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray
from models.plant import PlantResponse

from .controller import LinearController
from .dual import Dual
from .elements import Coefficients, Element


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopBlocks:
    """A plant's blocks at k points s.

    `zw` (nz, nw, k), `zu` (nz, m, k), `yw` (l, nw, k), `yu` (l, m, k), with m inputs and l
    measurements.  `outputs` and `sources` name z and w.
    """

    s: ComplexArray
    zw: ComplexArray
    zu: ComplexArray
    yw: ComplexArray
    yu: ComplexArray
    outputs: tuple[str, ...]
    sources: tuple[str, ...]

    @classmethod
    def of(
        cls,
        response: PlantResponse,
        outputs: Sequence[str] | None = None,
        sources: Sequence[str] | None = None,
    ) -> LoopBlocks:
        """Return the blocks of a response, by default for all its outputs and disturbances."""
        outputs = response.outputs if outputs is None else tuple(outputs)
        sources = response.disturbances if sources is None else tuple(sources)
        zw, zu, yw = response.zw, response.zu, response.yw
        if outputs != response.outputs:
            z = [response.outputs.index(name) for name in outputs]
            zw, zu = zw[:, z], zu[:, z]
        if sources != response.disturbances:
            w = [response.disturbances.index(name) for name in sources]
            zw, yw = zw[:, :, w], yw[:, :, w]
        zw, zu, yw, yu = (
            np.ascontiguousarray(block.transpose(1, 2, 0)) for block in (zw, zu, yw, response.yu)
        )
        return cls(s=response.s, zw=zw, zu=zu, yw=yw, yu=yu, outputs=outputs, sources=sources)

    def repeated(self, times: int) -> LoopBlocks:
        """Return the points several times, one after the other."""
        zw, zu, yw, yu = (np.tile(part, times) for part in (self.zw, self.zu, self.yw, self.yu))
        return replace(self, s=np.tile(self.s, times), zw=zw, zu=zu, yw=yw, yu=yu)


@dataclass(frozen=True, kw_only=True, eq=False)
class Closing:
    """What closes a loop: C at k points, the drag's loop in it, and its slopes."""

    #: The entries of C that are not zero, (..., k) each, by row and column.
    entries: Mapping[tuple[int, int], ComplexArray]
    size: tuple[int, int]  #: Rows and columns of C, (m, l).
    #: For each entry that depends on a variable which ones, (n,), and its slopes by them, (n, k);
    #: None if none are asked for.
    slopes: Mapping[tuple[int, int], tuple[list[int], ComplexArray]] | None = None
    count: int = 0  #: How many variables there are.

    @classmethod
    def of(cls, controller: LinearController, s: ComplexArray) -> Closing:
        """Return what a controller closes a loop with at points `s`, (k,) [1/s]."""
        law = controller.response_at(s).transpose(1, 2, 0)
        entries = {(i, j): law[i, j] for i in range(law.shape[0]) for j in range(law.shape[1])}
        return cls(entries=entries, size=law.shape[:2])

    def part(self, which: slice) -> Closing:
        """Return some of the points."""
        slopes = self.slopes
        if slopes is not None:
            slopes = {key: (at, slope[:, which]) for key, (at, slope) in slopes.items()}
        entries = {key: entry[..., which] for key, entry in self.entries.items()}
        return replace(self, entries=entries, slopes=slopes)

    def times(self, b: ComplexArray) -> ComplexArray:
        """Return C b of a matrix (l, n, ..., k), of which few entries are zero."""
        many = np.broadcast_shapes(*(entry.shape for entry in self.entries.values()), b.shape[2:])
        found = np.zeros((self.size[0], b.shape[1], *many), np.complex128)
        for (i, j), entry in self.entries.items():
            found[i] += entry * b[j]
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Shaking:
    """What shakes a loop at k points, times quadrature weights."""

    weights: FloatArray  #: Of the density of each disturbance, (nw, k).
    #: Places of two disturbances that go together, and of their cross-densities, (e, k).
    source: int
    error: int
    shares: ComplexArray
    signs: FloatArray  #: Every combination of signs that these may have, (c, e).


class LoopResponses:
    """The closed loop at some points: the plant's blocks, and what closes it at the same points."""

    def __init__(self, blocks: LoopBlocks, closing: Closing) -> None:
        self.outputs, self.sources = blocks.outputs, blocks.sources
        self._closing, self._omega, self.count = closing, np.abs(blocks.s), closing.count
        parts = blocks.zw, blocks.zu, blocks.yw, blocks.yu
        if any(entry.ndim > 1 for entry in closing.entries.values()):
            # Many parameter vectors: an axis for them before that of the points.
            parts = tuple(part[..., None, :] for part in parts)  # type: ignore[assignment]
        self._zw, self._zu, self._yw, self._yu = parts
        through = closing.times(self._yu)
        m = closing.size[0]
        self._matrix = np.eye(m).reshape(m, m, *(1,) * (through.ndim - 2)) - through

    @classmethod
    def of(
        cls,
        response: PlantResponse,
        controller: LinearController,
        sources: Sequence[str] | None = None,
    ) -> LoopResponses:
        """Return the closed loop of a plant's response and a controller of its measurements."""
        return cls(LoopBlocks.of(response, sources=sources), Closing.of(controller, response.s))

    @property
    def omega(self) -> FloatArray:
        """Size of the points, (k,) [rad/s]."""
        return self._omega

    @cached_property
    def inverse(self) -> ComplexArray:
        """G = (I - C P_yu)^-1, (m, m, ..., k)."""
        return _inverse(self._matrix)

    @property
    def responses(self) -> ComplexArray:
        """The responses of all outputs to all disturbances, (z, w, ..., k)."""
        return self._all(slice(None))

    def _all(self, rows: Any) -> ComplexArray:
        """Return the responses of some outputs to all disturbances, (rows, w, ..., k)."""
        return np.asarray(self._zw[rows] + _times(self._zu[rows], self._commands))

    @cached_property
    def _commands(self) -> ComplexArray:
        """The commands that each disturbance causes, (m, nw, ..., k)."""
        return _times(self.inverse, self._closing.times(self._yw))

    @cached_property
    def _heard(self) -> ComplexArray:
        """What the controller hears of each disturbance, (l, nw, ..., k)."""
        return np.asarray(self._yw + _times(self._yu, self._commands))

    def _through(self, rows: Any) -> ComplexArray:
        """Return the ways of a change of commands to some outputs, P_zu G, (rows, m, ..., k)."""
        return _times(self._zu[rows], self.inverse)

    def response(self, output: str, source: str) -> Any:
        """Return the response of an output to a disturbance, (k,)."""
        row, column = self.outputs.index(output), self.sources.index(source)
        through = np.einsum("m...,m...->...", self._zu[row], self._commands[:, column])
        value = self._zw[row, column] + through
        if self._closing.slopes is None:
            return value
        heard = self._yw[:, column] + _times(self._yu, self._commands[:, column, None])[:, 0]
        return Dual(value, self._turned(self._through([row])[0], heard))

    def difference(self, index: int) -> Any:
        """Return 1 + L of the loop broken at one command, all others closed, (k,)."""
        if self._closing.slopes is None:
            single = len(self._matrix) == 1
            return self._matrix[0, 0] if single else 1.0 / self.inverse[index, index]
        own = self.inverse[index, index]
        # dG_ii = G_i. dC (P_yu G)_.i
        back = _times(self._yu, self.inverse[:, index, None])[:, 0]
        return Dual(1.0 / own, self._turned(self.inverse[index], back) / -(own**2))

    def determinant(self) -> Any:
        """Return det(I - C P_yu), (k,)."""
        whole = np.linalg.det(np.moveaxis(self._matrix, (0, 1), (-2, -1)))
        if self._closing.slopes is None:
            return whole
        # d det M = det M tr(M^-1 dM), M = I - C P_yu
        turned = _times(self._yu, self.inverse)
        slope = np.zeros((self.count, whole.size), np.complex128)
        for (i, j), (at, part) in self._closing.slopes.items():
            slope[at] -= part * turned[j, i]
        return Dual(whole, slope * whole)

    def _turned(self, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        """Return left . dC right of vectors (m, k) and (l, k) by each variable, (n, k)."""
        assert self._closing.slopes is not None
        found = np.zeros((self.count, right.shape[-1]), np.complex128)
        for (i, j), (at, slope) in self._closing.slopes.items():
            found[at] += slope * (left[i] * right[j])
        return found

    def integrals(
        self,
        outputs: Sequence[str],
        pairs: Sequence[tuple[str, str]],
        shaking: Shaking,
        orders: Sequence[int],
    ) -> Any:
        """Return integrals of Re conj(F_one) S F_other over all disturbances: moments, covariances.

        They are of each output with itself, then of the pairs, for each power of omega in
        `orders`.  S is given by its diagonal first and then what is beside it, one after the
        other.  Returned is an array or a `Dual` (outputs and pairs, orders, ..., 1 + e).
        """
        rows = [self.outputs.index(name) for name in outputs]
        some = [[outputs.index(name) for name in pair] for pair in pairs]
        ones, others = np.array([*((i, i) for i in range(len(rows))), *some]).T
        found = self._all(rows)  # (z, nw, ..., k)
        powers = np.array([self._omega**order for order in orders])
        between = (1,) * (found.ndim - 3)
        shaken = found * shaking.weights.reshape(len(shaking.weights), *between, -1)
        own, other = found.view(np.float64), shaken.view(np.float64)
        both = zip(own[ones], other[others], strict=True)
        sums = np.array([np.einsum("w...,w...->...", one, other) for one, other in both])
        values = [sums @ np.repeat(powers, 2, axis=-1).T]
        # Of what is beside the diagonal Re share conj(a) b, for all orders and shares at once.
        shares = (powers[:, None] * shaking.shares).reshape(-1, powers.shape[1])
        from_source, from_error = found[:, shaking.source], found[:, shaking.error]
        if len(shares):
            crossed = from_source[ones].conj() * from_error[others]
            crossed += from_error[ones] * from_source[others].conj()
            values.append((crossed @ shares.T).real)
        parts = [value.reshape(*value.shape[:-1], len(orders), -1) for value in values]
        value = np.moveaxis(np.concatenate(parts, axis=-1), -2, 1)
        if self._closing.slopes is None:
            return value
        slope = np.zeros((self.count, len(ones), len(orders), 1 + len(shaking.shares)))
        through = self._through(rows).conj()
        # Over the disturbances first: what is heard goes with what comes out.
        heard = [*dict.fromkeys(j for _, j in self._closing.slopes)]
        together = np.einsum("zwk,jwk->jzk", shaken, self._heard[heard].conj())
        for (i, j), (at, change) in self._closing.slopes.items():
            back = together[heard.index(j)]
            both = 2.0 * back * through[:, i]
            more = [back[a] * through[b, i] + back[b] * through[a, i] for a, b in some]
            turns = (change[:, None] * powers).reshape(-1, change.shape[1])
            added = _real_product(turns, np.array([*both, *more]))
            slope[at, ..., 0] += added.reshape(len(at), len(orders), -1).swapaxes(1, 2)
        for i, at, moved in self._changes if len(shares) else ():
            for place, response in ((shaking.error, from_source), (shaking.source, from_error)):
                both = response[ones] * through[others, i] + response[others] * through[ones, i]
                share = shares if place == shaking.error else shares.conj()
                turns = (moved[:, None, place] * share).reshape(-1, shares.shape[1])
                added = _real_product(turns, both).reshape(len(at), len(orders), -1, len(ones))
                slope[at, ..., 1:] += added.transpose(0, 3, 1, 2)
        return Dual(value, slope)

    @cached_property
    def _changes(self) -> list[tuple[int, list[int], ComplexArray]]:
        """What variables change about each command but for the loop, dC y, (n, nw, k).

        With it which command, and which variables, (n,).
        """
        assert self._closing.slopes is not None
        found = []
        for i in range(self._closing.size[0]):
            parts = [(j, *part) for (row, j), part in self._closing.slopes.items() if row == i]
            variables = sorted({a for _, at, _ in parts for a in at})
            change = np.zeros((len(variables), *self._heard.shape[1:]), np.complex128)
            for j, at, slope in parts:
                change[[variables.index(a) for a in at]] += slope[:, None] * self._heard[j]
            found.append((i, variables, change))
        return found

    def curvature(self, output: str, weights: FloatArray) -> FloatArray:
        """Return half the Gauss-Newton Hessian of an integral of |F|^2, (n, n); see `moments`."""
        left = self._through([self.outputs.index(output)])[0]
        parts = [change * (left[i] * np.sqrt(weights)) for i, _, change in self._changes]
        slope = np.concatenate(parts).reshape(-1, weights.size)
        of = np.concatenate([at for _, at, _ in self._changes])
        found = np.zeros((self.count, self.count))
        np.add.at(found, (of[:, None], of), _real_product(slope, slope))
        return found


def blocks_with(
    blocks: LoopBlocks, elements: Sequence[Element], coefficients: Coefficients
) -> LoopBlocks:
    """Return the blocks of a plant with elements, as `with_elements`, by a rank-one change each.

    Velocities and forces must be among the outputs and the disturbances.
    """
    zw, zu, yw, yu = blocks.zw, blocks.zu, blocks.yw, blocks.yu
    for element, coefficient in zip(elements, coefficients, strict=True):
        gain = element.reference - coefficient
        v, f = blocks.outputs.index(element.velocity), blocks.sources.index(element.force)
        around = gain / (1.0 - gain * zw[v, f])
        by_w, by_u = around * zw[v], around * zu[v]
        into_z, into_y = zw[:, f, None], yw[:, f, None]
        zw, zu = zw + into_z * by_w, zu + into_z * by_u
        yw, yu = yw + into_y * by_w, yu + into_y * by_u
    return replace(blocks, zw=zw, zu=zu, yw=yw, yu=yu)


def _real_product(a: ComplexArray, b: ComplexArray) -> FloatArray:
    """Return Re a b^H of matrices whose rows are long."""
    return np.asarray(a.view(np.float64) @ b.view(np.float64).T)


def _times(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return the product of matrices that stand on the first two axes."""
    return np.asarray(np.einsum("ij...,jk...->ik...", a, b))


def _inverse(a: ComplexArray) -> ComplexArray:
    """Return the inverse of matrices on the first two axes."""
    if len(a) == 1:
        return np.asarray(1.0 / a)
    if len(a) == 2:
        determinant = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        return np.asarray(np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]) / determinant)
    if len(a) == 3:
        one, other = np.array([1, 2, 0]), np.array([2, 0, 1])
        cofactors = a[one[:, None], one] * a[other[:, None], other]
        cofactors -= a[one[:, None], other] * a[other[:, None], one]
        return np.asarray(cofactors.swapaxes(0, 1) / (a[0] * cofactors[0]).sum(axis=0))
    found: ComplexArray = np.linalg.inv(np.moveaxis(a, (0, 1), (-2, -1))).astype(np.complex128)
    return np.moveaxis(found, (-2, -1), (0, 1))


def with_loops(cross: ComplexArray, felt: ComplexArray, gains: FloatArray) -> FloatArray:
    """Return variances of velocities with forces -gain velocity closed around them, (m,).

    The m velocities have the cross-densities (m, m, k) without, times quadrature weights; `felt`
    are their responses to the forces, (m, m, k).  There is one gain for each, (m,).
    """
    closed = _inverse(np.eye(len(gains))[:, :, None] + felt * gains[None, :, None])
    return np.asarray(np.einsum("abk,bck,ack->a", closed, cross, closed.conj()).real)
