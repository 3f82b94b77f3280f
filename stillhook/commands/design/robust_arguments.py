"""The options of `stillhook robust` and `stillhook pareto`, without what they import."""

from __future__ import annotations

import argparse


def add_robust_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "--vary",
        metavar="PATH=LOW..HIGH",
        action="append",
        default=[],
        help="what varies, as in rope.length=500..1500, payload.mass=40t,50t or "
        "'PATH=a|b' for values with nothing between; may be repeated",
    )
    parser.add_argument("--seas", metavar="H_S/T_P[:SHARE],..", help="the sea states")
    parser.add_argument(
        "--scatter",
        metavar="FILE",
        help="a table of sea states: significant_height, peak_period, occurrence (.csv)",
    )
    parser.add_argument(
        "--objective",
        choices=("worst", "mean", "regret"),
        default="worst",
        help="what is made small (default: the worst payload motion)",
    )
    parser.add_argument(
        "--structure",
        dest="family_structure",  # not that of `optimise`, which leads to another command
        default="payload-feedback",
        metavar="NAME",
        help="controller structure (default: payload-feedback)",
    )
    parser.add_argument(
        "--schedule",
        metavar="LOW..HIGH",
        help="gains over the rope's length [m] instead of one set",
    )
    parser.add_argument("--starts", type=int, default=8, metavar="N", help="starts of the search")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the starts")
    parser.add_argument(
        "--draws", type=int, default=10_000, metavar="N", help="random plants to check with"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-robust)"
    )
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")


def add_pareto_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "--against",
        default="torque",
        choices=("torque", "speed", "max_sensitivity", "delay_margin", "delay"),
        help="the other quantity (default: torque); delay is that of the telemetry",
    )
    parser.add_argument(
        "--points", type=int, default=30, metavar="N", help="points of the front (default: 30)"
    )
    parser.add_argument(
        "--between", metavar="LOW..HIGH", help="ends of the front in SI units (default: found)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the searches")
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-pareto)"
    )
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")
