"""Runs that differ in their seed alone, prepared once for all of them (`Series`).

    case, controller by name, of a design or of the user's own --> Series --> run(seed)

`stillhook.runs.simulation` and the command line make `Runs` of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.case import Case
from models.operation import Scenario, SpectrumMotion
from models.run import NamedQuantity, Run
from models.sensing import Controller, holds_brake
from models.simulation import (
    Progress,
    Simulation,
    SimulationOptions,
    prepare,
    run_simulation,
)

from .runs import Runs, stays
from .window import error_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """Runs that differ in their seed alone, prepared but not yet run.

    Attributes
    ----------
    simulation
        The prepared simulation.
    """

    simulation: Simulation

    @classmethod
    def prepare(
        cls,
        case: Case,
        controller: Controller,
        scenario: Scenario,
        options: SimulationOptions,
    ) -> Series:
        """Prepare, the controller made for the scenario's own case (`Scenario.case_for`).

        Raises
        ------
        InputError, SolverError
            As `models.simulation.prepare`.
        """
        if options.duration is not None:
            scenario = replace(scenario, duration=options.duration)
        simulation = prepare(case, controller, scenario, options)
        if options.lock_limit is None:
            simulation = simulation.with_options(lock_limit=_default_lock_limit(simulation))
        return cls(simulation=simulation)

    def run(self, seed: int, progress: Progress | None = None) -> Run:
        """Run with one seed; `progress` is called now and then with the share that is done."""
        run = run_simulation(self.simulation, seed=seed, progress=progress)
        return _with_error_before_touchdown(run)

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
    quantities = {
        **run.statistics.quantities,
        "error before touch-down rms": NamedQuantity(value=rms, unit="m"),
        "error before touch-down largest": NamedQuantity(value=largest, unit="m"),
    }
    return replace(run, statistics=replace(run.statistics, quantities=quantities))
