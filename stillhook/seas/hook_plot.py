"""The figures of the hook's motion: over heading and peak period, and its spectra."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from models.basics import FloatArray
from models.hook import HookDemand, HookMotion, HookSurvey
from models.vessel import side_of

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    heading_words,
    new_figure,
    quantity,
    sea_words,
    styled,
    typeset,
    vessel_words,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes


_MOTIONS = (
    ("displacement", "m", "m$^2$ s/rad"),
    ("velocity", "m/s", "(m/s)$^2$ s/rad"),
    ("acceleration", "m/s$^2$", "(m/s$^2$)$^2$ s/rad"),
)
_SIDES = (AFTER, BEFORE)


def motion_figure(survey: HookSurvey) -> Figure:
    """Return the rope speed that follows the hook, over heading and peak period.

    A case with one heave RAO has no headings: then it is all three motions over the peak period.

    Parameters
    ----------
    survey
        The motion.
    """
    return _by_heading(survey) if survey.headings.size > 2 else _by_period(survey)


def spectra_figure(survey: HookSurvey) -> Figure:
    """Return the spectra of the hook's displacement, velocity and acceleration.

    Parameters
    ----------
    survey
        The motion; its case as it stands, and the same across the ship.
    """
    case = survey.case
    hooks = [("hook", HookMotion.from_case(case, warn=False))]
    if len(survey.points) > 1:
        x, y, z = survey.points[1]
        other = case.replace({"vessel.hook": {"x": x, "y": y, "z": z}, "vessel.crane": None})
        names = [side_of(point) for point in survey.points]
        hooks = [(names[0], hooks[0][1]), (names[1], HookMotion.from_case(other, warn=False))]
    low, top = _shown(hooks[0][1])
    omega = np.linspace(low, top, 800)
    with styled():
        figure = new_figure(height=6.4)
        axes = figure.subplots(3, 1, sharex=True)
        for order, (axis, (name, _, per)) in enumerate(zip(axes, _MOTIONS, strict=True)):
            for k, (side, hook) in enumerate(hooks):
                values = omega ** (2 * order) * hook.density(omega)
                found = HookDemand.from_motion(hook, tension=0.0).motions[order]
                label = f"{side}, {quantity(found.rms, found.unit)} rms"
                axis.plot(omega, values, color=_SIDES[k] if len(hooks) > 1 else HOOK, label=label)
            if order == 0:
                waves = hooks[0][1].sea.density(omega)
                label = "sea, at its own frequency" if case.vessel.moves else "sea"
                axis.plot(omega, waves, ":", color=REFERENCE, linewidth=1.0, label=label)
            axis.set_ylim(bottom=0.0)
            axis.set_ylabel(f"{name}\n[{per}]")
            axis.legend(loc="best")
            axis.set_xlim(omega[0], top)
        met = " of encounter" if case.vessel.moves else ""
        axes[-1].set_xlabel(f"frequency{met} [rad/s]")
        figures = survey.own.motions
        finding = (
            f"The hook moves at {quantity(figures[1].rms, 'm/s')} rms, "
            f"T_z {quantity(figures[0].zero_crossing_period, 's')}"
        )
        _heading(figure, finding, survey)
    return figure


def _by_period(survey: HookSurvey) -> Figure:
    periods = survey.peak_periods
    with styled():
        figure = new_figure()
        axes = figure.subplots(1, 3)
        for axis, (name, unit, _), colour in zip(axes, _MOTIONS, (HOOK, AFTER, DRUM), strict=True):
            for row, style in zip(survey.rms(name)[:, 0], ("-", "--"), strict=False):
                axis.plot(periods, row, style, color=colour, marker="o", markersize=3.5)
            axis.axvline(survey.case.sea.spectral_peak_period, color=REFERENCE, linewidth=0.8)
            axis.set_ylim(bottom=0.0)
            axis.set_title(f"{name} [{unit}]", fontsize=10.0)
            axis.set_xlabel(typeset("T_p") + " [s]")
        _heading(figure, "How the hook's motion, rms, hangs on the waves' period", survey)
    return figure


def _by_heading(survey: HookSurvey) -> Figure:
    from matplotlib.ticker import MaxNLocator

    speeds = survey.rms("velocity")
    t = survey.nearest_period
    names = [side_of(point) for point in survey.points]
    with styled():
        figure = new_figure(width=7.6, height=7.4)
        grid = figure.add_gridspec(2, 2, height_ratios=(1.1, 1.0))
        rose = cast("PolarAxes", figure.add_subplot(grid[0, :], projection="polar"))
        # Bow up and waves drawn where they come from, as seen from the bridge.
        rose.set_theta_zero_location("N")
        order = np.argsort(survey.headings)
        angle = survey.headings[order] - math.pi
        whole = survey.headings.size > 3 and _goes_round(survey.headings)
        for k, name in enumerate(names):
            r = speeds[k, order, t]
            a = angle
            if whole:
                a, r = np.append(a, a[0] + 2.0 * math.pi), np.append(r, r[0])
            rose.plot(a, r, color=_SIDES[k], label=_where(name))
        own = survey.case.vessel.heading
        if own is not None:
            rose.plot(
                [own - math.pi], [survey.own.velocity.rms], "o", color=_SIDES[0], label="this case"
            )
        rose.set_thetagrids(
            range(0, 360, 45),
            ["head", "", "from\nport", "", "following", "", "from\nstarboard", ""],
        )
        rose.tick_params(axis="x", pad=16.0)
        rose.tick_params(axis="y", labelsize=8.0, labelcolor="#666666")
        rose.set_rlabel_position(22.5)
        rose.set_ylim(0.0, None)
        rose.legend(loc="lower left", bbox_to_anchor=(1.2, 0.75))
        period = quantity(float(survey.peak_periods[t]), "s")
        text = typeset(f"rope speed\n[m/s rms]\nT_p {period}")
        rose.text(-0.55, 0.95, text, transform=rose.transAxes, va="top")
        top, drawn = float(speeds.max()), None
        for k, name in enumerate(names):
            axis = figure.add_subplot(grid[1, k] if len(names) > 1 else grid[1, :])
            drawn = _map(axis, survey, k, top) or drawn
            axis.set_title(_where(name), fontsize=10.0)
        if drawn is not None:
            bar = figure.colorbar(drawn, ax=figure.axes[1:], shrink=0.9, pad=0.02)
            bar.ax.yaxis.set_major_locator(MaxNLocator(6))
            bar.set_label("rope speed [m/s rms]")
        side, best = survey.best
        finding = (
            f"Least rope speed, {quantity(float(speeds[side, best, t]), 'm/s')} rms: "
            f"{heading_words(float(survey.headings[best]))}"
            + (f", {_where(names[side])}" if len(names) > 1 else "")
        )
        _heading(figure, finding, survey)
    return figure


def _map(axis: Axes, survey: HookSurvey, side: int, top: float) -> QuadContourSet | None:
    """Draw the speeds of a side over heading and peak period, with contours with their numbers.

    With one peak period there is a line over the heading, and None is returned.
    """
    order = np.argsort(survey.headings)
    speeds = survey.rms("velocity")[side, order]
    degrees = np.degrees(survey.headings[order])
    x, y = survey.peak_periods, degrees
    if x.size < 2:
        axis.plot(y, speeds[:, 0], color=AFTER)
        axis.set_xlabel("waves towards [deg]")
        axis.set_ylim(0.0, 1.05 * top)
        return None
    shades = np.linspace(0.0, 1.0001 * top, 41)
    drawn = axis.contourf(x, y, speeds, levels=shades, cmap="viridis")
    lines = axis.contour(x, y, speeds, levels=6, colors="white", linewidths=0.7)
    axis.clabel(lines, fontsize=8.0, fmt="%.2g")
    axis.grid(False)
    axis.set_yticks(range(0, 361, 90))
    axis.set_ylim(degrees[0], degrees[-1])
    axis.set_xlabel(typeset("T_p") + " [s]")
    axis.set_ylabel("waves towards [deg]")
    own = survey.case.vessel.heading
    if own is not None and side == 0:
        at = (survey.case.sea.spectral_peak_period, math.degrees(own) % 360.0)
        axis.plot(*at, "o", color="white", markeredgecolor=REFERENCE, markersize=5.0, clip_on=True)
    return drawn


def _where(side: str) -> str:
    """Return the hook's side in words."""
    return f"hook on the {side}" if side == "centre line" else f"hook to {side}"


