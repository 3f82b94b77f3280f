"""The options of `stillhook compare`, apart from the command so that --help loads nothing."""

from __future__ import annotations

import argparse


def add_compare_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `compare` to its parser, which has the case already."""
    parser.add_argument(
        "--controllers",
        metavar="A,B,..",
        help="who takes part (default: all that do anything here); see --list; a design file is "
        "one too, as in out/CASE/design.yaml",
    )
    parser.add_argument("--list", action="store_true", help="say who they are, and end")
    parser.add_argument(
        "--seeds", type=int, default=10, metavar="N", help="seas of each height (default: 10)"
    )
    parser.add_argument(
        "--hs", metavar="H,H,..", help="significant heights [m] (default: that of the case)"
    )
    parser.add_argument(
        "--duration", default="20 min", metavar="TIME", help="of a run (default: 20 min)"
    )
    parser.add_argument(
        "--mismatch",
        metavar="NAME=VALUE,..",
        help="what of the plant is not as the controllers think, as in payload=+30%%,E=-30%%,"
        "delay=+50ms,spectrum=jonswap, or a path of the case",
    )
    parser.add_argument(
        "--design-at",
        choices=("each", "case"),
        default="each",
        help="design the linear laws for each height (default), or once for the case's sea",
    )
    parser.add_argument(
        "--starts",
        type=int,
        default=8,
        metavar="N",
        help="starts of each search for a design (default: 8)",
    )
    parser.add_argument(
        "--masses",
        type=int,
        metavar="N",
        help="masses along the plant's rope (default: the case's)",
    )
    parser.add_argument("--settle", metavar="TIME", help="when statistics begin")
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="processes (default: one for each core)"
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="folder for the results (default: out/<case>-compare); the same command again goes "
        "on with what is there",
    )
    parser.add_argument(
        "--figures",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="draw figures (default) or not",
    )
    parser.add_argument("--quiet", action="store_true", help="print what it says only")
