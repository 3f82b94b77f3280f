"""Robust designs and gain schedules as figures, reports and tables of data."""

import numpy as np

from synth.robust import GainSchedule, RobustDesign

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
    columns,
    data_table,
    delay_margin,
    drawn,
    headline,
    new_figure,
    number,
    pairs,
    quantity,
    scale,
    typeset,
)

_SHOWN = 24  # scenarios of the figure
_ROWS = 12  # and of the table


@drawn
def robust_figure(design: RobustDesign) -> Figure:
    """Return payload rms and M_s of the scenarios, one stable at least, and the random draws."""
    shown = design.scenarios[:_SHOWN]
    rms = np.array([s.design.payload_rms for s in shown])
    size, unit = scale("m", float(np.median(rms)))
    at = np.arange(len(shown))[::-1]
    figure = new_figure(9.0, 2.6 + 0.22 * len(shown))
    left, right = figure.subplots(1, 2, width_ratios=(3, 1), sharey=True)
    before = np.array([s.design.payload_rms_before for s in shown]) / size
    left.scatter(before, at, color=BEFORE, marker="|", s=60, label="drum held")
    left.scatter(rms / size, at, color=AFTER, s=24, label="these gains")
    own = [(s.best_rms, k) for s, k in zip(shown, at, strict=True) if s.best_rms is not None]
    if own:
        values, rows = zip(*own, strict=True)
        label = "gains of its own"
        left.scatter(np.array(values) / size, rows, color=DRUM, marker="x", s=24, label=label)
    if design.check is not None and design.check.payload_rms.size:
        low, high = np.quantile(design.check.payload_rms, [0.005, 0.995]) / size
        label = f"99 % of {design.check.stable} random draws"
        left.axvspan(low, high, color=HOOK, alpha=0.2, label=label)
    left.set_xscale("log")
    left.set_xlabel(f"payload rms [{unit}]")
    left.set_yticks(at, [s.name for s in shown], fontsize=7.5)
    figure.legend(loc="outside lower left", ncols=4, fontsize=8.0)
    right.scatter([s.margins.max_sensitivity for s in shown], at, color=AFTER, s=24)
    bound = shown[0].design.limits.get("max_sensitivity")
    if bound is not None:
        right.axvline(bound.bound, color=BEFORE, linewidth=1.2)
    right.set_xlabel(typeset("M_s"))
    most = quantity(float(rms.max()), "m")
    finding = f"One set of gains: {most} rms at most in {len(design.scenarios)} scenarios"
    return headline(figure, finding, design.family.case.name)


@drawn
def schedule_figure(schedule: GainSchedule) -> Figure:
    """Return the gains over the rope's length, and the payload's motion with them."""
    lengths = np.geomspace(schedule.lengths[0], schedule.lengths[-1], 200)
    lengths[[0, -1]] = schedule.lengths[[0, -1]]
    table = [schedule.at(float(v)) for v in lengths]
    figure = new_figure(7.2, 2.0 + 1.3 * len(schedule.names))
    panels = figure.subplots(1 + len(schedule.names), 1, sharex=True)
    for axes, k, name in zip(panels, range(len(schedule.names)), schedule.names, strict=False):
        axes.plot(lengths, [row[name] for row in table], color=AFTER)
        axes.plot(schedule.lengths, schedule.gains[:, k], "o", color=REFERENCE, markersize=4)
        axes.set_ylabel(name)
    last = panels[-1]
    at = [p.length for p in schedule.points]
    last.plot(at, [1e3 * p.payload_rms for p in schedule.points], color=AFTER, label="schedule")
    best = [1e3 * p.best_rms for p in schedule.points]
    last.plot(at, best, color=DRUM, linestyle="--", label="gains of its own")
    last.set_ylabel("payload rms [mm]")
    last.set_xlabel("rope length [m]")
    last.legend(loc="best")
    last.set_xscale("log")
    finding = f"Gains over the rope's length, {len(schedule.lengths)} nodes"
    return headline(figure, finding, schedule.case.name)


