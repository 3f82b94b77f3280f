"""Failure modes as a table of figures, a sheet in words, a report, and plain data.

    FailureModes --> failure_table, failure_sheet --> Table;  failure_report --> Report
                 --> failure_data --> JSON

The table compares figures, the sheet is what an analysis of failure modes and effects asks for, the
report has both in the width of a terminal.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..text import (
    Column,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    count,
    duration,
    json_data,
    listed,
    number,
)
from .failure_effects import AFTER, FIRST, SAME, Afterwards, FirstSeconds
from .failures import BACK, RETURN, FailureMode, FailureModes, headline, references

FORMAT = 1  #: Version of the format of the data.

_RULE = (
    f"severity: none up to {SAME:g} times the undisturbed distances, minor up to those with the "
    "drum held, major beyond; critical where the rope went slack or beyond its limit, lock was "
    "lost, the brake had to stop the drum or a run diverged, unless undisturbed as well"
)


def failure_table(modes: FailureModes) -> Table:
    """Return distances, speeds, tensions and severities: a row for each failure, SI units.

    The worst of the seeds, rms over all of them; empty cells where nothing was run.  Above them
    stand the load undisturbed and the load with the drum held.
    """
    undisturbed, held = modes.undisturbed, modes.held
    rows: list[Sequence[Any]] = [
        ("undisturbed", *_cells(undisturbed.first, undisturbed.after), None, ""),
        ("drum held", *_cells(held.first, held.after), None, ""),
    ]
    rows += [_row(mode) for mode in modes.modes]
    reasons = dict.fromkeys(mode.not_run for mode in modes.modes if not mode.ran)
    unrun = (
        f"{listed([mode.identifier for mode in modes.modes if mode.not_run == why])}: {why}"
        for why in reasons
    )
    return Table(
        title="failure",
        columns=(
            Column("failure", ""),
            _column("first_largest", "in 5 s\n[m]", "m"),
            _column("first_speed", "speed\n[m/s]", "m/s"),
            _column("first_tension_least", "rope\n[kN]", "N", 1e3),
            _column("first_tension_largest", "to\n[kN]", "N", 1e3),
            _column("rms", "then rms\n[m]", "m"),
            _column("largest", "at most\n[m]", "m"),
            _column("back", "back\n[s]", "s"),
            Column("severity", left=True),
        ),
        rows=rows,
        notes=(
            f"in 5 s: distance from its place, speed and rope tension at the drum up to "
            f"{duration(FIRST)} after the failure; then: up to {duration(AFTER)} after its end",
            f"back: so long after its end the rms over a peak period is {BACK:g} times the "
            "undisturbed at most",
            _RULE,
            *unrun,
        ),
        broken=tuple(k for k, row in enumerate(rows) if row[-1] == "critical"),
    )


def failure_sheet(modes: FailureModes) -> Table:
    """Return the sheet of the analysis: what fails and how, how it shows, effect, safeguard."""
    return Table(
        title="what fails",
        columns=columns(
            "item=what fails; failure=how <; severity=severity <; effect=what the load does <; "
            "shows=how it shows <; safeguard=safeguard <"
        ),
        rows=[
            (
                mode.item,
                mode.failure,
                mode.severity or "-",
                mode.effect or mode.not_run,
                mode.shows or "-",
                mode.safeguard or "-",
            )
            for mode in modes.modes
        ],
        notes=(_RULE,),
        broken=tuple(k for k, mode in enumerate(modes.modes) if mode.severity == "critical"),
    )


def failure_report(modes: FailureModes) -> Report:
    """Return what the load does when one thing at a time fails, for 80 columns."""
    name, _, about = headline(modes).partition(": ")
    critical = [mode.identifier for mode in modes.modes if mode.severity == "critical"]
    told = f"{len(critical)} of {count(sum(mode.ran for mode in modes.modes), 'failure')} critical"
    return Report(
        name=name,
        about=about,
        status=f"{told}: {', '.join(critical)}" if critical else told,
        ok=not critical,
        sections=[
            ReportSection("", [*references(modes), failure_table(modes)]),
            *(
                ReportSection(
                    f"{mode.item}, {mode.failure}: {mode.severity}",
                    [mode.effect, f"shown by: {mode.shows}", f"safeguard: {mode.safeguard}"],
                )
                for mode in modes.modes
                if mode.ran
            ),
        ],
    )


def failure_data(modes: FailureModes) -> dict[str, Any]:
    """Return failure modes as plain data, SI: null for what was not run or did not occur."""
    data: dict[str, Any] = json_data(
        {
            "stillhook_failures": FORMAT,
            "case": modes.case.name,
            "controller": modes.controller,
            "seeds": modes.seeds,
            "moments": modes.moments,
            "lasting": modes.lasting,
            "duration": modes.duration,
            "complete": modes.complete,
            "undisturbed": asdict(modes.undisturbed),
            "held": asdict(modes.held),
            "modes": [
                {**asdict(mode), "ends": math.isfinite(mode.lasting) if mode.ran else None}
                for mode in modes.modes
            ],
        }
    )
    return data


def _column(name: str, label: str, unit: str, size: float = 1.0) -> Column:
    """Return a column whose figures are written without their unit, so that they compare."""
    digits = 3 if size > 1.0 else 2
    return Column(name, label, unit=unit, write=lambda value: number(value / size, digits))


def _row(mode: FailureMode) -> Sequence[Any]:
    if mode.first is None or mode.after is None:
        return (mode.identifier, *(None,) * 7, "-")
    back: Any = mode.recovery
    if math.isinf(mode.lasting):
        back = Written(None, "held")
    elif back is None:
        back = Written(None, f"> {number(RETURN)}")
    return (mode.identifier, *_cells(mode.first, mode.after), back, mode.severity)


def _cells(first: FirstSeconds, after: Afterwards) -> tuple[float, ...]:
    return (
        first.largest,
        first.speed,
        first.drum_tension_least,
        first.drum_tension_largest,
        after.rms,
        after.largest,
    )
