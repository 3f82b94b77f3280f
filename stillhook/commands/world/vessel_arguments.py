"""The options of `stillhook vessel`, apart from the commands so that --help loads nothing."""

from __future__ import annotations

import argparse

from .vessel_hull_arguments import add_hull_arguments

_FORMATS = ("csv", "netcdf", "wamit", "orcaflex", "capytaine", "mss", "shipx")


def add_vessel_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the sub-commands: import, hull and list."""
    parts = parser.add_subparsers(
        title="what to do", dest="vessel_command", metavar="WHAT", required=True
    )

    def part(name: str, text: str) -> argparse.ArgumentParser:
        added = parts.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False
        )
        added.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )
        return added

    _add_import(part("import", "read a vessel's RAOs, check them, and keep them in one convention"))
    hull = part("hull", "compute a vessel's RAOs from main dimensions or a mesh (extra: bem)")
    add_hull_arguments(hull)
    part("list", "list the bundled vessels")


def _add_import(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file",
        metavar="FILE",
        help="a RAO file: CSV, WAMIT .4, OrcaFlex .yml, Capytaine .nc, MSS .mat, ShipX .re1; or a "
        "bundled vessel",
    )
    parser.add_argument(
        "--format", choices=_FORMATS, help="what it is (default: its contents tell)"
    )
    parser.add_argument(
        "--out",
        metavar="PATH",
        help="a .csv or .nc file, or a folder (default: out/<name of the vessel>)",
    )
    parser.add_argument("--speed", type=float, metavar="V", help="which forward speed [m/s]")
    parser.add_argument("--body", metavar="BODY", help="which body of several")
    parser.add_argument("--length", type=float, metavar="L", help="WAMIT's ULEN [m] (default: 1)")
    parser.add_argument(
        "--waves",
        choices=("period", "frequency"),
        help="first column of a WAMIT file (default: the heave of long waves tells)",
    )
    parser.add_argument(
        "--symmetry",
        choices=("none", "xz plane", "yz plane", "xz and yz planes", "circular"),
        help="of the vessel, to fill in headings, if the file is silent",
    )
    parser.add_argument("--depth", type=float, metavar="D", help="water depth [m]")
    parser.add_argument(
        "--origin", metavar="X,Y,Z", help="the point whose motions they are, if the file is silent"
    )
    parser.add_argument("--vessel-type", metavar="NAME", help="which of an OrcaFlex file")
    parser.add_argument("--draught", metavar="NAME", help="which of an OrcaFlex vessel type")
    parser.add_argument(
        "--roll-damping", type=float, metavar="SHARE", help="to add, over the critical (Capytaine)"
    )
    parser.add_argument(
        "--no-check",
        dest="check",
        action="store_false",
        help="take the file even if it contradicts the limits of long waves",
    )
    parser.add_argument("--quiet", action="store_true", help="print the verdict only")
