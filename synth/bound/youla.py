r"""Controllers of high order within margins, by Youla's parametrisation: `youla_design`.

    Bound -> its LQG controller as the observer -> Q(s) from innovations to command
      -> cone programme on frequency nodes (cvxpy, Clarabel) -> YoulaDesign

Every stabilising controller is an observer with state feedback whose innovations drive the command
through a stable Q, and every closed-loop response is affine in Q.  Variances, limits on rms
values, M_s and roll-off are then convex, and with Q in a basis of fixed poles a second-order cone
programme (Boyd and Barratt, *Linear Controller Design*, 1991).  The answer is achievable, so it
lies above the best possible and falls with the number of functions; a bound it is not.

    u = K x^ + v,  v = Q (y - C x^ - D u):  X = [K (s - A - BK)^-1 L + M Q] N

x^ is the observer's state, M = I + K (s - A - BK)^-1 B, N = I - C (s - A + LC)^-1 L, and X the
response from noise on the measurements to the command.

The observer knows delays by Pade models and the rope by some masses.  With P~ its model, P the
truth and S~ = 1 + X P~, the true sensitivity is S~ / (1 - X (P - P~)), so that

.. math::  |\tilde S| / M_s + |X (P - \tilde P)| \le 1

at every frequency keeps the true loop stable and its M_s: convex too.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cvxpy
import numpy as np
from scipy.linalg import block_diag

from models.basics import (
    ComplexArray,
    FloatArray,
    InputError,
    SolverError,
    SynthesisError,
    check_range,
    one_thread,
)
from models.plant import LinearPlant

from ..limits import LowFrequency, RollOff
from ..loop import LinearController, frequency_grid
from .bound import Bound
from .truth import densities, filter_plant, frequencies, lqg_poles

cp: Any = cvxpy  # its functions come through a star import that mypy does not follow
_SLOWEST = 0.4  # of the functions' poles, over the mean frequency of the sea
_FASTEST = 2.5  # ... over the bandwidth of the LQG loop
_WORKS = 0.5  # |T| of a loop that does something
_LOWEST, _TOP = 1e-4, 3e3  # frequencies at which M_s is looked at [rad/s]
_EVERY = 10  # of them hold it at first
_EXCHANGES = 8
_SLOW = 60  # frequencies of a limit on a slow response
_INSIDE = 0.998  # of a limit between them


def poles_of_functions(low: float, high: float, count: int) -> FloatArray:
    """Return poles [1/s] that fill the decades between two frequencies ever more densely.

    In the order of van der Corput, so that the first ones are those of a smaller basis.
    """
    share = [sum((k + 1 >> i & 1) * 0.5 ** (i + 1) for i in range(20)) for k in range(count)]
    return np.asarray(low * (high / low) ** np.array(share), dtype=np.float64)


def basis(omega: FloatArray, poles: FloatArray) -> ComplexArray:
    """Return orthonormal functions of given poles at frequencies, (k, count).

    Those of Takenaka and Malmquist, sqrt(2 a_k)/(s + a_k) times (s - a_j)/(s + a_j) of all before;
    Laguerre's, where all poles are one.
    """
    s = 1j * omega[:, None]
    passed = np.cumprod((s - poles) / (s + poles), axis=1)
    before = np.hstack([np.ones((omega.size, 1)), passed[:, :-1]])
    return np.asarray(np.sqrt(2.0 * poles) / (s + poles) * before)


def realised_basis(poles: FloatArray, channels: int) -> tuple[FloatArray, FloatArray]:
    """Return A, B of the functions of every channel; the states are the functions themselves."""
    A = -np.diag(poles) - 2.0 * np.tril(np.sqrt(np.outer(poles, poles)), -1)
    B = np.sqrt(2.0 * poles)[:, None]
    return block_diag(*[A] * channels), block_diag(*[B] * channels)


class AffineLoop:
    """Responses of the closed loop that are affine in Q.

    `poles` are those of the functions of which Q is made, for each measurement [1/s], (count,).
    """

    def __init__(self, bound: Bound, poles: FloatArray) -> None:
        self.model, self.poles = bound.dual.plant, poles
        self.K, self.L = bound.point.regulator.gain, bound.dual.estimator.gain
        n, ny = self.L.shape
        states = np.eye(n)
        forced = np.hstack([self.L, self.model.B])
        fed = self.model.A + self.model.B @ self.K
        self.driven = filter_plant(fed, forced, states, np.zeros((n, forced.shape[1])))
        self.feedback = filter_plant(fed, states, self.K, np.zeros((1, n)))
        self.error = filter_plant(
            self.model.A - self.L @ self.model.C, states, -self.model.C, np.zeros((ny, n))
        )
        own = lqg_poles(self.model, bound.point.regulator, bound.dual.estimator)
        self.marks = np.concatenate([own, bound.plant.poles()])

    def at(self, omega: FloatArray) -> LoopBlocks:
        """Return what the responses are made of at frequencies [rad/s], (k,)."""
        driven = self.driven.response(omega).yu
        estimated, pushed = driven[:, :, :-1], driven[:, :, -1]
        error = self.error.response(omega).yu
        N = np.eye(error.shape[1]) + error @ self.L
        return LoopBlocks(
            functions=basis(omega, self.poles),
            estimated=estimated,
            pushed=pushed,
            error=error,
            N=N,
            M=1.0 + pushed @ self.K[0],
            X=((self.K @ estimated) @ N)[:, 0],
            yu=self.model.response(omega).yu[:, :, 0],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopBlocks:
    """Responses at frequencies, (k,) first."""

    functions: ComplexArray  #: Of the basis, (k, count).
    #: From innovations and from the command to the observer's states, (k, n, ny), (k, n).
    estimated: ComplexArray
    pushed: ComplexArray
    error: ComplexArray  #: From the observer's states to the innovations, (k, ny, n).
    #: From noise on the measurements to the innovations, (k, ny, ny), and from v to the command.
    N: ComplexArray
    M: ComplexArray
    X: ComplexArray  #: From noise on the measurements to the command, at Q = 0, (k, ny).
    yu: ComplexArray  #: The model's, from the command to the measurements, (k, ny).

    @cached_property
    def slope(self) -> ComplexArray:
        """Columns of X, (k, q, ny): function k of channel j is M phi_k N[j, :]."""
        each = (self.M[:, None] * self.functions)[:, None, :, None] * self.N[:, :, None, :]
        return each.reshape(len(self.M), -1, self.N.shape[2])


@dataclass(frozen=True, kw_only=True, eq=False)
class YoulaDesign:
    """A controller of full order, and what it achieves."""

    bound: Bound  #: The question, and the bound from below.
    #: Root of the weighted variance on the true spectra: an upper value of the best possible.
    value: float
    rms: Mapping[str, float]  #: Of what is limited, by name.
    max_sensitivity: float  #: The M_s that was asked for, or infinity.
    weights: FloatArray  #: Of the functions, measurement by measurement, (q,).
    loop: AffineLoop = field(repr=False)  #: The loop that is affine in them.

    @cached_property
    def controller(self) -> LinearController:
        """The observer with Q as one controller, u = +C y."""
        plant, K, L = self.loop.model, self.loop.K, self.loop.L
        Aq, Bq = realised_basis(self.loop.poles, len(plant.measurements))
        A, B, C, D, Cq = plant.A, plant.B, plant.C, plant.D, self.weights[None]
        seen = C + D @ K
        return LinearController(
            A=np.block([[A + B @ K - L @ seen, (B - L @ D) @ Cq], [-Bq @ seen, Aq - Bq @ D @ Cq]]),
            B=np.vstack([L, Bq]),
            C=np.hstack([K, Cq]),
            D=np.zeros((len(plant.inputs), len(plant.measurements))),
            measurements=plant.measurements,
            inputs=plant.inputs,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The plant on which a loop has to hold.

    Its command and measurements are those of the loop, with exact delays; its poles count.  `line`
    leads from frequencies [rad/s], (k,), to the exact responses of the measurements to the command,
    (k, ny); by default the plant's.
    """

    plant: LinearPlant
    line: Callable[[FloatArray], ComplexArray] | None = None

    def yu(self, omega: FloatArray) -> ComplexArray:
        """Return the responses from command to measurements at frequencies [rad/s], (k, ny)."""
        return self.plant.response(omega).yu[:, :, 0] if self.line is None else self.line(omega)


