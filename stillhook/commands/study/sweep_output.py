"""What `stillhook sweep` prints and writes: summary, table, worst cases as case files, commands."""

from __future__ import annotations

import argparse
import json
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from models.spread import Spread

from ...sweeps import (
    ATTRIBUTE,
    STATUS,
    SweepSummary,
    case_at,
    varied_paths,
    worst_cases,
    write_result,
)
from ...text import OutputFolder, commands, count, number, quantity, scale
from ...text.terminal import _put, _table

if TYPE_CHECKING:
    import xarray as xr
    from rich.console import Console

    from .sweep import Swept

_FEW = 20_000  # cases up to which a CSV file is written too
_ROWS = (
    "payload_rms",
    "payload_significant",
    "velocity_rms",
    "torque_rms",
    "speed_rms",
    "max_sensitivity",
    "saturated_share",
    "tension_largest",
    "snap_load",
    "energy_per_hour",
)
_SHOWN = 12  # rows of the table at most


def write(swept: Swept, arguments: argparse.Namespace) -> list[Path]:
    """Write what there is into the folder; return the files, the case file of the worst first."""
    folder, result = OutputFolder(swept.folder), swept.result
    written = []
    worst = worst_cases(result, arguments.worst) if arguments.worst else []
    for stale in folder.path.glob("worst*.yaml"):
        folder.discard(stale.name)
    for place, case_number in enumerate(worst):
        name = "worst.yaml" if place == 0 else f"worst-{place + 1}.yaml"
        text = _heading(result, case_number) + case_at(result, case_number, swept.case).to_yaml()
        written.append(folder.write(name, text))
    spread = swept.spread
    if ATTRIBUTE in result.attrs:  # in plain numbers, as it was drawn
        spread = Spread.from_dict(json.loads(result.attrs[ATTRIBUTE])["spread"])
    written.append(folder.write("spread.yaml", spread.to_yaml()))
    summary = SweepSummary.of(result)
    text = json.dumps(_summary_dict(summary, result, worst), indent=2)
    written.append(folder.write("summary.json", text + "\n"))
    written.append(write_result(result, swept.folder / "cases.parquet"))
    if result.sizes["case"] <= _FEW:
        written.append(write_result(result, swept.folder / "cases.csv"))
    if result.attrs.get("mode") != "time":
        written.append(write_result(result, swept.folder / "result.nc"))
    if arguments.figures:
        written += _figures(swept)
    return written


def _figures(swept: Swept) -> list[Path]:
    """Draw and write the figures; return their files."""
    from synth.design import GainDesign, StructureDesign

    from ...sweeps import sweep_figures
    from ...text import picture

    linear = isinstance(swept.design, GainDesign | StructureDesign)
    in_time = swept.result.attrs.get("mode") == "time"
    design: Any = swept.design if linear and not in_time else None
    result = swept.result
    if in_time:
        result = result.isel(case=result["status"].to_numpy() != STATUS["not run"])
    figures = sweep_figures(result, design)
    folder = OutputFolder(swept.folder)
    return [folder.write(f"{n}.png", picture(f, "png")) for n, f in figures.items()]


