"""Statistics that grow with a run: each part takes the next samples and keeps only a few numbers.

The parts of `Accumulator` in `models/run/statistics.py`.  A run of a day has too many samples to
keep, so every part is fed stretch by stretch and remembers, of what went before, only what the
next stretch needs: sums, extremes, and the cycle or the slack rope that is still under way.
Means and variances are merged as in Chan, Golub and LeVeque (1983), which loses no digits when the
mean is large against the deviation, as a rope's tension is.
"""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray

SmallArray: TypeAlias = npt.NDArray[np.float32]


# Cycles gathered before they are put away together: numpy is slow on a few numbers at a time.
_CYCLES_AT_ONCE = 1024


class Moments:
    """Mean, variance, smallest and largest value of several signals, and when they came."""

    def __init__(self, count: int) -> None:
        self.samples = 0
        self.mean = np.zeros(count)
        self.squares = np.zeros(count)  # sum of squared deviations from the mean
        self.low, self.high = np.full(count, math.inf), np.full(count, -math.inf)
        self.low_at, self.high_at = np.full(count, -1), np.full(count, -1)
        self._apart = np.empty((count, 0))  # room for deviations: making it anew takes longer

    def add(self, values: FloatArray, first: int) -> None:
        """Take samples `values` (signals, n), the first of which is number `first` of the run."""
        n = values.shape[1]
        mean = values.mean(axis=1)
        if self._apart.shape != values.shape:
            self._apart = np.empty_like(values)
        apart = np.subtract(values, mean[:, np.newaxis], out=self._apart)
        step, total = mean - self.mean, self.samples + n
        self.squares += np.einsum("ij,ij->i", apart, apart) + step**2 * (self.samples * n / total)
        self.mean += step * (n / total)
        self.samples = total
        low, high = values.min(axis=1), values.max(axis=1)
        # A NaN is the extreme from where it came on.
        for i in np.flatnonzero((low < self.low) | (np.isnan(low) & ~np.isnan(self.low))):
            self.low[i], self.low_at[i] = low[i], first + int(values[i].argmin())
        for i in np.flatnonzero((high > self.high) | (np.isnan(high) & ~np.isnan(self.high))):
            self.high[i], self.high_at[i] = high[i], first + int(values[i].argmax())

    @property
    def deviation(self) -> FloatArray:
        """Standard deviations (signals,); NaN before the first sample."""
        if self.samples == 0:
            return np.full(len(self.mean), math.nan)
        return np.sqrt(self.squares / self.samples)


class Cycles:
    """Up-crossings of a level, with the crest and the trough of each cycle between two of them.

    Crest and trough of every cycle are kept in single precision, up to `capacity` cycles; beyond
    that the store is given up and only the largest are known.
    """

    def __init__(self, level: float, capacity: int) -> None:
        self.level, self.capacity = level, capacity
        self.crossings = 0
        self.first_at = self.last_at = math.nan  # in samples, interpolated
        self.crest = self.trough = self.height = math.nan
        self.stored = True
        self._crests: list[SmallArray] = []
        self._troughs: list[SmallArray] = []
        self._highs: list[FloatArray] = []  # of whole cycles that still have to be put away
        self._lows: list[FloatArray] = []
        self._waiting = 0
        self._before = math.nan
        self._high, self._low = -math.inf, math.inf

    @property
    def count(self) -> int:
        """Number of whole cycles."""
        return max(self.crossings - 1, 0)

    @property
    def crests(self) -> SmallArray:
        """Crest of each cycle above the level (count,), if stored."""
        return np.concatenate([np.zeros(0, np.float32), *self._crests])

    @property
    def troughs(self) -> SmallArray:
        """Trough of each cycle below the level, negative (count,), if stored."""
        return np.concatenate([np.zeros(0, np.float32), *self._troughs])

    def add(self, signal: FloatArray, first: int) -> None:
        """Take samples `signal` (n,), the first of which is number `first` of the run."""
        above = signal >= self.level
        up = np.flatnonzero(above[1:] > above[:-1]) + 1
        if above[0] and self._before < self.level:
            up = np.concatenate(([0], up))
        if up.size == 0:
            self._high = max(self._high, float(signal.max()))
            self._low = min(self._low, float(signal.min()))
            self._before = float(signal[-1])
            return
        start, end = int(up[0]), int(up[-1])
        if self.crossings == 0:
            self.first_at = self._crossed_at(signal, start, first)
        self.last_at = self._crossed_at(signal, end, first)
        highs, lows = np.maximum.reduceat(signal, up), np.minimum.reduceat(signal, up)
        if start > 0:
            self._high = max(self._high, float(signal[:start].max()))
            self._low = min(self._low, float(signal[:start].min()))
        # The stretch after the last crossing is a cycle under way; what came before the very
        # first crossing is none.
        under_way = float(highs[-1]), float(lows[-1])
        highs[1:], lows[1:] = highs[:-1].copy(), lows[:-1].copy()
        highs[0], lows[0] = self._high, self._low
        whole = slice(1 if self.crossings == 0 else 0, None)
        self._highs.append(highs[whole])
        self._lows.append(lows[whole])
        self._high, self._low = under_way
        self._before = float(signal[-1])
        self.crossings += up.size
        self._waiting += up.size
        if self._waiting >= _CYCLES_AT_ONCE:
            self.finish()

    def finish(self) -> None:
        """Put the latest whole cycles away, so that every number counts them."""
        if self._highs:
            crests = np.concatenate(self._highs) - self.level
            troughs = np.concatenate(self._lows) - self.level
            if crests.size:
                self.crest = float(np.fmax(self.crest, crests.max()))
                self.trough = float(np.fmin(self.trough, troughs.min()))
                self.height = float(np.fmax(self.height, (crests - troughs).max()))
            if self.count > self.capacity:
                self.stored = False
                self._crests, self._troughs = [], []
            if self.stored:
                self._crests.append(crests.astype(np.float32))
                self._troughs.append(troughs.astype(np.float32))
        self._highs, self._lows, self._waiting = [], [], 0

    def figures(self, sample_time: float) -> dict[str, Any]:
        """Return what `SignalStatistics` says of the cycles, by its attributes."""
        crests, troughs = self.crests, self.troughs
        for array in (crests, troughs):
            array.setflags(write=False)
        found: dict[str, Any] = {
            "level": self.level,
            "cycles": self.count,
            "crest": self.crest,
            "trough": self.trough,
            "height": self.height,
            "crests": crests,
            "troughs": troughs,
        }
        if self.count:
            found["period"] = (self.last_at - self.first_at) * sample_time / self.count
            if self.stored:
                heights = np.sort(crests.astype(np.float64) - troughs)
                found["significant"] = float(heights[-math.ceil(self.count / 3) :].mean())
        return found

    def _crossed_at(self, signal: FloatArray, i: int, first: int) -> float:
        before = self._before if i == 0 else float(signal[i - 1])
        here = float(signal[i])
        return first + i - (here - self.level) / (here - before)


