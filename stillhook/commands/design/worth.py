"""`stillhook worth`: what each limit, sensor and delay is worth, and what to buy first."""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import check_range

from ...text import OutputFolder, commands, console, folder_name, number, progress, quantity
from ...text.terminal import _put, _table
from ..given import case_words, given_case
from .optimise import interruptible

if TYPE_CHECKING:
    from synth.sizing import Worth


def run(arguments: argparse.Namespace) -> int:
    """Price everything, show and save; return 0 if there is an optimum to begin with, else 1."""
    from synth.sizing import worth
    from synth.structures import structure_named

    check_range("worth", "--starts", arguments.starts, low=1, high=4096)
    check_range("worth", "--seed", arguments.seed, low=0)
    case = given_case(arguments)
    structure_named(arguments.family_structure, case)
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-worth")
    folder.write("case.yaml", case.to_yaml())
    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        result = worth(
            case,
            structure=arguments.family_structure,
            starts=arguments.starts,
            seed=arguments.seed,
            progress=step,
        )
    return _told(result, arguments, folder)


def _told(result: Worth, arguments: argparse.Namespace, folder: OutputFolder) -> int:
    from ...designs import worth_figure
    from ...text import picture

    for stale in ("worth.csv", "worth.svg", "worth.png"):
        folder.discard(stale)
    if result.rows:
        figure = worth_figure(result)
        folder.write("worth.csv", result.to_csv())
        for kind in ("svg", "png"):
            folder.write(f"worth.{kind}", picture(figure, kind))
    out = console()
    if arguments.quiet:
        out.print(f"{result.case.name}: {result.status}", soft_wrap=True)
        return 0 if result.ok else 1
    out.print(f"{result.case.name}: what is worth buying, {result.structure}", style="bold")
    out.print(f"{'ok' if result.ok else 'NOT OK'}: {result.status}", soft_wrap=True)
    words = case_words(arguments, str(folder.path / "case.yaml"))
    structure = f" --structure {result.structure}"
    if not result.rows:
        target = f"{1e3 * result.payload_rms:.3g} mm"
        rows = [("the controller itself", f"stillhook optimise {words}{structure}")]
        if math.isfinite(result.payload_rms) and result.payload_rms > 0.0:
            again = f"stillhook size {words} --target {shlex.quote(target)}{structure}"
            rows.append(("a motor that can do it", again))
        commands(rows, out)
        return 1
    out.print()
    _show(result)
    out.print()
    out.print(f"Written to {folder.path}: worth.csv, worth.svg, worth.png", soft_wrap=True)
    if result.case.limits.drive == "enforce":
        target = f"{1e3 * result.payload_rms:.3g} mm"
        again = f"stillhook size {words} --target {shlex.quote(target)}{structure}"
        commands([("the smallest motor that does as well", again)], out)
    else:
        again = f"stillhook size {words} --co-design{structure}"
        commands([("the best gear", again)], out)
    return 0


def _show(result: Worth) -> None:
    from ...designs import step_text
    from ...designs.size_plot import value_text

    out = console()
    table = _table("", "is", "1 % of it", "per step", "twice as good")
    idle = []
    for row in result.rows:
        if row.elasticity == 0.0 and row.gain == 0.0 and row.item.value != 0.0:
            idle.append(row.item.name)
            continue
        share = row.elasticity if math.isfinite(row.elasticity) else row.price
        better = -1.0 if row.factor < 1.0 else 1.0
        table.add_row(
            row.item.name + ("" if row.item.sold else " *"),
            value_text(row.item.value, row.item.unit),
            f"{number(better * share, 2)} %" if math.isfinite(share) else "-",
            step_text(row),
            quantity(row.twice_rms, "m") if math.isfinite(row.twice_rms) else "-",
        )
    _put(table, out)
    out.print("  1 % of it: what the payload's rms changes by if the figure gets 1 % better")
    if any(not row.item.sold for row in result.rows):
        out.print("  *: a margin is given away, not bought; the gear is chosen")
    if idle:
        out.print(f"  worth nothing here: {', '.join(idle)}", soft_wrap=True)
