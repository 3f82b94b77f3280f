"""Perfect preview, the predictor that has read the future, for reference only.

It shows what prediction costs: the same controller with this one and with `AdaptiveAR` differs
by the forecast alone.  Nothing of the kind exists on board.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from models.basics import FloatArray, InputError

from .forecast import Forecast, leads_of

if TYPE_CHECKING:
    from models.operation import Motion


_CHUNK = 4096  # samples read at once: a day at 1 ms would be 86 million rows


class PerfectPreview:
    """The hook's record itself, at now + leads up to a horizon [s]; standard deviation zero.

    Whoever runs a simulation hands over the record first, by `foresee`.  Between the record's
    rows it is the cubic that has their displacements and velocities (exact at the rows); before
    its first and beyond its last row it is held, with velocity zero.

    Raises InputError if a number is out of its range.
    """

    def __init__(self, *, sample_time: float, horizon: float) -> None:
        self.leads = leads_of("perfect preview", sample_time, horizon)
        self.sample_time = float(sample_time)
        self._certain = np.zeros(self.leads.size)
        self._certain.setflags(write=False)
        self._record: FloatArray | None = None
        self._time = math.nan

    def foresee(self, motion: Motion) -> None:
        """Take the record of the run that follows, row 0 at time 0; it is sampled here once."""
        last = math.floor((motion.rows - 1) * motion.step / self.sample_time + 1e-9)
        record = np.zeros((2, last + 1 + self.leads.size))
        for start in range(0, last + 1, _CHUNK):
            samples = np.arange(start, min(start + _CHUNK, last + 1))
            record[:, samples] = _sampled(
                motion, samples * np.float64(self.sample_time / motion.step)
            )
        record[0, last + 1 :] = record[0, last]
        record.setflags(write=False)
        self._record = record

    def reset(self) -> None:
        """Go back to before the first sample; the record stays."""
        self._time = math.nan

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take the time [s]; what the unit shows plays no part."""
        del heave, rate, valid
        self._time = float(time)

    def forecast(self) -> Forecast:
        """Return the record at now + leads.

        Raises InputError if there is no record, or no sample has come, or the time is no sample of
        the grid.
        """
        record, n = self._record, self.leads.size
        if record is None:
            raise InputError(
                "perfect preview: record must be given with foresee(motion) before a forecast, "
                "got none"
            )
        at = self._time / self.sample_time
        if not math.isfinite(at) or abs(at - round(at)) > 1e-6 * max(1.0, abs(at)):
            raise InputError(
                f"perfect preview: time must be a multiple of {self.sample_time:g} s, "
                f"got {self._time:g} s"
            )
        first = min(max(round(at), 0), record.shape[1] - n)
        stretch = record[:, first : first + n]
        return Forecast(stretch[0], stretch[1], self._certain, self._certain)


def _sampled(motion: Motion, at: FloatArray) -> FloatArray:
    """Return displacement and velocity (2, n) at ascending rows that need not be whole."""
    nearest = np.round(at)
    at = np.where(np.abs(at - nearest) < 1e-6, nearest, at)
    left = np.minimum(np.floor(at).astype(np.int64), max(motion.rows - 2, 0))
    first = int(left[0])
    count = min(int(left[-1]) + 2, motion.rows) - first
    z, v, _ = motion.block(first, count)
    x, h = at - left, motion.step
    i, j = left - first, np.minimum(left - first + 1, count - 1)
    bend = x * (1.0 - x)
    share = x**2 * (3.0 - 2.0 * x)
    value = z[i] + share * (z[j] - z[i]) + h * bend * ((1.0 - x) * v[i] - x * v[j])
    rate = 6.0 * bend / h * (z[j] - z[i])
    return np.array((value, rate + (1.0 - x) * (1.0 - 3.0 * x) * v[i] + x * (3.0 * x - 2.0) * v[j]))
