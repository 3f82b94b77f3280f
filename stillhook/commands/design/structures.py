"""`stillhook structures`: the best controllers of some structures side by side."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...designs import design_data, design_text, structures_report, structures_table
from ...text import OutputFolder, Progress, console, markdown
from ..declare import CASE, NO_BOUND, results_folder, text, whole
from ..given import case_words, given_case
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design

ARGUMENTS = (
    CASE,
    text(
        "--structures",
        "A,B,..",
        "which (default: all): payload-feedback, payload-feedback-rolloff, -lead, -notch, "
        "-integral, drum-feedback, feed-forward, combined, constant-tension, low-order-N; on "
        "request high-order, the best found of any order",
    ),
    results_folder("out/<name of the case>"),
    whole("--starts", "starts of each search", 8),
    whole("--seed", "seed of the starts", 0),
    NO_BOUND,
)


def run(arguments: argparse.Namespace) -> int:
    """Compare structures on a case; return 0 if one of them is ok, else 1."""
    from models.basics import check_range
    from synth.structures import structure_named, structure_names

    check_range("structures", "--starts", arguments.starts, low=1, high=4096)
    check_range("structures", "--seed", arguments.seed, low=0)
    known = structure_names()
    names = known if arguments.structures is None else _names(arguments.structures)
    case = given_case(arguments)
    for name in names:
        structure_named(name, case)  # an unknown name ends here, not after minutes
    folder = prepared(arguments, case.name)
    folder.write("case.yaml", case.to_yaml())
    designs: list[Design] = []
    with working(arguments) as tell:
        for k, name in enumerate(names):
            designs.append(_design(case, name, arguments, tell, f"{name} ({k + 1}/{len(names)})"))
            if arguments.bound:
                tell(f"{name}: bound", 0, 1)
            written = _write(folder, designs, bound=arguments.bound)
    ok = any(design.ok for design in designs)
    if arguments.quiet:
        for design in designs:
            line = f"{case.name}: {design.structure}: {design.status}"
            console().print(line, soft_wrap=True)
        return 0 if ok else 1
    best = min(designs, key=lambda design: (not design.ok, design.payload_rms))
    again = f"stillhook optimise {case_words(arguments)} --structure {best.structure}"
    report = structures_report(designs, bound=arguments.bound)
    conclude(
        report,
        arguments,
        written=written,
        following=lambda: [("the best one alone", again)],
        result=lambda: [design_data(design) for design in designs],
    )
    return 0 if ok else 1


def _names(text: str) -> tuple[str, ...]:
    from models.basics import InputError

    # Each once, in the order given.
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise InputError(
            "structures: --structures must name structures, as in --structures "
            f"payload-feedback,combined, got {text!r}"
        )
    return names


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


def _write(folder: OutputFolder, designs: Sequence[Design], *, bound: bool) -> list[Path]:
    """Write what there is so far: an interrupted comparison keeps what is done."""
    report, last = structures_report(designs, bound=bound), designs[-1]
    folder.write(f"{last.structure}.yaml", design_text(last))
    text = markdown(structures_table(designs, bound=bound))
    return [
        folder.write("structures.md", f"# Structures for {last.case.name}\n\n{text}"),
        *folder.draw(report.drawings, kinds=("svg",)),
        *(folder.path / f"{design.structure}.yaml" for design in designs),
    ]
