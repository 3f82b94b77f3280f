"""`stillhook size`: the smallest motor and gear for a target, or the best gear for a motor."""

from __future__ import annotations

import argparse
import math
import shlex
from typing import TYPE_CHECKING

from models.basics import InputError

from ...text import OutputFolder, pictures
from ..declare import CASE, options
from ..given import case_words, given_case
from ..lists import parse_range
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design
    from synth.sizing import Sizing

ARGUMENTS = (
    CASE,
    options(
        """
        --target LENGTH  rms that the payload may move: '20 mm', '5 %%' of the hook's rms, '26 dB'
            below it
        --hs LENGTH  significant wave height, as in '2.5 m' (default: the case's)
        --gear LOW..HIGH  gear ratios to look at (default: the case's over and times 2.5)
        --points N [9]  gears on the curve
        --motors FILE  a catalogue of motors to choose from (.csv)
        --co-design  keep the motor and find the gear with which the payload is stillest
        --radius LOW..HIGH  with --co-design: drum radii to look at [m]
        --structure NAME [payload-feedback]  controller structure (default: payload-feedback)
        --starts N [4]  starts of the search
        --seed N [0]  seed of the starts
        --out DIR  folder for the results (default: out/<case>-size)
        """,
        gear=parse_range,
        radius=parse_range,
    ),
)
EXAMPLES = (
    (
        "stillhook size thesis-1975 --target '150 mm' --hs '1 m' --points 3 --starts 1",
        "the smallest motor that leaves 150 mm in a sea of 1 m",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Size, or co-design, show and save; return 0 if a verified design came out, 1 if not."""
    from synth.structures import structure_aboard

    if arguments.co_design == (arguments.target is not None):
        raise InputError(
            "size: give --target, as in --target '20 mm', to find the smallest motor, or "
            "--co-design to find the best gear for the motor that there is"
        )
    if arguments.co_design and (arguments.motors or arguments.hs):
        raise InputError("size: --motors and --hs go with --target, not with --co-design")
    if arguments.radius and not arguments.co_design:
        raise InputError("size: --radius goes with --co-design")
    case = given_case(arguments)
    structure_aboard(arguments.structure, case)
    folder = prepared(arguments, case.name, "-size")
    if arguments.co_design:
        return _co_designed(case, arguments, folder)
    from synth.sizing import size_winch

    with working(arguments) as step:
        sizing = size_winch(
            case,
            target=arguments.target,
            height=arguments.hs,
            structure=arguments.structure,
            gear=arguments.gear,
            points=arguments.points,
            motors=arguments.motors,
            starts=arguments.starts,
            seed=arguments.seed,
            progress=step,
        )
    from ...designs import size_report

    report = size_report(sizing)
    folder.write("case.yaml", sizing.case.to_yaml())
    if sizing.points:
        folder.write("size.csv", sizing.to_csv())
    folder.draw(report.drawings)
    _sized(folder, sizing.sized_case, sizing.design)
    folder.discard("size.csv", *pictures("size"), "sized.yaml", "design.yaml")
    return conclude(report, arguments, folder, _next(sizing, arguments, folder))


def _sized(folder: OutputFolder, case: Case | None, design: Design | None) -> None:
    """Write the case with its new winch, and the design for it."""
    from ...designs import design_text

    if case is not None:
        folder.write("sized.yaml", case.to_yaml())
    if design is not None:
        folder.write("design.yaml", design_text(design))


def _next(
    sizing: Sizing, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    structure = f" --structure {sizing.structure}"
    sized = shlex.quote(str(folder.path / "sized.yaml"))
    words = case_words(arguments, folder)
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


def _co_designed(case: Case, arguments: argparse.Namespace, folder: OutputFolder) -> int:
    from synth.sizing import co_design

    from ...designs import co_design_report

    with working(arguments) as step:
        found = co_design(
            case,
            gear=arguments.gear,
            radius=arguments.radius,
            structure=arguments.structure,
            starts=arguments.starts,
            seed=arguments.seed,
            progress=step,
        )
    folder.write("case.yaml", case.to_yaml())
    folder.write("gears.csv", found.to_csv())
    _sized(folder, found.best_case, found.design)
    sized = shlex.quote(str(folder.path / "sized.yaml"))
    again = ("what would make it better", f"stillhook worth {sized} --structure {found.structure}")
    following = [] if found.best_case is None else [again]
    return conclude(co_design_report(found), arguments, folder, following)
