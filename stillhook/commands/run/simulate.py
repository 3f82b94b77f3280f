"""`stillhook simulate`: a controller, or several, on the nonlinear plant over some seeds.

Exit status 0 if every run went to its end, 1 if one diverged, 130 after Ctrl-C; what was simulated
until then is written all the same.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from models.basics import StillhookError, SynthesisError
from models.run import Run

from ...controllers import controller_of
from ...runs import RunFolder, Runs, Series, headline_of, keep_worst, runs_data, runs_report, tree
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
)
from ..declare import (
    CASE,
    changed_words,
    choice,
    group,
    one_of,
    real,
    repeated,
    results_folder,
    switch,
    text,
    whole,
)
from ..given import case_words
from ..lists import numbers
from ..working import Stop, kept_in, place_for, prepared, stoppable, tidy
from .simulate_given import SimulationRequest, asked_of

if TYPE_CHECKING:
    from rich.console import Console

_MEGABYTE = 1e6
_MANY = 10_000  # seeds: more than anybody wants on purpose
_Ticker = Callable[[str, float], None]  # takes what is being done, and how much is done [s]


@dataclass(kw_only=True)
class _Simulated:
    """What came of it: runs by controller, those left out and why."""

    compared: list[Runs] = field(default_factory=list)
    left_out: dict[str, StillhookError] = field(default_factory=dict)


ARGUMENTS = (
    CASE,
    group(
        "what is simulated",
        text(
            "--controller",
            "NAME",
            "a controller, several with commas between, or all, which leaves out the predictive "
            "ones (default: feedback; see `stillhook scenarios`)",
            "feedback",
        ),
        text("--scenario", "NAME", "an operation (default: hold)", "hold"),
        repeated(
            "--option", "KEY=VALUE", "an option of the operation, as in 'height=6 m'", "options"
        ),
        whole("--seeds", "how many seas", 1, low=1, high=_MANY),
        whole("--first-seed", "seed of the first", 0, low=0),
        one_of(
            real("--hours", "H", "length of a run in hours", low=0.0, high=1e4, open_low=True),
            text(
                "--duration",
                "TIME",
                "length of a run, as in '20 min' (default: the operation's own)",
            ),
        ),
        one_of(
            text(
                "--hook",
                "FILE",
                "the hook's motion from a CSV file with the columns time and displacement",
            ),
            text("--sine", "AMPLITUDE,PERIOD", "a sine instead, as in '0.5 m, 8 s'"),
        ),
        text(
            "--tip",
            "X,Y,Z",
            "--hook holds heave, roll and pitch of the vessel; the crane's tip is so far "
            "forward, to port and up [m]",
            read=numbers(3),
        ),
    ),
    group(
        "the feedback's gains (default: those of the case)",
        one_of(
            text("--design", "FILE", "a design that was written, as in out/CASE/design.yaml"),
            text("--gains", "A=..,a=..,a1=..,a2=..", "the gains"),
        ),
    ),
    group(
        "how",
        text("--sample-time", "TIME", "of the controller, as in '20 ms'"),
        text("--step", "TIME", "integration step (default: the longest)"),
        whole("--masses", "masses along the rope (default: the case's)"),
        text("--settle", "TIME", "when statistics begin (default: after some waves)"),
        text(
            "--lock-limit",
            "LENGTH",
            "error of the payload that counts as lost lock (default: the hook's significant "
            "height)",
        ),
        switch(
            "--no-compile",
            "do not compile the loop to C: slower, and needs no compiler",
            "compiled",
        ),
    ),
    group(
        "results",
        results_folder("out/<case>-<scenario>"),
        choice(
            "--traces",
            ("csv", "parquet", "netcdf", "none"),
            "format of the time traces (default: csv)",
            "csv",
        ),
        text(
            "--store-step",
            "TIME",
            "time between two rows of them (default: so that there are at most 40 000)",
        ),
        switch("--animate", "make a moving picture (GIF) of the worst run"),
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Simulate, show and save; return the exit status."""
    asked = asked_of(arguments)
    place = place_for(arguments, asked.case.name, f"-{asked.scenario.name}")
    several = len(asked.controllers) > 1
    with tidy(place), stoppable() as stop:
        folder = prepared(arguments, place)
        target = RunFolder(folder=folder, format=arguments.traces, several=several)
        try:
            asked = _with_gains(asked, folder, stop, shown=not arguments.quiet)
            total = len(asked.controllers) * len(asked.seeds) * asked.duration
            with progress(
                shown=not arguments.quiet, pace=lambda speed: f"{number(speed, 2)} x real time"
            ) as tell:

                def tick(what: str, done: float) -> None:
                    tell(what, done, total)

                found = _simulated(asked, target, stop, tick)
                if found.compared:
                    _finish(target, asked, found.compared, arguments, tick, total)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(folder)) from None
        stopped = stop()
    out = console()
    if not found.compared:
        if not stopped:
            raise next(iter(found.left_out.values()))
        raise KeyboardInterrupt(f"nothing was simulated; {_kept(folder)}")
    if arguments.json:
        sys.stdout.write(json_text(runs_data(found.compared)))
    elif arguments.quiet:
        for runs in found.compared:
            out.print(f"{headline_of(runs)}; {tree(runs)[0]}", soft_wrap=True)
    else:
        _show(asked, found, target, arguments, out)
    if stopped:
        done = sum(run.completed for runs in found.compared for run in runs)
        wanted = len(asked.controllers) * len(asked.seeds)
        raise KeyboardInterrupt(
            f"{done} of {count(wanted, 'run')} went to the end; all there is was written to "
            f"{folder.path}"
        )
    return 0 if all(runs.completed for runs in found.compared) else 1


