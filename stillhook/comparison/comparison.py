"""`Comparison`: what contenders in the same seas came to, and how sure that is.

    cells --> Comparison --> table, worst_moment --> sentences, figures, report, folder

A row of the table is one contender in seas of one height.  An rms is the pooled one, of all seeds
together, and a ratio of two is that on the seeds that both have; their 95 % intervals are on a
log scale, so that they are never negative (`models.basics.pooled_interval`).  The payload's rms is
about its place, so that a load that has sunk does not count as still.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from models.basics import Interval, pooled_interval
from models.case import Case

from ..controllers import Contender, StoredDesign
from .cell import Cell, ComparisonQuestion, Trace

COLUMNS: Mapping[str, str] = {
    "payload rms": "m, pooled over seeds",
    "payload rms low": "m",
    "payload rms high": "m",
    "residual": "% of the hook's motion, both pooled over seeds",
    "residual low": "%",
    "residual high": "%",
    "residual held": "% of the payload's with the drum held, where `none` takes part",
    "over the best": "payload rms over that of the best, on the seeds of both",
    "over the best low": "",
    "over the best high": "",
    "over the floor": "payload rms over that of the floor, on the seeds of both",
    "over the floor low": "",
    "over the floor high": "",
    "worst seed": "",
    "worst seed rms": "m",
    "significant": "m",
    "largest": "m",
    "saturated": "% of the time",
    "torque rms": "N m",
    "energy": "J/h, net",
    "slack": "% of the time",
    "snap load": "N, largest of all seeds",
    "lost lock": "runs",
    "tripped": "runs ended by the brake",
    "overspeed trips": "runs",
    "rope-out trips": "runs",
    "diverged": "runs",
    "failed": "runs",
    "speed beyond": "% of the time beyond the motor's limit",
    "torque beyond": "% of the time beyond the peak; the plant allows none",
    "tension below": "% of the time below limits.minimum_tension",
    "tension above": "% of the time above limits.rope_tension_peak",
    "fallbacks": "commands replaced, of all seeds",
    "step median": "s, of a controller in Python",
    "step p99": "s",
    "step max": "s",
}
"""Columns of the table after contender, height and runs, with unit or meaning."""

CAUSAL = ("brake", "linear", "filter", "predictive", "own")
"""Groups of contenders that know what can be known."""

NOTHING = 1e-3
"""A floor below so much of the stillest contender's rms says nothing."""

