r"""A free controller of low order, for any number of inputs and measurements.

Its parameters are n (nu + ny) numbers for order n, plus nu ny for a direct term.  Random
controllers of this kind are seldom stable in a loop, so the candidates are LQG designs
(`synth.structures.lqg`) for weights and noises of many sizes, reduced to the order; and, as these
may all lie about one optimum of several, controllers whose poles are drawn, with the zeros that
bring them closest to a state feedback.

A controller of given order in as few numbers as there can be is one of parallel canonical blocks:
second-order blocks (and one of first order if the order is odd), each in observable
canonical form as seen from one of the inputs, which leaves no redundant scale:

.. math::

    A_k = \begin{bmatrix} -\alpha_1 & 1 \\ -\alpha_0 & 0 \end{bmatrix},\quad
    B_k \text{ free},\quad C_k \text{ free but for one row, } [1\ 0]

so n (nu + ny) numbers describe order n.  The row that is fixed alternates between the inputs:
two channels that have nothing to do with each other, each with its own controller, are then an
ordinary point.  Complex and real poles meet within a block without a singularity; only a pole
that repeats across blocks is out of reach, which nothing that is optimised asks for.
"""

import contextlib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag, solve_continuous_lyapunov
from scipy.optimize import linear_sum_assignment
from scipy.stats import qmc
from typing_extensions import override

from models.basics import ComplexArray, FloatArray, InputError, SolverError
from models.plant import MEASUREMENTS, LinearPlant

from ..loop import LinearController
from .lqg import (
    LqgEstimator,
    LqgRegulator,
    designs,
    estimator,
    projected,
    reduced,
    regulator,
    weighing,
    whitened,
)
from .structure import (
    Bounds,
    GeneralisedPlant,
    Parameter,
    ParametrisedController,
    Structure,
    check_bounds,
    gain_scales,
    pace,
)

_PADE = 4  # of the delays, in the designs that candidates are made of
_SIDE = 12  # so many regulators times so many filters
_DRAWN = 64  # controllers whose poles are drawn
_LIGHTEST, _HEAVIEST = 0.03, 10.0  # damping ratios of these

_NEAR = 1e-6  # poles closer than this, relatively, are pulled apart
_NOTHING = 1e-14  # of the matrix's size, is a pole at zero
_FAINT = 1e-6  # least share of a mode that a fixed row must hear


