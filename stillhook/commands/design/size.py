"""`stillhook size`: the smallest motor and gear for a target, or the best gear for a motor."""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError, check_range

from ...text import (
    OutputFolder,
    Progress,
    commands,
    console,
    folder_name,
    number,
    pairs,
    progress,
    quantity,
)
from ...text.terminal import _put, _table
from ..given import case_words, given_case
from .optimise import interruptible
from .vary import parse_range

if TYPE_CHECKING:
    from models import Case
    from synth.design import StructureDesign
    from synth.sizing import CoDesign, Sizing

_ROWS = 14  # of the table on the terminal


def run(arguments: argparse.Namespace) -> int:
    """Size, or co-design, show and save; return 0 if a verified design came out, 1 if not."""
    from synth.structures import structure_named

    check_range("size", "--starts", arguments.starts, low=1, high=4096)
    check_range("size", "--seed", arguments.seed, low=0)
    gear = parse_range("--gear", arguments.gear) if arguments.gear else None
    if arguments.co_design == (arguments.target is not None):
        raise InputError(
            "size: give --target, as in --target '20 mm', to find the smallest motor, or "
            "--co-design to find the best gear for the motor that there is"
        )
    if arguments.co_design and (arguments.motors or arguments.hs):
        raise InputError("size: --motors and --hs go with --target, not with --co-design")
    if arguments.radius and not arguments.co_design:
        raise InputError("size: --radius goes with --co-design")
    radius = parse_range("--radius", arguments.radius) if arguments.radius else None
    case = given_case(arguments)
    structure_named(arguments.family_structure, case)
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-size")
    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        if arguments.co_design:
            return _co_designed(case, arguments, gear, radius, folder, step)
        from synth.sizing import size_winch

        sizing = size_winch(
            case,
            target=arguments.target,
            height=arguments.hs,
            structure=arguments.family_structure,
            gear=gear,
            points=arguments.points,
            motors=arguments.motors,
            starts=arguments.starts,
            seed=arguments.seed,
            progress=step,
        )
    return _told(sizing, arguments, folder)


def _told(sizing: Sizing, arguments: argparse.Namespace, folder: OutputFolder) -> int:
    written = _write(sizing, folder)
    out = console()
    name = sizing.case.name
    if arguments.quiet:
        out.print(f"{name}: {sizing.status}", soft_wrap=True)
        return 0 if sizing.ok else 1
    height = f"{sizing.case.sea.significant_height:.3g} m"
    target = quantity(sizing.target, "m")
    out.print(f"{name}: payload {target} rms in H_s {height}, {sizing.structure}", style="bold")
    out.print(f"{'ok' if sizing.ok else 'NOT OK'}: {sizing.status}", soft_wrap=True)
    out.print()
    if sizing.points:
        _show(sizing)
        out.print()
    given = sizing.given_rms
    highest = sizing.highest_height
    pairs(
        [
            ("whatever the motor", f"payload {quantity(sizing.unlimited_rms, 'm')} rms"),
            (
                "with the winch as it is",
                f"payload {quantity(given, 'm')} rms"
                if math.isfinite(given)
                else "its limits cannot be kept in this sea",
            ),
            (
                "the winch as it is meets the target",
                f"up to H_s {highest:.3g} m" if highest > 0.0 else "in no sea looked at",
            ),
        ],
        out,
    )
    out.print()
    if written:
        out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    commands(_next(sizing, arguments, folder), out)
    return 0 if sizing.ok else 1


def _write(sizing: Sizing, folder: OutputFolder) -> list[str]:
    from ...designs import structure_text
    from ...text import picture

    written = ["case.yaml"]
    folder.write("case.yaml", sizing.case.to_yaml())
    for stale in ("size.csv", "size.svg", "size.png", "sized.yaml", "design.yaml"):
        folder.discard(stale)
    if sizing.points:
        folder.write("size.csv", sizing.to_csv())
        written.append("size.csv")
    if sizing.chosen is not None:
        from ...designs import size_figure

        figure = size_figure(sizing)
        for kind in ("svg", "png"):
            folder.write(f"size.{kind}", picture(figure, kind))
            written.append(f"size.{kind}")
    if sizing.sized_case is not None:
        folder.write("sized.yaml", sizing.sized_case.to_yaml())
        written.append("sized.yaml")
    if sizing.design is not None:
        folder.write("design.yaml", structure_text(sizing.design))
        written.append("design.yaml")
    return written


