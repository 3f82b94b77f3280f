"""The report of a design: a folder with the design, its case, the figures and a summary.

    GainDesign -> design.yaml, case.yaml, figures (SVG and PNG), summary.md

Whoever opens the folder a year later finds the question beside the answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from synth.design import GainDesign

from ..text import (
    LimitRow,
    OutputFolder,
    command_text,
    duration,
    effect,
    facts,
    gain_rows,
    has_gains,
    limit_rows,
    margin_rows,
    motion_rows,
    percent,
    required_rows,
)
from .design_file import design_text

_CAPTIONS = {
    "payload_spectrum": "Spectra of the hook and of the payload",
    "responses": "Payload over hook and drum over hook",
    "nyquist": "Nyquist curve of the loop, broken at the command",
    "limits": "Use of the limits",
}
_KINDS = ("svg", "png")


def write_report(
    folder: str | Path,
    *,
    design: GainDesign,
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
    from ..text import picture
    from .figures import FIGURES

    target = OutputFolder.prepare(folder)
    written = [
        target.write("design.yaml", design_text(design)),
        target.write("case.yaml", design.case.to_yaml()),
    ]
    wanted = figures_of(design)
    for done, (name, make) in enumerate(FIGURES.items()):
        if progress is not None:
            progress("figures", done, len(FIGURES))
        figure = make(design) if name in wanted else None
        for kind in _KINDS:
            file = f"{name}.{kind}"
            if figure is None:
                target.discard(file)
            else:
                written.append(target.write(file, picture(figure, kind)))
    if bound and progress is not None and design.margins is not None:
        progress("bound", 0, 1)
    written.append(target.write("summary.md", summary_text(design, bound=bound)))
    return written


def figures_of(design: GainDesign) -> list[str]:
    """Return the names of the figures that a design has."""
    names = ["payload_spectrum", "responses", "nyquist", "limits"]
    if design.margins is None:
        names.remove("limits")
    if not has_gains(design):
        names.remove("nyquist")
    return names


def summary_text(design: GainDesign, *, bound: bool = True) -> str:
    """Return the summary as Markdown; its figures are those of the same folder."""
    case = design.case
    verdict = "Ok" if design.ok else "Not ok"
    parts = [f"# {case.name}", " ".join(case.description.split())]
    parts.append(f"**{verdict}**: {design.status}.")
    required = required_rows(design)
    if required:
        wanted = f"needed in H_s {case.sea.significant_height:.3g} m"
        parts.append(_table(("limit that breaks", "is", wanted), required))
        parts.append(f"All figures below are those in H_s {design.significant_height:.3g} m.")
    parts.append("## Payload motion")
    motions = [(row.label, row.rms, row.significant, row.largest) for row in motion_rows(design)]
    largest = f"most probable maximum in {duration(case.limits.exposure_time)}"
    parts.append(_table(("motion", "rms", "significant height", largest), motions))
    parts.append(_sentence(effect(design)))
    parts += _figure(design, "payload_spectrum") + _figure(design, "responses")
    if has_gains(design):
        parts += ["## Gains", f"`{command_text(design)}`"]
        gains = [(g.name, g.acts_on, g.value, g.product, g.unit) for g in gain_rows(design)]
        parts.append(_table(("gain", "on the payload's", "value", "A times it", "unit"), gains))
    if design.margins is not None:
        parts += ["## Margins", _table(("margin", "", ""), margin_rows(design))]
    parts += _figure(design, "nyquist")
    if design.limits:
        parts += ["## Limits", _limit_table(limit_rows(design))]
        parts.append(
            "Price: what the payload's rms would lose if the bound were one percent looser. "
            "A limit that is only reported did not bind the design."
        )
        parts += _figure(design, "limits")
    parts += ["## What this rests on", _table(("", ""), facts(design, bound=bound))]
    parts.append(
        "`design.yaml` holds all of this for `stillhook.load_design`, `case.yaml` the case."
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def _limit_table(rows: Sequence[LimitRow]) -> str:
    cells = [
        (row.label, row.value, row.bound, percent(row.use), row.remark or "kept") for row in rows
    ]
    return _table(("limit", "value", "bound", "use", "price"), cells)


def _figure(design: GainDesign, name: str) -> list[str]:
    return [f"![{_CAPTIONS[name]}]({name}.svg)"] if name in figures_of(design) else []


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; a bar in a text would end its cell."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
