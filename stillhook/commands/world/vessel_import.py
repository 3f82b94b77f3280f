"""`stillhook vessel import`: read a RAO file, say what it is and if it can be true, keep it."""

from __future__ import annotations

import argparse
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from models.basics import InputError
from models.vessel.readers import LongWaveCheck, check_long_waves, read_raos, write_raos

from ...text import OutputFolder, commands, console, folder_name, pairs, told_once
from ...text.terminal import _put, _table

if TYPE_CHECKING:
    from models.vessel import VesselRaos


def run(arguments: argparse.Namespace) -> int:
    """Read, check, show and write; return 0."""
    with told_once():
        raos = read_raos(
            arguments.file,
            file_format=arguments.format,
            speed=arguments.speed,
            body=_body(arguments.body),
            length=arguments.length,
            depth=arguments.depth,
            origin=_point(arguments.origin),
            vessel_type=arguments.vessel_type,
            draught=arguments.draught,
            roll_damping=arguments.roll_damping,
            waves=arguments.waves,
            symmetry=arguments.symmetry,
            check=arguments.check,
        )
    check = check_long_waves(raos)
    table, written = _write(raos, arguments)
    out = console()
    verdict = _verdict(check)
    if arguments.quiet:
        out.print(f"{raos.name}: {verdict}", soft_wrap=True)
        return 0
    out.print(f"{raos.name}: {arguments.file}", style="bold", soft_wrap=True)
    mark = "ok" if check.ok else "DOUBTFUL" if check.long else "not checked"
    out.print(f"{mark}: {verdict}", soft_wrap=True)
    out.print()
    pairs(_facts(raos), out)
    out.print()
    out.print("Found and converted:", style="bold")
    for note in raos.notes:
        out.print(f"  - {note}", soft_wrap=True)
    out.print()
    _show_check(check)
    out.print()
    out.print(f"Written: {', '.join(str(path) for path in written)}", soft_wrap=True)
    file = shlex.quote(str(table))
    commands(
        [
            (
                "a hook abaft to starboard, in waves from 30 deg to starboard of the bow",
                f"stillhook motion subsea-crane --set vessel.raos={file} "
                "--set 'vessel.heading=150 deg' --set vessel.hook.x=-25 --set vessel.hook.y=-15",
            ),
            ("a case file of your own, with `raos:` and `hook:`", "stillhook new my.yaml"),
        ],
        out,
    )
    return 0


def _body(word: str | None) -> int | str | None:
    return int(word) if word is not None and word.isdigit() else word


def _point(text: str | None) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if len(found) != 3:
        raise InputError(f"vessel: --origin must be 3 numbers [m], as in -5.4,0,0; got {text!r}")
    return found


def _write(raos: VesselRaos, arguments: argparse.Namespace) -> tuple[Path, list[Path]]:
    """Write the table and the picture; return the table's path, and all of them."""
    from ...seas import rao_figure
    from ...text import picture

    target = Path(arguments.out or Path("out") / folder_name(raos.name))
    alone = target.suffix.lower() in {".csv", ".nc"}
    folder = OutputFolder.prepare(target.parent if alone else target)
    table = target if alone else folder.path / "raos.csv"
    if table.exists() and Path(arguments.file).exists() and table.samefile(arguments.file):
        raise InputError(f"{table}: is the file itself; --out must name another")
    written = [write_raos(table, raos)]
    figure = rao_figure(raos)
    written += [
        folder.write(f"{table.stem}.{kind}", picture(figure, kind)) for kind in ("svg", "png")
    ]
    return table, written


def _verdict(check: LongWaveCheck) -> str:
    where = f"long waves ({check.omega:.3g} rad/s, {check.wave_length:.0f} m)"
    if check.mistake:
        return f"in {where} the motions look like {check.mistake}"
    if check.ok:
        return f"in {where} it heaves with the water and turns with its slope"
    return check.remarks[0] if check.remarks else f"in {where} it does not move as the water does"


def _facts(raos: VesselRaos) -> list[tuple[str, str]]:
    omega, heading = raos.omega, raos.heading_deg
    x, y, z = raos.origin
    gaps = np.diff([*raos.heading, raos.heading[0] + 2.0 * math.pi])
    gap = math.degrees(float(np.max(gaps)))
    return [
        (
            "frequencies",
            f"{omega.size}, {omega[0]:.3g} to {omega[-1]:.3g} rad/s "
            f"(periods {2.0 * math.pi / omega[-1]:.3g} to {2.0 * math.pi / omega[0]:.3g} s)",
        ),
        (
            "headings",
            f"{heading.size}, {heading[0]:.4g} to {heading[-1]:.4g} deg, at most {gap:.4g} deg "
            "apart (0 following, 90 to port, 180 head)",
        ),
        ("motions of the point", f"x {x:g} m forward, y {y:g} m to port, z {z:g} m up"),
        ("water depth", "deep" if math.isinf(raos.depth) else f"{raos.depth:g} m"),
        ("forward speed", f"{raos.speed:g} m/s"),
        ("largest heave, roll, pitch", _largest(raos)),
    ]


def _largest(raos: VesselRaos) -> str:
    texts = []
    for mode, factor, unit in (
        ("heave", 1.0, "m/m"),
        ("roll", math.degrees(1.0), "deg/m"),
        ("pitch", math.degrees(1.0), "deg/m"),
    ):
        size = np.abs(raos.mode(mode)) * factor
        row, column = np.unravel_index(int(np.argmax(size)), size.shape)
        period = 2.0 * math.pi / raos.omega[row]
        texts.append(
            f"{mode} {size[row, column]:.3g} {unit} ({period:.3g} s, "
            f"{raos.heading_deg[column]:.4g} deg)"
        )
    return ", ".join(texts)


def _show_check(check: LongWaveCheck) -> None:
    out = console()
    out.print(f"Long waves, {check.omega:.3g} rad/s; angles over the wave slope:", style="bold")
    table = _table("heading", "motion", "found", "phase", "expected", "phase", "", left=(1, 6))
    for row in check.rows:
        table.add_row(
            f"{row.heading_deg:.0f} deg",
            row.motion,
            f"{abs(row.found):.3f}",
            _phase(row.found),
            f"{abs(row.expected):.3f}",
            _phase(row.expected),
            row.verdict,
        )
    _put(table, out)


def _phase(value: complex) -> str:
    if abs(value) < 1e-9:
        return "-"
    degrees = math.degrees(math.atan2(value.imag, value.real))
    # -180 and 180 are one; so are 0 and -0.
    rounded = round(degrees)
    return f"{180 if rounded == -180 else rounded + 0} deg"
