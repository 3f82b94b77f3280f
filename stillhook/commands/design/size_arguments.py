"""The options of `stillhook size` and `stillhook worth`, without what they import."""

from __future__ import annotations

import argparse


def add_size_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "--target",
        metavar="LENGTH",
        help="rms that the payload may move: '20 mm', '5 %%' of the hook's rms, '26 dB' below it",
    )
    parser.add_argument(
        "--hs",
        metavar="LENGTH",
        help="significant wave height, as in '2.5 m' (default: the case's)",
    )
    parser.add_argument(
        "--gear",
        metavar="LOW..HIGH",
        help="gear ratios to look at (default: the case's over and times 2.5)",
    )
    parser.add_argument(
        "--points", type=int, default=9, metavar="N", help="gears on the curve (default: 9)"
    )
    parser.add_argument(
        "--motors", metavar="FILE", help="a catalogue of motors to choose from (.csv)"
    )
    parser.add_argument(
        "--co-design",
        action="store_true",
        help="keep the motor and find the gear with which the payload is stillest",
    )
    parser.add_argument(
        "--radius", metavar="LOW..HIGH", help="with --co-design: drum radii to look at [m]"
    )
    _common(parser, "size")


def add_worth_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    _common(parser, "worth")


def _common(parser: argparse.ArgumentParser, name: str) -> None:
    parser.add_argument(
        "--structure",
        dest="family_structure",  # not that of `optimise`, which leads to another command
        default="payload-feedback",
        metavar="NAME",
        help="controller structure (default: payload-feedback)",
    )
    parser.add_argument("--starts", type=int, default=4, metavar="N", help="starts of the search")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the starts")
    parser.add_argument(
        "--out", metavar="DIR", help=f"folder for the results (default: out/<case>-{name})"
    )
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")
