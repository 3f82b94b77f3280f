"""Declarations of what a command takes, beside the function that does it.

    ARGUMENTS = (CASE, OUT, whole("--starts", "starts of the search", 16))  --> `declared`

Each command's module has such a tuple and a function ``run(arguments)``; `stillhook.cli` reads the
tuple of the command that was asked for, and no other.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import Any

from models.basics import check_range

Declaration = Callable[[argparse._ActionsContainer], None]
"""Adds one argument, or a group of them, to a parser."""

Read = Callable[[str, Any], object]
"""Returns what an option means from its name, for messages, and what was given."""


class _Reading(argparse.Action):
    """Reads what an option is given as it comes; `InputError` passes the parser by."""

    read: Read

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Keep what the value means under the option's name, and the value in ``given``."""
        owner = parser.prog.rpartition(" ")[2]
        setattr(namespace, self.dest, self.read(f"{owner}: {self.option_strings[0]}", values))
        namespace.given = {**getattr(namespace, "given", {}), self.dest: values}


def _argument(*names: str, read: Read | None = None, **settings: Any) -> Declaration:
    def add(parser: argparse._ActionsContainer) -> None:
        if read is None:
            parser.add_argument(*names, **settings)
        else:
            action = parser.add_argument(*names, action=_Reading, **settings)
            assert isinstance(action, _Reading)
            action.read = read

    return add


def _within(number: type[float], limits: Mapping[str, Any]) -> Read | None:
    """Return what refuses a number out of range; None where there is no range."""
    return (lambda option, value: number(checked(option, value, **limits))) if limits else None


def checked(option: str, value: float, **limits: Any) -> float:
    """Return what an option is given if it is within limits as for `check_range`."""
    owner, _, name = option.rpartition(": ")
    return check_range(owner, name, value, **limits)


def positional(name: str, help: str, *, optional: bool = False) -> Declaration:
    """Declare an argument without a dash."""
    return _argument(name, metavar=name.upper(), help=help, nargs="?" if optional else None)


def text(
    flag: str, metavar: str, help: str, default: object = None, read: Read | None = None
) -> Declaration:
    """Declare an option with a text, as a name, a file or a quantity; `read` says what it means."""
    return _argument(flag, metavar=metavar, help=help, default=default, read=read)


def whole(flag: str, help: str, default: int | None = None, **limits: float) -> Declaration:
    """Declare an option with a whole number, within limits as for `check_range`."""
    told = help if default is None else f"{help} (default: {default})"
    read = _within(int, limits)
    return _argument(flag, metavar="N", help=told, type=int, default=default, read=read)


def real(
    flag: str, metavar: str, help: str, default: float | None = None, **limits: Any
) -> Declaration:
    """Declare an option with a number, within limits as for `check_range`."""
    told = help if default is None else f"{help} (default: {default:g})"
    read = _within(float, limits)
    return _argument(flag, metavar=metavar, help=told, type=float, default=default, read=read)


def choice(flag: str, of: tuple[str, ...], help: str, default: str | None = None) -> Declaration:
    """Declare an option with one of some words."""
    return _argument(flag, choices=of, help=help, default=default)


def switch(flag: str, help: str, dest: str | None = None) -> Declaration:
    """Declare an option without a value: ``--no-x`` makes `x` false, any other its name true."""
    off = flag.startswith("--no-")
    name = dest or flag.removeprefix("--no-" if off else "--").replace("-", "_")
    return _argument(flag, action="store_false" if off else "store_true", help=help, dest=name)


def repeated(flag: str, metavar: str, help: str, dest: str | None = None) -> Declaration:
    """Declare an option that may come several times."""
    name = dest or flag.removeprefix("--")
    told = f"{help}; may be repeated"
    return _argument(flag, metavar=metavar, help=told, action="append", default=[], dest=name)


def group(title: str, *inside: Declaration) -> Declaration:
    """Declare options under a title."""

    def add(parser: argparse._ActionsContainer) -> None:
        declared(parser.add_argument_group(title), inside)

    return add


def one_of(*inside: Declaration) -> Declaration:
    """Declare options of which one may be given."""

    def add(parser: argparse._ActionsContainer) -> None:
        declared(parser.add_mutually_exclusive_group(), inside)

    return add


def declared(parser: argparse._ActionsContainer, arguments: tuple[Declaration, ...]) -> None:
    """Add what is declared to a parser."""
    for add in arguments:
        add(parser)


def changed_words(
    arguments: argparse.Namespace, declarations: tuple[Declaration, ...], **changes: object
) -> list[str]:
    """Return the options that are not at their defaults, as words of the same command again.

    Parameters
    ----------
    arguments, declarations
        What was given, and what the command takes.
    changes
        Other values than those given, by name; a default leaves an option out.
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


def case_argument(*, optional: bool = False) -> Declaration:
    """Declare the case and changes of it."""
    told = "a bundled case (see `stillhook cases`) or a case file (.yaml, .json, .toml)"

    def add(parser: argparse._ActionsContainer) -> None:
        positional("case", told, optional=optional)(parser)
        repeated(
            "--set",
            "PATH=VALUE",
            "change a field of the case, as in --set limits.max_sensitivity=2.5 "
            "or --set 'sensors.telemetry.delay=50 ms'",
            "changes",
        )(parser)

    return add


def design_argument(parser: argparse._ActionsContainer) -> None:
    """Add the design, a file or gains; `commands.given_design` reads it."""
    text("--design", "FILE", "a design that was written (design.yaml)")(parser)
    told = "or gains, or parameters by name (default: the gains that the case has in use)"
    text("--gains", "A=..,a=..,a1=..,a2=..", told)(parser)
    text("--structure", "NAME", "whose parameters these are (default: payload-feedback)")(parser)


CASE = case_argument()
DESIGN: Declaration = design_argument
NO_BOUND = switch(
    "--no-bound",
    "do not compare with the best that any linear controller could do (2 s each, 15 s of one "
    "alone)",
)
OBJECTIVE = choice(
    "--objective",
    ("worst", "mean", "regret"),
    "what is made small (default: the worst payload motion)",
    "worst",
)
STRUCTURE = text(
    "--structure", "NAME", "controller structure (default: payload-feedback)", "payload-feedback"
)


#: The seed of a search, which any whole number is good for.
SEED = whole("--seed", "seed of the starts", 0, low=0)


def starts(default: int, help: str = "starts of the search") -> Declaration:
    """Declare from how many places a search begins."""
    return whole("--starts", help, default, low=1, high=4096)


def results_folder(default: str) -> Declaration:
    """Declare the folder for the results."""
    return text("--out", "DIR", f"folder for the results (default: {default})")


#: What every command takes, wherever it stands.
EVERYWHERE = group(
    "output",
    switch("--quiet", "print the verdict only"),
    switch("--json", "print what came of it as JSON, and nothing else"),
    switch("--no-figures", "draw no figures", "figures"),
    choice("--format", ("svg", "png"), "format of the figures (default: both)"),
)
