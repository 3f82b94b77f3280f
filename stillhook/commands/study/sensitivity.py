"""`stillhook sensitivity`: which numbers of the case matter most to a design."""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError, check_range, read_quantity

from ...text import OutputFolder, commands, console, folder_name, number, progress, quantity
from ...text.terminal import _put, _table
from ..design import interruptible
from ..design_argument import given_design
from ..given import case_words, given_case

if TYPE_CHECKING:
    from collections.abc import Sequence

    from synth.design import GainDesign, StructureDesign
    from synth.sensitivity import Moved, Screening, Sensitivity, SobolIndices

    from ...text import Progress

    Wide = tuple[Sequence[SobolIndices], Screening]

_ROWS = 16


def run(arguments: argparse.Namespace) -> int:
    """Study, show and save; return 0."""
    check_range("sensitivity", "--second", arguments.second, low=0, high=1000)
    share = _share(arguments.plus)
    case = given_case(arguments)
    design = given_design(case, arguments)
    out_name = arguments.out or Path("out") / f"{folder_name(case.name)}-sensitivity"
    folder = OutputFolder.prepare(out_name)
    from synth.sensitivity import sensitivity

    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        study = sensitivity(design, second=arguments.second, progress=step)
        moved = study.moved(share)
        wide = _over_ranges(design, arguments, step)
    written = _write(study, moved, folder) + (_write_wide(wide, folder) if wide else [])
    from ...designs.tornado_plot import finding

    out = console()
    if arguments.quiet:
        out.print(f"{case.name}: {finding(study)}", soft_wrap=True)
        return 0
    _show(study, moved)
    out.print()
    if wide:
        _show_wide(wide)
        out.print()
    out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    words = case_words(arguments, None)
    if arguments.design:
        words += f" --design {shlex.quote(arguments.design)}"
    elif arguments.gains:
        words += f" --gains {shlex.quote(arguments.gains)}"
    ranges = [] if wide else [("over whole ranges", f"stillhook sensitivity {words} --ranges")]
    commands(
        [
            *ranges,
            ("all of it at once, over ranges", f"stillhook sweep {words}"),
            ("how far the numbers may be off", f"stillhook margins {words}"),
        ],
        out,
    )
    return 0


def _over_ranges(
    design: GainDesign | StructureDesign, arguments: argparse.Namespace, step: Progress
) -> Wide | None:
    """Return Sobol's indices and Morris's effects over the ranges given, if any are wanted."""
    if not (arguments.ranges or arguments.spread or arguments.vary):
        return None
    from synth.sensitivity import morris_screening, sobol_indices

    from ...sweeps import usual_spread
    from .sweep import given_spread

    spread = given_spread(design.case, arguments) or usual_spread(design.case, "frequency")
    options = {"seed": arguments.seed, "progress": step}
    studies = [
        sobol_indices(design, spread, samples=arguments.samples, figure=figure, **options)
        for figure in ("payload_rms", "modulus_margin")
    ]
    return studies, morris_screening(design, spread, **options)


def _show_wide(wide: Wide) -> None:
    studies, screening = wide
    out = console()
    columns = ("rms: alone", "in all", "1/M_s: alone", "in all", "Morris mu*")
    table = _table("over its range", *columns)
    order = sorted(range(len(screening.paths)), key=lambda k: -studies[0].total[k])
    for k in order:
        cells = [f"{100.0 * v:.1f} %" for s in studies for v in (s.first[k], s.total[k])]
        table.add_row(screening.paths[k], *cells, f"{screening.mean_size[k]:.3f}")
    _put(table, out)
    study = studies[0]
    lost = f"{study.unstable} of {study.evaluations} cases are unstable"
    out.print(f"  {lost}{', and left out' if study.unstable else ''}")


def _write_wide(wide: Wide, folder: OutputFolder) -> list[str]:
    from ...designs import indices_figure
    from ...text import picture

    studies, screening = wide
    lines = ["figure,path,first,first_low,first_high,total,total_low,total_high,mu_star,sigma"]
    for study in studies:
        own = study.figure == screening.figure
        for k, path in enumerate(study.paths):
            numbers = (study.first[k], *study.first_interval[k], study.total[k])
            numbers = (*numbers, *study.total_interval[k])
            effects = (screening.mean_size[k], screening.spread[k]) if own else ("", "")
            cells = [*(repr(float(v)) for v in numbers), *(str(e) for e in effects)]
            lines.append(",".join([study.figure, path, *cells]))
    folder.write("indices.csv", "\n".join(lines) + "\n")
    study = studies[0]
    about = f"{study.evaluations} cases each, {study.unstable} unstable and left out"
    figure = indices_figure(studies, about)
    for kind in ("svg", "png"):
        folder.write(f"indices.{kind}", picture(figure, kind))
    return ["indices.csv", "indices.svg", "indices.png"]


def _show(study: Sensitivity, moved: tuple[Moved, ...]) -> None:
    out = console()
    rms, peak = quantity(study.payload_rms, "m"), number(study.max_sensitivity)
    out.print(f"{study.design.case.name}: payload {rms} rms, M_s {peak}", style="bold")
    out.print()
    table = _table("one per cent more of", "payload rms", "M_s", "torque", "speed")
    for entry in study.elasticities[:_ROWS]:
        values = (entry.payload_rms, entry.max_sensitivity, entry.torque_rms, entry.speed_rms)
        table.add_row(entry.path, *(f"{value:+.3f} %" for value in values))
    _put(table, out)
    rest = len(study.elasticities) - _ROWS
    idle = len(study.without_effect)
    if rest > 0:
        out.print(f"  {rest} more with less effect, {idle} without any (all in the table written)")
    for path in study.stepping:
        out.print(f"  {path}: something steps at its value, so that it has no elasticity")
    if moved:
        out.print()
        table = _table(f"{100.0 * moved[0].share:+.3g} % on", "payload rms", "M_s")
        for one in moved:
            there = math.isfinite(one.payload_rms)
            cells = (quantity(one.payload_rms, "m", 4), number(one.max_sensitivity))
            table.add_row(one.path, *(cells if there else ("unstable", "")))
        _put(table, out)


def _write(study: Sensitivity, moved: tuple[Moved, ...], folder: OutputFolder) -> list[str]:
    from ...designs import tornado_figure
    from ...text import picture

    folder.write("sensitivity.csv", study.to_csv())
    lines = ["path,share,payload_rms [m],max_sensitivity"]
    lines += [f"{m.path},{m.share!r},{m.payload_rms!r},{m.max_sensitivity!r}" for m in moved]
    folder.write("moved.csv", "\n".join(lines) + "\n")
    figure = tornado_figure(study)
    for kind in ("svg", "png"):
        folder.write(f"tornado.{kind}", picture(figure, kind))
    return ["sensitivity.csv", "moved.csv", "tornado.svg", "tornado.png"]


def _share(text: str) -> float:
    try:
        share = read_quantity(text, "ratio")
    except InputError as error:
        raise InputError(
            f"sensitivity: --plus must be a share, as in '10 %', got {error}"
        ) from None
    return check_range("sensitivity", "--plus", share, low=-0.9, high=10.0)
