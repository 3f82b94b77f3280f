"""Seas as time series: H_s, T_p and direction hour by hour, of a buoy or a hindcast.

file -> `models.sea.series_files` -> account of what is no sea -> `SeaSeries` -> weather windows
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, ReadOnlyArrays
from .quality import HIGHEST_SEA, QualityControl, Rejection, TimeArray
from .scatter import Scatter

LONGEST_GAP = 3.0 * 3600.0  #: Time between two records up to which the first stands for it [s].
_LONGEST_PERIOD = 60.0  # T_p above which a record is no sea [s]
_MOST_BINS = 80  # of frequency: with more, periods are measured ones
_RECORDS_IN_A_BIN = 5  # on average, at least, where periods stand in bins
_PARTS = 10  # into which a bin's records are spread


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaSeries(ReadOnlyArrays):
    """Sea states in the order of time.

    Examples
    --------
    >>> hours = np.datetime64("2020-01-01T00") + np.arange(5)
    >>> year = SeaSeries.from_arrays(hours, [1.0, 0.8, 1.0, math.nan, 2.0], np.full(5, 7.0))
    >>> len(year), year.spans.tolist()
    (4, [3600.0, 3600.0, 7200.0, 3600.0])
    """

    time: TimeArray  #: Times, UTC, strictly ascending (n,).
    significant_height: FloatArray  #: H_s (n,) [m].
    peak_period: FloatArray  #: T_p (n,) [s].
    #: Direction that the waves come from, clockwise from north (n,) [rad], NaN where it is unknown;
    #: None where the file has none.
    direction: FloatArray | None
    quality: QualityControl  #: The account of what was read and rejected.
    source: str = "series"  #: The file.
    file_format: str = "arrays"  #: Its format, for people.

    def __len__(self) -> int:
        """Return the number of records."""
        return int(self.time.size)

    @classmethod
    def from_arrays(
        cls,
        time: npt.ArrayLike,
        significant_height: npt.ArrayLike,
        peak_period: npt.ArrayLike,
        direction: npt.ArrayLike | None = None,
        *,
        rejections: tuple[Rejection, ...] = (),
        notes: tuple[str, ...] = (),
        source: str = "series",
        file_format: str = "arrays",
    ) -> SeaSeries:
        """Return the records of arrays that are seas, in the order of time.

        Times are UTC (n,), H_s in m, T_p in s, the direction that waves come from in rad clockwise
        from north; NaN and NaT are what is missing.  `rejections` are what a reader left out.

        Raises InputError if the arrays have unequal lengths, or no record is left.
        """
        when = np.atleast_1d(np.asarray(time)).astype("datetime64[s]")
        height, period = (
            np.atleast_1d(np.asarray(values, dtype=np.float64))
            for values in (significant_height, peak_period)
        )
        bearing = None if direction is None else np.asarray(direction, dtype=np.float64)
        for name, column in (
            ("significant_height", height),
            ("peak_period", period),
            ("direction", when if bearing is None else bearing),
        ):
            if column.shape != when.shape:
                raise InputError(
                    f"{source}: {name} must have one value for each of the {when.size} times, got "
                    f"shape {column.shape}"
                )
        keep, found = _sifted(when, height, period)
        quality = QualityControl(
            read=when.size + sum(one.count for one in rejections),
            rejections=(*rejections, *found),
            notes=notes,
        )
        if not np.any(keep):
            raise InputError(f"{source}: no record is left after quality control: {quality}")
        order = np.flatnonzero(keep)
        order = order[np.argsort(when[order], kind="stable")]
        return cls(
            time=when[order],
            significant_height=height[order],
            peak_period=period[order],
            direction=None if bearing is None else np.mod(bearing[order], 2.0 * math.pi),
            quality=quality,
            source=source,
            file_format=file_format,
        )

    @property
    def usual_step(self) -> float:
        """The median of the steps of at most `LONGEST_GAP` [s]; NaN where there is none."""
        steps = np.diff(self.time).astype(np.float64)
        short = steps[steps <= LONGEST_GAP]
        return float(np.median(short)) if short.size else math.nan

    @property
    def spans(self) -> FloatArray:
        """How long each record stands for the sea (n,) [s].

        Until the next one; before a gap of more than `LONGEST_GAP`, and at the end, for the usual
        step.
        """
        steps = np.diff(self.time).astype(np.float64)
        usual = self.usual_step
        return np.append(np.where(steps <= LONGEST_GAP, steps, usual), usual)

    @property
    def month(self) -> npt.NDArray[np.int64]:
        """Month of each record, 1 to 12 (n,)."""
        return np.asarray(self.time.astype("datetime64[M]").astype(np.int64) % 12 + 1)

    def of(self, keep: npt.NDArray[np.bool_], reason: str) -> SeaSeries:
        """Return some of the records (n,); the account of the others gives the reason."""
        left = np.flatnonzero(~keep)
        found = Rejection(
            reason=reason, count=left.size, example=str(self.time[left[0]]).replace("T", " ")
        )
        return replace(
            self,
            time=self.time[keep],
            significant_height=self.significant_height[keep],
            peak_period=self.peak_period[keep],
            direction=None if self.direction is None else self.direction[keep],
            quality=replace(self.quality, rejections=(*self.quality.rejections, found)),
        )

    def relative(self, bow: float) -> FloatArray:
        """Return where the waves travel to, counter-clockwise from the bow (n,) [rad].

        The bow's compass heading is clockwise from north [rad].

        Raises InputError if the file has no directions.
        """
        if self.direction is None:
            raise InputError(f"{self.source}: has no directions for a vessel's compass heading")
        return relative_heading(bow, self.direction)

    def scatter(
        self, *, height_step: float | None = 0.5, period_step: float | None = 1.0
    ) -> Scatter:
        """Return the scatter diagram of the records on classes of such widths [m], [s].

        Where a width is None every record is a state of its own.  Where the periods stand in the
        bins of the file's spectra, those of a bin are taken to be spread evenly over it; without
        that, whole classes would have no sea and others twice their own.
        """
        period, share = self._spread_periods()
        times = share.shape[0]
        every = Scatter(
            significant_height=np.tile(self.significant_height, times),
            peak_period=period.ravel(),
            occurrence=share.ravel(),
            month=np.tile(self.month, times),
            source=self.source,
            total=float(len(self)),
        )
        if height_step is None or period_step is None:
            return every
        return every.binned(height_step=height_step, period_step=period_step)

    def _spread_periods(self) -> tuple[FloatArray, FloatArray]:
        """Return periods (k, n) [s] over which each record is spread, with its shares."""
        bins, which = np.unique(np.round(self.peak_period, 6), return_inverse=True)
        if not 2 < bins.size <= min(_MOST_BINS, len(self) // _RECORDS_IN_A_BIN):
            return self.peak_period[None], np.ones((1, len(self)))
        frequency = 1.0 / bins
        middle = 0.5 * (frequency[:-1] + frequency[1:])
        ends = 2.0 * frequency[[0, -1]] - middle[[0, -1]]
        edges = np.concatenate([ends[:1], middle, ends[1:]])
        along = (np.arange(_PARTS) + 0.5)[:, None] / _PARTS
        spread = 1.0 / (edges[which] + (edges[which + 1] - edges[which]) * along)
        return np.minimum(spread, _LONGEST_PERIOD), np.full(spread.shape, 1.0 / _PARTS)


def relative_heading(bow: float, direction: FloatArray) -> FloatArray:
    """Return where waves travel to, counter-clockwise from the bow [rad].

    They come from `direction`; it and the bow's heading are compass bearings, clockwise from north.

    Examples
    --------
    >>> [round(math.degrees(float(relative_heading(math.radians(90.0), math.radians(d)))))
    ...  for d in (90.0, 180.0)]  # on the bow; from the south, on starboard
    [180, 90]
    """
    return np.asarray(np.mod(bow - (direction + math.pi), 2.0 * math.pi))


def _sifted(
    time: TimeArray, height: FloatArray, period: FloatArray
) -> tuple[npt.NDArray[np.bool_], tuple[Rejection, ...]]:
    """Tell which records are seas (n,), and why the others are not."""
    left, found = np.ones(time.size, dtype=np.bool_), []
    seen = np.zeros(time.size, dtype=np.bool_)

    def reject(which: Any, reason: str) -> None:
        nonlocal left
        wrong = which & left
        if np.any(wrong):
            at = int(np.argmax(wrong))
            name = f"record {at}" if np.isnat(time[at]) else str(time[at]).replace("T", " ")
            found.append(Rejection(reason=reason, count=int(wrong.sum()), example=name))
            left = left & ~wrong

    reject(np.isnat(time), "no time")
    reject(~np.isfinite(height), "no H_s")
    reject(~np.isfinite(period), "no T_p")
    reject(height <= 0.0, "no waves (H_s 0)")
    reject(height > HIGHEST_SEA, f"H_s above {HIGHEST_SEA:g} m")
    reject((period <= 0.0) | (period > _LONGEST_PERIOD), f"T_p not in 0 to {_LONGEST_PERIOD:g} s")
    places = np.flatnonzero(left)
    _, first = np.unique(time[places], return_index=True)
    seen[places] = True
    seen[places[first]] = False
    reject(seen, "same time again")
    return left, tuple(found)
