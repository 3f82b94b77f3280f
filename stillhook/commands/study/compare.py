"""`stillhook compare`: controllers side by side in the same seas, on the same nonlinear plant.

Exit status 0 if every run was made, 1 if one failed or nobody could take part, 130 after Ctrl-C;
what was simulated until then is kept, and the same command goes on with it.
"""

import argparse
import shlex
from pathlib import Path

from ...comparison import Comparison, comparison_report, write_comparison
from ...text import Report, ReportSection, console, count, pairs
from ..declare import CASE, options, within
from ..given import case_words, given_case
from ..lists import names, numbers
from ..working import conclude, counting, place_for, prepared, tidy

_MANY = 10_000  # seeds: more than anybody wants on purpose


def _controllers(option: str, text: str) -> list[object]:
    """Return the contenders of a text: names, and files of designs.

    Raises InputError if a file is no design; unknown names are told where they are looked up.
    """
    from ...designs import load_design

    return [
        (Path(name).stem, load_design(name)) if name.endswith((".yaml", ".yml")) else name
        for name in names(option, text)
    ]


ARGUMENTS = (
    CASE,
    options(
        """
        --controllers A,B,..  who takes part (default: all that do anything here); see --list; a
            design file is one too, as in out/CASE/design.yaml
        --list  say who they are, and end
        --seeds N [10]  seas of each height
        --hs H,H,..  significant heights [m] (default: that of the case)
        --duration TIME [20 min]  of a run (default: 20 min)
        --mismatch NAME=VALUE,..  what of the plant is not as the controllers think, as in
            payload=+30%%,E=-30%%,delay=+50ms,spectrum=jonswap, or a path of the case
        --design-at {each,case} [each]  design the linear laws for each height (default), or once
            for the case's sea
        --starts N [8]  starts of each search for a design
        --masses N  masses along the plant's rope (default: the case's)
        --settle TIME  when statistics begin
        --jobs N  processes (default: one for each core)
        --out DIR  folder for the results (default: out/<case>-compare); the same command again goes
            on with what is there
        """,
        controllers=_controllers,
        seeds=within(low=1, high=_MANY),
        hs=numbers(),
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compare, show and save; return the exit status."""
    from ...comparison import compare

    if arguments.list:
        return conclude(_contenders(), arguments)
    case = given_case(arguments)
    place = place_for(arguments, case.name, "-compare")
    with tidy(place), counting(arguments) as step:
        found = compare(
            case,
            arguments.controllers,
            seeds=arguments.seeds,
            duration=arguments.duration,
            heights=arguments.hs,
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
    folder = prepared(arguments, place)
    write_comparison(folder, found)
    report = comparison_report(found)
    # What the numbers say is the verdict.
    brief = [part for part in report.sections if part.items and isinstance(part.items[0], str)]
    status = conclude(report, arguments, folder, _next(found, place, arguments), brief=brief)
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
