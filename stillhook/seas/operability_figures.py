"""The figures of operability: H_s over T_p, at several depths, over heading and over the year.

Drawn as people of the trade draw them: one line for each limit with the region below all of them
shaded; the maker's lines of heave over period; roses and scatter diagrams.
"""

import math
from typing import Any

import numpy as np

from models.basics import FloatArray
from models.sea import breaking_height
from synth.limits import Limit
from synth.operability import AtDepth, Operability

from ..designs import LIMITS
from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    drawn,
    headline,
    new_figure,
    panel,
    quantity,
)
from .hook import bow_up, goes_round

# Colour and dashes of each limit: the same in every figure.
_LINES: dict[str, tuple[str, Any]] = {
    "payload": ("#0072b2", "-"),
    "motor.torque.peak": ("#e69f00", "-"),
    "motor.torque.continuous": ("#e69f00", (0, (5, 2))),
    "motor.speed.peak": ("#009e73", "-"),
    "motor.voltage.peak": ("#56b4e9", "-"),
    "motor.current.peak": ("#b8860b", (0, (1, 1.2))),
    "motor.current.continuous": ("#b8860b", (0, (5, 2, 1, 2))),
    "motor.torque.breakdown": ("#d55e00", (0, (1, 1))),
    "motor.power.peak": ("#cc79a7", "-"),
    "rope.tension.peak": ("#444444", "-"),
    "rope.tension.least": ("#444444", (0, (5, 2))),
    "rope.lower_tension.least": ("#444444", (0, (1, 1.2))),
    "rope.lower_tension.daf": ("#8c564b", "-"),
    "rope.lower_tension.snap": ("#8c564b", (0, (5, 2))),
    "stability": ("#000000", (0, (1, 1))),
}
_STEEP = "#9a9a9a"
_SHADE = "#cfe3f1"
_FAR = 3.0  # times what can be reached: beyond, a limit is not shown


def limit_text(limit: Limit) -> str:
    """Return a limit with its bound, as ``motor speed 2000 rpm``."""
    if math.isnan(limit.bound):
        return limit.name
    bound = quantity(limit.bound, "rpm" if limit.unit == "rad/s" else limit.unit)
    kind = {"payload.rms": " rms", "payload.significant": " sign.", "payload.max": " max."}
    return f"{_label(limit.name)} {bound}{kind.get(limit.name, '')}"


def _label(name: str) -> str:
    """Return a criterion in words."""
    if name in LIMITS:
        return LIMITS[name][0]
    own = {
        "stability": "stability",
        "payload.speed": "payload speed",
        "rope.lower_tension.daf": "DAF at the load",
        "rope.lower_tension.snap": "snap: tension at the load",
    }
    return own.get(name, "payload motion")


def line_of(name: str) -> tuple[str, Any]:
    """Return the colour and the dashes of a limit's line."""
    return _LINES.get(name) or _LINES.get(name.partition(".")[0]) or (REFERENCE, "-")


def pale(name: str) -> tuple[float, float, float]:
    """Return the colour of a limit, lighter where its line is dashed, to fill areas with."""
    from matplotlib.colors import to_rgb

    colour, dashes = line_of(name) if name else ("#f0f0f0", "-")
    red, green, blue = to_rgb(colour)
    mixed = 0.15 if dashes == "-" else 0.5
    return tuple(c + (1.0 - c) * mixed for c in (red, green, blue))  # type: ignore[return-value]


def top_of(
    periods: FloatArray, envelopes: list[FloatArray], others: FloatArray | None = None
) -> float:
    """Return the upper end of an axis of H_s: room above what can be reached, and no more.

    The next limit above is shown too, if it is not far away.
    """
    reached = max(float(np.minimum(e, breaking_height(periods)).max()) for e in envelopes)
    room = 1.5 * reached
    if others is not None:
        near = np.where(others < breaking_height(periods), others, np.inf).min(axis=1)
        above = np.sort(near[near > room])
        if above.size and above[0] < _FAR * reached:
            room = 1.15 * float(above[0])
    return max(room, 0.1)


def shade(axes: Axes, periods: FloatArray, limit: FloatArray) -> None:
    """Shade the seas that are workable: below the limit, and not steeper than seas are."""
    if periods.size > 1:
        T = np.linspace(periods[0], periods[-1], 400)
        # Lines that leave for infinity do so between two periods.
        below = np.interp(T, periods, np.minimum(limit, 1e3))
        axes.fill_between(
            T, 0.0, np.minimum(below, breaking_height(T)), color=_SHADE, linewidth=0.0
        )


