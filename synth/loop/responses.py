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

    dv = G \, dC \, y, \quad dF = P_{zu} \, dv, \quad dG = G \, dC \, P_{yu} G .

Reports and the optimiser look through the same lines; the verification does not.  Given many laws
at once and no slopes, they screen candidates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import ComplexArray, FloatArray
from models.plant import PlantResponse

from .controller import LinearController
from .drag_element import DragElement
from .dual import Dual


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopBlocks:
    """A plant's blocks, the drag's loop among them, at k points s.

    `zw` (nz, nw, k), `zu` (nz, m, k), `yw` (l, nw, k), `yu` (l, m, k), with m inputs and l
    measurements of which the last of each is the drag's, if there is drag.  `outputs` and `sources`
    name z and w.
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
        drag: DragElement | None = None,
    ) -> LoopBlocks:
        """Return the blocks of a response, by default for all its outputs and disturbances."""
        outputs = response.outputs if outputs is None else tuple(outputs)
        sources = response.disturbances if sources is None else tuple(sources)
        z = [response.outputs.index(name) for name in outputs]
        w = [response.disturbances.index(name) for name in sources]
        zw, yw = response.zw[:, z][:, :, w], response.yw[:, :, w]
        zu, yu = response.zu[:, z], response.yu
        if drag is not None:
            v = response.outputs.index(drag.velocity)
            f = response.disturbances.index(drag.force)
            zu = np.concatenate([zu, response.zw[:, z, f : f + 1]], axis=2)
            yw = np.concatenate([yw, response.zw[:, v : v + 1][:, :, w]], axis=1)
            own = np.concatenate([response.zu[:, v : v + 1], response.zw[:, v : v + 1, f, None]], 2)
            yu = np.concatenate(
                [np.concatenate([yu, response.yw[:, :, f, None]], axis=2), own], axis=1
            )
        zw, zu, yw, yu = (
            np.ascontiguousarray(np.moveaxis(block, 0, -1)) for block in (zw, zu, yw, yu)
        )
        return cls(s=response.s, zw=zw, zu=zu, yw=yw, yu=yu, outputs=outputs, sources=sources)

    def part(self, which: slice) -> LoopBlocks:
        """Return some of the points."""
        return replace(
            self,
            s=self.s[which],
            zw=self.zw[..., which],
            zu=self.zu[..., which],
            yw=self.yw[..., which],
            yu=self.yu[..., which],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Closing:
    """What closes a loop: C at k points, (m, l, ..., k), the drag's loop in it, and its slopes.

    The slopes, if asked for, are those of the entries that depend on a variable, (k,) each, by
    variable.
    """

    law: ComplexArray
    slopes: list[dict[tuple[int, int], ComplexArray]] | None

    def part(self, which: slice) -> Closing:
        """Return some of the points."""
        slopes = self.slopes
        if slopes is not None:
            slopes = [{key: slope[which] for key, slope in own.items()} for own in slopes]
        return Closing(law=self.law[..., which], slopes=slopes)


class LoopResponses:
    """The closed loop at some points.

    Parameters
    ----------
    blocks, closing
        The plant's blocks, and what closes the loop at the same points.
    """

    def __init__(self, blocks: LoopBlocks, closing: Closing) -> None:
        law, slope = closing.law, closing.slopes
        self.outputs, self.sources = blocks.outputs, blocks.sources
        self.count = 0 if slope is None else len(slope)
        yu, yw = blocks.yu, blocks.yw
        if law.ndim > 3:  # many parameter vectors: an axis for them before that of the points
            yu, yw = yu[..., None, :], yw[..., None, :]
            self._zw, self._zu = blocks.zw[..., None, :], blocks.zu[..., None, :]
        else:
            self._zw, self._zu = blocks.zw, blocks.zu
        identity = np.eye(len(law)).reshape(len(law), len(law), *(1,) * (law.ndim - 2))
        self._matrix = identity - _times(law, yu)
        self._law, self._law_slope, self._yu, self._yw = law, slope, yu, yw

    @classmethod
    def of(
        cls,
        response: PlantResponse,
        controller: LinearController,
        sources: Sequence[str] | None = None,
    ) -> LoopResponses:
        """Return the closed loop of a plant's response and a controller of its measurements."""
        law = np.moveaxis(controller.response_at(response.s), 0, -1)
        return cls(LoopBlocks.of(response, sources=sources), Closing(law=law, slopes=None))

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
        return _times(self.inverse, _times(self._law, self._yw))

    @cached_property
    def _command_slope(self) -> ComplexArray:
        """Slopes of the commands by each variable, (n, m, nw, k)."""
        assert self._law_slope is not None
        heard = self._yw + _times(self._yu, self._commands)
        found = np.zeros((self.count, *self._commands.shape), np.complex128)
        for a, parts in enumerate(self._law_slope):
            by_command: dict[int, ComplexArray] = {}
            for (i, j), slope in parts.items():  # most entries depend on few parameters
                term = slope * heard[j]
                by_command[i] = by_command[i] + term if i in by_command else term
            for i, through in by_command.items():
                found[a] += self.inverse[:, i, None] * through
        return found

    def response(self, output: str, source: str) -> Any:
        """Return the response of an output to a disturbance, (k,)."""
        row, column = self.outputs.index(output), self.sources.index(source)
        through = np.einsum("m...,m...->...", self._zu[row], self._commands[:, column])
        value = self._zw[row, column] + through
        if self._law_slope is None:
            return value
        slope = np.einsum("rk,nrk->nk", self._zu[row], self._command_slope[:, :, column])
        return Dual(value, slope)

    def difference(self, index: int) -> Any:
        """Return 1 + L of the loop broken at one command, all others closed, (k,)."""
        if self._law_slope is None:
            single = len(self._matrix) == 1
            return self._matrix[0, 0] if single else 1.0 / self.inverse[index, index]
        own = self.inverse[index, index]
        # dG_ii = G_i. dC (P_yu G)_.i
        back = np.einsum("jmk,mk->jk", self._yu, self.inverse[:, index])
        return Dual(1.0 / own, -self._turned(self.inverse[index], back) / own**2)

    def determinant(self) -> Any:
        """Return det(I - C P_yu), (k,)."""
        whole = np.linalg.det(np.moveaxis(self.inverse, (0, 1), (-2, -1)))
        if self._law_slope is None:
            return 1.0 / whole
        # d det M = det M tr(M^-1 dM), M = I - C P_yu
        turned = np.einsum("jmk,mrk->jrk", self._yu, self.inverse)
        slope = np.zeros((self.count, turned.shape[-1]), np.complex128)
        for a, parts in enumerate(self._law_slope):
            for (i, j), part in parts.items():
                slope[a] -= part * turned[j, i]
        return Dual(1.0 / whole, slope / whole)

    def _turned(self, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        """Return left . dC right of vectors (m, k) and (l, k) by each variable, (n, k)."""
        assert self._law_slope is not None
        found = np.zeros((self.count, right.shape[-1]), np.complex128)
        for a, parts in enumerate(self._law_slope):
            for (i, j), slope in parts.items():
                found[a] += left[i] * slope * right[j]
        return found

    def moments(self, outputs: Sequence[str], powers: Sequence[FloatArray]) -> Any:
        """Return integrals of |F|^2 over all disturbances.

        Parameters
        ----------
        outputs
            Output of each integral.
        powers
            Its weights, (nw, k) each: quadrature weights times density times a power of omega.

        Returns
        -------
        ndarray or Dual
            (..., number of integrals).
        """
        rows = [self.outputs.index(name) for name in outputs]
        found = {row: self._all([row])[0] for row in dict.fromkeys(rows)}
        values = []
        for row, weights in zip(rows, powers, strict=True):
            # (nw, ..., k) against (nw, k)
            spread = weights.reshape(len(weights), *(1,) * (found[row].ndim - 2), -1)
            values.append(np.sum(np.abs(found[row]) ** 2 * spread, axis=(0, -1)))
        value = np.stack(values, axis=-1)
        if self._law_slope is None:
            return value
        adjoint = np.stack(
            [
                (np.conj(found[row]) * weights)[None] * self._zu[row][:, None]
                for row, weights in zip(rows, powers, strict=True)
            ]
        )
        size = len(rows), -1
        slope = 2.0 * (self._command_slope.reshape(self.count, -1) @ adjoint.reshape(size).T)
        return Dual(value, slope.real)

    def curvature(self, output: str, weights: FloatArray) -> FloatArray:
        """Return half the Gauss-Newton Hessian of an integral of |F|^2, (n, n); see `moments`."""
        through = self._zu[self.outputs.index(output)]
        slope = np.einsum("rk,nrwk->nwk", through, self._command_slope) * np.sqrt(weights)
        flat = slope.reshape(self.count, -1)
        return np.asarray((flat @ flat.conj().T).real)


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
    found: ComplexArray = np.linalg.inv(np.moveaxis(a, (0, 1), (-2, -1))).astype(np.complex128)
    return np.moveaxis(found, (-2, -1), (0, 1))
