"""`stillhook simulate`: a controller, or several, on the nonlinear plant over some seeds.

Exit status 0 if every run went to its end, 1 if one diverged, 130 after Ctrl-C; what was simulated
until then is written all the same.
"""

import argparse
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

from models.basics import StillhookError, SynthesisError

from ...controllers import controller_of
from ...runs import (
    Runs,
    Series,
    TraceFormat,
    headline_of,
    keep_worst,
    runs_data,
    runs_report,
    tree,
    write_summary,
    write_traces,
)
from ...text import (
    OutputFolder,
    ReportSection,
    commands,
    console,
    count,
    json_text,
    number,
    progress,
    show,
    write_json,
)
from ..declare import CASE, changed_words, options, within
from ..given import case_words
from ..given_design import names_design, with_design
from ..lists import numbers, quantity
from ..working import Stop, asking, kept_in, place_for, prepared, stoppable, tidy, working
from .simulate_given import TIME, SimulationRequest, asked_of, sine

_MEGABYTE = 1e6
_MANY = 10_000  # seeds: more than anybody wants on purpose


@dataclass(kw_only=True)
class _Simulated:
    """What came of it: runs by controller, those left out and why."""

    compared: dict[str, Runs] = field(default_factory=dict)
    left_out: dict[str, StillhookError] = field(default_factory=dict)


