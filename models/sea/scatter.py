"""Scatter diagrams: the occurrence of sea states.

A diagram is a list of sea states with their share of the time, whether it came as a list, as a
matrix of H_s against period, or from the records of a buoy.  `models.sea.scatter_files` reads
and writes the files; operability studies and families of cases use the list.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_finite, check_range


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """Sea states and how often each occurs.

    Raises InputError if the columns have unequal lengths, a value is out of range, or nothing
    occurs.

    Examples
    --------
    >>> site = Scatter(significant_height=[1.0, 2.0], peak_period=[6.0, 8.0], occurrence=[30, 10])
    >>> [round(float(p), 3) for p in site.occurrence]
    [0.75, 0.25]
    >>> round(site.share_below(1.5), 3)
    0.75
    """

    significant_height: FloatArray  #: H_s (n,), n >= 1 [m].
    peak_period: FloatArray  #: T_p (n,) [s].
    #: Share of the time (n,) [-]; given as shares, per cent or counts, kept so that they add up to
    #: one.
    occurrence: FloatArray
    #: Month of each state, 1 to 12 (n,), or None where the diagram is for the whole year.
    month: npt.NDArray[Any] | None = None
    #: Direction that the waves travel towards, counter-clockwise from the bow (or, of a site, from
    #: the axis that its file says) (n,) [rad], or None.
    heading: FloatArray | None = None
    source: str = "scatter diagram"  #: Where the diagram comes from.
    #: What the occurrences added up to when they were given: the number of records, or 100.
    total: float = math.nan

    def __post_init__(self) -> None:
        """Check the columns, drop what never occurs and make the occurrences shares."""
        columns = {
            name: check_finite(self.source, name, getattr(self, name))
            for name in ("significant_height", "peak_period", "occurrence", "month", "heading")
            if getattr(self, name) is not None
        }
        rows = columns["significant_height"].size
        for name, column in columns.items():
            if column.shape != (rows,):
                raise InputError(
                    f"{self.source}: {name} must have as many entries as significant_height "
                    f"({rows}), got {column.size}"
                )
        _check_all(self.source, "occurrence", columns["occurrence"], low=0.0)
        happens = columns["occurrence"] > 0.0
        if not np.any(happens):
            raise InputError(
                f"{self.source}: must have at least one row with an occurrence above 0"
            )
        columns = {name: column[happens] for name, column in columns.items()}
        for name, high, unit in (("significant_height", 30.0, "m"), ("peak_period", 60.0, "s")):
            limits = {"low": 0.0, "high": high, "open_low": True}
            _check_all(self.source, name, columns[name], unit=unit, **limits)
        month = columns.get("month", np.ones(1))
        if np.any(month != np.round(month)) or np.any(month < 1) or np.any(month > 12):
            raise InputError(f"{self.source}: month must be whole numbers in [1, 12]")
        total = float(columns["occurrence"].sum())
        if not math.isfinite(total):
            raise InputError(f"{self.source}: the occurrences must have a finite sum, got {total}")
        columns["occurrence"] = columns["occurrence"] / total
        for name, column in columns.items():
            whole = column.astype(np.int64) if name == "month" else column
            whole.setflags(write=False)
            object.__setattr__(self, name, whole)
        if math.isnan(self.total):
            object.__setattr__(self, "total", total)

    def __len__(self) -> int:
        """Return the number of sea states."""
        return int(self.significant_height.size)

    @property
    def mean_significant_height(self) -> float:
        """Mean H_s [m]."""
        return float(self.occurrence @ self.significant_height)

    def share_below(self, significant_height: float) -> float:
        """Return the share of the time with an H_s of at most that given [m]."""
        return float(self.occurrence[self.significant_height <= significant_height].sum())

    def binned(self, *, height_step: float = 0.5, period_step: float = 1.0) -> Scatter:
        """Return the diagram on classes of H_s [m] and T_p [s], each state at its class's centre.

        Months and headings stay apart where there are months; headings fall into 30 degrees.  The
        first classes begin at zero.
        """
        check_range(self.source, "height_step", height_step, low=0.0, unit="m", open_low=True)
        check_range(self.source, "period_step", period_step, low=0.0, unit="s", open_low=True)
        keys = [
            np.floor(self.significant_height / height_step),
            np.floor(self.peak_period / period_step),
        ]
        turn = math.pi / 6.0
        if self.month is not None:
            keys.append(self.month.astype(np.float64))
        if self.heading is not None:
            keys.append(np.round(np.mod(self.heading, 2.0 * math.pi) / turn) % 12)
        classes, which = np.unique(np.stack(keys, axis=1), axis=0, return_inverse=True)
        share = np.zeros(len(classes))
        np.add.at(share, which.ravel(), self.occurrence)
        return Scatter(
            significant_height=(classes[:, 0] + 0.5) * height_step,
            peak_period=(classes[:, 1] + 0.5) * period_step,
            occurrence=share,
            month=None if self.month is None else classes[:, 2].astype(np.int64),
            heading=None if self.heading is None else turn * classes[:, -1],
            source=self.source,
            total=self.total,
        )

    @classmethod
    def from_records(
        cls,
        significant_height: npt.ArrayLike,
        peak_period: npt.ArrayLike,
        *,
        month: npt.ArrayLike | None = None,
        heading: npt.ArrayLike | None = None,
        height_step: float | None = 0.5,
        period_step: float | None = 1.0,
        source: str = "records",
    ) -> Scatter:
        """Return the diagram of equally long records; `SeaRecords.scatter` calls this.

        Parameters
        ----------
        significant_height, peak_period
            H_s and T_p of each record (n,) [m], [s]; a record where one is not a number is left
            out.
        month, heading
            Month and heading [rad] of each record (n,).
        height_step, period_step
            Widths of the classes [m], [s]; None keeps every record as a state of its own.
        source
            Name for the messages.
        """
        height = np.asarray(significant_height, dtype=np.float64)
        period = np.asarray(peak_period, dtype=np.float64)
        keep = np.isfinite(height) & np.isfinite(period) & (height > 0.0) & (period > 0.0)
        every = cls(
            significant_height=height[keep],
            peak_period=period[keep],
            occurrence=np.ones(int(keep.sum())),
            month=None if month is None else np.asarray(month, dtype=np.int64)[keep],
            heading=None if heading is None else np.asarray(heading, dtype=np.float64)[keep],
            source=source,
        )
        if height_step is None or period_step is None:
            return every
        return every.binned(height_step=height_step, period_step=period_step)

    def matrix(
        self, height_step: float = 0.5, period_step: float = 1.0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the diagram as a matrix of shares (r, c) [-] over all months and headings.

        Before it come the edges of the classes of such widths, (r + 1,) [m] and (c + 1,) [s].
        """
        rows = math.floor(float(self.significant_height.max()) / height_step) + 1
        first = math.floor(float(self.peak_period.min()) / period_step)
        last = math.floor(float(self.peak_period.max()) / period_step) + 1
        heights = height_step * np.arange(rows + 1.0)
        periods = period_step * np.arange(float(first), last + 1.0)
        table, _, _ = np.histogram2d(
            self.significant_height,
            self.peak_period,
            bins=(heights, periods),
            weights=self.occurrence,
        )
        return heights, periods, table


def _check_all(owner: str, name: str, values: FloatArray, **limits: Any) -> None:
    """Check a column, naming the first row that is out of range."""
    for row, value in enumerate(values.tolist(), start=1):
        check_range(f"{owner}: row {row}", name, value, **limits)
