"""The design that the user names: a file that was written, gains, or those that the case has."""

from __future__ import annotations

import argparse
import shlex
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design


def design_words(arguments: argparse.Namespace) -> list[str]:
    """Return the words of a command that name the same design again."""
    if arguments.design is not None:
        return [f"--design {shlex.quote(arguments.design)}"]
    if arguments.gains is None:
        return []
    structure = [] if arguments.structure is None else [f"--structure {arguments.structure}"]
    return [*structure, f"--gains {shlex.quote(arguments.gains)}"]


def given_design(case: Case, arguments: argparse.Namespace) -> Design:
    """Return the parameters of a file, those given, or the gains in use, on the case given.

    Raises
    ------
    InputError
        If both are given or neither, or the file holds no design.
    """
    # Here, as the parser imports this file and has to be quick.
    from models.basics import InputError
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
        return evaluate_gains(case, design.parameters, design.structure)
    structure = arguments.structure or "payload-feedback"
    if arguments.gains is not None:
        return evaluate_gains(case, parse_gains(arguments.gains, structure), structure)
    if case.gains is None:
        raise InputError(
            f"{case.source}: gains: the case has none in use; give them, as in --gains "
            "A=1,a=0,a1=0,a2=0.5, or --design with a design.yaml that `stillhook optimise` wrote"
        )
    return evaluate_gains(case, case.gains, structure)
