"""The command line: what can be asked, and how every ending is told.

    arguments -> parser -> one module of `stillhook.commands` -> exit status

Exit status: 0 all is well; 1 the design is not ok (unstable, infeasible, a limit broken, not
verified), a run diverged, or a vessel's RAOs are doubtful or not checked; 2 bad input; 3 an error
in Stillhook itself; 130 interrupted.  The commands are imported when they run, so that
``stillhook --help`` imports nothing heavy.
"""

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import TextIO

# Before numpy is imported.  The matrices here have some tens of rows: threads of the linear
# algebra libraries would spend their time waiting for each other, several times slower on a
# busy machine.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

OK, NOT_OK, BAD_INPUT, OUR_FAULT, INTERRUPTED = 0, 1, 2, 3, 130

_EPILOG = """\
exit status: 0 all is well; 1 the design is not ok: unstable, infeasible, a
limit broken, not verified; or a run diverged, or RAOs are doubtful or not
checked; 2 bad input; 3 an error in Stillhook itself; 130 interrupted

examples, and more by stillhook COMMAND --help:
  # the gains of a winch that can do its job
  stillhook optimise subsea-crane
  # all controllers in the same seas
  stillhook compare thesis-1975
  # a commented case file of your own
  stillhook new my.yaml
"""

#: The contents of the command line, by what somebody wants to do: a heading, and its commands:
#: name, room in `stillhook.commands`, and what it does in one line of the help.
CONTENTS = (
    (
        "start here",
        (
            ("cases", "world", "list the bundled cases"),
            ("new", "world", "write a commented case file that runs as it is"),
            ("check", "world", "read a case, and show what follows from it"),
            ("page", "design", "try gains, sea and limits with sliders, in the browser"),
        ),
    ),
    (
        "design a controller",
        (
            ("optimise", "design", "find the gains that hold the payload stillest within limits"),
            ("evaluate", "design", "say what given gains do"),
            ("structures", "design", "compare controller structures on a case"),
            ("robust", "design", "find one set of gains for many depths, loads and seas"),
            ("bound", "design", "say what no linear controller can do better than"),
        ),
    ),
    (
        "try it in time",
        (
            ("simulate", "run", "simulate controllers in a sea, limits and all"),
            ("compare", "study", "compare controllers in the same seas, limits and all"),
            ("scenarios", "run", "list the operations and the controllers"),
        ),
    ),
    (
        "study it",
        (
            ("margins", "design", "say how far the plant may be off before a design is unstable"),
            ("sensitivity", "study", "say which numbers of the case matter most to a design"),
            ("sweep", "study", "try a design or a controller on thousands of cases"),
            ("operability", "study", "say in which seas, and how often, the winch can work"),
        ),
    ),
    (
        "choose a winch",
        (
            ("size", "design", "find the smallest motor and gear that meet a target"),
            ("pareto", "design", "draw what stillness costs: torque, margin or delay"),
            ("worth", "design", "say what each limit, sensor and delay is worth"),
        ),
    ),
    (
        "hand it over",
        (
            ("report", "study", "write all about a design as a report for clients: HTML, PDF"),
            ("export", "study", "write a controller or the plant as C, FMU or IEC 61131-3"),
        ),
    ),
    (
        "vessels and seas",
        (
            ("motion", "world", "show the hook's motion over headings, periods and sides"),
            ("sea", "world", "read wave spectra: what they hold, scatter diagram, one of them"),
            ("vessel", "", "read a vessel's RAOs from a file, or compute them from a hull"),
            ("vessel list", "world", "list the bundled vessels"),
            ("vessel import", "world", "read RAOs, check them, keep them in one convention"),
            ("vessel hull", "world", "compute RAOs from main dimensions or a mesh (extra: bem)"),
        ),
    ),
    (
        "editors and shells",
        (
            ("schema", "world", "write the JSON Schema of a case file, for editors"),
            ("completion", "world", "write the completion of this command line for a shell"),
        ),
    ),
)
#: Every command: its name, its room in `stillhook.commands`, what it does.
COMMANDS = tuple(row for _, rows in CONTENTS for row in rows)

# Of commands that only have parts.
_EXAMPLES = {
    "vessel": (
        ("stillhook vessel list", "the bundled vessels"),
        ("stillhook vessel import osv-83m", "one of them, checked and drawn"),
    )
}
_SPELT = {"optimize": "optimise"}


