"""`stillhook motion`: what the hook does, over headings, peak periods and sides of the ship.

A first look at a lift, before any controller: how fast a winch would have to be, and which heading
and side ask least of it.
"""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError
from models.vessel import side_of

from ...text import (
    OutputFolder,
    commands,
    console,
    duration,
    folder_name,
    heading_text,
    number,
    pairs,
    percent,
    quantity,
    sea_words,
    vessel_words,
)
from ...text.terminal import _put, _table
from ..given import case_words, given_case

if TYPE_CHECKING:
    from rich.console import Console

    from models import Case
    from models.hook import HookSurvey

_ROWS = 12  # of a table over headings on the terminal


def run(arguments: argparse.Namespace) -> int:
    """Survey the hook's motion, show it and save it; return 0."""
    from models.hook import hook_motion

    headings = _optional("--headings", arguments.headings, 15.0, -360.0, 360.0)
    periods = _optional("--tp", arguments.tp, 1.0, 1.0, 40.0)
    case = given_case(arguments)
    if headings is not None and case.vessel.raos is None:
        raise InputError(
            f"--headings: {arguments.case} has vessel.heave_rao, the heave of one hook in one "
            "heading; give vessel.raos, hook and heading to look at others"
        )
    survey = hook_motion(case, headings=headings, peak_periods=periods, fractile=arguments.fractile)
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-motion")
    written = _write(survey, folder)
    out = console()
    _show_own(survey, out)
    if arguments.quiet:
        return 0
    out.print()
    _show_periods(survey, out)
    if survey.headings.size:
        out.print()
        _show_headings(survey, out)
    out.print()
    out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    commands(_next(survey, arguments, folder), out)
    return 0


def parse_steps(option: str, text: str, step: float, low: float, high: float) -> tuple[float, ...]:
    """Return numbers from `A,B,..` or from a range `LOW..HIGH` in steps.

    Raises
    ------
    InputError
        If the text is neither, or a number is out of range.

    Examples
    --------
    >>> parse_steps("--tp", "6..9", 1.0, 1.0, 40.0), parse_steps("--tp", "6, 8.5", 1.0, 1.0, 40.0)
    ((6.0, 7.0, 8.0, 9.0), (6.0, 8.5))
    """
    first, dots, last = text.partition("..")
    try:
        if dots:
            ends = float(first), float(last)
            if not ends[0] < ends[1] or not all(math.isfinite(v) for v in ends):
                raise ValueError
            count = math.floor((ends[1] - ends[0]) / step + 1e-9)
            values = tuple(ends[0] + step * k for k in range(count + 1))
        else:
            values = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option}: must be numbers A,B,.. or LOW..HIGH, got {text!r}") from None
    wrong = next((v for v in values if not low <= v <= high), None)
    if wrong is not None:
        raise InputError(f"{option}: must be in [{low:g}, {high:g}], got {wrong:g}")
    return values


def _optional(
    option: str, text: str | None, step: float, low: float, high: float
) -> tuple[float, ...] | None:
    return None if text is None else parse_steps(option, text, step, low, high)


def _show_own(survey: HookSurvey, out: Console) -> None:
    case, own = survey.case, survey.own
    out.print(f"{case.name}: {sea_words(case)}", style="bold", soft_wrap=True)
    out.print(vessel_words(case), soft_wrap=True)
    out.print()
    longest = duration(own.duration)
    share = f"{100.0 * own.probability:g} % below"
    table = _table("hook", "rms", "2 rms", "T_z", "width", f"{longest} max", share)
    for m in own.motions:
        table.add_row(
            {"velocity": "speed"}.get(m.name, m.name),
            quantity(m.rms, m.unit),
            quantity(m.significant_amplitude, m.unit),
            quantity(m.zero_crossing_period, "s"),
            number(m.width, 2),
            quantity(m.largest, m.unit),
            quantity(m.fractile(own.probability), m.unit),
        )
    _put(table, out)
    out.print(f"  width: 0 is a sine; {longest} max: most probable; {share}: that fractile of it")
    out.print()
    pairs(_demand(survey), out)


def _demand(survey: HookSurvey) -> list[tuple[str, str]]:
    """Return what a winch that follows the hook has to do, beside what the case's can."""
    case, own = survey.case, survey.own
    winch = case.winch
    fastest = winch.speed_limit * case.drum_radius / winch.gearbox.ratio
    speed, power = own.velocity, own.peak_power
    can = f"; this winch can {quantity(fastest, 'm/s')}, {percent(speed.largest / fastest)} used"
    limit = winch.drive.power
    has = "" if limit is None else f"; the drive has {quantity(limit, 'W')}"
    return [
        ("to follow the hook", f"rope speed {quantity(speed.largest, 'm/s')}{can}"),
        ("", f"acceleration {quantity(own.acceleration.largest, 'm/s2')}"),
        ("power", f"{quantity(power, 'W')} at {quantity(own.tension, 'N')}, no losses{has}"),
        ("", f"{quantity(own.mean_power, 'W')} mean, to and fro"),
    ]


