"""`stillhook compare`: controllers side by side in the same seas, on the same nonlinear plant.

Exit status 0 if every run was made, 1 if one failed or nobody could take part, 130 after Ctrl-C;
what was simulated until then is kept, and the same command goes on with it.
"""

import argparse
import math
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

from models import Case
from models.basics import InputError

from ...comparison import Comparison, comparison_report, write_comparison
from ...text import Report, ReportSection, console, count, pairs, percent, quantity
from ..declare import CASE, changed_words, options, within
from ..given import case_words, given_case
from ..given_design import lying_design
from ..lists import names, numbers
from ..working import conclude, counting, place_for, prepared, tidy

_MANY = 10_000  # seeds: more than anybody wants on purpose
_PLENTY = 20  # seeds


def _controllers(option: str, text: str) -> list[object]:
    """Return the contenders of a text: names, and files of designs.

    Raises InputError if a file is no design; unknown names are told where they are looked up.
    """
    return [
        _design(option, name) if name.endswith((".yaml", ".yml")) else name
        for name in names(option, text)
    ]


def _design(option: str, path: str) -> object:
    """Return the design of a file, with its name.

    Raises InputError if it is none.
    """
    from ...designs import load_design

    del option
    return Path(path).stem, load_design(path)


ARGUMENTS = (
    CASE,
    options(
        """
        --controllers A,B,..  who takes part (default: each kind once); see --list; a design file
            is one too, as in out/CASE/design.yaml
        --all  everybody who can do anything here: a quarter of an hour and more
        --design FILE  a design that takes the place of the one that would be looked for
        --list  say who they are, and end
        --seeds N [6]  seas of each height
        --hs H,H,..  significant heights [m] (default: that of the case)
        --duration TIME [5 min]  of a run (default: 5 min)
        --mismatch NAME=VALUE,..  what of the plant is not as the controllers think, as in
            payload=+30%%,E=-30%%,delay=+50ms,spectrum=jonswap, or a path of the case
        --design-at {each,case} [each]  design the linear laws for each height (default), or once
            for the case's sea
        --starts N  starts of each search for a design (default: 1, of named contenders 8)
        --masses N  masses along the plant's rope (default: the case's)
        --settle TIME  when statistics begin
        --traces  write the time traces around the worst moment too (traces.csv)
        --jobs N  processes (default: one for each core)
        --out DIR  folder for the results (default: out/<case>-compare); the same command again goes
            on with what is there
        """,
        controllers=_controllers,
        design=_design,
        seeds=within(low=1, high=_MANY),
        hs=numbers(),
    ),
)
EXAMPLES = (
    (
        "stillhook compare thesis-1975 --controllers none,thesis,mpc --seeds 2",
        "three controllers in the same two seas",
    ),
    ("stillhook compare thesis-1975 --list", "who can take part"),
)


def run(arguments: argparse.Namespace) -> int:
    """Compare, show and save; return the exit status."""
    from ...comparison import compare

    if arguments.list:
        return conclude(_contenders(), arguments)
    if arguments.all and arguments.controllers is not None:
        raise InputError("compare: give --controllers or --all, not both")
    case = given_case(arguments)
    place = place_for(arguments, case.name, "-compare")
    with tidy(place), counting(arguments) as step:
        found = compare(
            case,
            "all" if arguments.all else arguments.controllers,
            design=arguments.design,
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
            traces=arguments.figures or arguments.traces,
            progress=step,
            told=_first_answers(arguments),
        )
    if not found.cells:
        if not found.complete:
            raise KeyboardInterrupt("no run was finished")
        for line in found.refused.values():
            console().print(line, soft_wrap=True)
        return 1
    folder = prepared(arguments, place)
    write_comparison(folder, found, traces=arguments.traces)
    report = comparison_report(found)
    # What the numbers say is the verdict.
    brief = [part for part in report.sections if part.items and isinstance(part.items[0], str)]
    status = conclude(report, arguments, folder, _next(case, found, place, arguments), brief=brief)
    if not found.complete:
        raise KeyboardInterrupt(
            f"{count(len(found.cells), 'run')} kept in {place}; the same command goes on"
        )
    return status


def _first_answers(arguments: argparse.Namespace) -> Callable[[Comparison], None] | None:
    """Return what writes the first run of everybody above the progress bar, as it comes."""
    if arguments.quiet or not console(stderr=True).is_terminal:
        return None
    seen: set[tuple[str, float]] = set()

    def tell(found: Comparison) -> None:
        for cell in found.cells:
            key = cell.contender, cell.height
            if key not in seen and math.isfinite(cell.rms):
                seen.add(key)
                told = f"H_s {cell.height:.4g} m: {cell.contender}, {quantity(cell.rms, 'm')} rms"
                share = found.residual(*key).mean
                if math.isfinite(share):
                    told += f", {percent(share)} of the hook's motion"
                print(f"  {told} (first seed)", file=sys.stderr)

    return tell


def _next(
    case: Case, found: Comparison, place: Path, arguments: argparse.Namespace
) -> list[tuple[str, str]]:
    words = case_words(arguments)
    rows = [("who took part, and what they know", "stillhook compare --list " + words)]
    if len(found.seeds) < _PLENTY:
        own = changed_words(arguments, ARGUMENTS, set=[], seeds=_PLENTY)
        more = " ".join(["stillhook compare", words, *map(shlex.quote, own)])
        rows.append((f"narrower intervals, from {_PLENTY} seeds", more))
    lying = None
    if arguments.design is None and arguments.controllers is None:
        lying = lying_design(case)
    if lying is not None:
        own = changed_words(arguments, ARGUMENTS, set=[], design=lying)
        again = " ".join(["stillhook compare", words, *map(shlex.quote, own)])
        rows.append(("with the design that was optimised", again))
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
