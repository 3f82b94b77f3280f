"""The report of a sweep, and a folder with all of it: numbers, worst cases as case files, figures.

xarray.Dataset --> Report --> summary.json, worst.yaml, spread.yaml, cases, figures
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from synth.sweeps import case_of, spread_of

from ..text import (
    Item,
    OutputFolder,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    count,
    json_text,
    number,
    quantity,
    scale,
)
from .export import write_result
from .time_metrics import STATUS
from .words import SweepSummary, varied_paths, worst_cases

if TYPE_CHECKING:
    import xarray as xr

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
_FEW = 20_000  # cases up to which a CSV file is written too
_SHOWN = 12  # rows of the table at most


def sweep_report(result: xr.Dataset, name: str, *, worst: int = 0) -> Report:
    """Return what a sweep about the nominal case of a name says, and so many of the worst cases."""
    summary = SweepSummary.of(result)
    told = ", ".join(varied_paths(result))
    first, *others = summary.sentences
    items: list[Item] = [*others, *list(result.attrs.get("messages", []))[:3]]
    sections = [ReportSection("", items), ReportSection("", [_quantiles(summary)])]
    if worst:
        lines = [_worst(result, number) for number in worst_cases(result, worst)]
        sections.append(ReportSection("The worst", lines))
    return Report(
        name=name,
        about=f"{count(summary.cases, 'case')}, varying {told}",
        status=first,
        ok=bool((result["stable"] == 1).all()),
        sections=sections,
    )


def write_sweep(folder: str | Path, result: xr.Dataset, *, worst: int = 0) -> list[Path]:
    """Write a sweep into a folder, made if need be; return the files, so many worst cases' first.

    Raises InputError if a file cannot be written.
    """
    place = OutputFolder.prepare(folder)
    written = []
    numbers = worst_cases(result, worst) if worst else []
    place.discard("worst*.yaml")
    for rank, case_number in enumerate(numbers):
        name = "worst.yaml" if rank == 0 else f"worst-{rank + 1}.yaml"
        text = _heading(result, case_number) + case_of(result, case_number).to_yaml()
        written.append(place.write(name, text))
    written.append(place.write("spread.yaml", spread_of(result).to_yaml()))
    written.append(place.write("summary.json", json_text(sweep_data(result, numbers))))
    written.append(write_result(result, place.at("cases.parquet")))
    if result.sizes["case"] <= _FEW:
        written.append(write_result(result, place.at("cases.csv")))
    if result.attrs.get("mode") != "time":
        written.append(write_result(result, place.at("result.nc")))
    return written


def sweep_data(result: xr.Dataset, worst: list[int]) -> dict[str, Any]:
    """Return the summary of a sweep as plain data; `worst` are the numbers of the worst cases."""
    summary = SweepSummary.of(result)
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


def _quantiles(summary: SweepSummary) -> Table:
    names = [name for name in _ROWS if name in summary.quantiles]
    names += [name for name in summary.quantiles if name not in names]
    rows = []
    for name in names[:_SHOWN]:
        values, unit = summary.quantiles[name], summary.units[name]
        factor, shown = scale(unit, max(abs(value) for value in values))
        texts = (Written(value, number(value / factor)) for value in values)
        rows.append((name.replace("_", " "), *texts, "" if unit == "1" else shown))
    those = "of those that hold" if summary.in_time else "of those stable"
    heads = columns(f"name={those}; 5 %; median; 95 %; largest; unit <")
    return Table(columns=heads, rows=rows)


def _worst(result: xr.Dataset, case_number: int) -> str:
    """Return a case in a line."""
    at = place_of(result, case_number)
    rms = float(result["payload_rms"].to_numpy()[at])
    values = []
    for path in varied_paths(result):
        unit = str(result[path].attrs.get("units", "")).removeprefix("1")
        shown = quantity(float(result[path].to_numpy()[at]), unit)
        values.append(f"{path.rpartition('.')[2].replace('_', ' ')} {shown}")
    moves = "" if math.isnan(rms) else f", payload {quantity(rms, 'm')} rms"
    return f"case {case_number}: {_status_of(result, at)}{moves}: {', '.join(values)}"


def place_of(result: xr.Dataset, case_number: int) -> int:
    """Return where in a result a case stands."""
    return int((result["case"].to_numpy() == case_number).argmax())


def _status_of(result: xr.Dataset, at: int) -> str:
    if "status" in result:
        code = int(result["status"].to_numpy()[at])
        return next(name for name, value in STATUS.items() if value == code)
    return "stable" if int(result["stable"].to_numpy()[at]) == 1 else "unstable"


def _heading(result: xr.Dataset, case_number: int) -> str:
    """Return the first lines of a case file: which case it is, and how it is run again."""
    at = place_of(result, case_number)
    lines = [f"# Case {case_number} of a sweep: {_status_of(result, at)}."]
    if "seed" in result.coords:
        lines.append(f"# Its run has the seed {int(result['seed'].to_numpy()[at])}.")
    other = [p for p in varied_paths(result) if p.startswith("fault.")]
    for path in other:
        value = float(result[path].to_numpy()[at])
        lines.append(f"# Not part of a case file: {path} = {value:.8g}")
    return "\n".join(lines) + "\n"
