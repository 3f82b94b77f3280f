"""Declarations of what a command takes, beside the function that does it.

    ARGUMENTS = (CASE, options("--points N [9]  gears on the curve"), OUT)  --> `declared`

Each command's module has such a tuple and a function ``run(arguments)``; `stillhook.cli` reads the
tuple of the command that was asked for, and no other.
"""

import argparse
import re
from collections.abc import Callable, Mapping
from textwrap import dedent
from typing import Any

from models.basics import check_range

_NUMBER = re.compile(r"\d+(\.\d*)?")

Declaration = Callable[[argparse._ActionsContainer], None]
"""Adds one argument, or a group of them, to a parser."""

Read = Callable[[str, Any], object]
"""Returns what an option means from its name, for messages, and what was given."""


class _Reading(argparse.Action):
    """Reads what an option is given as it comes; `InputError` passes the parser by."""

    def __init__(self, *args: Any, read: Read, **settings: Any) -> None:
        """Take what reads the value."""
        super().__init__(*args, **settings)
        self._read = read

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Keep what the value means under the option's name, and the value in ``given``."""
        owner = parser.prog.rpartition(" ")[2]
        setattr(namespace, self.dest, self._read(f"{owner}: {self.option_strings[0]}", values))
        namespace.given = {**getattr(namespace, "given", {}), self.dest: values}


def within(**limits: Any) -> Read:
    """Return what refuses a number that is not within limits as for `check_range`."""

    def read(option: str, value: float) -> float:
        owner, _, name = option.rpartition(": ")
        found = check_range(owner, name, value, **limits)
        return value if isinstance(value, int) else found

    return read


# Of options that several commands have.
_USUAL: dict[str, Read] = {"seed": within(low=0), "starts": within(low=1, high=4096)}


def options(text: str, **means: Read) -> Declaration:
    """Declare options as their help shows them, one below the other.

        --name METAVAR [default]  what it is, in words that may go on in lines
            that are indented
        | --other METAVAR  one that goes without the one before
        --name N [16]  a whole number; a number that is a default is told
        --name {a,b} [a]  one of some words
        --name PATH=VALUE ...  one that may come several times
        --name  one without a value, that makes `name` true; --no-name makes it false
        name  one without a dash; [name] may be left out
        a title:
        --name  what follows a title stands under it

    Beside the text `means` has, by an option's name, what reads it; a number without a default is
    `within()` no limits.
    """
    lines: list[str] = []
    for line in dedent(text).strip().splitlines():
        if line.startswith(" "):
            lines[-1] += f" {line.strip()}"
        elif line:
            lines.append(line)

    def add(parser: argparse._ActionsContainer) -> None:
        group = parser
        for line, after in zip(lines, [*lines[1:], ""], strict=True):
            if "  " not in line:
                group = parser.add_argument_group(line.removesuffix(":"))
                continue
            if not line.startswith("| "):
                place = group.add_mutually_exclusive_group() if after[:2] == "| " else group
            _option(place, line.removeprefix("| "), _USUAL | means)

    return add


def _option(parser: argparse._ActionsContainer, line: str, means: Mapping[str, Read]) -> None:
    """Add the argument of a line to a parser."""
    spec, _, told = (part.strip() for part in line.partition("  "))
    name, _, shape = spec.partition(" ")
    metavar, _, default = shape.removesuffix("]").partition(" [")
    dest = name.removeprefix("--").replace("-", "_")
    settings: dict[str, Any] = {"default": default or None}
    if not name.startswith("--"):
        settings = {"metavar": name.strip("[]").upper(), "nargs": "?" if "[" in name else None}
    elif not shape:
        off = name.startswith("--no-")
        settings = {"action": "store_false" if off else "store_true"}
        settings["dest"] = dest.removeprefix("no_") if off else dest
    elif metavar.startswith("{"):
        settings["choices"] = metavar.strip("{}").split(",")
    elif metavar.endswith(" ..."):
        told += "; may be repeated"
        settings = {"metavar": metavar[:-4], "action": "append", "default": []}
    else:
        settings["metavar"], read = metavar, means.get(dest)
        if metavar == "N" or _NUMBER.fullmatch(default):
            number = settings["type"] = int if metavar == "N" else float
            if default:
                settings["default"] = number(default)
                told += f" (default: {number(default):.6g})"
        elif read is not None and default:
            settings["default"] = read(name, default)
        if read is not None:
            settings |= {"action": _Reading, "read": read}
    parser.add_argument(name.strip("[]"), help=told, **settings)


def declared(parser: argparse._ActionsContainer, arguments: tuple[Declaration, ...]) -> None:
    """Add what is declared to a parser."""
    for add in arguments:
        add(parser)


def changed_words(
    arguments: argparse.Namespace, declarations: tuple[Declaration, ...], **changes: object
) -> list[str]:
    """Return the options that are not at their defaults, as words of the same command again.

    Values of `changes`, by name, take the place of those given; a default leaves an option out.
    """
    parser = argparse.ArgumentParser(add_help=False)
    declared(parser, declarations)
    words, known = [], vars(arguments) | getattr(arguments, "given", {}) | changes
    for action in parser._actions:
        value = known[action.dest]
        if action.option_strings and value not in (None, action.default):
            for one in value if isinstance(value, list) else [value]:
                words.append(action.option_strings[0])
                if action.nargs != 0:
                    words.append(f"{one:g}" if isinstance(one, float) else str(one))
    return words


_CASE = "a bundled case (see `stillhook cases`) or a case file (.yaml, .json, .toml)"
_SET = """
--set PATH=VALUE ...  change a field of the case, as in --set limits.max_sensitivity=2.5
    or --set 'sensors.telemetry.delay=50 ms'
"""
CASE = options(f"case  {_CASE}{_SET}")
#: None where something else names it.
OPTIONAL_CASE = options(f"[case]  {_CASE}{_SET}")

#: The design: a file, gains, or the best one of the case; `commands.given_design` reads it.
DESIGN = options(
    """
    --design FILE  a design that was written, as in out/CASE/design.yaml
    --gains A=..,a=..,a1=..,a2=..  or gains, or parameters by name (default: the gains that the
        case has in use; else the best design is found, a minute or so once)
    --structure NAME  whose parameters these are (default: payload-feedback); without --gains its
        best ones are found
    """
)
#: How still the payload must be; `REQUIRED` are its names.
STILLNESS = options(
    """
    how still the payload must be:
    --payload-rms LENGTH  standard deviation of its motion, as in '50 mm'
    --payload-significant LENGTH  significant double amplitude, 4 sigma
    --payload-max LENGTH  most probable maximum amplitude in the case's exposure time
    --payload-speed SPEED  most probable maximum of its speed, as in '0.5 m/s'
    --daf RATIO  largest dynamic amplification factor at the load's end of the rope, as in 1.3
    --snap SHARE  largest share of the load's weight that the dynamic tension there may take up
        before the rope is slack and snaps taut, as in 0.9
    """,
    daf=within(low=1.0, high=10.0, open_low=True),
)
REQUIRED = (
    "payload_rms", "payload_significant", "payload_max", "payload_speed", "daf", "snap"
)  # fmt: skip
NO_BOUND = options(
    """
    --no-bound  do not compare with the best that any linear controller could do (2 s each, 15 s
        of one alone)
    """
)

#: What every command takes, wherever it stands.
EVERYWHERE = options(
    """
    output:
    --quiet  print the verdict only
    --json  print what came of it as JSON, and nothing else
    --no-figures  draw no figures
    --format {svg,png}  format of the figures (default: both)
    --force  write into a folder that holds other people's files, or over a file that exists
    """
)
