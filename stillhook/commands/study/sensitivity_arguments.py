"""The options of `stillhook sensitivity`, without what it imports."""

from __future__ import annotations

import argparse

from ..design_argument import add_design_arguments


def add_sensitivity_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add_design_arguments(parser)
    parser.add_argument(
        "--second",
        type=int,
        default=6,
        metavar="N",
        help="second derivatives of the N numbers with the largest effect (default: 6)",
    )
    parser.add_argument(
        "--plus",
        default="10 %",
        metavar="SHARE",
        help="move each gain by this share and compute all anew, as Figure 32 of the 1975 thesis "
        "does (default: '10 %%')",
    )
    over = parser.add_argument_group("over whole ranges: Sobol's indices and Morris's screening")
    over.add_argument(
        "--ranges",
        action="store_true",
        help="study ranges too; without --spread or --vary: payload mass 30 %% either way, "
        "stiffness 20 %%, drag 50 %%, the telemetry up to 20 ms later",
    )
    over.add_argument("--spread", metavar="FILE", help="a spread file (.yaml); implies --ranges")
    over.add_argument(
        "--vary",
        metavar="PATH=RANGE",
        action="append",
        default=[],
        help="vary a number evenly, as in payload.mass=30%% or 'sensors.telemetry.delay="
        "20 ms..80 ms'; may be repeated; implies --ranges",
    )
    over.add_argument(
        "--samples",
        type=int,
        default=1024,
        metavar="N",
        help="base points of the indices, a power of two; numbers + 2 cases each (default: 1024)",
    )
    over.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the draws (default: 0)"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<case>-sensitivity)"
    )
    parser.set_defaults(faults=None)  # of the time domain, which is not studied here
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")