def gain_disk(max_sensitivity: float, up: float | None, down: float | None) -> tuple[float, float]:
    """Return centre and radius of a disk of S in which M_s and the gain margins hold.

    With S in the disk the curve of L keeps off the real axis from -1/down to -1/up, as
    S = 1/(1 + L) is -down/(1 - down) at the one end and up/(up - 1) at the other.
    """
    high = min(max_sensitivity, up / (up - 1.0) if up is not None else max_sensitivity)
    low = -min(max_sensitivity, down / (1.0 - down) if down else max_sensitivity)
    return 0.5 * (high + low), 0.5 * (high - low)


@one_thread()
def youla_design(
    bound: Bound,
    *,
    max_sensitivity: float = math.inf,
    disk: tuple[float, float] | None = None,
    shapes: Sequence[LowFrequency | RollOff] = (),
    functions: int = 16,
    truth: Truth | None = None,
) -> YoulaDesign:
    """Return the best controller with a Q of so many functions.

    Parameters
    ----------
    bound
        The question: plant with one input, spectra, weights, rms limits.
    max_sensitivity
        Limit on M_s of the loop, broken at the input.
    disk
        (centre, radius): S within this disk at every frequency, as gain margins ask for
        (`gain_disk`).
    shapes
        Limits on a slow response, and on |L| from some frequency on.
    functions
        Functions of each measurement.
    truth
        On which stability and M_s hold; by default the bound's plant, with its exact delays.

    Raises
    ------
    InputError
        If a number is out of range.
    SynthesisError
        If no such controller keeps the limits, or the plant has more than one input.
    """
    if len(bound.plant.inputs) != 1:
        raise SynthesisError("Youla: the plant must have one input")
    if not max_sensitivity > 1.0:
        raise InputError(f"Youla: max_sensitivity must be above 1, got {max_sensitivity!r}")
    check_range("Youla", "functions", functions, low=1, high=60)
    loop = AffineLoop(bound, poles_of_functions(*_range(bound), functions))
    rows = _variances(bound, loop)
    q = cp.Variable(functions * len(bound.plant.measurements))
    # Unit columns, as the measurements differ by many decades.
    scale = np.sqrt(sum(w * np.sum(rows[n][0] ** 2, axis=0) for n, w in bound.minimise.items()))
    scale = 1.0 / np.maximum(scale, 1e-12 * scale.max())
    unit = bound.attained or 1.0
    stacked = cp.hstack(
        [
            math.sqrt(w) / unit * (rows[n][0] * scale @ q + rows[n][1])
            for n, w in bound.minimise.items()
        ]
    )
    limits = [
        cp.norm(rows[n][0] * (scale / b) @ q + rows[n][1] / b) <= _INSIDE
        for n, b in bound.limits.items()
    ]
    true = truth or Truth(plant=bound.plant)
    limits += [_shape(bound, loop, shape, scale, q) for shape in shapes]
    dense = margin_grid(np.concatenate([loop.marks, true.plant.poles()]))
    blocks = loop.at(dense)
    base, moved = _affine(blocks, blocks.yu, scale)
    off, shifted = _affine(blocks, true.yu(dense) - blocks.yu, scale)
    # |S~ - c D| <= r |D| with D = 1 - X (P - P~), if |S~ - c|/r + (1 + |c|/r) |X (P - P~)| <= 1.
    centre, radius = (0.0, max_sensitivity) if disk is None else disk
    more = 1.0 + abs(centre) / radius
    base, moved = (1.0 + base - centre) / radius, moved / radius
    off, shifted = more * off, more * shifted
    chosen = np.zeros(dense.size, dtype=np.bool_)
    chosen[::_EVERY] = math.isfinite(radius)
    # On all of the dense grid these would be thousands of cones: the peaks of those that are
    # broken join in turn.
    for _ in range(_EXCHANGES):
        held = list(limits)
        if chosen.any():
            size = _size(base[chosen], moved[chosen], q) + _size(off[chosen], shifted[chosen], q)
            held.append(size <= _INSIDE)
        _solve(cp.Problem(cp.Minimize(cp.norm(stacked)), held), q)
        used = np.abs(base + moved @ q.value) + np.abs(off + shifted @ q.value)
        around = np.concatenate([[0.0], used, [0.0]])
        broken = (used > 1.0) & (used >= around[:-2]) & (used >= around[2:])
        if not broken.any():
            break
        chosen |= broken
    values = np.asarray(q.value, dtype=np.float64) * scale
    rms = {n: float(np.linalg.norm(r @ values + r0)) for n, (r, r0) in rows.items()}
    return YoulaDesign(
        bound=bound,
        value=math.sqrt(sum(w * rms[n] ** 2 for n, w in bound.minimise.items())),
        rms={n: rms[n] for n in bound.limits},
        max_sensitivity=max_sensitivity,
        weights=values,
        loop=loop,
    )