ARGUMENTS = (
    CASE,
    options(
        """
        what is simulated:
        --controller NAME [feedback]  a controller, several with commas between, or all, which
            leaves out the predictive ones (default: feedback; see `stillhook scenarios`)
        --scenario NAME [hold]  an operation (default: hold)
        --option KEY=VALUE ...  an option of the operation, as in 'height=6 m'
        --seeds N [1]  how many seas
        --first-seed N [0]  seed of the first
        --hours H  length of a run in hours
        | --duration TIME  length of a run, as in '20 min' (default: the operation's own)
        --hook FILE  the hook's motion from a CSV file with the columns time and displacement
        | --sine AMPLITUDE,PERIOD  a sine instead, as in '0.5 m, 8 s'
        --tip X,Y,Z  --hook holds heave, roll and pitch of the vessel; the crane's tip is so far
            forward, to port and up [m]

        the feedback's design:
        --design FILE  a design that was written, as in out/CASE/design.yaml
        | --gains A=..,a=..,a1=..,a2=..  gains, or parameters by name (default: the gains that the
            case has in use; else the best design is found, a minute or so once)
        --structure NAME  whose parameters these are (default: payload-feedback); without --gains
            its best ones are found

        how:
        --sample-time TIME  of the controller, as in '20 ms'
        --step TIME  integration step (default: the longest)
        --masses N  masses along the rope (default: the case's)
        --settle TIME  when statistics begin (default: after some waves)
        --lock-limit LENGTH  error of the payload that counts as lost lock (default: the hook's
            significant height)
        --no-compile  do not compile the loop to C: slower, and needs no compiler

        results:
        --out DIR  folder for the results (default: out/<case>-<scenario>)
        --traces {csv,parquet,netcdf,none} [none]  write time traces, in this format
        --store-step TIME  time between two rows of them (default: so that there are at most 40 000)
        """,
        seeds=within(low=1, high=_MANY),
        first_seed=within(low=0),
        hours=within(low=0.0, high=1e4, open_low=True),
        duration=TIME,
        sine=sine,
        tip=numbers(3),
        sample_time=TIME,
        step=TIME,
        settle=quantity("time", 0.0, 1e8),
        lock_limit=quantity("length", 0.0, 1e5, open_low=True),
        store_step=TIME,
    ),
)
EXAMPLES = (
    (
        "stillhook simulate thesis-1975 --duration '2 min'",
        "two minutes with the gains in use, figures in out/thesis-1975-hold",
    ),
    (
        "stillhook simulate thesis-1975 --controller none,mpc --duration '2 min'",
        "the drum held against predictive control, in the same sea",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, show and save; return the exit status."""
    asked = asked_of(arguments)
    place = place_for(arguments, asked.case.name, f"-{asked.scenario.name}")
    found = _Simulated()
    with tidy(place), stoppable() as stop:
        folder = prepared(arguments, place)
        try:
            asked = _with_design(asked, arguments, folder, stop)
            total = len(asked.controllers) * len(asked.seeds) * asked.duration
            with progress(
                shown=not arguments.quiet, pace=lambda speed: f"{number(speed, 2)} x real time"
            ) as tell:

                def tick(what: str, before: float, span: float = 0.0, share: float = 0.0) -> None:
                    tell(what.format(share), before + span * share, total)
                    if stop():
                        raise KeyboardInterrupt  # ends a run, and is told by its status

                try:
                    _simulate(asked, found, folder, arguments.traces, tick)
                except KeyboardInterrupt:
                    if not stop():
                        raise
                if found.compared:
                    write_summary(
                        folder,
                        [*found.compared.values()],
                        case=asked.case,
                        question=_question(asked, arguments),
                        progress=lambda what, share: tell(what, share * total, total),
                    )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(folder)) from None
        stopped = stop()
    compared = [*found.compared.values()]
    if not compared:
        if not stopped:
            raise next(iter(found.left_out.values()))
        raise KeyboardInterrupt(f"nothing was simulated; {_kept(folder)}")
    if arguments.json:
        write_json(json_text(runs_data(compared)))
    elif arguments.quiet:
        for runs in compared:
            console().print(f"{headline_of(runs)}; {tree(runs)[0]}", soft_wrap=True)
    else:
        _show(asked, found, folder, arguments)
    if stopped:
        done = sum(run.completed for runs in compared for run in runs)
        wanted = len(asked.controllers) * len(asked.seeds)
        raise KeyboardInterrupt(
            f"{done} of {count(wanted, 'run')} went to the end; all there is was written to "
            f"{folder.path}"
        )
    return 0 if all(runs.completed for runs in compared) else 1


def _with_design(
    asked: SimulationRequest, arguments: argparse.Namespace, folder: OutputFolder, stop: Stop
) -> SimulationRequest:
    """Return what is asked with a design for the feedback, the best if there is none."""
    if not _fed_back(asked) or names_design(asked.case, arguments):
        return asked
    from ...designs import best_design, design_text

    with working(arguments) as tell:
        step = asking(stop, tell)
        design = best_design(asked.case, arguments.structure, progress=step)
    folder.write("design.yaml", design_text(design))
    if not design.parameters and not asked.every:
        raise SynthesisError(f"no design for the feedback: {design.status}")
    return replace(asked, design=design)


def _fed_back(asked: SimulationRequest) -> bool:
    """Return whether a controller is a design."""
    return any(name.startswith("feedback") for name in asked.controllers)


def _simulate(
    asked: SimulationRequest,
    found: _Simulated,
    folder: OutputFolder,
    traces: TraceFormat,
    tick: Callable[..., None],
) -> None:
    """Run every controller with every seed, and keep each run as soon as it is there."""
    before = 0.0
    for name in asked.controllers:
        tick(f"preparing {name}", before)
        try:
            series = _prepared(asked, name, partial(tick, f"tuning {name}, {{:.0%}}", before, 0.0))
        except StillhookError as error:
            tick(name, before)  # the compiler may have been interrupted too
            if not asked.every:
                raise
            found.left_out[name] = error
            continue
        for seed in asked.seeds:
            what = f"{name}, seed {seed}"
            tick(what, before)
            one = series.run(seed, partial(tick, what, before, asked.duration))
            write_traces(folder, one, traces, several=len(asked.controllers) > 1)
            found.compared[name] = series.runs(keep_worst([*found.compared.get(name, ()), one]))
            before += asked.duration
        tick(f"{name}, snap load", before)
        found.compared[name] = series.runs(series.with_finer_snap(found.compared[name].runs))


def _prepared(asked: SimulationRequest, name: str, tune: Callable[[float], None]) -> Series:
    if "mpc" in name:  # whose weights take seconds: tuned here, where it can be told, and kept
        from mpc.winch import tune_weights

        case = asked.scenario.case_for(asked.case)
        tune_weights(case, sample_time=asked.sample_time or 0.05, progress=tune)
    controller = controller_of(
        name,
        asked.scenario.case_for(asked.case),
        design=asked.design if name.startswith("feedback") else None,
        sample_time=asked.sample_time,
    )
    return Series.prepare(asked.case, controller, asked.scenario, asked.how)


def _question(asked: SimulationRequest, arguments: argparse.Namespace) -> dict[str, object]:
    """Return what was asked, as plain data."""
    hook, design = asked.how.hook, asked.design
    return {
        "controllers": list(asked.controllers),
        "scenario": asked.scenario.name,
        "options": list(arguments.option),
        "hook": "the case's own sea" if hook is None else hook.description,
        "seeds": list(asked.seeds),
        "structure": None if design is None else design.structure,
        "gains": None if design is None else dict(design.parameters),
        "command": _again(arguments, case_words(arguments)),
    }


def _show(
    asked: SimulationRequest, found: _Simulated, folder: OutputFolder, arguments: argparse.Namespace
) -> None:
    out = console()
    report = runs_report([*found.compared.values()])
    if _fed_back(asked):
        report = with_design(report, asked.design, asked.case, arguments)
    left = [
        f"left out: {error if name in str(error) else f'{name}: {error}'}"
        for name, error in found.left_out.items()
    ]
    show(replace(report, sections=[*report.sections, ReportSection("", left)]), out)
    out.print()
    out.print(_written(folder), soft_wrap=True)
    commands(_next(asked, folder, arguments), out)


def _written(folder: OutputFolder) -> str:
    """Return what was written where, and how much it is."""
    traces = [path for path in folder.written if path.parent.name == "runs"]
    suffixes = {path.suffix for path in folder.written}
    text = f"Written to {folder.path}: summary.md, summary.json, events.csv"
    text += ", design.yaml" * any(path.name == "design.yaml" for path in folder.written)
    text += ", figures" * (".svg" in suffixes)
    if traces:
        size = sum(path.stat().st_size for path in traces) / _MEGABYTE
        text += f", {count(len(traces), 'time trace')} of {size:.1f} MB"
    return text


def _next(
    asked: SimulationRequest, folder: OutputFolder, arguments: argparse.Namespace
) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    words = case_words(arguments, folder)
    own: dict[str, object] = {}
    if asked.design is not None and not names_design(asked.case, arguments):
        own = {"design": folder.path / "design.yaml", "structure": None}
    rows = []
    if len(asked.controllers) == 1:
        rows.append(
            ("every controller in the same sea", _again(arguments, words, controller="all", **own))
        )
    if len(asked.seeds) < 10 and not asked.duration > 1e5:
        rows.append(("ten seas", _again(arguments, words, seeds=10, **own)))
    rows.append(("other operations and controllers", "stillhook scenarios"))
    return rows


def _again(arguments: argparse.Namespace, case: str, **changes: object) -> str:
    """Return the command that does the same again, with changes."""
    fresh: dict[str, object] = {"set": [], "out": None, "traces": "none"}
    words = changed_words(arguments, ARGUMENTS, **(fresh | changes))
    return " ".join(["stillhook simulate", case, *map(shlex.quote, words)])


def _kept(folder: OutputFolder) -> str:
    return f"kept in {folder.path}: {', '.join(kept_in(folder.path)) or 'nothing'}"
