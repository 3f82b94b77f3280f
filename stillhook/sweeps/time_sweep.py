"""A sweep in time from its question to its result (`run_sweep`): draws, tasks, pool, journal.

    TimeQuestion, Draw --> tasks --> engine --> store (or memory) --> xarray.Dataset

The driver knows which cases are done and hands out the others; it never looks into a run.
"""

from __future__ import annotations

import contextlib
import math
import sys
import time as clock
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from models.basics import FloatArray, InputError, check_range
from models.operation import FAULTS, PREFIX, scenario_named
from models.spread import Spread
from synth.sweeps import ATTRIBUTE, coordinates_of

from ..keeper import Alone, Cluster, Died, Pool, Processes
from ..text import OutputFolder, Progress
from .export import write_result
from .store import Draw, Results, header_of, places_of, text_of
from .time_cases import CaseResult, CaseTask, TimeQuestion
from .time_metrics import METRICS, STATUS

if TYPE_CHECKING:
    import xarray as xr

_TOLD = 20  # reasons of failed cases that a result tells


def run_sweep(
    question: TimeQuestion,
    draw: Draw,
    *,
    engine: str | Pool | None = None,
    jobs: int | None = None,
    store: str | Path | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Run what is missing of a sweep, and return all of it along "case".

    Engine and jobs are as for `engine_of`.  The store is a folder in which results are kept as they
    come, or a file (``.nc``) beside whose name they are (``.jsonl``); None for memory alone.
    `progress` is called as progress(what, done, total), several times a second; it may raise
    KeyboardInterrupt.  ``attrs["complete"]`` is 1 if every case is there, 0 after Ctrl-C.

    Raises InputError if the spread cannot be run in time, or the store is another's or spoilt;
    SolverError if the cluster is gone.
    """
    last = draw.first + draw.samples
    rows = draw.spread.sample(last, draw.sampling, draw.seed, start=draw.first, stop=last)
    if len(rows) != draw.samples:
        raise InputError(f"sweep: the spread gives {len(rows)} cases, not {draw.samples}")
    _check(question, draw.spread)
    tell = progress or (lambda what, done, total: None)
    template = template_of(question, draw, rows)
    used = engine_of(engine, question, jobs)
    messages: dict[int, str] = {}
    began, wall = clock.perf_counter(), 0.0
    journal, export = (None, None) if store is None else places_of(store)
    if journal is not None:
        folder = OutputFolder.prepare(journal.parent)
        if export is not None and folder.path == Path(str(store)):  # not one that a file lies in
            folder.claim(journal, export)
    keeper = Results(template, journal)
    with keeper.journal or contextlib.nullcontext():
        missing = np.flatnonzero(~keeper.done)
        done, total = len(rows) - len(missing), len(rows)
        if missing.size and not question.design_follows:
            question.recipe.controller(question.case)  # one that cannot be made is told at once
        tasks = tasks_of(draw, rows, missing)
        with contextlib.suppress(KeyboardInterrupt), contextlib.ExitStack() as stack:
            tell("starting", done, total)
            # Entered at once: processes must not outlive the sweep when something raises.
            pool = stack.enter_context(used.begin(question, missing.size)) if missing.size else None
            for answered in pool.answers(tasks) if pool is not None else ():
                if answered is not None:
                    task, result = answered
                    died = isinstance(result, Died)
                    if isinstance(result, Died):
                        result = CaseResult(
                            index=task.index,
                            status="died",
                            message=result.reason,
                            values=dict.fromkeys(question.metrics, math.nan),
                        )
                    code, held = STATUS[result.status], result.status == "completed"
                    row = {"status": code, "stable": float(held), **result.values}
                    keeper.put(task.index, row, final=not died)
                    wall += 0.0 if died else result.wall
                    done += 1
                    if result.message and len(messages) < _TOLD:
                        messages[task.index] = result.message
                tell("", done, total)
        found = keeper.dataset()
        if export is not None:
            write_result(found, export)
    complete = bool((found["status"] != STATUS["not run"]).all())
    return found.assign_attrs(
        complete=int(complete),
        messages=[f"case {index}: {messages[index]}" for index in sorted(messages)],
        seconds=clock.perf_counter() - began,
        seconds_in_cases=wall,
        engine=used.name,
        jobs=used.jobs,
    )


def tasks_of(draw: Draw, rows: FloatArray, wanted: npt.NDArray[np.intp]) -> Iterator[CaseTask]:
    """Yield the cases of a sweep whose places among the rows are wanted, in their order.

    One at a time: a million of them would need more memory than their results.
    """
    spread = draw.spread
    faulty = [(j, path) for j, path in enumerate(spread.paths) if path.startswith(PREFIX)]
    for place in wanted:
        row, index = rows[place], draw.first + int(place)
        yield CaseTask(
            index=index,
            seed=draw.seeds([index])[0],
            changes=spread.changes(row),
            gains=spread.gains(row),
            faults={path: float(row[j]) for j, path in faulty},
        )


def template_of(question: TimeQuestion, draw: Draw, rows: FloatArray) -> xr.Dataset:
    """Return the result with nothing in it yet: coordinates, variables, units, attributes."""
    import xarray as xr

    n = len(rows)
    seeds = draw.seeds(range(draw.first, draw.first + n))
    coordinates = {
        "seed": ("case", np.array(seeds, np.int64), {"long_name": "seed of the run"}),
        **coordinates_of(draw.spread, rows, draw.first),
    }
    flags = {
        "long_name": "what became of the case",
        "flag_values": list(STATUS.values()),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in STATUS),
    }
    variables: dict[str, object] = {
        "status": ("case", np.full(n, STATUS["not run"], np.int8), flags),
        "stable": (
            "case",
            np.zeros(n, np.int8),
            {"long_name": "1 where the payload was held to the end: completed", "units": "1"},
        ),
    }
    for name in question.metrics:
        metric = METRICS[name]
        told = {"long_name": metric.text, "units": metric.unit}
        variables[name] = ("case", np.full(n, np.nan), told)
    header = header_of(question, draw)
    attributes = {
        "title": f"{question.recipe.name} on {n} cases about {question.case.name}, in time",
        "case_name": question.case.name,
        "controller": question.recipe.name,
        "mode": "time",
        "sampling": draw.sampling,
        "source": f"Stillhook {header['versions']['stillhook']}",
        ATTRIBUTE: text_of(header),
    }
    return xr.Dataset(variables, coords=coordinates, attrs=attributes)


def engine_of(wanted: str | Pool | None, question: TimeQuestion, jobs: int | None = None) -> Pool:
    """Return the pool that is meant, of so many processes: every one gives the same numbers.

    It is "serial", "processes", an address of a dask scheduler such as ``tcp://10.0.0.1:8786``,
    ``local:4`` for a dask cluster of four processes here, or a pool; by default processes.  A
    controller that cannot be sent anywhere is run in this process.

    Raises InputError if there is no such engine, or the controller cannot be sent to it.
    """
    stays = not question.recipe.portable
    found: Pool
    if isinstance(wanted, Pool):
        found = wanted
    elif wanted is None or wanted == "processes":
        if jobs is not None:
            check_range("sweep", "jobs", jobs, low=1, high=512)
        here = stays or jobs == 1 or not sys.executable
        found = Alone() if here and wanted is None else Processes(jobs)
    elif wanted == "serial":
        found = Alone()
    elif ":" in wanted:
        found = Cluster(wanted)
    else:
        raise InputError(
            "sweep: engine must be serial, processes, local:N or the address of a dask scheduler "
            f"such as tcp://10.0.0.1:8786; got {wanted!r}"
        )
    if stays and not isinstance(found, Alone):
        raise InputError(
            f"sweep: the controller {question.recipe.name} cannot be sent to another process "
            '(it was made at a prompt or in a script); put it in a module, or take engine="serial"'
        )
    return found


def _check(question: TimeQuestion, spread: Spread) -> None:
    """Say at once what no case could be run with."""
    scenario_named(question.scenario, question.case, **question.options)
    gains = [path for path in spread.paths if path.startswith("gains.")]
    if "drag" in spread.paths:
        raise InputError(
            "sweep: drag is a number of a design and plays no part in the time domain; vary "
            "payload.drag_coefficient"
        )
    if gains and question.design_follows:
        raise InputError(f"sweep: {gains[0]} cannot vary where the design follows the case")
    if gains and not question.recipe.gains:
        raise InputError(f"sweep: {question.recipe.name} has no gains that could vary ({gains[0]})")
    if any(path.startswith(PREFIX) for path in spread.paths):
        own = spread.distributions.get("fault.at")
        latest = FAULTS["at"].nominal if own is None else own.ends[1]
        if latest >= question.duration:
            raise InputError(
                f"sweep: fault.at must be before the end of the run, {question.duration:g} s, got "
                f"up to {latest:g} s; vary it too, or run for longer"
            )
