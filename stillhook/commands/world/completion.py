"""`stillhook completion`: the completion of the command line for bash, zsh or fish."""

import argparse

from ..declare import Declaration

_SHELLS = ("bash", "zsh", "fish")


def _shell(parser: argparse._ActionsContainer) -> None:
    parser.add_argument("shell", choices=_SHELLS, help="the shell")


ARGUMENTS: tuple[Declaration, ...] = (_shell,)
EXAMPLES = (
    ("stillhook completion bash", "the script, for `eval` in ~/.bashrc"),
    ("stillhook completion zsh", "for a file _stillhook in a folder of zsh's fpath"),
    ("stillhook completion fish", "for ~/.config/fish/completions/stillhook.fish"),
)


def run(arguments: argparse.Namespace) -> int:
    """Write the script on standard output; return 0."""
    from models import bundled_cases
    from models.operation import scenario_names
    from models.vessel.readers import bundled_vessels
    from synth.structures import structure_names

    from ...controllers import CONTROLLER_TEXTS
    from ...text import write_json
    from ..shells import bash_script, completions, fish_script, zsh_script

    cases = [name for name, _ in bundled_cases()]
    known = {
        "case": cases,
        "sea file": cases,
        "vessel import file": [name for name, _ in bundled_vessels()],
        "scenario": [*scenario_names()],
        "scenarios name": [*scenario_names()],
        "controller": [*CONTROLLER_TEXTS],
        "structure": structure_names(),
    }
    write = {"bash": bash_script, "zsh": zsh_script, "fish": fish_script}[arguments.shell]
    write_json(write(completions(arguments.parser(), known)))
    return 0