class Slack:
    """A rope's time with a least tension at or below a limit [N], and the snap when it comes tight.

    A snap is looked for over `window` samples after slack.
    """

    def __init__(self, limit: float, window: int) -> None:
        self.limit, self.window = limit, window
        self.slack = self.events = 0
        self.first_at = -1
        self.snap, self.snap_at = math.nan, -1
        self._last = -window - 1  # number of the last slack sample
        self._was_slack = False

    def add(self, smallest: FloatArray, tension: FloatArray, first: int) -> None:
        """Take smallest and largest tension along the rope (n,) [N], from sample `first` on."""
        n = smallest.size
        slack = smallest <= self.limit
        count = int(np.count_nonzero(slack))
        if count == 0 and first - self._last > self.window:
            self._was_slack = False
            return
        begins = slack & ~np.concatenate(([self._was_slack], slack[:-1]))
        if count and self.first_at < 0:
            self.first_at = first + int(slack.argmax())
        self.slack += count
        self.events += int(np.count_nonzero(begins))
        numbers = np.arange(first, first + n)
        last = np.maximum.accumulate(np.where(slack, numbers, self._last))
        after = ~slack & (numbers - last <= self.window)
        if after.any():
            # -inf outside the window: it never wins, and a NaN inside it is not hidden.
            snaps = np.where(after, tension, -math.inf)
            i = int(snaps.argmax())
            if not snaps[i] <= self.snap:
                self.snap, self.snap_at = float(snaps[i]), first + i
        self._last, self._was_slack = int(last[-1]), bool(slack[-1])


class Touchdown:
    """Every time that the payload touches, and how fast it comes down on what it touches.

    The speed is that of the last sample before contact, so that the contact itself has not yet
    slowed the payload.
    """

    def __init__(self) -> None:
        self.count = 0
        self.first_at = -1
        self.speed = self.hardest = math.nan
        self._touching = True  # a run that begins in contact has not touched down yet
        self._approach = math.nan

    def add(self, touching: npt.NDArray[np.bool_], approach: FloatArray, first: int) -> None:
        """Take contact and speed of approach (n,) [m/s], downwards positive."""
        before = np.concatenate(([self._touching], touching[:-1]))
        touched = np.flatnonzero(touching & ~before)
        if touched.size:
            speeds = np.concatenate(([self._approach], approach[:-1]))[touched]
            if self.count == 0:
                self.first_at, self.speed = first + int(touched[0]), float(speeds[0])
            self.count += touched.size
            self.hardest = float(np.fmax(self.hardest, speeds.max()))
        self._touching, self._approach = bool(touching[-1]), float(approach[-1])


class BlockExtremes:
    """Largest and smallest value of several signals in each whole block of `length` samples."""

    def __init__(self, signals: int, length: int) -> None:
        self.length = length
        self._whole: list[FloatArray] = []
        self._filled = 0
        self._high, self._low = np.full(signals, -math.inf), np.full(signals, math.inf)

    def add(self, values: FloatArray) -> None:
        """Take samples `values` (signals, n)."""
        start, n = 0, values.shape[1]
        while start < n:
            stop = min(n, start + self.length - self._filled)
            part = values[:, start:stop]
            self._high = np.maximum(self._high, part.max(axis=1))
            self._low = np.minimum(self._low, part.min(axis=1))
            self._filled += stop - start
            start = stop
            if self._filled == self.length:
                self._whole.append(np.stack([self._high, self._low]))
                self._high = np.full_like(self._high, -math.inf)
                self._low = np.full_like(self._low, math.inf)
                self._filled = 0

    def found(self) -> FloatArray:
        """Maxima and minima of the whole blocks (blocks, 2, signals)."""
        return np.array(self._whole).reshape(len(self._whole), 2, self._high.size)
