"""The figures of a design: payload spectrum, responses, Nyquist curve, use of the limits.

Each function takes a `Design` and returns a matplotlib `Figure`; nothing is shown, saved or
kept.  Titles say what the figure found.  What an unstable loop does not have (a spectrum, a use
of limits) is left out.

The Nyquist figure says how far the loop stays from -1.  A loop through an integrator is huge at low
frequency and small at high: what matters is near -1, so the figure shows that neighbourhood and
says what lies outside.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.basics import ComplexArray, FloatArray, InputError, digits_apart
from synth.design import Design

from ..text import (
    AFTER,
    BEFORE,
    BROKEN,
    DASHED,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Bar,
    Figure,
    Table,
    annotate,
    decibels,
    drawn,
    headline,
    new_figure,
    number,
    panel,
    quantity,
    typeset,
)
from .motion import DRUM as DRUM_HAUL
from .motion import HOOK as HOOK_HEAVE
from .motion import PAYLOAD, MotionView, highest
from .summary import about_of, has_loop, limit_table

_WEIGHT = 0.999  # share of a variance that a spectrum's axis has to hold
_PERIODS = (20.0, 12.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5)  # marks on an axis [s]
_CUT = 2.0  # use of a limit at which its bar is cut off


@drawn
def payload_spectrum(design: Design) -> Figure:
    """Return the spectra of hook and payload, with the drum held and with the gains.

    Variance density [m^2 s/rad] on a logarithmic axis over frequency [rad/s].
    """
    view = MotionView(design)
    omega = view.frequencies
    curves = [
        ("hook", HOOK, view.hook.density(omega), view.hook.displacement.rms),
        ("payload, drum held", BEFORE, view.held_density(omega), design.payload_rms_before),
    ]
    for other in design.alternatives:
        if other.structure == "payload-feedback" and other.margins is not None:
            density = MotionView(other).payload_density(omega)
            curves.append((f"payload, {other.structure}", DRUM, density, other.payload_rms))
    if view.compensated:
        density = view.payload_density(omega)
        label = f"payload, {design.structure}" if design.alternatives else "payload, with the gains"
        curves.append((label, AFTER, density, design.payload_rms))
    right = max(2.0, 1.15 * max(_quantile(omega, density) for _, _, density, _ in curves))
    peaks = [float(density[np.isfinite(density)].max()) for _, _, density, _ in curves]
    bottom = max(1e-3 * min(peaks), 1e-10 * max(peaks))
    shown = omega <= right
    figure, axes = panel()
    for label, colour, density, rms in curves:
        heights = np.clip(density[shown], 1e-3 * bottom, None)
        text = f"{label}: {quantity(rms, 'm')} rms"
        axes.semilogy(omega[shown], heights, color=colour, label=text)
    if view.compensated:
        axes.fill_between(omega[shown], 1e-3 * bottom, heights, color=AFTER, alpha=0.12)
    axes.set_ylim(bottom, 3.0 * max(peaks))
    axes.set_xlim(0.0, right)
    axes.set_xlabel("frequency [rad/s]")
    axes.set_ylabel("variance density [m² s/rad]")
    _period_axis(axes, right)
    axes.legend(loc="upper right")
    return headline(figure, _spectrum_finding(design), about_of(design))


@drawn
def responses(design: Design) -> Figure:
    """Return |P/Z| with the drum held and with the gains, and |X/Z|.

    Two logarithmic axes, one above the other, over frequency [rad/s].
    """
    view = MotionView(design)
    low, high = _response_band(view)
    omega = view.frequencies
    omega = np.unique(np.concatenate([np.geomspace(low, high, 700), omega]))
    omega = omega[(omega >= low) & (omega <= high)]
    held = np.abs(view.held_response(omega))
    figure = new_figure(7.2, 6.2)
    if view.compensated:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        payload = np.abs(design.assessment.response(PAYLOAD, HOOK_HEAVE, omega))
        upper.loglog(omega, payload, color=AFTER, label="with the gains", zorder=3)
        _range(upper, np.concatenate([held, payload]), 2.0)
        drum = np.abs(design.assessment.response(DRUM_HAUL, HOOK_HEAVE, omega))
        lower.loglog(omega, drum, color=DRUM)
        _range(lower, drum, 4.0)
        _mark_peak(design, lower, low, high)
        _frame(view, lower, "drum over hook |X/Z| [m/m]")
    else:
        upper = lower = figure.add_subplot()
    upper.loglog(omega, held, color=BEFORE, label="drum held")
    _frame(view, upper, "payload over hook |P/Z| [m/m]")
    _slow_limit(design, upper, low)
    upper.set_xlim(low, high)
    upper.legend(loc="best")
    lower.set_xlabel("frequency [rad/s]   (shaded: 90 % of the hook's motion)")
    return headline(figure, _response_finding(view), about_of(design))


@drawn
def limits(design: Design) -> Figure:
    """Return the use of each limit as a bar, in percent; what the case only reports is hatched.

    Raises InputError if the design has no limits to show (an unstable loop).
    """
    table = limit_table(design)
    uses: list[Bar] = [row[3] for row in table.rows]
    if not uses:
        raise InputError("limits: the loop is unstable, so there is no use of limits")
    longest = min(max(1.1, *(1.02 * use.value for use in uses)), _CUT)
    figure, axes = panel(7.6, 1.5 + 0.36 * len(uses))
    for place, use in enumerate(uses):
        axes.barh(
            place,
            100.0 * min(use.value, longest),
            height=0.62,
            color=AFTER if use.kept else BROKEN,
            alpha=1.0 if use.enforced else 0.45,
            hatch=None if use.enforced else "///",
            edgecolor="white",
            linewidth=0.0,
        )
        _bar_text(axes, place, table, longest)
    axes.axvline(100.0, color=REFERENCE, linewidth=1.2)
    axes.set_yticks(range(len(uses)), [typeset(row[0]) for row in table.rows])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0 * longest)
    axes.grid(visible=False, axis="y")
    note = "" if all(use.enforced for use in uses) else "   (hatched: reported, not enforced)"
    axes.set_xlabel(f"use of the limit [%]{note}")
    return headline(figure, _limits_finding(table), about_of(design))


def _spectrum_finding(design: Design) -> str:
    if design.margins is None:
        return "The loop is unstable: no compensated payload to show"
    hook, payload = quantity(design.hook_rms, "m"), quantity(design.payload_rms, "m")
    change = decibels(design.hook_rms / design.payload_rms)
    return f"The hook moves {hook}, the payload {payload} rms ({change})"


def _response_finding(view: MotionView) -> str:
    design = view.design
    if not view.compensated:
        return "The loop is unstable: only the drum held is shown"
    omega = np.geomspace(*view.hook.energetic_band, 300)
    payload = np.abs(design.assessment.response(PAYLOAD, HOOK_HEAVE, omega))
    held = np.abs(view.held_response(omega))
    gains = f"{number(float(payload.min()), 2)} to {number(float(payload.max()), 2)}"
    before = f"{number(float(held.min()), 2)} to {number(float(held.max()), 2)}"
    return f"In the waves |P/Z| is {gains} with the gains, {before} with the drum held"


def _limits_finding(table: Table) -> str:
    uses: list[Bar] = [row[3] for row in table.rows]
    broken = [row[0] for row in table.rows if not row[3].kept and row[3].enforced]
    over = sum(not use.kept and not use.enforced for use in uses)
    if broken:
        text = f"Broken: {', '.join(broken)}"
    else:
        used = sum(use.value > 0.999 for use in uses if use.enforced)
        text = f"Every enforced limit is kept, {used or 'none'} used up"
    return f"{text}; {over} reported ones exceeded" if over else text


def _quantile(omega: FloatArray, density: FloatArray) -> float:
    """Return the frequency below which nearly all of a variance lies [rad/s]."""
    slices = 0.5 * (density[1:] + density[:-1]) * np.diff(omega)
    total = np.cumsum(np.nan_to_num(slices, posinf=0.0))
    return float(omega[1 + np.searchsorted(total, _WEIGHT * total[-1])])


def _period_axis(axes: Axes, right: float) -> None:
    """Add the period [s] on top, in round figures."""
    chosen: list[float] = []
    for period in _PERIODS:
        place = 2.0 * np.pi / period
        apart = not chosen or place - 2.0 * np.pi / chosen[-1] > 0.06 * right
        if place < 0.98 * right and apart:
            chosen.append(period)
    top = axes.secondary_xaxis("top")
    places = [2.0 * np.pi / period for period in chosen]
    top.set_xticks(places, [f"{period:g} s" for period in chosen])


def _response_band(view: MotionView) -> tuple[float, float]:
    low, high = 0.02, 20.0
    limit = view.design.case.limits.low_frequency
    if limit is not None:
        low = min(low, 0.4 * limit.below)
    if view.design.margins is not None:
        high = max(high, 2.0 * float(view.design.margins.crossovers.max(initial=0.0)))
    return low, min(high, 200.0)


def _range(axes: Axes, values: FloatArray, room: float) -> None:
    top = float(np.max(values))
    axes.set_ylim(0.6 * max(float(np.min(values)), 1e-4 * top), room * top)


def _frame(view: MotionView, axes: Axes, label: str) -> None:
    low, high = view.hook.energetic_band
    axes.axvspan(low, high, color=HOOK, alpha=0.15, linewidth=0.0)
    axes.axhline(1.0, color=REFERENCE, linewidth=0.9, linestyle=DASHED)
    axes.set_ylabel(label)


def _mark_peak(design: Design, axes: Axes, low: float, high: float) -> None:
    def height(omega: FloatArray) -> FloatArray:
        return np.abs(design.assessment.response(DRUM_HAUL, HOOK_HEAVE, omega))

    at = highest(height, low, high)
    value = float(height(np.array([at]))[0])
    if value > 1.05:
        text = f"peak {number(value)} at {number(at)} rad/s"
        annotate(axes, text, (at, value), (-170.0, 8.0))


def _slow_limit(design: Design, axes: Axes, low: float) -> None:
    """Draw the corner under which |P/Z| has to stay at low frequency."""
    limit = design.case.limits.low_frequency
    if limit is None:
        return
    across, up = [low, limit.below, limit.below], [limit.ratio, limit.ratio, 2.5 * limit.ratio]
    text = f"limit: {limit.ratio:g} up to {limit.below:g} rad/s"
    axes.plot(across, up, color=REFERENCE, linewidth=2.0, label=text)


def _bar_text(axes: Axes, place: int, table: Table, longest: float) -> None:
    """Write value, bound and price into a long bar, or behind a short one."""
    _, value, bound, use, price = table.rows[place]
    text = f"{value.text}  ({bound.text})"
    if price.value:
        text += f"   price {price.text} per %"
    shown = min(use.value, longest)
    if use.value > longest:
        text += f"   {100.0 * use.value:.0f} % ▸"
    inside = shown > 0.55 * longest
    plain = use.enforced or not inside
    axes.text(
        100.0 * shown + (-1.2 if inside else 1.2) * longest,
        place,
        text,
        horizontalalignment="right" if inside else "left",
        verticalalignment="center",
        fontsize=9.0,
        color="white" if inside and use.enforced else REFERENCE,
        bbox=None if plain else {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1},
    )


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
def nyquist(design: Design) -> Figure:
    """Return the Nyquist curve of the loop gain L with the circle of M_s around -1.

    Real against imaginary part of L(i omega) near -1; the loop is broken at the command, and may be
    unstable.

    Raises InputError if all gains are zero: there is no loop.
    """
    if not has_loop(design):
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


def _finding(design: Design) -> str:
    margins = design.margins
    if margins is None:
        return "The loop is unstable"
    text = f"L stays {number(1.0 / margins.max_sensitivity)} away from -1"
    if math.isfinite(margins.phase):
        text += f", phase margin {number(math.degrees(margins.phase))}°"
    return text


def _window(design: Design) -> PlaneWindow:
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


def _circles(design: Design, axes: Axes) -> None:
    """Draw the circles that the curve may not and does not enter, 1/M_s around -1."""
    bound = design.case.limits.max_sensitivity
    turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 361))
    dots = (0, (1.5, 1.5))

    def draw(sensitivity: float, colour: str, label: str) -> None:
        ring = -1.0 + turn / sensitivity
        axes.plot(ring.real, ring.imag, color=colour, linewidth=1.3, linestyle=dots, label=label)

    peak = None if design.margins is None else design.margins.max_sensitivity
    if peak is not None and abs(peak / bound - 1.0) < 1e-6:
        draw(peak, AFTER, f"$M_s$ = {number(peak)}, at its limit")
        return
    digits = 3 if peak is None else digits_apart(peak, bound)
    draw(bound, "#777777", f"$M_s$ = {number(bound, digits)}, the limit")
    if peak is not None:
        draw(peak, BROKEN if peak > bound else AFTER, f"$M_s$ = {number(peak, digits)}")


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


def _remarks(design: Design, axes: Axes, window: PlaneWindow) -> None:
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
