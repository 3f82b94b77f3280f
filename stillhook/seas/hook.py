"""The hook's motion as figures and report: over heading and peak period, and its spectra."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from models.basics import FloatArray
from models.hook import HookMotion, HookSurvey
from models.vessel import side_of

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Column,
    Drawing,
    Figure,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    drawn,
    duration,
    heading_text,
    heading_words,
    new_figure,
    pairs,
    percent,
    quantity,
    sea_words,
    typeset,
    vessel_words,
)

if TYPE_CHECKING:
    from matplotlib.contour import QuadContourSet
    from matplotlib.projections.polar import PolarAxes


_MOTIONS = (
    ("displacement", "m", "m$^2$ s/rad"),
    ("velocity", "m/s", "(m/s)$^2$ s/rad"),
    ("acceleration", "m/s2", "(m/s$^2$)$^2$ s/rad"),
)
_SIDES = (AFTER, BEFORE)
_ROWS = 12  # of the table over headings


def motion_figure(survey: HookSurvey) -> Figure:
    """Return the rope speed that follows the hook, over heading and peak period.

    A case with one heave RAO has no headings: then it is all three motions over the peak period.
    """
    return _by_heading(survey) if survey.headings.size > 2 else _by_period(survey)


@drawn
def spectra_figure(survey: HookSurvey) -> Figure:
    """Return the spectra of the hook's displacement, velocity and acceleration.

    Those of the case as it stands, and the same across the ship.
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
    figure = new_figure(height=6.4)
    axes = figure.subplots(3, 1, sharex=True)
    for order, (axis, (name, unit, per)) in enumerate(zip(axes, _MOTIONS, strict=True)):
        for k, (side, hook) in enumerate(hooks):
            values = omega ** (2 * order) * hook.density(omega)
            label = f"{side}, {quantity(getattr(hook, name).rms, unit)} rms"
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
    return _headed(figure, finding, survey)


@drawn
def _by_period(survey: HookSurvey) -> Figure:
    periods = survey.peak_periods
    figure = new_figure()
    axes = figure.subplots(1, 3)
    for axis, (name, unit, _), colour in zip(axes, _MOTIONS, (HOOK, AFTER, DRUM), strict=True):
        for row, style in zip(survey.rms(name)[:, 0], ("-", "--"), strict=False):
            axis.plot(periods, row, style, color=colour, marker="o", markersize=3.5)
        axis.axvline(survey.case.sea.spectral_peak_period, color=REFERENCE, linewidth=0.8)
        axis.set_ylim(bottom=0.0)
        axis.set_title(f"{name} [{unit}]".replace("s2", "s$^2$"), fontsize=10.0)
        axis.set_xlabel(typeset("T_p") + " [s]")
    finding = "How the hook's motion, rms, hangs on the waves' period"
    return _headed(figure, finding, survey)


@drawn
def _by_heading(survey: HookSurvey) -> Figure:
    from matplotlib.ticker import MaxNLocator

    speeds = survey.rms("velocity")
    t = survey.nearest_period
    names = [side_of(point) for point in survey.points]
    figure = new_figure(width=7.6, height=7.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.1, 1.0))
    rose = cast("PolarAxes", figure.add_subplot(grid[0, :], projection="polar"))
    bow_up(rose)
    order = np.argsort(survey.headings)
    angle = survey.headings[order] - math.pi
    whole = goes_round(survey.headings)
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
    rose.tick_params(axis="x", pad=16.0)
    rose.tick_params(axis="y", labelsize=8.0, labelcolor="#666666")
    rose.set_rlabel_position(22.5)
    rose.set_ylim(0.0, None)
    rose.legend(loc="lower left", bbox_to_anchor=(1.2, 0.75))
    period = quantity(float(survey.peak_periods[t]), "s")
    text = typeset(f"rope speed\n[m/s rms]\nT_p {period}")
    rose.text(-0.55, 0.95, text, transform=rose.transAxes, va="top")
    top, mapped = float(speeds.max()), None
    for k, name in enumerate(names):
        axis = figure.add_subplot(grid[1, k] if len(names) > 1 else grid[1, :])
        mapped = _map(axis, survey, k, top) or mapped
        axis.set_title(_where(name), fontsize=10.0)
    if mapped is not None:
        bar = figure.colorbar(mapped, ax=figure.axes[1:], shrink=0.9, pad=0.02)
        bar.ax.yaxis.set_major_locator(MaxNLocator(6))
        bar.set_label("rope speed [m/s rms]")
    side, best = survey.best
    finding = (
        f"Least rope speed, {quantity(float(speeds[side, best, t]), 'm/s')} rms: "
        f"{heading_words(float(survey.headings[best]))}"
        + (f", {_where(names[side])}" if len(names) > 1 else "")
    )
    return _headed(figure, finding, survey)


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
    shaded = axis.contourf(x, y, speeds, levels=shades, cmap="viridis")
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
    return shaded


