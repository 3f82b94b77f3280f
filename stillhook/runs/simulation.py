"""`sh.simulate`: a controller on the nonlinear plant, over as many seeds as are asked for.

    case, controller, scenario --> Series --> run(seed) ... --> Runs

`Runs` keeps the runs and says what they say together; `stillhook.runs.report` writes them into a
folder.  A `Series` holds runs that differ in their seed alone, prepared once for all of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from models.basics import (
    InputError,
    check_choice,
    check_range,
    check_seed,
    one_thread,
    shows_progress,
)
from models.case import Case
from models.casefile import Quantity
from models.operation import MotionSource, Scenario, SpectrumMotion, scenario_named
from models.plant import MAX_MASSES, DriveLimits
from models.run import Event, NamedQuantity, Run
from models.sensing import Controller, holds_brake
from models.simulation import Progress, Simulation, SimulationOptions, prepare, run_simulation
from synth.controllers import operated, touching_down
from synth.design import Design, Tuning

from ..controllers import controller_of, with_c_if_any
from ..text import number, quantity
from .runs import FINER_SNAP, Runs, keep_worst, stays
from .window import error_of

_PAYS = 1200.0  # length of a run that wins back what compiling a predictive controller takes [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """Runs that differ in their seed alone, prepared but not yet run."""

    simulation: Simulation

    @classmethod
    def prepare(
        cls, case: Case, controller: Controller, scenario: Scenario, options: SimulationOptions
    ) -> Series:
        """Prepare, the controller made for the scenario's own case (`Scenario.case_for`).

        Where the scenario asks for it (`Scenario.operated`) it gets the interface (`operated`).
        Linear predictive control runs as C in a run that is long enough to pay for the compiler.

        Raises InputError, SolverError as `models.simulation.prepare`.
        """
        if options.duration is not None:
            scenario = replace(scenario, duration=options.duration)
        own = scenario.case_for(case)
        # A compiler takes its seconds over the C of a predictive controller.
        if scenario.duration >= _PAYS and options.compiled is not False:
            controller = with_c_if_any(controller)
        if scenario.operated:
            ramp = {"ramp": scenario.ramp} if scenario.ramp > 0.0 else {}
            controller = operated(controller, own, rate=scenario.rate, **ramp)
        if scenario.touch_down is not None:
            controller = touching_down(controller, own, scenario.touch_down)
        simulation = prepare(case, controller, scenario, options)
        if options.lock_limit is None:
            simulation = simulation.with_options(lock_limit=_default_lock_limit(simulation))
        return cls(simulation=simulation)

    def run(self, seed: int, progress: Progress | None = None) -> Run:
        """Run with one seed; `progress` is called now and then with the share that is done."""
        run = run_simulation(self.simulation, seed=seed, progress=progress)
        return _with_error_before_touchdown(run)

    def with_finer_snap(self, found: Sequence[Run]) -> list[Run]:
        """Return the runs, the one with the largest snap load told how sure that is.

        A snap is a wave in the rope, which few masses blunt: the run is repeated with the same
        seed on as many masses as there may be, and says both loads.  Not where every sample asks
        a controller in Python, which would take its time again; nor on a rope so short that its
        waves are faster than a run can follow, where few masses blunt nothing.
        """
        runs, simulation = list(found), self.simulation
        loads = [run.statistics.quantities.get("snap load") for run in runs]
        sizes = [-math.inf if q is None or math.isnan(q.value) else q.value for q in loads]
        at = max(range(len(runs)), key=sizes.__getitem__, default=0)
        ropes = [name for name in simulation.loop.states if name.startswith("plant.rope.")]
        masses = 1 + sum(name.endswith("velocity") for name in ropes)
        cut_short = any(run.status == "interrupted" for run in runs)
        if cut_short or math.isinf(max(sizes, default=-math.inf)):
            return runs
        if not simulation.fused or masses >= MAX_MASSES:
            return runs
        options = replace(simulation.options, masses=MAX_MASSES, step=None)
        try:
            finer = prepare(simulation.case, simulation.controller, simulation.scenario, options)
        except InputError:
            return runs
        again = run_simulation(finer, seed=runs[at].seed)
        if again.status != runs[at].status:
            return runs
        found_again = again.statistics.value("snap load")
        load, size = 0.0 if math.isnan(found_again) else found_again, sizes[at]
        text = (
            f"snap load {quantity(size, 'N')} on {masses} masses, {quantity(load, 'N')} on "
            f"{MAX_MASSES}: uncertain by {number(100.0 * abs(load / size - 1.0), 2)} %"
        )
        event = Event(time=runs[at].statistics.value("snap load at"), kind="snap", text=text)
        events = tuple(sorted((*runs[at].events, event), key=lambda event: event.time))
        named = {FINER_SNAP: NamedQuantity(value=load, unit="N")}
        runs[at] = _with_quantities(replace(runs[at], events=events), named)
        return runs

    def runs(self, found: Sequence[Run]) -> Runs:
        """Return runs of this series as one result."""
        simulation = self.simulation
        return Runs(
            runs=tuple(found),
            scenario=simulation.scenario,
            lock_limit=simulation.options.lock_limit,
        )


def _default_lock_limit(simulation: Simulation) -> float | None:
    """Return the significant height of the hook's motion [m], where that makes sense."""
    hook = simulation.hook
    if not isinstance(hook, SpectrumMotion) or not stays(simulation.scenario):
        return None
    return None if holds_brake(simulation.controller) else 4.0 * hook.hook.displacement.rms


