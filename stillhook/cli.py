"""The command line: what can be asked, and how every ending is told.

    arguments -> parser -> one module of `stillhook.commands` -> exit status

Exit status: 0 all is well; 1 the design is not ok (unstable, infeasible, a limit broken, not
verified), or a run diverged; 2 bad input; 3 an error in Stillhook itself; 130 interrupted.  The
commands are imported when they run, so that ``stillhook --help`` imports nothing heavy.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module

# Before numpy is imported.  The matrices here have some tens of rows: threads of the linear
# algebra libraries would spend their time waiting for each other, several times slower on a
# busy machine.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

OK, NOT_OK, BAD_INPUT, OUR_FAULT, INTERRUPTED = 0, 1, 2, 3, 130

_CASE = "a bundled case (see `stillhook cases`) or a case file (.yaml, .json, .toml)"
_EPILOG = """\
exit status: 0 all is well; 1 the design is not ok: unstable, infeasible, a
limit broken, not verified; or a run diverged; 2 bad input; 3 an error in
Stillhook itself; 130 interrupted

to begin with:
  stillhook cases                     what comes with the toolkit
  stillhook optimise subsea-crane     the gains of a winch that can do its job
  stillhook simulate thesis-1975      a controller in the time domain
  stillhook compare thesis-1975       all of them in the same seas
  stillhook new my.yaml               a commented case file of your own