def _where(side: str) -> str:
    """Return the hook's side in words."""
    return f"hook on the {side}" if side == "centre line" else f"hook to {side}"


def bow_up(rose: PolarAxes) -> None:
    """Set polar axes over where the waves come from, as seen from the bridge, the bow up."""
    rose.set_theta_zero_location("N")
    names = ("head 180", "225", "from\nport\n270", "315", "following 0", "45")
    rose.set_thetagrids(range(0, 360, 45), [*names, "from\nstarboard\n90", "135"])


def goes_round(headings: FloatArray) -> bool:
    """Return whether headings (n,) [rad] go all round the ship, with no wide gap between."""
    gaps = np.diff(np.append(np.sort(headings), np.min(headings) + 2.0 * math.pi))
    return bool(gaps.max() < math.radians(91.0))


def _shown(hook: HookMotion) -> tuple[float, float]:
    """Return the frequencies between which there is something to see [rad/s]."""
    omega = np.geomspace(hook.band[0], min(hook.band[1], 6.0), 2000)
    energy = np.cumsum(omega**2 * hook.density(omega) * omega)
    low, high = np.interp([1e-4 * energy[-1], 0.997 * energy[-1]], energy, omega)
    return 0.8 * float(low), 1.15 * float(high)


def _headed(figure: Figure, finding: str, survey: HookSurvey) -> Figure:
    """Write what was found above the axes, and in small the sea and the hook; return the figure."""
    case, height = survey.case, figure.get_figheight()
    text = typeset(f"{case.name}: {sea_words(case)}\n{vessel_words(case)}")
    figure.text(0.012, 1.0 - 0.34 / height, text, fontsize=9.5, color="#555555", va="top")
    title = typeset(finding)
    figure.text(0.012, 1.0 - 0.08 / height, title, fontsize=11.0, fontweight="bold", va="top")
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0.0, 0.0, 1.0, 1.0 - 0.78 / height))  # type: ignore[call-arg]
    return figure


def motion_report(survey: HookSurvey) -> Report:
    """Return the hook's motion as the case has it, over peak periods and over headings."""
    case, own = survey.case, survey.own
    longest, share = duration(own.duration), f"{100.0 * own.probability:g} % below"
    heads = columns(
        "motion=hook; rms; 2 rms; zero_crossing_period=T_z [s]; width [2]; "
        f"largest={longest} max; fractile={share}"
    )
    rows = [
        (
            {"velocity": "speed"}.get(name, name),
            _in_unit(m.rms, unit),
            _in_unit(m.significant_amplitude, unit),
            m.zero_crossing_period,
            m.width,
            _in_unit(m.most_probable_maximum(own.duration), unit),
            _in_unit(m.fractile(own.probability, own.duration), unit),
        )
        for (name, unit, _), m in zip(_MOTIONS, own.motions, strict=True)
    ]
    note = f"width: 0 is a sine; {longest} max: most probable; {share}: that fractile of it"
    table = Table(columns=heads, rows=rows, notes=(note,))
    sections = [ReportSection("", [table, pairs(_demand(survey))]), _periods(survey)]
    if survey.headings.size:
        sections.append(_headings(survey))
    drawings = [
        Drawing("motion", "Over heading and period", lambda: motion_figure(survey)),
        Drawing("spectra", "Spectra of the hook", lambda: spectra_figure(survey)),
    ]
    return Report(
        name=case.name,
        about=sea_words(case),
        status=vessel_words(case),
        sections=[*sections, ReportSection("", drawings)],
    )


