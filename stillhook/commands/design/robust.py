"""`stillhook robust`: gains for many plants and seas, or gains over the rope's length."""

from __future__ import annotations

import argparse
import shlex
from typing import TYPE_CHECKING

from models.basics import InputError

from ...text import OutputFolder, csv_text
from ..declare import CASE, options
from ..given import case_words, gains_text, given_case
from ..lists import parse_range
from ..vary import parse_seas, parse_vary
from ..working import conclude, prepared, working

if TYPE_CHECKING:
    from models import Case
    from synth.robust import RobustDesign

ARGUMENTS = (
    CASE,
    options(
        """
        --vary PATH=LOW..HIGH ...  what varies, as in rope.length=500..1500, payload.mass=40t,50t or
            'PATH=a|b' for values with nothing between
        --seas H_S/T_P[:SHARE],..  the sea states
        --scatter FILE  a table of sea states: significant_height, peak_period, occurrence (.csv)
        --objective {worst,mean,regret} [worst]  what is made small (default: the worst payload
            motion)
        --structure NAME [payload-feedback]  controller structure (default: payload-feedback)
        --schedule LOW..HIGH  gains over the rope's length [m] instead of one set
        --starts N [8]  starts of the search
        --seed N [0]  seed of the starts
        --draws N [10000]  random plants to check with
        --out DIR  folder for the results (default: out/<case>-robust)
        """,
        schedule=parse_range,
    ),
)
EXAMPLES = (
    (
        "stillhook robust thesis-1975 --vary payload.mass=30t..40t --starts 2",
        "one set of gains for every load from 30 to 40 t",
    ),
)


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
    folder = prepared(arguments, case.name, "-robust")
    folder.write("case.yaml", case.to_yaml())
    if arguments.schedule is not None:
        return _scheduled(case, arguments, folder)
    from synth.robust import Family, optimise_robust

    from ...designs import robust_report, scenario_table

    with working(arguments) as step:
        design = optimise_robust(
            case,
            Family.of(case, vary, seas),
            arguments.objective,
            structure=arguments.structure,
            starts=arguments.starts,
            seed=arguments.seed,
            draws=arguments.draws,
            progress=step,
        )
    report = robust_report(design)
    if design.scenarios:
        folder.write("scenarios.csv", csv_text(scenario_table(design)))
        folder.draw(report.drawings)
    return conclude(report, arguments, folder, _next(design, arguments, folder))


def _scheduled(case: Case, arguments: argparse.Namespace, folder: OutputFolder) -> int:
    from synth.robust import schedule_gains

    from ...designs import schedule_report

    with working(arguments) as step:
        schedule = schedule_gains(case, arguments.schedule, seed=arguments.seed, progress=step)
    report = schedule_report(schedule)
    folder.write("schedule.yaml", schedule.to_yaml())
    folder.write("schedule.csv", schedule.to_csv(101))
    folder.draw(report.drawings)
    words = case_words(arguments, folder)
    length = float(schedule.lengths[0])
    at = f"stillhook evaluate {words} --set rope.length={length:g}"
    again = ("the schedule at its shortest rope", f"{at} --gains {gains_text(schedule.at(length))}")
    return conclude(report, arguments, folder, [again])


def _next(
    design: RobustDesign, arguments: argparse.Namespace, folder: OutputFolder
) -> list[tuple[str, str]]:
    words = case_words(arguments, folder)
    rows = []
    if design.scenarios and design.worst.design.gains:
        worst = design.family.case_at(design.worst.member)
        path = folder.write("worst.yaml", worst.to_yaml())
        gains = gains_text(design.parameters)
        evaluate = f"stillhook evaluate {shlex.quote(str(path))} --gains {gains}"
        rows.append(("these gains where the payload moves most", evaluate))
    lengths = (a for a in design.family.axes if a.path == "rope.length" and a.continuous)
    if (axis := next(lengths, None)) is not None:
        span = f"{axis.low:g}..{axis.high:g}"
        rows.append(
            ("gains that follow the rope instead", f"stillhook robust {words} --schedule {span}")
        )
    rows.append(("what stillness costs in torque", f"stillhook pareto {words} --against torque"))
    return rows