def _show_periods(survey: HookSurvey, out: Console) -> None:
    side, heading = _own_place(survey)
    what = "" if not survey.headings.size else f", {heading_text(survey.headings[heading])}"
    table = _table("T_p", "displacement", "speed", "acceleration", "max speed", "power", "")
    for t, period in enumerate(survey.peak_periods):
        demand = survey.figures(side, heading, t)
        table.add_row(
            quantity(float(period), "s"),
            quantity(demand.displacement.rms, "m"),
            quantity(demand.velocity.rms, "m/s"),
            quantity(demand.acceleration.rms, "m/s2"),
            quantity(demand.velocity.largest, "m/s"),
            quantity(demand.peak_power, "W"),
            "too steep" if survey.steep[t] else "",
        )
    out.print(f"over the peak period, rms{what}:")
    _put(table, out)
    if survey.steep.any():
        out.print("  too steep: such waves break, seas of this H_s and T_p are not observed")
    if not survey.headings.size:
        out.print("  over the peak period only: heave_rao holds for one hook in one heading")


def _show_headings(survey: HookSurvey, out: Console) -> None:
    t = survey.nearest_period
    sides = [side_of(point) for point in survey.points]
    columns = [what for side in sides for what in (side, "max", "power")]
    table = _table("towards", *columns)
    size = float(np.max(survey.rms("velocity")[:, :, t]))
    every = max(1, -(-survey.headings.size // _ROWS))
    best = survey.best
    for h, heading in enumerate(survey.headings):
        if h % every and h != best[1]:
            continue
        cells = []
        for s in range(len(sides)):
            demand = survey.figures(s, h, t)
            mark = " *" if (s, h) == best else ""
            cells += [
                quantity(demand.velocity.rms, "m/s", size=size) + mark,
                quantity(demand.velocity.largest, "m/s", size=size),
                quantity(demand.peak_power, "W"),
            ]
        table.add_row(f"{math.degrees(heading) % 360.0:.4g} deg", *cells)
    period = quantity(float(survey.peak_periods[t]), "s")
    out.print(f"over the waves' heading, T_p {period}: rope speed rms, largest, power:")
    _put(table, out)
    out.print("  0 following, 90 from starboard, 180 head sea, 270 from port; * least speed")


def _own_place(survey: HookSurvey) -> tuple[int, int]:
    """Return the indices of the case's own side and of the heading next to its own."""
    heading = survey.case.vessel.heading
    if heading is None or not survey.headings.size:
        return 0, 0
    return 0, int(np.argmax(np.cos(survey.headings - heading)))


def _write(survey: HookSurvey, folder: OutputFolder) -> list[str]:
    from ...seas import motion_figure, spectra_figure
    from ...text import picture

    folder.write("case.yaml", survey.case.to_yaml())
    folder.write("motion.csv", survey.to_csv())
    figures = {"motion": motion_figure(survey), "spectra": spectra_figure(survey)}
    for name, figure in figures.items():
        for kind in ("svg", "png"):
            folder.write(f"{name}.{kind}", picture(figure, kind))
    return ["case.yaml", "motion.csv", *(f"{n}.{k}" for n in figures for k in ("svg", "png"))]


def _next(
    survey: HookSurvey, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    case: Case = survey.case
    words = case_words(arguments, str(folder.path / "case.yaml"))
    rows = [("the gains for it", f"stillhook optimise {words}")]
    if survey.headings.size and survey.best != _own_place(survey):
        side, heading = survey.best
        turned = f"'vessel.heading={math.degrees(survey.headings[heading]) % 360.0:.4g} deg'"
        change = f"--set {turned}"
        if side and case.vessel.crane is None:
            x, y, z = survey.points[side]
            change += f" --set 'vessel.hook={{x: {x:g}, y: {y:g}, z: {z:g}}}'"
        elif side and case.vessel.crane is not None:
            crane = case.vessel.crane
            change += f" --set vessel.crane.y={-crane.y:g} --set vessel.crane.slew={-crane.slew:g}"
        rows.append(("where the hook moves least", f"stillhook motion {words} {change}"))
    quoted = shlex.quote(arguments.case)
    rows.append(
        ("another sea", f"stillhook motion {quoted} --set sea.significant_height=1.5 --tp 6..12")
    )
    return rows
