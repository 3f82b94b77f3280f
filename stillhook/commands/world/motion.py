"""`stillhook motion`: what the hook does, over headings, peak periods and sides of the ship.

A first look at a lift, before any controller: how fast a winch would have to be, and which heading
and side ask least of it.
"""

import argparse
import math
import shlex

from models import Case
from models.basics import InputError
from models.hook import HookSurvey

from ...seas import motion_report, own_place
from ...text import OutputFolder
from ..declare import CASE, options
from ..given import case_words, given_case
from ..lists import axis
from ..working import conclude, prepared

ARGUMENTS = (
    CASE,
    options(
        """
        --headings A,B,.. or LOW..HIGH  where the waves travel to, relative to the bow [deg]: 180 is
            a head sea, 90 comes from starboard (default: every 15 degrees)
        --tp A,B,.. or LOW..HIGH  peak periods [s]; a range goes in steps of one second (default:
            5..16)
        --fractile P [0.9]  probability that the largest value of the exposure time stays below the
            second extreme that is told
        --out DIR  folder for the results (default: out/<case>-motion)
        """,
        headings=axis(15.0, -360.0, 360.0),
        tp=axis(1.0, 1.0, 40.0),
    ),
)
EXAMPLES = (
    (
        "stillhook motion subsea-crane --tp 6..12",
        "how fast a winch would have to be, over headings and periods",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Survey the hook's motion, show it and save it; return 0."""
    from models.hook import hook_motion

    headings, case = arguments.headings, given_case(arguments)
    if headings is not None and case.vessel.raos is None:
        raise InputError(
            f"--headings: {arguments.case} has vessel.heave_rao, the heave of one hook in one "
            "heading; give vessel.raos, hook and heading to look at others"
        )
    survey = hook_motion(
        case, headings=headings, peak_periods=arguments.tp, fractile=arguments.fractile
    )
    folder = prepared(arguments, case.name, "-motion")
    report = motion_report(survey)
    folder.write("case.yaml", survey.case.to_yaml())
    folder.write("motion.csv", survey.to_csv())
    folder.draw(report.drawings)
    # The first table is the verdict.
    following = _next(survey, arguments, folder)
    return conclude(report, arguments, folder, following, brief=report.sections[:1])


def _next(
    survey: HookSurvey, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    case: Case = survey.case
    words = case_words(arguments, folder)
    rows = [("the gains for it", f"stillhook optimise {words}")]
    if survey.headings.size and survey.best != own_place(survey):
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
