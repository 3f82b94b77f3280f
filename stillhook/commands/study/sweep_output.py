"""Report, folder, figures and further commands of `stillhook sweep`."""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from models.spread import Spread

from ...sweeps import (
    ATTRIBUTE,
    STATUS,
    place_of,
    sweep_figures,
    sweep_report,
    varied_paths,
    worst_cases,
    write_sweep,
)
from ...text import OutputFolder, console, picture, show
from ..working import conclude

if TYPE_CHECKING:
    import xarray as xr

    from models import Case


@dataclass(frozen=True, kw_only=True, eq=False)
class Swept:
    """A sweep that was made: its case, what varied, and what came of it."""

    case: Case
    design: object
    spread: Spread
    result: xr.Dataset
    folder: Path
    words: str


def conclude_sweep(swept: Swept, arguments: argparse.Namespace) -> int:
    """Write and print what the sweep says; return the exit status."""
    result, most = swept.result, arguments.worst
    written = write_sweep(swept.folder, result, swept.case, swept.spread, worst=most)
    if arguments.figures:
        # Clouds of ten thousand points: as pixels, unless asked otherwise.
        written += _figures(swept, arguments.format or "png")
    report = sweep_report(result, swept.case.name, worst=most)
    if arguments.quiet:
        show(replace(report, sections=report.sections[:1]), console())
        return 0 if report.ok else 1
    worst = worst_cases(result, most) if most else []
    return conclude(
        report, arguments, written=written, following=lambda: _next(swept, worst, arguments)
    )


def _figures(swept: Swept, kind: str) -> list[Path]:
    """Draw and write the figures; return their files."""
    from synth.design import GainDesign, StructureDesign

    linear = isinstance(swept.design, GainDesign | StructureDesign)
    in_time = swept.result.attrs.get("mode") == "time"
    design: Any = swept.design if linear and not in_time else None
    result = swept.result
    if in_time:
        result = result.isel(case=result["status"].to_numpy() != STATUS["not run"])
    figures = sweep_figures(result, design)
    folder = OutputFolder(swept.folder)
    return [folder.write(f"{n}.{kind}", picture(f, kind)) for n, f in figures.items()]


def _next(swept: Swept, worst: list[int], arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """Return the commands to go on with."""
    folder = swept.folder
    found = []
    if worst:
        file = shlex.quote(str(folder / "worst.yaml"))
        found.append(("what the worst case would take", f"stillhook optimise {file}"))
        if swept.result.attrs.get("mode") == "time":
            at = place_of(swept.result, worst[0])
            seed = int(swept.result["seed"].to_numpy()[at])
            words = ["stillhook simulate", file, *_controller_words(swept, arguments)]
            words.append(f"--first-seed {seed} --duration '{_duration(swept.result):g} s'")
            found.append(("see the worst case again", " ".join(words)))
    if swept.words and swept.result.attrs.get("mode") != "time":
        same = " ".join([swept.words, *_law_words(arguments)])
        again = f"--spread {shlex.quote(str(folder / 'spread.yaml'))}"
        place = shlex.quote(f"{folder}-time")
        command = f"stillhook sweep {same} --mode time --out {place}"
        if "drag" not in varied_paths(swept.result):
            command += f" {again}"
        found.append(("the same in time, with limits and slack rope", command))
    return found


def _duration(result: xr.Dataset) -> float:
    """Return the length of the runs [s]."""
    return float(json.loads(result.attrs[ATTRIBUTE])["duration"])


def _controller_words(swept: Swept, arguments: argparse.Namespace) -> list[str]:
    """Return the words for `stillhook simulate`; gains of a design stand in the case file."""
    header = json.loads(swept.result.attrs[ATTRIBUTE])["controller"]
    if header["kind"] == "name":
        return [] if header["name"] == "feedback" else [f"--controller {header['name']}"]
    return [] if header["law"]["kind"] == "gains" else _law_words(arguments)


def _law_words(arguments: argparse.Namespace) -> list[str]:
    if arguments.design is not None:
        return [f"--design {shlex.quote(arguments.design)}"]
    if arguments.gains is not None:
        return [f"--gains {shlex.quote(arguments.gains)}"]
    return []
