"""The options of `stillhook vessel hull`, without what they import."""

from __future__ import annotations

import argparse


def add_hull_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    shape = parser.add_argument_group("the hull: main dimensions, or a mesh")
    shape.add_argument(
        "--shape",
        choices=("ship", "box"),
        default="ship",
        help="what the main dimensions make (default: ship)",
    )
    shape.add_argument("--length", type=float, metavar="L", help="of the waterline [m]")
    shape.add_argument("--beam", type=float, metavar="B", help="of the waterline [m]")
    shape.add_argument(
        "--draught",
        type=float,
        metavar="T",
        help="[m]; with --mesh: where the waterline is above the lowest point "
        "(default: z = 0 of the file)",
    )
    shape.add_argument(
        "--block", type=float, default=0.7, metavar="C", help="block coefficient (default: 0.7)"
    )
    shape.add_argument(
        "--midship",
        type=float,
        default=0.96,
        metavar="C",
        help="midship section coefficient (default: 0.96)",
    )
    shape.add_argument(
        "--transom",
        default="0.9,0.3",
        metavar="WIDTH,DEPTH",
        help="of the transom over beam and draught (default: 0.9,0.3)",
    )
    shape.add_argument(
        "--mesh", metavar="FILE", help="a mesh: .stl, .gdf, .pnl, .hst, .mar; z up, x forward"
    )
    shape.add_argument(
        "--scale",
        type=float,
        default=1.0,
        metavar="F",
        help="metres per unit of length of the mesh (default: 1)",
    )
    load = parser.add_argument_group("how it is loaded")
    load.add_argument(
        "--kg", type=float, metavar="Z", help="centre of gravity above the keel [m]; or"
    )
    load.add_argument("--gm", type=float, metavar="GM", help="metacentric height [m]")
    load.add_argument(
        "--radii",
        metavar="ROLL,PITCH,YAW",
        help="radii of gyration [m] (default: 0.37 beam, 0.25 length, 0.25 length)",
    )
    load.add_argument(
        "--roll-damping",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="damping of roll beyond that of its waves, over the critical (default: 0.05)",
    )
    water = parser.add_argument_group("water and waves")
    water.add_argument("--depth", type=float, metavar="D", help="[m] (default: deep)")
    water.add_argument(
        "--density", type=float, default=1025.0, metavar="RHO", help="[kg/m3] (default: 1025)"
    )
    water.add_argument(
        "--frequencies",
        default="0.15..2.0",
        metavar="LOW..HIGH",
        help="of the coefficients [rad/s] (default: 0.15..2.0)",
    )
    water.add_argument(
        "--count",
        type=int,
        metavar="N",
        help="how many of them (default: 0.05 rad/s apart, closer for long ships)",
    )
    water.add_argument(
        "--heading-step",
        type=float,
        default=15.0,
        metavar="DEG",
        help="between headings, all round [deg] (default: 15)",
    )
    run = parser.add_argument_group("the computation")
    run.add_argument(
        "--panels", type=int, default=600, metavar="N", help="of our own hulls (default: 600)"
    )
    run.add_argument(
        "--no-lid",
        dest="lid",
        action="store_false",
        help="no lid against irregular frequencies",
    )
    run.add_argument(
        "--threads", type=int, metavar="N", help="how many to use (default: one for each core)"
    )
    run.add_argument(
        "--no-cache", dest="cache", action="store_false", help="compute it anew, and keep nothing"
    )
    run.add_argument("--name", metavar="NAME", help="what the vessel is called")
    run.add_argument(
        "--out",
        metavar="PATH",
        help="a .nc or .csv file, or a folder (default: out/<name of the vessel>)",
    )
    run.add_argument("--quiet", action="store_true", help="print the verdict only")
