"""The two ways to run a loop over rows: with the controller inside, or called from Python.

    state, rows --> Stepper.run --> state, log, trip

`models.simulation.simulate` drives either in the same way.  A controller in Python may fail: return
no number, take too long, raise.  Its last good command is then held, and the run counts how often
and says when it happened first; the load never sees a command that is not a number.
"""

from __future__ import annotations

import math
import time as clock
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from typing_extensions import override

from ..basics import FloatArray, SolverError, check_range
from ..run import Event
from ..sensing import Measurement
from .trips import Trip, TripLimit, find_trip

if TYPE_CHECKING:
    from .simulation import Simulation


Ran = tuple[FloatArray, FloatArray, Trip | None]


class Stepper(ABC):
    """Runs the loop of one run; made anew for each."""

    def __init__(self, simulation: Simulation) -> None:
        self._signals = simulation.loop.signals
        self._sample_time = simulation.loop.sample_time
        self.seconds: list[float] = []
        self.fallbacks: dict[str, int] = {}
        self.events: list[Event] = []

    @abstractmethod
    def run(
        self,
        state: FloatArray,
        rows: FloatArray,
        parameters: FloatArray,
        first: int,
        limits: Sequence[TripLimit],
    ) -> Ran:
        """Run over rows, to their end or to the first trip, whose row is the last of the log.

        Parameters
        ----------
        state, rows, parameters
            As for `Kernel.run`.
        first
            Number of the first sample.
        limits
            What to watch.

        Returns
        -------
        state, log, trip
            The state after the last row of the log, the log, and the trip if there was one.
        """


def stepper_for(simulation: Simulation) -> Stepper:
    """Return what runs a simulation."""
    return _Fused(simulation) if simulation.fused else _FromPython(simulation)


class _Fused(Stepper):
    """The controller is part of the recursion."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        self._kernel = simulation.kernels[0]

    @override
    def run(
        self,
        state: FloatArray,
        rows: FloatArray,
        parameters: FloatArray,
        first: int,
        limits: Sequence[TripLimit],
    ) -> Ran:
        after, log = self._kernel.run(state, rows, parameters)
        trip = find_trip(limits, self._signals, log, first, self._sample_time)
        if trip is not None and trip.sample - first + 1 < len(log):
            # Once more, up to the sample where it happened.
            after, log = self._kernel.run(state, rows[: trip.sample - first + 1], parameters)
        return after, log, trip


class _FromPython(Stepper):
    """The controller is called between the two halves of a sample."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        deadline = simulation.options.deadline
        if deadline is not None:
            check_range("simulation", "deadline", deadline, low=0.0, unit="s", open_low=True)
        self._measure, self._advance = simulation.kernels
        self._controller = simulation.controller
        self._deadline = math.inf if deadline is None else deadline
        self._command = simulation.rest.command
        self._controller.reset()

    @override
    def run(
        self,
        state: FloatArray,
        rows: FloatArray,
        parameters: FloatArray,
        first: int,
        limits: Sequence[TripLimit],
    ) -> Ran:
        log = np.empty((len(rows), len(self._signals)))
        given = np.empty(rows.shape[1] + 1)
        watched = [limit for limit in limits if limit.signal in self._signals]
        columns = [self._signals.index(limit.signal) for limit in watched]
        for k, row in enumerate(rows):
            time = (first + k) * self._sample_time
            state, seen = self._measure.step(state, row, parameters)
            given[:-1] = row
            given[-1] = self._ask(Measurement(seen), time)
            state, log[k] = self._advance.step(state, given, parameters)
            for limit, column in zip(watched, columns, strict=True):
                if not limit.low <= log[k, column] <= limit.high:
                    trip = find_trip(
                        limits, self._signals, log[k : k + 1], first + k, self._sample_time
                    )
                    if trip is not None:
                        return state, log[: k + 1], trip
        return state, log, None

    def _ask(self, measurement: Measurement, time: float) -> float:
        """Return the controller's command, or the one before if it has none."""
        began = clock.perf_counter()
        try:
            command = float(self._controller.step(measurement, time))
        except (ArithmeticError, SolverError, TypeError, ValueError) as error:
            command = math.nan
            self._held("failed", time, f"the controller failed ({error})")
        else:
            if not math.isfinite(command):
                self._held("not a number", time, "the controller returned no number")
        taken = clock.perf_counter() - began
        self.seconds.append(taken)
        if taken > self._deadline:
            late = f"the controller took {1e3 * taken:.3g} ms"
            self._held("late", time, f"{late}, its deadline is {1e3 * self._deadline:.3g} ms")
        elif math.isfinite(command):
            self._command = command
        return self._command

    def _held(self, kind: str, time: float, text: str) -> None:
        """Count a command that was not used, and tell of the first."""
        if kind not in self.fallbacks:
            told = f"{text}: the command before is held (told once)"
            self.events.append(Event(time=time, kind="controller", text=told))
        self.fallbacks[kind] = self.fallbacks.get(kind, 0) + 1
