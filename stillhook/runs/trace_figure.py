"""The time traces of a run: the whole of it as an envelope, and its worst minute beside it.

One row for each thing that matters to an operator: hook and payload, drum, torque and speed of the
motor with their limits, the rope's tension, and when brake, telemetry and drive were not as usual.
"""

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np

from models.basics import BoolArray, FloatArray, InputError, residual_text
from models.run import ERROR, Event, Run
from models.sensing import STATUSES
from models.simulation import STATUS

from ..text import (
    AFTER,
    BROKEN,
    DASHED,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    drawn,
    duration,
    headline,
    new_figure,
    quantity,
    scale,
)
from .window import Window, envelope, error_of, moves, runs_of_true, window_of

_BINS = 500  # over the width of the whole run
_SMALL = 0.25  # of the hook's motion: a payload that moves less has a scale of its own
_EVENTS = 12  # told below the figure
_SLACK = 1.0  # tension below which the rope is slack [N]
_REACH = 1.6  # a limit farther away than so many times the signal is not drawn


@dataclass(frozen=True)
class _Panel:
    """One row: signals with label and colour, unit, and the limits to shade."""

    title: str
    unit: str
    signals: tuple[tuple[str, str, str], ...]
    _: KW_ONLY
    limits: tuple[float, float] = (-math.inf, math.inf)
    rest: float | None = None
    slack: bool = False


@drawn
def traces(run: Run, window: Window | None = None) -> Figure:
    """Return the time traces of a run: on the left the whole of it, on the right a window.

    That is by default `stillhook.runs.window.window_of`.

    Raises InputError if the run has no stored samples.
    """
    if run.time.size < 2:
        raise InputError(f"traces: the run with seed {run.seed} has no time traces to draw")
    window = window_of(run) if window is None else window
    panels = _panels(run)
    split = window.end - window.start < 0.95 * float(run.time[-1])
    told = run.events[:_EVENTS]
    figure = new_figure(10.4, 1.75 * len(panels) + 1.7 + 0.17 * len(told))
    grid = figure.subplots(
        len(panels) + 1,
        2 if split else 1,
        sharex="col",
        squeeze=False,
        height_ratios=[1.0] * len(panels) + [0.42],
        width_ratios=[1.15, 1.0] if split else [1.0],
    )
    columns = [None, window] if split else [None]
    for column, part in enumerate(columns):
        for row, panel in enumerate(panels):
            _draw(grid[row][column], run, panel, part)
        _states(grid[-1][column], run, part)
        _mark_events(list(grid[:, column]), told, part)
        grid[-1][column].set_xlabel("time [s]")
    if split:
        for axes in grid[:-1, 0]:
            axes.axvspan(window.start, window.end, color="#f0e442", alpha=0.2, linewidth=0.0)
        grid[0][1].set_title(
            f"{window.why}: {window.start:.4g} to {window.end:.4g} s", fontsize=9.5, color="#555555"
        )
    for row in range(len(panels)):
        grid[row][0].set_ylabel(f"{panels[row].title}\n[{_scale(run, panels[row])[1]}]")
    about = f"{run.case.name}, {run.scenario}, {run.controller}, seed {run.seed}"
    lasting = duration(round(float(run.time[-1]), 3))
    figure.align_ylabels(grid[:, 0])
    headline(figure, _finding(run), f"{about}: {lasting}")
    handles, labels = grid[0][-1].get_legend_handles_labels()
    if len(labels) > 1:
        beside = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}  # the small title
        grid[0][-1].legend(handles, labels, ncols=3, borderpad=0.1, **beside)
    if told:
        figure.supxlabel(_events_text(run), x=0.012, ha="left", fontsize=9.0)
    return figure