"""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    from ._version import __version__
    from .commands import add_design_arguments
    from .commands.design import (
        add_pareto_arguments,
        add_robust_arguments,
        add_size_arguments,
        add_worth_arguments,
    )
    from .commands.run import add_simulate_arguments
    from .commands.study import (
        add_compare_arguments,
        add_operability_arguments,
        add_sensitivity_arguments,
        add_sweep_arguments,
    )
    from .commands.world import add_motion_arguments, add_sea_arguments, add_vessel_arguments

    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="stillhook",
        description="Keep the load on a vessel's hook still: gains for offshore winches.",
        epilog=_EPILOG,
        formatter_class=raw,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"stillhook {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND")

    def command(name: str, module: str, text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False
        )
        added.set_defaults(module=module)
        # Wherever it stands; without a default of its own, lest it undo the one before it.
        added.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )
        return added

    def case(added: argparse.ArgumentParser) -> None:
        added.add_argument("case", metavar="CASE", help=_CASE)
        added.add_argument(
            "--set",
            dest="changes",
            metavar="PATH=VALUE",
            action="append",
            default=[],
            help="change a field of the case, as in --set limits.max_sensitivity=2.5 "
            "or --set 'sensors.telemetry.delay=50 ms'; may be repeated",
        )

    def bounded(added: argparse.ArgumentParser) -> None:
        added.add_argument(
            "--no-bound",
            dest="bound",
            action="store_false",
            help="do not compare with the best that any linear controller could do (2 s a design)",
        )

    text = "find the gains that hold the payload stillest within the limits"
    optimise = command("optimise", "design.optimise", text)
    case(optimise)
    optimise.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<name of the case>)"
    )
    optimise.add_argument(
        "--starts", type=int, default=16, metavar="N", help="starts of the search (default: 16)"
    )
    optimise.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the starts (default: 0)"
    )
    optimise.add_argument("--quiet", action="store_true", help="print the verdict only")
    optimise.add_argument(
        "--structure",
        metavar="NAME",
        help="another structure than the three gains of payload feedback, such as combined; "
        "`stillhook structures CASE` compares them",
    )
    bounded(optimise)

    structures = command(
        "structures", "design.structures", "compare controller structures on a case"
    )
    case(structures)
    structures.add_argument(
        "--structures",
        metavar="A,B,..",
        help="which (default: all): payload-feedback, payload-feedback-rolloff, -lead, -notch, "
        "-integral, drum-feedback, feed-forward, combined, constant-tension, low-order-N",
    )
    structures.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<name of the case>)"
    )
    structures.add_argument(
        "--starts", type=int, default=8, metavar="N", help="starts of each search (default: 8)"
    )
    structures.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the starts (default: 0)"
    )
    structures.add_argument("--quiet", action="store_true", help="print the verdicts only")
    bounded(structures)

    evaluate = command("evaluate", "design.evaluate", "say what given gains do")
    case(evaluate)
    evaluate.add_argument(
        "--gains",
        metavar="A=..,a=..,a1=..,a2=..",
        help="the gains (default: those that the case has in use)",
    )
    evaluate.add_argument("--out", metavar="DIR", help="folder for the results (default: none)")
    evaluate.add_argument("--quiet", action="store_true", help="print the verdict only")
    bounded(evaluate)

    robust = command(
        "robust", "design.robust", "find one set of gains for many depths, loads and seas"
    )
    case(robust)
    add_robust_arguments(robust)

    text = "say how far the plant's numbers may be off before a design is unstable"
    margins = command("margins", "design.margins", text)
    case(margins)
    add_design_arguments(margins)
    margins.add_argument(
        "--off",
        metavar="PATH=SHARE",
        action="append",
        default=[],
        help="what may be off and how far either way, as in payload.mass=0.3, drag=0.5 or "
        "'delay=20 ms'; may be repeated (default: payload.mass=0.3, stiffness=0.2, drag=0.5)",
    )
    margins.add_argument(
        "--draws", type=int, default=1000, metavar="N", help="random plants to check with"
    )
    margins.add_argument("--quiet", action="store_true", help="print the verdict only")

    text = "say which numbers of the case matter most to a design"
    sensitivity = command("sensitivity", "study.sensitivity", text)
    case(sensitivity)
    add_sensitivity_arguments(sensitivity)

    text = "say in which seas the winch can work, what limits it, and how much of the year"
    operability = command("operability", "study.operability", text)
    case(operability)
    add_operability_arguments(operability)

    pareto = command(
        "pareto", "design.pareto", "draw what stillness costs: torque, margin or delay"
    )
    case(pareto)
    add_pareto_arguments(pareto)

    size = command("size", "design.size", "find the smallest motor and gear that meet a target")
    case(size)
    add_size_arguments(size)

    worth = command("worth", "design.worth", "say what each limit, sensor and delay is worth")
    case(worth)
    add_worth_arguments(worth)

    simulate = command("simulate", "run.simulate", "simulate controllers in a sea, limits and all")
    case(simulate)
    add_simulate_arguments(simulate)

    compare = command(
        "compare", "study.compare", "compare controllers in the same seas, limits and all"
    )
    case(compare)
    add_compare_arguments(compare)

    text = "try a design or a controller on many cases: what is not known exactly, what fails"
    add_sweep_arguments(command("sweep", "study.sweep", text))

    scenarios = command("scenarios", "run.scenarios", "list the operations and the controllers")
    scenarios.add_argument(
        "name", metavar="NAME", nargs="?", help="an operation, to see its options"
    )

    bound = command("bound", "design.bound", "say what no linear controller can do better than")
    case(bound)
    bound.add_argument(
        "--sensors",
        metavar="A,B,..",
        help="what a controller may hear, as in payload.displacement,mru.heave (default: all)",
    )
    bound.add_argument("--masses", type=int, metavar="N", help="masses along the rope")
    bound.add_argument(
        "--faint",
        type=float,
        default=1e-3,
        metavar="R",
        help="noise of a sensor that the case calls exact, over the hook's rms (default: 0.001)",
    )
    bound.add_argument("--quiet", action="store_true", help="print the bound only")

    sea = command(
        "sea", "world.sea", "read wave spectra: what they hold, scatter diagram, one of them"
    )
    add_sea_arguments(sea)

    text = "show the hook's motion over headings, periods and sides, and what it asks of a winch"
    motion = command("motion", "world.motion", text)
    case(motion)
    add_motion_arguments(motion)

    text = "read a vessel's RAOs from a file, or compute them from a hull"
    vessel = command("vessel", "world.vessel", text)
    add_vessel_arguments(vessel)

    case(command("check", "world.check", "read a case, and show what follows from it"))

    command("cases", "world.files", "list the bundled cases")

    new = command("new", "world.files", "write a commented case file that runs as it is")
    new.add_argument("file", metavar="FILE", help="the file to write")
    new.add_argument("--force", action="store_true", help="overwrite the file if it exists")

    schema = command("schema", "world.files", "write the JSON Schema of a case file, for editors")
    schema.add_argument(
        "file", metavar="FILE", nargs="?", help="the file to write (default: standard output)"
    )
    schema.add_argument("--force", action="store_true", help="overwrite the file if it exists")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    Parameters
    ----------
    argv
        The arguments; by default those of the process.

    Returns
    -------
    int
        0, 1, 2, 3 or 130, see the module.

    Raises
    ------
    SystemExit
        From the parser: with 0 for ``--help`` and ``--version``, with 2 for arguments that it
        does not understand.
    """
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.print_help(sys.stderr)
        return BAD_INPUT
    try:
        status = _run(arguments)
        # What is still in the buffer can fail too: a reader that has gone, a full disk.
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The reader (`head`, a closed pager) has what it wanted; leave Python nothing to flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt as stop:
        print(f"stillhook: interrupted{f'; {stop}' if str(stop) else ''}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if arguments.debug:
            raise
        return _failed(error)


def _run(arguments: argparse.Namespace) -> int:
    structured = getattr(arguments, "structure", None) is not None
    name = "design.structures" if structured else arguments.module
    module = import_module(f".commands.{name}", __package__)
    with warnings.catch_warnings():  # what a command sets about warnings ends with it
        status: int = module.run(arguments)
    return status


def _failed(error: Exception) -> int:
    """Write one sentence (or one for each error in a file), and return the exit status."""
    from models.basics import InputError, StillhookError

    if isinstance(error, InputError):
        print(error, file=sys.stderr)
        return BAD_INPUT
    hint = "run the command again with --debug to see where"
    if isinstance(error, StillhookError):
        print(f"stillhook: the computation failed: {error}; {hint}", file=sys.stderr)
        return NOT_OK
    what = f"{type(error).__name__}: {error}".partition("\n")[0]
    print(f"stillhook: unexpected error, {what}; {hint}", file=sys.stderr)
    return OUR_FAULT