def build_parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser of all commands, or with the arguments of the one that `words` name alone.

    Only that command is imported, so that ``stillhook --help`` imports nothing.
    """
    parser = argparse.ArgumentParser(
        prog="stillhook",
        usage="stillhook [-h] [--version] [--debug] COMMAND ...",
        description=_described(),
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show version and commit, and exit"
    )
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser.set_defaults(parser=build_parser)
    commands = parser.add_subparsers(
        prog="stillhook", dest="command", metavar="COMMAND", help=argparse.SUPPRESS
    )
    within = {"": commands}
    plain = [word for word in words or () if not word.startswith("-")]
    for name, room, help in COMMANDS:
        first, _, second = name.partition(" ")
        added = within[first if second else ""].add_parser(
            second or first,
            help=help,
            description=f"{help[0].upper()}{help[1:]}.",
            epilog=_examples(_EXAMPLES.get(name, ())),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        # Wherever it stands; without a default of its own, lest it undo the one before it.
        added.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )
        if not room:
            within[first] = added.add_subparsers(
                title="what to do", dest="part", metavar="WHAT", required=True
            )
        elif words is None or name.split() == plain[: 2 if second else 1]:
            from .commands.declare import EVERYWHERE, declared

            module = f".commands.{room}.{name.replace(' ', '_')}"
            chosen = import_module(module, __package__)
            added.epilog = _examples(getattr(chosen, "EXAMPLES", ()))
            declared(added, (*chosen.ARGUMENTS, EVERYWHERE))
            added.set_defaults(run=chosen.run)
    return parser


class _Version(argparse.Action):
    """Tells the version and, where it is known, the commit: looked for when asked."""

    def __call__(self, parser: argparse.ArgumentParser, *given: object) -> None:
        """Print them and end."""
        from ._version import __version__, commit

        known = commit()
        print(f"stillhook {__version__}{f' (commit {known})' if known else ''}")
        parser.exit()


def _described() -> str:
    """Return what the command line is for, and its contents."""
    lines = ["Keep the load on a vessel's hook still: gains for offshore winches."]
    wide = max(len(name) for name, *_ in COMMANDS)
    for heading, rows in CONTENTS:
        lines += ["", f"{heading}:"]
        lines += [f"  {name:{wide}}  {help}" for name, room, help in rows if room]
    return "\n".join(lines)


def _examples(rows: Sequence[tuple[str, str]]) -> str | None:
    """Return commands under what they do, to stand at the end of a help."""
    lines = [f"  # {comment}\n  {command}" for command, comment in rows]
    return "\n".join(["examples:", *lines]) if lines else None


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, 1, 2, 3 or 130, see the module.

    The arguments are those of the process by default.

    Raises SystemExit from the parser: with 0 for ``--help`` and ``--version``, with 2 for arguments
    that it does not understand.
    """
    from models.basics.progress import unshown

    from .text import take_any_text

    words = _spelt(sys.argv[1:] if argv is None else argv)
    take_any_text()
    parser = build_parser(words)
    try:
        arguments = parser.parse_args(words)
        if arguments.command is None:
            parser.print_help(sys.stderr)
            return BAD_INPUT
        if arguments.json:
            arguments.quiet = False  # what came of it is told whole
        # What a command sets about warnings ends with it, and it shows its progress itself.
        with warnings.catch_warnings(), unshown():
            status: int = arguments.run(arguments)
        # What is still in the buffer can fail too: a reader that has gone, a full disk.
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The reader (`head`, a closed pager) has what it wanted; leave Python nothing to flush.
        _leave(sys.stdout)
        return OK
    except KeyboardInterrupt as stop:
        _tell(f"stillhook: interrupted{f'; {stop}' if str(stop) else ''}")
        return INTERRUPTED
    except Exception as error:
        if "--debug" in words:
            raise
        return _failed(error)


def _spelt(words: Sequence[str]) -> list[str]:
    """Return the words of a command, which is written in British spelling."""
    first = next((k for k, word in enumerate(words) if not word.startswith("-")), 0)
    return [_SPELT.get(word, word) if k == first else word for k, word in enumerate(words)]


def _failed(error: Exception) -> int:
    """Write one sentence (or one for each error in a file), and return the exit status."""
    from models.basics import InputError, StillhookError

    if isinstance(error, InputError):
        _tell(str(error))
        return BAD_INPUT
    if isinstance(error, OSError) and error.filename is not None:  # a place that was named
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return BAD_INPUT
    hint = "run the command again with --debug to see where"
    if isinstance(error, StillhookError):
        _tell(f"stillhook: the computation failed: {error}; {hint}")
        return NOT_OK
    what = f"{type(error).__name__}: {error}".partition("\n")[0]
    _tell(f"stillhook: unexpected error, {what}; {hint}")
    return OUR_FAULT


def _tell(sentence: str) -> None:
    """Write a sentence to standard error, if anybody still reads it."""
    try:
        print(sentence, file=sys.stderr, flush=True)
    except BrokenPipeError:
        _leave(sys.stderr)


def _leave(stream: TextIO) -> None:
    """Let nothing more be written to a stream whose reader has gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
