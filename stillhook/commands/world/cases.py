"""`stillhook cases`: the bundled cases."""

import argparse

from ...text import Report, ReportSection, pairs
from ..declare import Declaration
from ..working import conclude

ARGUMENTS: tuple[Declaration, ...] = ()
EXAMPLES = (("stillhook cases", "the cases that come with the toolkit"),)


def run(arguments: argparse.Namespace) -> int:
    """List the cases; return 0."""
    from models import bundled_cases

    report = Report(name="bundled cases", sections=[ReportSection("", [pairs(bundled_cases())])])
    return conclude(report, arguments)