def _with_gains(
    asked: SimulationRequest, folder: OutputFolder, stop: Stop, *, shown: bool
) -> SimulationRequest:
    """Return what is asked with gains for the feedback, optimised if there are none."""
    wanted = any(name.startswith("feedback") for name in asked.controllers)
    if not wanted or asked.design or asked.gains or asked.case.gains is not None:
        return asked
    from synth import optimise_gains

    from ...designs import design_text

    with progress(shown=shown) as tell:

        def step(stage: str, done: int, total: int) -> None:
            if stop():
                raise KeyboardInterrupt
            tell(stage, done, total)

        design = optimise_gains(asked.case, "payload-feedback", progress=step)
    folder.write("design.yaml", design_text(design))
    if design.margins is None and not asked.every:
        raise SynthesisError(f"no gains for the feedback: {design.status}")
    return replace(asked, design=design)


def _simulated(
    asked: SimulationRequest, target: RunFolder, stop: Stop, tick: _Ticker
) -> _Simulated:
    """Run every controller with every seed, until all are done or the user asks to stop."""
    found = _Simulated()
    before = 0.0
    for name in asked.controllers:
        if stop():
            break
        tick(f"preparing {name}", before)

        def tune(share: float, what: str = f"tuning {name}", at: float = before) -> None:
            tick(f"{what}, {100.0 * share:.0f} %", at)
            if stop():
                raise KeyboardInterrupt

        try:
            series = _prepared(asked, name, tune)
        except KeyboardInterrupt:
            if stop():
                break  # what was simulated before is shown
            raise
        except StillhookError as error:
            if stop():
                break  # the compiler was interrupted too
            if not asked.every:
                raise
            found.left_out[name] = error
            series = None
        runs: list[Run] = []
        for seed in asked.seeds if series is not None else ():
            if series is None or stop():
                break

            def tell(share: float, what: str = f"{name}, seed {seed}", at: float = before) -> None:
                tick(what, at + share * asked.duration)
                if stop():
                    raise KeyboardInterrupt  # which ends the run, and is told by its status

            one = series.run(seed, tell)
            target.add(one)
            runs = keep_worst([*runs, one])
            before += asked.duration
        if series is not None and runs:
            found.compared.append(series.runs(runs))
    return found