def _panels(run: Run) -> list[_Panel]:
    drive, winch = run.case.winch.drive, run.case.winch
    hook, payload = ("hook.heave", "hook", HOOK), ("payload.displacement", "payload", AFTER)
    asked = ("reference.displacement", "asked", REFERENCE)
    moved = moves(run)
    wide = (*((asked,) if moved else ()), payload)
    small = not moved and _span(run, "payload.displacement") < _SMALL * _span(run, "hook.heave")
    if small:
        panels = [_Panel("hook", "m", (hook,)), _Panel("payload", "m", wide)]
    else:
        panels = [_Panel("hook, payload", "m", (hook, *wide))]
    if moved:
        panels.append(_Panel("payload's error", "m", ((ERROR, "", AFTER),)))
    panels.append(_Panel("drum haul", "m", (("drum.haul", "", DRUM),)))
    torque, speed, most = drive.torque_peak, winch.speed_limit, run.case.limits.rope_tension_peak
    turning, turns = (("motor.torque", "", DRUM),), (("motor.speed", "", DRUM),)
    limits, rest = (-torque, torque), run.case.static_torque
    panels.append(_Panel("motor torque", "N m", turning, limits=limits, rest=rest))
    panels.append(_Panel("motor speed", "rpm", turns, limits=(-speed, speed)))
    pull, limits = (("rope.tension", "", REFERENCE),), (-math.inf, most or math.inf)
    line = "rope tension" if run.case.rope.falls == 1 else "tension of a fall"
    panels.append(_Panel(line, "N", pull, limits=limits, slack=True))
    if "contact.gap" in run:
        panels.append(_Panel("clearance below", "m", (("contact.gap", "", AFTER),)))
    return [panel for panel in panels if panel.signals[0][0] in (*run.signals, ERROR)]


def _signal(run: Run, name: str) -> FloatArray:
    """Return a signal (n,); the error up to touchdown only, as nobody can follow after it."""
    values = error_of(run) if name == ERROR else run[name]
    found = run.statistics.quantities.get("touch-down at")
    if name == ERROR and found is not None and not math.isnan(found.value):
        values = np.where(run.time < found.value, values, np.nan)
    return np.where(np.isfinite(values), values, np.nan)


def _draw(axes: Axes, run: Run, panel: _Panel, window: Window | None) -> None:
    rows = slice(None) if window is None else window.rows(run.time)
    time = run.time[rows]
    factor, _ = _scale(run, panel)
    for name, label, colour in panel.signals:
        values = _signal(run, name)[rows] / factor
        at, low, high = envelope(time, values, _BINS)
        if label == "asked":  # it is smooth, and a line shows it best
            axes.plot(at, low, color=colour, label=label, linestyle=DASHED, linewidth=1.2)
        elif at is time or window is not None:
            axes.plot(time, values, color=colour, label=label, linewidth=1.5)
        else:
            axes.fill_between(at, low, high, color=colour, alpha=0.75, linewidth=0.5, label=label)
    _shade_limits(axes, panel, factor)
    if panel.rest is not None:
        axes.axhline(panel.rest / factor, color=REFERENCE, linewidth=0.8, linestyle=DASHED)
    if panel.slack and "rope.minimum_tension" in run:
        slack = run["rope.minimum_tension"][rows] <= _SLACK
        for start, end in runs_of_true(time, slack):
            axes.axvspan(start, end, color=BROKEN, alpha=0.3, linewidth=0.0)
    if time.size:
        axes.set_xlim(float(time[0]), float(time[-1]))


def _shade_limits(axes: Axes, panel: _Panel, factor: float) -> None:
    """Shade what lies beyond a limit, if the signal comes anywhere near it."""
    low, high = axes.get_ylim()
    reach = max(abs(low), abs(high))
    for limit, sign in zip(panel.limits, (-1.0, 1.0), strict=True):
        bound = limit / factor
        end = high if sign > 0.0 else -low
        if not math.isfinite(bound) or abs(bound) > _REACH * reach or sign * bound > _REACH * end:
            continue
        far = bound + sign * 0.12 * abs(bound)
        low, high = min(low, far), max(high, far)
        axes.axhspan(
            bound, bound + sign * 10.0 * abs(bound), color=BROKEN, alpha=0.15, linewidth=0.0
        )
        axes.axhline(bound, color=BROKEN, linewidth=0.9)
    axes.set_ylim(low, high)


