"""Trips of the brake in mid-run: overspeed, the end of the drum's travel, a lost encoder.

A supervisor beside the controller watches a few signals, each in its range, and whether the
controller asks for the brake.  The first that leaves it closes the brake and takes the command back
to the static one; the run goes on with the brake closed, and the event says what happened.
`models.simulation.simulate` asks after every sample.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..basics import FloatArray
from ..case import Case
from ..run import Event
from ..sensing import STATUSES
from .closed_loop import STATUS

# Hoists have a switch at 1.1 to 1.25 times their highest speed: a drive at the limit of its power
# cannot hold a load that runs away.
OVERSPEED = 1.15


@dataclass(frozen=True, kw_only=True)
class TripLimit:
    """The range of a signal, and what to say when it is left."""

    signal: str  #: Name of the signal.
    #: The range that is allowed.
    low: float = -math.inf
    high: float = math.inf
    kind: str  #: One word for the event.
    text: str  #: The sentence; `{value}` is the signal's.


def trip_limits(case: Case) -> tuple[TripLimit, ...]:
    """Return the limits of a case: overspeed, stroke, the rope that the drum has, the encoder."""
    fastest = OVERSPEED * case.winch.speed_limit
    text = f"motor at {{value:.4g}} rad/s, beyond {fastest:.4g} rad/s: brake"
    limits = [
        TripLimit(signal="motor.speed", low=-fastest, high=fastest, kind="overspeed", text=text)
    ]
    if case.limits.stroke is not None:
        low, high = case.limits.stroke
        text = f"haul of {{value:.3g}} m is at the end of the stroke, {low:g} to {high:g} m: brake"
        limits.append(TripLimit(signal="drum.haul", low=low, high=high, kind="stroke", text=text))
    total = case.winch.drum.total(case.rope.diameter)
    if total < math.inf:
        text = f"all {total:.6g} m of rope are paid out: brake"
        most = total / case.rope.falls
        limits.append(TripLimit(signal="rope.length", high=most, kind="rope-out", text=text))
    text = "all rope is hauled in, the payload is at the hook: brake"
    limits.append(TripLimit(signal="rope.length", low=1.0, kind="rope-in", text=text))
    text = "without the drum's encoder the controller has stopped the drum: brake"
    asked = tuple(STATUSES).index("braked") - 0.5  # the last of them
    limits.append(TripLimit(signal=STATUS, high=asked, kind="encoder", text=text))
    return tuple(limits)


class Watch:
    """The ranges of some signals, watched in the log of a run whose columns are `signals`.

    Of signals that the log does not have nothing is known.
    """

    def __init__(
        self, limits: Sequence[TripLimit], signals: Sequence[str], sample_time: float
    ) -> None:
        self._limits = [limit for limit in limits if limit.signal in signals]
        self._columns = [signals.index(limit.signal) for limit in self._limits]
        self._low = np.array([limit.low for limit in self._limits])
        self._high = np.array([limit.high for limit in self._limits])
        self._sample_time = sample_time

    def trip(self, log: FloatArray, first: int) -> tuple[int, Event] | None:
        """Return the row of the first trip in a log (n, signals) and what to say, or None.

        `first` is the number of the log's first sample.
        """
        values = log[:, self._columns]
        outside = (values < self._low) | (values > self._high)
        if not outside.any():
            return None
        row, at = np.argwhere(outside)[0]
        limit = self._limits[at]
        text = limit.text.format(value=values[row, at])
        time = (first + int(row)) * self._sample_time
        return int(row), Event(time=time, kind=limit.kind, text=text)
