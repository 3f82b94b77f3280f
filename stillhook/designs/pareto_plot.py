"""The figure of a Pareto front: what stillness costs, and where that turns most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from synth.sizing import ParetoFront

from ..text import AFTER, HOOK, annotate, new_figure, number, quantity, scale, styled, typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What the other axis is called, by the name of the front.
AXES = {
    "torque": "rms of the dynamic motor torque",
    "speed": "rms of the motor speed",
    "max_sensitivity": "largest M_s allowed",
    "delay_margin": "further delay that the loop stands",
    "delay": "delay of the telemetry",
}


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
    with styled():
        figure = new_figure()
        axes = figure.add_subplot()
        axes.semilogy(bounds / factor, rms / size, color=AFTER, marker="o", markersize=3.0)
        for bound in front.lost:
            axes.axvline(bound / factor, color=HOOK, linewidth=0.6, linestyle=":")
        text = f"{value_text(front, knee.bound)}: {quantity(knee.payload_rms, 'm')}"
        annotate(axes, text, (knee.bound / factor, knee.payload_rms / size), (24.0, 24.0))
        label = typeset(AXES[front.against])
        axes.set_xlabel(f"{label} [{unit}]" if unit else label)
        axes.set_ylabel(f"payload rms [{length}]")
        figure.suptitle(typeset(finding(front)), x=0.012, ha="left", fontsize=11.0, weight="bold")
        about = f"{front.case.name}: every point is an optimum within all other limits"
        axes.set_title(about, fontsize=9.5, color="#555555", pad=6.0)
    return figure


def finding(front: ParetoFront) -> str:
    """Return what the front says, in a sentence."""
    first, last = front.points[0], front.points[-1]
    return (
        f"{value_text(front, first.bound)} to {value_text(front, last.bound)}: the payload moves "
        f"{quantity(first.payload_rms, 'm')} to {quantity(last.payload_rms, 'm')} rms"
    )


def value_text(front: ParetoFront, value: float) -> str:
    """Return a value of the other quantity with its unit."""
    if front.against == "max_sensitivity":
        return f"M_s {number(value)}"
    return quantity(value, front.unit)
