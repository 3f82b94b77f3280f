"""One run of a simulation: a controller on the nonlinear plant, behind real sensors, in a real sea.

    Simulation, seed --> rows, chunk by chunk --> recursion --> Run

The plant is that of the case with everything a design leaves out: quadratic drag, slack rope,
limits of the drive, dry friction, losses of the gear both ways, the brake.  A controller that is
a recursion runs inside the compiled loop; any other object with `step` is called from Python once
in a sample.  Either way every random number is drawn in advance, from the seed alone, so that a run
can be repeated to the last bit.

Whatever happens on the way (the end of the stroke, a controller that returns no number, a
diverging plant, Ctrl-C) ends in a `Run` that says what happened and when, with everything
simulated up to then.

A controller in Python may fail: return no number, take too long, raise.  Its last good command is
then held, and the run counts how often and says when it happened first; the load never sees a
command that is not a number.
"""

import math
import time as clock
from collections.abc import Callable

import numpy as np
from typing_extensions import override

from ..basics import FloatArray, SolverError, check_range, check_seed
from ..run import Accumulator, Event, Run, Timings
from ..sensing import STATUSES, Measurement, holds_brake
from .closed_loop import STATUS
from .native_loop import HELD, NativeLoop
from .simulation import Simulation
from .trips import Watch, trip_limits

Progress = Callable[[float], None]

CHUNK = 8192  # samples between two looks at trips, Ctrl-C and progress
_NAMES = tuple(STATUSES)
_BLIND = _NAMES.index("blind")
STORED = 40_000  # samples that a run keeps unless told otherwise
Ran = tuple[FloatArray, FloatArray, Event | None]


def run_simulation(
    simulation: Simulation, *, seed: int = 0, progress: Progress | None = None
) -> Run:
    """Run a prepared simulation once, also one that diverges or is interrupted.

    The seed is that of sea, noise and telemetry; `progress` is called now and then with the share
    that is done.

    Raises InputError if an option is out of range; SolverError if the controller's recursion fails.
    """
    began = clock.perf_counter()
    if simulation.scenario.worst_trip is not None:
        whole = run_simulation(simulation.with_trip(None), seed=seed)
        if whole.status != "completed":
            return whole
        simulation = simulation.with_trip(whole)
    loop, scenario, case = simulation.loop, simulation.scenario, simulation.case
    options, wanted, settle = simulation.options, simulation.duration, simulation.options.settle
    owner, dt = "simulation", loop.sample_time
    check_range(owner, "duration", wanted, low=dt, unit="s")
    samples = simulation.samples(wanted)
    if settle is None:
        waves = simulation.ease + 10.0 * case.sea.spectral_peak_period
        settle = min(max(scenario.settle, waves), 0.1 * wanted)
        # not before the controller is at work, however short the run
        settle = max(settle, min(scenario.warm_up + scenario.ramp, 0.5 * wanted))
    static = simulation.rest.outputs
    torque = 0.0 if holds_brake(simulation.controller) else static["motor.torque"]
    levels = {"motor.torque": torque, "rope.tension": static["rope.tension"]}
    accumulator = Accumulator(
        loop.signals,
        dt,
        settle=check_range(owner, "settle", settle, low=0.0, high=wanted, unit="s"),
        units=loop.units,
        levels=levels,
        lock_limit=options.lock_limit,
        thermal_time=case.winch.motor.thermal_time_constant,
        cooled_speed=case.winch.cooled_speed,
    )
    store = _Store(dt, samples, options.store_step)
    rows = simulation.rows(check_seed(owner, seed), wanted)
    stepper = _stepper(simulation)
    foresee = getattr(simulation.controller, "foresee", None)
    if foresee is not None:  # a controller with perfect preview, for reference
        foresee(rows.motions[0])
    events = [Event(time=t, kind=kind, text=text) for t, kind, text in scenario.events]
    status, message = "completed", ""
    state, mru = simulation.start(rows), rows.start()
    schedule, trip = simulation.schedule, None
    try:
        while store.seen < samples:
            first = store.seen
            # A chunk ends where a parameter changes: the recursion has one set of them in a call.
            until = min([samples, first + CHUNK, *(row for row in schedule.breaks if row > first)])
            p = np.array(list({**loop.parameters, **schedule.parameters_at(first)}.values()))
            chunk, mru = rows.block(first, until - first, mru)
            if trip is not None:
                rows.trip(chunk, first, trip.time)
            # A trip ends the stepper's work early; the rest of the chunk goes on with the brake.
            while len(chunk):
                at = store.seen
                state, log, found = stepper.run(state, chunk, p, at)
                chunk = chunk[len(log) :]
                good = _finite(log)  # up to the divergence everything is kept
                accumulator.update(log[:good])
                store.add(log[:good])
                if good < len(log):
                    raise _DivergedError
                if found is not None:
                    trip, stepper.watch = found, None
                    events.append(trip)
                    rows.trip(chunk, store.seen, trip.time)
            if progress is not None:
                progress(store.seen / samples)
    except KeyboardInterrupt:
        status, message = "interrupted", f"interrupted at {store.seen * dt:.6g} s"
    except _DivergedError:
        when, status = store.seen * dt, "diverged"
        message = (
            f"the simulation diverged at {when:.6g} s: the loop is unstable and nothing limits it"
        )
        events.append(Event(time=when, kind="diverged", text=message))
    events = [event for event in events + stepper.events if event.time <= store.seen * dt]
    time, values = store.arrays(len(loop.signals))
    wall = clock.perf_counter() - began
    return Run(
        case=case,
        controller=simulation.controller.name,
        scenario=scenario.name,
        seed=seed,
        sample_time=dt,
        step=loop.step.step,
        duration=float(wanted),
        compiled=simulation.compiled,
        signals=loop.signals,
        units=loop.units,
        time=time,
        values=values,
        statistics=accumulator.result(),
        events=tuple(sorted(events, key=lambda event: event.time)),
        status=status,
        message=message,
        timings=Timings.of(
            wall_seconds=wall,
            steps=store.seen * loop.step.substeps,
            duration=store.seen * dt,
            controller_seconds=stepper.seconds,
            fallbacks=stepper.fallbacks,
            statuses=stepper.statuses,
        ),
    )