def margin_grid(poles: ComplexArray) -> FloatArray:
    """Return frequencies [rad/s] that see every lightly damped pole [1/s]."""
    grid = frequency_grid(poles)
    return grid[grid <= _TOP]


def _variances(bound: Bound, loop: AffineLoop) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return R, r by output, with ||R q + r||^2 its variance: few rows for many nodes."""
    omega, weights = frequencies(bound.sources, loop.marks)
    omega, weights = omega[1:], weights[1:]
    plant = bound.plant.response(omega).select(disturbances=[s.name for s in bound.sources])
    blocks = loop.at(omega)
    shaken = np.sqrt(densities(bound.sources, omega) * weights).T[:, None]  # (k, 1, nw)
    constant = (blocks.X[:, None] @ plant.yw * shaken)[:, 0]
    slope = np.moveaxis(blocks.slope @ plant.yw * shaken, 1, 2)
    found = {}
    for name in dict.fromkeys([*bound.minimise, *bound.limits]):
        row = plant.outputs.index(name)
        pushed = plant.zu[:, row, 0]
        r = plant.zw[:, row] * shaken[:, 0] + pushed[:, None] * constant
        R = (pushed[:, None, None] * slope).reshape(r.size, -1)
        whole = np.column_stack([R, r.ravel()])
        triangle = upper_triangle(whole)
        found[name] = triangle[:, :-1], triangle[:, -1]
    return found


def _shape(
    bound: Bound, loop: AffineLoop, limit: LowFrequency | RollOff, scale: FloatArray, q: Any
) -> Any:
    """Return a limit on a slow response or on a roll-off as cones."""
    if isinstance(limit, RollOff):
        blocks = loop.at(np.geomspace(limit.above, 100.0 * limit.above, 100))
        base, moved = _affine(blocks, blocks.yu, scale)
        # |L| <= b wherever |T| <= b/(1 + b), and T = 1 - S is affine.
        return _size(base, moved, q) <= _INSIDE * limit.bound / (1.0 + limit.bound)
    omega = np.geomspace(_LOWEST, limit.below, _SLOW)
    plant = bound.plant.response(omega).select(
        outputs=[limit.output], disturbances=[limit.disturbance]
    )
    blocks = loop.at(omega)
    base, moved = _affine(blocks, plant.yw[:, :, 0], scale)
    pushed = plant.zu[:, 0, 0]
    base, moved = plant.zw[:, 0, 0] + pushed * base, pushed[:, None] * moved
    return _size(base, moved, q) <= _INSIDE * limit.bound


def upper_triangle(rows: ComplexArray | FloatArray) -> FloatArray:
    """Return R with R'R = Re rows^H rows, (n, n)."""
    return np.asarray(np.linalg.qr(np.vstack([rows.real, rows.imag]), mode="r"), dtype=np.float64)


