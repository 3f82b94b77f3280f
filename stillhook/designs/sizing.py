"""Sizing, co-design, worth and Pareto fronts as figures and reports: what to buy, what it costs."""

import math
from typing import Any

import numpy as np

from synth.sizing import CoDesign, ParetoFront, Sizing, Worth, WorthRow

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Column,
    Drawing,
    Figure,
    Item,
    Report,
    ReportSection,
    Table,
    Written,
    annotate,
    columns,
    drawn,
    headline,
    number,
    pairs,
    panel,
    quantity,
    scale,
    typeset,
)

_MARKS = ("o", "s", "^", "D", "v", "P", "X")
_ROWS = 14  # of the bar figure
_POINTS = 14  # of a table on the terminal


@drawn
def size_figure(sizing: Sizing) -> Figure:
    """Return the smallest motor over gear ratios, at least one, marked by the limit that binds."""
    points = [p for p in sizing.points if p.feasible and p.motor is not None]
    lost = [p for p in sizing.points if not p.feasible]
    power = [p.motor.power for p in points if p.motor is not None]
    factor, unit = scale("W", min(power))
    figure, axes = panel()
    axes.plot([p.gear for p in points], [v / factor for v in power], color=AFTER, zorder=1)
    names = list(dict.fromkeys(_limit(p.binding) for p in points))
    for k, name in enumerate(names):
        at = [i for i, p in enumerate(points) if _limit(p.binding) == name]
        colour, mark = (AFTER, DRUM, BEFORE, HOOK, REFERENCE)[k % 5], _MARKS[k % len(_MARKS)]
        style: Any = {"linestyle": "none", "marker": mark, "markersize": 5.0, "color": colour}
        gears, powers = [points[i].gear for i in at], [power[i] / factor for i in at]
        axes.plot(gears, powers, label=f"bound by {name}", **style)
    why = f"no motor: {', '.join(dict.fromkeys(q.binding[0] for q in lost))}"
    for k, p in enumerate(lost):
        label = None if k else why
        axes.axvline(p.gear, color=HOOK, linewidth=0.8, linestyle=":", label=label)
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
    height = sizing.case.sea.significant_height
    about = f"{sizing.case.name}: H_s {height:.3g} m, {sizing.structure}"
    return headline(figure, finding, about)


@drawn
def worth_figure(result: Worth) -> Figure:
    """Return what each figure takes off the payload's rms if it gets twice as good, as bars."""
    from matplotlib.patches import Patch

    rows = [r for r in result.rows if r.gain > 0.0][:_ROWS] or list(result.rows[:1])
    size, unit = scale("m", result.payload_rms)
    figure, axes = panel(height=1.6 + 0.34 * len(rows))
    top = result.payload_rms / size
    least = min(row.twice_rms / size for row in rows)
    for k, row in enumerate(rows):
        colour = AFTER if row.item.sold else HOOK
        after = row.twice_rms / size
        axes.barh(k, after - top, left=top, color=colour, height=0.62)
        inside = top - after > 0.3 * (top - least)  # of a long bar, else to its left
        side, colour = ("left", "white") if inside else ("right", REFERENCE)
        place: Any = {"xytext": (4.0 if inside else -4.0, 0.0), "textcoords": "offset points"}
        words: Any = {"ha": side, "va": "center", "color": colour, "fontsize": 9.0}
        axes.annotate(quantity(row.twice_rms, "m"), (after, k), **place, **words)
    labels = []
    for row in rows:
        now, then = (_value_text(row.item.value * by, row.item.unit) for by in (1.0, row.factor))
        labels.append(f"{typeset(row.item.name)}  {now} to {then}")
    axes.set_yticks(range(len(rows)), labels)
    axes.invert_yaxis()
    axes.axvline(top, color=REFERENCE, linewidth=1.0)
    axes.set_xlim(max(0.0, least - 0.18 * (top - least) - 0.02 * top), top * 1.01)
    axes.set_xlabel(f"payload rms [{unit}]")
    axes.grid(axis="y", visible=False)
    kinds = ((True, AFTER, "bought"), (False, HOOK, "given away, or chosen"))
    sold = {row.item.sold for row in rows}
    handles = [Patch(color=colour, label=label) for kind, colour, label in kinds if kind in sold]
    axes.legend(handles=handles, loc="lower left")
    first = result.first
    finding = f"Buy first: {first.item.name}" if first is not None else "Nothing is worth it"
    about = f"{result.case.name}, {result.structure}: one thing twice as good, gains anew"
    return headline(figure, finding, about)


