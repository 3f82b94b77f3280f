"""The options of `stillhook operability`, without what they import."""

from __future__ import annotations

import argparse

from ..design_argument import add_design_arguments


def add_operability_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add_design_arguments(parser)
    parser.add_argument(
        "--held",
        action="store_true",
        help="no design: the drum held and a perfect winch only (default: the case's gains, or "
        "the best ones where it has none)",
    )
    parser.add_argument(
        "--tp",
        metavar="LOW..HIGH[/STEP]|A,B,..",
        help="peak periods [s], as in 5..15, 5..15/0.5 or 6,8,10 (default: 4..18, or those of "
        "the scatter diagram)",
    )
    parser.add_argument(
        "--headings",
        metavar="LOW..HIGH[/STEP]|A,B,..",
        help="headings [deg], where the waves travel to, 180 head sea, as in 0..345/15 or "
        "90,135,180 (default: 0..330/30 of a vessel with raos)",
    )
    criteria = parser.add_argument_group("how still the payload must be")
    criteria.add_argument(
        "--payload-rms", metavar="LENGTH", help="standard deviation of its motion, as in '50 mm'"
    )
    criteria.add_argument(
        "--payload-significant", metavar="LENGTH", help="significant double amplitude, 4 sigma"
    )
    criteria.add_argument(
        "--payload-max",
        metavar="LENGTH",
        help="most probable maximum amplitude in the case's exposure time",
    )
    criteria.add_argument(
        "--payload-speed",
        metavar="SPEED",
        help="most probable maximum of its speed, as in '0.5 m/s'",
    )
    parser.add_argument(
        "--depths",
        metavar="A,B,..",
        help="lengths of rope paid out [m], as in 100,500,1000 (default: the case's)",
    )
    parser.add_argument(
        "--scatter",
        metavar="FILE",
        help="scatter diagram (.csv): the share of the year that is workable; `example` is a "
        "made-up one",
    )
    parser.add_argument(
        "--reoptimise",
        action="store_true",
        help="also find the gains anew for each sea (seconds for each)",
    )
    parser.add_argument(
        "--highest", metavar="LENGTH", default="30 m", help="highest H_s looked at (default: 30 m)"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-operability)"
    )
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")
