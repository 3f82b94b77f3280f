"""Limits on what gain and delay may change by until a loop is unstable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from typing_extensions import override

from models.basics import check_range

from ..loop import imag, joined, log, real, sqrt, squared, value_of, where
from .limits import Limit, Symbols

if TYPE_CHECKING:
    from ..loop import Assessment

_RATIO = 1.4  # of the ends of one disc's diameter, where few discs do
_MOST_DISCS = 12
_FAR = 1e3  # a loop gain beyond which a gain margin of zero asks for nothing
_OVERLAP = 0.2  # of neighbouring discs, in their widths
_THICK = 0.03  # half the width of the band about the arc that a delay margin forbids
_TINY = 1e-12


@dataclass(frozen=True, kw_only=True)
class GainMargin(Limit):
    """The loop gain may grow by the factor `bound` before the loop is unstable."""

    name: str = "gain_margin_up"
    at_least: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_range("GainMargin", "bound", self.bound, low=1.0, open_low=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        if symbols.on_axis is not None:
            # Where L crosses the axis short of -1: what the gain may grow by there.
            within = value_of(symbols.on_axis) > -1.0
            return log(-symbols.on_axis[within] * bound)
        # The curve keeps off the segment [-1, -1/bound] of the real axis.
        reach = symbols.module_margin
        ratio = self.bound * (1.0 - reach)
        return _off_segment(symbols, 1.0 - reach, 1.0 / bound, ratio)

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.margins.gain


@dataclass(frozen=True, kw_only=True)
class GainMarginDown(Limit):
    """The loop gain may fall to the factor `bound` (below 1) before the loop is unstable.

    What a conditionally stable loop lacks: saturation lowers the effective gain and drives
    it into a limit cycle.
    """

    name: str = "gain_margin_down"

    def __post_init__(self) -> None:
        check_range("GainMarginDown", "bound", self.bound, low=0.0, high=1.0, open_high=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        least = max(bound, 1.0 / _FAR)
        if symbols.on_axis is not None:
            beyond = value_of(symbols.on_axis) < -1.0
            return log(-1.0 / (symbols.on_axis[beyond] * least))
        # The curve keeps off the segment [-1/bound, -1] of the real axis.
        far = 1.0 / least
        reach = symbols.module_margin
        ratio = 1.0 / (max(self.bound, 1.0 / _FAR) * (1.0 + reach))
        return _off_segment(symbols, 1.0 + reach, far, ratio)

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.margins.gain_down


@dataclass(frozen=True, kw_only=True)
class DelayMargin(Limit):
    """The loop stays stable for any further delay up to `bound` [s]."""

    name: str = "delay_margin"
    unit: str = "s"
    at_least: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_range("DelayMargin", "bound", self.bound, low=0.0, unit="s", open_low=True)

    @override
    def rows(self, symbols: Symbols, bound: Any) -> Any:
        if symbols.turning_delays is not None:
            return log(bound / symbols.turning_delays)
        # A delay tau turns L by omega tau: L keeps off the arc of the unit circle that such a
        # turn carries to -1.  The disc of a limit on the sensitivity covers the arc's first part.
        covered = 2.0 * np.arcsin(0.5 * symbols.module_margin)
        at = np.flatnonzero(symbols.omega * self.bound > covered)
        turn = np.minimum(symbols.omega[at] * bound, 2.0 * np.pi)
        # Half as thick as wide where it is short, and its round end where the arc ends.
        width = np.maximum(turn - covered, 0.0)
        thick = np.minimum(_THICK, 0.25 * width)
        half = 0.5 * width - thick
        middle = np.pi + covered + 0.5 * width
        rows = []
        for d in symbols.differences:
            re, im = real(d[..., at] - 1.0), imag(d[..., at])
            along = re * np.cos(middle) + im * np.sin(middle)
            across = im * np.cos(middle) - re * np.sin(middle)
            beside = np.arctan2(np.abs(value_of(across)), value_of(along)) < half
            radial = squared(sqrt(along * along + across * across + _TINY) - 1.0)
            # Across counts by its size: the round end is the same on both sides of the arc.
            outside = where(value_of(across) < 0.0, -across, across) - np.sin(half)
            to_end = squared(along - np.cos(half)) + squared(outside)
            rows.append(log((thick**2 + _TINY) / (where(beside, radial, to_end) + _TINY)))
        return joined(rows)

    @override
    def measure(self, loop: Assessment) -> float:
        return loop.margins.delay


def _off_segment(symbols: Symbols, start: Any, end: Any, ratio: float) -> Any:
    """Return rows that keep every loop off the real axis from -start to -end.

    By a chain of overlapping discs centred on the axis: the end is exact, and unlike the
    segment itself they are wide enough for nodes to see.  `ratio`, above one, is that of the
    two ends in numbers; where it is not, the disc of a limit on the sensitivity covers all.
    """
    if ratio <= 1.0:
        return real(symbols.differences[0][..., :0])
    count = min(_MOST_DISCS, max(1, int(np.ceil(np.log(ratio) / np.log(_RATIO)))))
    rows = []
    for k in range(count):
        first = start * (end / start) ** (k / count)
        last = start * (end / start) ** ((k + 1) / count)
        first = first - _OVERLAP * (last - first)  # into the disc before
        centre, radius = -0.5 * (first + last), 0.5 * (last - first)
        rows += [_off_disc(d - 1.0, centre, radius) for d in symbols.differences]
    return joined(rows)


def _off_disc(point: Any, centre: float, radius: float) -> Any:
    """Return a row that keeps `point` out of a disc; the logarithm bounds its slope far away."""
    return log((radius**2 + _TINY) / (squared(point - centre) + _TINY))
