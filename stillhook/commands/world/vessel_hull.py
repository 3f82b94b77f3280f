"""`stillhook vessel hull`: a vessel's motions from its main dimensions, or from a mesh."""

from __future__ import annotations

import argparse
import math
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError, check_range
from models.vessel.readers import check_long_waves, write_raos

from ...text import (
    OutputFolder,
    commands,
    console,
    folder_name,
    number,
    pairs,
    percent,
    progress,
    quantity,
    table_of,
)
from ..design import parse_range
from .vessel_import import _largest, _show_check, _verdict

if TYPE_CHECKING:
    from models.vessel.hull import Hull, HullVessel

_STAGE = "computing waves on the hull"


def run(arguments: argparse.Namespace) -> int:
    """Compute, check, show and write; return 0."""
    from models.vessel.hull import usual_frequencies, vessel_from_hull

    low, high = parse_range("--frequencies", arguments.frequencies)
    check_range("hull", "--frequencies", low, low=0.01, unit="rad/s")
    check_range("hull", "--frequencies", high, low=1.1 * low, high=10.0, unit="rad/s")
    if arguments.count is not None:
        check_range("hull", "--count", arguments.count, low=4, high=400)
    check_range("hull", "--heading-step", arguments.heading_step, low=1.0, high=90.0, unit="deg")
    if arguments.threads is not None:
        check_range("hull", "--threads", arguments.threads, low=1, high=1024)
    radii = _numbers("--radii", arguments.radii, 3) if arguments.radii else (None, None, None)
    hull = _hull(arguments)
    folder, table = _place(arguments, hull)
    with progress(shown=not arguments.quiet) as tell:
        vessel = vessel_from_hull(
            hull,
            kg=arguments.kg,
            gm=arguments.gm,
            radii=(radii[0], radii[1], radii[2]),
            roll_damping=arguments.roll_damping,
            omega=usual_frequencies(hull, low, high)
            if arguments.count is None
            else np.linspace(low, high, arguments.count),
            heading_step=math.radians(arguments.heading_step),
            depth=math.inf if arguments.depth is None else arguments.depth,
            density=arguments.density,
            lid=arguments.lid,
            name=arguments.name,
            command=_command(arguments),
            threads=arguments.threads or os.cpu_count(),
            cache=arguments.cache,
            progress=lambda done, of: tell(_STAGE, done, of),
        )
        written = _write(vessel, folder, table)
    _show(vessel, arguments, table, written)
    return 0


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

    width, depth = _numbers("--transom", arguments.transom, 2)
    lines = ShipLines(
        **named,
        block=arguments.block,
        midship=arguments.midship,
        transom_width=width,
        transom_depth=depth,
    )
    return lines.hull(panels=arguments.panels, name=arguments.name)


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count:
        raise InputError(f"hull: {option} must be {count} numbers with commas, got {text!r}")
    return found


def _place(arguments: argparse.Namespace, hull: Hull) -> tuple[OutputFolder, Path]:
    """Return the folder, made and tried before anything long begins, and the table in it."""
    target = Path(arguments.out or Path("out") / folder_name(hull.name))
    alone = target.suffix.lower() in {".csv", ".nc"}
    folder = OutputFolder.prepare(target.parent if alone else target)
    return folder, target if alone else folder.path / "raos.nc"


def _command(arguments: argparse.Namespace) -> str:
    """Return the command that makes the same vessel again: what differs from the defaults."""
    from .vessel_hull_arguments import add_hull_arguments

    parser = argparse.ArgumentParser()
    add_hull_arguments(parser)
    words = ["stillhook", "vessel", "hull"]
    for action in parser._actions:
        if action.dest in {"help", "out", "quiet", "threads", "cache"}:
            continue
        value = getattr(arguments, action.dest)
        if value == action.default or not action.option_strings:
            continue
        words.append(action.option_strings[0])
        if action.nargs != 0:
            words.append(f"{value:g}" if isinstance(value, float) else str(value))
    return shlex.join(words)


def _write(vessel: HullVessel, folder: OutputFolder, table: Path) -> list[Path]:
    """Write the table and the pictures; return their paths."""
    from ...seas import hull_figure, rao_figure
    from ...text import picture

    written = [write_raos(table, vessel.raos)]
    for name, figure in (
        (table.stem, rao_figure(vessel.raos)),
        ("hull" if table.stem == "raos" else f"{table.stem}-hull", hull_figure(vessel)),
    ):
        written += [
            folder.write(f"{name}.{kind}", picture(figure, kind)) for kind in ("svg", "png")
        ]
    return written


