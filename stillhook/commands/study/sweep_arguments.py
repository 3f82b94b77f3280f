"""The options of `stillhook sweep`, apart from the command so that --help loads nothing."""

from __future__ import annotations

import argparse

_CASE = "a bundled case (see `stillhook cases`) or a case file; none with --resume"


def add_sweep_arguments(parser: argparse.ArgumentParser) -> None:
    """Add all arguments of `sweep` to its parser, the case included."""
    parser.add_argument("case", metavar="CASE", nargs="?", help=_CASE)
    parser.add_argument(
        "--set",
        dest="changes",
        metavar="PATH=VALUE",
        action="append",
        default=[],
        help="change a field of the nominal case; may be repeated",
    )
    _who(parser.add_argument_group("who is tried"))
    _what(parser.add_argument_group("what varies (default: mass, stiffness, drag and delay)"))
    _time(parser.add_argument_group("in the time domain (--mode time)"))
    _where(parser.add_argument_group("where it runs, with --mode time"))
    _results(parser.add_argument_group("results"))


def _who(group: argparse._ArgumentGroup) -> None:
    one = group.add_mutually_exclusive_group()
    one.add_argument(
        "--design", metavar="FILE", help="a design that was written (design.yaml, combined.yaml)"
    )
    one.add_argument(
        "--gains",
        metavar="A=..,a=..,a1=..,a2=..",
        help="gains (default: those that the case has in use)",
    )
    one.add_argument(
        "--controller",
        metavar="NAME",
        help="another controller, with --mode time, as in mpc (see `stillhook scenarios`)",
    )
    group.add_argument(
        "--follow",
        action="store_true",
        help="make the controller for each case, and design a design anew (default: it is made for "
        "the nominal case, and the plant is another)",
    )


def _what(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--spread", metavar="FILE", help="a spread file (.yaml)")
    group.add_argument(
        "--vary",
        metavar="PATH=RANGE",
        action="append",
        default=[],
        help="vary a number evenly, as in payload.mass=30%% (either way) or "
        "'delay=20 ms..80 ms'; may be repeated, and adds to --spread",
    )
    group.add_argument(
        "--faults",
        metavar="A,B,..",
        help="vary what fails, with --mode time: dropouts, outages, delay-jumps, sensor-bias, "
        "mru-bias, limit-cuts",
    )
    group.add_argument(
        "--samples",
        type=int,
        metavar="N",
        help="number of cases (default: 10000; with --mode time 256)",
    )
    group.add_argument(
        "--sampling",
        default="sobol",
        metavar="METHOD",
        help="sobol (default), lhs, random, grid, corners or given",
    )
    group.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the draws (default: 0)"
    )
    group.add_argument(
        "--mode",
        choices=("frequency", "time"),
        default="frequency",
        help="the linear loop (default), or nonlinear runs in time",
    )


def _time(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--duration", default="10 min", metavar="TIME", help="length of a run (default: 10 min)"
    )
    group.add_argument("--settle", metavar="TIME", help="when its statistics begin")
    group.add_argument("--scenario", default="hold", metavar="NAME", help="the operation")
    group.add_argument(
        "--option",
        dest="options",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the operation; may be repeated",
    )
    group.add_argument(
        "--masses", type=int, metavar="N", help="masses along the rope (default: the case's)"
    )
    group.add_argument(
        "--first",
        type=int,
        default=0,
        metavar="N",
        help="number of the first case, for a part of a longer sweep (default: 0)",
    )
    group.add_argument(
        "--common-seed", action="store_true", help="let all cases meet the same sea and noise"
    )


def _where(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--jobs", type=int, metavar="N", help="processes (default: one for each core)"
    )
    group.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="a dask scheduler, as in tcp://10.0.0.1:8786, or local:4 for four processes here",
    )
    group.add_argument(
        "--resume",
        metavar="DIR",
        help="go on with a sweep that was stopped, from its folder alone",
    )


def _results(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--out",
        metavar="DIR",
        help="folder for the results (default: out/<case>-sweep); with --mode time the same "
        "command again goes on with what is there",
    )
    group.add_argument(
        "--worst", type=int, default=5, metavar="N", help="how many of the worst (default: 5)"
    )
    group.add_argument(
        "--figures",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="draw figures (default) or not",
    )
    group.add_argument("--quiet", action="store_true", help="print what it says only")
