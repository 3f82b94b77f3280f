"""`stillhook vessel hull`: a vessel's motions from its main dimensions, or from a mesh."""

from __future__ import annotations

import argparse
import math
import os
import shlex

import numpy as np

from models.basics import InputError, check_range
from models.vessel.hull import Hull
from models.vessel.readers import check_long_waves, write_raos

from ...seas import hull_report
from ..declare import changed_words, choice, group, real, switch, text, whole
from ..lists import numbers, parse_range
from ..working import conclude, prepared_table, working

_STAGE = "computing waves on the hull"

ARGUMENTS = (
    group(
        "the hull: main dimensions, or a mesh",
        choice("--shape", ("ship", "box"), "what the main dimensions make (default: ship)", "ship"),
        real("--length", "L", "of the waterline [m]"),
        real("--beam", "B", "of the waterline [m]"),
        real(
            "--draught",
            "T",
            "[m]; with --mesh: where the waterline is above the lowest point "
            "(default: z = 0 of the file)",
        ),
        real("--block", "C", "block coefficient", 0.7),
        real("--midship", "C", "midship section coefficient", 0.96),
        text(
            "--transom",
            "WIDTH,DEPTH",
            "of the transom over beam and draught (default: 0.9,0.3)",
            (0.9, 0.3),
            read=numbers(2),
        ),
        text("--mesh", "FILE", "a mesh: .stl, .gdf, .pnl, .hst, .mar; z up, x forward"),
        real("--scale", "F", "metres per unit of length of the mesh", 1.0),
    ),
    group(
        "how it is loaded",
        real("--kg", "Z", "centre of gravity above the keel [m]; or"),
        real("--gm", "GM", "metacentric height [m]"),
        text(
            "--radii",
            "ROLL,PITCH,YAW",
            "radii of gyration [m] (default: 0.37 beam, 0.25 length, 0.25 length)",
            (None, None, None),
            read=numbers(3),
        ),
        real(
            "--roll-damping",
            "SHARE",
            "damping of roll beyond that of its waves, over the critical",
            0.05,
        ),
    ),
    group(
        "water and waves",
        real("--depth", "D", "[m] (default: deep)"),
        real("--density", "RHO", "[kg/m3]", 1025.0),
        text(
            "--frequencies",
            "LOW..HIGH",
            "of the coefficients [rad/s] (default: 0.15..2.0)",
            "0.15..2.0",
        ),
        whole(
            "--count",
            "how many of them (default: 0.05 rad/s apart, closer for long ships)",
            low=4,
            high=400,
        ),
        real(
            "--heading-step", "DEG", "between headings, all round [deg]", 15.0, low=1.0, high=90.0
        ),
    ),
    group(
        "the computation",
        whole("--panels", "of our own hulls", 600),
        switch("--no-lid", "no lid against irregular frequencies"),
        whole("--threads", "how many to use (default: one for each core)", low=1, high=1024),
        switch("--no-cache", "compute it anew, and keep nothing"),
        text("--name", "NAME", "what the vessel is called"),
        text(
            "--out", "PATH", "a .nc or .csv file, or a folder (default: out/<name of the vessel>)"
        ),
    ),
)


def run(arguments: argparse.Namespace) -> int:
    """Compute, check, show and write; return 0."""
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
            radii=arguments.radii,
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
