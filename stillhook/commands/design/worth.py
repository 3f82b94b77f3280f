"""`stillhook worth`: what each limit, sensor and delay is worth, and what to buy first."""

from __future__ import annotations

import argparse
import math
import shlex
from typing import TYPE_CHECKING

from ...text import OutputFolder, pictures
from ..declare import CASE, options
from ..given import case_words, given_case
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from synth.sizing import Worth

ARGUMENTS = (
    CASE,
    options(
        """
        --structure NAME [payload-feedback]  controller structure (default: payload-feedback)
        --starts N [4]  starts of the search
        --seed N [0]  seed of the starts
        --out DIR  folder for the results (default: out/<case>-worth)
        """
    ),
)
EXAMPLES = (
    (
        "stillhook worth thesis-1975 --starts 1",
        "what a better sensor, a shorter delay or a larger motor would bring",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Price everything, show and save; return 0 if there is an optimum to begin with, else 1."""
    from synth.sizing import worth
    from synth.structures import structure_aboard

    case = given_case(arguments)
    structure_aboard(arguments.structure, case)
    folder = prepared(arguments, case.name, "-worth")
    folder.write("case.yaml", case.to_yaml())
    with working(arguments) as step:
        result = worth(
            case,
            structure=arguments.structure,
            starts=arguments.starts,
            seed=arguments.seed,
            progress=step,
        )
    from ...designs import worth_report

    report = worth_report(result)
    if result.rows:
        folder.write("worth.csv", result.to_csv())
        folder.draw(report.drawings)
    folder.discard("worth.csv", *pictures("worth"))
    status = conclude(report, arguments, folder, _next(result, arguments, folder))
    return status if result.rows else 1


def _next(
    result: Worth, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    words = case_words(arguments, folder)
    structure = f" --structure {result.structure}"
    target = shlex.quote(f"{1e3 * result.payload_rms:.3g} mm")
    size = f"stillhook size {words} --target {target}{structure}"
    if not result.rows:
        rows = [("the controller itself", f"stillhook optimise {words}{structure}")]
        if math.isfinite(result.payload_rms) and result.payload_rms > 0.0:
            rows.append(("a motor that can do it", size))
        return rows
    if result.case.limits.drive == "enforce":
        return [("the smallest motor that does as well", size)]
    return [("the best gear", f"stillhook size {words} --co-design{structure}")]
