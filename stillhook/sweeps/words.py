"""Summary and worst cases of a sweep: how many hold, and how their numbers are distributed.

    Dataset --> SweepSummary.of, worst_cases --> the command line, reports

Cases that are not stable are counted, with the exact interval of Clopper and Pearson, and never
averaged in: every quantile is of those that hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from models.basics import Share, SolverError, check_range, pick, share

from .time_metrics import STATUS, UNKNOWN

if TYPE_CHECKING:
    import xarray as xr

QUANTILES = (0.05, 0.5, 0.95)  #: Shares of the stable cases that are below what is told.

_AFTER = {  # what a status says, after "1 case" and after "N cases"
    "diverged": ("diverged", "diverged"),
    "limit cycle": ("ended in a limit cycle", "ended in a limit cycle"),
    "brake": ("was stopped by the brake", "were stopped by the brake"),
    "failed": ("could not be run", "could not be run"),
    "died": (
        "is left out, its process was killed twice: it is tried again when the sweep goes on",
        "are left out, their processes were killed twice: they are tried again when the sweep "
        "goes on",
    ),
    "not run": ("was not run", "were not run"),
}
_NO_NUMBERS = ("stable", "status")


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepSummary:
    """What a sweep says."""

    cases: int  #: Number of cases that were run.
    stable: Share  #: Share of them that is stable, with its 95 % interval.
    statuses: Mapping[str, int]  #: How many ended otherwise, by status.
    #: By variable: quantiles of `QUANTILES` and the largest, of the stable cases.
    quantiles: Mapping[str, tuple[float, ...]]
    units: Mapping[str, str]  #: By variable.
    in_time: bool = True  #: Whether cases were run in time, or loops looked at.

    @classmethod
    def of(cls, result: xr.Dataset) -> SweepSummary:
        """Return the summary of a result.

        Raises SolverError if no case of it was run to its end.
        """
        ran = np.ones(result.sizes["case"], np.bool_)
        statuses: dict[str, int] = {}
        if "status" in result:
            codes = result["status"].to_numpy()
            ran = ~np.isin(codes, UNKNOWN)
            for name, code in STATUS.items():
                if name != "completed" and (count := int((codes == code).sum())):
                    statuses[name] = count
        if not ran.any():
            raise SolverError(f"sweep: no case was run to its end{_first_message(result)}")
        stable = (result["stable"].to_numpy() == 1) & ran
        quantiles, units = {}, {}
        for label, variable in result.data_vars.items():
            name = str(label)
            if name in _NO_NUMBERS or variable.dims != ("case",):
                continue
            values = np.asarray(variable.to_numpy()[stable], dtype=np.float64)
            values = values[~np.isnan(values)]
            if values.size == 0:
                continue
            found = (*np.quantile(values, QUANTILES), values.max())
            quantiles[name] = tuple(float(value) for value in found)
            units[name] = str(variable.attrs.get("units", "1"))
        return cls(
            cases=int(ran.sum()),
            stable=share(int(stable.sum()), int(ran.sum())),
            statuses=MappingProxyType(statuses),
            quantiles=MappingProxyType(quantiles),
            units=MappingProxyType(units),
            in_time="status" in result,
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say, in words."""
        s = self.stable
        low, high = (f"{100.0 * value:.4g}" for value in (s.low, s.high))
        what = "hold the payload" if self.in_time else "are stable"
        first = (
            f"{s.count} of {s.total} cases {what}: {100.0 * s.value:.4g} % "
            f"(95 % interval {low} to {high} %)"
        )
        others = [
            f"1 case {_AFTER[name][0]}" if count == 1 else f"{count} cases {_AFTER[name][1]}"
            for name, count in self.statuses.items()
        ]
        return first, *([", ".join(others)] if others else [])

    def __str__(self) -> str:
        """Return the summary as a small tree."""
        lines = [*self.sentences]
        for name, values in self.quantiles.items():
            figures = ", ".join(f"{value:.4g}" for value in values)
            lines.append(f"{name} [{self.units[name]}] 5, 50, 95 %, largest: {figures}")
        marks = ["", *["├ "] * (len(lines) - 2), "└ "] if len(lines) > 1 else [""]
        return "\n".join(mark + line for mark, line in zip(marks, lines, strict=True))


def _first_message(result: xr.Dataset) -> str:
    return "".join(f": {text}" for text in list(result.attrs.get("messages", []))[:1])


def worst_cases(result: xr.Dataset, count: int, *, by: str = "payload_rms") -> list[int]:
    """Return the numbers of so many of the worst cases, the worst first.

    Of two stable cases the one with the larger value is worse; one that is not stable is worse than
    all that are, and one that has no number there is worst.

    Raises InputError if there is no such variable.
    """
    check_range("worst cases", "count", count, low=1)
    pick("worst cases", "variable", tuple(str(name) for name in result.data_vars), (by,))
    values = np.asarray(result[by].to_numpy(), dtype=np.float64)
    stable = result["stable"].to_numpy() == 1
    number = result["case"].to_numpy()
    order = np.lexsort((number, -np.nan_to_num(values, nan=np.inf), stable))
    if "status" in result:  # of cases that were not run, or not to be run, nothing is known
        codes = result["status"].to_numpy()
        unknown = np.isin(codes, (*UNKNOWN, STATUS["failed"]))
        order = order[~unknown[order]]
    return [int(number[i]) for i in order[:count]]


def varied_paths(result: xr.Dataset) -> tuple[str, ...]:
    """Return what varied in a sweep, by path."""
    return tuple(str(name) for name in result.coords if str(name) not in ("case", "seed"))
