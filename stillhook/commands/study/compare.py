"""`stillhook compare`: controllers side by side in the same seas, on the same nonlinear plant.

Exit status 0 if every run was made, 1 if one failed or nobody could take part, 130 after Ctrl-C;
what was simulated until then is kept, and the same command goes on with it.
"""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from pathlib import Path

from models.basics import InputError, check_range

from ...comparison import Comparison, comparison_report, write_comparison
from ...text import OutputFolder, Report, ReportSection, console, count, pairs, show
from ..declare import CASE, choice, switch, text, whole
from ..given import case_words, given_case, split_numbers
from ..working import conclude, counting, figure_kinds, place_for, tidy

_MANY = 10_000  # seeds: more than anybody wants on purpose

ARGUMENTS = (
    CASE,
    text(
        "--controllers",
        "A,B,..",
        "who takes part (default: all that do anything here); see --list; a design file is "
        "one too, as in out/CASE/design.yaml",
    ),
    switch("--list", "say who they are, and end"),
    whole("--seeds", "seas of each height", 10),
    text("--hs", "H,H,..", "significant heights [m] (default: that of the case)"),
    text("--duration", "TIME", "of a run (default: 20 min)", "20 min"),
    text(
        "--mismatch",
        "NAME=VALUE,..",
        "what of the plant is not as the controllers think, as in payload=+30%%,E=-30%%,"
        "delay=+50ms,spectrum=jonswap, or a path of the case",
    ),
    choice(
        "--design-at",
        ("each", "case"),
        "design the linear laws for each height (default), or once for the case's sea",
        "each",
    ),
    whole("--starts", "starts of each search for a design", 8),
    whole("--masses", "masses along the plant's rope (default: the case's)"),
    text("--settle", "TIME", "when statistics begin"),
    whole("--jobs", "processes (default: one for each core)"),
    text(
        "--out",
        "DIR",
        "folder for the results (default: out/<case>-compare); the same command again goes "
        "on with what is there",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compare, show and save; return the exit status."""
    from ...comparison import compare

    if arguments.list:
        return conclude(_contenders(), arguments)
    check_range("compare", "--seeds", arguments.seeds, low=1, high=_MANY)
    wanted = _controllers(arguments.controllers)
    heights = _heights(arguments.hs)
    case = given_case(arguments)
    place = place_for(arguments, case.name, "-compare")
    with tidy(place), counting(arguments) as step:
        found = compare(
            case,
            wanted,
            seeds=arguments.seeds,
            duration=arguments.duration,
            heights=heights,
            mismatch=arguments.mismatch,
            masses=arguments.masses,
            settle=arguments.settle,
            design_at=arguments.design_at,
            starts=arguments.starts,
            jobs=arguments.jobs,
            out=place,
            traces=arguments.figures,
            progress=step,
        )
    if not found.cells:
        if not found.complete:
            raise KeyboardInterrupt("no run was finished")
        for line in found.refused.values():
            console().print(line, soft_wrap=True)
        return 1
    written = write_comparison(
        OutputFolder.prepare(place, figure_kinds(arguments)), found, figures=arguments.figures
    )
    report = comparison_report(found)
    if arguments.quiet:  # what the numbers say is the verdict
        brief = [part for part in report.sections if part.items and isinstance(part.items[0], str)]
        show(replace(report, sections=brief), console())
        status = 0 if report.ok else 1
    else:
        status = conclude(
            report, arguments, written=written, following=lambda: _next(found, place, arguments)
        )
    if not found.complete:
        raise KeyboardInterrupt(
            f"{count(len(found.cells), 'run')} kept in {place}; the same command goes on"
        )
    return status


def _next(found: Comparison, place: Path, arguments: argparse.Namespace) -> list[tuple[str, str]]:
    words = case_words(arguments)
    rows = [("who took part, and what they know", "stillhook compare --list " + words)]
    if found.question.mismatch.text == "":
        off = shlex.quote(f"{place}-off")
        again = f"stillhook compare {words} --mismatch payload=+30% --out {off}"
        rows.append(("the plant not as the controllers think", again))
    return rows


def _contenders() -> Report:
    from ...controllers import CONTENDERS, DEFAULTS

    marks = {name: "" if name in DEFAULTS else "  (if asked for)" for name in CONTENDERS}
    sections = [
        ReportSection(name + marks[name], [pairs([("is", each.what), ("knows", each.knows)])])
        for name, each in CONTENDERS.items()
    ]
    return Report(name="contenders", sections=sections)


def _controllers(text: str | None) -> list[object] | None:
    """Return the contenders of a text: names, and files of designs.

    Raises
    ------
    InputError
        If a file is no design; unknown names are told where they are looked up.
    """
    if text is None:
        return None
    found: list[object] = []
    for name in (part.strip() for part in text.split(",")):
        if not name.endswith((".yaml", ".yml")):
            found.append(name)
            continue
        from ...designs import load_design

        found.append((Path(name).stem, load_design(name)))
    return found


def _heights(text: str | None) -> list[float] | None:
    if text is None:
        return None
    if not (found := split_numbers(text)):
        raise InputError(
            f"--hs: must be heights [m] with commas between, as in 1.25,1.9,2.43; got {text!r}"
        )
    return list(found)
