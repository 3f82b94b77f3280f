"""`stillhook scenarios`: the operations and the controllers that can be simulated."""

import argparse
import math

from models.basics import KINDS
from models.operation import Option, WordOption, scenario_names, scenario_options

from ...controllers import CONTROLLER_TEXTS
from ...text import Report, ReportSection, pairs, quantity
from ..declare import options
from ..working import conclude

ARGUMENTS = (options("[name]  an operation, to see its options"),)
EXAMPLES = (
    ("stillhook scenarios", "what can be simulated, and who can control it"),
    ("stillhook scenarios landing", "the options of one operation"),
)


def run(arguments: argparse.Namespace) -> int:
    """List scenarios and controllers, or the options of one scenario; return 0."""
    name = arguments.name
    if name is not None:
        options = scenario_options(name)  # an unknown name ends here
        told = pairs([(key, _text(option)) for key, option in options.items()])
        report = Report(
            name=name, about=scenario_names()[name], sections=[ReportSection("", [told])]
        )
        key, option = next(iter(options.items()))
        command = f"stillhook simulate CASE --scenario {name} --option '{key}={_example(option)}'"
        return conclude(report, arguments, following=[("with an option", command)])
    sections = [
        ReportSection("Scenarios (--scenario)", [pairs(list(scenario_names().items()))]),
        ReportSection("Controllers (--controller)", [pairs(list(CONTROLLER_TEXTS.items()))]),
    ]
    following = [
        ("the options of one scenario", "stillhook scenarios landing"),
        ("its simulation", "stillhook simulate landing --scenario landing"),
    ]
    report = Report(name="operations and controllers", sections=sections)
    return conclude(report, arguments, following=following)


def _text(option: Option | WordOption) -> str:
    if isinstance(option, WordOption):
        return f"{option.text}: {', '.join(option.words)}"
    return f"{option.text} ({_default(option)})"


def _default(option: Option) -> str:
    if callable(option.default):
        return "follows from the case"
    if option.default == math.inf:
        return "never"
    unit = KINDS[option.quantity.kind].unit
    return quantity(option.default, unit) if unit else f"{option.default:g}"


def _example(option: Option | WordOption) -> str:
    if isinstance(option, WordOption):
        return option.words[-1]
    unit = KINDS[option.quantity.kind].unit
    value = 2.0 if callable(option.default) else 2.0 * option.default or 10.0
    return quantity(value, unit) if unit else f"{value:g}"
