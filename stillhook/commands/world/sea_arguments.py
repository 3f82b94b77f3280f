"""The options of `stillhook sea`, without what they import."""

from __future__ import annotations

import argparse


def add_sea_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "file",
        metavar="FILE",
        help="a file of wave spectra (NDBC, Spotter, SWAN, WAVEWATCH III, ERA5 and more), or a "
        "case (bundled, .yaml or .toml) to see its sea",
    )
    parser.add_argument("--format", metavar="NAME", help="format of the file (default: found out)")
    parser.add_argument(
        "--record",
        type=int,
        metavar="N",
        help="record to show, counted from 0 in the order of time (default: the highest)",
    )
    parser.add_argument(
        "--beyond",
        choices=("decay", "zero"),
        default="decay",
        help="what a spectrum is above its last frequency (default: decay, as 1/omega^5)",
    )
    parser.add_argument(
        "--height-step",
        type=float,
        default=0.5,
        metavar="M",
        help="width of the scatter diagram's classes of H_s [m] (default: 0.5)",
    )
    parser.add_argument(
        "--period-step",
        type=float,
        default=1.0,
        metavar="S",
        help="width of its classes of T_p [s] (default: 1)",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder for the results (default: out/<file>-sea)"
    )
    parser.add_argument("--quiet", action="store_true", help="print the account only")
