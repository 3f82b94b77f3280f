"""The report of a design: motion, gains, margins, limits, and a folder with all of it.

    Design -> Report -> design.yaml, case.yaml, figures (SVG and PNG), summary.md

Whoever opens the folder a year later finds the question beside the answer.
"""

from collections.abc import Callable
from pathlib import Path

from models.basics import shows_progress
from synth.design import Design

from ..text import Drawing, OutputFolder, Report, ReportSection, markdown, pairs, pictures
from .design_file import design_text
from .figures import limits, nyquist, payload_spectrum, responses
from .summary import (
    alternatives_table,
    command_text,
    effect,
    expected_table,
    facts,
    has_loop,
    limit_table,
    margin_table,
    member_table,
    motion_table,
    parameter_table,
    required_table,
    share_table,
)

_FIGURES = ("payload_spectrum", "responses", "nyquist", "limits")
_READ = "`design.yaml` holds all of this for `stillhook.load_design`, `case.yaml` the case."


def design_report(design: Design, *, bound: bool = True) -> Report:
    """Return all there is to say about a design.

    `bound` says whether to compute the best that any linear controller could do, too.
    """
    needed, margins = required_table(design), margin_table(design)
    named = "" if design.structure == "payload-feedback" else f"{design.structure}: "
    status = f"{named}{design.status}"
    spectrum = "Spectra of the hook and of the payload"
    over = "Payload over hook and drum over hook"
    curve = "Nyquist curve of the loop, broken at the command"
    sections = [
        ReportSection("", [needed] if needed is not None else []),
        ReportSection(
            "Payload motion",
            [
                motion_table(design),
                effect(design),
                Drawing("payload_spectrum", spectrum, lambda: payload_spectrum(design)),
                Drawing("responses", over, lambda: responses(design)),
            ],
        ),
    ]
    titled = (
        ("Structures", alternatives_table(design)),
        ("Members", member_table(design)),
        ("", share_table(design)),
    )
    sections += [ReportSection(title, [table]) for title, table in titled if table is not None]
    if has_loop(design):
        law = f"`{command_text(design)}`"
        sections.append(ReportSection("Gains", [law, parameter_table(design)]))
    if margins is not None:
        sections.append(ReportSection("Margins", [margins]))
    if has_loop(design):
        sections.append(ReportSection("", [Drawing("nyquist", curve, lambda: nyquist(design))]))
    if design.limits:
        drawing = Drawing("limits", "Use of the limits", lambda: limits(design))
        tables = (limit_table(design), expected_table(design))
        shown = [table for table in tables if table is not None]
        sections.append(ReportSection("Limits", [*shown, drawing]))
    sections.append(ReportSection("What this rests on", [pairs(facts(design, bound=bound))]))
    return Report(
        name=design.case.name,
        about=" ".join(design.case.description.split()),
        status=status,
        ok=design.ok,
        sections=sections,
    )


@shows_progress("drawing")
def write_design(
    folder: str | Path | OutputFolder,
    *,
    design: Design,
    bound: bool = True,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Path]:
    """Write everything there is to say about a design into a folder.

    Each file is written whole or not at all, and a figure that this design does not have (an
    unstable loop has no spectrum) is removed if an earlier run left one.

    Parameters
    ----------
    folder
        The folder; it is made if need be.
    design
        The design.
    bound
        Whether to compute the best that any linear controller could do, and to say how far
        the design is from it.
    progress
        Called as progress("figures" or "bound", done, total).

    Returns
    -------
    list of Path
        The files written: ``design.yaml`` (see `load_design`), ``case.yaml``, the figures
        ``payload_spectrum``, ``responses``, ``nyquist`` and ``limits`` as ``.svg`` and
        ``.png``, and ``summary.md``.

    Raises
    ------
    InputError
        If the folder cannot be made or a file cannot be written.
    """
    target = OutputFolder.prepare(folder)
    written = [
        target.write("design.yaml", design_text(design)),
        target.write("case.yaml", design.case.to_yaml()),
    ]
    drawings = design_report(design, bound=False).drawings
    written += target.draw(drawings, progress=progress)
    target.discard(*pictures(*_FIGURES))
    if bound and progress is not None and design.margins is not None:
        progress("bound", 0, 1)
    text = markdown(design_report(design, bound=bound))
    written.append(target.write("summary.md", f"{text}\n{_READ}\n"))
    return written
