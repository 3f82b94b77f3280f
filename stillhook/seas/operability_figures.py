"""The figures of operability: H_s over T_p, at several depths, and what the winch can follow.

Drawn as people of the trade draw them: one line for each limit with the region below all of them
shaded; the maker's lines of heave over period.  Roses and scatter diagrams are in
`stillhook.seas.operability_site`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from synth.operability import AtDepth, Operability

from ..text import AFTER, BEFORE, REFERENCE, drawn, panel
from .operability_axes import (
    SHADE,
    draw_steepest,
    limit_line,
    limit_text,
    line_of,
    own_heading,
    periods_axis,
    shade,
    steepest,
    titled,
    top_of,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HELD = (0, (2, 1))  # dashes of the drum held


@drawn
def contour_figure(study: Operability, at: AtDepth | None = None) -> Figure:
    """Return H_s over T_p: a line for each limit, what is workable shaded, and the drum held.

    Parameters
    ----------
    study
        The study.
    at
        The length of rope; by default the first.
    """
    at = study.depths[0] if at is None else at
    contour = at.main
    h = own_heading(study, contour)
    periods = contour.periods
    held = at.contours["held"].limit[h]
    figure, axes = panel(8.0, 4.6)
    top = top_of(periods, [contour.limit[h], held], contour.heights[:, h])
    shade(axes, periods, contour.limit[h])
    for criterion, heights in zip(contour.criteria, contour.heights[:, h], strict=True):
        if heights.min() > top:
            continue  # above the figure: that it is not reached says enough
        colour, dashes = line_of(criterion.name)
        width = 2.2 if np.any(contour.binding[h] == criterion.name) else 1.3
        dot = "o" if periods.size == 1 else None
        style = {"linestyle": dashes, "linewidth": width, "marker": dot}
        limit_line(axes, periods, heights, top, colour, label=limit_text(criterion), **style)
    if "loop" in at.contours:
        text = "drum held: what binds first"
        limit_line(axes, periods, held, top, BEFORE, linestyle=_HELD, label=text)
    if "reoptimised" in at.contours:
        anew = at.contours["reoptimised"].limit[h]
        style = {"linestyle": (0, (6, 1.5, 1, 1.5)), "label": "gains anew for each sea"}
        limit_line(axes, periods, anew, top, AFTER, **style)
    draw_steepest(axes, periods, top)
    axes.set_ylim(0.0, top)
    periods_axis(axes, periods)
    axes.set_ylabel(r"limiting $H_s$ [m]")
    figure.legend(loc="outside right center", fontsize=8.5)
    return titled(figure, study, at, _finding(study, at, h))


@drawn
def capability_figure(study: Operability, at: AtDepth | None = None) -> Figure:
    """Return the winch maker's lines, heave height over period, with what the sea asks for.

    Parameters
    ----------
    study
        The study.
    at
        The length of rope; by default the first.
    """
    at = study.depths[0] if at is None else at
    lines, contour = at.capability, at.main
    h = own_heading(study, contour)
    asked = []
    for column, limit in zip(at.columns, contour.limit[h], strict=True):
        if 0.0 < limit < contour.highest:
            heave = column.hook(h, float(limit)).displacement
            time = study.case.limits.exposure_time
            asked.append(
                (heave.zero_crossing_period, 2.0 * heave.most_probable_maximum(time), heave.rms)
            )
    figure, axes = panel(8.0, 4.4)
    lowest = lines.limit
    largest = max((a[1] for a in asked), default=float(np.quantile(lowest, 0.5)))
    top = 2.0 * largest
    axes.fill_between(lines.periods, 0.0, np.minimum(lowest, 2 * top), color=SHADE, lw=0.0)
    for criterion, heights in zip(lines.criteria, lines.heights, strict=True):
        if heights.min() > top:
            continue
        colour, dashes = line_of(criterion.name)
        axes.plot(
            lines.periods, heights, color=colour, linestyle=dashes, label=limit_text(criterion)
        )
    if asked:
        T, most, rms = np.array(asked).T
        dots: Any = {"color": AFTER, "marker": "o", "linestyle": "none", "markersize": 4.5}
        axes.plot(T, most, label="hook at the limiting $H_s$: largest", **dots)
        axes.plot(T, 4.0 * rms, markerfacecolor="white", label="... significant", **dots)
    axes.set_ylim(0.0, top)
    axes.set_xlim(lines.periods[0], lines.periods[-1])
    axes.set_xlabel("period of the heave [s]")
    axes.set_ylabel("double amplitude of the hook's heave [m]")
    figure.legend(loc="outside right center", fontsize=8.5)
    return titled(figure, study, at, "What the winch can follow in regular heave")


@drawn
def depth_figure(study: Operability) -> Figure:
    """Return the contours at all lengths of rope, with the drum held and with the design.

    Parameters
    ----------
    study
        The study.
    """
    import matplotlib as mpl

    h = own_heading(study, study.depths[0].main)
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, len(study.depths)))
    figure, axes = panel(8.0, 4.4)
    limits = [at.main.limit[h] for at in study.depths]
    helds = [at.contours["held"].limit[h] for at in study.depths]
    top = top_of(study.periods, limits)
    for at, limit, held, colour in zip(study.depths, limits, helds, colours, strict=True):
        layer = f", layer {at.rope.layer}" if at.rope.layer else ""
        layer += ": works in no sea" if limit.max() == 0.0 else ""
        text = f"{at.rope.length:g} m{layer}"
        limit_line(axes, study.periods, limit, top, colour, label=text)
        if "loop" in at.contours:
            limit_line(axes, study.periods, held, top, colour, linestyle=_HELD, linewidth=1.2)
    if "loop" in study.depths[0].contours:
        axes.plot([], [], color=REFERENCE, linestyle=_HELD, label="drum held")
    draw_steepest(axes, study.periods, top)
    axes.set_ylim(0.0, top)
    periods_axis(axes, study.periods)
    axes.set_ylabel(r"limiting $H_s$ [m]")
    figure.legend(loc="outside right center", fontsize=8.5)
    lengths = [at.rope.length for at in study.depths]
    finding = f"Rope from {min(lengths):g} to {max(lengths):g} m"
    return titled(figure, study, None, finding)


def _finding(study: Operability, at: AtDepth, h: int) -> str:
    contour = at.main
    limit = contour.limit[h]
    # Limits above the steepest seas bind nothing.
    real = np.isfinite(limit) & (limit < steepest(contour.periods))
    finite = limit[real]
    if not np.isfinite(limit).any():
        return f"Nothing binds up to H_s {contour.highest:g} m"
    if not finite.size:
        return "Nothing binds below the steepest seas"
    low, high = float(finite.min()), float(finite.max())
    names, counts = np.unique(contour.binding[h][real], return_counts=True)
    label = {c.name: c.label for c in contour.criteria}[str(names[counts.argmax()])]
    span = f"{low:.2g} m" if math.isclose(low, high, rel_tol=0.02) else f"{low:.2g} to {high:.2g} m"
    who = "" if "loop" in at.contours else ", drum held"
    return f"Workable up to H_s {span}{who}; most often bound by {label}"
