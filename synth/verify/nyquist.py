r"""Stability margins read off a traced Nyquist curve, root by root.

The second opinion to `synth.loop.margins`: the curve is followed with points as close as its phase
asks for (`synth.verify.winding.trace`), and every crossing and every peak between them is then
solved for on its own, by Brent's methods.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, minimize_scalar

from models.basics import ComplexArray, FloatArray, SolverError

from .winding import Function, axis_clusters, lively, trace

_FLOOR = 5e-5  # |L| below which the curve's phase is not followed, for no check asks for 1e-4
_VALLEYS = 6  # local extrema that are solved for, the most extreme first
_SEEN = 0.5  # |log|L|| at an extremum that might still hide a crossing


@dataclass(frozen=True, kw_only=True)
class CurveMargins:
    """Margins of a stable loop, as in `synth.loop.margins.Margins` (phase [rad], delay [s])."""

    max_sensitivity: float
    gain: float
    gain_down: float
    phase: float
    delay: float
    disk: float

    def worse(self, other: CurveMargins) -> CurveMargins:
        """Return the worse of each figure."""
        return CurveMargins(
            max_sensitivity=max(self.max_sensitivity, other.max_sensitivity),
            gain=min(self.gain, other.gain),
            gain_down=max(self.gain_down, other.gain_down),
            phase=min(self.phase, other.phase),
            delay=min(self.delay, other.delay),
            disk=min(self.disk, other.disk),
        )


class Curve:
    """The curve 1 + L(i omega) from `low` to `high`.

    Parameters
    ----------
    difference
        1 + L as a function of s [1/s].
    marks
        Poles [1/s] near which it turns quickly.
    low, high
        Ends [rad/s].

    Raises
    ------
    SolverError
        If its phase cannot be followed.
    """

    def __init__(self, difference: Function, marks: ComplexArray, low: float, high: float) -> None:
        self._difference = difference
        start = np.log(lively(low, high, marks))
        try:
            found = trace(difference, lambda t: 1j * np.exp(t), start, loop_floor=_FLOOR)
        except SolverError as error:
            raise SolverError(f"verification: the Nyquist curve: {error}") from error
        self.t, self.values = found
        self._add_hidden_crossings()

    @property
    def margins(self) -> CurveMargins:
        """All margins of the loop."""
        crossings = [self._root(self._log_gain, i) for i in self._changes(np.log(self._sizes))]
        turns = [float(np.angle(1.0 - self._at(t))) for t in crossings]  # beyond -180 deg
        delays = [
            turn % (2.0 * np.pi) / float(np.exp(t))
            for turn, t in zip(turns, crossings, strict=True)
        ]
        real = self._real_crossings()
        return CurveMargins(
            max_sensitivity=1.0 / self._least(np.abs),
            gain=min((-1.0 / x for x in real if -1.0 < x < 0.0), default=np.inf),
            gain_down=max((-1.0 / x for x in real if x < -1.0), default=0.0),
            phase=min((abs(turn) for turn in turns), default=np.inf),
            delay=min(delays, default=np.inf),
            # 1/max|S - 1/2|, S = 1/(1 + L)
            disk=self._least(lambda d: 2.0 * np.abs(d) / np.maximum(np.abs(2.0 - d), 1e-300)),
        )

    @property
    def _sizes(self) -> FloatArray:
        return np.maximum(np.abs(self.values - 1.0), 1e-300)

    def _at(self, t: float) -> complex:
        return complex(self._difference(np.array([1j * np.exp(t)]))[0])

    def _log_gain(self, t: float) -> float:
        return float(np.log(max(abs(self._at(t) - 1.0), 1e-300)))

    def _root(self, function: Callable[[float], float], index: int) -> float:
        """Return the root between point `index` and the next."""
        low, high = float(self.t[index]), float(self.t[index + 1])
        first, last = function(low), function(high)
        if (first < 0.0) == (last < 0.0):
            return low  # the sign hangs on rounding: the point itself is the root
        return float(brentq(function, low, high, xtol=1e-13, rtol=1e-13))

    @staticmethod
    def _changes(values: FloatArray) -> npt.NDArray[np.intp]:
        return np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))

    def _least(self, measure: Callable[[ComplexArray], FloatArray]) -> float:
        """Return the least value of a measure of 1 + L along the curve."""
        return _least(
            lambda t: float(measure(np.array([self._at(t)]))[0]),
            self.t,
            np.asarray(measure(self.values), dtype=np.float64),
            1.5,
        )

    def _real_crossings(self) -> list[float]:
        """Return the values of L where it meets the real axis, its ends there included."""
        loop = self.values - 1.0
        change = self._changes(loop.imag)
        change = change[np.maximum(np.abs(loop[change]), np.abs(loop[change + 1])) > _FLOOR]
        # The curve turns by little between points: right of zero at both, right of it between.
        change = change[np.minimum(loop[change].real, loop[change + 1].real) < 0.0]
        roots = [self._root(lambda t: self._at(t).imag, int(i)) for i in change]
        found = [self._at(t).real - 1.0 for t in roots]
        # A finite gain at rest begins on the axis, a direct path ends there.
        return found + [float(end.real) for end in loop[[0, -1]] if abs(end.imag) < 1e-3 * abs(end)]

    def _add_hidden_crossings(self) -> None:
        """Add the points where |L| just reaches one between two points that do not show it."""
        level = np.log(self._sizes)
        inner, left, right = level[1:-1], level[:-2], level[2:]
        near = np.abs(inner) < _SEEN
        tops = near & (inner < 0.0) & (inner >= left) & (inner >= right)
        dips = near & (inner > 0.0) & (inner <= left) & (inner <= right)
        added = []
        for i in np.flatnonzero(tops | dips) + 1:
            sign = np.sign(level[i])
            found = minimize_scalar(
                lambda t, sign=sign: float(sign * self._log_gain(t)),
                bounds=(self.t[i - 1], self.t[i + 1]),
                method="bounded",
                options={"xatol": 1e-8},
            )
            if found.fun < 0.0:
                added.append(float(found.x))
        if added:
            t = np.concatenate([self.t, added])
            values = np.concatenate([self.values, [self._at(x) for x in added]])
            order = np.argsort(t)
            self.t, self.values = t[order], values[order]


def curve_margins(difference: Function, marks: ComplexArray) -> CurveMargins:
    """Return the margins of a loop with 1 + L and marks as in `Curve`.

    From 1e-4 rad/s, or a hundredth of the slowest mark, to a hundred times the fastest one; in
    pieces between the undamped poles of the open loop, where the curve goes through infinity.

    Raises
    ------
    SolverError
        If its phase cannot be followed.
    """
    sizes = np.abs(marks)
    sizes = sizes[sizes > 1e-9 * sizes.max(initial=0.0)]
    ends = [min(1e-4, 0.01 * float(sizes.min(initial=1.0)))]
    for at, size, _ in axis_clusters(marks):
        ends += [at - size, at + size]
    ends.append(100.0 * float(sizes.max(initial=1.0)))
    pieces = [
        Curve(difference, marks, low, high).margins
        for low, high in zip(ends[::2], ends[1::2], strict=True)
    ]
    return reduce(CurveMargins.worse, pieces)


def largest(
    function: Callable[[FloatArray], FloatArray], low: float, high: float, marks: ComplexArray
) -> float:
    """Return the largest value of a real function of omega between `low` and `high` [rad/s]."""
    t = np.log(lively(low, high, marks, per_decade=100))
    return -_least(
        lambda x: -float(function(np.array([np.exp(x)]))[0]), t, -function(np.exp(t)), 0.7
    )


def _least(
    function: Callable[[float], float], t: FloatArray, values: FloatArray, share: float
) -> float:
    """Return the least value of a function, known on points, from its valleys.

    Those are solved for whose floor is at most `share` of the lowest.
    """
    best = float(values.min())
    valley = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    valley = valley[values[valley] < share * best]
    for i in valley[np.argsort(values[valley])][:_VALLEYS]:
        found = minimize_scalar(
            function, bounds=(t[i - 1], t[i + 1]), method="bounded", options={"xatol": 1e-10}
        )
        best = min(best, float(found.fun))
    return best
