"""`stillhook sweep`: a design or a controller on many cases about the nominal one.

Exit status 0 if every case holds the payload, 1 if one does not or could not be run, 130 after
Ctrl-C; what was run in time until then is kept, and the same command, or --resume, goes on.
"""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from models import Case
from models.basics import InputError
from models.spread import Spread
from synth.design import Design
from synth.sweeps import ATTRIBUTE, law_of

from ...sweeps import (
    STATUS,
    UNKNOWN,
    place_of,
    sweep_figures,
    sweep_report,
    varied_paths,
    worst_cases,
    write_sweep,
)
from ...text import OutputFolder, count, picture
from ..declare import OPTIONAL_CASE, changed_words, options, within
from ..given import case_words, given_case, parse_options, split_pairs
from ..given_design import design_words, given_design, with_design
from ..lists import names
from ..working import conclude, counting, place_for, prepared, tidy

if TYPE_CHECKING:
    import xarray as xr

_MOST = 100  # of the worst cases that are told
_IN_TIME = (
    "--follow", "--faults", "--settle", "--scenario", "--option", "--masses", "--common-seed",
    "--first", "--jobs", "--cluster",
)  # fmt: skip
"""Options that do nothing in the frequency domain."""

ARGUMENTS = (
    OPTIONAL_CASE,
    options(
        """
        who is tried:
        --design FILE  a design that was written, as in out/CASE/design.yaml
        | --gains A=..,a=..,a1=..,a2=..  gains, or parameters by name (default: the gains that the
            case has in use; else the best design is found, a minute or so once)
        | --controller NAME  another controller, with --mode time, as in mpc (see `stillhook
            scenarios`)
        --structure NAME  whose parameters --gains are (default: payload-feedback); without them
            its best ones are found
        --follow  make the controller for each case, and design a design anew (default: it is made
            for the nominal case, and the plant is another)

        what varies (default: mass, stiffness, drag and delay):
        --spread FILE  a spread file (.yaml)
        --vary PATH=RANGE ...  vary a number evenly, as in payload.mass=30%% (either way) or
            'delay=20 ms..80 ms'; adds to --spread
        --faults A,B,..  vary what fails, with --mode time: dropouts, outages, stuck,
            spikes, delay-jumps, sensor-bias, mru-bias, limit-cuts
        --samples N  number of cases (default: 10000; with --mode time 256)
        --sampling METHOD [sobol]  sobol (default), lhs, random, grid, corners or given
        --seed N [0]  seed of the draws
        --mode {frequency,time} [frequency]  the linear loop (default), or nonlinear runs in time

        in the time domain (--mode time):
        --duration TIME [10 min]  length of a run (default: 10 min)
        --settle TIME  when its statistics begin
        --scenario NAME [hold]  the operation (default: hold)
        --option KEY=VALUE ...  an option of the operation
        --masses N  masses along the rope (default: the case's)
        --first N [0]  number of the first case, for a part of a longer sweep
        --common-seed  let all cases meet the same sea and noise

        where it runs, with --mode time:
        --jobs N  processes (default: one for each core)
        --cluster ADDRESS  a dask scheduler, as in tcp://10.0.0.1:8786, or local:4 for four
            processes here
        --resume DIR  go on with a sweep that was stopped, from its folder alone

        results:
        --out DIR  folder for the results (default: out/<case>-sweep); with --mode time the same
            command again goes on with what is there
        --worst N [5]  how many of the worst
        """,
        faults=names,
        worst=within(low=0, high=_MOST),
    ),
)
EXAMPLES = (
    ("stillhook sweep thesis-1975 --samples 1000", "a thousand plants that are a little off"),
    (
        "stillhook sweep thesis-1975 --samples 1000 --vary payload.mass=30%",
        "of which only the mass is not known",
    ),
    (
        "stillhook sweep thesis-1975 --mode time --samples 4 --duration '1 min'",
        "nonlinear runs in time instead",
    ),
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Swept:
    """A sweep that was made: its case, and what came of it."""

    case: Case
    design: object
    result: xr.Dataset
    folder: Path
    words: str


def run(arguments: argparse.Namespace) -> int:
    """Sweep, show and save; return the exit status."""
    swept = _resumed(arguments) if arguments.resume else _swept(arguments)
    result = swept.result
    complete = int(result.attrs.get("complete", 1)) == 1
    known = ~np.isin(result.get("status", 0), UNKNOWN)
    if not complete and not known.any():
        raise KeyboardInterrupt("no case was finished")
    status = _concluded(swept, arguments)
    if not complete:
        there = count(int(known.sum()), "case")
        raise KeyboardInterrupt(
            f"{there} kept; stillhook sweep --resume {shlex.quote(str(swept.folder))} goes on"
        )
    return status


def _swept(arguments: argparse.Namespace) -> Swept:
    """Return the sweep that was asked for."""
    from ...sweeps import sweep

    if arguments.case is None:
        raise InputError("sweep: say which case, or --resume and the folder of a sweep")
    if arguments.mode == "frequency":
        wrong = [word for word in changed_words(arguments, ARGUMENTS) if word in _IN_TIME]
        if wrong:  # it would do nothing
            raise InputError(f"sweep: {', '.join(wrong)}: only with --mode time")
    case = given_case(arguments)
    design = given_pilot(case, arguments)
    spread = given_spread(arguments)
    place = place_for(arguments, case.name, "-sweep")
    with tidy(place):
        folder = OutputFolder.prepare(place).path
        options: dict[str, Any] = {}
        if arguments.mode == "time":
            options = {
                "duration": arguments.duration,
                "settle": arguments.settle,
                "scenario": arguments.scenario,
                "options": parse_options(arguments.option),
                "masses": arguments.masses,
                "design_follows": arguments.follow,
                "common_seed": arguments.common_seed,
                "first": arguments.first,
                "engine": arguments.cluster,
                "jobs": arguments.jobs,
                "store": folder,
            }
        with counting(arguments) as step:
            result = sweep(
                design,
                spread,
                case=case,
                samples=arguments.samples,
                sampling=arguments.sampling,
                seed=arguments.seed,
                mode=arguments.mode,
                progress=step,
                **options,
            )
    return Swept(
        case=case, design=design, result=result, folder=folder, words=case_words(arguments)
    )


def _resumed(arguments: argparse.Namespace) -> Swept:
    """Return the sweep of a folder, gone on with."""
    import warnings

    from models.basics import PhysicsWarning

    from ...sweeps import resume_sweep, stored_question

    if arguments.case is not None:
        raise InputError(
            f"sweep: --resume takes case and all else from {arguments.resume}; give no CASE"
        )
    warnings.simplefilter("ignore", PhysicsWarning)  # told when it was begun
    question, _ = stored_question(arguments.resume)
    with counting(arguments) as step:
        result = resume_sweep(
            arguments.resume, engine=arguments.cluster, jobs=arguments.jobs, progress=step
        )
    return Swept(
        case=question.case, design=None, result=result, folder=Path(arguments.resume), words=""
    )


def given_pilot(case: Case, arguments: argparse.Namespace) -> object:
    """Return what is tried: a controller's name, or a design on the case.

    Raises InputError if there is none, or a name goes with the frequency domain.
    """
    if arguments.controller is None:
        return given_design(case, arguments)
    if arguments.mode == "frequency":
        raise InputError(
            "sweep: --controller goes with --mode time; in the frequency domain give --design or "
            "--gains"
        )
    return str(arguments.controller)


def given_spread(arguments: argparse.Namespace) -> Spread | None:
    """Return what varies; None for the usual.

    Raises InputError if a file is none, or a text is not of the form PATH=RANGE.
    """
    from ...sweeps import fault_spread

    parts = []
    if arguments.spread is not None:
        parts.append(Spread.from_yaml(arguments.spread))
    if arguments.vary:
        parts.append(Spread(parse_ranges(arguments.vary)))
    faults = getattr(arguments, "faults", None)  # of the time domain
    if faults is not None:
        parts.append(fault_spread(*faults))
    if not parts:
        return None
    together: dict[str, Any] = {}
    correlations: dict[tuple[str, str], float] = {}
    for part in parts:
        for path, distribution in part.distributions.items():
            if path in together:
                raise InputError(f"sweep: {path} is given twice")
            together[path] = distribution
        correlations |= part.correlations or {}
    return Spread(together, correlations)


def parse_ranges(texts: list[str]) -> dict[str, Any]:
    """Return even distributions from texts PATH=WIDTH or PATH=LOW..HIGH.

    Raises InputError if a text has neither form, or a path comes twice.

    Examples
    --------
    >>> parse_ranges(["payload.mass=30 %", "delay=20 ms..80 ms"])["delay"].to_dict()
    {'uniform': {'low': '20 ms', 'high': '80 ms'}}
    """
    from models.spread import Uniform

    form = "PATH=WIDTH or PATH=LOW..HIGH, as in payload.mass=30% or 'delay=20 ms..80 ms'"
    found: dict[str, Any] = {}
    for path, value in split_pairs("--vary", form, texts).items():
        ends = [_number(part) for part in value.split("..")]
        if len(ends) > 2 or "" in ends:
            raise InputError(f"--vary: must be {form}, got '{path}={value}'")
        found[path] = Uniform(*ends)
    return found


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text.strip()


def _concluded(swept: Swept, arguments: argparse.Namespace) -> int:
    """Write and print what the sweep says; return the exit status."""
    result, most = swept.result, arguments.worst
    folder = prepared(arguments, swept.folder)
    folder.keep(*write_sweep(swept.folder, result, worst=most))
    worst = worst_cases(result, most) if most else []
    law = _worst_design(swept, folder, worst)
    if folder.kinds:
        _figures(swept, folder)
    report = sweep_report(result, swept.case.name, worst=most)
    following = _next(swept, worst, law, arguments)
    brief = report.sections[:1]
    if isinstance(swept.design, Design):  # no controller by its name
        report = with_design(report, swept.design, swept.case, arguments)
    return conclude(report, arguments, folder, following, brief=brief)


def _worst_design(swept: Swept, folder: OutputFolder, worst: list[int]) -> Path | None:
    """Write the design of the worst case in time, where its parameters stand in no case file."""
    from synth import evaluate_gains

    from ...designs import design_text

    if not worst or swept.result.attrs["mode"] != "time":
        return None
    structure, parameters = law_of(swept.result, worst[0])
    if structure in ("", "payload-feedback"):
        return None
    return folder.write(
        "worst-design.yaml", design_text(evaluate_gains(swept.case, parameters, structure))
    )


def _figures(swept: Swept, folder: OutputFolder) -> None:
    """Draw and write the figures, in the folder's kinds."""
    linear = isinstance(swept.design, Design)
    in_time = swept.result.attrs.get("mode") == "time"
    design: Any = swept.design if linear and not in_time else None
    result = swept.result
    if in_time:
        result = result.isel(case=~np.isin(result["status"].to_numpy(), UNKNOWN))
    for name, figure in sweep_figures(result, design).items():
        for kind in folder.kinds:
            folder.write(f"{name}.{kind}", picture(figure, kind, name=name))


def _next(
    swept: Swept, worst: list[int], law: Path | None, arguments: argparse.Namespace
) -> list[tuple[str, str]]:
    """Return the commands to go on with; `law` is the file of the worst case's design."""
    folder = swept.folder
    found = []
    if "status" in swept.result and (swept.result["status"] == STATUS["died"]).any():
        again = f"stillhook sweep --resume {shlex.quote(str(folder))}"
        found.append(("the cases that are left out once more", again))
    if worst:
        file = shlex.quote(str(folder / "worst.yaml"))
        structure = law_of(swept.result, worst[0])[0]
        other = "" if structure in ("", "payload-feedback") else f" --structure {structure}"
        found.append(("what the worst case would take", f"stillhook optimise {file}{other}"))
        if swept.result.attrs.get("mode") == "time":
            at = place_of(swept.result, worst[0])
            seed = int(swept.result["seed"].to_numpy()[at])
            words = ["stillhook simulate", file, *_controller_words(swept, law)]
            lasting = float(json.loads(swept.result.attrs[ATTRIBUTE])["duration"])
            words.append(f"--first-seed {seed} --duration '{lasting:g} s'")
            found.append(("see the worst case again", " ".join(words)))
    if swept.words and swept.result.attrs.get("mode") != "time":
        same = " ".join([swept.words, *design_words(arguments)])
        again = f"--spread {shlex.quote(str(folder / 'spread.yaml'))}"
        place = shlex.quote(f"{folder}-time")
        command = f"stillhook sweep {same} --mode time --out {place}"
        if "drag" not in varied_paths(swept.result):
            command += f" {again}"
        found.append(("the same in time, with limits and slack rope", command))
    return found


def _controller_words(swept: Swept, law: Path | None) -> list[str]:
    """Return the words for `stillhook simulate`; three gains stand in the case file."""
    if law is not None:
        return ["--design", shlex.quote(str(law))]
    header = json.loads(swept.result.attrs[ATTRIBUTE])["controller"]
    by_name = header["kind"] == "name" and header["name"] != "feedback"
    return ["--controller", header["name"]] if by_name else []
