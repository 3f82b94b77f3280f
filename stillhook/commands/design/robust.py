"""`stillhook robust`: gains for many plants and seas, or gains over the rope's length."""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError

from ...text import (
    OutputFolder,
    Progress,
    commands,
    console,
    folder_name,
    number,
    percent,
    progress,
    quantity,
)
from ..given import case_words, gains_text, given_case
from .optimise import interruptible
from .vary import parse_range, parse_seas, parse_vary

if TYPE_CHECKING:
    from models import Case
    from synth.robust import GainSchedule, RobustDesign, ScenarioResult

_ROWS = 12  # scenarios on the terminal


def run(arguments: argparse.Namespace) -> int:
    """Design, show and save; return 0 if the design is ok, 1 if not."""
    case = given_case(arguments)
    vary, seas = parse_vary(arguments.vary), parse_seas(arguments.seas, arguments.scatter)
    if arguments.schedule is not None and (vary or seas is not None):
        raise InputError("--schedule: varies the rope's length alone; leave out --vary and --seas")
    if arguments.schedule is None and not vary and seas is None:
        raise InputError(
            "robust: nothing varies; give --vary (as in --vary rope.length=500..1500), --seas, "
            "--scatter or --schedule"
        )
    folder = OutputFolder.prepare(arguments.out or Path("out") / f"{folder_name(case.name)}-robust")
    folder.write("case.yaml", case.to_yaml())
    with progress(shown=not arguments.quiet) as tell, interruptible() as check:

        def step(stage: str, done: int, total: int) -> None:
            check()
            tell(stage, done, total)

        if arguments.schedule is not None:
            return _scheduled(case, arguments, folder, step)
        from synth.robust import Family, optimise_robust

        design = optimise_robust(
            case,
            Family.of(case, vary, seas),
            arguments.objective,
            structure=arguments.family_structure,
            starts=arguments.starts,
            seed=arguments.seed,
            draws=arguments.draws,
            progress=step,
        )
    return _told(design, arguments, folder)


def _told(design: RobustDesign, arguments: argparse.Namespace, folder: OutputFolder) -> int:
    from ...text import picture

    written = []
    if design.scenarios:
        from ...designs import robust_figure

        folder.write("scenarios.csv", scenarios_csv(design))
        figure = robust_figure(design)
        for kind in ("svg", "png"):
            folder.write(f"robust.{kind}", picture(figure, kind))
        written = ["scenarios.csv", "robust.svg", "robust.png"]
    out = console()
    if arguments.quiet:
        out.print(f"{design.case.name}: {design.status}", soft_wrap=True)
        return 0 if design.ok else 1
    out.print(f"{design.case.name}: one set of gains", style="bold")
    out.print(f"{'ok' if design.ok else 'NOT OK'}: {design.status}", soft_wrap=True)
    out.print()
    for name, value in design.parameters.items():
        out.print(f"  {name} = {number(value, 6)}")
    if design.scenarios:
        _show(design)
    if design.check is not None:
        out.print()
        out.print(f"  {design.check}", soft_wrap=True)
        quantiles = [
            f"{100 * q:g} %: {quantity(v, 'm')}" for q, v in design.check.quantiles.items()
        ]
        out.print(f"  their payload rms: {', '.join(quantiles)}", soft_wrap=True)
    if design.added:
        out.print(f"  the search for the worst member added {design.added} of the scenarios")
    out.print()
    if written:
        out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    commands(_next(design, arguments, folder), out)
    return 0 if design.ok else 1


def _show(design: RobustDesign) -> None:
    from ...text.terminal import _put, _table

    out = console()
    out.print()
    headings = ("", "payload", "held", "M_s", "delay", "disk", "gains off", "use")
    table = _table(*headings, "of", left=(8,))
    for k, s in enumerate(design.scenarios[:_ROWS]):
        tightest = s.tightest
        table.add_row(
            str(k + 1),
            quantity(s.payload_rms, "m"),
            quantity(s.payload_rms_before, "m"),
            number(s.max_sensitivity),
            quantity(s.delay, "s") if math.isfinite(s.delay) else "any",
            number(s.disk),
            "" if s.radius is None else f"{100.0 * s.radius.box:.0f} %",
            "" if tightest is None else percent(tightest.use),
            "" if tightest is None else tightest.name,
        )
    _put(table, out)
    for k, s in enumerate(design.scenarios[:_ROWS]):
        out.print(f"  {k + 1}: {s.name}", soft_wrap=True)
    out.print("  gains off: by how much all may be off at once before a loop is unstable")
    if len(design.scenarios) > _ROWS:
        out.print(f"  and {len(design.scenarios) - _ROWS} more, in scenarios.csv")


