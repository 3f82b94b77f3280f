"""The numbers that a search needs of a loop, with slopes: cost, moments, curves, margins, poles.

The responses are `synth.loop`'s.  Quadratic drag, linearised, is one more loop around the plant: a
force -(c - c_0) v with the logarithm of c as its variable.  At many parameter vectors at once and
without slopes, the same numbers screen candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from operator import methodcaller
from typing import Any

import numpy as np
from scipy.linalg import eig

from models.basics import BoolArray, ComplexArray, FloatArray, Quadrature

from ..limits import Size
from ..loop import (
    Closing,
    Dual,
    LoopResponses,
    at_least,
    counted_poles,
    exp,
    imag,
    joined,
    level_ends,
    log,
    real,
    sqrt,
    value_of,
)
from ..structures import ParametrisedController
from .places import SHIFT, beside, crossings, peaks
from .problem import Goal, Problem

_FAINT = 1e-3  # loop gains whose crossings of the axis no gain margin is about
_SMALL = 1e-3  # of its typical size: a parameter below it is shifted as if it were that
_SINGLE, _NUDGE = 1e-9, 1e-15  # product of unit eigenvectors below which poles are pulled apart
_LEAST_CYCLES = float(np.exp(0.5))  # of a peak: a factor of one, below which the log turns negative


@dataclass(frozen=True, kw_only=True, eq=False)
class Point:
    """A parameter vector, or many: what a loop is closed with.

    Attributes
    ----------
    values
        The law's parameters, one array each, () or (b, 1).
    drag
        Coefficient of the drag [N s/m] or None, () or (b, 1).
    slopes
        Whether derivatives are asked for: by the parameters, then by the drag's logarithm.
    """

    values: Sequence[Any]
    drag: Any = None
    slopes: bool = False

    def closing(self, problem: Problem, s: ComplexArray) -> Closing:
        """Return what closes the loop of a problem at points `s`, (k,) [1/s]."""
        law: ParametrisedController = problem.law
        count, drag = len(self.values), problem.drag
        values: list[Any] = list(self.values)
        slopes: list[dict[tuple[int, int], ComplexArray]] | None = None
        if self.slopes:
            unit = np.eye(count)
            values = [Dual(np.array([v]), unit[:, i : i + 1]) for i, v in enumerate(values)]
            slopes = [{} for _ in range(count + (drag is not None))]
        entries = law.response(values, s)
        m, length = len(entries) + (drag is not None), len(entries[0]) + (drag is not None)
        many = np.shape(self.values[0])[:-1] if count else ()
        C = np.zeros((m, length, *many, s.size), dtype=np.complex128)
        for i, line in enumerate(entries):
            for j, entry in enumerate(line):
                if isinstance(entry, Dual):
                    assert slopes is not None
                    C[i, j] = entry.value
                    for a in np.flatnonzero(np.any(entry.slope, axis=1)):
                        slopes[a][i, j] = np.broadcast_to(entry.slope[a], s.shape)
                else:
                    C[i, j] = entry
        if drag is not None:
            C[-1, -1] = -(self.drag - drag.reference)
            if slopes is not None:
                slopes[count][m - 1, length - 1] = np.full(s.shape, -self.drag, np.complex128)
        return Closing(law=C, slopes=slopes)


#: Weights of the moments m_0 and m_2 on quadrature nodes, (nw, k) each, by order.
Moments = Mapping[int, FloatArray]


def moment_weights(problem: Problem, nodes: Quadrature) -> Moments:
    """Return quadrature weights times densities times powers of omega, (nw, k), by order."""
    densities = [d.density(nodes.omega) * nodes.weights for d in problem.disturbances]
    # What only limits speak of shakes nothing.
    still = np.zeros((len(problem.sources) - len(densities), nodes.omega.size))
    every = np.vstack([*densities, still])
    return {order: every * nodes.omega**order for order in (0, 2)}


Fresh = Callable[[FloatArray, bool], LoopResponses]


class LoopNumbers:
    """The `synth.limits.Symbols` of a problem at one point, or at many.

    Parameters
    ----------
    problem
        The problem.
    cost, margins
        The closed loop on the quadrature nodes and on the margin frequencies.
    weights, omega
        The weights of the moments on those nodes, and those frequencies [rad/s].
    point
        What the loop is closed with.
    log_drag
        Logarithm of the drag coefficient, or None.
    extra
        The variable of a goal other than the cost, or None.
    goal
        What is looked for.
    """

    def __init__(
        self,
        problem: Problem,
        cost: LoopResponses,
        margins: LoopResponses,
        weights: Moments,
        omega: FloatArray,
        point: Point,
        *,
        log_drag: Any = None,
        extra: Any = None,
        goal: Goal = Goal.COST,
    ) -> None:
        self._problem, self._weights = problem, weights
        self._cost, self._margins = cost, margins
        self.omega, self._point = omega, point
        self.log_drag, self.extra = log_drag, extra
        self._goal = goal
        self._amplitude = exp(extra * 2.0) if goal is Goal.SEA else None
        self._fresh: Fresh | None = None

    def under(self, problem: Problem, weights: Moments) -> LoopNumbers:
        """Return the same loop shaken by the disturbances of another problem."""
        return LoopNumbers(
            problem,
            self._cost,
            self._margins,
            weights,
            self.omega,
            self._point,
            log_drag=self.log_drag,
            extra=self.extra,
            goal=self._goal,
        )

    @cached_property
    def differences(self) -> list[Any]:
        """1 + L of every loop at the margin frequencies, (k,) each."""
        loops = range(len(self._problem.plant.inputs))
        return [self._padded(self._margins.difference(i)) for i in loops]

    @property
    def module_margin(self) -> float:
        """Radius of the disc about -1 that a limit on the sensitivity keeps clear; 0 without."""
        bounds = [lim.bound for lim in self._problem.limits if lim.name == "max_sensitivity"]
        return 1.0 / bounds[0] if bounds else 0.0

    def measure(self, fresh: Fresh) -> None:
        """Let margins be held where they are measured, between the margin frequencies too.

        Parameters
        ----------
        fresh
            From frequencies [rad/s] and whether slopes are wanted to the closed loop there.
        """
        self._fresh = fresh

    def curves(
        self, size: Size, above: float, channel: tuple[str, str] | None = None
    ) -> list[tuple[FloatArray, Any]]:
        """Return curves at the margin frequencies, and at the refined peaks of a size between them.

        The peaks move with the parameters, but at a peak that changes the size in second order
        only.  See `synth.limits.Symbols`.
        """
        takes: list[Callable[[LoopResponses], Any]]
        if channel is None:
            found = [(self.omega, d) for d in self.differences]
            takes = [methodcaller("difference", i) for i in range(len(found))]
        else:
            takes = [methodcaller("response", *channel)]
            found = [(self.omega, self._padded(takes[0](self._margins)))]
        fresh = self._fresh
        if fresh is None:
            return found
        for take, (omega, curve) in zip(takes, found[:], strict=True):

            def sized(w: FloatArray, take: Callable[[LoopResponses], Any] = take) -> FloatArray:
                return size(w, value_of(take(fresh(w, False))))

            at = peaks(sized, omega, size(omega, value_of(curve)), above)
            if at.size:
                found.append((at, self._padded(take(fresh(at, isinstance(curve, Dual))))))
        return found

    @cached_property
    def poles(self) -> tuple[Any, BoolArray, BoolArray]:
        """The closed loop's poles [1/s], and which count for damping and for frequency.

        Of a conjugate pair one counts.  By u^H dA v / u^H v with the unit eigenvectors u, v; a
        double pole, which moves infinitely fast, is pulled apart by a hair.
        """
        problem, point = self._problem, self._point
        plant, models = problem.modelled
        drag = point.drag
        if not point.slopes:
            given = [*point.values, *([] if drag is None else [drag])]
            rows = np.stack(np.broadcast_arrays(*given), axis=-1)
            count, found = len(point.values), []
            for row in rows.reshape(-1, len(given)):
                matrix = problem.loop_matrix(plant, row[:count], *row[count:])
                poles = np.linalg.eigvals(matrix).astype(np.complex128)
                found.append((poles, *_counted(poles, models)))
            shape = (*rows.shape[:-2], -1)
            several, swinging, own = ([each[i] for each in found] for i in range(3))
            return np.reshape(several, shape), np.reshape(swinging, shape), np.reshape(own, shape)
        values = np.array(point.values, dtype=np.float64)
        uneven = np.linspace(-1.0, 1.0, values.size) if values.size > 1 else np.ones(1)
        for nudge in (0.0, _NUDGE):
            near = values * (1.0 + nudge * uneven)
            matrix = problem.loop_matrix(plant, near, drag)
            poles, left, right = eig(matrix, left=True, right=True)  # type: ignore[misc]  # its stub
            product = np.einsum("ik,ik->k", left.conj(), right)
            if np.abs(product).min() > _SINGLE:
                break
        product = np.where(product == 0.0, 1.0, product)
        scales = [_SMALL * p.scale for p in problem.law.parameters]
        steps = np.diag(SHIFT * np.maximum(np.abs(values), scales))
        slopes = []
        ends = [[(values + sign * step, drag) for sign in (1.0, -1.0)] for step in steps]
        widths = [2.0 * step.sum() for step in steps]
        if problem.drag is not None:
            ends.append([(values, drag * (1.0 + sign * SHIFT)) for sign in (1.0, -1.0)])
            widths.append(2.0 * SHIFT)  # of its logarithm
        for (more, less), width in zip(ends, widths, strict=True):
            change = problem.loop_matrix(plant, *more) - problem.loop_matrix(plant, *less)
            slopes.append(np.einsum("ik,ij,jk->k", left.conj(), change / width, right) / product)
        return self._padded(Dual(poles, np.array(slopes))), *_counted(poles, models)

    @cached_property
    def on_axis(self) -> Any | None:
        """L of all loops where it crosses the negative real axis, (c,); None on a grid.

        The crossing moves with the parameters: Im L = 0 gives its frequency's slopes.
        """
        fresh = self._fresh
        if fresh is None:
            return None
        found = []
        for i, d in enumerate(self.differences):
            gain = value_of(d) - 1.0
            at = crossings(partial(_height, fresh, i), self.omega, gain.imag, np.abs(gain) > _FAINT)
            loop, rate = self._moving(fresh, at, i, isinstance(d, Dual))
            crossed = real(loop) - imag(loop) * (rate.real / rate.imag)
            ends = (d - 1.0)[..., [0, -1]]
            for on in (crossed, real(ends)[..., level_ends(gain)]):
                found.append(on[..., value_of(on) < 0.0])
        return joined(found)

    @cached_property
    def turning_delays(self) -> Any | None:
        """Delay at each crossover of all loops that turns L to -1 [s], (c,); None on a grid."""
        fresh = self._fresh
        if fresh is None:
            return None
        found: list[Any] = []
        for i, d in enumerate(self.differences):
            size = np.abs(value_of(d) - 1.0) - 1.0
            at = crossings(partial(_excess, fresh, i), self.omega, size)
            loop, rate = self._moving(fresh, at, i, isinstance(d, Dual))
            gain = value_of(loop)
            turn = np.mod(np.angle(-gain), 2.0 * np.pi)
            if not isinstance(loop, Dual):
                found.append(turn / at)
                continue
            grows = (np.conj(gain) * rate).real
            shift = -(np.conj(gain) * loop.slope).real / grows  # of the crossover, [rad/s]
            turns = ((loop.slope + rate * shift) / gain).imag
            found.append(Dual(turn / at, turns / at - turn / at**2 * shift))
        return joined(found)

    def _moving(
        self, fresh: Fresh, omega: FloatArray, index: int, slopes: bool
    ) -> tuple[Any, ComplexArray]:
        """Return L at frequencies [rad/s], and dL/d omega by central differences, (k,) each."""
        both = self._padded(fresh(beside(omega), slopes).difference(index) - 1.0)
        above, below = both[..., : omega.size], both[..., omega.size :]
        rate = (value_of(above) - value_of(below)) / (2.0 * SHIFT * omega)
        return (above + below) * 0.5, np.asarray(rate)

    @cached_property
    def _moments(self) -> Mapping[tuple[str, int], Any]:
        """Spectral moments m_0 and m_2 of every output."""
        keys = [(name, order) for name in self._cost.outputs for order in self._weights]
        names = [name for name, _ in keys]
        every = self._cost.moments(names, [self._weights[order] for _, order in keys])
        every = self._padded(every)
        return {
            key: every[k : k + 1] if isinstance(every, Dual) else every[..., k : k + 1]
            for k, key in enumerate(keys)
        }

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`, (1,)."""
        found = self._moments[output, order]
        return found if self._amplitude is None else found * self._amplitude

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s], (1,)."""
        m0, m2 = self.moment(output, 0), self.moment(output, 2)
        cycles = sqrt(m2 / m0) * (duration / (2.0 * np.pi))
        return sqrt(log(at_least(cycles, _LEAST_CYCLES)) * 2.0) * sqrt(m0)

    def cost(self) -> Any:
        """Return the logarithm of the square root of the weighted variance, (1,)."""
        terms = [self.moment(name, 0) * w for name, w in self._problem.minimise.items()]
        return log(sum(terms[1:], terms[0])) * 0.5

    def cost_curvature(self) -> FloatArray:
        """Return the Gauss-Newton Hessian of `cost` by its variables, (n, n).

        The responses are nearly linear in the parameters where the cost is small, and then it is
        the sum of squares, not its logarithm, that a quadratic model is good for.
        """
        total, variance = np.zeros((self._cost.count, self._cost.count)), 0.0
        for name, weight in self._problem.minimise.items():
            total += weight * self._cost.curvature(name, self._weights[0])
            variance += weight * float(value_of(self._moments[name, 0]).item())
        found = total / variance
        if isinstance(self.extra, Dual):
            found = np.pad(found, (0, 1))
        return found

    def drag_balance(self) -> Any:
        """Return log C - log(slope sigma_v), zero where drag and motion agree, (1,)."""
        drag = self._problem.drag
        assert drag is not None
        return self.log_drag - (log(self.moment(drag.velocity, 0)) * 0.5 + np.log(drag.slope))

    def _padded(self, found: Any) -> Any:
        """Return a number with a slope of zero by the variable of the goal, if there is one."""
        if not isinstance(found, Dual) or not isinstance(self.extra, Dual):
            return found
        return Dual(found.value, np.concatenate([found.slope, np.zeros_like(found.slope[:1])]))


def _counted(poles: ComplexArray, models: ComplexArray) -> tuple[BoolArray, BoolArray]:
    """Return which poles count for damping and for frequency, one of each conjugate pair."""
    swinging, own = counted_poles(poles, models)
    # Of a pair of which the delay models took one the other counts, whichever it is.
    below = poles.imag < 0.0
    for counted in (swinging, own):
        mates = np.isclose(poles[:, None], poles[counted & ~below].conj(), rtol=1e-9, atol=0.0)
        counted &= ~(below & mates.any(axis=1))
    return swinging, own


def _gain(loop: LoopResponses, index: int) -> ComplexArray:
    return np.asarray(value_of(loop.difference(index)) - 1.0)


def _height(fresh: Fresh, index: int, omega: FloatArray) -> FloatArray:
    """Return Im L, (k,)."""
    return _gain(fresh(omega, False), index).imag


def _excess(fresh: Fresh, index: int, omega: FloatArray) -> FloatArray:
    """Return |L| - 1, (k,)."""
    return np.abs(_gain(fresh(omega, False), index)) - 1.0
