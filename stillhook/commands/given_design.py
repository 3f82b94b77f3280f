"""The design that the user names: a file that was written, gains, or those that the case has."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from models import Case
    from synth.design import GainDesign, StructureDesign


def design_words(arguments: argparse.Namespace) -> list[str]:
    """Return the words of a command that name the same design again."""
    if arguments.design is not None:
        return [f"--design {shlex.quote(arguments.design)}"]
    if arguments.gains is not None:
        return [f"--gains {shlex.quote(arguments.gains)}"]
    return []


def given_design(case: Case, arguments: argparse.Namespace) -> GainDesign | StructureDesign:
    """Return the design of a file on the case given, or that of gains.

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
        if arguments.gains is not None:
            raise InputError(f"{arguments.command}: give --design or --gains, not both")
        from synth.design import StructureDesign

        from ..designs import read_design

        design = read_design(arguments.design)
        if isinstance(design, StructureDesign):
            return replace(design, case=case)
        return evaluate_gains(case, design.gains)
    if arguments.gains is not None:
        return evaluate_gains(case, parse_gains(arguments.gains))
    if case.gains is None:
        raise InputError(
            f"{case.source}: gains: the case has none in use; give --gains, or --design with a "
            "design.yaml that `stillhook optimise` wrote"
        )
    own = {name: getattr(case.gains, name) for name in ("A", "a", "a1", "a2")}
    return evaluate_gains(case, own)
