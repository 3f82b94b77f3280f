"""`stillhook evaluate`: what gains do that somebody else has chosen."""

from __future__ import annotations

import argparse

from models.basics import InputError

from ...text import OutputFolder, commands, console, progress, show_design
from ..given import case_words, given_case, parse_gains


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
    folder = None if arguments.out is None else OutputFolder.prepare(arguments.out)
    from synth import evaluate_gains

    with progress(shown=not arguments.quiet) as tell:
        design = evaluate_gains(case, gains)
        if folder is not None:
            from ...designs import write_report

            write_report(folder.path, design=design, bound=arguments.bound, progress=tell)
    out = console()
    if arguments.quiet:
        out.print(f"{case.name}: {design.status}", soft_wrap=True)
        return 0 if design.ok else 1
    show_design(design, out, bound=arguments.bound)
    out.print()
    if folder is not None:
        out.print(f"Written to {folder.path}: summary.md, design.yaml, figures", soft_wrap=True)
    words = case_words(arguments, None if folder is None else str(folder.path / "case.yaml"))
    commands([("the best gains for this case", f"stillhook optimise {words}")], out)
    return 0 if design.ok else 1
