"""`stillhook structures`: the best controllers of some structures side by side."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...designs import design_data, design_text, structures_report, structures_table
from ...text import OutputFolder, Progress, console, markdown
from ..declare import CASE, NO_BOUND, options
from ..given import case_words, given_case
from ..lists import names
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design

ARGUMENTS = (
    CASE,
    options(
        """
        --structures A,B,..  which (default: all that the case's sensors allow): payload-feedback,
            payload-feedback-rolloff, -lead, -notch, -integral, drum-feedback, feed-forward,
            combined, constant-tension, low-order-N; on request high-order, the best found of any
            order
        --out DIR  folder for the results (default: out/<name of the case>)
        --starts N [8]  starts of each search
        --seed N [0]  seed of the starts
        """,
        structures=names,
    ),
    NO_BOUND,
)
EXAMPLES = (
    (
        "stillhook structures thesis-1975 --structures payload-feedback,low-order-2",
        "two structures, each with the best gains of its own",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compare structures on a case; return 0 if one of them is ok, else 1."""
    from synth.structures import structure_aboard, structures_aboard

    case = given_case(arguments)
    wanted = tuple(dict.fromkeys(arguments.structures or structures_aboard(case)))
    for name in wanted:
        structure_aboard(name, case)  # a name that cannot be ends here, not after minutes
    folder = prepared(arguments, case.name)
    folder.write("case.yaml", case.to_yaml())
    designs: list[Design] = []
    with working(arguments) as tell:
        for k, name in enumerate(wanted):
            designs.append(_design(case, name, arguments, tell, f"{name} ({k + 1}/{len(wanted)})"))
            if arguments.bound:
                tell(f"{name}: bound", 0, 1)
            _write(folder, designs, bound=arguments.bound)
    ok = any(design.ok for design in designs)
    if arguments.quiet:
        for design in designs:
            line = f"{case.name}: {design.structure}: {design.status}"
            console().print(line, soft_wrap=True)
        return 0 if ok else 1
    best = min(designs, key=lambda design: (not design.ok, design.payload_rms))
    again = f"stillhook optimise {case_words(arguments)} --structure {best.structure}"
    report = structures_report(designs, bound=arguments.bound)
    following, data = [("the best one alone", again)], [design_data(each) for each in designs]
    conclude(report, arguments, folder, following, result=data)
    return 0 if ok else 1


def _design(
    case: Case, name: str, arguments: argparse.Namespace, tell: Progress, stage: str
) -> Design:
    from synth.design import optimise_gains

    return optimise_gains(
        case,
        name,
        starts=arguments.starts,
        seed=arguments.seed,
        progress=lambda part, done, total: tell(f"{stage}: {part}", done, total),
    )


def _write(folder: OutputFolder, designs: Sequence[Design], *, bound: bool) -> None:
    """Write what there is so far: an interrupted comparison keeps what is done."""
    report, last = structures_report(designs, bound=bound), designs[-1]
    folder.write(f"{last.structure}.yaml", design_text(last))
    text = markdown(structures_table(designs, bound=bound))
    folder.write("structures.md", f"# Structures for {last.case.name}\n\n{text}")
    folder.draw(report.drawings)