def _show(
    vessel: HullVessel, arguments: argparse.Namespace, table: Path, written: list[Path]
) -> None:
    out = console()
    check = check_long_waves(vessel.raos)
    if arguments.quiet:
        out.print(f"{vessel.raos.name}: {_verdict(check)}", soft_wrap=True)
        return
    out.print(f"{vessel.raos.name}: {vessel.raos.source}", style="bold", soft_wrap=True)
    out.print(f"{'ok' if check.ok else 'DOUBTFUL'}: {_verdict(check)}", soft_wrap=True)
    out.print()
    table_of("afloat", _afloat(vessel), out)
    out.print()
    table_of("motions", _motions(vessel), out)
    out.print()
    pairs(_about(vessel), out)
    out.print()
    _show_check(check)
    for warning in vessel.warnings:
        out.print(f"note: {warning}", soft_wrap=True)
    out.print()
    out.print(f"Written: {', '.join(str(path) for path in written)}", soft_wrap=True)
    file = shlex.quote(str(table))
    commands(
        [
            (
                "the hook of a crane at x = -25 m, y = -15 m in its seas",
                f"stillhook motion subsea-crane --set vessel.raos={file} "
                "--set vessel.hook.x=-25 --set vessel.hook.y=-15",
            ),
            ("the table again, with what it was made from", f"stillhook vessel import {file}"),
        ],
        out,
    )


def _afloat(vessel: HullVessel) -> list[tuple[str, str, str]]:
    plane, load = vessel.waterplane, vessel.loading
    keel = plane.draught
    roll, pitch = vessel.metacentric_heights
    buoyancy = plane.centre_of_buoyancy
    return [
        ("displacement", quantity(load.mass, "kg", 4), f"{number(plane.volume, 4)} m3"),
        (
            "length x beam x draught",
            f"{number(plane.length)} x {number(plane.beam)} x {number(plane.draught)} m",
            f"block coefficient {number(plane.block)}",
        ),
        ("waterplane", f"{number(plane.area, 4)} m2", ""),
        (
            "centre of gravity, KG",
            f"{load.centre[2] + keel:.2f} m",
            f"x {load.centre[0]:+.2f} m, above the centre of buoyancy",
        ),
        ("KB + BM", f"{buoyancy[2] + keel:.2f} + {plane.metacentric_radii[0]:.2f} m", ""),
        ("metacentric height, GM", f"{roll:.2f} m", f"of pitch {pitch:.0f} m"),
        (
            "radii of gyration",
            ", ".join(f"{r:.2f}" for r in load.radii) + " m",
            "roll, pitch, yaw",
        ),
    ]


def _motions(vessel: HullVessel) -> list[tuple[str, str, str]]:
    periods = vessel.natural_periods
    omega = vessel.body.hydrodynamics.omega
    rows = []
    for name in ("heave", "roll", "pitch"):
        period = getattr(periods, name)
        inside = omega[0] <= 2.0 * math.pi / period <= omega[-1]
        rows.append(
            (
                f"natural period of {name}",
                quantity(period, "s"),
                "" if inside else "beyond the frequencies computed",
            )
        )
    rows.append(
        (
            "damping of roll added",
            percent(vessel.body.roll_damping),
            f"of critical, {vessel.body.critical_roll_damping / 1e6:.4g} MN m s",
        )
    )
    return rows


def _about(vessel: HullVessel) -> list[tuple[str, str]]:
    raos, body = vessel.raos, vessel.body
    error = body.hydrodynamics.energy_error(body.roll_damping * body.critical_roll_damping)
    found = [
        (
            "table",
            f"{raos.omega.size} frequencies, {raos.omega[0]:.3g} to {raos.omega[-1]:.3g} rad/s, "
            f"{raos.heading.size} headings",
        ),
        (
            "panels",
            f"{vessel.hull.count}" + (", kept from an earlier run" if vessel.kept else ""),
        ),
        ("largest heave, roll, pitch", _largest(raos)),
    ]
    if math.isfinite(error):
        found.insert(2, ("waves made and felt", f"agree within {percent(error)}"))
    return found