def limit_line(
    axes: Axes, periods: FloatArray, heights: FloatArray, top: float, colour: Any, **style: Any
) -> None:
    """Draw a limit of H_s over the period, up to somewhat above the figure's `top`."""
    axes.plot(periods, np.minimum(heights, 2.0 * top), color=colour, **style)


def _frame(axes: Axes, periods: FloatArray, top: float, label: str) -> None:
    """Draw the steepest seas of each period; make the axes those of peak period and H_s."""
    T = np.linspace(periods[0], periods[-1], 100)
    if breaking_height(T).min() < top:
        axes.plot(
            T, breaking_height(T), color=_STEEP, linestyle=":", linewidth=1.2, label="steepest seas"
        )
    axes.set_ylim(0.0, top)
    axes.set_ylabel(label)
    axes.set_xlabel(r"peak period $T_p$ [s]")
    if periods.size > 1:
        axes.set_xlim(periods[0], periods[-1])


def titled(figure: Figure, study: Operability, at: AtDepth | None, finding: str) -> Figure:
    """Set what the figure found as its title, and what it is about in small below; return it.

    `at` is the length of rope; None where the figure shows several.
    """
    gamma = f", gamma {study.case.sea.gamma}" if study.case.sea.spectrum == "jonswap" else ""
    about = f"{study.case.name}: {study.case.sea.spectrum}{gamma}"
    if at is not None:
        about += f", {at.length:g} m of rope"
    if study.headings is not None:
        h = study.own_heading(study.depths[0].main)
        about += f", heading {math.degrees(study.headings[h]):.0f} deg"
    return headline(figure, finding, about)


_HELD = (0, (2, 1))  # dashes of the drum held


@drawn
def contour_figure(study: Operability) -> Figure:
    """Return H_s over T_p: a line for each limit, what is workable shaded, and the drum held."""
    at = study.depths[0]
    contour = at.main
    h = study.own_heading(contour)
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
    _frame(axes, periods, top, r"limiting $H_s$ [m]")
    figure.legend(loc="outside right center", fontsize=8.5)
    return titled(figure, study, at, _finding(study, at, h))


@drawn
def capability_figure(study: Operability) -> Figure:
    """Return the winch maker's lines, heave height over period, with what the sea asks for."""
    at = study.depths[0]
    lines, contour = at.capability, at.main
    h = study.own_heading(contour)
    asked = []
    for column, limit in zip(at.columns, contour.limit[h], strict=True):
        if 0.0 < limit < contour.highest:
            heave = column.hook(h, float(limit)).displacement
            time = study.case.limits.equivalent_exposure
            asked.append(
                (heave.zero_crossing_period, 2.0 * heave.most_probable_maximum(time), heave.rms)
            )
    figure, axes = panel(8.0, 4.4)
    lowest = lines.limit
    largest = max((a[1] for a in asked), default=float(np.quantile(lowest, 0.5)))
    top = 2.0 * largest
    axes.fill_between(lines.periods, 0.0, np.minimum(lowest, 2 * top), color=_SHADE, lw=0.0)
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
    """Return the contours at all lengths of rope, with the drum held and with the design."""
    import matplotlib as mpl

    h = study.own_heading(study.depths[0].main)
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, len(study.depths)))
    figure, axes = panel(8.0, 4.4)
    limits = [at.main.limit[h] for at in study.depths]
    helds = [at.contours["held"].limit[h] for at in study.depths]
    top = top_of(study.periods, limits)
    for at, limit, held, colour in zip(study.depths, limits, helds, colours, strict=True):
        layer = f", layer {at.layer}" if at.layer else ""
        layer += ": works in no sea" if limit.max() == 0.0 else ""
        text = f"{at.length:g} m{layer}"
        limit_line(axes, study.periods, limit, top, colour, label=text)
        if "loop" in at.contours:
            limit_line(axes, study.periods, held, top, colour, linestyle=_HELD, linewidth=1.2)
    if "loop" in study.depths[0].contours:
        axes.plot([], [], color=REFERENCE, linestyle=_HELD, label="drum held")
    _frame(axes, study.periods, top, r"limiting $H_s$ [m]")
    figure.legend(loc="outside right center", fontsize=8.5)
    lengths = [at.length for at in study.depths]
    finding = f"Rope from {min(lengths):g} to {max(lengths):g} m"
    return titled(figure, study, None, finding)