def show(swept: Swept, written: list[Path], arguments: argparse.Namespace, out: Console) -> None:
    """Print what the sweep says."""
    result = swept.result
    summary = SweepSummary.of(result)
    told = ", ".join(varied_paths(result))
    title = f"{swept.case.name}: {count(summary.cases, 'case')}, varying {told}"
    out.print(title, style="bold", soft_wrap=True)
    for sentence in summary.sentences:
        out.print(sentence, soft_wrap=True)
    for message in list(result.attrs.get("messages", []))[:3]:
        out.print(message, style="dim", soft_wrap=True)
    if arguments.quiet:
        return
    out.print()
    names = [name for name in _ROWS if name in summary.quantiles]
    names += [name for name in summary.quantiles if name not in names]
    those = "of those that hold" if summary.in_time else "of those stable"
    table = _table(those, "5 %", "median", "95 %", "largest", "unit", left=(0, 5))
    for name in names[:_SHOWN]:
        values, unit = summary.quantiles[name], summary.units[name]
        factor, shown = scale(unit, max(abs(value) for value in values))
        figures = (number(value / factor) for value in values)
        table.add_row(name.replace("_", " "), *figures, "" if unit == "1" else shown)
    _put(table, out)
    worst = worst_cases(result, arguments.worst) if arguments.worst else []
    if worst:
        out.print()
        _show_worst(result, worst, out)
    out.print()
    more = len([p for p in written if p.name.startswith("worst")])
    files = [p.name for p in written if not p.name.startswith("worst-")]
    also = f" to worst-{more}.yaml" if more > 1 else ""
    listed = ", ".join(name + also if name == "worst.yaml" else name for name in files)
    out.print(f"Written to {swept.folder}: {listed}", soft_wrap=True)
    commands(_next(swept, worst, arguments), out)


def _show_worst(result: xr.Dataset, worst: list[int], out: Console) -> None:
    """Write the worst cases, a line each."""
    out.print("The worst:", style="bold")
    for case_number in worst:
        at = _at(result, case_number)
        rms = float(result["payload_rms"].to_numpy()[at])
        values = []
        for path in varied_paths(result):
            unit = str(result[path].attrs.get("units", "")).removeprefix("1")
            shown = quantity(float(result[path].to_numpy()[at]), unit)
            values.append(f"{path.rpartition('.')[2].replace('_', ' ')} {shown}")
        moves = "" if math.isnan(rms) else f", payload {quantity(rms, 'm')} rms"
        told = f"{_status_of(result, at)}{moves}: {', '.join(values)}"
        out.print(f"  case {case_number}: {told}", soft_wrap=True)


def _status_of(result: xr.Dataset, at: int) -> str:
    if "status" in result:
        code = int(result["status"].to_numpy()[at])
        return next(name for name, value in STATUS.items() if value == code)
    return "stable" if int(result["stable"].to_numpy()[at]) == 1 else "unstable"


def _at(result: xr.Dataset, case_number: int) -> int:
    return int((result["case"].to_numpy() == case_number).argmax())


def _heading(result: xr.Dataset, case_number: int) -> str:
    """Return the first lines of a case file: which case it is, and how it is run again."""
    at = _at(result, case_number)
    lines = [f"# Case {case_number} of a sweep: {_status_of(result, at)}."]
    if "seed" in result.coords:
        lines.append(f"# Its run has the seed {int(result['seed'].to_numpy()[at])}.")
    other = [p for p in varied_paths(result) if p.startswith("fault.")]
    for path in other:
        value = float(result[path].to_numpy()[at])
        lines.append(f"# Not part of a case file: {path} = {value:.8g}")
    return "\n".join(lines) + "\n"


def _summary_dict(summary: SweepSummary, result: xr.Dataset, worst: list[int]) -> dict[str, Any]:
    stable = summary.stable
    return {
        "cases": summary.cases,
        "stable": {
            "count": stable.count,
            "share": stable.value,
            "low_95": stable.low,
            "high_95": stable.high,
        },
        "statuses": dict(summary.statuses),
        "quantiles": {
            name: dict(zip(("q05", "q50", "q95", "largest"), values, strict=True))
            | {"unit": summary.units[name]}
            for name, values in summary.quantiles.items()
        },
        "worst": worst,
        "seconds": result.attrs.get("seconds"),
        "seconds_in_cases": result.attrs.get("seconds_in_cases"),
    }


def _next(swept: Swept, worst: list[int], arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """Return the commands to go on with."""
    folder = swept.folder
    found = []
    if worst:
        file = shlex.quote(str(folder / "worst.yaml"))
        found.append(("what the worst case would take", f"stillhook optimise {file}"))
        if swept.result.attrs.get("mode") == "time":
            at = _at(swept.result, worst[0])
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
