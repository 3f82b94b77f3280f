"""`stillhook evaluate`: what gains do that somebody else has chosen."""

import argparse

from ..declare import CASE, DESIGN, NO_BOUND, options
from ..given import case_words, given_case
from ..given_design import given_design, with_design
from ..working import conclude, prepared, working

ARGUMENTS = (
    CASE,
    DESIGN,
    options("--out DIR  folder for the results (default: none)"),
    NO_BOUND,
)
EXAMPLES = (
    ("stillhook evaluate thesis-1975", "the gains that a case has in use, held against its limits"),
    (
        "stillhook evaluate thesis-1975 --gains A=200,a=30,a1=60,a2=60 --no-bound",
        "other gains, at once",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, show and (if asked) save; return 0 if the design is ok, 1 if not."""
    case = given_case(arguments)
    from ...designs import design_data, design_report, write_design

    folder = None if arguments.out is None else prepared(arguments, case.name)
    design = given_design(case, arguments)
    with working(arguments) as tell:
        if folder is not None:
            write_design(folder, design=design, bound=arguments.bound, progress=tell)
    structure = "" if design.gains else f" --structure {design.structure}"
    again = [
        ("the best for this case", f"stillhook optimise {case_words(arguments, folder)}{structure}")
    ]
    report = design_report(design, bound=arguments.bound and not arguments.quiet)
    report = with_design(report, design, case, arguments)
    return conclude(report, arguments, folder, again, result=design_data(design))
