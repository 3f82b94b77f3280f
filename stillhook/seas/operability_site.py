"""The figures of operability over heading, and over the year of a site."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray
from synth.operability import AtDepth, Operability

from ..text import AFTER, BEFORE, DRUM, HOOK, drawn, headline, new_figure
from .operability_axes import (
    draw_steepest,
    limit_line,
    limit_text,
    own_heading,
    pale,
    periods_axis,
    shade,
    steepest,
    titled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@drawn
def heading_figure(study: Operability, at: AtDepth | None = None) -> Figure:
    """Return two roses over heading, the bow up: the limiting H_s, and the limit that binds.

    Parameters
    ----------
    study
        The study, of a vessel with headings.
    at
        The length of rope; by default the first.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    at = study.depths[0] if at is None else at
    contour = at.main
    assert contour.headings is not None
    # Where the waves come from, seen from the deck: head seas at the top.
    edges, rows = _around(contour.headings)
    rings = _edges(contour.periods)
    figure = new_figure(9.6, 5.6)
    left = figure.add_subplot(1, 2, 1, projection="polar")
    right = figure.add_subplot(1, 2, 2, projection="polar")
    # Above the steepest seas of a period there is nothing to be limited.
    limit = np.minimum(contour.limit[rows], steepest(contour.periods))
    levels = _levels(float(limit.max()))
    bands = BoundaryNorm(levels, 256, extend="neither")
    mesh = left.pcolormesh(edges, rings, limit.T, cmap="viridis", norm=bands)
    bar = figure.colorbar(mesh, ax=left, shrink=0.8, pad=0.08, location="bottom")
    bar.set_label(r"limiting $H_s$ [m], up to the steepest seas")
    real = contour.limit < steepest(contour.periods)
    binding = np.where(real, contour.binding, "")
    names = [str(n) for n in np.unique(binding)]
    number = np.searchsorted(names, binding[rows])
    colours = [pale(name) for name in names]
    right.pcolormesh(
        edges, rings, number.T, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(names) - 0.5
    )
    labels = {c.name: limit_text(c) for c in contour.criteria}
    right.legend(
        handles=[
            Patch(color=colour, label=labels.get(name, "nothing below the steepest seas"))
            for name, colour in zip(names, colours, strict=True)
        ],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        fontsize=8.5,
    )
    for axes, text in ((left, r"limiting $H_s$"), (right, "what binds")):
        _rose(axes, contour.periods)
        axes.set_title(text, fontsize=10.0, loc="center", pad=12.0)
    best = float(np.degrees(contour.headings[int(limit.mean(axis=1).argmax())]))
    finding = f"Best on average at a heading of {best:.0f} deg; rings are $T_p$, the bow is up"
    return headline(figure, finding)


@drawn
def scatter_figure(study: Operability, at: AtDepth | None = None) -> Figure:
    """Return the scatter diagram with the limits across it, and the share of each month if known.

    Parameters
    ----------
    study
        The study, with a scatter diagram.
    at
        The length of rope; by default the first.
    """
    at = study.depths[0] if at is None else at
    scatter = study.scatter
    assert scatter is not None
    months = at.workable["held"].by_month
    main = "loop" if "loop" in at.contours else "held"
    h = own_heading(study, at.main)
    figure = new_figure(9.6 if months else 7.2, 4.6)
    grid = figure.add_gridspec(1, 2 if months else 1, width_ratios=(3, 2) if months else None)
    axes = figure.add_subplot(grid[0, 0])
    seas = np.column_stack([scatter.peak_period, scatter.significant_height])
    states, place = np.unique(np.round(seas, 6), axis=0, return_inverse=True)
    share = np.bincount(place.ravel(), weights=scatter.occurrence)
    visible = share > 2e-5
    size = 260.0 * np.sqrt(share[visible] / share.max())
    x, y = states[visible].T
    axes.scatter(x, y, s=size, color=HOOK, alpha=0.45, linewidths=0.0, zorder=2)
    top = 1.05 * float(states[visible, 1].max())
    for name, colour, text in (
        ("held", BEFORE, "drum held"),
        ("loop", AFTER, "with the design"),
        ("reoptimised", DRUM, "gains anew for each sea"),
    ):
        if name not in at.contours:
            continue
        contour = at.contours[name]
        worked = at.workable[name].share
        label = f"{text}: {100.0 * worked:.0f} % of the year"
        if name == main:
            shade(axes, contour.periods, contour.limit[h])
        limit_line(axes, contour.periods, contour.limit[h], top, colour, label=label, zorder=3)
        best = at.workable[name].best_heading
        if best is not None:
            style: Any = {"linestyle": (0, (4, 2)), "zorder": 3}
            label = f"... best heading: {100.0 * best:.0f} %"
            vaning = contour.weathervaning
            limit_line(axes, contour.periods, vaning, top, colour, label=label, **style)
    draw_steepest(axes, at.main.periods, top)
    axes.set_ylim(0.0, top)
    periods_axis(axes, at.main.periods)
    axes.set_ylabel(r"$H_s$ [m]")
    figure.legend(loc="outside lower center", ncols=3, fontsize=8.5)
    if months:
        _months(figure.add_subplot(grid[0, 1]), at)
    gain = at.workable[main].share - at.workable["held"].share
    finding = f"Workable {100.0 * at.workable[main].share:.0f} % of the year"
    if main == "loop":
        finding += f", {100.0 * at.workable['held'].share:.0f} % with the drum held"
        if abs(gain) < 5e-3:
            finding = "Compensation makes no more of the year workable"
    return titled(figure, study, at, finding)


