"""What there is to say about runs, in a line or two: how they ended, and what came of them."""

from __future__ import annotations

import math
from collections import Counter

from ..text import count, duration, number
from .runs import Runs
from .table import main_quantity, rows_of


def headline_of(runs: Runs) -> str:
    """Return what was simulated, and how it ended."""
    what = f"{runs.case.name}, {runs.controller}, {runs.scenario.name}"
    lasting = duration(runs[0].duration)
    return f"{what}: {count(len(runs), 'run')} of {lasting}, {outcome(runs)}"


def outcome(runs: Runs) -> str:
    """Return how many runs completed, diverged or were interrupted."""
    if runs.completed:
        return "all completed" if len(runs) > 1 else "completed"
    found = Counter(run.status for run in runs)
    return ", ".join(f"{n} {status}" for status, n in found.items())


def tree(runs: Runs) -> list[str]:
    """Return the lines that stand under the headline."""
    rows = {row.name: row for row in rows_of([runs])}

    def told(name: str) -> str:
        row = rows.get(name)
        if row is None or not row.figures[0].known:
            return ""
        interval = row.interval(0)
        return f"{row.full(0)} ({interval})" if interval else row.full(0)

    main = main_quantity([runs])
    lines = []
    if main in rows:
        label = rows[main].label.replace(", rms", "")
        residual = f", residual {told('residual')} of the hook's motion" if told("residual") else ""
        lines.append(f"{label} {told(main)} rms{residual}")
    for name, label in (("lost lock", "lock lost"), ("slack", "slack rope")):
        share = runs.summary.shares.get(name)
        if share is not None and share.count:
            lines.append(f"{label} in {share.count} of {count(share.total, 'run')}")
    if runs.tripped:
        lines.append(f"ended by the brake: {runs.tripped} of {count(len(runs.judged), 'run')}")
    for name in ("touch-down speed", "snap load"):
        if told(name):
            lines.append(f"{rows[name].label} {told(name)}")
    if told("motor torque rms"):
        largest = told("motor torque largest")
        lines.append(f"motor torque {told('motor torque rms')} rms, {largest} at most")
    fallbacks = sum(sum(run.timings.fallbacks.values()) for run in runs)
    if fallbacks:
        lines.append(f"{count(fallbacks, 'command')} of the controller could not be used")
    return [*lines, speed_of(runs)]


def speed_of(runs: Runs) -> str:
    """Return how fast the runs were."""
    wall = sum(run.timings.wall_seconds for run in runs)
    simulated = sum(run.statistics.end for run in runs if math.isfinite(run.statistics.end))
    how = "compiled" if runs[0].compiled else "not compiled"
    return f"{how}, {number(simulated / max(wall, 1e-9), 2)} times real time"