class _Stepper:
    """Runs the loop of one run, made anew for each; here the controller is part of it."""

    def __init__(self, simulation: Simulation) -> None:
        self._kernels = simulation.kernels
        self._signals = simulation.loop.signals
        self._told = self._signals.index(STATUS) if STATUS in self._signals else None
        self._age = self._signals.index("payload.age")
        self._deaf = getattr(simulation.controller, "deaf_after", math.inf)
        self._sample_time = simulation.loop.sample_time
        limits = trip_limits(simulation.case)
        self.watch: Watch | None = Watch(limits, self._signals, self._sample_time)
        self.seconds: list[float] = []
        self.fallbacks: dict[str, int] = {}
        self.statuses: dict[str, int] = {}
        self.events: list[Event] = []

    def run(self, state: FloatArray, rows: FloatArray, parameters: FloatArray, first: int) -> Ran:
        """Run over rows, to their end or to the first trip, whose row is the last of the log.

        `first` is the number of the first sample, the rest as for `Kernel.run`.
        """
        (kernel,) = self._kernels
        after, log = kernel.run(state, rows, parameters)
        found = None if self.watch is None else self.watch.trip(log, first)
        trip = None
        if found is not None:  # once more, up to the sample where it happened
            row, trip = found
            after, log = kernel.run(state, rows[: row + 1], parameters)
        self._look(log, first)
        return after, log, trip

    def _look(self, log: FloatArray, first: int) -> None:
        """Look at what the steps of the controller in the loop were."""
        if self._told is None:
            self._count(np.where(log[:, self._age] > self._deaf, _BLIND, 0.0), first)
        else:
            self._count(log[:, self._told], first)

    def _count(self, codes: FloatArray, first: int) -> None:
        """Count the statuses of steps, and tell of the first of each."""
        if not codes.any():
            return
        for code in np.unique(codes[np.isfinite(codes)]):
            rows = np.flatnonzero(codes == code)
            time = (first + int(rows[0])) * self._sample_time
            self._tell(_NAMES[int(code)], time, len(rows))

    def _tell(self, status: str, time: float, count: int = 1) -> None:
        """Count steps that were not as usual to the controller, and tell of the first."""
        if not STATUSES.get(status):
            return
        if status not in self.statuses:
            told = f"{STATUSES[status]} (told once)"
            self.events.append(Event(time=time, kind="controller", text=told))
        self.statuses[status] = self.statuses.get(status, 0) + count

    def _held(self, kind: str, time: float, text: str, count: int = 1) -> None:
        """Count commands that were not used, and tell of the first."""
        if kind not in self.fallbacks:
            told = f"{text}: the command before is held (told once)"
            self.events.append(Event(time=time, kind="controller", text=told))
        self.fallbacks[kind] = self.fallbacks.get(kind, 0) + count