def size_report(sizing: Sizing) -> Report:
    """Return the smallest motors over the gear ratio, the chosen one marked."""
    target, height = quantity(sizing.target, "m"), sizing.case.sea.significant_height
    highest = sizing.highest_height

    def left(rms: float, otherwise: str) -> str:
        return f"payload {quantity(rms, 'm')} rms" if math.isfinite(rms) else otherwise

    items: list[Item] = [_motors(sizing)] if sizing.points else []
    if sizing.chosen is not None:
        caption = "The smallest motor over the gear"
        items.append(Drawing("size", caption, lambda: size_figure(sizing)))
    around = [
        ("whatever the motor", left(sizing.unlimited_rms, "no stable loop keeps the limits")),
        (
            "with the winch as it is",
            left(sizing.given_rms, "its limits cannot be kept in this sea"),
        ),
        (
            "the winch as it is meets the target",
            f"up to H_s {highest:.3g} m" if highest > 0.0 else "in no sea looked at",
        ),
    ]
    return Report(
        name=sizing.case.name,
        about=f"payload {target} rms in H_s {height:.3g} m, {sizing.structure}",
        status=sizing.status,
        ok=sizing.ok,
        sections=[ReportSection("", items), ReportSection("", [pairs(around)])],
    )


def co_design_report(found: CoDesign) -> Report:
    """Return what the payload moves over gear and drum, the best pair marked."""
    heads = columns("gear [4]; drum [m]; payload_rms=payload rms [m 4]; limited_by=limited by <")
    rows = [
        (
            p.gear,
            p.radius,
            p.payload_rms if math.isfinite(p.payload_rms) else "-",
            ", ".join(p.binding[:2]),
        )
        for p in found.points
    ]
    best = (found.gear, found.radius)
    marked = tuple(k for k, p in enumerate(found.points) if (p.gear, p.radius) == best)
    table = Table(columns=heads, rows=rows, marked=marked, most=_POINTS)
    return Report(
        name=found.case.name,
        about=f"gear and gains together, {found.structure}",
        status=found.status,
        ok=found.ok,
        sections=[ReportSection("", [table])],
    )


def worth_report(result: Worth) -> Report:
    """Return what each figure of the case is worth."""
    head: Any = {"name": result.case.name, "about": f"what is worth buying, {result.structure}"}
    if not result.rows:
        return Report(status=result.status, ok=result.ok, **head)
    rows, idle = [], []
    for row in result.rows:
        if row.elasticity == 0.0 and row.gain == 0.0 and row.item.value != 0.0:
            idle.append(row.item.name)
            continue
        better = (-1.0 if row.factor < 1.0 else 1.0) * row.elasticity
        rows.append(
            (
                row.item.name + ("" if row.item.sold else " *"),
                Written(row.item.value, _value_text(row.item.value, row.item.unit)),
                f"{number(better, 2)} %" if math.isfinite(better) else "-",
                step_text(row),
                row.twice_rms if math.isfinite(row.twice_rms) else "-",
            )
        )
    notes = ["1 % of it: what the payload's rms changes by if the figure gets 1 % better"]
    if any(not row.item.sold for row in result.rows):
        notes.append("*: a margin is given away, not bought; the gear is chosen")
    if idle:
        notes.append(f"worth nothing here: {', '.join(idle)}")
    heads = columns("item=; is; one_per_cent=1 % of it; per step; twice_rms=twice as good [m]")
    drawing = Drawing("worth", "What is worth buying", lambda: worth_figure(result))
    items: list[Item] = [Table(columns=heads, rows=rows, notes=tuple(notes)), drawing]
    return Report(status=result.status, ok=result.ok, sections=[ReportSection("", items)], **head)


def _motors(sizing: Sizing) -> Table:
    rows = []
    for point in sizing.points:
        motor = point.motor
        figures: tuple[float | str, ...] = ("-",) * 4
        if motor is not None:
            figures = (motor.power, motor.torque_continuous, motor.torque_peak, motor.inertia)
        rows.append((point.gear, *figures, ", ".join(point.binding[:2])))
    best = sizing.chosen.gear if sizing.chosen is not None else None
    heads = columns(
        "gear; power [W]; torque_continuous=continuous [N m]; torque_peak=peak [N m]; "
        "inertia [kg m2]; limited_by=limited by <"
    )
    marked = tuple(k for k, point in enumerate(sizing.points) if point.gear == best)
    return Table(columns=heads, rows=rows, marked=marked, most=_POINTS)


