r"""A free controller of low order, for any number of inputs and measurements.

Parallel second-order blocks (and one of first order if the order is odd), each in observable
canonical form as seen from one of the inputs, which leaves no redundant scale:

.. math::

    A_k = \begin{bmatrix} -\alpha_1 & 1 \\ -\alpha_0 & 0 \end{bmatrix},\quad
    B_k \text{ free},\quad C_k \text{ free but for one row, } [1\ 0]

so n (nu + ny) numbers describe order n, the least there is (plus nu ny for a direct term).  The
row that is fixed alternates between the inputs: two channels that have nothing to do with each
other, each with its own controller, are then an ordinary point.  Complex and real
poles meet within a block without a singularity; only a pole that repeats across blocks is out
of reach, which nothing that is optimised asks for.

Random controllers of this kind are seldom stable in a loop.  Candidates are LQG designs
(`synth.lqg`) for weights and noises of many sizes, reduced and brought to this form.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment

from models.checks import InputError, SynthesisError
from models.linear import LinearPlant

from .controller import Controller
from .lqg import (
    Estimator,
    Regulator,
    designs,
    estimator,
    projected,
    reduced,
    regulator,
    weighing,
    whitened,
)
from .structure import Bounds, Law, Parameter, Structure, check_bounds, gain_scales, pace

if TYPE_CHECKING:
    from .problem import Problem

__all__ = ["LowOrder"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_PADE = 4  # of the delays, in the designs that candidates are made of
_SIDE = 12  # so many regulators times so many filters
_NEAR = 1e-6  # poles closer than this, relatively, are pulled apart


@dataclass(frozen=True, kw_only=True)
class LowOrder(Structure):
    """A free controller x' = A x + B y, u = C x + D y of order n.

    Parameters
    ----------
    order
        Number of states n, at least 1.
    proper
        Whether there is a direct term D; strictly proper if not.
    stable
        Whether the controller itself must be stable.
    bounds
        Bounds by parameter name.  Block k has ``alpha0[k]``, ``alpha1[k]`` (its poles are the
        roots of s^2 + alpha1 s + alpha0), ``B[k.1,y]``, ``B[k.2,y]`` and ``C[u,k.1]``,
        ``C[u,k.2]`` with the signals' names; D has ``D[u,y]``.
    """

    order: int
    proper: bool = False
    stable: bool = False
    bounds: Bounds = field(default_factory=dict)

    def __init__(
        self,
        order: int,
        *,
        proper: bool = False,
        stable: bool = False,
        bounds: Bounds | None = None,
    ) -> None:
        if isinstance(order, bool) or not isinstance(order, int) or order < 1:
            raise InputError(f"LowOrder: order must be a whole number of at least 1, got {order!r}")
        object.__setattr__(self, "order", order)
        object.__setattr__(self, "proper", proper)
        object.__setattr__(self, "stable", stable)
        object.__setattr__(self, "bounds", dict(bounds or {}))

    def bind(self, plant: LinearPlant, response_scale: Bounds | None = None) -> Law:
        """Return the law; see `Structure.bind`."""
        return _LowOrderLaw(plant, self)


@dataclass(frozen=True, kw_only=True)
class _Block:
    """Where the numbers of one block stand among the parameters, and which row of C is fixed."""

    size: int
    row: int
    alpha: slice  # alpha1, alpha0; alpha0 alone for a block of first order
    B: slice  # size rows of ny
    C: slice  # nu - 1 rows of `size`

    def matrices(self, values: Any, nu: int, ny: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, B, C of the block."""
        A = np.zeros((self.size, self.size))
        A[:, 0] = -np.asarray(values[self.alpha])
        if self.size == 2:
            A[0, 1] = 1.0
        B = np.reshape(values[self.B], (self.size, ny))
        free = np.reshape(values[self.C], (nu - 1, self.size))
        return A, B, np.insert(free, self.row, np.eye(self.size)[0], axis=0)


