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

to begin with:
  stillhook cases                     what comes with the toolkit
  stillhook optimise subsea-crane     the gains of a winch that can do its job
  stillhook simulate thesis-1975      a controller in the time domain
  stillhook compare thesis-1975       all of them in the same seas
  stillhook new my.yaml               a commented case file of your own
"""


#: Every command: its name, its room in `stillhook.commands`, what it does.
COMMANDS = (
    ("optimise", "design", "find the gains that hold the payload stillest within the limits"),
    ("structures", "design", "compare controller structures on a case"),
    ("evaluate", "design", "say what given gains do"),
    ("robust", "design", "find one set of gains for many depths, loads and seas"),
    ("margins", "design", "say how far the plant's numbers may be off before a design is unstable"),
    ("sensitivity", "study", "say which numbers of the case matter most to a design"),
    (
        "operability",
        "study",
        "say in which seas the winch can work, what limits it, and how much of the year",
    ),
    ("pareto", "design", "draw what stillness costs: torque, margin or delay"),
    ("size", "design", "find the smallest motor and gear that meet a target"),
    ("worth", "design", "say what each limit, sensor and delay is worth"),
    ("simulate", "run", "simulate controllers in a sea, limits and all"),
    ("compare", "study", "compare controllers in the same seas, limits and all"),
    (
        "sweep",
        "study",
        "try a design or a controller on many cases: what is not known exactly, what fails",
    ),
    ("report", "study", "write all there is about a design as a report for clients: HTML and PDF"),
    ("page", "design", "try gains, sea and limits with sliders, in the browser on this machine"),
    (
        "export",
        "study",
        "write a controller, or the plant, for drives, PLCs and co-simulation: C, FMU, IEC 61131-3",
    ),
    ("scenarios", "run", "list the operations and the controllers"),
    ("bound", "design", "say what no linear controller can do better than"),
    ("sea", "world", "read wave spectra: what they hold, scatter diagram, one of them"),
    (
        "motion",
        "world",
        "show the hook's motion over headings, periods and sides, and what it asks of a winch",
    ),
    ("vessel", "", "read a vessel's RAOs from a file, or compute them from a hull"),
    ("vessel import", "world", "read a vessel's RAOs, check them, and keep them in one convention"),
    ("vessel hull", "world", "compute a vessel's RAOs from main dimensions or a mesh (extra: bem)"),
    ("vessel list", "world", "list the bundled vessels"),
    ("check", "world", "read a case, and show what follows from it"),
    ("cases", "world", "list the bundled cases"),
    ("new", "world", "write a commented case file that runs as it is"),
    ("schema", "world", "write the JSON Schema of a case file, for editors"),
)


_SPELT = {"optimize": "optimise"}


def build_parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser of all commands, or with the arguments of the one that `words` name alone.

    Only that command is imported, so that ``stillhook --help`` imports nothing.
    """
    from ._version import __version__

    parser = argparse.ArgumentParser(
        prog="stillhook",
        description="Keep the load on a vessel's hook still: gains for offshore winches.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"stillhook {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    within = {"": parser.add_subparsers(title="commands", dest="command", metavar="COMMAND")}
    plain = [word for word in words or () if not word.startswith("-")]
    for name, room, help in COMMANDS:
        first, _, second = name.partition(" ")
        added = within[first if second else ""].add_parser(
            second or first,
            help=help,
            description=f"{help[0].upper()}{help[1:]}.",
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
            declared(added, (*chosen.ARGUMENTS, EVERYWHERE))
            added.set_defaults(run=chosen.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, 1, 2, 3 or 130, see the module.

    The arguments are those of the process by default.

    Raises SystemExit from the parser: with 0 for ``--help`` and ``--version``, with 2 for arguments
    that it does not understand.
    """
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
        with warnings.catch_warnings():  # what a command sets about warnings ends with it
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
