"""The numbers that a search needs of a loop, with slopes: cost, moments, curves, margins, poles.

The responses are `synth.loop`'s.  Quadratic drag and losses that switch, linearised, are further
loops around the plant: forces -(c - c_0) v with the logarithm of c as variable.  At many parameter
vectors at once and without slopes, the same numbers screen candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eig

from models.basics import BoolArray, ComplexArray, FloatArray, Quadrature

from ..limits import DelayMargin, GainMargin, GainMarginDown, Limit, Size
from ..loop import (
    Closing,
    CoherentError,
    Dual,
    LoopResponses,
    at_least,
    conj,
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
from .places import SHIFT, Search, beside, crossings, peaks, together
from .problem import Goal, Problem

_FAINT = 1e-3  # loop gains whose crossings of the axis no gain margin is about
_SMALL = 1e-3  # of its typical size: a parameter below it is shifted as if it were that
_SINGLE, _NUDGE = 1e-9, 1e-15  # product of unit eigenvectors below which poles are pulled apart
_AXIS, _CIRCLE = "real axis", "unit circle"
_ORDERS = (0, 2)  # of the spectral moments
_STILL = 1e-100  # a variance that is none
_LEAST_CYCLES = float(np.exp(0.5))  # of a peak: a factor of one, below which the log turns negative


@dataclass(frozen=True, kw_only=True, eq=False)
class Point:
    """A parameter vector, or many: what a loop is closed with.

    Attributes
    ----------
    values
        The law's parameters, one array each, () or (b, 1).
    coefficients
        One for each of the problem's elements, () or (b, 1).
    slopes
        Whether derivatives are asked for: by the parameters, then by the coefficients' logarithms.
    """

    values: Sequence[Any]
    coefficients: Sequence[Any] = ()
    slopes: bool = False

    def sides(self, problem: Problem) -> list[Point]:
        """Return the point, and that without losses where it has some: margins hold at both."""
        still = problem.still(self.coefficients)
        if all(a is b for a, b in zip(still, self.coefficients, strict=True)):
            return [self]
        return [self, replace(self, coefficients=still)]

    def closing(self, problem: Problem, s: ComplexArray) -> Closing:
        """Return what closes the loop of a problem at points `s`, (k,) [1/s]."""
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
        for element, coefficient in zip(problem.elements, self.coefficients, strict=True):
            added = np.asarray(coefficient - element.reference, dtype=np.complex128)
            entries[m, length] = np.broadcast_to(-added, (*added.shape[:-1], s.size))
            if self.slopes:
                slopes[m, length] = [count], np.full((1, s.size), -coefficient, np.complex128)
            m, length, count = m + 1, length + 1, count + 1
        return Closing(
            entries=entries,
            size=(m, length),
            slopes=slopes if self.slopes else None,
            count=count,
        )


def moment_weights(problem: Problem, nodes: Quadrature) -> FloatArray:
    """Return quadrature weights times densities, (nw, k)."""
    densities = [d.density(nodes.omega) * nodes.weights for d in problem.disturbances]
    # What only limits speak of shakes nothing.
    still = np.zeros((len(problem.sources) - len(densities), nodes.omega.size))
    return np.vstack([*densities, still])


Fresh = Callable[[FloatArray, bool], Sequence[LoopResponses]]
Take = Callable[[Sequence[LoopResponses]], Any]


class _Sought(NamedTuple):
    """Places on a curve: whose they are, the curve in a closed loop, its height, and the search."""

    key: tuple[str, int]
    take: Take
    height: Size
    search: Search


class LoopNumbers:
    """The `synth.limits.Symbols` of a problem at one point, or at many.

    Parameters
    ----------
    problem
        The problem.
    cost, margins
        The closed loop on the quadrature nodes, and on the margin frequencies at each side of the
        point (`Point.sides`).
    weights, omega
        The weights of the moments on those nodes, and those frequencies [rad/s].
    point
        What the loop is closed with.
    logs
        Logarithms of the elements' coefficients, for `balances`.
    extra
        The variable of a goal other than the cost, or None.
    goal
        What is looked for.
    """

    def __init__(
        self,
        problem: Problem,
        cost: LoopResponses,
        margins: Sequence[LoopResponses],
        weights: FloatArray,
        omega: FloatArray,
        point: Point,
        *,
        logs: Sequence[Any] = (),
        extra: Any = None,
        goal: Goal = Goal.COST,
    ) -> None:
        self._problem, self._weights = problem, weights
        self._cost, self._margins = cost, margins
        self.omega, self._point = omega, point
        self._logs, self.extra = logs, extra
        self._goal = goal
        self._amplitude = exp(extra * 2.0) if goal is Goal.SEA else None
        self._fresh: Fresh | None = None
        self._responses: dict[tuple[str, str], list[Any]] = {}
        self._shaken: dict[tuple[str, str], Any] = {}
        self._crosses: dict[tuple[str, str], Any] = {}
        self._peaks: dict[tuple[str, float], Any] = {}
        self._signs: FloatArray | None = None

    def under(self, problem: Problem, weights: FloatArray) -> LoopNumbers:
        """Return the same loop shaken by the disturbances of another problem."""
        return LoopNumbers(
            problem,
            self._cost,
            self._margins,
            weights,
            self.omega,
            self._point,
            logs=self._logs,
            extra=self.extra,
            goal=self._goal,
        )

    @cached_property
    def differences(self) -> list[Any]:
        """1 + L of every loop at the margin frequencies, (k,) each; at each side of the point."""
        return [self._padded(take(self._margins)) for take in self._takes(None)]

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

    @cached_property
    def _followed(self) -> Mapping[tuple[str, int], tuple[FloatArray, Any]]:
        """Where margins are measured between the margin frequencies, and what curves are there.

        By limit, or kind of crossing, and loop.  The places move with the parameters: at a peak
        that changes a size in second order only, and crossings are known a hair to both sides.
        """
        assert self._fresh is not None
        fresh, sought = self._fresh, self._sought()

        def curves(at: FloatArray, sizes: Sequence[int], slopes: bool) -> list[Any]:
            loop, ends = fresh(at, slopes), np.cumsum([0, *sizes])
            return [
                self._padded(one.take(loop))[..., begin:end] if begin < end else None
                for one, (begin, end) in zip(sought, pairwise(ends), strict=True)
            ]

        def heights(at: FloatArray, sizes: Sequence[int]) -> list[FloatArray]:
            pieces = np.split(at, np.cumsum(sizes)[:-1])
            every = zip(sought, pieces, curves(at, sizes, False), strict=True)
            return [one.height(w, curve) if w.size else w for one, w, curve in every]

        found = together([one.search for one in sought], heights)
        places = [
            beside(at) if one.key[0] in (_AXIS, _CIRCLE) else at
            for one, at in zip(sought, found, strict=True)
        ]
        sizes = [at.size for at in places]
        if not sum(sizes):
            return {}
        there = curves(np.concatenate(places), sizes, self._point.slopes)
        every = zip(sought, found, there, strict=True)
        return {one.key: (at, curve) for one, at, curve in every if at.size}

    def _sought(self) -> list[_Sought]:
        """Return the places that limits ask for, of each curve."""
        omega, limits = self.omega, self._problem.limits
        found = []
        for i, (take, d) in enumerate(zip(self._takes(None), self.differences, strict=True)):
            gain = value_of(d) - 1.0
            if any(isinstance(limit, GainMargin | GainMarginDown) for limit in limits):
                search = crossings(omega, gain.imag, np.abs(gain) > _FAINT)
                found.append(_Sought((_AXIS, i), take, _height, search))
            if any(isinstance(limit, DelayMargin) for limit in limits):
                search = crossings(omega, np.abs(gain) - 1.0)
                found.append(_Sought((_CIRCLE, i), take, _excess, search))
        for limit in limits:
            if limit.followed is None:
                continue
            size, above = limit.followed
            curves = zip(self._takes(limit.channel), self._on_grid(limit.channel), strict=True)
            for i, (take, curve) in enumerate(curves):
                search = peaks(omega, size(omega, value_of(curve)), above)
                found.append(_Sought((limit.name, i), take, size, search))
        return found

    def _takes(self, channel: tuple[str, str] | None) -> list[Take]:
        """Return how to take the curves that a limit is on from a closed loop."""
        sides = range(len(self._margins))
        if channel is not None:
            return [partial(_response, k, channel) for k in sides]
        inputs = range(len(self._problem.plant.inputs))
        return [partial(_difference, k, i) for k in sides for i in inputs]

    def _on_grid(self, channel: tuple[str, str] | None) -> list[Any]:
        """Return the curves that a limit is on at the margin frequencies."""
        if channel is None:
            return self.differences
        if channel not in self._responses:
            takes = self._takes(channel)
            self._responses[channel] = [self._padded(take(self._margins)) for take in takes]
        return self._responses[channel]

    def curves(self, limit: Limit) -> list[tuple[FloatArray, Any]]:
        """Return the curves that a limit is on, at the margin frequencies and at peaks between.

        See `synth.limits.Symbols`.
        """
        found = [(self.omega, curve) for curve in self._on_grid(limit.channel)]
        if self._fresh is not None:
            keys = [(limit.name, i) for i in range(len(found))]
            found += [self._followed[key] for key in keys if key in self._followed]
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
        steps = np.diag(SHIFT * np.maximum(np.abs(values), scales))
        slopes = []
        ends = [[(values + sign * step, known) for sign in (1.0, -1.0)] for step in steps]
        widths = [2.0 * step.sum() for step in steps]
        for unit in np.eye(len(known)):
            shifts = [1.0 + sign * SHIFT * unit for sign in (1.0, -1.0)]
            ends.append([(values, (np.array(known) * shift).tolist()) for shift in shifts])
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
        if self._fresh is None:
            return None
        found = []
        for i, d in enumerate(self.differences):
            ends = (d - 1.0)[..., [0, -1]]
            own = [real(ends)[..., level_ends(value_of(d) - 1.0)]]
            if (_AXIS, i) in self._followed:
                loop, rate = _moving(*self._followed[_AXIS, i])
                own.insert(0, real(loop) - imag(loop) * (rate.real / rate.imag))
            found += [on[..., value_of(on) < 0.0] for on in own]
        return joined(found)

    @cached_property
    def turning_delays(self) -> Any | None:
        """Delay at each crossover of all loops that turns L to -1 [s], (c,); None on a grid."""
        if self._fresh is None:
            return None
        found: list[Any] = [self.differences[0][..., :0]]
        for i in range(len(self.differences)):
            if (_CIRCLE, i) not in self._followed:
                continue
            at = self._followed[_CIRCLE, i][0]
            loop, rate = _moving(*self._followed[_CIRCLE, i])
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
    def _moments(self) -> Any:
        """Spectral moments m_0 and m_2 of every output, (z, ..., 2)."""
        return self._padded(self._cost.moments(self._cost.outputs, self._weights, _ORDERS))

    def moment(self, output: str, order: int) -> Any:
        """Return the spectral moment m_order of `output`, (1,), or by combination of signs."""
        row, at = self._cost.outputs.index(output), _ORDERS.index(order)
        found, every = slice(at, at + 1), self._moments
        if isinstance(every, Dual):
            moment: Any = Dual(every.value[row, found], every.slope[:, row, found])
        else:
            moment = every[row, ..., found]
        if self._signs is not None:
            # A programme's logarithms want it above zero, where error and motion cancel.
            moment = at_least(moment + self._crossed(output, output, order), _STILL)
        return moment if self._amplitude is None else moment * self._amplitude

    def covariance(self, one: str, other: str) -> Any:
        """Return the covariance of two outputs, (1,), or by combination of signs."""
        parts = [
            real(conj(self._shown(one, d.name)) * self._shown(other, d.name)) @ weights[:, None]
            for d, weights in zip(self._problem.disturbances, self._weights, strict=False)
        ]
        total = sum(parts[1:], parts[0])
        if self._signs is not None:
            total = total + self._crossed(one, other, 0)
        return total if self._amplitude is None else total * self._amplitude

    @cached_property
    def signed(self) -> LoopNumbers:
        """The numbers by combination of the signs that sensors' errors may have; or themselves.

        Its moments are those of each combination, (c,), where its own are the mean over all.
        """
        if self._coherent is None:
            return self
        _ = self._moments, self._shares  # once for both
        own = copy(self)
        own._signs, own._peaks = np.array(self._coherent.signs), {}
        return own

    @cached_property
    def _coherent(self) -> CoherentError | None:
        return CoherentError.among(self._problem.disturbances)

    @cached_property
    def _shares(self) -> ComplexArray:
        """Weights of the products of source and error, (k, orders times errors)."""
        assert self._coherent is not None
        omega = self._cost.omega
        shares = self._coherent.shares(omega) * self._weights[self._coherent.source]
        return np.concatenate([shares * omega**order for order in _ORDERS]).T

    def _crossed(self, one: str, other: str, order: int) -> Any:
        """Return what the error's signs add to an integral of conj(F) F of two outputs, (c,)."""
        pair, signs = self._coherent, self._signs
        assert pair is not None
        assert signs is not None
        if (one, other) not in self._crosses:
            source, error = (self._problem.disturbances[i].name for i in (pair.source, pair.error))
            product = conj(self._shown(one, source)) * self._shown(other, error)
            if one == other:
                product = product * 2.0
            else:
                product = product + conj(self._shown(other, source)) * self._shown(one, error)
            self._crosses[one, other] = real(product @ self._shares)
        errors, at = signs.shape[1], _ORDERS.index(order)
        return self._crosses[one, other][..., at * errors : (at + 1) * errors] @ signs.T

    def _shown(self, output: str, source: str) -> Any:
        """Return a response on the quadrature nodes, (k,)."""
        if (output, source) not in self._shaken:
            self._shaken[output, source] = self._padded(self._cost.response(output, source))
        return self._shaken[output, source]

    def peak(self, output: str, duration: float) -> Any:
        """Return the most probable maximum of `output` in `duration` [s], as its moments are."""
        if (output, duration) not in self._peaks:
            m0, m2 = self.moment(output, 0), self.moment(output, 2)
            cycles = sqrt(m2 / m0) * (duration / (2.0 * np.pi))
            factor = sqrt(log(at_least(cycles, _LEAST_CYCLES)) * 2.0)
            self._peaks[output, duration] = factor * sqrt(m0)
        return self._peaks[output, duration]

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
            total += weight * self._cost.curvature(name, self._weights)
            row = self._cost.outputs.index(name)
            variance += weight * float(value_of(self._moments)[row, 0])
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