@dataclass(frozen=True)
class LowOrder(Structure):
    """A free controller x' = A x + B y, u = C x + D y of order n.

    Noise on every measurement and a weight on every input (or a limit that does as much) belong
    to the question: without them the best controller has an infinite gain.
    """

    order: int  #: Number of states n, at least 1.
    _: KW_ONLY
    proper: bool = False  #: Whether there is a direct term D; strictly proper if not.
    stable: bool = False  #: Whether the controller itself must be stable.
    #: Bounds by parameter name.  Block k has ``alpha0[k]``, ``alpha1[k]`` (its poles are the roots
    #: of s^2 + alpha1 s + alpha0), ``B[k.1,y]``, ``B[k.2,y]`` and ``C[u,k.1]``, ``C[u,k.2]`` with
    #: the signals' names; D has ``D[u,y]``.
    bounds: Bounds = field(default_factory=dict)

    def __post_init__(self) -> None:
        order: object = self.order
        if isinstance(order, bool) or not isinstance(order, int) or order < 1:
            raise InputError(f"LowOrder: order must be a whole number of at least 1, got {order!r}")

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`."""
        return LowOrderLaw(plant, self)


@dataclass(frozen=True, kw_only=True)
class CanonicalBlock:
    """Where the numbers of one block stand among the parameters, and which row of C is fixed."""

    size: int
    row: int
    alpha: slice  #: alpha1, alpha0; alpha0 alone for a block of first order
    B: slice  #: `size` rows of ny
    C: slice  #: nu - 1 rows of `size`


class LowOrderLaw(ParametrisedController):
    """The law of `LowOrder`: parameters of canonical blocks and of the direct term."""

    def __init__(self, plant: LinearPlant, structure: LowOrder) -> None:
        nu, ny = len(plant.inputs), len(plant.measurements)
        if not (nu and ny):
            raise InputError("LowOrder: the plant must have an input and a measurement")
        self._plant = plant
        self._structure = structure
        self._nu, self._ny = nu, ny
        self._blocks: list[CanonicalBlock] = []
        at = 0
        for k in range((structure.order + 1) // 2):
            size = min(2, structure.order - 2 * k)
            ends = np.cumsum([at, size, size * ny, (nu - 1) * size]).tolist()
            alpha, B, C = (slice(a, b) for a, b in itertools.pairwise(ends))
            self._blocks.append(CanonicalBlock(size=size, row=k % nu, alpha=alpha, B=B, C=C))
            at = ends[-1]
        self._direct = slice(at, None) if structure.proper else slice(0, 0)
        self.parameters = tuple(self._named_parameters())
        check_bounds("LowOrder", structure.bounds, [p.name for p in self.parameters])
        self.dimensions = 4 + len(self.parameters)

    def _named_parameters(self) -> Iterable[Parameter]:
        plant = self._plant
        middle = pace(plant)
        entries = [(i, j) for i in range(self._nu) for j in range(self._ny)]
        gains = np.reshape(gain_scales(plant, entries), (self._nu, self._ny))
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

    @override
    def response(self, values: Sequence[Any], s: Any) -> list[list[Any]]:
        measured = range(self._ny)
        result: list[list[Any]] = [[0.0] * self._ny for _ in range(self._nu)]
        for block in self._blocks:
            alpha, B = values[block.alpha], values[block.B]
            free = iter(values[block.C])
            # The block's states, each as a response to every measurement.
            if block.size == 2:
                below = s * (s + alpha[0]) + alpha[1]
                # x1' = x2 - alpha1 x1 + B1 y gives the second from the first.
                first = [(s * B[j] + B[self._ny + j]) / below for j in measured]
                second = [(s + alpha[0]) * first[j] - B[j] for j in measured] * (self._nu > 1)
                states = [first, second]
            else:
                states = [[B[j] / (s + alpha[0]) for j in measured]]
            for i in range(self._nu):
                weights = [1.0] if i == block.row else [next(free) for _ in range(block.size)]
                for weight, state in zip(weights, states, strict=False):
                    for j in measured:
                        result[i][j] = state[j] * weight + result[i][j]
        for k, gain in enumerate(values[self._direct]):
            i, j = divmod(k, self._ny)
            result[i][j] = result[i][j] + gain
        return result

    @override
    def controller(self, values: Sequence[float]) -> LinearController:
        numbers, order = np.asarray(values, dtype=np.float64), self._structure.order
        A, B = np.zeros((order, order)), np.empty((order, self._ny))
        C, D = np.zeros((self._nu, order)), np.zeros((self._nu, self._ny))
        at = 0
        for block in self._blocks:
            states = slice(at, at + block.size)
            A[states, states] = np.eye(block.size, k=1)
            A[states, at] = -numbers[block.alpha]
            B[states] = numbers[block.B].reshape(block.size, self._ny)
            C[block.row, at] = 1.0
            others = [i for i in range(self._nu) if i != block.row]
            C[others, states] = numbers[block.C].reshape(self._nu - 1, block.size)
            at += block.size
        D.flat[: numbers[self._direct].size] = numbers[self._direct]
        names = self._plant.measurements, self._plant.inputs
        return LinearController(A=A, B=B, C=C, D=D, measurements=names[0], inputs=names[1])

    def values(self, controller: LinearController) -> FloatArray:
        """Return the parameters of a controller, whose order may be lower than the law's.

        Poles that repeat are pulled apart a little, and a mode that its block's fixed row does
        not hear is lent a whisper of it.
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
            _fill(result, block, poles[at], into[at], out[:, at])
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
        heard = np.abs(C) / np.maximum(np.linalg.norm(C, axis=0), 1e-300)
        rows = [block.row for block in self._blocks[: len(groups)]]
        price = [[-np.log(heard[row, g].min() + 1e-12) for row in rows] for g in groups]
        result = groups + single
        if groups:
            for g, b in zip(*linear_sum_assignment(price), strict=True):
                result[b] = groups[g]
        return result

    @override
    def guesses(self, problem: GeneralisedPlant, omega: FloatArray) -> FloatArray:
        """Return LQG designs for the problem's own weights and spectra.

        The first is the optimum where the noises are white, every input is weighed and every
        measurement is noisy; the others charge more for the inputs or trust the measurements
        less.  The last are static gains behind fast poles.
        """
        plant = whitened(self._plant.without_delays(_PADE), problem.disturbances)
        regulators, filters = designs(plant, problem.minimise, omega)
        full = np.ones((self._nu, self._ny), dtype=np.bool_)
        gains = [projected(plant, design, full) for design in regulators]
        fast = [
            self.values(self._swift(gain, share * float(omega[-1])))
            for gain in gains
            for share in (0.03, 0.3, 3.0)
        ]
        if self._structure.proper:
            names = plant.measurements, plant.inputs
            fast += [self.values(LinearController.static(gain, *names)) for gain in gains]
        found = self._family(plant, regulators, filters)
        return self.clipped(np.vstack([found, *fast]))

    @override
    def others(self, problem: GeneralisedPlant, omega: FloatArray, seed: int) -> FloatArray:
        """Return controllers with poles of many sizes and dampings.

        Their commands come closest, in the mean square of the loop that a state feedback makes,
        to those of the state feedback: with its poles held a controller is linear in the rest, but
        for what an input hears from another's blocks, which is left out.
        """
        plant = whitened(self._plant.without_delays(_PADE), problem.disturbances)
        regulators, _ = designs(plant, problem.minimise, omega)
        points = qmc.Sobol(2 * len(self._blocks), seed=seed).random(_DRAWN)
        sizes = omega[0] * (omega[-1] / omega[0]) ** points[:, ::2]
        dampings = _LIGHTEST * (_HEAVIEST / _LIGHTEST) ** points[:, 1::2]
        found = np.zeros((_DRAWN * bool(regulators), len(self.parameters)))
        for k, row in enumerate(found):
            regulator = regulators[k % len(regulators)]
            with contextlib.suppress(np.linalg.LinAlgError):
                self._fit(row, plant, regulator, sizes[k], dampings[k])
        return self.clipped(found)

    @override
    def draw(self, points: FloatArray, omega: FloatArray, yu: ComplexArray) -> FloatArray:
        plant = self._plant.without_delays(_PADE)
        sizes = np.abs(yu) ** 2
        sizes += 1e-12 * sizes.max(axis=0) + 1e-60 * sizes.max()
        at = np.minimum((points[:, :2] * omega.size).astype(int), omega.size - 1)
        tilt = 10.0 ** (2.0 * points[:, 2:4] - 1.0)
        uneven = np.linspace(-1.0, 1.0, self._ny)
        regulators, filters = [], []
        for k in range(min(_SIDE, len(points)) if np.any(yu) else 0):
            # Bandwidths are drawn: with such weights the loop crosses over near that frequency.
            weights = tilt[k, 0] ** uneven / sizes[at[k, 0]].mean(axis=1)
            effort = weights @ sizes[at[k, 0]]
            noise = tilt[k, 1] ** uneven * sizes[at[k, 1]].sum(axis=1)
            with contextlib.suppress(SolverError):
                Q, R, S = weighing(plant.C, plant.D, weights)
                regulators.append(regulator(plant, Q, R + np.diag(effort), S))
            with contextlib.suppress(SolverError):
                W = plant.B @ plant.B.T
                filters.append(estimator(plant, W, np.diag(noise), np.zeros_like(plant.C.T)))
        known = self._family(plant, regulators, filters)[: len(points)]
        scales = np.array([p.scale for p in self.parameters])
        signed = 2.0 * points[len(known) :, 4:] - 1.0
        if not len(known):  # no such design exists: any size, any sign
            spread = np.sign(signed) * 10.0 ** (4.0 * np.abs(signed) - 3.0)
            return self.clipped(spread * scales)
        # The rest are the known ones with every parameter changed, more and more.
        rows = np.arange(len(signed))
        reach = np.linspace(0.1, 1.5, max(1, len(signed)))[:, None]
        near = known[rows % len(known)]
        return self.clipped(np.vstack([known, near * np.exp(reach * signed)]))

    def _swift(self, gain: FloatArray, pole: float) -> LinearController:
        """Return the most important directions of a static gain behind poles near -`pole`."""
        left, sizes, right = np.linalg.svd(gain, full_matrices=False)
        keep = min(self._structure.order, len(sizes))
        poles = pole * (1.0 + 0.3 * np.arange(keep))
        return LinearController(
            A=-np.diag(poles),
            B=(poles * sizes[:keep])[:, None] * right[:keep],
            C=left[:, :keep],
            D=np.zeros_like(gain),
            measurements=self._plant.measurements,
            inputs=self._plant.inputs,
        )

    def _fit(
        self,
        values: FloatArray,
        plant: LinearPlant,
        feedback: LqgRegulator,
        sizes: FloatArray,
        dampings: FloatArray,
    ) -> None:
        """Write into `values` the controller with given poles that comes closest to a feedback.

        The plant is shaken by white noises of intensity 1, the feedback is u = K x.  Sizes [rad/s]
        and dampings [-] are those of the poles of each block.
        """
        # Every measurement through 1 and s over each block's denominator, beside the plant.
        filters = []
        for block, size, damping in zip(self._blocks, sizes, dampings, strict=True):
            alpha = [2.0 * damping * size, size**2] if block.size == 2 else [size]
            values[block.alpha] = alpha
            companion = np.eye(block.size, k=1)
            companion[-1] = -np.array(alpha[::-1])
            filters += [companion] * self._ny
        heard, noise = plant.C + plant.D @ feedback.gain, plant.F
        entries = [np.eye(len(f))[:, -1:] for f in filters]
        rows = [np.tile(x, (len(self._blocks), 1)) for x in (heard, noise)]
        into, shaken = (
            np.vstack([e @ row[None] for e, row in zip(entries, of, strict=True)]) for of in rows
        )
        n = len(plant.A)
        A = block_diag(plant.A + plant.B @ feedback.gain, *filters)
        A[n:, :n] = into
        E = np.vstack([plant.E, shaken])
        covariance = solve_continuous_lyapunov(A, -E @ E.T)
        owner = np.repeat([b.row for b in self._blocks], [b.size * self._ny for b in self._blocks])
        command = np.zeros(len(owner))
        for i, gain in enumerate(feedback.gain):
            at = n + np.flatnonzero(owner == i)
            size = np.sqrt(np.maximum(np.diag(covariance)[at], 1e-300))
            share = covariance[np.ix_(at, at)] / np.outer(size, size)
            wanted = covariance[at, :n] @ gain / size
            command[at - n] = np.linalg.lstsq(share, wanted, rcond=1e-12)[0] / size
        start = 0
        for block in self._blocks:
            end = start + block.size * self._ny
            # B1 goes with s, B2 with 1.
            values[block.B] = command[start:end].reshape(self._ny, block.size).T[::-1].ravel()
            start = end

    def _family(
        self,
        plant: LinearPlant,
        regulators: Sequence[LqgRegulator],
        filters: Sequence[LqgEstimator],
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
        return self.clipped(np.array(found))


@dataclass(frozen=True, kw_only=True)
class LowOrderFeedback(Structure):
    """`LowOrder` on the payload's motion, or on all that is aboard."""

    order: int  #: Number of states; 0 as long as it is not known how many it takes.
    family: str = "low-order"  #: What it is called, but for the order.
    measurements: tuple[str, ...] = MEASUREMENTS  #: Names of what it hears.
    hears_payload: bool = True

    @property
    def name(self) -> str:
        """What it is called."""
        return f"{self.family}-{self.order}" if self.order else self.family

    def bind(self, plant: LinearPlant) -> ParametrisedController:
        """Return the law; see `Structure.bind`."""
        if not self.order:
            raise InputError(
                f"{self.family}: its order must be told with its parameters, as in {self.family}-28"
            )
        return LowOrder(self.order).bind(plant)

    @staticmethod
    def start(
        law: ParametrisedController, found: Mapping[str, float], controller: LinearController
    ) -> list[float]:
        """Return the parameters of rolled-off payload feedback, and set the sizes by it.

        The law is that of this structure: its parameters get the sizes that go with the answer.
        `found` and `controller` are parameters and controller of ``payload-feedback-rolloff``, of
        order two.
        """
        assert isinstance(law, LowOrderLaw)
        corner = found["rolloff.corner"]
        static = np.abs(controller.D - controller.C @ np.linalg.solve(controller.A, controller.B))
        size = dict(zip(controller.measurements, static[0], strict=True))
        sizes = []
        for p in law.parameters:
            head, _, rest = p.name.partition("[")
            block, _, measured = rest.rstrip("]").partition(",")
            if head.startswith("alpha"):
                sizes.append(corner if head == "alpha1" else corner**2)
            else:
                sizes.append(size[measured] * corner ** int(block.partition(".")[2]))
        law.parameters = tuple(
            replace(p, scale=scale) for p, scale in zip(law.parameters, sizes, strict=True)
        )
        return [float(v) for v in law.values(controller)]


def _fill(
    result: FloatArray, block: CanonicalBlock, poles: ComplexArray, B: ComplexArray, C: ComplexArray
) -> None:
    """Write one block's numbers: its modes in observable canonical form."""
    fixed, size = C[block.row].copy(), np.linalg.norm(C, axis=0)
    faint = np.abs(fixed) < _FAINT * size
    fixed[faint] = _FAINT * size[faint] + 1e-300
    alpha = np.poly(poles)[1:]
    to_canonical = np.array([fixed, fixed * (poles + alpha[0])])[: block.size]
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
        # Relative to themselves: slow modes beside a fast one are no repeated ones.
        sizes = np.maximum(np.abs(poles[:, None]), np.abs(poles)) + _NOTHING * size
        gaps = np.abs(poles[:, None] - poles) / sizes + np.eye(len(A))
        if gaps.min() > _NEAR and np.linalg.cond(vectors) < 1e10:
            break
    poles = poles.astype(np.complex128)
    order = np.lexsort((-poles.imag, np.abs(poles.imag), poles.real))
    poles, vectors = poles[order], vectors[:, order]
    return poles, np.linalg.solve(vectors, B.astype(np.complex128)), C @ vectors
