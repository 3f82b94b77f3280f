"""The design of a command: a file that was written, gains, those of the case, or the best one."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from typing import TYPE_CHECKING

from models.basics import InputError, SynthesisError

from ..text import Report, ReportSection

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design


def design_words(arguments: argparse.Namespace) -> list[str]:
    """Return the words of a command that name the same design again."""
    if arguments.design is not None:
        return [f"--design {shlex.quote(arguments.design)}"]
    words = [] if arguments.structure is None else [f"--structure {arguments.structure}"]
    if arguments.gains is not None:
        words.append(f"--gains {shlex.quote(arguments.gains)}")
    return words


def names_design(case: Case, arguments: argparse.Namespace) -> bool:
    """Return whether a file, gains or the case say which design is meant."""
    if arguments.design is not None or arguments.gains is not None:
        return True
    return arguments.structure is None and case.gains is not None


def given_design(case: Case, arguments: argparse.Namespace, *, search: bool = True) -> Design:
    """Return the parameters of a file, those given, the gains in use or the best, on the case.

    The best ones, of the structure that is named if one is, are searched for where there are no
    others, if `search`.

    Raises InputError if a file and gains are given, the file holds no design, or there is none and
    no search; SynthesisError if no design was found.
    """
    # Here, as the parser imports this file and has to be quick.
    from synth import evaluate_gains

    from .given import parse_gains

    if arguments.design is not None:
        if arguments.gains is not None or arguments.structure is not None:
            raise InputError(
                f"{arguments.command}: give --design, or --structure and --gains, not both"
            )
        from ..designs import load_design

        design = load_design(arguments.design)
        if not design.parameters:
            raise InputError(f"{arguments.design}: has no controller: {design.status}")
        return evaluate_gains(case, design)
    if names_design(case, arguments):
        structure = arguments.structure or "payload-feedback"
        gains = case.gains if arguments.gains is None else parse_gains(arguments.gains, structure)
        return evaluate_gains(case, gains, structure)
    if not search:
        raise InputError(
            f"{case.source}: gains: the case has none in use; give them, as in --gains "
            "A=1,a=0,a1=0,a2=0.5, or --design with a design.yaml that `stillhook optimise` wrote"
        )
    from ..designs import best_design
    from .working import working

    with working(arguments) as step:
        design = best_design(case, arguments.structure, progress=step)
    if not design.parameters:
        raise SynthesisError(f"no design was found for {case.name}: {design.status}")
    return evaluate_gains(case, design)


def with_design(
    report: Report, design: Design, case: Case, arguments: argparse.Namespace
) -> Report:
    """Return a report on a design, that says which one it is where nobody has named it."""
    if names_design(case, arguments):
        return report
    mark = "" if design.ok else f", NOT OK ({design.status})"
    text = f"design: {design.structure}, found for this case{mark}; give --design to use another"
    return replace(report, sections=[ReportSection("", [text]), *report.sections])
