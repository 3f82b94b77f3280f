"""`stillhook bound`: the best that any linear controller of a case could do with its sensors."""

from __future__ import annotations

import argparse

from models.basics import InputError, check_range

from ...text import commands, console, progress
from ..given import case_words, given_case


def run(arguments: argparse.Namespace) -> int:
    """Compute and show the bound; return 0, or 1 where no linear controller keeps the limits."""
    case = given_case(arguments)
    check_range("--faint", "noise", arguments.faint, low=0.0, open_low=True)
    heard = None
    if arguments.sensors is not None:
        heard = [name.strip() for name in arguments.sensors.split(",") if name.strip()]
        if not heard:
            raise InputError("--sensors: names of measurements with commas between, got none")
    from synth.bound import bound_for

    with progress(shown=not arguments.quiet) as tell:
        tell("bound", 0, 1)
        found = bound_for(case, masses=arguments.masses, measurements=heard, faint=arguments.faint)
        tell("bound", 1, 1)
    out, words = console(), case_words(arguments, None)
    text = str(found).partition("\n")[0] if arguments.quiet else str(found)
    out.print(text, soft_wrap=True)
    if not arguments.quiet:
        gains = ("gains of payload feedback", f"stillhook optimise {words}")
        commands([gains, ("other structures", f"stillhook structures {words}")], out)
    return 0 if found.feasible else 1
