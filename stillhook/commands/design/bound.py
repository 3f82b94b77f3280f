"""`stillhook bound`: the best that any linear controller of a case could do with its sensors."""

from __future__ import annotations

import argparse

from ...text import Report, ReportSection
from ..declare import CASE, real, text, whole
from ..given import case_words, given_case
from ..lists import names
from ..working import conclude, working

ARGUMENTS = (
    CASE,
    text(
        "--sensors",
        "A,B,..",
        "what a controller may hear, as in payload.displacement,mru.heave (default: all)",
        read=names,
    ),
    whole("--masses", "masses along the rope"),
    real(
        "--faint",
        "R",
        "noise of a sensor that the case calls exact, over the hook's rms",
        1e-3,
        low=0.0,
        open_low=True,
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compute and show the bound; return 0, or 1 where no linear controller keeps the limits."""
    case = given_case(arguments)
    from synth.bound import bound_for

    with working(arguments) as tell:
        tell("bound", 0, 1)
        found = bound_for(
            case, masses=arguments.masses, measurements=arguments.sensors, faint=arguments.faint
        )
        tell("bound", 1, 1)
    words = case_words(arguments)
    following = [
        ("gains of payload feedback", f"stillhook optimise {words}"),
        ("other structures", f"stillhook structures {words}"),
    ]
    verdict, _, rest = str(found).partition("\n")
    report = Report(
        name=case.name,
        status=verdict,
        ok=None if found.free.feasible else False,
        sections=[ReportSection("", [rest])] if rest else [],
    )
    return conclude(report, arguments, following=following)
