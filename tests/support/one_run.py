"""One run, prepared and simulated in one call."""

from __future__ import annotations

from typing import Any

from models.case import Case
from models.operation import Scenario
from models.run import Run
from models.sensing import Controller
from models.simulation import Progress, SimulationOptions, prepare, run_simulation


def simulate(
    case: Case,
    controller: Controller,
    *,
    scenario: Scenario | str = "hold",
    seed: int = 0,
    progress: Progress | None = None,
    **options: Any,
) -> Run:
    """Return the run; `options` are those of `SimulationOptions`."""
    simulation = prepare(case, controller, scenario, SimulationOptions(**options))
    return run_simulation(simulation, seed=seed, progress=progress)
