"""`stillhook vessel hull`: a vessel's motions from its main dimensions, or from a mesh."""

import argparse
import math
import os
import shlex

import numpy as np

from models.basics import InputError, check_range
from models.vessel.hull import Hull
from models.vessel.readers import check_long_waves, write_raos

from ...seas import hull_report
from ..declare import changed_words, options, within
from ..lists import numbers, parse_range
from ..working import conclude, prepared_table, working

_STAGE = "computing waves on the hull"

ARGUMENTS = (
    options(
        """
        the hull: main dimensions, or a mesh:
        --shape {ship,box} [ship]  what the main dimensions make (default: ship)
        --length L  of the waterline [m]
        --beam B  of the waterline [m]
        --draught T  [m]; with --mesh: where the waterline is above the lowest point (default: z = 0
            of the file)
        --block C [0.7]  block coefficient
        --midship C [0.96]  midship section coefficient
        --transom WIDTH,DEPTH [0.9,0.3]  of the transom over beam and draught (default: 0.9,0.3)
        --mesh FILE  a mesh: .stl, .gdf, .pnl, .hst, .mar; z up, x forward
        --scale F [1.0]  metres per unit of length of the mesh

        how it is loaded:
        --kg Z  centre of gravity above the keel [m]; or
        --gm GM  metacentric height [m]
        --radii ROLL,PITCH,YAW  radii of gyration [m] (default: 0.37 beam, 0.25 length, 0.25 length)
        --roll-damping SHARE [0.05]  damping of roll beyond that of its waves, over the critical

        water and waves:
        --depth D  [m] (default: deep)
        --density RHO [1025.0]  [kg/m3]
        --frequencies LOW..HIGH [0.15..2.0]  of the coefficients [rad/s] (default: 0.15..2.0)
        --count N  how many of them (default: 0.05 rad/s apart, closer for long ships)
        --heading-step DEG [15.0]  between headings, all round [deg]

        the computation:
        --panels N [600]  of our own hulls
        --no-lid  no lid against irregular frequencies
        --threads N  how many to use (default: one for each core)
        --no-cache  compute it anew, and keep nothing
        --name NAME  what the vessel is called
        --out PATH  a .nc or .csv file, or a folder (default: out/<name of the vessel>)
        """,
        length=within(),
        beam=within(),
        draught=within(),
        transom=numbers(2),
        kg=within(),
        gm=within(),
        radii=numbers(3),
        depth=within(),
        count=within(low=4, high=400),
        heading_step=within(low=1.0, high=90.0),
        threads=within(low=1, high=1024),
    ),
)
EXAMPLES = (
    (
        "stillhook vessel hull --length 80 --beam 18 --draught 6 --kg 6 --panels 150",
        "a ship of these main dimensions, in few panels",
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compute, check, show and write; return 0, or 1 if the motions cannot be vouched for."""
    from models.vessel.hull import usual_frequencies, vessel_from_hull

    low, high = parse_range("--frequencies", arguments.frequencies)
    check_range("hull", "--frequencies", low, low=0.01, unit="rad/s")
    check_range("hull", "--frequencies", high, low=1.1 * low, high=10.0, unit="rad/s")
    hull = _hull(arguments)
    made = changed_words(arguments, ARGUMENTS, out=None, threads=None, cache=True)
    # Made and tried before anything long begins.
    folder, table = prepared_table(arguments, hull.name, "raos.nc")
    with working(arguments) as tell:
        vessel = vessel_from_hull(
            hull,
            kg=arguments.kg,
            gm=arguments.gm,
            radii=arguments.radii or (None, None, None),
            roll_damping=arguments.roll_damping,
            omega=usual_frequencies(hull, low, high)
            if arguments.count is None
            else np.linspace(low, high, arguments.count),
            heading_step=math.radians(arguments.heading_step),
            depth=math.inf if arguments.depth is None else arguments.depth,
            density=arguments.density,
            lid=arguments.lid,
            name=arguments.name,
            command=shlex.join(["stillhook", "vessel", "hull", *made]),
            threads=arguments.threads or os.cpu_count(),
            cache=arguments.cache,
            progress=lambda done, of: tell(_STAGE, done, of),
        )
        report = hull_report(vessel, check_long_waves(vessel.raos), stem=table.stem)
        folder.keep(write_raos(table, vessel.raos))
        folder.draw(report.drawings)
    file = shlex.quote(str(table))
    following = [
        (
            "the hook of a crane at x = -25 m, y = -15 m in its seas",
            f"stillhook motion subsea-crane --set vessel.raos={file} "
            "--set vessel.hook.x=-25 --set vessel.hook.y=-15",
        ),
        ("the table again, with what it was made from", f"stillhook vessel import {file}"),
    ]
    return conclude(report, arguments, folder, following)


def _hull(arguments: argparse.Namespace) -> Hull:
    """Return the hull that the arguments describe."""
    named = {k: getattr(arguments, k) for k in ("length", "beam", "draught")}
    if arguments.mesh is not None:
        from models.vessel.hull import read_hull

        if arguments.length is not None or arguments.beam is not None:
            raise InputError("hull: --length and --beam go with main dimensions, not with --mesh")
        return read_hull(
            arguments.mesh, scale=arguments.scale, draught=arguments.draught, name=arguments.name
        )
    missing = [f"--{key}" for key, value in named.items() if value is None]
    if missing:
        raise InputError(
            f"hull: give --length, --beam and --draught, or --mesh; {', '.join(missing)} missing"
        )
    if arguments.shape == "box":
        from models.vessel.hull import box_hull

        return box_hull(**named, panels=arguments.panels, name=arguments.name)
    from models.vessel.hull import ShipLines

    width, depth = arguments.transom
    lines = ShipLines(
        **named,
        block=arguments.block,
        midship=arguments.midship,
        transom_width=width,
        transom_depth=depth,
    )
    return lines.hull(panels=arguments.panels, name=arguments.name)
