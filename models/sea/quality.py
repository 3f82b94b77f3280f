"""Quality control of measured seas: records that are no sea states, and the reasons.

A buoy's file holds rows that are no spectra: missing codes, empty rows, broken dates, the same hour
twice.  Each is rejected for one stated reason and counted, so that nothing disappears in silence.
Nothing is rejected for being large: densities of real storms exceed 300 m^2/Hz, and masking by a
threshold deletes the very storms that a design is for.  Only a whole sea state above 30 m of H_s,
half as high again as any ever measured, is taken for the error that it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray

TimeArray = npt.NDArray[np.datetime64]

HIGHEST_SEA = 30.0  #: H_s above which a record is rejected [m]; the highest on record is 19 m.


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """Records that were rejected for one reason."""

    reason: str  #: Why, as a sentence without its end.
    count: int  #: How many records.
    example: str  #: The first of them: its line, or its time.


@dataclass(frozen=True, kw_only=True, eq=False)
class RawRecords:
    """What a reader found, before quality control."""

    file_format: str  #: Name of the format, for people.
    time: TimeArray  #: Times, UTC (n,); NaT where the file has none.
    frequency: FloatArray  #: Frequencies, strictly ascending (k,) [Hz].
    density: FloatArray  #: Variance densities (n, k) [m^2/Hz], NaN where missing.
    #: Mean direction that the waves come from, clockwise from north (n,) [deg], or None.
    direction: FloatArray | None = None
    #: Where each record is from (n,), or empty where there is one place only.
    place: tuple[str, ...] = ()
    #: What to call each record in an account (n,), or empty to call it by its time.
    names: tuple[str, ...] = ()
    #: What the reader itself had to leave out, and what it noticed.
    rejections: tuple[Rejection, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class QualityControl:
    """What became of the records of a file."""

    read: int  #: How many records the file holds.
    rejections: tuple[Rejection, ...] = ()  #: What was rejected, in the order of the checks.
    notes: tuple[str, ...] = ()  #: What else was found and put right.

    @property
    def rejected(self) -> int:
        """How many records were rejected."""
        return sum(one.count for one in self.rejections)

    @property
    def kept(self) -> int:
        """How many records are left."""
        return self.read - self.rejected

    def __str__(self) -> str:
        """Return the account in a few lines."""
        lines = [f"{self.read} records read, {self.rejected} rejected, {self.kept} kept"]
        lines += [f"  {one.count} x {one.reason} (first: {one.example})" for one in self.rejections]
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])


def sift(
    omega: FloatArray, density: FloatArray, names: Sequence[str], same: Sequence[object]
) -> tuple[npt.NDArray[np.bool_], list[Rejection]]:
    """Tell which records are spectra (n,), and why the others are not.

    Densities (n, k) [m^2 s/rad] are NaN where a value is missing.  A record's name is its line or
    its time; the second with the `same` time and place is a repetition, and None is never one.
    """
    count = len(names)
    open_, found = np.ones(count, dtype=np.bool_), []

    def reject(which: npt.ArrayLike, reason: str) -> None:
        nonlocal open_
        wrong = np.asarray(which, dtype=np.bool_) & open_
        if np.any(wrong):
            first = names[int(np.argmax(wrong))]
            found.append(Rejection(reason=reason, count=int(wrong.sum()), example=first))
            open_ = open_ & ~wrong

    missing = ~np.isfinite(density)
    reject(missing.all(axis=1), "all values missing")
    reject(missing.any(axis=1), "some values missing")
    filled = np.where(missing, 0.0, density)
    reject((filled < 0.0).any(axis=1), "negative density")
    variance = np.trapezoid(filled, omega, axis=1)
    reject(~(variance > 0.0), "no energy")
    heights = 4.0 * np.sqrt(np.maximum(variance, 0.0))
    reject(heights > HIGHEST_SEA, f"H_s above {HIGHEST_SEA:g} m")
    seen: set[object] = set()
    repeated = np.zeros(count, dtype=np.bool_)
    for index, key in enumerate(same):
        if open_[index] and key is not None:
            repeated[index] = key in seen
            seen.add(key)
    reject(repeated, "same time and place again")
    return open_, found
