"""The numbers that a search needs of a loop, with slopes: cost, moments, curves, margins, poles.

The responses are `synth.loop`'s.  Quadratic drag and losses that switch, linearised, are further
loops around the plant: forces -(c - c_0) v with the logarithm of c as variable.  At many parameter
vectors at once and without slopes, the same numbers screen candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import eig

from models.basics import BoolArray, ComplexArray, FloatArray, Quadrature

from ..limits import DelayMargin, GainMargin, GainMarginDown, Limit
from ..loop import (
    Closing,
    CoherentError,
    Dual,
    LoopResponses,
    Shaking,
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
from .places import IntArray, Search, crossings, peaks, together
from .problem import Goal, Problem

_FAINT = 1e-3  # loop gains whose crossings of the axis no gain margin is about
_SMALL = 1e-3  # of its typical size: a parameter below it is shifted as if it were that
_SINGLE, _NUDGE = 1e-9, 1e-15  # product of unit eigenvectors below which poles are pulled apart
_SHIFT = 1e-6  # relative, of a parameter, of differences
_AXIS, _CIRCLE = "real axis", "unit circle"
_ORDERS = (0, 2)  # of the spectral moments
_STILL = 1e-100  # a variance that is none
_LEAST_CYCLES = float(np.exp(0.5))  # of a peak: a factor of one, below which the log turns negative


@dataclass(frozen=True, kw_only=True, eq=False)
class Point:
    """A parameter vector, or many: what a loop is closed with."""

    values: Sequence[Any]  #: The law's parameters, one array each, () or (b, 1).
    coefficients: Sequence[Any] = ()  #: One for each of the problem's elements, () or (b, 1).
    #: Whether derivatives are asked for: by the parameters, then by the coefficients' logarithms.
    slopes: bool = False

    def closing(self, problem: Problem, s: ComplexArray, still: BoolArray | None = None) -> Closing:
        """Return what closes the loop of a problem at points `s`, (k,) [1/s].

        Where `still` is true, (k,), it is closed without losses.
        """
        law: ParametrisedController = problem.law
        count = len(self.values)
        values: list[Any] = list(self.values)
        if self.slopes:
            values = [Dual(np.array([v]), np.ones((1, 1)), (i,)) for i, v in enumerate(values)]
        law_entries = law.response(values, s)
        entries: dict[tuple[int, int], ComplexArray] = {}
        slopes: dict[tuple[int, int], tuple[list[int], ComplexArray]] = {}
        for i, line in enumerate(law_entries):
            for j, entry in enumerate(line):
                if isinstance(entry, float) and entry == 0.0:
                    continue
                value = np.asarray(value_of(entry), dtype=np.complex128)
                if value.shape[-1:] != s.shape:
                    value = np.broadcast_to(value, (*value.shape[:-1], s.size))
                entries[i, j] = value
                if isinstance(entry, Dual):
                    assert entry.at is not None
                    slope = np.broadcast_to(entry.slope, (len(entry.at), s.size))
                    slopes[i, j] = list(entry.at), np.asarray(slope, dtype=np.complex128)
        m, length = len(law_entries), len(law_entries[0])
        calm = problem.still(self.coefficients)
        for element, known, rest in zip(problem.elements, self.coefficients, calm, strict=True):
            coefficient = known if still is None else np.where(still, rest, known)
            added = np.asarray(coefficient - element.reference, dtype=np.complex128)
            entries[m, length] = np.broadcast_to(-added, (*added.shape[:-1], s.size))
            if self.slopes:
                slope = np.full((1, s.size), -coefficient, np.complex128)
                slopes[m, length] = [count], slope
            m, length, count = m + 1, length + 1, count + 1
        return Closing(
            entries=entries,
            size=(m, length),
            slopes=slopes if self.slopes else None,
            count=count,
        )


def moment_weights(problem: Problem, nodes: Quadrature) -> Shaking:
    """Return what shakes the loop of a problem on quadrature nodes."""
    densities = [d.density(nodes.omega) * nodes.weights for d in problem.disturbances]
    # What only limits speak of shakes nothing.
    silent = np.zeros((len(problem.sources) - len(densities), nodes.omega.size))
    pair = CoherentError.among(problem.disturbances)
    source, error = (0, 0) if pair is None else (pair.source, pair.error)
    shares = np.zeros((0, nodes.omega.size), np.complex128)
    if pair is not None:
        shares = pair.shares(nodes.omega) * densities[source]
    return Shaking(
        weights=np.vstack([*densities, silent]),
        source=source,
        error=error,
        shares=shares,
        signs=np.array([()] if pair is None else pair.signs),
    )


def on_sides(problem: Problem, points: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], BoolArray]:
    """Return points, (k,), once more where there are losses, and which are those without them.

    Margins hold at both.
    """
    sides = _sides(problem)
    return np.tile(points, sides), np.repeat(np.arange(sides) > 0, points.size)


def _sides(problem: Problem) -> int:
    return 1 if all(element.lasting for element in problem.elements) else 2


#: From frequencies [rad/s], (k,), and where losses are none to the closed loop there.
Fresh = Callable[[FloatArray, BoolArray], LoopResponses]
#: A loop by its input, or a response by its ends.
Curve = int | tuple[str, str]


class LoopNumbers:
    """The `synth.limits.Symbols` of a problem at one point, or at many.

    Parameters
    ----------
    problem
        The problem.
    cost, margins
        The closed loop on the quadrature nodes, and at the margin frequencies.
    shaking, omega
        What shakes it on those nodes, and those frequencies [rad/s]: see `on_sides`.
    point
        What the loop is closed with.
    logs
        Logarithms of the elements' coefficients, for `balances`.
    extra
        The variable of a goal other than the cost, or None.
    goal
        What is looked for.
    fresh
        If margins are held where they are measured, between the margin frequencies too: the closed
        loop at other ones.
    """

    def __init__(
        self,
        problem: Problem,
        cost: LoopResponses,
        margins: LoopResponses,
        shaking: Shaking,
        omega: FloatArray,
        point: Point,
        *,
        logs: Sequence[Any] = (),
        extra: Any = None,
        goal: Goal = Goal.COST,
        fresh: Fresh | None = None,
    ) -> None:
        self._problem, self._shaking = problem, shaking
        self._cost, self._margins = cost, margins
        self.omega, self._point = omega, point
        self._logs, self.extra = logs, extra
        self._sides = _sides(problem)
        self._amplitude = exp(extra * 2.0) if goal is Goal.SEA else None
        self._fresh = fresh
        self._signs = np.zeros((1, len(shaking.shares)))
        self._grid: dict[Curve, Any] = {}
        self._peaks: dict[float, Any] = {}

    def under(self, problem: Problem, shaking: Shaking) -> LoopNumbers:
        """Return the same loop shaken by the disturbances of another problem."""
        own = copy(self)
        for name in ("_every", "_moments", "signed"):
            own.__dict__.pop(name, None)
        own._problem, own._shaking, own._peaks = problem, shaking, {}
        own._signs = np.zeros((1, len(shaking.shares)))
        return own

    @cached_property
    def differences(self) -> list[Any]:
        """1 + L of every loop at the margin frequencies, (k,) each."""
        return [self._on_grid(of) for of in self._curves_of(None)]

    @property
    def module_margin(self) -> float:
        """Radius of the disc about -1 that a limit on the sensitivity keeps clear; 0 without."""
        bounds = [lim.bound for lim in self._problem.limits if lim.name == "max_sensitivity"]
        return 1.0 / bounds[0] if bounds else 0.0

    @cached_property
    def _followed(self) -> Mapping[str, list[tuple[FloatArray, Any]]]:
        """Where margins are measured between the margin frequencies, and what curves are there.

        By limit, or kind of crossing.  The places move with the parameters: at a peak that changes
        a size in second order only, and crossings are known a hair to both sides.
        """
        fresh, sought = self._fresh, self._sought()
        assert fresh is not None

        def curves(at: FloatArray, side: IntArray, cuts: Sequence[slice]) -> list[Any]:
            loop = fresh(at, side > 0)
            every = [*zip((of for _, of, _ in sought), cuts, strict=True)]
            asked = {of for of, cut in every if cut.start < cut.stop}
            whole = {of: self._padded(_curve(loop, of)) for of in asked}
            return [whole[of][..., cut] if of in whole else None for of, cut in every]

        found: dict[str, list[tuple[FloatArray, Any]]] = {key: [] for key, _, _ in sought}
        searches = [search for _, _, search in sought]
        for (key, _, _), place in zip(sought, together(searches, curves), strict=True):
            found[key] += [] if place is None else [place]
        return found

    def _sought(self) -> list[tuple[str, Curve, Search]]:
        """Return the places that limits ask for, of each curve: whose, what curve, the search."""
        limits, sides = self._problem.limits, self._sides
        omega = self.omega[: self.omega.size // sides]
        found: list[tuple[str, Curve, Search]] = []
        for i, d in enumerate(self.differences):
            gain = value_of(d).reshape(sides, -1) - 1.0
            if any(isinstance(limit, GainMargin | GainMarginDown) for limit in limits):
                behind = (np.abs(gain) > _FAINT) & (gain.real < 0.0)
                found.append((_AXIS, i, crossings(omega, gain, _height, behind)))
            if any(isinstance(limit, DelayMargin) for limit in limits):
                found.append((_CIRCLE, i, crossings(omega, gain, _excess)))
        for limit in limits:
            if limit.followed is None:
                continue
            for of in self._curves_of(limit.channel):
                values = value_of(self._on_grid(of)).reshape(sides, -1)
                found.append((limit.name, of, peaks(omega, values, *limit.followed)))
        return found

    def _curves_of(self, channel: tuple[str, str] | None) -> list[Curve]:
        """Return the curves that a limit is on."""
        return [*range(len(self._problem.plant.inputs))] if channel is None else [channel]

    def _on_grid(self, of: Curve) -> Any:
        """Return a curve at the margin frequencies."""
        if of not in self._grid:
            self._grid[of] = self._padded(_curve(self._margins, of))
        return self._grid[of]

    def curves(self, limit: Limit) -> list[tuple[FloatArray, Any]]:
        """Return the curves that a limit is on, at the margin frequencies and at peaks between.

        See `synth.limits.Symbols`.
        """
        found = [(self.omega, self._on_grid(of)) for of in self._curves_of(limit.channel)]
        if self._fresh is not None:
            found += self._followed.get(limit.name, [])
        return found

    @cached_property
    def poles(self) -> tuple[Any, BoolArray, BoolArray]:
        """The closed loop's poles [1/s], and which count for damping and for frequency.

        Of a conjugate pair one counts.  By u^H dA v / u^H v with the unit eigenvectors u, v; a
        double pole, which moves infinitely fast, is pulled apart by a hair.
        """
        problem, point = self._problem, self._point
        plant, models = problem.modelled
        known = point.coefficients
        if not point.slopes:
            given = [*point.values, *known]
            rows = np.stack(np.broadcast_arrays(*given), axis=-1)
            count, found = len(point.values), []
            for row in rows.reshape(-1, len(given)):
                matrix = problem.loop_matrix(plant, row[:count], row[count:].tolist())
                poles = np.linalg.eigvals(matrix).astype(np.complex128)
                found.append((poles, *_counted(poles, models)))
            shape = (*rows.shape[:-2], -1)
            several, swinging, own = ([each[i] for each in found] for i in range(3))
            return np.reshape(several, shape), np.reshape(swinging, shape), np.reshape(own, shape)
        values = np.array(point.values, dtype=np.float64)
        uneven = np.linspace(-1.0, 1.0, values.size) if values.size > 1 else np.ones(1)
        for nudge in (0.0, _NUDGE):
            near = values * (1.0 + nudge * uneven)
            matrix = problem.loop_matrix(plant, near, known)
            poles, left, right = eig(matrix, left=True, right=True)  # type: ignore[misc]  # its stub
            product = np.einsum("ik,ik->k", left.conj(), right)
            if np.abs(product).min() > _SINGLE:
                break
        product = np.where(product == 0.0, 1.0, product)
        scales = [_SMALL * p.scale for p in problem.law.parameters]
        steps = np.diag(_SHIFT * np.maximum(np.abs(values), scales))
        slopes = []
        ends = [[(values + sign * step, known) for sign in (1.0, -1.0)] for step in steps]
        widths = [2.0 * step.sum() for step in steps]
        for unit in np.eye(len(known)):
            shifts = [1.0 + sign * _SHIFT * unit for sign in (1.0, -1.0)]
            ends.append([(values, (np.array(known) * shift).tolist()) for shift in shifts])
            widths.append(2.0 * _SHIFT)  # of its logarithm
        for (more, less), width in zip(ends, widths, strict=True):
            change = problem.loop_matrix(plant, *more) - problem.loop_matrix(plant, *less)
            slopes.append(np.einsum("ik,ij,jk->k", left.conj(), change / width, right) / product)
        return self._padded(Dual(poles, np.array(slopes))), *_counted(poles, models)

    @cached_property
    def on_axis(self) -> Any | None:
        """L of all loops where it crosses the negative real axis, (c,); None on a grid.

        The crossing moves with the parameters: Im L = 0 gives its frequency's slopes.
        """
        if self._fresh is None:
            return None
        ends = np.arange(self.omega.size).reshape(self._sides, -1)[:, [0, -1]]
        found = []
        for d in self.differences:
            gain = value_of(d) - 1.0
            level = np.concatenate([pair[level_ends(gain[pair])] for pair in ends])
            found.append(real(d[..., level]) - 1.0)
        for place in self._followed.get(_AXIS, []):
            loop, rate = _moving(*place)
            found.append(real(loop) - imag(loop) * (rate.real / rate.imag))
        return joined([on[..., value_of(on) < 0.0] for on in found])

    @cached_property
    def turning_delays(self) -> Any | None:
        """Delay at each crossover of all loops that turns L to -1 [s], (c,); None on a grid."""
        if self._fresh is None:
            return None
        found: list[Any] = [self.differences[0][..., :0]]
        for beside_it in self._followed.get(_CIRCLE, []):
            at = beside_it[0].reshape(2, -1).mean(axis=0)
            loop, rate = _moving(*beside_it)
            gain = value_of(loop)
            turn = np.mod(np.angle(-gain), 2.0 * np.pi)
            if not isinstance(loop, Dual):
                found.append(turn / at)
                continue
            grows = (np.conj(gain) * rate).real
            shift = -(np.conj(gain) * loop.slope).real / grows  # of the crossover, [rad/s]
            turns = ((loop.slope + rate * shift) / gain).imag
            found.append(Dual(turn / at, turns / at - turn / at**2 * shift))
        return real(joined(found))

    @cached_property
    def _pairs(self) -> list[tuple[str, ...]]:
        """Every output, and the two that a limit speaks of."""
        pairs = {lim.outputs: None for lim in self._problem.limits if len(lim.outputs) == 2}
        return [*((name,) for name in self._cost.outputs), *pairs]

    @cached_property
    def _every(self) -> Any:
        """Integrals of all pairs, (pairs, orders, ..., 1 + e): the mean, and what signs turn."""
        outputs = self._cost.outputs
        pairs: Any = self._pairs[len(outputs) :]
        return self._padded(self._cost.integrals(outputs, pairs, self._shaking, _ORDERS))

    @cached_property
    def _moments(self) -> Any:
        """Moments and covariances by combination of signs, (pairs, orders, ..., c)."""
        found = self._every @ np.vstack([np.ones(len(self._signs)), self._signs.T])
        if self._amplitude is None:
            return found
        if isinstance(found, Dual):
            return found * Dual(self._amplitude.value, self._amplitude.slope[:, None, None])
        return found * self._amplitude

    def _rows(self, which: int | slice, order: int) -> Any:
        at, every = _ORDERS.index(order), self._moments
        return every.row(which, at) if isinstance(every, Dual) else every[which, at]

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`, (1,), or by combination of signs."""
        return self._positive(self._rows(self._pairs.index((output,)), order))

    def covariance(self, one: str, other: str) -> Any:
        """Return the covariance of two outputs, (1,), or by combination of signs."""
        return self._rows(self._pairs.index((one, other)), 0)

    def _positive(self, moment: Any) -> Any:
        # A programme's logarithms want it above zero, where error and motion cancel.
        return at_least(moment, _STILL) if self._signs.any() else moment

    @cached_property
    def signed(self) -> LoopNumbers:
        """The numbers by combination of the signs that sensors' errors may have; or themselves.

        Its moments are those of each combination, (c,), where its own are the mean over all.
        """
        if not self._shaking.signs.any():
            return self
        _ = self._every  # once for both
        own = copy(self)
        own.__dict__.pop("_moments", None)
        own._signs, own._peaks = self._shaking.signs, {}
        return own

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s], as its moments are."""
        row, outputs = self._pairs.index((output,)), slice(0, len(self._cost.outputs))
        if duration not in self._peaks:
            m0, m2 = (self._positive(self._rows(outputs, order)) for order in _ORDERS)
            cycles = sqrt(m2 / m0) * (duration / (2.0 * np.pi))
            factor = sqrt(log(at_least(cycles, _LEAST_CYCLES)) * 2.0)
            self._peaks[duration] = factor * sqrt(m0)
        every = self._peaks[duration]
        return every.row(row) if isinstance(every, Dual) else every[row]

    def cost(self) -> Any:
        """Return the logarithm of the square root of the weighted variance, (1,)."""
        terms = [self.moment(name, 0) * w for name, w in self._problem.minimise.items()]
        return log(sum(terms[1:], terms[0])) * 0.5

    def cost_curvature(self) -> FloatArray:
        """Return the Gauss-Newton Hessian of `cost` by its variables, (n, n).

        The responses are nearly linear in the parameters where the cost is small, and then it is
        the sum of squares, not its logarithm, that a quadratic model is good for.
        """
        size = self._cost.count
        total, variance = np.zeros((size, size)), 0.0
        for name, weight in self._problem.minimise.items():
            total += weight * self._cost.curvature(name, self._shaking.weights)
            variance += weight * float(value_of(self._every)[self._pairs.index((name,)), 0, 0])
        found = total / variance
        if isinstance(self.extra, Dual):
            found = np.pad(found, (0, 1))
        return found

    def balances(self) -> list[Any]:
        """Return log c less that of the motion, zero where elements and motion agree, (1,) each."""
        pairs = zip(self._logs, self._problem.elements, strict=True)
        return [own - e.log_coefficient(self.moment(e.velocity, 0)) for own, e in pairs]

    def _padded(self, found: Any) -> Any:
        """Return a number with a slope of zero by the variable of the goal, if there is one."""
        if not isinstance(found, Dual) or not isinstance(self.extra, Dual):
            return found
        return Dual(found.value, np.concatenate([found.slope, np.zeros_like(found.slope[:1])]))


def _curve(loop: LoopResponses, of: Curve) -> Any:
    return loop.difference(of) if isinstance(of, int) else loop.response(*of)


def _counted(poles: ComplexArray, models: ComplexArray) -> tuple[BoolArray, BoolArray]:
    """Return which poles count for damping and for frequency, one of each conjugate pair."""
    swinging, own = counted_poles(poles, models)
    # Of a pair of which the delay models took one the other counts, whichever it is.
    below = poles.imag < 0.0
    for counted in (swinging, own):
        mates = np.isclose(poles[:, None], poles[counted & ~below].conj(), rtol=1e-9, atol=0.0)
        counted &= ~(below & mates.any(axis=1))
    return swinging, own


def _moving(beside_it: FloatArray, curve: Any) -> tuple[Any, ComplexArray]:
    """Return L at places, and dL/d omega by central differences, (k,) each.

    From 1 + L at frequencies [rad/s] a hair above and a hair below, (2 k,); see `places.beside`.
    """
    size = beside_it.size // 2
    above, below = curve[..., :size], curve[..., size:]
    rate = (value_of(above) - value_of(below)) / (beside_it[:size] - beside_it[size:])
    return (above + below) * 0.5 - 1.0, np.asarray(rate)


def _height(gain: ComplexArray) -> FloatArray:
    """Return Im L, (k,)."""
    return np.asarray(gain.imag)


def _excess(gain: ComplexArray) -> FloatArray:
    """Return |L| - 1, (k,)."""
    return np.asarray(np.abs(gain) - 1.0)