def _prepared(asked: SimulationRequest, name: str, tune: Callable[[float], None]) -> Series:
    feedback = name.startswith("feedback")
    if "mpc" in name:  # whose weights take seconds: tuned here, where it can be told, and kept
        from mpc.winch import tune_weights

        case = asked.scenario.case_for(asked.case)
        tune_weights(case, sample_time=asked.sample_time or 0.05, progress=tune)
    controller = controller_of(
        name,
        asked.scenario.case_for(asked.case),
        design=asked.design if feedback else None,
        gains=asked.gains if feedback else None,
        sample_time=asked.sample_time,
    )
    return Series.prepare(asked.case, controller, asked.scenario, asked.how)


def _finish(
    target: RunFolder,
    asked: SimulationRequest,
    compared: Sequence[Runs],
    arguments: argparse.Namespace,
    tick: _Ticker,
    total: float,
) -> None:
    hook = "the case's own sea" if asked.how.hook is None else asked.how.hook.description
    design = asked.design
    question = {
        "controllers": list(asked.controllers),
        "scenario": asked.scenario.name,
        "options": list(arguments.options),
        "hook": hook,
        "seeds": list(asked.seeds),
        "gains": dict(design.parameters) if design is not None else asked.gains,
        "command": _again(arguments, case_words(arguments)),
    }
    target.finish(
        compared,
        case=asked.case,
        question=question,
        figures=arguments.figures,
        animate=arguments.animate,
        progress=lambda what, share: tick(what, share * total),
    )


def _show(
    asked: SimulationRequest,
    found: _Simulated,
    target: RunFolder,
    arguments: argparse.Namespace,
    out: Console,
) -> None:
    design = asked.design
    if design is not None and arguments.design is None:
        mark = "ok" if design.ok else "NOT OK"
        out.print(f"The case has no gains in use, so they were optimised: {mark}: {design.status}")
        out.print()
    report = runs_report(found.compared)
    left = [
        f"left out: {error if name in str(error) else f'{name}: {error}'}"
        for name, error in found.left_out.items()
    ]
    show(replace(report, sections=[*report.sections, ReportSection("", left)]), out)
    out.print()
    out.print(_written(target), soft_wrap=True)
    commands(_next(asked, found, target, arguments), out)


def _written(target: RunFolder) -> str:
    """Return what was written where, and how much it is."""
    traces = [path for path in target.written if path.parent.name == "runs"]
    text = f"Written to {target.folder.path}: summary.md, summary.json, events.csv"
    if any(path.suffix == ".svg" for path in target.written):
        text += ", figures"
    if any(path.suffix == ".gif" for path in target.written):
        text += ", animation.gif"
    if traces:
        size = sum(path.stat().st_size for path in traces) / _MEGABYTE
        text += f", {count(len(traces), 'time trace')} of {size:.1f} MB"
    return text


def _next(
    asked: SimulationRequest, found: _Simulated, target: RunFolder, arguments: argparse.Namespace
) -> list[tuple[str, str]]:
    """Return commands to go on with, each with what it does."""
    words = case_words(arguments, target.folder)
    own: dict[str, object] = {}
    if asked.design is not None and arguments.design is None:
        own["design"] = target.folder.path / "design.yaml"
    rows = []
    if len(asked.controllers) == 1:
        rows.append(
            ("every controller in the same sea", _again(arguments, words, controller="all", **own))
        )
    if len(asked.seeds) < 10 and not found.compared[0][0].duration > 1e5:
        rows.append(("ten seas", _again(arguments, words, seeds=10, **own)))
    if not arguments.animate:
        rows.append(("a moving picture", _again(arguments, words, animate=True, **own)))
    rows.append(("other operations and controllers", "stillhook scenarios"))
    return rows


def _again(arguments: argparse.Namespace, case: str, **changes: object) -> str:
    """Return the command that does the same again, with changes."""
    fresh: dict[str, object] = {"changes": [], "out": None, "traces": "csv", "animate": False}
    words = changed_words(arguments, ARGUMENTS, **(fresh | changes))
    return " ".join(["stillhook simulate", case, *map(shlex.quote, words)])


def _kept(folder: OutputFolder) -> str:
    return f"kept in {folder.path}: {', '.join(kept_in(folder.path)) or 'nothing'}"