def _states(axes: Axes, run: Run, window: Window | None) -> None:
    """Draw when brake, link, drive and rope were not as usual, as bars one above the other."""
    rows = slice(None) if window is None else window.rows(run.time)
    time = run.time[rows]

    def flag(name: str, limit: float) -> BoolArray:
        return run[name][rows] > limit if name in run else np.zeros(time.size, dtype=np.bool_)

    usual = [tuple(STATUSES).index(name) for name in ("blending", "held")]
    waits = np.isin(run[STATUS][rows], usual) if STATUS in run else np.zeros(0, dtype=np.bool_)
    late = run.case.sensors.telemetry.delay + 1.0
    states = (
        ("brake", flag("brake.on", 0.5), REFERENCE),
        ("no link", flag("payload.age", late), HOOK),
        ("saturated", flag("drive.saturated", 0.5), BROKEN),
        *([("not engaged", waits, DRUM)] if STATUS in run else []),
    )
    for place, (_, values, colour) in enumerate(states):
        bars = [(start, end - start) for start, end in runs_of_true(time, values)]
        axes.broken_barh(bars, (place + 0.12, 0.76), facecolors=colour, edgecolors=colour)
    axes.set_yticks([place + 0.5 for place in range(len(states))], [name for name, *_ in states])
    axes.set_ylim(len(states), 0)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)


def _mark_events(column: Sequence[Axes], told: Sequence[Event], window: Window | None) -> None:
    """Draw a line through all panels where something happened, with its number on top."""
    for number, event in enumerate(told, 1):
        if window is not None and not window.start <= event.time <= window.end:
            continue
        for axes in column:
            axes.axvline(event.time, color=REFERENCE, linewidth=0.8, linestyle=":")
        column[0].annotate(
            str(number),
            (event.time, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(1.5, -2.0),
            textcoords="offset points",
            fontsize=9.0,
            verticalalignment="top",
        )


def _events_text(run: Run) -> str:
    lines = [f"{i}  at {event}" for i, event in enumerate(run.events[:_EVENTS], 1)]
    if len(run.events) > _EVENTS:
        lines[-1] += f"   (and {len(run.events) - _EVENTS} more)"
    return "\n".join(lines)


def _finding(run: Run) -> str:
    statistics = run.statistics
    if run.status == "diverged":
        return f"{run.message[:1].upper()}{run.message[1:]}"
    found = {name: q.value for name, q in statistics.quantities.items()}
    largest, residual = found["tracking error largest"], found.get("residual", math.nan)
    touched = found.get("touch-down speed", math.nan)
    if not math.isnan(touched):
        before = found.get("error before touch-down largest", math.nan)
        told = "" if math.isnan(before) else f", off by at most {quantity(before, 'm')} before"
        return f"The payload touches down at {quantity(touched, 'm/s')}{told}"
    text = f"The payload is off by at most {quantity(largest, 'm')}"
    if not math.isnan(residual):
        rms = quantity(found["hook rms"] * residual / 100.0, "m")
        text += f", {rms} rms: {residual_text(0.01 * residual)}"
    return text


def _span(run: Run, name: str) -> float:
    values = run[name]
    values = values[np.isfinite(values)]
    return float(np.ptp(values)) if values.size else 0.0


def _scale(run: Run, panel: _Panel) -> tuple[float, str]:
    """Return factor and name of the unit that a panel is drawn in."""
    size = 0.0
    for name, *_ in panel.signals:
        values = np.abs(_signal(run, name))
        size = max(size, float(values[np.isfinite(values)].max(initial=0.0)))
    return scale(panel.unit, size)
