"""`stillhook report`: a design and the studies of it as one document for clients and surveyors.

What is not given is run: the best design, its studies, simulations and failures.  Exit status 0 if
the design is ok and keeps what is required, 1 if not.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from models.basics import InputError

from ...text import OutputFolder, Progress, Report, ReportSection, pairs
from ..declare import CASE, DESIGN, NO_BOUND, REQUIRED, STILLNESS, changed_words, options, within
from ..given import USUALLY_OFF, case_words, given_case
from ..given_design import design_words, given_design, names_design, with_design
from ..lists import axis, names
from ..weather import WEATHER, asked_weather, found_windows
from ..working import conclude, place_for, prepared, tidy, working

if TYPE_CHECKING:
    from models import Case
    from synth.design import Design

    from ...report import Findings

PARTS = (
    "comparison", "operability", "sweep", "sensitivity", "robustness", "failures", "simulation"
)  # fmt: skip
"""Studies that a report is made of, and that can be left out of it."""

_SAMPLES = 2000  # plants of the sweep
_LASTING = "30 min"  # of each simulation
_FOLDER = "comparison"  # in the report's own, from which a comparison goes on

_BLOCK = options(
    """
    title block:
    --title TEXT  of the document (default: one that names the case)
    --client TEXT  for whom it is
    --project TEXT  what it belongs to
    --document TEXT  its number
    --date DATE  as in 2026-11-28 (default: today)
    --author TEXT  who prepared it
    --checker TEXT  who checked it
    --approver TEXT  who approved it
    --revision TEXT ...  a row of the revision table, 'MARK; DATE; TEXT[; AUTHOR[; CHECKER[;
        APPROVER]]]', the last one being this issue
    """
)
ARGUMENTS = (
    CASE,
    DESIGN,
    options(
        f"""
        --without A,B,..  studies that are not wanted: {", ".join(PARTS)}
        --comparison DIR  a folder of `stillhook compare` for this case, which is gone on with
            (default: comparison in the report's own)
        --seeds N [3]  seas of the simulations and failures
        --headings LOW..HIGH[/STEP]|A,B,..  headings of operability [deg], 180 head sea (default:
            the case's own; half a minute for each)
        --scatter FILE  scatter diagram (.csv): the share of the year that is workable; `example` is
            a made-up one
        --out DIR  folder for the report (default: out/<case>-report)
        """,
        without=names,
        headings=axis(30.0),
        seeds=within(low=1, high=1000),
    ),
    NO_BOUND,
    STILLNESS,
    WEATHER,
    _BLOCK,
)
EXAMPLES = (
    (
        "stillhook report thesis-1975 --without comparison,operability,failures",
        "a report without its longest chapters, as HTML and PDF",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Run what is missing, and write the report; return 0 if it says ok, 1 if not."""
    from ...report import (
        NO_PDF,
        Findings,
        Revision,
        TitleBlock,
        belongs_to,
        can_typeset,
        requirement_of,
        write_report,
    )

    for name in arguments.without or ():
        if name not in PARTS:
            raise InputError(f"report: --without: there is no {name!r}; {', '.join(PARTS)}")
    words = ("title", "client", "project", "document", "date", "author", "checker", "approver")
    block = TitleBlock(
        revisions=tuple(Revision.read(text) for text in arguments.revision),
        **{name: getattr(arguments, name) or "" for name in words},
    )
    case = given_case(arguments)
    required = {name: getattr(arguments, name) for name in REQUIRED}
    weather = asked_weather(arguments)
    if weather[1] is not None and "operability" in (arguments.without or ()):
        raise InputError("report: --seas needs the study of operability; take it out of --without")
    place = place_for(arguments, case.name, "-report")
    if not arguments.force:
        belongs_to(place, case)
    with tidy(place):
        requirement_of(case, required)
        folder = prepared(arguments, place)
        design = _design(case, arguments)
        with working(arguments) as tell:
            studies = _studies(case, design, weather, folder, arguments, tell)
            write_report(
                folder,
                design=design,
                requirement=required,
                bound=arguments.bound,
                figures=arguments.figures,
                block=block,
                force=arguments.force,
                progress=tell,
                **studies,
            )
    findings = Findings(design=design, required=requirement_of(case, required), **studies)
    report = _told(findings, folder)
    if not can_typeset():
        report = _with_note(report, NO_PDF)
    report = with_design(report, design, case, arguments)
    return conclude(report, arguments, folder, _next(design, folder, arguments))


def _design(case: Case, arguments: argparse.Namespace) -> Design:
    """Return the design that the arguments name, with all that its search found out.

    Its alternatives and prices are lost where its parameters alone are evaluated anew.
    """
    from ...designs import best_design, load_design

    if arguments.design is not None and arguments.gains is None and arguments.structure is None:
        design = load_design(arguments.design)
        if design.case == case:
            return design
    elif not names_design(case, arguments):
        with working(arguments) as tell:
            return best_design(case, arguments.structure, progress=tell)
    return given_design(case, arguments)


def _studies(
    case: Case,
    design: Design,
    weather: tuple[Any, Any],
    folder: OutputFolder,
    arguments: argparse.Namespace,
    tell: Progress,
) -> dict[str, Any]:
    """Return the studies that are wanted, by the names that `write_report` has for them."""
    import stillhook as sh

    rule, seas = weather
    angles = arguments.headings
    if angles is None and case.vessel.heading is not None:
        angles = [np.degrees(case.vessel.heading)]
    options = {"duration": _LASTING, "seeds": arguments.seeds}

    def shares(what: str) -> Callable[[float], None]:
        return lambda share: tell(what, round(100.0 * share), 100)

    def compared() -> dict[str, Any]:
        store = Path(arguments.comparison or folder.at(_FOLDER))
        found = sh.compare(case, design=design, out=store, traces=arguments.figures, progress=tell)
        return {"comparison": found}

    def worked() -> dict[str, Any]:
        study = sh.operability(
            design,
            headings=None if angles is None else [float(np.radians(a)) for a in angles],
            scatter=arguments.scatter,
            seas=seas,
            vessel_heading=rule,
            progress=tell,
            **{name: getattr(arguments, name) for name in REQUIRED},
        )
        windows = None if seas is None else found_windows(study, seas, rule, arguments)
        return {"operability": study, "windows": windows}

    makers: dict[str, Callable[[], dict[str, Any]]] = {
        "comparison": compared,
        "operability": worked,
        "sweep": lambda: {"sweep": sh.sweep(design, samples=_SAMPLES, progress=tell)},
        "sensitivity": lambda: {"sensitivity": sh.sensitivity(design, progress=tell)},
        "robustness": lambda: {"robustness": sh.robustness(design, USUALLY_OFF, progress=tell)},
        "failures": lambda: {
            "failures": sh.failure_modes(case, design, seeds=arguments.seeds, progress=tell)
        },
        "simulation": lambda: {
            "runs": sh.simulate(case, design, progress=shares("simulation"), **options),
            "held": sh.simulate(case, "none", progress=shares("drum held"), **options),
        },
    }
    found: dict[str, Any] = {}
    for name in PARTS:
        if name in (arguments.without or ()) or design.margins is None:
            continue
        made = makers[name]()
        if not all(_whole(study) for study in made.values()):
            kept = f"; the runs so far are kept in {folder.path / _FOLDER}, and the same command "
            kept = f"{kept}goes on with them" if name == "comparison" else ""
            raise KeyboardInterrupt(f"no report was written{kept}")
        found |= made
    return found


def _whole(study: Any) -> bool:
    """Return whether a study went to its end: after Ctrl-C some return what there is."""
    if isinstance(study, Sequence):  # of runs
        return not any(run.status == "interrupted" for run in study)
    return bool(getattr(study, "complete", True))


def _told(findings: Findings, folder: OutputFolder) -> Report:
    """Return what the terminal says: the verdict, and what the document holds."""
    from ...report import verdict

    there = [
        field.name
        for field in fields(findings)
        if field.name not in ("design", "required") and getattr(findings, field.name) is not None
    ]
    ok, status = verdict(findings)
    design = findings.design
    rows = [("document", str(folder.path / "report.html"))]
    rows += [("with", ", ".join(there) or "the design alone")]
    return Report(
        name=design.case.name,
        about=" ".join(design.case.description.split()),
        status=status,
        ok=ok,
        sections=[ReportSection("", [pairs(rows)])],
    )


def _with_note(report: Report, note: str) -> Report:
    return replace(report, sections=[*report.sections, ReportSection("", [note])])


def _next(
    design: Design, folder: OutputFolder, arguments: argparse.Namespace
) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    words = case_words(arguments, folder)

    def again(**changes: object) -> str:
        own = changed_words(arguments, ARGUMENTS, set=[], out=str(folder.path), **changes)
        return " ".join(["stillhook report", words, *map(shlex.quote, own)])

    rows = []
    if not any(getattr(arguments, name) is not None for name in REQUIRED):
        rows.append(("against a requirement on the load's motion", again(payload_rms="50 mm")))
    if arguments.seas is None and "operability" not in (arguments.without or ()):
        rows.append(
            ("with weather windows (of a made-up year)", again(seas="example", duration="12h"))
        )
    words = " ".join([words, *design_words(arguments)])
    rows.append(("the design by itself", f"stillhook evaluate {words}"))
    return rows
