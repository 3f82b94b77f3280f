"""`stillhook sensitivity`: which numbers of the case matter most to a design."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from models.basics import InputError, check_range, read_quantity

from ...text import Progress, csv_text
from ..declare import CASE, DESIGN, options, within
from ..given import case_words, given_case
from ..given_design import design_words, given_design, with_design
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from synth.design import Design

    from ...designs import Wide


def _share(option: str, text: str) -> float:
    try:
        share = read_quantity(text, "ratio")
    except InputError as error:
        raise InputError(f"{option} must be a share, as in '10 %', got {error}") from None
    owner, _, name = option.rpartition(": ")
    return check_range(owner, name, share, low=-0.9, high=10.0)


ARGUMENTS = (
    CASE,
    DESIGN,
    options(
        """
        --second N [6]  second derivatives of the N numbers with the largest effect
        --plus SHARE [10 %]  move each gain by this share and compute all anew, as Figure 32 of the
            1975 thesis does (default: '10 %%')

        over whole ranges: Sobol's indices and Morris's screening:
        --ranges  study ranges too; without --spread or --vary: payload mass 30 %% either way,
            stiffness 20 %%, drag 50 %%, the telemetry up to 20 ms later
        --spread FILE  a spread file (.yaml); implies --ranges
        --vary PATH=RANGE ...  vary a number evenly, as in payload.mass=30%% or
            'sensors.telemetry.delay=20 ms..80 ms'; implies --ranges
        --samples N [1024]  base points of the indices, a power of two; numbers + 2 cases each
        --seed N [0]  seed of the draws
        """,
        second=within(low=0),
        plus=_share,
    ),
    options("--out DIR  folder for the results (default: out/<case>-sensitivity)"),
)
EXAMPLES = (("stillhook sensitivity thesis-1975", "which numbers of the case to measure first"),)


def run(arguments: argparse.Namespace) -> int:
    """Study, show and save; return 0."""
    case = given_case(arguments)
    design = given_design(case, arguments)
    folder = prepared(arguments, case.name, "-sensitivity")
    from synth.sensitivity import sensitivity

    with working(arguments) as step:
        study = sensitivity(design, second=arguments.second, progress=step)
        moved = study.moved(arguments.plus)
        wide = _over_ranges(design, arguments, step)
    from ...designs import indices_table, moved_table, sensitivity_report

    report = with_design(sensitivity_report(study, moved, wide), design, case, arguments)
    folder.write("sensitivity.csv", study.to_csv())
    folder.write("moved.csv", csv_text(moved_table(moved)))
    if wide is not None:
        folder.write("indices.csv", csv_text(indices_table(wide)))
    folder.draw(report.drawings)
    words = " ".join([case_words(arguments), *design_words(arguments)])
    ranges = [] if wide else [("over whole ranges", f"stillhook sensitivity {words} --ranges")]
    following = [
        *ranges,
        ("all of it at once, over ranges", f"stillhook sweep {words}"),
        ("how far the numbers may be off", f"stillhook margins {words}"),
    ]
    return conclude(report, arguments, folder, following)


def _over_ranges(design: Design, arguments: argparse.Namespace, step: Progress) -> Wide | None:
    """Return Sobol's indices and Morris's effects over the ranges given, if any are wanted."""
    if not (arguments.ranges or arguments.spread or arguments.vary):
        return None
    from synth.sensitivity import morris_screening, sobol_indices

    from ...sweeps import usual_spread
    from .sweep import given_spread

    spread = given_spread(arguments) or usual_spread(design.case, "frequency")
    options = {"seed": arguments.seed, "progress": step}
    studies = [
        sobol_indices(design, spread, samples=arguments.samples, figure=figure, **options)
        for figure in ("payload_rms", "modulus_margin")
    ]
    return studies, morris_screening(design, spread, **options)