def robust_report(design: RobustDesign) -> Report:
    """Return what the design does in its scenarios, the worst first."""
    parameters = [(name, number(value, 6)) for name, value in design.parameters.items()]
    items: list[Item] = [pairs(parameters)]
    if design.scenarios:
        items.append(_scenarios(design))
        items.append(Drawing("robust", "The scenarios", lambda: robust_figure(design)))
    if design.check is not None:
        found = [f"{100 * q:g} %: {quantity(v, 'm')}" for q, v in design.check.quantiles.items()]
        items += [str(design.check), f"their payload rms: {', '.join(found)}"]
    if design.added:
        items.append(f"the search for the worst member added {design.added} of the scenarios")
    return Report(
        name=design.family.case.name,
        about="one set of gains",
        status=design.status,
        ok=design.ok,
        sections=[ReportSection("", items)],
    )


def schedule_report(schedule: GainSchedule) -> Report:
    """Return the gains at the nodes of a schedule."""
    rows = [
        (float(length), *map(float, row))
        for length, row in zip(schedule.lengths, schedule.gains, strict=True)
    ]
    gains = (f"; {name} [5]" for name in schedule.names)
    heads = columns(f"rope_length=rope [m 4]{''.join(gains)}")
    items: list[Item] = [Table(columns=heads, rows=rows)]
    if schedule.points:
        caption = "Gains over the rope's length"
        items.append(Drawing("schedule", caption, lambda: schedule_figure(schedule)))
    return Report(
        name=schedule.case.name,
        about="gains over the rope's length",
        status=schedule.status,
        ok=schedule.ok,
        sections=[ReportSection("", items)],
    )


def scenario_table(design: RobustDesign) -> Table:
    """Return every figure of all scenarios as data, SI units."""
    paths = [axis.path for axis in design.family.axes]
    names = sorted({name for s in design.scenarios for name in s.design.limits})
    head = [*paths, "significant_height", "peak_period", "weight", "payload_rms"]
    head += ["payload_rms_held", "best_rms", "max_sensitivity", "gain_down", "gain", "phase"]
    head += ["delay_margin", "disk_margin", "gain_radius", "gain_box", "pressure", "verified"]
    rows = []
    for s in design.scenarios:
        sea, radius = design.family.seas[s.member.sea], s.radius
        own, m = s.design, s.margins
        row = [*s.member.point, sea.significant_height, sea.peak_period, s.weight, own.payload_rms]
        row += [own.payload_rms_before, s.best_rms, m.max_sensitivity, m.gain_down, m.gain, m.phase]
        row += [m.delay, m.disk, *((radius.ball, radius.box) if radius else (None, None))]
        row += [s.pressure, s.verified]
        rows.append([*row, *(own.limits[n].use if n in own.limits else None for n in names)])
    return data_table([*head, *(f"use:{name}" for name in names)], rows)


def _scenarios(design: RobustDesign) -> Table:
    """Return the worst scenarios, with their names below: they are too long for a column."""
    rows = []
    for k, s in enumerate(design.scenarios[:_ROWS]):
        tightest, off = s.tightest, None if s.radius is None else s.radius.box
        own, m = s.design, s.margins
        row = (k + 1, own.payload_rms, own.payload_rms_before, m.max_sensitivity, m.delay, m.disk)
        rows.append((*row, off, *((tightest.use, tightest.name) if tightest else (None, ""))))
    heads = (
        *columns("scenario=; payload_rms=payload [m]; held=held [m]; max_sensitivity=M_s"),
        Column("delay", write=delay_margin),
        *columns("disk; gains_off=gains off [%]; use [%]; of <"),
    )
    notes = [f"{k + 1}: {s.name}" for k, s in enumerate(design.scenarios[:_ROWS])]
    notes.append("gains off: by how much all may be off at once before a loop is unstable")
    if len(design.scenarios) > _ROWS:
        notes.append(f"and {len(design.scenarios) - _ROWS} more, in scenarios.csv")
    return Table(columns=heads, rows=rows, notes=tuple(notes))