_RUNS = {"overspeed trips": "overspeed", "rope-out trips": "rope-out"}
_BROKEN = {
    "speed beyond": "speed",
    "torque beyond": "torque",
    "tension below": "tension low",
    "tension above": "tension high",
}
# What a controller counts that is no command replaced: of a late plan the fallback is counted.
_NO_FALLBACKS = ("steps", "iterations", "late", "gated", "derated", "blind", "misfit")
_MEANS = {
    "significant": "payload significant",
    "largest": "tracking error largest",
    "saturated": "saturated share",
    "torque rms": "motor torque rms",
    "energy": "energy per hour, net",
    "slack": "slack share",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """What contenders came to."""

    case: Case  #: The case that they were made for.
    contenders: tuple[Contender, ...]  #: Who took part.
    heights: tuple[float, ...]  #: Significant heights of the seas [m].
    seeds: tuple[int, ...]
    question: ComparisonQuestion  #: What all were asked.
    cells: tuple[Cell, ...]  #: One for each run.
    #: Why a contender did not take part in seas of a height, by name and height.
    refused: Mapping[tuple[str, float], str] = field(default_factory=dict)
    #: Designs by contender and height.
    laws: Mapping[tuple[str, float], StoredDesign] = field(default_factory=dict)
    #: Time traces of the worst moment, one for each contender that has any.
    traces: tuple[Trace, ...] = ()
    complete: bool = True  #: Whether every run was made; False after Ctrl-C.
    seconds: float = math.nan  #: Time that it took [s].

    @cached_property
    def _groups(self) -> dict[tuple[str, float], list[Cell]]:
        found: dict[tuple[str, float], list[Cell]] = {}
        for cell in self.cells:
            found.setdefault((cell.contender, cell.height), []).append(cell)
        return found

    def of(self, name: str, height: float) -> Sequence[Cell]:
        """Return the runs of a contender in seas of a height [m]."""
        return tuple(self._groups.get((name, height), ()))

    def contender(self, name: str) -> Contender:
        """Return a contender by its name."""
        return next(each for each in self.contenders if each.name == name)

    def rms(self, name: str, height: float) -> Interval:
        """Return the payload's pooled rms about its place, and its interval [m]."""
        return pooled_interval([cell.rms for cell in self.of(name, height)], unit="m")

    def pooled(self, name: str, height: float) -> float:
        """Return the payload's pooled rms about its place [m]; NaN without a run."""
        return self.rms(name, height).mean

    def ratio(self, name: str, height: float, other: str | None) -> Interval:
        """Return the pooled rms over that of another, on the seeds that both have [1]."""
        return self._over(name, height, {c.seed: c.rms for c in self.of(other or "", height)})

    def residual(self, name: str, height: float) -> Interval:
        """Return the pooled rms over the hook's, which is the same for all in a sea [1]."""
        hook = {
            cell.seed: cell.quantities["hook rms"]
            for cell in self.cells
            if cell.height == height and "hook rms" in cell.quantities
        }
        return self._over(name, height, hook)

    def _over(self, name: str, height: float, others: Mapping[int, float]) -> Interval:
        cells = self.of(name, height)
        return pooled_interval(
            [c.rms for c in cells], [others.get(c.seed, math.nan) for c in cells]
        )

    def lost(self, name: str, height: float) -> int:
        """Return in how many runs the payload was lost: lock, brake, divergence, failure."""
        return sum(cell.lost for cell in self.of(name, height))

    def cliff(self, name: str) -> float:
        """Return the lowest height at which any run was lost [m]; NaN if there is none."""
        return next((h for h in self.heights if self.lost(name, h)), math.nan)

    @property
    def floor(self) -> Contender | None:
        """The clairvoyant floor, if it took part."""
        return next((each for each in self.contenders if each.group == "floor"), None)

    def floor_at(self, height: float) -> str | None:
        """Return the floor by its name; None where it is next to nothing, and says nothing."""
        best = self.best(height, CAUSAL)
        if self.floor is None or not self.of(self.floor.name, height):
            return None
        left = self.ratio(self.floor.name, height, best).mean
        return None if left < NOTHING else self.floor.name

    def best(self, height: float, groups: Sequence[str]) -> str | None:
        """Return who of some groups has the least pooled rms at a height; None if nobody has."""
        found = {
            each.name: self.pooled(each.name, height)
            for each in self.contenders
            if each.group in groups
        }
        known = {name: value for name, value in found.items() if math.isfinite(value)}
        if not known:
            return None
        # Equal but for the last digit: the one that was named first.
        least = min(known.values())
        return next(name for name, value in known.items() if value <= 1.001 * least)

    @cached_property
    def worst_moment(self) -> tuple[float, int, float] | None:
        """Height [m], seed and time [s] at which the best linear law was farthest off.

        In the highest sea of which there are runs; None if no linear law has any.
        """
        for height in reversed(self.heights):
            name = self.best(height, ("linear",))
            if name is None:
                continue
            cells = [cell for cell in self.of(name, height) if not math.isnan(cell.worst)]
            if cells:
                worst = max(cells, key=lambda cell: cell.quantities["tracking error largest"])
                return height, worst.seed, worst.worst
        return None

    @cached_property
    def table(self) -> Any:
        """Everything as a `pandas.DataFrame`: a row for each contender and height, SI units.

        Columns are ``contender``, ``height``, ``runs``, those of `COLUMNS`, and ``note``: why a
        contender did not take part, or how its design came about.
        """
        rows = [self._row(each, height) for each in self.contenders for height in self.heights]
        names = ["contender", "height", "runs", *COLUMNS, "note"]
        return import_module("pandas").DataFrame(rows, columns=names)

    def note(self, contender: Contender, height: float) -> str:
        """Return why a contender did not take part, or how its design came about."""
        if (contender.name, height) in self.refused:
            return self.refused[contender.name, height]
        cells = self.of(contender.name, height)
        failed = next((c.message for c in cells if c.status in ("failed", "died")), "")
        if failed:
            return failed
        law = self.laws.get((contender.name, height))
        if law is None:
            return ""
        how = "designed within the drive's limits"
        if law.drive == "reported":
            how = "designed without the drive's limits"
        return how if law.ok else f"{how}; {law.status}"

    def _row(self, contender: Contender, height: float) -> dict[str, Any]:
        name, cells = contender.name, self.of(contender.name, height)
        row: dict[str, Any] = {"contender": name, "height": height, "runs": len(cells)}
        row |= {"note": self.note(contender, height)}
        if not cells:
            return row
        for column, factor, found in (
            ("payload rms", 1.0, self.rms(name, height)),
            ("residual", 100.0, self.residual(name, height)),
            ("over the best", 1.0, self.ratio(name, height, self.best(height, CAUSAL))),
            ("over the floor", 1.0, self.ratio(name, height, self.floor_at(height))),
        ):
            row[column] = factor * found.mean
            row |= {f"{column} low": factor * found.low, f"{column} high": factor * found.high}
        row["residual held"] = 100.0 * self.ratio(name, height, "none").mean
        known = [cell for cell in cells if not math.isnan(cell.rms)]
        if known:
            worst = max(known, key=lambda cell: cell.rms)
            row |= {"worst seed": worst.seed, "worst seed rms": worst.rms}
        for column, quantity in _MEANS.items():
            row[column] = _mean([cell.quantities.get(quantity, math.nan) for cell in cells])
        snaps = [cell.quantities.get("snap load", math.nan) for cell in cells]
        row["snap load"] = max((x for x in snaps if not math.isnan(x)), default=math.nan)
        locks = [cell.quantities.get("lost lock at", math.nan) for cell in cells]
        row["lost lock"] = sum(not math.isnan(at) for at in locks)
        row["tripped"] = sum(bool(cell.trips) for cell in cells)
        row |= {column: sum(kind in c.trips for c in cells) for column, kind in _RUNS.items()}
        row["diverged"] = sum(cell.status == "diverged" for cell in cells)
        row["failed"] = sum(cell.status in ("failed", "died") for cell in cells)
        for column, limit in _BROKEN.items():
            row[column] = 100.0 * _mean([cell.broken.get(limit, math.nan) for cell in cells])
        row["fallbacks"] = sum(sum(cell.fallbacks.values()) for cell in cells) + sum(
            value for c in cells for kind, value in c.counts.items() if kind not in _NO_FALLBACKS
        )
        row["step median"] = _mean([cell.step.get("median", math.nan) for cell in cells])
        row["step p99"] = _mean([cell.step.get("p99", math.nan) for cell in cells])
        steps = [cell.step["max"] for cell in cells if cell.step]
        row["step max"] = max(steps, default=math.nan)
        return row

    def __str__(self) -> str:
        """Return the pooled rms of every contender as a small tree."""
        lines = [f"{self.case.name}: {len(self.contenders)} contenders, {len(self.seeds)} seeds"]
        for height in self.heights:
            rms = [(each.name, self.pooled(each.name, height)) for each in self.contenders]
            told = ", ".join(f"{name} {1e3 * x:.4g} mm" for name, x in rms if not math.isnan(x))
            lines.append(f"H_s {height:.4g} m: {told}")
        marks = ["", *["├ "] * (len(lines) - 2), "└ "]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan
