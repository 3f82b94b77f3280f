"""The options of `stillhook motion`, without what they import."""

from __future__ import annotations

import argparse


def add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument(
        "--headings",
        metavar="A,B,.. or LOW..HIGH",
        help="where the waves travel to, relative to the bow [deg]: 180 is a head sea, 90 comes "
        "from starboard (default: every 15 degrees)",
    )
    parser.add_argument(
        "--tp",
        metavar="A,B,.. or LOW..HIGH",
        help="peak periods [s]; a range goes in steps of one second (default: 5..16)",
    )
    parser.add_argument(
        "--fractile",
        type=float,
        default=0.9,
        metavar="P",
        help="probability that the largest value of the exposure time stays below the second "
        "extreme that is told (default: 0.9)",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-motion)"
    )
    parser.add_argument("--quiet", action="store_true", help="print the figures of the case only")