class _LowOrderLaw(Law):
    """The structure's law."""

    def __init__(self, plant: LinearPlant, structure: LowOrder) -> None:
        self._plant = plant
        self._structure = structure
        self._nu, self._ny = nu, ny = len(plant.inputs), len(plant.measurements)
        if not (nu and ny):
            raise InputError("LowOrder: the plant must have an input and a measurement")
        self._blocks: list[_Block] = []
        at = 0
        for k in range((structure.order + 1) // 2):
            size = min(2, structure.order - 2 * k)
            ends = np.cumsum([at, size, size * ny, (nu - 1) * size]).tolist()
            slices = [slice(a, b) for a, b in itertools.pairwise(ends)]
            self._blocks.append(
                _Block(size=size, row=k % nu, alpha=slices[0], B=slices[1], C=slices[2])
            )
            at = ends[-1]
        self._direct = slice(at, at + nu * ny) if structure.proper else slice(at, at)
        self.parameters = tuple(self._named_parameters())
        check_bounds("LowOrder", structure.bounds, [p.name for p in self.parameters])
        self.dimensions = 4 + len(self.parameters)

    def _named_parameters(self) -> Iterable[Parameter]:
        plant, nu, ny = self._plant, self._nu, self._ny
        middle = pace(plant)
        entries = [(i, j) for i in range(nu) for j in range(ny)]
        gains = np.reshape(gain_scales(plant, entries), (nu, ny))
        # The share of each input in a loop gain of one; an input's size against another's.
        inputs = np.exp(np.log(gains).mean(axis=1))
        for k, block in enumerate(self._blocks, start=1):
            powers = [middle ** (i + 1) for i in range(block.size)]
            alphas = ["alpha1", "alpha0"] if block.size == 2 else ["alpha0"]
            for name, scale in zip(alphas, powers, strict=True):
                yield self._parameter(f"{name}[{k}]", scale, positive=self._structure.stable)
            for i, scale in enumerate(powers):
                for y, gain in zip(plant.measurements, gains[block.row], strict=True):
                    yield self._parameter(f"B[{k}.{i + 1},{y}]", gain * scale)
            for i, u in enumerate(plant.inputs):
                for j in range(block.size if i != block.row else 0):
                    ratio = inputs[i] / inputs[block.row] / middle**j
                    yield self._parameter(f"C[{u},{k}.{j + 1}]", ratio)
        if self._structure.proper:
            for (i, j), gain in zip(entries, gains.ravel(), strict=True):
                name = f"D[{plant.inputs[i]},{plant.measurements[j]}]"
                yield self._parameter(name, gain)

    def _parameter(self, name: str, scale: float, *, positive: bool = False) -> Parameter:
        low, high = self._structure.bounds.get(name, (-np.inf, np.inf))
        if positive:
            low = max(low, 1e-6 * scale)
        return Parameter(name=name, scale=float(scale), low=float(low), high=float(high))

    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        nu, ny = self._nu, self._ny
        result: list[list[Any]] = [[0.0] * ny for _ in range(nu)]
        for block in self._blocks:
            alpha, B = values[block.alpha], values[block.B]
            free = iter(values[block.C])
            # The block's states, each as a response to every measurement.
            if block.size == 2:
                below = s * (s + alpha[0]) + alpha[1]
                # The first state is the output that is fixed, the second (s + alpha1) it - B1.
                first = [(s * B[j] + B[ny + j]) / below for j in range(ny)]
                second = [(s + alpha[0]) * first[j] - B[j] for j in range(ny)] if nu > 1 else []
                states = [first, second]
            else:
                states = [[B[j] / (s + alpha[0]) for j in range(ny)]]
            for i in range(nu):
                weights = [1.0] if i == block.row else [next(free) for _ in range(block.size)]
                for weight, state in zip(weights, states, strict=False):
                    for j in range(ny):
                        result[i][j] = state[j] * weight + result[i][j]
        if self._structure.proper:
            D = values[self._direct]
            for i in range(nu):
                for j in range(ny):
                    result[i][j] = result[i][j] + D[i * ny + j]
        return result

    def controller(self, values: Sequence[float]) -> Controller:
        nu, ny = self._nu, self._ny
        numbers = np.asarray(values, dtype=np.float64)
        parts = [block.matrices(numbers, nu, ny) for block in self._blocks]
        D = np.zeros((nu, ny))
        if self._structure.proper:
            D = np.reshape(numbers[self._direct], (nu, ny))
        return Controller(
            A=block_diag(*[A for A, _, _ in parts]),
            B=np.vstack([B for _, B, _ in parts]),
            C=np.hstack([C for _, _, C in parts]),
            D=D,
            measurements=self._plant.measurements,
            inputs=self._plant.inputs,
        )

    def characteristic(self, values: Sequence[Any], s: Any) -> Any:
        result: Any = 1.0
        for block in self._blocks:
            alpha = values[block.alpha]
            result = result * (s * (s + alpha[0]) + alpha[1] if block.size == 2 else s + alpha[0])
        return result

    def values(self, controller: Controller) -> FloatArray:
        """Return the parameters of a controller, whose order may be lower than the law's.

        Poles that repeat are pulled apart a little, and a mode that the input of its block's
        fixed row does not hear is lent a whisper of it.
        """
        missing = self._structure.order - len(controller.A)
        A, B, C = controller.A, controller.B, controller.C
        if missing > 0:
            A = block_diag(A, -np.diag(pace(self._plant) * (1.0 + 0.3 * np.arange(missing))))
            B = np.vstack([B, np.zeros((missing, self._ny))])
            C = np.hstack([C, np.ones((self._nu, missing))])
        poles, into, out = _modes(A, B, C)
        result = np.empty(len(self.parameters))
        for block, at in zip(self._blocks, self._assigned(poles, out), strict=True):
            self._fill(result, block, poles[at], into[at], out[:, at])
        if self._structure.proper:
            result[self._direct] = controller.D.ravel()
        return result

    def _assigned(self, poles: ComplexArray, C: ComplexArray) -> list[list[int]]:
        """Return the modes of each block, such that each is well heard through its fixed row."""
        groups = [[int(i), int(i) + 1] for i in np.flatnonzero(poles.imag > 0.0)]
        real = [int(i) for i in np.flatnonzero(poles.imag == 0.0)]
        real.sort(key=lambda i: poles[i].real)
        single = [[real.pop(0)]] if len(real) % 2 else []  # the fastest one
        groups += [real[i : i + 2] for i in range(0, len(real), 2)]
        pairs = len(groups)
        heard = np.abs(C) / np.maximum(np.linalg.norm(C, axis=0), 1e-300)
        rows = [block.row for block in self._blocks[:pairs]]
        price = [[-np.log(heard[row, g].min() + 1e-12) for row in rows] for g in groups]
        result = groups + single
        if pairs:
            for g, b in zip(*linear_sum_assignment(price), strict=True):
                result[b] = groups[g]
        return result

    def _fill(
        self,
        result: FloatArray,
        block: _Block,
        poles: ComplexArray,
        B: ComplexArray,
        C: ComplexArray,
    ) -> None:
        """Write one block's parameters: its modes in observable canonical form."""
        fixed = C[block.row].copy()
        faint = np.abs(fixed) < 1e-6 * np.linalg.norm(C, axis=0)
        fixed[faint] = 1e-6 * np.linalg.norm(C, axis=0)[faint] + 1e-300
        if block.size == 2:
            alpha = np.array([-(poles[0] + poles[1]), poles[0] * poles[1]])
            to_canonical = np.array([fixed, fixed * poles]) + np.outer([0.0, alpha[0]], fixed)
        else:
            alpha, to_canonical = -poles, np.diag(fixed)
        others = np.delete(C, block.row, axis=0)
        result[block.alpha] = alpha.real
        result[block.B] = (to_canonical @ B).real.ravel()
        result[block.C] = np.linalg.solve(to_canonical.T, others.T).T.real.ravel()

    def guesses(self, problem: Problem, omega: FloatArray) -> FloatArray:
        """Return LQG designs for the problem's own weights and spectra.

        The first is the optimum where the noises are white, every input is weighed and every
        measurement is noisy; the others charge more for the inputs or trust the measurements
        less.  The last are static gains behind fast poles.
        """
        plant = whitened(self._plant.without_delays(_PADE), problem.disturbances)
        regulators, filters = designs(plant, problem.minimise, omega)
        full = np.ones((self._nu, self._ny), dtype=np.bool_)
        fast = [
            self.values(self._swift(projected(plant, design, full), share * float(omega[-1])))
            for design in regulators
            for share in (0.03, 0.3, 3.0)
        ]
        found = self._family(plant, regulators, filters)
        return self._clipped(np.vstack([found, *fast]))

    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        plant = self._plant.without_delays(_PADE)
        sizes = np.abs(yu) ** 2 + 1e-12 * np.max(np.abs(yu) ** 2, axis=0) + 1e-300
        at = np.minimum((points[:, :2] * omega.size).astype(int), omega.size - 1)
        tilt = 10.0 ** (2.0 * points[:, 2:4] - 1.0)
        regulators, filters = [], []
        for k in range(min(_SIDE, len(points))):
            # Bandwidths are drawn: with such weights the loop crosses over near that frequency.
            weights = tilt[k, 0] ** np.linspace(-1.0, 1.0, self._ny) / sizes[at[k, 0]].mean(axis=1)
            effort = weights @ sizes[at[k, 0]]
            noise = tilt[k, 1] ** np.linspace(-1.0, 1.0, self._ny) * sizes[at[k, 1]].sum(axis=1)
            with contextlib.suppress(SynthesisError):
                Q, R, S = weighing(plant.C, plant.D, weights)
                regulators.append(regulator(plant, Q, R + np.diag(effort), S))
            with contextlib.suppress(SynthesisError):
                W = plant.B @ plant.B.T
                filters.append(estimator(plant, W, np.diag(noise), np.zeros_like(plant.C.T)))
        known = self._family(plant, regulators, filters)[: len(points)]
        scales = np.array([p.scale for p in self.parameters])
        signed = 2.0 * points[len(known) :, 4:] - 1.0
        if not len(known):  # no such design exists: any size, any sign
            spread = np.sign(signed) * 10.0 ** (4.0 * np.abs(signed) - 3.0)
            return self._clipped(spread * scales)
        # The rest are the known ones with every parameter changed, more and more.
        rows = np.arange(len(signed))
        reach = np.linspace(0.1, 1.5, max(1, len(signed)))[:, None]
        near = known[rows % len(known)]
        return self._clipped(np.vstack([known, near * np.exp(reach * signed)]))

    def _swift(self, gain: FloatArray, pole: float) -> Controller:
        """Return the most important directions of a static gain behind poles near -`pole`."""
        left, sizes, right = np.linalg.svd(gain, full_matrices=False)
        keep = min(self._structure.order, len(sizes))
        poles = pole * (1.0 + 0.3 * np.arange(keep))
        return Controller(
            A=-np.diag(poles),
            B=(poles * sizes[:keep])[:, None] * right[:keep],
            C=left[:, :keep],
            D=np.zeros_like(gain),
            measurements=self._plant.measurements,
            inputs=self._plant.inputs,
        )

    def _family(
        self, plant: LinearPlant, regulators: Sequence[Regulator], filters: Sequence[Estimator]
    ) -> FloatArray:
        """Return the parameters of every regulator with every filter, equal ranks first."""
        pairs = sorted(
            ((i, j) for i in range(len(regulators)) for j in range(len(filters))),
            key=lambda pair: (max(pair), sum(pair)),
        )
        order = self._structure.order
        found = [self.values(reduced(plant, regulators[i], filters[j], order)) for i, j in pairs]
        if not found:
            return np.zeros((0, len(self.parameters)))
        return self._clipped(np.array(found))

    def _clipped(self, values: FloatArray) -> FloatArray:
        low = [p.low for p in self.parameters]
        high = [p.high for p in self.parameters]
        return np.asarray(np.clip(values, low, high), dtype=np.float64)


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
