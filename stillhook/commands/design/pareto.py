"""`stillhook pareto`: how still the payload can be held against what it costs."""

import argparse

from ..declare import CASE, options
from ..given import case_words, gains_text, given_case
from ..lists import parse_range
from ..working import conclude, prepared, working

ARGUMENTS = (
    CASE,
    options(
        """
        --against {torque,speed,max_sensitivity,delay_margin,delay} [torque]  the other quantity
            (default: torque); delay is that of the telemetry
        --points N [30]  points of the front
        --between LOW..HIGH  ends of the front in SI units (default: found)
        --seed N [0]  seed of the searches
        --out DIR  folder for the results (default: out/<case>-pareto)
        """,
        between=parse_range,
    ),
)
EXAMPLES = (
    ("stillhook pareto thesis-1975 --points 4", "what less motion costs in torque, at four points"),
)


def run(arguments: argparse.Namespace) -> int:
    """Compute, show and save a front; return 0 if it holds, 1 if not."""
    from synth.sizing import pareto_front

    from ...designs import pareto_report

    case = given_case(arguments)
    folder = prepared(arguments, case.name, "-pareto")
    folder.write("case.yaml", case.to_yaml())
    with working(arguments) as step:
        front = pareto_front(
            case,
            arguments.against,
            points=arguments.points,
            between=arguments.between,
            seed=arguments.seed,
            progress=step,
        )
    report = pareto_report(front)
    if report.sections:
        folder.write("pareto.csv", front.to_csv())
    folder.draw(report.drawings)
    following = []
    if front.points:
        words = case_words(arguments, folder)
        gains = gains_text({"A": front.amplifier, **front.knee.parameters})
        delayed = f" --set sensors.telemetry.delay={front.knee.bound:.6g}"
        late = delayed if front.against == "delay" else ""
        others = {"torque": "max_sensitivity", "max_sensitivity": "delay"}
        other = others.get(front.against, "torque")
        following = [
            ("the design at the knee", f"stillhook evaluate {words}{late} --gains {gains}"),
            (f"against {other}", f"stillhook pareto {words} --against {other}"),
        ]
    return conclude(report, arguments, folder, following)
