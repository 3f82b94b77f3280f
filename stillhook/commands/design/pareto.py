"""`stillhook pareto`: how still the payload can be held against what it costs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ...text import OutputFolder, commands, console, folder_name, number, progress, quantity
from ..given import case_words, gains_text, given_case
from .optimise import interruptible
from .vary import parse_range

if TYPE_CHECKING:
    from synth.sizing import ParetoFront

_ROWS = 12  # of the table on the terminal


def run(arguments: argparse.Namespace) -> int:
    """Compute, show and save a front; return 0 if it holds, 1 if not."""
    from synth.sizing import pareto_front

    case = given_case(arguments)
    between = parse_range("--between", arguments.between) if arguments.between else None
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-pareto")
    folder.write("case.yaml", case.to_yaml())
    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        front = pareto_front(
            case,
            arguments.against,
            points=arguments.points,
            between=between,
            seed=arguments.seed,
            progress=step,
        )
    if len(front.points) >= 2:
        from ...designs import pareto_figure
        from ...text import picture

        figure = pareto_figure(front)
        folder.write("pareto.csv", front.to_csv())
        for kind in ("svg", "png"):
            folder.write(f"pareto.{kind}", picture(figure, kind))
    out = console()
    verdict = _verdict(front)
    if arguments.quiet:
        out.print(f"{case.name}: {verdict}", soft_wrap=True)
        return 0 if front.ok else 1
    out.print(f"{case.name}: payload rms against {front.against}", style="bold")
    out.print(f"{'ok' if front.ok else 'NOT OK'}: {verdict}", soft_wrap=True)
    if not front.points:
        return 1
    _show(front)
    out.print()
    out.print(f"Written to {folder.path}: pareto.csv, pareto.svg, pareto.png", soft_wrap=True)
    words = case_words(arguments, str(folder.path / "case.yaml"))
    knee = front.knee
    gains = gains_text({"A": front.amplifier, **knee.parameters})
    late = f" --set sensors.telemetry.delay={knee.bound:.6g}" if front.against == "delay" else ""
    rows = [("the design at the knee", f"stillhook evaluate {words}{late} --gains {gains}")]
    others = {"torque": "max_sensitivity", "max_sensitivity": "delay"}
    other = others.get(front.against, "torque")
    rows.append((f"against {other}", f"stillhook pareto {words} --against {other}"))
    commands(rows, out)
    return 0 if front.ok else 1


def _verdict(front: ParetoFront) -> str:
    from ...designs import finding

    if len(front.points) < 2:
        return "no front: fewer than two points hold"
    text = f"{len(front.points)} points; {finding(front)}"
    if front.lost:
        text += f"; no point holds at {len(front.lost)} bounds"
    passed, asked = front.verified
    return f"{text}; {passed} of {asked} checked by other code"


def _show(front: ParetoFront) -> None:
    from ...designs import value_text
    from ...text.terminal import _put, _table

    out = console()
    out.print()
    names = list(front.points[0].parameters)
    table = _table(front.against, "payload rms", "M_s", "torque rms", *names, left=())
    every = max(1, -(-len(front.points) // _ROWS))
    knee = front.knee
    for k, point in enumerate(front.points):
        if k % every and point is not knee and k + 1 < len(front.points):
            continue
        table.add_row(
            value_text(front, point.bound) + (" *" if point is knee else ""),
            quantity(point.payload_rms, "m"),
            number(point.max_sensitivity),
            quantity(point.torque_rms, "N m"),
            *(number(point.parameters[name]) for name in names),
        )
    _put(table, out)
    out.print("  * the knee: here the front turns most")
