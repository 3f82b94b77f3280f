"""`stillhook evaluate`: what gains do that somebody else has chosen."""

from __future__ import annotations

import argparse

from models.basics import InputError

from ...text import progress
from ..declare import CASE, NO_BOUND, text
from ..given import case_words, given_case, parse_gains
from ..working import conclude, prepared

ARGUMENTS = (
    CASE,
    text("--gains", "A=..,a=..,a1=..,a2=..", "the gains (default: those that the case has in use)"),
    text("--out", "DIR", "folder for the results (default: none)"),
    NO_BOUND,
)


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, show and (if asked) save; return 0 if the design is ok, 1 if not."""
    case = given_case(arguments)
    if arguments.gains is not None:
        gains = parse_gains(arguments.gains)
    elif case.gains is not None:
        gains = {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    else:
        raise InputError(
            f"{case.source}: gains: the case has none in use; give them, as in "
            "--gains A=1,a=0,a1=0,a2=0.5"
        )
    folder = None if arguments.out is None else prepared(arguments, case.name)
    from synth import evaluate_gains

    from ...designs import design_data, design_report, write_report

    written = []
    with progress(shown=not arguments.quiet) as tell:
        design = evaluate_gains(case, gains)
        if folder is not None:
            written = write_report(folder, design=design, bound=arguments.bound, progress=tell)
    words = case_words(arguments, None if folder is None else str(folder.path / "case.yaml"))
    again = [("the best gains for this case", f"stillhook optimise {words}")]
    report = design_report(design, bound=arguments.bound and not arguments.quiet)
    return conclude(
        report,
        arguments,
        written=written,
        following=lambda: again,
        result=lambda: design_data(design),
    )
