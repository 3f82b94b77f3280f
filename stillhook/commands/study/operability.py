"""`stillhook operability`: in which seas the winch can work, and how much of the year that is.

Exit status 0 if the contour was found and its points stood up to single evaluations; 1 if the
design is unstable, works in no sea at all, or a point did not.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError

from ...text import OutputFolder, csv_text, pictures
from ..declare import CASE, DESIGN, REQUIRED, STILLNESS, options
from ..given import case_words, given_case
from ..given_design import design_words, given_design, with_design
from ..lists import axis, quantity
from ..weather import WEATHER, asked_weather, found_windows
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from synth.operability import Operability

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
        """,
        tp=axis(1.0),
        headings=axis(30.0),
    ),
    STILLNESS,
    WEATHER,
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
EXAMPLES = (
    (
        "stillhook operability thesis-1975 --tp 7,9,11 --payload-rms '100 mm'",
        "the highest sea at three peak periods that leaves the payload 100 mm",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Find the contours, show and save them; return the exit status."""
    if arguments.held and (arguments.design or arguments.gains or arguments.reoptimise):
        raise InputError("operability: --held goes without --design, --gains and --reoptimise")
    if arguments.rules and arguments.scatter is None:
        raise InputError("operability: --rules goes with --scatter FILE")
    case = given_case(arguments)
    rule, seas = asked_weather(arguments)
    source = case if arguments.held else given_design(case, arguments)
    folder = prepared(arguments, case.name, "-operability")
    from synth.operability import operability, recheck_records

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
            **{name: getattr(arguments, name) for name in REQUIRED},
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
            windows = found_windows(study, seas, rule, arguments)
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