def _months(axes: Axes, at: AtDepth) -> None:
    """Draw the workable share of each month."""
    numbers = np.arange(1, 13)
    bars = [(n, c) for n, c in (("held", BEFORE), ("loop", AFTER)) if n in at.workable]
    width = 0.8 / len(bars)
    for k, (name, colour) in enumerate(bars):
        shares = [100.0 * at.workable[name].by_month.get(int(m), np.nan) for m in numbers]
        axes.bar(numbers - 0.4 + (k + 0.5) * width, shares, width=width, color=colour)
    axes.set_xticks(numbers, list("JFMAMJJASOND"))
    axes.set_ylim(0.0, 100.0)
    axes.set_ylabel("workable [% of the month]")
    axes.grid(axis="x", visible=False)


def _around(headings: FloatArray) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return the edges of sectors [rad], waves coming from there, and the rows in their order."""
    rows = np.arange(headings.size)
    if headings.size == 1:
        half = math.radians(15.0)
        return np.array([headings[0] - half, headings[0] + half]) + math.pi, rows
    middle = 0.5 * (headings[:-1] + headings[1:])
    if _goes_round(headings):
        seam = 0.5 * (headings[-1] + headings[0] + 2.0 * math.pi)
        return np.concatenate([[seam - 2.0 * math.pi], middle, [seam]]) + math.pi, rows
    first = headings[0] - 0.5 * (headings[1] - headings[0])
    last = headings[-1] + 0.5 * (headings[-1] - headings[-2])
    return np.concatenate([[first], middle, [last]]) + math.pi, rows


def _goes_round(headings: FloatArray) -> bool:
    gaps = np.diff(np.append(headings, headings[0] + 2.0 * math.pi))
    return bool(gaps.max() < math.radians(91.0))


def _edges(periods: FloatArray) -> FloatArray:
    if periods.size == 1:
        return np.array([periods[0] - 0.5, periods[0] + 0.5])
    middle = 0.5 * (periods[:-1] + periods[1:])
    first, last = 1.5 * periods[0] - 0.5 * periods[1], 1.5 * periods[-1] - 0.5 * periods[-2]
    return np.concatenate([[first], middle, [last]])


def _levels(high: float) -> FloatArray:
    """Return round bounds of bands of H_s from zero to above a value, five to ten."""
    steps = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    step = next((s for s in steps if high / s <= 10.0), steps[-1])
    return np.asarray(step * np.arange(math.ceil(high / step - 1e-9) + 1.0))


def _rose(axes: Any, periods: FloatArray) -> None:
    """Set a polar axis: bow up, angles counter-clockwise, radius the peak period."""
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(1)
    turns = np.radians(np.arange(0.0, 360.0, 45.0))
    names = {
        180.0: "head 180",
        0.0: "following 0",
        90.0: "from\nstarboard 90",
        270.0: "from\nport 270",
    }
    labels = []
    for turn in turns:
        heading = (math.degrees(turn) + 180.0) % 360.0
        labels.append(names.get(round(heading, 6), f"{heading:.0f}"))
    axes.set_xticks(turns, labels, fontsize=8.0)
    axes.set_ylim(0.0, _edges(periods)[-1])
    rings = [t for t in (5.0, 10.0, 15.0, 20.0) if t < periods[-1]]
    axes.set_yticks(rings, [f"{t:g} s" for t in rings], fontsize=7.5, color="white")
    axes.set_axisbelow(False)
    axes.grid(color="white", linewidth=0.5, alpha=0.7)
    axes.tick_params(axis="x", pad=9.0)
