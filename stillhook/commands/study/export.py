"""`stillhook export`: a controller, or the plant, as others run it.

Exit status 0 if each kind was compared with the simulation and found the same, 1 if one could not
be, as for want of a compiler.
"""

from __future__ import annotations

import argparse
import math
import shlex
from typing import TYPE_CHECKING, Any

from models.basics import InputError

from ...text import Progress, Report, ReportSection, pairs
from ..declare import options, within
from ..given import given_case
from ..given_design import given_design
from ..lists import names, quantity
from ..working import conclude, place_for, prepared, tidy, working

if TYPE_CHECKING:
    from models import Case

    from ...exports import Export

_STEP = quantity("time", 1e-5, 10.0)
ARGUMENTS = (
    options(
        """
        case  a design that was written, as in out/CASE/design.yaml; or a bundled case (see
            `stillhook cases`) or a case file (.yaml, .json, .toml)
        --set PATH=VALUE ...  change a field of the case, as in --set limits.max_sensitivity=2.5
            or --set 'sensors.telemetry.delay=50 ms'
        --to A,B,.. [c]  what to write: c, fmu, st, mat, json (the controller), plant (an FMU of the
            plant), orcaflex, moordyn, csv (a run in the case's sea) (default: c)

        the controller, of a case:
        --controller NAME  one of `stillhook scenarios` (default: the feedback of a design)
        --gains A=..,a=..,a1=..,a2=..  gains, or parameters by name (default: the gains that the
            case has in use; else the best design is found, a minute or so once)
        --structure NAME  whose parameters these are (default: payload-feedback); without --gains
            its best ones are found

        how:
        --sample-time TIME  of the controller, as in '10 ms' (default: the controller's own)
        --communication-step TIME  of the co-simulation that an FMU goes into: the margins there
        --ramp TIME [5 s]  in which the controller takes the drive over (default: 5 s)
        --rate SPEED  highest rate of the set point (default: as the operator asks)
        --slew RATE  highest rate of the command, in its unit per second (default: none)
        --duration TIME [10 min]  of the run that a series is taken from (default: 10 min)
        --seed N [0]  its sea
        --name NAME  what files and functions are called (default: after the controller)
        --out DIR  folder for the exports (default: out/<case>-export)
        """,
        to=names,
        sample_time=_STEP,
        communication_step=_STEP,
        ramp=quantity("time", 0.0, 600.0),
        rate=quantity("speed", 0.0, 100.0, open_low=True),
        slew=within(low=0.0, open_low=True),
        duration=quantity("time", 60.0, 3.0 * 3600.0),
    ),
)
EXAMPLES = (
    ("stillhook export thesis-1975", "the gains in use as C99, with a README and a test"),
    (
        "stillhook export thesis-1975 --to st,mat",
        "as structured text for a PLC, and as state space",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Write what is asked for; return 0 if all of it was checked and found the same."""
    from ...exports import asked_kinds, export

    kinds = asked_kinds(arguments.to)
    what, case = _meant(arguments)
    place = place_for(arguments, case.name, "-export")
    with tidy(place):
        folder = prepared(arguments, place)
        with working(arguments) as tell:
            if what is case and arguments.controller is None and set(kinds) != {"plant"}:
                what = given_design(case, arguments)
            _tuned(case, arguments, tell)
            found = export(
                what,
                folder,
                kinds,
                controller=arguments.controller if what is case else None,
                sample_time=arguments.sample_time,
                communication_step=arguments.communication_step,
                ramp=arguments.ramp,
                rate=math.inf if arguments.rate is None else arguments.rate,
                slew=math.inf if arguments.slew is None else arguments.slew,
                duration=arguments.duration,
                seed=arguments.seed,
                name=arguments.name,
                progress=tell,
            )
    return conclude(_told(found, case), arguments, folder, _next(found, folder.path, arguments))


def _meant(arguments: argparse.Namespace) -> tuple[Any, Case]:
    """Return the design of a file and its case, or the case that is named, twice.

    Raises InputError if there is neither, or options of a case are given with a design.
    """
    from ...designs import is_design_file, load_design

    if not is_design_file(arguments.case):
        arguments.design = None
        case = given_case(arguments)
        return case, case
    for name in ("set", "controller", "gains", "structure"):
        if getattr(arguments, name):
            raise InputError(
                f"export: --{name} is for a case; {arguments.case} is a design, with a case and a "
                "controller of its own"
            )
    design = load_design(arguments.case)
    return design, design.case


def _tuned(case: Case, arguments: argparse.Namespace, tell: Progress) -> None:
    """Tune predictive control where it can be told, as that takes seconds; it is kept."""
    if "mpc" in (arguments.controller or ""):
        from mpc.winch import tune_weights

        tune_weights(
            case,
            sample_time=arguments.sample_time or 0.05,
            progress=lambda share: tell("tuning", round(100.0 * share), 100),
        )


def _told(found: Export, case: Case) -> Report:
    """Return what the terminal says: what was written, and how it was checked."""
    checks = pairs([(one.kind, one.proof) for one in found.exported])
    sections = [ReportSection("How each was checked", [checks])]
    if found.facts:
        sections.append(ReportSection("The law", [pairs(list(found.facts))]))
    note = "No export is a safety function: each README says what that means."
    sections.append(ReportSection("", [note]))
    status = "exported, each compared with the simulation"
    if not found.proved:
        status = "exported, but not everything could be compared with the simulation"
    return Report(name=case.name, about="", status=status, ok=found.proved, sections=sections)


def _next(found: Export, place: Any, arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    kinds = [one.kind for one in found.exported]
    rows = []
    if "c" in kinds:
        rows.append(("build it here and replay", f"make -C {shlex.quote(str(place / 'c'))} check"))
    if "fmu" in kinds and found.law is not None:
        path = shlex.quote(str(place / "fmu" / f"{found.law.name}.fmu"))
        rows.append(("look into the FMU", f"{_PYTHON} -m fmpy info {path}"))
    if "fmu" not in kinds:
        rows.append(("for a co-simulation", f"{_again(arguments)} --to fmu,plant"))
    return rows


_PYTHON = "python"


def _again(arguments: argparse.Namespace) -> str:
    words = ["stillhook export", shlex.quote(arguments.case)]
    if arguments.controller is not None:
        words.append(f"--controller {arguments.controller}")
    return " ".join(words)