def _affine(
    blocks: LoopBlocks, yu: ComplexArray, scale: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return X yu at Q = 0, (k,), and its columns, (k, q)."""
    return np.einsum("ky,ky->k", blocks.X, yu), (blocks.slope @ yu[:, :, None])[:, :, 0] * scale


def _solve(problem: Any, q: Any) -> None:
    """Solve a cone programme with Clarabel."""
    try:
        with warnings.catch_warnings():
            # An inaccurate solution is a controller all the same, and is looked at as such.
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cp.CLARABEL)
    except cvxpy.error.SolverError as error:
        # Its own words advise on how to call it, which nobody here does.
        raise SolverError("Youla: Clarabel found no answer, for want of digits") from error
    if q.value is None or problem.status not in ("optimal", "optimal_inaccurate"):
        raise SynthesisError(f"Youla: no controller with {q.size} free numbers keeps the limits")


def _size(base: ComplexArray, moved: ComplexArray, q: Any) -> Any:
    """Return |base + moved q|, (k,)."""
    real, imaginary = moved.real @ q + base.real, moved.imag @ q + base.imag
    return cp.norm(cp.vstack([real, imaginary]), 2, axis=0)


def _range(bound: Bound) -> tuple[float, float]:
    """Return the slowest and the fastest pole of the functions [rad/s].

    From below the sea's mean frequency to above that where the LQG loop ends.
    """
    loop = AffineLoop(bound, np.ones(1))
    omega = margin_grid(loop.marks)
    blocks = loop.at(omega)
    works = np.abs(np.sum(blocks.X * blocks.yu, axis=1)) > _WORKS
    sizes = np.abs(bound.plant.poles())
    mean = float(np.exp(np.median(np.log(sizes[sizes > 1e-3]))))
    found = []
    for source in bound.sources:
        if source.band is not None:
            edges = np.geomspace(*source.band, 500)
            density = source.density(edges)
            found.append(np.trapezoid(edges * density, edges) / np.trapezoid(density, edges))
    slowest = _SLOWEST * float(max(found, default=mean))
    return slowest, max(_FASTEST * float(omega[works].max(initial=0.0)), 10.0 * slowest)
