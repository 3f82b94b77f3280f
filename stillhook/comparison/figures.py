"""The figures of a comparison: rms over H_s, and time traces around the worst moment.

Each function returns a matplotlib `Figure`.  A contender has the same colour in both; the floor
is a shaded edge, because nothing can lie below it on the linear plant.
"""

import math
from typing import Any

import numpy as np

from models.basics import InputError

from ..controllers import Contender
from ..text import (
    AFTER,
    BEFORE,
    BROKEN,
    DRUM,
    HOOK,
    REFERENCE,
    Figure,
    count,
    drawn,
    duration,
    headline,
    logarithmic,
    new_figure,
    number,
    panel,
    quantity,
    scale,
    typeset,
)
from .cell import Trace
from .comparison import Comparison

_COLOURS = {
    "none": HOOK,
    "constant-tension": "#cc79a7",
    "feed-forward": "#e69f00",
    "feed-forward-full": "#f5d08a",
    "thesis": BEFORE,
    "feedback": "#56b4e9",
    "feedback-eager": "#56b4e9",
    "feedback-half": "#0072b2",
    "feedback-no-antiwindup": "#b3dcf5",
    "combined": AFTER,
    "combined-eager": AFTER,
    "combined-no-antiwindup": "#6a9fc9",
    "mpc-clipped": "#661100",
    "mpc": DRUM,
    "mpc-ar": "#8c6d31",
    "nonlinear-mpc": "#882255",
    "mpc-preview": DRUM,
    "clairvoyant": REFERENCE,
}
_OTHERS = ("#332288", "#117733", "#999933", "#aa4499")
_DASHED = (0, (4, 2))
_DASHES = ("feedback-eager", "combined-eager", "mpc-preview", "feedback-half", "combined-half")
_MARKS = "osD^vP*X<>hd8p"
_FLOOR_SHOWN = 0.05  # of the least rms: a floor below that leaves the figure
_WIDEST = 1e4  # the most that the axis goes above the stillest
_FINE = 3e3  # an axis that spans less is marked at 2 and 5 too
_SHOWN = 8  # contenders among the traces


@drawn
def heights(found: Comparison) -> Figure:
    """Return the payload's rms over the significant height, one line for each contender.

    Bars are 95 % intervals over the seeds; a cross marks the lowest sea in which a contender lost
    the load in any run.  With a single height the contenders stand below each other, each with a
    dot for every seed.

    Raises InputError if there are no runs.
    """
    values = [found.pooled(c.name, h) for c in found.contenders for h in found.heights]
    known = [value for value in values if math.isfinite(value) and value > 0.0]
    if not known:
        raise InputError("comparison: there are no runs to draw")
    factor, unit = scale("m", math.sqrt(min(known) * max(known)))
    if len(found.heights) == 1:
        figure = _dots(found, factor, unit)
    else:
        figure = _lines(found, factor, unit)
    return headline(figure, _finding(found), _about(found))


