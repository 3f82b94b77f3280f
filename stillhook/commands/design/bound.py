"""`stillhook bound`: the best that any linear controller of a case could do with its sensors."""

import argparse

from ...text import Report, ReportSection
from ..declare import CASE, options, within
from ..given import case_words, given_case
from ..lists import names
from ..working import conclude, working

ARGUMENTS = (
    CASE,
    options(
        """
        --sensors A,B,..  what a controller may hear, as in payload.displacement,mru.heave (default:
            all)
        --masses N  masses along the rope
        --faint R [0.001]  noise of a sensor that the case calls exact, over the hook's rms
        """,
        sensors=names,
        faint=within(low=0.0, open_low=True),
    ),
)
EXAMPLES = (
    ("stillhook bound thesis-1975", "the least motion that any linear controller can leave"),
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
