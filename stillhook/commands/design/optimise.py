"""`stillhook optimise`: from a case to its gains, on the terminal and in a folder."""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Callable
from typing import TYPE_CHECKING

from ...designs import AT_LEAST, LIMITS
from ...text import OutputFolder, number
from ..declare import CASE, NO_BOUND, changed_words, options
from ..given import case_words, gains_text, given_case, parse_fixed, parse_members
from ..lists import names
from ..working import conclude, kept_in, prepared, working

if TYPE_CHECKING:
    from synth.design import Design

_FAMILY = options(
    """
    --member PATH=VALUE[;..] ...  another case that the same gains are for, as in
        --member rope.damping_ratio=0.0002 or --member 'rope.length=800 m; payload.mass=40 t'
    --objective {worst,mean,regret} [worst]  what is made small (default: the worst payload motion)
    --fix NAME=NUMBER ...  hold a parameter, as in --fix a=0
    """
)
ARGUMENTS = (
    CASE,
    options(
        """
        --out DIR  folder for the results (default: out/<name of the case>)
        --starts N [16]  starts of the search
        --seed N [0]  seed of the starts
        --structure NAME  controller structure, such as payload-feedback, or several, the simplest
            first (default: those that the case's sensors allow)
        """,
        structure=names,
    ),
    _FAMILY,
    NO_BOUND,
)
EXAMPLES = (
    (
        "stillhook optimise subsea-crane",
        "the best gains, with figures and a report: a minute or two",
    ),
    (
        "stillhook optimise thesis-1975 --structure payload-feedback --starts 4",
        "one structure and a short search: seconds",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Optimise, show and save; return 0 if the design is ok, 1 if not."""
    from synth.structures import structure_aboard

    case = given_case(arguments)
    asked, fixed = arguments.structure, parse_fixed(arguments.fix)
    members = [case.replace(changes) for changes in parse_members(arguments.member)]
    for name in asked or ():
        structure_aboard(name, case)  # a name that cannot be ends here, before any file
    folder = prepared(arguments, case.name)
    folder.write("case.yaml", case.to_yaml())
    from synth import optimise_gains

    from ...designs import design_data, design_report, keep_best, write_design

    one = asked[0] if asked is not None and len(asked) == 1 else asked
    design: Design | None = None
    try:
        with working(arguments) as tell:
            design = optimise_gains(
                case,
                one,
                members=members,
                objective=arguments.objective,
                fixed=fixed,
                starts=arguments.starts,
                seed=arguments.seed,
                progress=tell,
            )
            # Other commands then need not search for it again.
            plain = not members and not fixed and (arguments.starts, arguments.seed) == (16, 0)
            if plain and (one is None or isinstance(one, str)):
                keep_best(design, case, one)
            write_design(folder, design=design, bound=arguments.bound, progress=tell)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(_kept(folder, design)) from None
    report = design_report(design, bound=arguments.bound and not arguments.quiet)
    following = _next(design, arguments, folder)
    return conclude(report, arguments, folder, following, result=design_data(design))


def _kept(folder: OutputFolder, design: Design | None) -> str:
    """Return what an interrupted run leaves behind: whole files, some of them perhaps old."""
    kept = kept_in(folder.path)
    names = ", ".join(kept)
    if design is not None:
        return f"the design is finished, its report is not; kept in {folder.path}: {names}"
    old = "" if kept == ["case.yaml"] else " (all but case.yaml are from an earlier run)"
    return f"no design was finished; kept in {folder.path}: {names}{old}"


def _next(
    design: Design, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    words = case_words(arguments, folder)
    plain = design.structure == "payload-feedback"
    structure = "" if plain else f" --structure {design.structure}"
    family = "".join(f" {shlex.quote(word)}" for word in changed_words(arguments, (_FAMILY,)))
    optimise = f"stillhook optimise {words}{structure}{family}"
    rows = []
    if not design.feasible:
        height = _rounded(design.significant_height, math.floor)
        rows.append(
            (
                f"the largest sea that is feasible, H_s {height} m",
                f"{optimise} --set sea.significant_height={height}",
            )
        )
    if design.required:
        sets = [
            f"--set {LIMITS[name][1]}={_rounded(value, math.ceil)}"
            for name, value in design.required.items()
        ]
        rows.append(("a drive that can do it", f"{optimise} {' '.join(sets)}"))
    highest = max(design.limits.values(), key=lambda use: use.price, default=None)
    if highest is not None and highest.price > 0.0 and design.ok:
        bound = highest.bound * (0.9 if highest.name in AT_LEAST else 1.1)
        rows.append(
            (
                "the limit with the highest price, a tenth looser",
                f"{optimise} --set {LIMITS[highest.name][1]}={number(bound)} "
                f"--out {shlex.quote(str(folder.path) + '-looser')}",
            )
        )
    if design.margins is not None:
        given = f"--gains {gains_text(design.parameters)}"
        if not plain:
            given = f"--design {shlex.quote(str(folder.path / 'design.yaml'))}"
        rows.append(("these gains again", f"stillhook evaluate {words} {given}"))
        rows.append(("in which seas they can work", f"stillhook operability {words} {given}"))
        rows.append(("where mass, stiffness and delay are off", f"stillhook sweep {words} {given}"))
    rows.append(("what was read from the case", f"stillhook check {words}"))
    return rows


def _rounded(value: float, towards: Callable[[float], int]) -> str:
    """Return a figure rounded down or up at its third digit, so that it suffices."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return number(towards(value / unit) * unit)
