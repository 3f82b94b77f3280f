"""Trips of the brake in mid-run: overspeed, and the end of the drum's travel.

A supervisor beside the controller watches a few signals, each in its range.  The first that
leaves it closes the brake and takes the command back to the static one; the run goes on with the
brake closed, and the event says what happened.  `models.simulation.simulate` asks after every
sample.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..basics import FloatArray
from ..case import Case
from ..run import Event

# Hoists have a switch at 1.1 to 1.25 times their highest speed: a drive at the limit of its power
# cannot hold a load that runs away.
OVERSPEED = 1.15


@dataclass(frozen=True, kw_only=True)
class TripLimit:
    """The range of a signal, and what to say when it is left.

    Parameters
    ----------
    signal
        Name of the signal.
    low, high
        The range that is allowed.
    kind
        One word for the event.
    text
        The sentence; `{value}` is the signal's.
    """

    signal: str
    low: float = -math.inf
    high: float = math.inf
    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Trip:
    """A range that was left.

    Parameters
    ----------
    sample
        Number of the sample at which it happened.
    time
        Its time [s].
    event
        What to say.
    """

    sample: int
    time: float
    event: Event


def trip_limits(case: Case) -> tuple[TripLimit, ...]:
    """Return the limits of a case: overspeed, the stroke, and the rope that the drum has."""
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
        limits.append(TripLimit(signal="rope.length", high=total, kind="rope-out", text=text))
    text = "all rope is hauled in, the payload is at the hook: brake"
    limits.append(TripLimit(signal="rope.length", low=1.0, kind="rope-in", text=text))
    return tuple(limits)


def find_trip(
    limits: Sequence[TripLimit],
    signals: Sequence[str],
    log: FloatArray,
    first: int,
    sample_time: float,
) -> Trip | None:
    """Return the first trip in a log, or None.

    Parameters
    ----------
    limits
        The ranges to watch; of signals that the log does not have nothing is known.
    signals
        Names of the log's columns.
    log
        One row for each sample (n, signals).
    first
        Number of the log's first sample.
    sample_time
        Time between samples [s].
    """
    found: Trip | None = None
    for limit in limits:
        if limit.signal not in signals:
            continue
        value = log[:, signals.index(limit.signal)]
        outside = (value < limit.low) | (value > limit.high)
        if not outside.any():
            continue
        at = int(np.argmax(outside))
        if found is None or first + at < found.sample:
            time = (first + at) * sample_time
            text = limit.text.format(value=value[at])
            event = Event(time=time, kind=limit.kind, text=text)
            found = Trip(sample=first + at, time=time, event=event)
    return found