@drawn
def worst_moment(found: Comparison) -> Figure:
    """Return time traces around the worst moment of the best linear law, for the same seed.

    Raises InputError if there are no traces.
    """
    if found.worst_moment is None or not found.traces:
        raise InputError("comparison: there are no traces to draw")
    height, seed, moment = found.worst_moment
    shown = _chosen(found, height)
    hook = next((t for t in found.traces if "hook.heave" in t.signals), None)
    drive = found.case.winch.drive
    figure = new_figure(10.4, 7.6)
    # Half-way between, a law that falls off would hide what all others do.
    top, payload, torque, flags = figure.subplots(
        4, 1, sharex=True, height_ratios=[0.8, 2.2, 1.3, 0.16 * len(shown) + 0.25]
    )
    if hook is not None:
        top.plot(hook.time, hook.signals["hook.heave"], color=HOOK)
    top.set_ylabel("hook [m]")
    reach = _reach(found, shown, height)
    factor, unit = scale("m", reach)
    for place, trace in enumerate(shown):
        style = {"color": _colour(found, trace.contender), "linestyle": _line(trace.contender)}
        at = trace.time
        width = 2.2 if trace.contender == found.best(height, ("linear",)) else 1.5
        payload.plot(
            at,
            trace.signals["payload.displacement"] / factor,
            label=trace.contender,
            linewidth=width,
            **style,
        )
        if "motor.torque" in trace.signals and trace.contender != "none":
            torque.plot(at, trace.signals["motor.torque"] / 1e3, linewidth=1.2, **style)
        if "drive.saturated" in trace.signals:
            full = trace.signals["drive.saturated"] > 0.5
            flags.fill_between(
                at, place + 0.1, place + 0.9, where=full, color=style["color"], linewidth=0.0
            )
    payload.set_ylim(-1.1 * reach / factor, 1.1 * reach / factor)
    payload.set_ylabel(f"payload [{unit}]")
    for sign in (-1.0, 1.0):
        torque.axhline(sign * drive.torque_peak / 1e3, color=BROKEN, linewidth=0.9)
    torque.set_ylabel("motor torque\n[kN m]")
    flags.set_ylim(len(shown), 0)
    flags.set_yticks(
        [place + 0.5 for place in range(len(shown))], [t.contender for t in shown], fontsize=8.0
    )
    flags.grid(visible=False, axis="y")
    flags.set_title("drive saturated", fontsize=9.0, color="#555555", pad=2.0)
    flags.set_xlabel("time [s]")
    flags.set_xlim(float(shown[0].time[0]), float(shown[0].time[-1]))
    payload.axvline(moment, color=REFERENCE, linewidth=0.8, linestyle=":")
    figure.legend(loc="outside right center")
    name = found.best(height, ("linear",))
    worst = max(
        (c.quantities["tracking error largest"] for c in found.of(str(name), height)),
        default=math.nan,
    )
    text = f"The worst moment of {name}: {quantity(worst, 'm')} off, H_s {height:.4g} m"
    return headline(figure, text, f"{found.case.name}, seed {seed}, all contenders in the same sea")


def _lines(found: Comparison, factor: float, unit: str) -> Figure:
    figure, axes = panel(8.6, 5.4)
    wide = found.heights[-1] - found.heights[0]
    several = max(1, len(found.contenders) - 1)
    fell = False
    for place, each in enumerate(found.contenders):
        at = [h for h in found.heights if math.isfinite(found.pooled(each.name, h))]
        if not at:
            continue
        middle = np.array([found.pooled(each.name, h) for h in at]) / factor
        colour, mark = _colour(found, each.name), _MARKS[place % len(_MARKS)]
        if each.group == "floor":
            axes.plot(at, middle, color=colour, linewidth=1.2, label=each.name)
            axes.fill_between(at, 1e-9, middle, color=colour, alpha=0.12, linewidth=0.0)
            continue
        # Beside each other, so that intervals do not hide each other.
        shift = 0.02 * wide * (place / several - 0.5)
        style: Any = {"linestyle": _line(each.name), "marker": mark, "markersize": 4.5}
        axes.plot(np.array(at) + shift, middle, color=colour, label=each.name, **style)
        for height in at:
            mean = found.rms(each.name, height)
            if math.isfinite(mean.low):
                span = [mean.low / factor, mean.high / factor]
                axes.plot([height + shift] * 2, span, color=colour, linewidth=1.0)
        edge = found.cliff(each.name)
        if not math.isnan(edge) and edge in at and each.group != "brake":
            fell = True
            place_of = (edge + shift, middle[at.index(edge)])
            axes.plot(*place_of, "x", color=BROKEN, markersize=11, markeredgewidth=2.2, zorder=5)
    if fell:
        axes.plot([], [], "x", color=BROKEN, markeredgewidth=2.2, label="first loses the load")
    ends = _ends(found)
    axes.set_ylim(ends[0] / factor, ends[1] / factor)
    logarithmic(axes, "y", _marks_of(ends))
    axes.set_xticks(found.heights, [f"{h:.4g}" for h in found.heights])
    axes.set_xlabel(typeset("H_s [m]"))
    axes.set_ylabel(f"payload, rms over all seeds [{unit}]")
    figure.legend(loc="outside right center")
    return figure


def _ends(found: Comparison) -> tuple[float, float]:
    """Return the ends of the axis [m], at most five decades apart.

    A floor that is next to nothing does not press all others flat, nor does what has diverged.
    """
    own: list[float] = []
    floor: list[float] = []
    for each in found.contenders:
        values = [found.pooled(each.name, height) for height in found.heights]
        kept = floor if each.group == "floor" else own
        kept += [value for value in values if math.isfinite(value) and value > 0.0]
    low = min(own or floor)
    high = min(max(own or floor), _WIDEST * low)
    if own and floor:
        low = min(low, max(min(floor), _FLOOR_SHOWN * low))
    return 0.6 * low, 1.6 * high


