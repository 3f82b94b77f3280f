"""`stillhook vessel import`: read a RAO file, say what it is and if it can be true, keep it."""

import argparse
import shlex
from dataclasses import replace
from pathlib import Path

from models.basics import InputError
from models.vessel.readers import check_long_waves, read_raos, write_raos

from ...seas import rao_report
from ...text import told_once
from ..declare import options, within
from ..lists import numbers
from ..working import conclude, prepared_table

ARGUMENTS = (
    options(
        """
        file  a RAO file: CSV, WAMIT .4 or .out, OrcaFlex .yml, AQWA .LIS, Capytaine .nc, MSS .mat,
            ShipX .re1; or a bundled vessel
        --read-as {csv,netcdf,wamit,orcaflex,capytaine,mss,shipx,aqwa,wamit-listing}  what it is
            (default: its contents tell)
        --out PATH  a .csv, .nc, .4 (WAMIT) or .yml (OrcaFlex) file, or a folder (default: out/<name
            of the vessel>)
        --speed V  which forward speed [m/s]
        --body BODY  which body of several
        --length L  WAMIT's ULEN [m] (default: 1)
        --heading B  the one heading of a CSV file that has no column of them [deg]
        --waves {period,frequency}  first column of a WAMIT file (default: the heave of long waves
            tells)
        --symmetry {none,xz plane,yz plane,xz and yz planes,circular}  of the vessel, to fill in
            headings, if the file is silent
        --depth D  water depth [m]
        --origin X,Y,Z  the point whose motions they are, if the file is silent
        --vessel-type NAME  which of an OrcaFlex file
        --draught NAME  which of an OrcaFlex vessel type
        --roll-damping SHARE  to add, over the critical (Capytaine)
        --no-check  take the file even if it contradicts the limits of long waves
        """,
        speed=within(),
        length=within(),
        heading=within(),
        depth=within(),
        origin=numbers(3),
        roll_damping=within(),
    ),
)
EXAMPLES = (
    ("stillhook vessel import osv-83m", "a bundled vessel: its RAOs checked, drawn and kept"),
)


def run(arguments: argparse.Namespace) -> int:
    """Read, check, show and write; return 0, or 1 if the check ends in doubt or says nothing."""
    body = arguments.body
    with told_once():
        raos = read_raos(
            arguments.file,
            file_format=arguments.read_as,
            speed=arguments.speed,
            body=int(body) if body and body.isdigit() else body,
            length=arguments.length,
            heading=arguments.heading,
            depth=arguments.depth,
            origin=arguments.origin,
            vessel_type=arguments.vessel_type,
            draught=arguments.draught,
            roll_damping=arguments.roll_damping,
            waves=arguments.waves,
            symmetry=arguments.symmetry,
            check=arguments.check,
        )
    folder, table = prepared_table(arguments, raos.name, "raos.csv")
    if table.exists() and Path(arguments.file).exists() and table.samefile(arguments.file):
        raise InputError(f"{table}: is the file itself; --out must name another")
    report = rao_report(raos, check_long_waves(raos), stem=table.stem)
    if not arguments.check:
        report = replace(report, ok=None)  # taken as it is, as asked
    folder.keep(write_raos(table, raos))
    folder.draw(report.drawings)
    file = shlex.quote(str(table))
    following = [
        (
            "a hook aft and to starboard, in waves from 30 deg to starboard of the bow",
            f"stillhook motion subsea-crane --set vessel.raos={file} "
            "--set 'vessel.heading=150 deg' --set vessel.hook.x=-25 --set vessel.hook.y=-15",
        ),
        ("a case file of your own, with `raos:` and `hook:`", "stillhook new my.yaml"),
    ]
    return conclude(report, arguments, folder, following)
