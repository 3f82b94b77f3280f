"""The design of a command: a file that was written, gains, those of the case, or the best one."""

from __future__ import annotations

import argparse
import contextlib
import shlex
from dataclasses import replace
from typing import TYPE_CHECKING

from models.basics import InputError, SynthesisError

from ..text import Report, ReportSection

if TYPE_CHECKING:
    from pathlib import Path

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


def given_design(case: Case, arguments: argparse.Namespace) -> Design:
    """Return the parameters of a file, those given, the gains in use or the best, on the case.

    The best ones, of the structure that is named if one is, are searched for where there are no
    others.

    Raises InputError if a file and gains are given, or the file holds no design; SynthesisError if
    no design was found.
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
    from ..designs import best_design
    from .working import working

    with working(arguments) as step:
        design = best_design(case, arguments.structure, progress=step)
    if not design.parameters:
        raise SynthesisError(f"no design was found for {case.name}: {design.status}")
    return evaluate_gains(case, design)


def with_design(
    report: Report, design: Design | None, case: Case, arguments: argparse.Namespace
) -> Report:
    """Return a report on a design, that says which one it is where no option has named it.

    Without one it is on the gains that the case has in use.
    """
    if arguments.design is not None or arguments.gains is not None:
        return report
    other = lying_design(case, design)
    words = "--design" if other is None else f"--design {shlex.quote(str(other))}"
    text = f"design: the gains that the case has in use; give {words} to use another"
    if not names_design(case, arguments):
        assert design is not None
        mark = "" if design.ok else f", NOT OK ({design.status})"
        text = f"design: {design.structure}, found for this case{mark}; give {words} to use another"
    elif other is None:
        return report
    return replace(report, sections=[ReportSection("", [text]), *report.sections])


def lying_design(case: Case, used: Design | None = None) -> Path | None:
    """Return the file of a design for a case where `optimise` leaves one, other than that in use.

    It is told, and not taken unasked: what a command does hangs on its words alone.
    """
    from ..designs import load_design
    from .working import usual_place

    path = usual_place(case.name) / "design.yaml"
    with contextlib.suppress(InputError):  # none there, or not whole
        found = load_design(path)
        mine = used is not None and (found.structure, found.parameters) == (
            used.structure,
            used.parameters,
        )
        if found.case == case and found.parameters and not mine:
            return path
    return None