def _dots(found: Comparison, factor: float, unit: str) -> Figure:
    height = found.heights[0]
    shown = [c for c in found.contenders if math.isfinite(found.pooled(c.name, height))]
    figure, axes = panel(7.6, 1.6 + 0.36 * len(shown))
    labels = []
    for place, each in enumerate(shown):
        colour = _colour(found, each.name)
        cells = found.of(each.name, height)
        seeds = [cell.rms / factor for cell in cells if math.isfinite(cell.rms)]
        axes.plot(seeds, [place] * len(seeds), ".", color=colour, alpha=0.6, markersize=6)
        mean = found.rms(each.name, height)
        middle = found.pooled(each.name, height) / factor
        if math.isfinite(mean.low):
            span = [mean.low / factor, mean.high / factor]
            axes.plot(span, [place, place], color=colour, linewidth=1.2)
        axes.plot(middle, place, "|", color=colour, markersize=15, markeredgewidth=2.6)
        lost = found.lost(each.name, height)
        labels.append(f"{each.name}\n(load lost in {lost} of {len(cells)})" if lost else each.name)
    floor = found.floor
    if floor is not None and math.isfinite(found.pooled(floor.name, height)):
        edge = found.pooled(floor.name, height) / factor
        axes.axvspan(1e-9, edge, color=REFERENCE, alpha=0.12, linewidth=0.0)
    ends = _ends(found)
    axes.set_xlim(ends[0] / factor, ends[1] / factor)
    logarithmic(axes, "x", _marks_of(ends))
    axes.set_yticks(range(len(shown)), labels)
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(f"payload, rms [{unit}]: a dot for each seed, a bar for all together")
    return figure


def _marks_of(ends: tuple[float, float]) -> tuple[float, ...]:
    return (1.0, 2.0, 5.0) if ends[1] < _FINE * ends[0] else (1.0,)


def _about(found: Comparison) -> str:
    seeds = f"{count(len(found.seeds), 'seed')} x {duration(found.question.duration)}"
    about = f"{found.case.name}, {seeds}, same seas and same noise for all"
    if found.question.mismatch.text:
        about += f"; plant off by {found.question.mismatch.text}"
    return f"H_s {found.heights[0]:.4g} m: {about}" if len(found.heights) == 1 else about


def _finding(found: Comparison) -> str:
    """Return what the figure shows, as a title."""
    height = found.heights[-1]
    best = found.best(height, ("linear", "filter", "predictive", "own"))
    if best is None:
        return "What is left of the payload's motion"
    text = f"{best} holds best in H_s {height:.4g} m, {quantity(found.pooled(best, height), 'm')}"
    linear = found.best(height, ("linear",))
    if linear is not None and linear != best:
        times = found.ratio(linear, height, best).mean
        text += f" rms: {number(times, 2)} times less than {linear}"
    else:
        text += " rms"
    return text


def _chosen(found: Comparison, height: float) -> list[Trace]:
    """Return the traces to draw: the best of each kind first, so many as can be told apart."""
    order = sorted(found.traces, key=lambda trace: found.pooled(trace.contender, height))
    first = {found.best(height, (group,)) for group in ("linear", "predictive", "floor", "brake")}
    kept = [t.contender for t in order if t.contender in first]
    kept += [t.contender for t in order if t.contender not in first]
    kept = kept[:_SHOWN]
    return [trace for trace in found.traces if trace.contender in kept and trace.time.size > 1]


def _reach(found: Comparison, shown: list[Trace], height: float) -> float:
    """Return how far the axis of the payload goes [m]: what has lost the load may leave it."""
    sizes = {t.contender: float(np.abs(t.signals["payload.displacement"]).max()) for t in shown}
    kept = [size for name, size in sizes.items() if not found.lost(name, height)]
    return min(max(sizes.values()), 1.5 * max(kept)) if kept else max(sizes.values())


def _colour(found: Comparison, name: str) -> str:
    if name in _COLOURS:
        return _COLOURS[name]
    others: list[Contender] = [each for each in found.contenders if each.name not in _COLOURS]
    return _OTHERS[[each.name for each in others].index(name) % len(_OTHERS)]


def _line(name: str) -> str | tuple[int, tuple[int, int]]:
    return _DASHED if name in _DASHES else "-"