def _value_text(value: float, unit: str) -> str:
    """Return the value of an item as people read it: motor speeds in rpm."""
    return quantity(value, "rpm") if unit == "rad/s" else quantity(value, unit)


def step_text(row: WorthRow) -> str:
    """Return what the rms changes by per natural step, as ``-5.31 mm per 1.00 cm``."""
    item = row.item
    if math.isnan(row.per_step) or row.per_step == 0.0:
        return "-"
    step = _value_text(item.step, item.unit)
    return f"{quantity(row.per_step, 'm')} per {step}"


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


_FRONT_ROWS = 12  # of the table on the terminal

#: What the other axis is called, by the name of the front.
AXES = {
    "torque": "rms of the dynamic motor torque",
    "speed": "rms of the motor speed",
    "max_sensitivity": "largest M_s allowed",
    "delay_margin": "further delay that the loop stands",
    "delay": "delay of the telemetry",
}


@drawn
def pareto_figure(front: ParetoFront) -> Figure:
    """Return a front of at least two points: payload rms, logarithmic, over the other quantity."""
    bounds = np.array([p.bound for p in front.points])
    rms = np.array([p.payload_rms for p in front.points])
    factor, unit = scale(front.unit, float(bounds.max()))
    size, length = scale("m", float(np.median(rms)))
    knee = front.knee
    figure, axes = panel()
    axes.semilogy(bounds / factor, rms / size, color=AFTER, marker="o", markersize=3.0)
    for bound in front.lost:
        axes.axvline(bound / factor, color=HOOK, linewidth=0.6, linestyle=":")
    text = f"{_point_text(front, knee.bound)}: {quantity(knee.payload_rms, 'm')}"
    annotate(axes, text, (knee.bound / factor, knee.payload_rms / size), (24.0, 24.0))
    label = typeset(AXES[front.against])
    axes.set_xlabel(f"{label} [{unit}]" if unit else label)
    axes.set_ylabel(f"payload rms [{length}]")
    about = f"{front.case.name}: every point is an optimum within all other limits"
    return headline(figure, _finding(front), about)


def pareto_report(front: ParetoFront) -> Report:
    """Return what the front says: its points, the knee marked, and its figure."""
    about = f"payload rms against {front.against}"
    head: Any = {"name": front.case.name, "about": about, "ok": front.ok}
    if len(front.points) < 2:
        return Report(status="no front: fewer than two points hold", **head)
    text = f"{len(front.points)} points; {_finding(front)}"
    if front.lost:
        text += f"; no point holds at {len(front.lost)} bounds"
    passed, asked = front.verified
    names = list(front.points[0].parameters)
    table = Table(
        columns=(
            Column("bound", front.against, write=lambda bound: _point_text(front, bound)),
            *columns(
                "payload_rms=payload rms [m]; max_sensitivity=M_s; torque_rms=torque rms [N m]"
            ),
            *map(Column, names),
        ),
        rows=[
            (p.bound, p.payload_rms, p.max_sensitivity, p.torque_rms, *p.parameters.values())
            for p in front.points
        ],
        notes=("* the knee: here the front turns most",),
        marked=(front.points.index(front.knee),),
        most=_FRONT_ROWS,
    )
    drawing = Drawing("pareto", "What stillness costs", lambda: pareto_figure(front))
    status = f"{text}; {passed} of {asked} checked by other code"
    return Report(status=status, sections=[ReportSection("", [table, drawing])], **head)


def _finding(front: ParetoFront) -> str:
    """Return what the front says, in a sentence."""
    first, last = front.points[0], front.points[-1]
    return (
        f"{_point_text(front, first.bound)} to {_point_text(front, last.bound)}: the payload moves "
        f"{quantity(first.payload_rms, 'm')} to {quantity(last.payload_rms, 'm')} rms"
    )


def _point_text(front: ParetoFront, value: float) -> str:
    """Return a value of the other quantity with its unit."""
    if front.against == "max_sensitivity":
        return f"M_s {number(value)}"
    return quantity(value, front.unit)