class _FromC(_Stepper):
    """The controller is C of its own between the two halves of a sample (`NativeLoop`)."""

    @override
    def run(self, state: FloatArray, rows: FloatArray, parameters: FloatArray, first: int) -> Ran:
        (kernel,) = self._kernels
        after, both = kernel.run(state, rows, parameters)
        found = None if self.watch is None else self.watch.trip(both[:, :-2], first)
        trip = None
        if found is not None:
            row, trip = found
            after, both = kernel.run(state, rows[: row + 1], parameters)
        codes, seconds = both[:, -2], both[:, -1]
        held = codes >= HELD
        if held.any():
            time = (first + int(np.argmax(held))) * self._sample_time
            self._held("not a number", time, "the controller returned no number", int(held.sum()))
        self._count(np.where(held, codes - HELD, codes), first)
        if math.isfinite(float(seconds.sum())):
            self.seconds.extend(seconds.tolist())
        return after, np.ascontiguousarray(both[:, :-2]), trip


def _stepper(simulation: Simulation) -> _Stepper:
    if not simulation.fused:
        return _FromPython(simulation)
    return (
        _FromC(simulation)
        if isinstance(simulation.kernels[0], NativeLoop)
        else _Stepper(simulation)
    )


class _FromPython(_Stepper):
    """The controller is called between the two halves of a sample."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        deadline = simulation.options.deadline
        if deadline is not None:
            check_range("simulation", "deadline", deadline, low=0.0, unit="s", open_low=True)
        self._controller = simulation.controller
        self._deadline = math.inf if deadline is None else deadline
        self._command = simulation.rest.command
        self._controller.reset()

    @override
    def run(self, state: FloatArray, rows: FloatArray, parameters: FloatArray, first: int) -> Ran:
        measure, advance = self._kernels  # type: ignore[misc]
        log = np.empty((len(rows), len(self._signals)))
        for k, row in enumerate(rows):
            state, seen = measure.step(state, row, parameters)
            command = self._ask(Measurement(seen), (first + k) * self._sample_time)
            asked = (command,) if self._told is None else (command, _NAMES.index(self._status))
            state, log[k] = advance.step(state, np.append(row, asked), parameters)
            found = None if self.watch is None else self.watch.trip(log[k : k + 1], first + k)
            if found is not None:
                return state, log[: k + 1], found[1]
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
        self._tell(self._status, time)
        if taken > self._deadline:
            late = f"the controller took {1e3 * taken:.3g} ms"
            self._held("late", time, f"{late}, its deadline is {1e3 * self._deadline:.3g} ms")
        elif math.isfinite(command):
            self._command = command
        return self._command

    @property
    def _status(self) -> str:
        """What the last step was; as usual if the controller does not say, or not in our words."""
        status = str(getattr(self._controller, "status", ""))
        return status if status in STATUSES else _NAMES[0]


class _DivergedError(Exception):
    """The plant's state is no longer a number."""


class _Store:
    """Keeps every so manieth sample."""

    def __init__(self, sample_time: float, samples: int, store_step: float | None) -> None:
        if store_step is None:
            self._every = max(1, math.ceil(samples / STORED))
        else:
            check_range("simulation", "store_step", store_step, low=sample_time, unit="s")
            self._every = max(1, round(store_step / sample_time))
        self._dt = sample_time
        self._kept: list[FloatArray] = []
        self.seen = 0

    def add(self, log: FloatArray) -> None:
        """Take the next samples (n, signals)."""
        first = -self.seen % self._every
        self._kept.append(log[first :: self._every].copy())
        self.seen += len(log)

    def arrays(self, signals: int) -> tuple[FloatArray, FloatArray]:
        """Return times (n,) and values (n, signals)."""
        values = np.concatenate(self._kept) if self._kept else np.zeros((0, signals))
        return self._dt * self._every * np.arange(len(values), dtype=np.float64), values


def _finite(log: FloatArray) -> int:
    """Return how many rows come before the first that is not finite."""
    if math.isfinite(log.sum()):  # one pass, and the usual case
        return len(log)
    bad = ~np.isfinite(log.sum(axis=1))
    return int(np.argmax(bad)) if bad.any() else len(log)
