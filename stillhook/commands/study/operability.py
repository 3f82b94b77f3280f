"""`stillhook operability`: in which seas the winch can work, and how much of the year that is.

Exit status 0 if the contour was found and its points stood up to single evaluations; 1 if the
design is unstable, works in no sea at all, or a point did not.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError

from ...text import OutputFolder, csv_text, pictures
from ..declare import CASE, DESIGN, options, within
from ..given import case_words, given_case
from ..given_design import design_words, given_design, with_design
from ..lists import axis, quantity
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from models.sea import SeaSeries
    from synth.operability import Operability, VesselHeading

_RECORDS = 3  # that are evaluated by themselves
_HEIGHT = quantity("length", 0.0, 1e3, open_low=True)

ARGUMENTS = (
    CASE,
    DESIGN,
    options(
        """
        --held  no design: the drum held and a perfect winch only
        --tp LOW..HIGH[/STEP]|A,B,..  peak periods [s], as in 5..15, 5..15/0.5 or 6,8,10 (default:
            4..18, or those of the scatter diagram)
        --headings LOW..HIGH[/STEP]|A,B,..  headings [deg], where the waves travel to, 180 head sea,
            as in 0..345/15 or 90,135,180 (default: 0..330/30 of a vessel with raos)

        how still the payload must be:
        --payload-rms LENGTH  standard deviation of its motion, as in '50 mm'
        --payload-significant LENGTH  significant double amplitude, 4 sigma
        --payload-max LENGTH  most probable maximum amplitude in the case's exposure time
        --payload-speed SPEED  most probable maximum of its speed, as in '0.5 m/s'
        --daf RATIO  largest dynamic amplification factor at the load's end of the rope, as in 1.3
        --snap SHARE  largest share of the load's weight that the dynamic tension there may take up
            before the rope is slack and snaps taut, as in 0.9
        """,
        tp=axis(1.0),
        headings=axis(30.0),
        daf=within(low=1.0, high=10.0, open_low=True),
    ),
    options(
        """
        weather windows:
        --seas FILE  H_s, T_p and direction in time (`stillhook sea FILE` tells what is read);
            `example` is a made-up year
        --place PLACE  one place of a file that has several, as LAT,LON of a grid
        --duration TIME  planned time of the operation T_POP, as in 12h
        --contingency TIME  contingency T_C (default: T_POP); the window T_R = T_POP + T_C is 72 h
            at most
        --heading DEG|DEG+-X|+-X|best  the bow by the compass, or the best within so much of it, of
            head seas, or of all (default: the case's heading to the waves)
        --alpha NUMBER|FILE  factor on the limiting H_s, or your table of it (default: 1)
        --forecast-level LEVEL  level of the weather forecast in that table
        """,
    ),
    options(
        """
        --depths A,B,..  lengths of rope paid out [m], as in 100,500,1000 (default: the case's)
        --scatter FILE  scatter diagram (.csv): the share of the year that is workable; `example` is
            a made-up one
        --rules  beside it the shares by the rules of thumb of the 1975 thesis
        --reoptimise  also find the gains anew for each sea (seconds for each)
        --highest LENGTH [30 m]  highest H_s looked at (default: 30 m)
        --out DIR  folder for the results (default: out/<case>-operability)
        """,
        depths=axis(None),
        highest=_HEIGHT,
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Find the contours, show and save them; return the exit status."""
    if arguments.held and (arguments.design or arguments.gains or arguments.reoptimise):
        raise InputError("operability: --held goes without --design, --gains and --reoptimise")
    if arguments.rules and arguments.scatter is None:
        raise InputError("operability: --rules goes with --scatter FILE")
    case = given_case(arguments)
    rule, seas = _asked(arguments)
    source = case if arguments.held else given_design(case, arguments)
    folder = prepared(arguments, case.name, "-operability")
    from synth.operability import operability, recheck_records, weather_windows

    from ...seas import (
        FIGURES,
        WINDOW_FIGURES,
        netcdf,
        operability_report,
        save_windows,
        window_list,
        windows_section,
        windows_table,
        workable_table,
    )

    angles = arguments.headings
    with working(arguments) as step:
        study = operability(
            source,
            periods=arguments.tp,
            headings=None if angles is None else [float(np.radians(a)) for a in angles],
            payload_rms=arguments.payload_rms,
            payload_significant=arguments.payload_significant,
            payload_max=arguments.payload_max,
            payload_speed=arguments.payload_speed,
            daf=arguments.daf,
            snap=arguments.snap,
            depths=arguments.depths,
            scatter=arguments.scatter,
            seas=seas,
            vessel_heading=rule,
            reoptimise=arguments.reoptimise,
            highest=arguments.highest,
            progress=step,
        )
        step("verify", 0, 1)
        checks = study.verify()
        report = operability_report(study, checks, rules=arguments.rules)
        if seas is not None:
            windows = weather_windows(
                study,
                seas,
                arguments.duration,
                contingency=arguments.contingency,
                heading=rule,
                alpha=arguments.alpha or 1.0,
                forecast_level=arguments.forecast_level,
            )
            section = windows_section(windows, recheck_records(study, windows, _RECORDS))
            report = replace(report, sections=[*report.sections, section])
            folder.write("windows.csv", csv_text(windows_table(windows)))
            folder.write("window_list.csv", csv_text(window_list(windows)))
            folder.keep(save_windows(folder.path / "windows.nc", windows))
        if study.design is not None:
            report = with_design(report, study.design, case, arguments)
        folder.write("case.yaml", study.case.to_yaml())
        folder.write("operability.csv", study.to_csv())
        folder.write("operability.nc", netcdf(study.dataset))
        if study.scatter is not None:
            folder.write("workable.csv", csv_text(workable_table(study)))
        folder.draw(report.drawings, progress=step)
        every = ("workable.csv", "windows.csv", "window_list.csv", "windows.nc")
        folder.discard(*every, *pictures(*FIGURES, *WINDOW_FIGURES))
    return conclude(report, arguments, folder, _next(study, arguments, folder))


def _asked(arguments: argparse.Namespace) -> tuple[VesselHeading | None, SeaSeries | None]:
    """Return the vessel's heading and the seas that windows are counted in, None without.

    Whatever can be wrong about them is told before anything is computed.
    """
    words = ("place", "duration", "contingency", "heading", "alpha", "forecast_level")
    if arguments.seas is None:
        given = [word for word in words if getattr(arguments, word) is not None]
        if given:
            name = given[0].replace("_", "-")
            raise InputError(f"operability: --{name} is for weather windows; give --seas FILE, too")
        return None, None
    if arguments.duration is None:
        raise InputError("operability: --seas needs --duration, the planned time, as in 12h")
    from models.sea import read_series
    from synth.operability import alpha_factor, example_series, window_times

    planned, _ = window_times(arguments.duration, arguments.contingency)
    alpha_factor(arguments.alpha or 1.0, planned, arguments.forecast_level)
    rule = _heading(arguments.heading)
    if arguments.seas == "example":
        seas = example_series()
    else:
        seas = read_series(arguments.seas, place=arguments.place)
    if rule.bow is not None:
        seas.relative(rule.bow)
    return rule, seas


def _heading(text: str | None) -> VesselHeading:
    """Return how the vessel lies, from DEG, DEG+-X, +-X or `best`."""
    from synth.operability import VesselHeading

    if text is None:
        return VesselHeading()
    if text == "best":
        return VesselHeading(within=math.pi)
    bow, sign, within = text.replace("\u00b1", "+-").partition("+-")
    try:
        angles = [math.radians(float(part)) if part.strip() else None for part in (bow, within)]
    except ValueError:
        angles = [None, None]
    if angles == [None, None] or (sign and angles[1] is None):
        raise InputError(
            f"operability: --heading must be DEG, DEG+-X, +-X or best, in degrees; got {text!r}"
        )
    return VesselHeading(bow=angles[0], within=angles[1] or 0.0)


def _next(
    study: Operability, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    words = case_words(arguments, folder)
    given = ["--held"] if arguments.held else design_words(arguments)
    design = "".join(f" {word}" for word in given)
    rows = []
    if not study.wanted:
        again = f"stillhook operability {words}{design} --payload-rms '50 mm'"
        rows.append(("with a bound on the payload's motion", again))
    if arguments.seas is None and study.scatter is None:
        again = f"stillhook operability {words}{design} --scatter example"
        rows.append(("how much of a (made-up) year is workable", again))
        again = f"stillhook operability {words}{design} --seas example --duration 12h"
        rows.append(("how long one waits for a window of (made-up) weather", again))
    if len(study.depths) == 1:
        length = study.case.rope.length
        again = f"--depths {0.25 * length:.4g},{0.5 * length:.4g},{length:.4g}"
        rows.append(("at other depths", f"stillhook operability {words}{design} {again}"))
    rows.append(("other structures", f"stillhook structures {words}"))
    return rows
