"""The Pareto front as figure and report: what stillness costs, and where that turns most."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from synth.sizing import ParetoFront

from ..text import (
    AFTER,
    HOOK,
    Column,
    Drawing,
    Report,
    ReportSection,
    Table,
    annotate,
    columns,
    drawn,
    headline,
    number,
    panel,
    quantity,
    scale,
    typeset,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROWS = 12  # of the table on the terminal

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
    """Return the front: payload rms, logarithmic, over the other quantity.

    Parameters
    ----------
    front
        A front of at least two points.
    """
    bounds = np.array([p.bound for p in front.points])
    rms = np.array([p.payload_rms for p in front.points])
    factor, unit = scale(front.unit, float(bounds.max()))
    size, length = scale("m", float(np.median(rms)))
    knee = front.knee
    figure, axes = panel()
    axes.semilogy(bounds / factor, rms / size, color=AFTER, marker="o", markersize=3.0)
    for bound in front.lost:
        axes.axvline(bound / factor, color=HOOK, linewidth=0.6, linestyle=":")
    text = f"{_value_text(front, knee.bound)}: {quantity(knee.payload_rms, 'm')}"
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
            Column("bound", front.against, write=lambda bound: _value_text(front, bound)),
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
        most=_ROWS,
    )
    drawing = Drawing("pareto", "What stillness costs", lambda: pareto_figure(front))
    status = f"{text}; {passed} of {asked} checked by other code"
    return Report(status=status, sections=[ReportSection("", [table, drawing])], **head)


def _finding(front: ParetoFront) -> str:
    """Return what the front says, in a sentence."""
    first, last = front.points[0], front.points[-1]
    return (
        f"{_value_text(front, first.bound)} to {_value_text(front, last.bound)}: the payload moves "
        f"{quantity(first.payload_rms, 'm')} to {quantity(last.payload_rms, 'm')} rms"
    )


def _value_text(front: ParetoFront, value: float) -> str:
    """Return a value of the other quantity with its unit."""
    if front.against == "max_sensitivity":
        return f"M_s {number(value)}"
    return quantity(value, front.unit)
