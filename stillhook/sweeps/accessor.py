"""The accessor `result.sweep`: summary, worst cases and tables of the Dataset of a sweep.

    result = sh.sweep(...);  result.sweep.summary(), .worst(5), .case(7), .to_csv("cases.csv")

An accessor of xarray's, as it recommends instead of a class of its own: the result stays a plain
Dataset for every other tool.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from models.case import Case
from synth.sweeps import case_of

from .export import table_of, write_result
from .words import SweepSummary, worst_cases

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]


@xr.register_dataset_accessor("sweep")  # type: ignore[no-untyped-call]
class SweepAccessor:
    """What can be asked of the result of a sweep, of what `sh.sweep` returned."""

    def __init__(self, result: xr.Dataset) -> None:
        self._result = result

    def summary(self) -> SweepSummary:
        """Return the share that is stable with its interval, and quantiles of every number."""
        return SweepSummary.of(self._result)

    def worst(self, count: int = 5, *, by: str = "payload_rms") -> list[int]:
        """Return the numbers of the worst cases: those not stable first, then by a variable."""
        return worst_cases(self._result, count, by=by)

    def case(self, number: int) -> Case:
        """Return a case of the sweep, to be designed for or run again."""
        return case_of(self._result, number)

    def table(self) -> pd.DataFrame:
        """Return a table with a row for each case."""
        return table_of(self._result)

    def to_csv(self, path: str | Path) -> Path:
        """Write a row for each case as CSV."""
        return write_result(self._result, Path(path).with_suffix(".csv"))

    def to_parquet(self, path: str | Path) -> Path:
        """Write a row for each case as Parquet."""
        return write_result(self._result, Path(path).with_suffix(".parquet"))
