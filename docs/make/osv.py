"""Compute the bundled vessel `osv-83m`: an offshore supply vessel of 83 m, from our own hull lines.

    .venv/bin/python docs/make/osv.py              # writes models/vessel/data/osv-83m.csv
    .venv/bin/python docs/make/osv.py --check      # computes it on fewer panels and compares

Main dimensions are those of a usual offshore supply and construction vessel.  Its lines are not
those of any ship that was built: they are the simple ship of `models/vessel/hull/lines.py`.  It
needs the extra `bem`, and about a minute.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from stored import study_parser

from models.basics import write_text_atomically
from models.vessel import MODES, VesselRaos
from models.vessel.hull import HullVessel, ShipLines, vessel_from_hull
from models.vessel.readers import read_raos
from models.vessel.readers.csv_file import csv_text
from stillhook.seas import hull_figure
from stillhook.text import picture

ROOT = Path(__file__).parents[2]
PLACE = ROOT / "models" / "vessel" / "data" / "osv-83m.csv"
PICTURE = ROOT / "docs" / "images" / "osv-83m-hull.png"
COMMAND = (
    "stillhook vessel hull --length 82.8 --beam 19.2 --draught 6 --block 0.68 --gm 2 "
    "--radii 7.1,20.7,20.7 --roll-damping 0.08 --panels 900 --name osv-83m"
)
ABOUT = "offshore supply vessel, 83 m, 6650 t; motions of amidships in the waterline"


def computed(panels: int) -> HullVessel:
    lines = ShipLines(length=82.8, beam=19.2, draught=6.0, block=0.68)
    return vessel_from_hull(
        lines.hull(panels=panels, name="osv-83m"),
        gm=2.0,
        radii=(7.1, 20.7, 20.7),
        roll_damping=0.08,
        name="osv-83m",
        command=COMMAND,
        progress=lambda done, of: print(f"\r{done} of {of}", end="", flush=True),
    )


def text(raos: VesselRaos) -> str:
    """Return the file: one side only, and no more digits than there is truth in."""
    side = raos.heading <= np.pi + 1e-9
    values = np.round(raos.values[:, side], 6)
    values[..., 3:] = np.round(raos.values[:, side, 3:], 8)
    half = replace(
        raos,
        omega=np.round(raos.omega, 6),
        heading=raos.heading[side],
        values=values + 0.0,
        notes=(ABOUT, *raos.notes),
    )
    head, _, rest = csv_text(half).partition("# source")
    return f"{head}# symmetry: xz plane\n# source{rest}"


def main() -> int:
    parser = study_parser(__doc__)
    parser.add_argument(
        "--check", action="store_true", help="compare with fewer panels, write none"
    )
    arguments = parser.parse_args()
    vessel = computed(200 if arguments.quick else 450 if arguments.check else 900)
    print(f"\n{vessel.natural_periods}, {vessel.raos.omega.size} frequencies")
    if not (arguments.check or arguments.quick):
        write_text_atomically(PLACE, text(vessel.raos))
        print(f"{PLACE}: {PLACE.stat().st_size / 1e3:.0f} kB")
        PICTURE.write_bytes(picture(hull_figure(vessel), "png"))
        return 0
    kept = read_raos("osv-83m")
    again = vessel.raos.response(kept.omega[:, None], kept.heading)
    for index, mode in enumerate(MODES):
        scale = np.abs(kept.values[..., index]).max()
        off = np.abs(np.abs(again[..., index]) - np.abs(kept.values[..., index])).max() / scale
        print(f"{mode}: {100.0 * off:.1f} % of its largest value")
    return 0


if __name__ == "__main__":
    sys.exit(main())
