"""A chart as SVG text: a frame with axes, and curves on it.

The colours are classes that `page.css` fills, for light and for dark; a browser scales the chart to
its place, and nothing in it scrolls.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray

WIDTH, HEIGHT = 460.0, 270.0  #: Of every chart, in its own units.
_LEFT, _RIGHT, _TOP, _BOTTOM = 50.0, 14.0, 24.0, 38.0
_FAR = 4.0  # how many frames beyond its edge a point is still drawn


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One axis: what it shows, its ends, and whether it is logarithmic."""

    label: str
    low: float
    high: float
    log: bool = False
    ticks: tuple[float, ...] | None = None

    def share(self, values: npt.ArrayLike) -> FloatArray:
        """Return where values lie between the ends, 0 to 1; far outside is cut off."""
        found = np.asarray(values, dtype=np.float64)
        low, high = self.low, self.high
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.log10(found)
            low, high = math.log10(low), math.log10(high)
        share = (found - low) / (high - low)
        return np.clip(np.nan_to_num(share, nan=-_FAR, posinf=_FAR, neginf=-_FAR), -_FAR, _FAR)

    def marks(self) -> tuple[float, ...]:
        """Return round values for marks."""
        if self.ticks is not None:
            return self.ticks
        return _log_marks(self.low, self.high) if self.log else _round_marks(self.low, self.high)


@dataclass(frozen=True, kw_only=True)
class Chart:
    """The frame of a chart, to which pieces of SVG are added."""

    x: Axis
    y: Axis
    about: str  #: What it shows, for those who hear the page.

    def points(self, x: npt.ArrayLike, y: npt.ArrayLike) -> FloatArray:
        """Return places in the chart (k, 2)."""
        wide, high = WIDTH - _LEFT - _RIGHT, HEIGHT - _TOP - _BOTTOM
        across = _LEFT + wide * self.x.share(x)
        up = _TOP + high * (1.0 - self.y.share(y))
        return np.stack(np.broadcast_arrays(across, up), axis=-1)

    def line(self, x: npt.ArrayLike, y: npt.ArrayLike, look: str) -> str:
        """Return a curve; `look` are its classes."""
        return f'<polyline class="line {look}" points="{_listed(self.points(x, y))}"/>'

    def area(self, x: FloatArray, y: FloatArray, look: str) -> str:
        """Return what is between a curve and the bottom."""
        ends = np.array([self.y.low, self.y.low])
        over = self.points(
            np.concatenate([x, x[[-1, 0]]]), np.concatenate([np.maximum(y, self.y.low), ends])
        )
        return f'<polygon class="area {look}" points="{_listed(over)}"/>'

    def band(self, low: float, high: float, look: str) -> str:
        """Return an upright band between two values of x."""
        (left, _), (right, _) = self.points([low, high], self.y.low)
        left, right = max(left, _LEFT), min(right, WIDTH - _RIGHT)
        tall = HEIGHT - _TOP - _BOTTOM
        return (
            f'<rect class="area {look}" x="{left:.1f}" y="{_TOP:g}" '
            f'width="{max(right - left, 0.0):.1f}" height="{tall:g}"/>'
        )

    def dot(self, x: float, y: float, look: str, radius: float = 4.5) -> str:
        """Return a point."""
        across, up = self.points(x, y)
        return f'<circle class="dot {look}" cx="{across:.1f}" cy="{up:.1f}" r="{radius:g}"/>'

    def circle(self, x: float, y: float, radius: float, look: str) -> str:
        """Return a circle in the units of x and y, which have to be alike."""
        (left, up), (right, _) = self.points([x - radius, x + radius], [y, y])
        cx, r = 0.5 * (left + right), 0.5 * (right - left)
        return f'<circle class="{look}" cx="{cx:.1f}" cy="{up:.1f}" r="{r:.1f}"/>'

    def drawn(self, *pieces: str) -> str:
        """Return the chart with pieces on it, whatever lies outside its frame cut off."""
        right, bottom = WIDTH - _RIGHT, HEIGHT - _BOTTOM
        parts = [
            f'<svg class="chart" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" '
            f'aria-label="{html.escape(self.about)}">'
        ]
        for value in self.x.marks():
            (across, _) = self.points(value, self.y.low)
            parts.append(f'<path class="grid" d="M{across:.1f} {_TOP:g}V{bottom:g}"/>')
            parts.append(
                f'<text class="tick" x="{across:.1f}" y="{bottom + 15:g}" '
                f'text-anchor="middle">{_number(value)}</text>'
            )
        for value in self.y.marks():
            (_, up) = self.points(self.x.low, value)
            parts.append(f'<path class="grid" d="M{_LEFT:g} {up:.1f}H{right:g}"/>')
            parts.append(
                f'<text class="tick" x="{_LEFT - 6:g}" y="{up + 4:.1f}" '
                f'text-anchor="end">{_number(value)}</text>'
            )
        parts.append(
            f'<svg x="{_LEFT:g}" y="{_TOP:g}" width="{right - _LEFT:g}" height="{bottom - _TOP:g}" '
            f'viewBox="{_LEFT:g} {_TOP:g} {right - _LEFT:g} {bottom - _TOP:g}" overflow="hidden">'
        )
        parts += pieces
        parts.append("</svg>")
        parts.append(f'<path class="axis" d="M{_LEFT:g} {_TOP:g}V{bottom:g}H{right:g}"/>')
        parts.append(f'<text class="label" x="{_LEFT:g}" y="14">{html.escape(self.y.label)}</text>')
        parts.append(
            f'<text class="label" x="{right:g}" y="{HEIGHT - 5:g}" text-anchor="end">'
            f"{html.escape(self.x.label)}</text></svg>"
        )
        return "".join(parts)


def _listed(points: FloatArray) -> str:
    """Return points as SVG lists them, each tenth of a unit once."""
    rounded = np.round(points, 1)
    keep = np.ones(len(rounded), dtype=np.bool_)
    keep[1:] = np.any(rounded[1:] != rounded[:-1], axis=1)
    return " ".join(f"{x:g},{y:g}" for x, y in rounded[keep].tolist())


def _number(value: float) -> str:
    return f"{value:.6g}".replace("e-0", "e-").replace("-", "\u2212")


def _round_marks(low: float, high: float, most: int = 6) -> tuple[float, ...]:
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(k for k in (1.0, 2.0, 2.5, 5.0, 10.0) if rough <= k * power * 1.0001)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return tuple(round(k * step, 10) for k in range(first, last + 1))


def _log_marks(low: float, high: float) -> tuple[float, ...]:
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    decades = last - first
    heads: Sequence[float] = (1.0,) if decades > 3 else (1.0, 2.0, 5.0)
    stride = max(1, -(-decades // 7))
    marks = [head * 10.0**k for k in range(first, last + 1, stride) for head in heads]
    return tuple(float(f"{m:.3g}") for m in marks if low * 0.999 <= m <= high * 1.001)