def own_place(survey: HookSurvey) -> tuple[int, int]:
    """Return the indices of the case's own side and of the heading next to its own."""
    heading = survey.case.vessel.heading
    if heading is None or not survey.headings.size:
        return 0, 0
    return 0, int(np.argmax(np.cos(survey.headings - heading)))


def _in_unit(value: float, unit: str) -> Written:
    return Written(value, quantity(value, unit))


def _demand(survey: HookSurvey) -> list[tuple[str, str]]:
    """Return what a winch that follows the hook has to do, beside what the case's can."""
    case, own = survey.case, survey.own
    winch = case.winch
    fastest = winch.speed_limit * case.haul_radius / winch.gearbox.ratio
    speed, acceleration = (
        motion.most_probable_maximum(own.duration) for motion in (own.velocity, own.acceleration)
    )
    can = f"; this winch can {quantity(fastest, 'm/s')}, {percent(speed / fastest)} used"
    limit = winch.drive.power
    has = "" if limit is None else f"; it has {quantity(limit, 'W')}"
    return [
        ("to follow the hook", f"rope speed {quantity(speed, 'm/s')}{can}"),
        ("", f"acceleration {quantity(acceleration, 'm/s2')}"),
        ("power", f"{quantity(own.peak_power, 'W')} at {quantity(own.tension, 'N')}, no losses"),
        ("", f"{quantity(own.drive_power, 'W')} of the drive, with losses{has}"),
        ("", f"{quantity(own.mean_power, 'W')} mean modulus"),
    ]


def _periods(survey: HookSurvey) -> ReportSection:
    side, heading = own_place(survey)
    what = "" if not survey.headings.size else f", {heading_text(survey.headings[heading])}"
    rows = []
    for t, period in enumerate(survey.peak_periods):
        demand = survey.figures(side, heading, t)
        rms = [motion.rms for motion in demand.motions]
        steep = "too steep" if survey.steep[t] else ""
        largest = demand.velocity.most_probable_maximum(demand.duration)
        rows.append((float(period), *rms, largest, demand.peak_power, steep))
    notes = []
    if survey.steep.any():
        notes.append("too steep: such waves break, seas of this H_s and T_p are not observed")
    if not survey.headings.size:
        notes.append("over the peak period only: heave_rao holds for one hook in one heading")
    heads = columns(
        "peak_period=T_p [s]; displacement [m]; speed [m/s]; acceleration [m/s2]; "
        "largest_speed=max speed [m/s]; power [W]; remark=<"
    )
    table = Table(columns=heads, rows=rows, notes=tuple(notes))
    return ReportSection(f"over the peak period, rms{what}", [table])


def _headings(survey: HookSurvey) -> ReportSection:
    t = survey.nearest_period
    sides = [side_of(point) for point in survey.points]
    size, best = float(np.max(survey.rms("velocity")[:, :, t])), survey.best
    rows = []
    for h, heading in enumerate(survey.headings):
        row: list[Any] = [math.degrees(heading) % 360.0]
        for s in range(len(sides)):
            demand = survey.figures(s, h, t)
            mark = " *" if (s, h) == best else ""
            rms = demand.velocity.rms
            fastest = demand.velocity.most_probable_maximum(demand.duration)
            row.append(Written(rms, quantity(rms, "m/s", size=size) + mark))
            row += [fastest, demand.peak_power]
        rows.append(row)
    heads = [Column("heading", "towards", write=lambda degrees: f"{degrees:.4g} deg")]
    for side in sides:
        largest = Column(f"{side} largest", "max", write=lambda v: quantity(v, "m/s", size=size))
        heads += [Column(side), largest, Column(f"{side} power", "power", unit="W")]
    # So many that the one with the least speed is among them.
    every = max(1, -(-len(rows) // _ROWS))
    shown = [row for h, row in enumerate(rows) if h % every == 0 or h == best[1]]
    note = "0 following, 90 from starboard, 180 head sea, 270 from port; * least speed"
    table = Table(columns=tuple(heads), rows=shown, notes=(note,))
    period = quantity(float(survey.peak_periods[t]), "s")
    title = f"over the waves' heading, T_p {period}: rope speed rms, largest, power"
    return ReportSection(title, [table])
