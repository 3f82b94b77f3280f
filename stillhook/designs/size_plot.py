"""The figures of sizing and purchase: smallest motor over the gear, what is worth buying."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from synth.sizing import Sizing, Worth, WorthRow

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    annotate,
    new_figure,
    quantity,
    scale,
    styled,
    typeset,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_ROWS = 14  # of the bar figure


def size_figure(sizing: Sizing) -> Figure:
    """Return the smallest motor over the gear ratio, marked by the limit that binds.

    Parameters
    ----------
    sizing
        With at least one gear behind which a motor meets the target.
    """
    points = [p for p in sizing.points if p.feasible and p.motor is not None]
    lost = [p for p in sizing.points if not p.feasible]
    power = [p.motor.power for p in points if p.motor is not None]
    factor, unit = scale("W", min(power))
    with styled():
        figure = new_figure()
        axes = figure.add_subplot()
        axes.plot([p.gear for p in points], [v / factor for v in power], color=AFTER, zorder=1)
        names = list(dict.fromkeys(_limit(p.binding) for p in points))
        for k, name in enumerate(names):
            at = [i for i, p in enumerate(points) if _limit(p.binding) == name]
            axes.plot(
                [points[i].gear for i in at],
                [power[i] / factor for i in at],
                linestyle="none",
                color=(AFTER, DRUM, BEFORE, HOOK, REFERENCE)[k % 5],
                marker=_MARKS[k % len(_MARKS)],
                markersize=5.0,
                label=f"bound by {name}",
            )
        for k, p in enumerate(lost):
            axes.axvline(
                p.gear,
                color=HOOK,
                linewidth=0.8,
                linestyle=":",
                label=f"no motor: {', '.join(dict.fromkeys(q.binding[0] for q in lost))}"
                if k == 0
                else None,
            )
        chosen = sizing.chosen
        if chosen is not None and chosen.motor is not None:
            text = f"{quantity(chosen.motor.power, 'W')} at {chosen.gear:g}"
            annotate(axes, text, (chosen.gear, chosen.motor.power / factor), (-40.0, 36.0))
        axes.set_xscale("log")
        ticks = sorted({p.gear for p in sizing.points})
        chosen_ticks = _thinned(ticks)
        axes.set_xticks(chosen_ticks, [f"{t:.3g}" for t in chosen_ticks])
        axes.set_xticks([], minor=True)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("gear ratio")
        axes.set_ylabel(f"rated power of the smallest motor [{unit}]")
        axes.legend(loc="best")
        finding = f"The smallest motor for {quantity(sizing.target, 'm')} rms at the payload"
        figure.suptitle(finding, x=0.012, ha="left", fontsize=11.0, weight="bold")
        height = sizing.case.sea.significant_height
        about = f"{sizing.case.name}: H_s {height:.3g} m, {sizing.structure}"
        axes.set_title(typeset(about), fontsize=9.5, color="#555555", pad=6.0)
    return figure


def worth_figure(result: Worth) -> Figure:
    """Return what each figure takes off the payload's rms if it gets twice as good, as bars.

    Parameters
    ----------
    result
        With at least one row.
    """
    rows = [r for r in result.rows if r.gain > 0.0][:_ROWS] or list(result.rows[:1])
    size, unit = scale("m", result.payload_rms)
    with styled():
        figure = new_figure(height=1.6 + 0.34 * len(rows))
        axes = figure.add_subplot()
        top = result.payload_rms / size
        least = min(row.twice_rms / size for row in rows)
        for k, row in enumerate(rows):
            colour = AFTER if row.item.sold else HOOK
            after = row.twice_rms / size
            axes.barh(k, after - top, left=top, color=colour, height=0.62)
            inside = top - after > 0.3 * (top - least)  # of a long bar, else to its left
            axes.annotate(
                quantity(row.twice_rms, "m"),
                (after, k),
                xytext=(4.0 if inside else -4.0, 0.0),
                textcoords="offset points",
                ha="left" if inside else "right",
                va="center",
                color="white" if inside else REFERENCE,
                fontsize=9.0,
            )
        labels = [f"{typeset(row.item.name)}  {_change(row)}" for row in rows]
        axes.set_yticks(range(len(rows)), labels)
        axes.invert_yaxis()
        axes.axvline(top, color=REFERENCE, linewidth=1.0)
        axes.set_xlim(max(0.0, least - 0.18 * (top - least) - 0.02 * top), top * 1.01)
        axes.set_xlabel(f"payload rms [{unit}]")
        axes.grid(axis="y", visible=False)
        bought, given = _handles()
        kinds = {row.item.sold for row in rows}
        handles = [h for h, sold in ((bought, True), (given, False)) if sold in kinds]
        axes.legend(handles=handles, loc="lower left")
        first = result.first
        finding = f"Buy first: {first.item.name}" if first is not None else "Nothing is worth it"
        figure.suptitle(typeset(finding), x=0.012, ha="left", fontsize=11.0, weight="bold")
        about = f"{result.case.name}, {result.structure}: one thing twice as good, gains anew"
        axes.set_title(about, fontsize=9.5, color="#555555", pad=6.0)
    return figure


def value_text(value: float, unit: str) -> str:
    """Return the value of an item as people read it: motor speeds in rpm."""
    return quantity(value, "rpm") if unit == "rad/s" else quantity(value, unit)


def step_text(row: WorthRow) -> str:
    """Return what the rms changes by per natural step, as ``-5.31 mm per 1.00 cm``."""
    item = row.item
    if math.isnan(row.per_step) or row.per_step == 0.0:
        return "-"
    step = value_text(item.step, item.unit)
    return f"{quantity(row.per_step, 'm')} per {step}"


def _change(row: WorthRow) -> str:
    item = row.item
    return (
        f"{value_text(item.value, item.unit)} to {value_text(item.value * row.factor, item.unit)}"
    )


def _limit(binding: tuple[str, ...]) -> str:
    """Return the first limit of the drive that binds, of those that grow with the motor."""
    motor = [name for name in binding if name.startswith("motor.") or name.startswith("the load")]
    return motor[0] if motor else (binding[0] if binding else "nothing")


def _thinned(ticks: list[float]) -> list[float]:
    """Return ticks that are at least 12 % apart."""
    found: list[float] = []
    for tick in ticks:
        if not found or tick > 1.12 * found[-1]:
            found.append(tick)
    return found


def _handles() -> tuple[object, object]:
    from matplotlib.patches import Patch

    return Patch(color=AFTER, label="bought"), Patch(color=HOOK, label="given away, or chosen")