def _show(sizing: Sizing) -> None:
    table = _table("gear", "power", "continuous", "peak", "inertia", "limited by", left=(5,))
    every = max(1, -(-len(sizing.points) // _ROWS))
    best = sizing.chosen.gear if sizing.chosen is not None else None
    for k, point in enumerate(sizing.points):
        if k % every and point.gear != best:
            continue
        motor = point.motor
        mark = " *" if point.gear == best else ""
        figures = ["-"] * 4
        if motor is not None:
            figures = [
                quantity(motor.power, "W"),
                quantity(motor.torque_continuous, "N m"),
                quantity(motor.torque_peak, "N m"),
                quantity(motor.inertia, "kg m2"),
            ]
        table.add_row(number(point.gear) + mark, *figures, ", ".join(point.binding[:2]))
    _put(table, console())


def _next(
    sizing: Sizing, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    structure = f" --structure {sizing.structure}"
    sized = shlex.quote(str(folder.path / "sized.yaml"))
    words = case_words(arguments, str(folder.path / "case.yaml"))
    rows = []
    if sizing.sized_case is not None:
        rows.append(("the chosen winch once more", f"stillhook optimise {sized}{structure}"))
        rows.append(("what would make it better", f"stillhook worth {sized}{structure}"))
    else:
        target = f"{1e3 * 1.1 * sizing.unlimited_rms:.3g} mm"
        if sizing.unlimited_rms > sizing.target and math.isfinite(sizing.unlimited_rms):
            again = f"stillhook size {words} --target {shlex.quote(target)}{structure}"
            rows.append(("a target that the loop can meet", again))
        rows.append(("other structures", f"stillhook structures {words}"))
    return rows


def _co_designed(
    case: Case,
    arguments: argparse.Namespace,
    gear: tuple[float, float] | None,
    radius: tuple[float, float] | None,
    folder: OutputFolder,
    step: Progress,
) -> int:
    from synth.sizing import co_design

    from ...designs import structure_text

    found: CoDesign = co_design(
        case,
        gear=gear,
        radius=radius,
        structure=arguments.family_structure,
        starts=arguments.starts,
        seed=arguments.seed,
        progress=step,
    )
    folder.write("case.yaml", case.to_yaml())
    folder.write("gears.csv", found.to_csv())
    written = ["case.yaml", "gears.csv"]
    if found.best_case is not None:
        folder.write("sized.yaml", found.best_case.to_yaml())
        written.append("sized.yaml")
    design: StructureDesign | None = found.design
    if design is not None:
        folder.write("design.yaml", structure_text(design))
        written.append("design.yaml")
    out = console()
    if arguments.quiet:
        out.print(f"{case.name}: {found.status}", soft_wrap=True)
        return 0 if found.ok else 1
    out.print(f"{case.name}: gear and gains together, {found.structure}", style="bold")
    out.print(f"{'ok' if found.ok else 'NOT OK'}: {found.status}", soft_wrap=True)
    out.print()
    table = _table("gear", "drum", "payload rms", "limited by", left=(3,))
    every = max(1, -(-len(found.points) // _ROWS))
    for k, p in enumerate(found.points):
        if k % every and p.gear != found.gear:
            continue
        rms = quantity(p.payload_rms, "m", 4) if math.isfinite(p.payload_rms) else "-"
        mark = " *" if (p.gear, p.radius) == (found.gear, found.radius) else ""
        table.add_row(
            number(p.gear, 4) + mark, quantity(p.radius, "m"), rms, ", ".join(p.binding[:2])
        )
    _put(table, out)
    out.print()
    out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    if found.best_case is not None:
        sized = shlex.quote(str(folder.path / "sized.yaml"))
        again = f"stillhook worth {sized} --structure {found.structure}"
        commands([("what would make it better", again)], out)
    return 0 if found.ok else 1