def _response(side: int, channel: tuple[str, str], loops: Sequence[LoopResponses]) -> Any:
    return loops[side].response(*channel)


def _difference(side: int, index: int, loops: Sequence[LoopResponses]) -> Any:
    return loops[side].difference(index)


def _counted(poles: ComplexArray, models: ComplexArray) -> tuple[BoolArray, BoolArray]:
    """Return which poles count for damping and for frequency, one of each conjugate pair."""
    swinging, own = counted_poles(poles, models)
    # Of a pair of which the delay models took one the other counts, whichever it is.
    below = poles.imag < 0.0
    for counted in (swinging, own):
        mates = np.isclose(poles[:, None], poles[counted & ~below].conj(), rtol=1e-9, atol=0.0)
        counted &= ~(below & mates.any(axis=1))
    return swinging, own


def _moving(omega: FloatArray, beside_it: Any) -> tuple[Any, ComplexArray]:
    """Return L at frequencies [rad/s], and dL/d omega by central differences, (k,) each.

    From 1 + L a hair above and a hair below, (2 k,); see `places.beside`.
    """
    above, below = beside_it[..., : omega.size], beside_it[..., omega.size :]
    rate = (value_of(above) - value_of(below)) / (2.0 * SHIFT * omega)
    return (above + below) * 0.5 - 1.0, np.asarray(rate)


def _height(_: FloatArray, difference: Any) -> FloatArray:
    """Return Im L, (k,)."""
    return np.asarray(difference.imag)


def _excess(_: FloatArray, difference: Any) -> FloatArray:
    """Return |L| - 1, (k,)."""
    return np.asarray(np.abs(difference - 1.0) - 1.0)
