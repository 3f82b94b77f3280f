"""`sh.write_report`: a design and its studies as a folder that can be handed to a client.

Findings --> Document --> report.html, report.pdf, report.json, case.yaml, design.yaml
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from models.basics import InputError, shows_progress
from models.case import Case
from synth.design import Design

from ..comparison import Comparison
from ..runs import FailureModes, Runs
from ..text import OutputFolder, Progress, json_text
from .document import TABLES, Document
from .findings import Findings, TitleBlock, requirement_of, told
from .pages import can_typeset, html_text, pdf_bytes
from .wording import CASE, DESIGN, OWN

if TYPE_CHECKING:
    import xarray as xr

    from synth.operability import Operability, WeatherWindows
    from synth.robust import Robustness
    from synth.sensitivity import Sensitivity

HTML, PDF = "report.html", "report.pdf"
NO_PDF = "report.pdf was not made: it needs typst: run `make report`; report.html prints on A4 too"


@shows_progress("drawing")
def write_report(
    out: str | Path | OutputFolder,
    *,
    design: Design,
    comparison: Comparison | None = None,
    operability: Operability | None = None,
    windows: WeatherWindows | None = None,
    sweep: xr.Dataset | None = None,
    sensitivity: Sensitivity | None = None,
    robustness: Robustness | None = None,
    failures: FailureModes | None = None,
    runs: Runs | None = None,
    held: Runs | None = None,
    requirement: Mapping[str, Any] | None = None,
    bound: bool = True,
    figures: bool = True,
    block: TitleBlock | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> list[Path]:
    """Write a design and the studies of it as a report for clients, class and surveyors.

    A chapter whose study is not given says so.  Every figure of the document names the file and
    the field that it came from, and stands in ``report.json``.

    Parameters
    ----------
    out
        The folder; it is made if need be.
    design
        The design (`sh.optimise_gains`, `sh.evaluate_gains`, `sh.load_design`).
    comparison, operability, windows, sweep, sensitivity, robustness, failures
        What `sh.compare`, `sh.operability`, `sh.weather_windows`, `sh.sweep`, `sh.sensitivity`,
        `sh.robustness` and `sh.failure_modes` returned for the same case.
    runs, held
        What `sh.simulate` returned for the design, and for the drum held in the same seas.
    requirement
        How still the load must be held, as in ``{"payload_rms": "50 mm"}``: ``payload_rms``,
        ``payload_significant``, ``payload_max``, ``payload_speed``, ``daf`` and ``snap``; by
        default what `operability` was asked for.
    bound
        Whether to compute the best that any linear controller could do, some 15 s.
    figures
        Whether to draw figures.
    block
        Title, client, names and revisions (`TitleBlock`).
    force
        Whether to write over the report of another case.
    progress
        Called as progress("figures" or "pages", done, total).

    Returns
    -------
    list of Path
        The files written: ``report.html``, ``report.json``, ``case.yaml``, ``design.yaml``, the
        tables as CSV in ``tables`` and, where Typst is installed, ``report.pdf``; a PDF or a table
        that only an earlier run had is removed.

    Raises
    ------
    InputError
        If the design has no controller, a study is of another case, the folder holds the report of
        another case, or a file cannot be written.
    """
    findings = Findings(
        design=design,
        required=requirement_of(design.case, requirement),
        comparison=comparison,
        operability=operability,
        windows=windows,
        sweep=sweep,
        sensitivity=sensitivity,
        robustness=robustness,
        failures=failures,
        runs=runs,
        held=held,
    )
    target = OutputFolder.prepare(out)
    if not force:
        belongs_to(target.path, design.case)
    if bound and progress is not None:
        progress("bound", 0, 1)
    document = Document.of(findings, block or TitleBlock(), bound=bound)
    pages = document.pages(progress, figures=figures)
    if progress is not None:
        progress("pages", 0, 1)
    # Made before anything is written: a report is there whole, or the one before it.
    made: list[tuple[str, str | bytes]] = [
        (CASE, design.case.to_yaml()),
        (DESIGN, document.design_text),
        (OWN, json_text(document.data)),
        (HTML, html_text(pages)),
    ]
    made += document.tables.items()
    if can_typeset():
        made.append((PDF, pdf_bytes(pages)))
    written = [target.write(name, content) for name, content in made]
    target.discard(PDF, f"{TABLES}/*.csv")
    return written


def belongs_to(folder: Path, case: Case) -> None:
    """Check that a folder has no report of another case.

    Raises InputError if it has.
    """
    try:
        there = json.loads((folder / OWN).read_bytes())["results"]["identification"]
        name, digest = str(there["case"]), str(there["digest"])
    except (OSError, ValueError, KeyError, TypeError):  # there is none, or not whole
        return
    if digest != case.digest:
        raise InputError(
            f"{folder}: holds the report of another case ({name}, {digest[:12]}) than this one "
            f"({told(case)}); name a new folder, or say --force to write over it"
        )
