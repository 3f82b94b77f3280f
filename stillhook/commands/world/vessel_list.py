"""`stillhook vessel list`: the vessels that come with the toolkit."""

import argparse

from ...text import Report, ReportSection, pairs
from ..declare import Declaration
from ..working import conclude

ARGUMENTS: tuple[Declaration, ...] = ()
EXAMPLES = (("stillhook vessel list", "the vessels that come with the toolkit"),)


def run(arguments: argparse.Namespace) -> int:
    """List them; return 0."""
    from models.vessel.readers import bundled_vessels

    found = bundled_vessels()
    rows = [("look at one", f"stillhook vessel import {name}") for name, _ in found[:1]]
    rows.append(("a vessel from its main dimensions", "stillhook vessel hull --help"))
    report = Report(name="bundled vessels", sections=[ReportSection("", [pairs(found)])])
    return conclude(report, arguments, following=rows)
