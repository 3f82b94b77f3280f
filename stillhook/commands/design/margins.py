"""`stillhook margins`: how far the plant's numbers may be off before a design is unstable."""

import argparse

from models.spread import GAINS

from ...text import Report, ReportSection
from ..declare import CASE, DESIGN, options, within
from ..given import USUALLY_OFF, case_words, given_case, read_pairs
from ..given_design import given_design, with_design
from ..working import conclude, working

ARGUMENTS = (
    CASE,
    DESIGN,
    options(
        """
        --off PATH=SHARE ...  what may be off and how far either way, as in payload.mass=0.3,
            drag=0.5 or 'delay=20 ms' (default: payload.mass=0.3, stiffness=0.2, drag=0.5)
        --draws N [1000]  random plants to check with
        """,
        draws=within(low=0, high=1_000_000),
    ),
)
EXAMPLES = (
    ("stillhook margins thesis-1975 --draws 100", "how far mass, stiffness and drag may be off"),
    (
        "stillhook margins thesis-1975 --off payload.mass=0.5 --off 'delay=20 ms'",
        "half the mass more or less, and telemetry 20 ms later",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Analyse and show; return 0 if the loop is stable over the ranges, 1 if not."""
    case = given_case(arguments)
    off = read_pairs("--off", "PATH=SHARE, as in payload.mass=0.3", arguments.off) or USUALLY_OFF
    design = given_design(case, arguments)
    from synth.robust import robustness

    with working(arguments) as step:
        found = robustness(design, off, draws=arguments.draws, progress=step)
    vary = " ".join(
        f"--vary {path}={low:.5g}..{high:.5g}"
        for path, (low, high) in found.ranges.items()
        if "." in path and not path.startswith(GAINS)
    )
    again = (
        [("gains for the whole range", f"stillhook robust {case_words(arguments)} {vary}")]
        if vary
        else []
    )
    first, *rest = str(found).splitlines()
    report = Report(
        name=case.name,
        about=first,
        status=found.status,
        ok=found.ok,
        sections=[ReportSection("", rest)],
    )
    return conclude(with_design(report, design, case, arguments), arguments, following=again)
