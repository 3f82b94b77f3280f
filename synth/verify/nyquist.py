r"""Stability margins read off a traced Nyquist curve, root by root.

The second opinion to `synth.loop.margins`: the curve is followed with points as close as its phase
asks for (`synth.verify.winding.trace`), and every crossing and every peak between them is then
closed in on, by cutting what holds it into even pieces again and again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, SolverError

from .winding import Function, axis_clusters, lively, trace

_FLOOR = 5e-5  # |L| below which the curve's phase is not followed, for no check asks for 1e-4
_VALLEYS = 6  # local extrema that are solved for, the most extreme first
_PIECES = np.linspace(0.0, 1.0, 33)  # that an interval is cut into ...
_CUTS = 5  # ... so many times, before the last straight line
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
    """The curve 1 + L(i omega) from `low` to `high` [rad/s].

    `difference` is 1 + L as a function of s [1/s]; `marks` are poles [1/s] near which it turns
    quickly.

    Raises SolverError if its phase cannot be followed.
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
        crossings = self._roots(_log_gain, self._changes(np.log(self._sizes)))
        turns = np.angle(1.0 - self._at(crossings))  # beyond -180 deg
        delays = turns % (2.0 * np.pi) / np.exp(crossings)
        real = self._real_crossings()
        return CurveMargins(
            max_sensitivity=1.0 / self._least(np.abs),
            gain=min((-1.0 / x for x in real if -1.0 < x < 0.0), default=np.inf),
            gain_down=max((-1.0 / x for x in real if x < -1.0), default=0.0),
            phase=float(np.abs(turns).min(initial=np.inf)),
            delay=float(delays.min(initial=np.inf)),
            # 1/max|S - 1/2|, S = 1/(1 + L)
            disk=self._least(lambda d: 2.0 * np.abs(d) / np.maximum(np.abs(2.0 - d), 1e-300)),
        )

    @property
    def _sizes(self) -> FloatArray:
        return np.maximum(np.abs(self.values - 1.0), 1e-300)

    def _at(self, t: FloatArray) -> ComplexArray:
        """Return 1 + L at logarithms of frequencies, of any shape."""
        found = self._difference(np.asarray(1j * np.exp(t.ravel()), dtype=np.complex128))
        return np.asarray(found.reshape(t.shape))

    def _roots(
        self, function: Callable[[ComplexArray], FloatArray], index: npt.NDArray[np.intp]
    ) -> FloatArray:
        """Return the roots of a function of 1 + L between points `index` and the next."""
        low, high = self.t[index], self.t[index + 1]
        rows = np.arange(index.size)
        for _ in range(_CUTS if index.size else 0):
            t = low[:, None] + (high - low)[:, None] * _PIECES
            values = function(self._at(t))
            changed = (values[:, 1:] < 0.0) != (values[:, :-1] < 0.0)
            # Where the sign hangs on rounding the first piece is as good as any.
            k = np.argmax(changed, axis=1)
            low, high = t[rows, k], t[rows, k + 1]
            ends = values[rows, k], values[rows, k + 1]
        if not index.size:
            return low
        rise = ends[1] - ends[0]
        share = np.where(rise == 0.0, 0.0, -ends[0] / np.where(rise == 0.0, 1.0, rise))
        return np.asarray(low + np.clip(share, 0.0, 1.0) * (high - low))

    @staticmethod
    def _changes(values: FloatArray) -> npt.NDArray[np.intp]:
        return np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))

    def _least(self, measure: Callable[[ComplexArray], FloatArray]) -> float:
        """Return the least value of a measure of 1 + L along the curve."""
        values = np.asarray(measure(self.values), dtype=np.float64)
        return _least(lambda t: measure(self._at(t)), self.t, values, 1.5)

    def _real_crossings(self) -> list[float]:
        """Return the values of L where it meets the real axis, its ends there included."""
        loop = self.values - 1.0
        change = self._changes(loop.imag)
        change = change[np.maximum(np.abs(loop[change]), np.abs(loop[change + 1])) > _FLOOR]
        # The curve turns by little between points: right of zero at both, right of it between.
        change = change[np.minimum(loop[change].real, loop[change + 1].real) < 0.0]
        roots = self._roots(lambda d: np.asarray(d.imag), change)
        found = [float(value) for value in self._at(roots).real - 1.0]
        # A finite gain at rest begins on the axis, a direct path ends there.
        return found + [float(end.real) for end in loop[[0, -1]] if abs(end.imag) < 1e-3 * abs(end)]

    def _add_hidden_crossings(self) -> None:
        """Add the points where |L| just reaches one between two points that do not show it."""
        level = np.log(self._sizes)
        inner, left, right = level[1:-1], level[:-2], level[2:]
        near = np.abs(inner) < _SEEN
        tops = near & (inner < 0.0) & (inner >= left) & (inner >= right)
        dips = near & (inner > 0.0) & (inner <= left) & (inner <= right)
        at = np.flatnonzero(tops | dips) + 1
        if not at.size:
            return
        sign = np.sign(level[at])[:, None]
        added, found = _valleys(
            lambda t: sign * _log_gain(self._at(t)), self.t[at - 1], self.t[at + 1]
        )
        added = added[found < 0.0]
        t = np.concatenate([self.t, added])
        values = np.concatenate([self.values, self._at(added)])
        order = np.argsort(t)
        self.t, self.values = t[order], values[order]


def _log_gain(difference: ComplexArray) -> FloatArray:
    return np.asarray(np.log(np.maximum(np.abs(difference - 1.0), 1e-300)))


def curve_margins(difference: Function, marks: ComplexArray) -> CurveMargins:
    """Return the margins of a loop with 1 + L and marks as in `Curve`.

    From 1e-4 rad/s, or a hundredth of the slowest mark, to a hundred times the fastest one; in
    pieces between the undamped poles of the open loop, where the curve goes through infinity.

    Raises SolverError if its phase cannot be followed.
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
        lambda x: -function(np.exp(x.ravel())).reshape(x.shape), t, -function(np.exp(t)), 0.7
    )


def _least(
    function: Callable[[FloatArray], FloatArray], t: FloatArray, values: FloatArray, share: float
) -> float:
    """Return the least value of a function, known on points, from its valleys.

    Those are gone into whose floor is at most `share` of the lowest.
    """
    best = float(values.min())
    valley = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    valley = valley[values[valley] < share * best]
    valley = valley[np.argsort(values[valley])][:_VALLEYS]
    found = _valleys(function, t[valley - 1], t[valley + 1])[1]
    return float(found.min(initial=best))


def _valleys(
    function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where functions are least between two points each, and how small, (v,) each.

    The function takes a row of points for each, (v, n).
    """
    rows, place, least = np.arange(low.size), low, np.full(low.size, np.inf)
    for _ in range(_CUTS if low.size else 0):
        t = low[:, None] + (high - low)[:, None] * _PIECES
        values = function(t)
        k = np.argmin(values, axis=1)
        place, least = t[rows, k], values[rows, k]
        low, high = t[rows, np.maximum(k - 1, 0)], t[rows, np.minimum(k + 1, _PIECES.size - 1)]
    return place, least