def scenarios_csv(design: RobustDesign) -> str:
    """Return all scenarios as CSV, SI units."""
    paths = [axis.path for axis in design.family.axes]
    names = sorted({name for s in design.scenarios for name in s.limits})
    head = [*paths, "significant_height", "peak_period", "weight", "payload_rms"]
    head += ["payload_rms_held", "best_rms", "max_sensitivity", "gain_down", "gain", "phase"]
    head += ["delay_margin", "disk_margin", "gain_radius", "gain_box", "pressure", "verified"]
    lines = [",".join([*head, *(f"use:{name}" for name in names)])]
    lines += [",".join(_cell(v) for v in _row(design, s, names)) for s in design.scenarios]
    return "\n".join(lines) + "\n"


def _row(design: RobustDesign, s: ScenarioResult, names: list[str]) -> list[object]:
    sea = design.family.seas[s.member.sea]
    return [
        *s.member.point,
        sea.significant_height,
        sea.peak_period,
        s.weight,
        s.payload_rms,
        s.payload_rms_before,
        s.best_rms,
        s.max_sensitivity,
        s.gain_down,
        s.gain,
        s.phase,
        s.delay,
        s.disk,
        None if s.radius is None else s.radius.ball,
        None if s.radius is None else s.radius.box,
        s.pressure,
        s.verified,
        *(s.limits[name].use if name in s.limits else None for name in names),
    ]


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.8g}" if isinstance(value, float) else str(value)


def _next(
    design: RobustDesign, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    words = case_words(arguments, str(folder.path / "case.yaml"))
    rows = []
    if design.scenarios and design.structure == "payload-feedback":
        worst = design.family.case_at(design.worst.member)
        path = folder.write("worst.yaml", worst.to_yaml())
        gains = gains_text(design.gains)
        evaluate = f"stillhook evaluate {shlex.quote(str(path))} --gains {gains}"
        rows.append(("these gains where the payload moves most", evaluate))
    if any(axis.path == "rope.length" and axis.continuous for axis in design.family.axes):
        axis = next(a for a in design.family.axes if a.path == "rope.length")
        span = f"{axis.low:g}..{axis.high:g}"
        rows.append(
            ("gains that follow the rope instead", f"stillhook robust {words} --schedule {span}")
        )
    rows.append(("what stillness costs in torque", f"stillhook pareto {words} --against torque"))
    return rows


def _scheduled(
    case: Case, arguments: argparse.Namespace, folder: OutputFolder, step: Progress
) -> int:
    from synth.robust import schedule_gains

    schedule: GainSchedule = schedule_gains(
        case,
        parse_range("--schedule", arguments.schedule),
        seed=arguments.seed,
        progress=step,
    )
    folder.write("schedule.yaml", schedule.to_yaml())
    folder.write("schedule.csv", schedule.to_csv(101))
    written = ["schedule.yaml", "schedule.csv"]
    if schedule.points:
        from ...designs import schedule_figure
        from ...text import picture

        figure = schedule_figure(schedule)
        for kind in ("svg", "png"):
            folder.write(f"schedule.{kind}", picture(figure, kind))
            written.append(f"schedule.{kind}")
    out = console()
    out.print(f"{case.name}: {schedule.status}", soft_wrap=True)
    if arguments.quiet:
        return 0 if schedule.ok else 1
    from ...text.terminal import _put, _table

    out.print()
    table = _table("rope", *schedule.names, left=())
    for length, row in zip(schedule.lengths, schedule.gains, strict=True):
        table.add_row(quantity(float(length), "m", 4), *(number(float(v), 5) for v in row))
    _put(table, out)
    out.print()
    out.print(f"Written to {folder.path}: {', '.join(written)}", soft_wrap=True)
    words = case_words(arguments, str(folder.path / "case.yaml"))
    length = float(schedule.lengths[0])
    at = f"stillhook evaluate {words} --set rope.length={length:g}"
    gains = gains_text(schedule.at(length))
    commands([("the schedule at its shortest rope", f"{at} --gains {gains}")], out)
    return 0 if schedule.ok else 1