def _finding(study: Operability, at: AtDepth, h: int) -> str:
    contour = at.main
    limit = contour.limit[h]
    # Limits above the steepest seas bind nothing.
    real = np.isfinite(limit) & (limit < breaking_height(contour.periods))
    finite = limit[real]
    if not np.isfinite(limit).any():
        return f"Nothing binds up to H_s {contour.highest:g} m"
    if not finite.size:
        return "Nothing binds below the steepest seas"
    low, high = float(finite.min()), float(finite.max())
    names, counts = np.unique(contour.binding[h][real], return_counts=True)
    label = _label(str(names[counts.argmax()]))
    span = f"{low:.2g} m" if math.isclose(low, high, rel_tol=0.02) else f"{low:.2g} to {high:.2g} m"
    who = "" if "loop" in at.contours else ", drum held"
    return f"Workable up to H_s {span}{who}; most often bound by {label}"


@drawn
def heading_figure(study: Operability) -> Figure:
    """Return two roses over heading, the bow up: the limiting H_s, and the limit that binds."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator

    contour = study.depths[0].main
    assert contour.headings is not None
    # Where the waves come from, seen from the deck: head seas at the top.
    edges, rings = _around(contour.headings), _edges(contour.periods, 0.5)
    figure = new_figure(9.6, 5.6)
    left = figure.add_subplot(1, 2, 1, projection="polar")
    right = figure.add_subplot(1, 2, 2, projection="polar")
    # Above the steepest seas of a period there is nothing to be limited.
    limit = np.minimum(contour.limit, breaking_height(contour.periods))
    levels = MaxNLocator(10, steps=[1, 2, 5, 10]).tick_values(0.0, max(float(limit.max()), 0.1))
    bands = BoundaryNorm(levels, 256, extend="neither")
    mesh = left.pcolormesh(edges, rings, limit.T, cmap="viridis", norm=bands)
    # The layout does not see all that stands around a polar plot.
    figure.set_layout_engine("constrained", rect=(0.0, 0.03, 1.0, 0.94))
    bar = figure.colorbar(mesh, ax=left, shrink=0.8, pad=0.08, location="bottom")
    bar.set_label(r"limiting $H_s$ [m], up to the steepest seas")
    real = contour.limit < breaking_height(contour.periods)
    binding = np.where(real, contour.binding, "")
    names = [str(n) for n in np.unique(binding)]
    number = np.searchsorted(names, binding)
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
    for axes, text in (
        (left, r"limiting $H_s$"),
        (right, "what binds"),
    ):
        _rose(axes, contour.periods)
        axes.set_title(text, fontsize=10.0, loc="center", pad=12.0)
    best = float(np.degrees(contour.headings[int(limit.mean(axis=1).argmax())]))
    finding = f"Best on average at a heading of {best:.0f} deg; rings are $T_p$, the bow is up"
    return headline(figure, finding)


@drawn
def scatter_figure(study: Operability) -> Figure:
    """Return the scatter diagram, the limits across it, and the share of each month if known."""
    at = study.depths[0]
    scatter = study.scatter
    assert scatter is not None
    months = at.workable["held"].by_month
    main = "loop" if "loop" in at.contours else "held"
    h = study.own_heading(at.main)
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
            vaning = contour.limit.max(axis=0)
            limit_line(axes, contour.periods, vaning, top, colour, label=label, **style)
    _frame(axes, at.main.periods, top, r"$H_s$ [m]")
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


def _around(headings: FloatArray) -> FloatArray:
    """Return the edges of sectors [rad], waves coming from there."""
    edges = _edges(headings, math.radians(15.0))
    if goes_round(headings):
        seam = 0.5 * (headings[-1] + headings[0] + 2.0 * math.pi)
        edges[[0, -1]] = seam - 2.0 * math.pi, seam
    return edges + math.pi


def _edges(centres: FloatArray, half: float) -> FloatArray:
    """Return the edges of cells about ascending centres; `half` is half the width of one alone."""
    if centres.size == 1:
        return np.array([centres[0] - half, centres[0] + half])
    middle = 0.5 * (centres[:-1] + centres[1:])
    first, last = 1.5 * centres[0] - 0.5 * centres[1], 1.5 * centres[-1] - 0.5 * centres[-2]
    return np.concatenate([[first], middle, [last]])


def _rose(axes: Any, periods: FloatArray) -> None:
    """Set a polar axis: bow up, radius the peak period."""
    bow_up(axes)
    axes.set_ylim(0.0, _edges(periods, 0.5)[-1])
    rings = [t for t in (5.0, 10.0, 15.0, 20.0) if t < periods[-1]]
    axes.set_yticks(rings, [f"{t:g} s" for t in rings], fontsize=7.5, color="white")
    axes.set_axisbelow(False)
    axes.grid(color="white", linewidth=0.5, alpha=0.7)
    axes.tick_params(axis="x", pad=9.0, labelsize=8.0)
