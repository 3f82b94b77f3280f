"""One case of a sweep in time: changed plant, controller, seed, and the numbers of its run.

    TimeQuestion --(to any process)--> do(CaseTask) --> CaseResult (plain data)

The same function does a case in this process, in a pool and on a cluster, on one BLAS thread, from
the case, its changes and its seed alone: so the numbers are the same to the last bit wherever and
in whatever order it is done.
"""

import math
import time as clock
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import PhysicsWarning, one_thread
from models.case import Case
from models.operation import scenario_named, with_faults
from models.run import Run
from models.sensing import Controller
from models.simulation import Progress, SimulationOptions

from ..controllers import Recipe
from ..keeper import failure
from ..runs import Series
from .time_metrics import numbers_of, status_of
from .trim import Shift, shift_between, static_of, trimmed

_PURPOSE = 7  # second entry of the seeds of cases; those of a run's own draws are others


@dataclass(frozen=True, kw_only=True)
class CaseTask:
    """A case to be run."""

    index: int  #: Its number in the sweep.
    seed: int  #: Of its run.
    #: Values by path of the case, by gain, and by ``fault.`` path.
    changes: Mapping[str, float] = field(default_factory=dict, compare=False)
    gains: Mapping[str, float] = field(default_factory=dict, compare=False)
    faults: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def group(self) -> None:
        """Nothing is prepared for several cases."""

    def __str__(self) -> str:
        """Return what it is called in a message."""
        return f"case {self.index}"


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """What came of a case."""

    index: int  #: Its number in the sweep.
    status: str  #: A name of `time_metrics.STATUS`.
    message: str = ""  #: Why it failed, if it did.
    #: Metrics by name, SI; NaN where there is none.
    values: Mapping[str, float] = field(default_factory=dict)
    wall: float = math.nan  #: Time that it took, preparing included [s].


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeQuestion:
    """What every case of a sweep is asked; it does the cases, one after the other."""

    case: Case  #: The nominal case, which the controller is made for unless it follows.
    recipe: Recipe  #: How the controller is made.
    metrics: tuple[str, ...]  #: What is kept, names of `time_metrics.METRICS`.
    #: Length of a run, and when its statistics begin [s]; None: as `sh.simulate` has it.
    duration: float
    settle: float | None = None
    #: The operation by its name, and its options.
    scenario: str = "hold"
    options: Mapping[str, Any] = field(default_factory=dict)
    #: Of the simulated plant, as for `sh.simulate`.
    masses: int | None = None
    compiled: bool | None = None
    #: Whether the controller is made for each case; a design is then designed anew.
    design_follows: bool = False
    #: Whether a controller that does not follow knows the static load, by the load cell.
    weighed: bool = True
    starts: int = 8  #: Starts of the searches of designs that follow.

    def do(self, task: CaseTask, progress: Progress | None = None) -> CaseResult:
        """Return what comes of a case; what is wrong with it is part of the answer.

        Raises KeyboardInterrupt if the run was interrupted: half a run is worth nothing.
        """
        began = clock.perf_counter()
        with warnings.catch_warnings(), one_thread():
            warnings.simplefilter("ignore", PhysicsWarning)  # told once, of the nominal case
            try:
                run = self.run(task, progress)
                status, message = status_of(run), run.message
                values = numbers_of(run, self.metrics)
            except Exception as error:  # what a controller of the user's own may do
                message = failure(error)
                status, values = "failed", dict.fromkeys(self.metrics, math.nan)
        wall = clock.perf_counter() - began
        return CaseResult(
            index=task.index, status=status, message=message, values=values, wall=wall
        )

    def run(self, task: CaseTask, progress: Progress | None = None) -> Run:
        """Return the whole run of a case, with its traces.

        Raises InputError, SynthesisError, SolverError if there is no such case, or no controller
        for it; KeyboardInterrupt if it was interrupted.
        """
        case = self.case.replace(task.changes) if task.changes else self.case
        controller = self.controller(case, task)
        scenario = scenario_named(self.scenario, self.case, **self.options)
        series = Series.prepare(
            case,
            controller,
            with_faults(scenario, task.faults, case, self.duration),
            SimulationOptions(
                duration=self.duration,
                settle=self.settle,
                masses=self.masses,
                compiled=self.compiled,
            ),
        )
        run = series.run(task.seed, progress)
        if run.status == "interrupted":
            raise KeyboardInterrupt
        return run

    def controller(self, case: Case, task: CaseTask) -> Controller:
        """Return the controller of a case: made for the nominal one, or for this one."""
        if self.design_follows:
            return self.recipe.follow(case, self.starts)
        own = self._own
        if task.gains:
            own = self.recipe.with_gains(self.case, task.gains).controller(self.case)
        if not (self.weighed and task.changes):
            return own
        return trimmed(own, shift_between(self._static, static_of(case)))

    @cached_property
    def _own(self) -> Controller:
        """The controller of the nominal case."""
        return self.recipe.controller(self.case)

    @cached_property
    def _static(self) -> Shift:
        """The static state of the nominal case."""
        return static_of(self.case)


def seed_of(seed: int, index: int, *, common: bool = False) -> int:
    """Return the seed of a case's run, which depends on its number and the sweep's seed alone.

    With a `common` one all cases meet the same sea and noise.

    Examples
    --------
    >>> seed_of(0, 3), seed_of(0, 3, common=True) == seed_of(0, 4, common=True)
    (3725892462, True)
    """
    entropy = [seed, _PURPOSE, 0 if common else index + 1]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
