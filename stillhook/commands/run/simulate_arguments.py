"""The options of `stillhook simulate`, apart from the command so that --help loads nothing."""

from __future__ import annotations

import argparse


def add_simulate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `simulate` to its parser, which has the case already."""
    _what(parser.add_argument_group("what is simulated"))
    _controller(parser.add_argument_group("the feedback's gains (default: those of the case)"))
    _how(parser.add_argument_group("how"))
    _results(parser.add_argument_group("results"))


def _what(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--controller",
        default="feedback",
        metavar="NAME",
        help="a controller, several with commas between, or all, which leaves out the predictive "
        "ones (default: feedback; see `stillhook scenarios`)",
    )
    group.add_argument(
        "--scenario", default="hold", metavar="NAME", help="an operation (default: hold)"
    )
    group.add_argument(
        "--option",
        dest="options",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the operation, as in 'height=6 m'; may be repeated",
    )
    group.add_argument(
        "--seeds", type=int, default=1, metavar="N", help="how many seas (default: 1)"
    )
    group.add_argument(
        "--first-seed", type=int, default=0, metavar="N", help="seed of the first (default: 0)"
    )
    length = group.add_mutually_exclusive_group()
    length.add_argument("--hours", type=float, metavar="H", help="length of a run in hours")
    length.add_argument(
        "--duration",
        metavar="TIME",
        help="length of a run, as in '20 min' (default: the operation's own)",
    )
    hook = group.add_mutually_exclusive_group()
    hook.add_argument(
        "--hook",
        metavar="FILE",
        help="the hook's motion from a CSV file with the columns time and displacement",
    )
    hook.add_argument(
        "--sine", metavar="AMPLITUDE,PERIOD", help="a sine instead, as in '0.5 m, 8 s'"
    )
    group.add_argument(
        "--tip",
        metavar="X,Y,Z",
        help="--hook holds heave, roll and pitch of the vessel; the crane's tip is so far "
        "forward, to port and up [m]",
    )


def _controller(group: argparse._ArgumentGroup) -> None:
    gains = group.add_mutually_exclusive_group()
    gains.add_argument(
        "--design", metavar="FILE", help="the gains of a design, as in out/CASE/design.yaml"
    )
    gains.add_argument("--gains", metavar="A=..,a=..,a1=..,a2=..", help="the gains")


def _how(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--sample-time", metavar="TIME", help="of the controller, as in '20 ms'")
    group.add_argument("--step", metavar="TIME", help="integration step (default: the longest)")
    group.add_argument(
        "--masses", type=int, metavar="N", help="masses along the rope (default: the case's)"
    )
    group.add_argument(
        "--settle", metavar="TIME", help="when statistics begin (default: after some waves)"
    )
    group.add_argument(
        "--lock-limit",
        metavar="LENGTH",
        help="error of the payload that counts as lost lock (default: the hook's significant "
        "height)",
    )
    group.add_argument(
        "--no-compile",
        dest="compiled",
        action="store_const",
        const=False,
        help="do not compile the loop to C: slower, and needs no compiler",
    )


def _results(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-<scenario>)"
    )
    group.add_argument(
        "--format",
        choices=("csv", "parquet", "netcdf", "none"),
        default="csv",
        help="of the time traces (default: csv)",
    )
    group.add_argument(
        "--store-step",
        metavar="TIME",
        help="time between two rows of them (default: so that there are at most 40 000)",
    )
    group.add_argument(
        "--figures",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="draw figures (default) or not",
    )
    group.add_argument(
        "--animate", action="store_true", help="make a moving picture (GIF) of the worst run"
    )
    group.add_argument("--quiet", action="store_true", help="print the outcome only")
