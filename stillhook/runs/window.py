"""Windows of a run: its envelope as a whole, and the minute that matters most.

A run has more samples than a figure has dots.  The envelope keeps every peak of what is stored;
the window is where the payload is farthest from where it should be, or where it touches down.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.basics import BoolArray, FloatArray
from models.run import Run

from .runs import TRIPS

LENGTH = 60.0  # of a window [s]

# Kinds of events after which the load may be elsewhere than it should be.
_TROUBLE = ("brake", "telemetry", "sensor", "mru", "parameter", "controller", *TRIPS)


@dataclass(frozen=True, kw_only=True)
class Window:
    """A part of a run, from `start` to `end` [s], and why it was chosen."""

    start: float
    end: float
    why: str

    def rows(self, time: FloatArray) -> slice:
        """Return the rows of the stored samples that lie in it."""
        first, last = np.searchsorted(time, (self.start - 1e-9, self.end + 1e-9))
        return slice(int(first), int(last))


def error_of(run: Run) -> FloatArray:
    """Return how far the payload is from what is asked of it (n,) [m]."""
    payload = run["payload.displacement"]
    if "reference.displacement" not in run:
        return payload
    with np.errstate(invalid="ignore"):  # a run that diverged ends in infinities
        error: FloatArray = payload - run["reference.displacement"]
    return error


def moves(run: Run) -> bool:
    """Return whether the payload is asked to be anywhere but in its place."""
    if "reference.displacement" not in run:
        return False
    asked = run["reference.displacement"]
    asked = asked[np.isfinite(asked)]
    return bool(asked.size and np.ptp(asked) > 0.0)


def whole_of(run: Run) -> Window:
    """Return all of a run."""
    last = float(run.time[-1]) if run.time.size else 0.0
    return Window(start=0.0, end=last, why="the whole operation")


def window_of(run: Run, length: float = LENGTH) -> Window:
    """Return the part of a run to look at closely, so long [s]; a shorter run is taken whole.

    Around the first touchdown if there is one; else around the first thing that went wrong: a
    fault, the end of the drum's travel, loss of lock; else around the largest error, once the run
    has settled.
    """
    if run.time.size == 0:
        return Window(start=0.0, end=0.0, why="nothing")
    last = float(run.time[-1])
    if last <= length:
        return Window(start=0.0, end=last, why="the whole run")
    touched = _time_of(run, "touch-down at")
    if not math.isnan(touched):
        return _around(touched, length, last, "touchdown")
    # What follows trouble is longer than what came before.
    ahead = 0.25 * length
    lost = _time_of(run, "lost lock at")
    trouble = next((event.time for event in run.events if event.kind in _TROUBLE), math.nan)
    if trouble <= lost or (math.isnan(lost) and not math.isnan(trouble)):
        return _around(trouble + ahead, length, last, f"about {trouble:.4g} s")
    if not math.isnan(lost):
        return _around(lost + ahead, length, last, "loss of lock")
    error = np.abs(error_of(run))
    error = np.where(np.isfinite(error), error, 0.0)
    settled = run.time >= min(run.statistics.settle, 0.5 * last)
    at = float(run.time[int(np.argmax(np.where(settled, error, -1.0)))])
    return _around(at, length, last, "largest error")


def envelope(time: FloatArray, values: FloatArray, bins: int) -> tuple[FloatArray, ...]:
    """Return times, lowest and highest values of a signal over `bins` parts of its samples (m,).

    With less than two samples (n,) to a part all are returned.  NaN is left out where there are
    others.
    """
    each = time.size // bins
    if each < 2:
        return time, values, values
    # The last part takes what is left over, so that no sample is lost.
    edges = np.arange(0, time.size - each + 1, each)
    return (
        time[edges] + 0.5 * each * (time[1] - time[0]),
        np.fmin.reduceat(values, edges),
        np.fmax.reduceat(values, edges),
    )


def runs_of_true(time: FloatArray, flag: BoolArray) -> list[tuple[float, float]]:
    """Return the periods in which a flag holds, from its first true sample to the next false."""
    if flag.size == 0:
        return []
    change = np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8))
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    last = time.size - 1
    return [
        (float(time[first]), float(time[min(int(beyond), last)]))
        for first, beyond in zip(starts.tolist(), ends.tolist(), strict=True)
    ]


def _time_of(run: Run, name: str) -> float:
    """Return when something happened first [s], NaN if it did not."""
    found = run.statistics.quantities.get(name)
    return math.nan if found is None else found.value


def _around(at: float, length: float, last: float, why: str) -> Window:
    start = min(max(0.0, at - 0.5 * length), last - length)
    return Window(start=start, end=start + length, why=why)
