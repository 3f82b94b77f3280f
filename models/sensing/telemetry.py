"""The telemetry link over time: delays, dropouts and outages of the payload's messages.

The payload sends a message at every control sample.  Each is late by the delay and the jitter,
some are lost, and now and then the link or the sensor is gone for a while.  None of it depends on
what is sent, so the whole schedule is drawn before the run; `models.sensing.sensing` applies it.

The link is faster than the control samples.  A transit time that is no multiple of the sample
time is therefore met by interpolation between two neighbouring messages: what is known at t is
the signal at t - delay, not at the sample before it.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import BoolArray, FloatArray, InputError, ReadOnlyArrays, check_range
from ..rig import Telemetry
from .draws import TELEMETRY, draw

IntArray = npt.NDArray[np.int64]
Interval = tuple[float, float]
Late = tuple[float, float, float]
Size = tuple[str, float, float, str]  # name, range and unit

LATE: tuple[Size, ...] = (("extra delay", 0.0, 60.0, "s"),)
"""What stands behind start and end of an interval in which messages are late."""

_ROUNDING = 1e-6  # of a sample: 0.07 s is seven samples of 0.01 s, whatever the division says


@dataclass(frozen=True, kw_only=True, eq=False)
class TelemetryBlock(ReadOnlyArrays):
    """What arrives in a stretch of samples."""

    #: Weights of the messages sent `lags` samples ago (count, len(lags)): at most two are not zero,
    #: and they add up to 1 where something has arrived, else to 0.
    weights: FloatArray
    #: 1 where something new and usable has arrived since the sample before, else 0 (count,).
    fresh: FloatArray
    valid: FloatArray  #: 1 where it is said that this is so, else 0 (count,).
    age: FloatArray  #: Time since what is known last was true [s], (count,).


@dataclass(frozen=True, eq=False)
class TelemetrySchedule:
    """The schedule of a link; sample k is at k `sample_time`.

    Notes
    -----
    A message sent at sample j arrives at t = j Ts + delay + U(0, jitter).  Messages may overtake
    each other; an older one that comes late is thrown away.  Lost messages are independent, or
    come in runs of mean length L by a Markov chain of two states (E. N. Gilbert, "Capacity of a
    burst-noise channel", Bell Syst. Tech. J. 39, 1960), whose stationary share of lost messages
    is `dropout`.  Single losses have a mean length of 1/(1 - dropout) messages already; a
    shorter `dropout_length` means those.

    Before sample 0 the link works as after it, and sends the values at rest.

    Examples
    --------
    >>> link = TelemetrySchedule(Telemetry(delay=0.025), 0.01, seed=1)
    >>> list(link.lags), [float(w) for w in link.block(0, 1).weights[0].round(9)]
    ([2, 3], [0.5, 0.5])
    """

    telemetry: Telemetry  #: Delay, jitter and dropouts.
    sample_time: float  #: Time between control samples, and between messages [s].
    seed: int  #: Seed of the run.
    outages: Sequence[Interval] = ()  #: Intervals (start, end) [s] in which nothing is sent.
    #: Intervals in which the messages come, but are marked as invalid.
    broken: Sequence[Interval] = ()
    #: Intervals in which the messages that come tell what the last one before them did.
    stuck: Sequence[Interval] = ()
    #: (start, end, extra) [s]: messages sent in the interval are late by so much more.
    late: Sequence[Late] = ()

    @cached_property
    def lags(self) -> range:
        """Ages in samples that a message may have when it is used."""
        low, high = self._transit
        latest = max((extra for _, _, extra in self.late), default=0.0)
        high = _snapped(high + latest / self.sample_time)
        return range(math.floor(low), math.ceil(high) + 1)

    def block(self, start: int, count: int) -> TelemetryBlock:
        """Return what arrives at the samples from `start` on."""
        arrival, content, usable = self._messages(start - self.lags.stop, start + count)
        inside = usable & (arrival >= start) & (arrival < start + count)
        best = np.full(count + 1, -math.inf)
        best[0] = self._known_before(start)
        np.maximum.at(best, arrival[inside] - start + 1, content[inside])
        known = np.maximum.accumulate(best)
        fresh = known[1:] > known[:-1]
        age = start + np.arange(count) - known[1:]
        weights = np.zeros((count, len(self.lags)))
        valid = fresh
        fresh = fresh & ~during(self.stuck, start + np.arange(count), self.sample_time)
        row = np.flatnonzero(fresh)
        whole = np.floor(age[row]).astype(np.int64)
        share = age[row] - whole
        weights[row, whole - self.lags.start] = 1.0 - share
        split = share > 0.0
        weights[row[split], whole[split] + 1 - self.lags.start] = share[split]
        return TelemetryBlock(
            weights=weights,
            fresh=fresh.astype(np.float64),
            valid=valid.astype(np.float64),
            age=np.asarray(age * self.sample_time, dtype=np.float64),
        )

    @cached_property
    def _transit(self) -> tuple[float, float]:
        """Shortest and longest transit time, in samples."""
        delay, jitter = self.telemetry.delay, self.telemetry.jitter
        shortest, longest = (_snapped(t / self.sample_time) for t in (delay, delay + jitter))
        return shortest, longest

    @cached_property
    def _chain(self) -> tuple[float, float]:
        """Probability of a lost message after one that came, and after a lost one."""
        share = self.telemetry.dropout
        length = self.telemetry.dropout_length / self.sample_time
        if length <= 1.0 / (1.0 - share):
            return share, share
        return share / (length * (1.0 - share)), 1.0 - 1.0 / length

    def _messages(self, first: int, stop: int) -> tuple[IntArray, FloatArray, BoolArray]:
        """Return of the messages sent at samples `first` to `stop` when they arrive [sample].

        Then the moment that their content is from [sample], and whether they are of any use.
        """
        sent = np.arange(first, stop)
        usable = self._usable(first, stop + 1)
        low, high = self._transit
        transit = np.full(len(sent), low)
        if self.telemetry.jitter > 0.0:
            transit += (high - low) * self._uniform(first, stop)[:, 1]
        for start, end, extra in self.late:
            inside = during([(start, end)], sent, self.sample_time)
            shifted = transit[inside] + extra / self.sample_time
            nearest = np.round(shifted)
            whole = np.abs(shifted - nearest) < _ROUNDING
            transit[inside] = np.where(whole, nearest, shifted)
        late = np.ceil(transit)
        arrival = sent + late.astype(np.int64)
        # The later neighbour of the interpolation may be lost: then the message stands alone.
        alone = ~usable[1:] & (late > transit)
        content = np.where(alone, sent.astype(np.float64), arrival - transit)
        return arrival, content, usable[:-1]

    def _usable(self, first: int, stop: int) -> BoolArray:
        sent = np.arange(first, stop)
        bad = self._lost(first, stop) if self.telemetry.dropout > 0.0 else sent < -self.lags.stop
        for intervals in (self.outages, self.broken):
            bad = bad | during(intervals, sent, self.sample_time)
        return np.asarray(~bad & (sent >= -self.lags.stop))

    def _lost(self, first: int, stop: int) -> BoolArray:
        """Return which messages are lost.

        One number decides on each message: below `after_one` it is lost and from `after_lost` on
        it comes, whatever happened before; in between it shares the fate of its predecessor.  So
        the chain is known from the last message that was decided, and needs no beginning.
        """
        after_one, after_lost = self._chain
        back = 256
        while True:
            low = max(first - back, -self.lags.stop)
            number = self._uniform(low, stop)[:, 0]
            lost = number < after_one
            decided = lost | (number >= after_lost)
            if low == -self.lags.stop:
                lost[0], decided[0] = number[0] < self.telemetry.dropout, True
            at = np.maximum.accumulate(np.where(decided, np.arange(len(number)), -1))
            if low == -self.lags.stop or at[first - low] >= 0:
                break
            back *= 4
        # Messages before the very first do not exist; `_usable` drops them.
        ahead = np.ones(max(low - first, 0), dtype=np.bool_)
        return np.concatenate((ahead, lost[np.maximum(at, 0)][max(first - low, 0) :]))

    def _uniform(self, first: int, stop: int) -> FloatArray:
        """Return the numbers of the messages `first` to `stop`; zero before the very first."""
        skipped = max(-self.lags.stop - first, 0)
        begin = first + skipped + self.lags.stop
        numbers = draw(self.seed, TELEMETRY, begin, stop - first - skipped, 2, "uniform")
        return np.concatenate((np.zeros((skipped, 2)), numbers)) if skipped else numbers

    def _known_before(self, start: int) -> float:
        """Return the moment [sample] of what is known just before a sample."""
        stop, width = start, 2 * self.lags.stop + 64
        while stop > -self.lags.stop:
            first = max(stop - width, -self.lags.stop)
            arrival, content, usable = self._messages(first, stop)
            found = content[usable & (arrival < start)]
            if found.size:  # whatever was sent earlier is older
                return float(found.max())
            stop, width = first, min(4 * width, 65536)
        return float(-self.lags.stop)


def check_intervals(
    owner: str,
    name: str,
    intervals: Sequence[Sequence[float]],
    sizes: Sequence[Size] = (),
    *,
    apart: bool = False,
) -> tuple[Any, ...]:
    """Return intervals of time, each (start, end) [s] and the sizes of what is wrong in it.

    The start is included, the end is not.  Intervals that have to be `apart` come in order of time.

    Raises InputError if one is no such row, does not start before its end, which may be infinite,
    or has a size out of its range; if two overlap that have to be apart.
    """
    checked = []
    for interval in intervals:
        try:
            start, end = (float(time) for time in interval[:2])
            more = list(zip(interval[2:], sizes, strict=True))
        except (TypeError, ValueError):
            start, end, more = math.nan, math.nan, []
        if not (math.isfinite(start) and start < end):
            raise InputError(
                f"{owner}: {name} must be pairs (start, end) in s with start < end, "
                f"got {interval!r}"
            )
        found = [
            check_range(owner, f"{size} of {name}", value, low=low, high=high, unit=unit)
            for value, (size, low, high, unit) in more
        ]
        checked.append((start, end, *found))
    if apart:
        checked.sort()
        check_range(owner, f"start of {name}", min(checked, default=(0.0,))[0], low=0.0, unit="s")
        for (start, end, *_), (then, until, *_) in itertools.pairwise(checked):
            if then < end:
                raise InputError(
                    f"{owner}: {name} must not overlap, got {start:g} s to {end:g} s and "
                    f"{then:g} s to {until:g} s"
                )
    return tuple(checked)


def during(intervals: Sequence[Interval], samples: IntArray, sample_time: float) -> BoolArray:
    """Return which samples k (n,), at k `sample_time` [s], lie in an interval (start, end) [s].

    The start is included, the end not.
    """
    inside = np.zeros(len(samples), dtype=np.bool_)
    for start, end in intervals:
        position = samples + _ROUNDING
        inside |= (position >= start / sample_time) & (position < end / sample_time)
    return inside


def _snapped(samples: float) -> float:
    """Return a number of samples, whole if it is so but for rounding."""
    nearest = round(samples)
    return float(nearest) if abs(samples - nearest) < _ROUNDING else samples