def _goes_round(headings: FloatArray) -> bool:
    gaps = np.diff(np.append(np.sort(headings), np.min(headings) + 2.0 * math.pi))
    return bool(gaps.max() < 1.6 * np.median(gaps))


def _shown(hook: HookMotion) -> tuple[float, float]:
    """Return the frequencies between which there is something to see [rad/s]."""
    omega = np.geomspace(hook.band[0], min(hook.band[1], 6.0), 2000)
    energy = np.cumsum(hook.velocity_density(omega) * omega)
    low, high = np.interp([1e-4 * energy[-1], 0.997 * energy[-1]], energy, omega)
    return 0.8 * float(low), 1.15 * float(high)


def _heading(figure: Figure, finding: str, survey: HookSurvey) -> None:
    """Write what was found, and in small what it is about, above the axes."""
    height = figure.get_figheight()
    title = typeset(finding).replace("T_z", "$T_z$")
    figure.text(0.012, 1.0 - 0.08 / height, title, fontsize=11.0, fontweight="bold", va="top")
    about = _about(survey)
    figure.text(0.012, 1.0 - 0.34 / height, about, fontsize=9.5, color="#555555", va="top")
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0.0, 0.0, 1.0, 1.0 - 0.78 / height))  # type: ignore[call-arg]


def _about(survey: HookSurvey) -> str:
    case = survey.case
    return typeset(f"{case.name}: {sea_words(case)}\n{vessel_words(case)}")
