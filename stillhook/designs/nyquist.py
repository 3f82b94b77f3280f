"""The Nyquist figure: how far the loop stays from -1.

A loop through an integrator is huge at low frequency and small at high: what matters is near
-1, so the figure shows that neighbourhood and says what lies outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, InputError
from synth.design import GainDesign

from ..text import (
    AFTER,
    BROKEN,
    DASHED,
    REFERENCE,
    annotate,
    drawn,
    headline,
    number,
    panel,
)
from .summary import about_of, has_gains

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LoopGain = Callable[[FloatArray], ComplexArray]

_HALF = 2.0  # half the window's width, in the unit of L
_WIDEST = 4.0  # the same where a crossing beyond -1 should be seen
_STEP = 0.012  # longest straight piece of a curve that looks smooth, of the window
_MOST = 20_000  # points


@dataclass(frozen=True, kw_only=True)
class PlaneWindow:
    """The part of the plane that is shown: real part from `left` to `right`, |imag| to `high`."""

    left: float
    right: float
    high: float

    @property
    def width(self) -> float:
        """Its width."""
        return self.right - self.left

    def holds(self, gain: ComplexArray) -> npt.NDArray[np.bool_]:
        """Return which points lie inside."""
        inside = (gain.real > self.left) & (gain.real < self.right) & (abs(gain.imag) < self.high)
        return np.asarray(inside)


@drawn
def nyquist(design: GainDesign) -> Figure:
    """Return the Nyquist curve of the loop gain L with the circle of M_s around -1.

    Parameters
    ----------
    design
        The design; its loop may be unstable.

    Returns
    -------
    matplotlib.figure.Figure
        Real against imaginary part of L(i omega) near -1; the loop is broken at the command.

    Raises
    ------
    InputError
        If all gains are zero: there is no loop.
    """
    if not has_gains(design):
        raise InputError("nyquist: all gains are zero, so there is no loop")
    window = _window(design)
    gain = _smooth(design.assessment.loop_gain, design.assessment.grid, window)
    figure, axes = panel(6.4, 5.7)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(turn), np.sin(turn), color="#999999", linewidth=0.9, label="|L| = 1")
    _circles(design, axes)
    axes.plot(gain.real, gain.imag, color=AFTER, label="L(iω), ω > 0")
    axes.plot(
        gain.real,
        -gain.imag,
        color=AFTER,
        linewidth=0.9,
        linestyle=DASHED,
        alpha=0.7,
        label="ω < 0",
    )
    axes.plot(-1.0, 0.0, "+", color=REFERENCE, markersize=13, markeredgewidth=2.0)
    _arrows(axes, gain, window)
    _remarks(design, axes, window)
    axes.set_xlim(window.left, window.right)
    axes.set_ylim(-window.high, window.high)
    axes.set_aspect("equal")
    axes.set_xlabel("real part of L [-]")
    axes.set_ylabel("imaginary part of L [-]")
    axes.legend(loc="best")
    return headline(figure, _finding(design), about_of(design))


def _finding(design: GainDesign) -> str:
    margins = design.margins
    if margins is None:
        return "The loop is unstable"
    text = f"L stays {number(1.0 / margins.max_sensitivity)} away from -1"
    if math.isfinite(margins.phase):
        text += f", phase margin {number(math.degrees(margins.phase))}°"
    return text


def _window(design: GainDesign) -> PlaneWindow:
    half = _HALF
    if design.margins is not None and design.margins.gain_down > 0.0:
        # A curve that crosses the axis beyond -1 is shown there, if that is not too far away.
        half = min(max(half, 0.65 / design.margins.gain_down), _WIDEST)
    left, right = -1.0 - half, half - 0.5
    return PlaneWindow(left=left, right=right, high=0.42 * (right - left))


def _smooth(loop: LoopGain, grid: FloatArray, window: PlaneWindow) -> ComplexArray:
    """Return the curve, close enough points within the window to look smooth."""
    omega, gain = grid, loop(grid)
    reach = 1.5 * window.width
    for _ in range(10):
        long = np.abs(np.diff(gain)) > _STEP * window.width
        near = np.minimum(np.abs(gain[1:] + 1.0), np.abs(gain[:-1] + 1.0)) < reach
        split = long & near
        if not split.any() or omega.size + split.sum() > _MOST:
            break
        middle = np.sqrt(omega[:-1][split] * omega[1:][split])
        places = np.flatnonzero(split) + 1
        gain = np.insert(gain, places, loop(middle))
        omega = np.insert(omega, places, middle)
    return gain


def _circles(design: GainDesign, axes: Axes) -> None:
    """Draw the circles that the curve may not and does not enter, 1/M_s around -1."""
    bound = design.case.limits.max_sensitivity
    turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 361))
    dots = (0, (1.5, 1.5))

    def draw(sensitivity: float, colour: str, label: str) -> None:
        ring = -1.0 + turn / sensitivity
        axes.plot(ring.real, ring.imag, color=colour, linewidth=1.3, linestyle=dots, label=label)

    peak = None if design.margins is None else design.margins.max_sensitivity
    if peak is not None and abs(peak / bound - 1.0) < 1e-3:
        draw(peak, AFTER, f"$M_s$ = {number(peak)}, at its limit")
        return
    draw(bound, "#777777", f"$M_s$ = {number(bound)}, the limit")
    if peak is not None:
        draw(peak, BROKEN if peak > bound else AFTER, f"$M_s$ = {number(peak)}")


def _arrows(axes: Axes, gain: ComplexArray, window: PlaneWindow) -> None:
    """Show which way the frequency grows, where the curve is in view."""
    inside = window.holds(gain)
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(gain)) * inside[1:])])
    for share in (0.2, 0.5, 0.8):
        at = int(np.searchsorted(path, share * path[-1]))
        if 0 < at < gain.size and inside[at]:
            axes.annotate(
                "",
                (gain[at].real, gain[at].imag),
                xytext=(gain[at - 1].real, gain[at - 1].imag),
                arrowprops={"arrowstyle": "-|>", "color": AFTER, "mutation_scale": 14.0},
            )


def _remarks(design: GainDesign, axes: Axes, window: PlaneWindow) -> None:
    margins = design.margins
    if margins is None:
        return
    nearest = complex(design.assessment.loop_gain(np.array([margins.peak]))[0])
    axes.plot(nearest.real, nearest.imag, "o", color=REFERENCE, markersize=4.5)
    side = 1.0 if nearest.imag >= 0.0 else -1.0
    text = f"closest at {number(margins.peak)} rad/s"
    annotate(axes, text, (nearest.real, nearest.imag), (-12.0, 58.0 * side))
    if margins.gain_down > 0.0 and -1.0 / margins.gain_down < window.left:
        axes.annotate(
            f"◂ the curve crosses the axis at {number(-1.0 / margins.gain_down)}",
            (window.left, 0.0),
            xytext=(6.0, 5.0),
            textcoords="offset points",
            fontsize=9.0,
        )