def _with_error_before_touchdown(run: Run) -> Run:
    """Return a run that also knows how far off the payload was before it touched down.

    What is asked afterwards is below the ground, so the error of the whole run says nothing.
    """
    found = run.statistics.quantities.get("touch-down at")
    if found is None:
        return run
    counted = (run.time >= run.statistics.settle) & (run.time < found.value)
    error = error_of(run)[counted]
    rms, largest = math.nan, math.nan
    if error.size:
        rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    named = {
        "error before touch-down rms": NamedQuantity(value=rms, unit="m"),
        "error before touch-down largest": NamedQuantity(value=largest, unit="m"),
    }
    return _with_quantities(run, named)


def _with_quantities(run: Run, named: Mapping[str, NamedQuantity]) -> Run:
    """Return a run that also knows some quantities."""
    quantities = {**run.statistics.quantities, **named}
    return replace(run, statistics=replace(run.statistics, quantities=quantities))


@shows_progress("simulating")
def simulate(
    case: Case,
    controller: str | Design | Tuning | Controller = "feedback",
    *,
    scenario: str | Scenario = "hold",
    options: Mapping[str, object] | None = None,
    hook: MotionSource | None = None,
    seeds: int | Sequence[int] = 1,
    duration: float | str | None = None,
    design: Design | Tuning | None = None,
    gains: Mapping[str, float] | None = None,
    sample_time: float | None = None,
    step: float | None = None,
    masses: int | None = None,
    limits: DriveLimits | None = None,
    parameters: Mapping[str, float] | None = None,
    settle: float | None = None,
    store_step: float | None = None,
    lock_limit: float | None = None,
    deadline: float | None = None,
    compiled: bool | None = None,
    traces: Literal["all", "worst"] = "all",
    progress: Progress | None = None,
) -> Runs:
    """Simulate a controller over seeds.

    Parameters
    ----------
    case
        Vessel, sea, rope, payload, winch and sensors.
    controller
        The name of a controller (`stillhook.controllers.CONTROLLER_TEXTS`); a design, whose
        feedback is meant; or any object with ``name``, ``sample_time``, ``reset()`` and
        ``step(measurement, time)`` (`models.sensing.control.Controller`).
    scenario, options
        An operation, or the name of one and its options: numbers in SI, or texts with a unit
        (`models.operation.scenarios`).
    hook
        Motion of the hook, such as ``sh.RecordMotion.read("heave.csv")``; by default drawn from
        the case's sea.
    seeds
        How many runs, or their seeds.
    duration
        Length of a run [s], or a text such as ``"3 h"``; by default the scenario's own.
    design, gains
        For "feedback": gains count before a design, a design before the gains of the case.
    sample_time
        Of a controller by name or of a design [s]; by default its own.
    step, masses, limits, parameters, settle, store_step, deadline, compiled
        See `models.simulation.SimulationOptions`.
    lock_limit
        Size of the payload's error beyond which it counts as having lost lock [m]; by default
        the significant height of the hook's motion in the case's sea, where the payload is to
        stay in its place.
    traces
        Whether all runs keep their time traces, up to 8 MB each, or the one with the largest
        error alone; the statistics are of every sample all the same.
    progress
        Called now and then with the share of the whole that is done.

    Returns
    -------
    Runs
        Also of runs that diverged; after Ctrl-C those that there are.

    Raises
    ------
    InputError
        If an argument is out of range, a name is unknown, or the step is too long for the plant.
    SynthesisError
        If the controller is not stable on the linear plant of the case.
    SolverError
        If there is no static operating point, or the controller's recursion fails.

    Examples
    --------
    >>> import stillhook as sh
    >>> runs = sh.simulate(sh.load_case("thesis-1975"), "none", seeds=3, duration="5 min")
    >>> len(runs), runs.completed, runs.summary["payload rms"].count
    (3, True, 3)
    """
    numbers = seeds_of("simulate", seeds)
    check_choice("simulate", "traces", traces, ("all", "worst"))
    if isinstance(scenario, str):
        scenario = scenario_named(scenario, case, **(options or {}))
    elif options:
        raise InputError("simulate: options are for a scenario by its name")
    series = Series.prepare(
        case,
        # A lift in air is another case, with another static command, than the one given.
        controller_of(
            controller, scenario.case_for(case), design=design, gains=gains, sample_time=sample_time
        ),
        scenario,
        SimulationOptions(
            hook=hook,
            duration=None
            if duration is None
            else seconds_of("simulate: duration", duration, high=1e8),
            step=step,
            masses=masses,
            limits=limits,
            parameters=parameters,
            settle=settle,
            store_step=store_step,
            lock_limit=lock_limit,
            deadline=deadline,
            compiled=compiled,
        ),
    )
    found: list[Run] = []
    for done, seed in enumerate(numbers):
        tell = None if progress is None else _part(progress, done, len(numbers))
        # Small matrices: a second BLAS thread only gets in the way of a controller in Python.
        with one_thread():
            found.append(series.run(seed, tell))
        if traces == "worst":
            found = keep_worst(found)
        if found[-1].status == "interrupted":
            break
    with one_thread():
        return series.runs(series.with_finer_snap(found))


def seeds_of(owner: str, seeds: int | Sequence[int]) -> tuple[int, ...]:
    """Return the seeds: 0 to n - 1, or those given.

    Raises InputError if there is none, one is negative, or one comes twice.
    """
    if isinstance(seeds, int):
        check_range(owner, "seeds", seeds, low=1)
        return tuple(range(seeds))
    found = tuple(check_seed(owner, seed) for seed in seeds)
    if not found or len(set(found)) != len(found):
        raise InputError(f"{owner}: seeds must be distinct whole numbers, got {list(found)}")
    return found


def seconds_of(owner: str, value: float | str, *, high: float, positive: bool = True) -> float:
    """Return a time that was given as a number [s] or as a text with a unit.

    Raises InputError if it is none, or not above 0 (at least 0 unless `positive`) and up to the
    highest.
    """
    try:
        return float(Quantity("time", 0.0, high, open_low=positive).read(value))
    except InputError as error:
        raise InputError(f"{owner} {error}") from None


def _part(progress: Progress, done: int, total: int) -> Progress:
    def tell(share: float) -> None:
        progress((done + share) / total)

    return tell
