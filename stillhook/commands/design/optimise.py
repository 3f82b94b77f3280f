"""`stillhook optimise`: from a case to its gains, on the terminal and in a folder."""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Callable
from typing import TYPE_CHECKING

from ...designs import AT_LEAST, LIMITS
from ...text import OutputFolder, number, progress
from ..declare import CASE, NO_BOUND, results_folder, text, whole
from ..given import case_words, gains_text, given_case
from ..working import conclude, interruptible, kept_in, prepared
from .structures import optimise_one

if TYPE_CHECKING:
    from synth.design import GainDesign

ARGUMENTS = (
    CASE,
    results_folder("out/<name of the case>"),
    whole("--starts", "starts of the search", 16),
    whole("--seed", "seed of the starts", 0),
    text(
        "--structure",
        "NAME",
        "another structure than the three gains of payload feedback, such as combined; "
        "`stillhook structures CASE` compares them",
    ),
    NO_BOUND,
)


def run(arguments: argparse.Namespace) -> int:
    """Optimise, show and save; return 0 if the design is ok, 1 if not."""
    from models.basics import check_range

    check_range("optimise", "--starts", arguments.starts, low=1, high=4096)
    check_range("optimise", "--seed", arguments.seed, low=0)
    if arguments.structure is not None:
        return optimise_one(arguments)
    case = given_case(arguments)
    folder = prepared(arguments, case.name)
    folder.write("case.yaml", case.to_yaml())
    from synth import optimise_gains

    from ...designs import design_data, design_report, write_report

    design: GainDesign | None = None
    try:
        with progress(shown=not arguments.quiet) as tell:
            with interruptible() as check:

                def step(stage: str, done: int, total: int) -> None:
                    check()
                    tell(stage, done, total)

                starts, seed = arguments.starts, arguments.seed
                design = optimise_gains(case, starts=starts, seed=seed, progress=step)
            # Outside, as a report that is interrupted leaves whole files.
            written = write_report(folder, design=design, bound=arguments.bound, progress=tell)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_kept(folder, design)) from None
    report = design_report(design, bound=arguments.bound and not arguments.quiet)
    return conclude(
        report,
        arguments,
        written=written,
        following=lambda: _next(design, arguments, folder),
        result=lambda: design_data(design),
    )


def _kept(folder: OutputFolder, design: GainDesign | None) -> str:
    """Return what an interrupted run leaves behind: whole files, some of them perhaps old."""
    kept = kept_in(folder.path)
    names = ", ".join(kept)
    if design is not None:
        return f"the design is finished, its report is not; kept in {folder.path}: {names}"
    old = "" if kept == ["case.yaml"] else " (all but case.yaml are from an earlier run)"
    return f"no design was finished; kept in {folder.path}: {names}{old}"


def _next(
    design: GainDesign, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    case = case_words(arguments, str(folder.path / "case.yaml"))
    rows = []
    if not design.feasible:
        height = _rounded(design.significant_height, math.floor)
        rows.append(
            (
                f"the largest sea that is feasible, H_s {height} m",
                f"stillhook optimise {case} --set sea.significant_height={height}",
            )
        )
    if design.required:
        sets = [
            f"--set {LIMITS[name][1]}={_rounded(value, math.ceil)}"
            for name, value in design.required.items()
        ]
        rows.append(("a drive that can do it", f"stillhook optimise {case} {' '.join(sets)}"))
    dearest = max(design.limits.values(), key=lambda use: use.price, default=None)
    if dearest is not None and dearest.price > 0.0 and design.ok:
        bound = dearest.bound * (0.9 if dearest.name in AT_LEAST else 1.1)
        rows.append(
            (
                "the dearest limit, a tenth looser",
                f"stillhook optimise {case} --set {LIMITS[dearest.name][1]}={number(bound)} "
                f"--out {shlex.quote(str(folder.path) + '-looser')}",
            )
        )
    if design.margins is not None:
        gains = f"{case} --gains {gains_text(design.gains)}"
        rows.append(("these gains again", f"stillhook evaluate {gains}"))
        rows.append(("in which seas they can work", f"stillhook operability {gains}"))
        rows.append(("where mass, stiffness and delay are off", f"stillhook sweep {gains}"))
    rows.append(("what was read from the case", f"stillhook check {case}"))
    return rows


def _rounded(value: float, towards: Callable[[float], int]) -> str:
    """Return a figure rounded down or up at its third digit, so that it suffices."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return number(towards(value / unit) * unit)
