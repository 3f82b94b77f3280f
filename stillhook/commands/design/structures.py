"""`stillhook structures` and `stillhook optimise --structure`: controllers by their structure."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...designs import HEADINGS, markdown, structure_rows
from ...text import (
    OutputFolder,
    Progress,
    bound_sentence,
    bounds_note,
    commands,
    console,
    count,
    folder_name,
    number,
    pairs,
    progress,
    quantity,
)
from ..given import case_words, given_case

if TYPE_CHECKING:
    from models import Case
    from synth.design import StructureDesign


def run(arguments: argparse.Namespace) -> int:
    """Compare structures on a case, or optimise one; return 0 if one of them is ok, else 1."""
    from models.basics import check_range
    from synth.structures import structure_named, structure_names

    check_range(arguments.command, "--starts", arguments.starts, low=1, high=4096)
    check_range(arguments.command, "--seed", arguments.seed, low=0)
    if arguments.command == "optimise":
        return _optimise_one(arguments)
    known = structure_names()
    names = known if arguments.structures is None else _names(arguments.structures)
    case = given_case(arguments)
    for name in names:
        structure_named(name, case)  # an unknown name ends here, not after minutes
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}")
    folder.write("case.yaml", case.to_yaml())
    designs: list[StructureDesign] = []
    with progress(shown=not arguments.quiet) as tell:
        for k, name in enumerate(names):
            designs.append(_design(case, name, arguments, tell, f"{name} ({k + 1}/{len(names)})"))
            if arguments.bound:
                tell(f"{name}: bound", 0, 1)
            _write(folder, designs, bound=arguments.bound)
    _show(designs, quiet=arguments.quiet, bound=arguments.bound)
    out = console()
    if not arguments.quiet:
        out.print()
        out.print(f"Written to {folder.path}: structures.md, figure, one file each", soft_wrap=True)
        best = min(designs, key=lambda design: (not design.ok, design.payload_rms))
        again = f"stillhook optimise {case_words(arguments)} --structure {best.structure}"
        commands([("the best one alone", again)], out)
    return 0 if any(design.ok for design in designs) else 1


def _optimise_one(arguments: argparse.Namespace) -> int:
    """Optimise one structure, show and save it; return 0 if it is ok, 1 if not."""
    from synth.structures import structure_named

    from ...designs import structure_text

    case = given_case(arguments)
    structure_named(arguments.structure, case)
    folder = OutputFolder.prepare(arguments.out or Path("out") / folder_name(case.name))
    folder.write("case.yaml", case.to_yaml())
    with progress(shown=not arguments.quiet) as tell:
        design = _design(case, arguments.structure, arguments, tell, arguments.structure)
    folder.write(f"{design.structure}.yaml", structure_text(design))
    out = console()
    if arguments.quiet:
        out.print(f"{case.name}: {design.structure}: {design.status}", soft_wrap=True)
        return 0 if design.ok else 1
    _show([design], quiet=False, bound=arguments.bound)
    if arguments.bound and (text := bound_sentence(design)):
        out.print()
        pairs([("bound", text)], out)
    if design.parameters:
        out.print()
        out.print("Parameters", style="bold")
        units = design.units
        rows = [(k, f"{number(v, 6)} {units.get(k, '')}") for k, v in design.parameters.items()]
        pairs(rows, out)
    out.print()
    out.print(f"Written to {folder.path}: {design.structure}.yaml", soft_wrap=True)
    return 0 if design.ok else 1


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
) -> StructureDesign:
    from synth.design import optimise_structure

    from .optimise import interruptible

    with interruptible() as check:

        def step(part: str, done: int, total: int) -> None:
            check()
            tell(f"{stage}: {part}", done, total)

        return optimise_structure(
            case, name, starts=arguments.starts, seed=arguments.seed, progress=step
        )


def _write(folder: OutputFolder, designs: Sequence[StructureDesign], *, bound: bool) -> None:
    """Write what there is so far: an interrupted comparison keeps what is done."""
    import math

    from ...designs import structure_text, structures
    from ...text import picture

    last = designs[-1]
    folder.write(f"{last.structure}.yaml", structure_text(last))
    text = markdown(designs, bound=bound)
    folder.write("structures.md", f"# Structures for {last.case.name}\n\n{text}")
    if any(math.isfinite(design.payload_rms) for design in designs):
        folder.write("structures.svg", picture(structures(designs, bound=bound), "svg"))


def _show(designs: Sequence[StructureDesign], *, quiet: bool, bound: bool) -> None:
    out, first = console(), designs[0]
    if quiet:
        for design in designs:
            out.print(f"{first.case.name}: {design.structure}: {design.status}", soft_wrap=True)
        return
    out.print(f"{first.case.name}: {count(len(designs), 'structure')}", style="bold")
    held, hook = (quantity(v, "m") for v in (first.payload_rms_before, first.hook_rms))
    out.print(f"hook {hook} rms; with the drum held the payload moves {held} rms")
    out.print()
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    for k, heading in enumerate(HEADINGS[:-1]):
        table.add_column(heading, justify="left" if k == 0 else "right", no_wrap=True)
    rows = structure_rows(designs, bound=bound)
    for row in rows:
        table.add_row(*row.cells[:-1], style="" if row.ok else "red")
    out.print(table)
    if bound and len(designs) > 1:
        out.print(bounds_note(designs))
    out.print()
    # Below, not beside: the names of limits are too long for a column on 80.
    out.print("Limited by", style="bold")
    pairs([(row.name, row.limited) for row in rows], out)
    for design in designs:
        if not design.ok:
            out.print(f"{design.structure}: {design.status}", soft_wrap=True)
