"""Taking turns: everybody answers the same questions, in a process of his own, round after round.

    Task --> Worker (one process, one core) --> times and answers of each round --> Timing

Whatever else the machine does hits all alike, and a solver that crashes takes nobody with it.
Times are processor times; that of a question is the median of its repetitions.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpc_report import Timing
from mpc_solvers import version_of

__all__ = ["Replay", "Task", "Worker", "measure", "nothing", "timed"]

FloatArray = npt.NDArray[np.float64]
#: Goes through the questions: processor and wall time of each [s], and the first moves.
Replay = Callable[[], tuple[FloatArray, FloatArray, FloatArray]]

OFF = 1e-2  # of the peak torque, beyond which an answer counts as none
_FORK = multiprocessing.get_context("fork")


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """Somebody who answers questions; `begin` sets up and returns what goes through them.

    `reference` holds the right answers, of as many questions as it takes.
    """

    name: str
    statement: str
    package: str
    sea: str
    horizon: float
    moves: int
    begin: Callable[[], Replay]
    reference: FloatArray


class Worker:
    """A process for a task, that goes through the questions when it is told to.

    A solver that crashes takes its process with it, and no more.
    """

    def __init__(self, task: Task, core: int | None) -> None:
        self.task = task
        self._here, there = _FORK.Pipe()
        self._process = _FORK.Process(target=_serve, args=(task, there, core), daemon=True)
        with warnings.catch_warnings():
            # From Python 3.12 on, of other threads: those of a test runner do no harm here.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process.start()
        there.close()
        self.trouble = self._hear()

    def replay(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Return times and moves, None if there is trouble."""
        if self.trouble is not None:
            return None
        self._here.send("again")
        answer = self._hear()
        if isinstance(answer, str):
            self.trouble = answer
            return None
        return answer  # type: ignore[no-any-return]

    def _hear(self) -> Any:
        try:
            return self._here.recv()
        except EOFError:
            self._process.join()
            return f"crashed (exit code {self._process.exitcode})"

    def stop(self) -> None:
        """End the process."""
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()


def _serve(task: Task, pipe: Any, core: int | None) -> None:
    """Set up, then go through the questions whenever asked; in the child."""
    if core is not None:
        os.sched_setaffinity(0, {core})
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)  # solvers greet
    os.dup2(null, 2)
    try:
        replay = task.begin()
        pipe.send(None)
        while True:
            pipe.recv()
            pipe.send(replay())
    except EOFError:
        pass
    except BaseException as error:
        pipe.send(f"{type(error).__name__}: {error}".strip().splitlines()[0][:200])


def timed(count: int, ask: Callable[[int], float], before: Callable[[int], None]) -> Any:
    """Return processor and wall time of each question [s], and the answers."""
    cpu, wall, moves = np.zeros(count), np.zeros(count), np.zeros(count)
    for k in range(count):
        before(k)
        began, at = clock.perf_counter_ns(), clock.process_time_ns()
        move = ask(k)
        cpu[k] = 1e-9 * (clock.process_time_ns() - at)
        wall[k] = 1e-9 * (clock.perf_counter_ns() - began)
        moves[k] = move
    return cpu, wall, moves


def nothing(k: int) -> None:
    pass


def measure(
    tasks: Sequence[Task],
    *,
    repetitions: int,
    enough: float,
    tell: Callable[[str], None] = lambda text: None,
) -> list[Timing]:
    """Return the timings of tasks that take turns on one core.

    Each goes through its questions until it has done so often enough, or has spent enough of the
    processor's time [s].
    """
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    core = max(cores) if cores else None
    workers = []
    for task in tasks:
        tell(f"{task.sea}, {task.horizon:g} s: {task.name} sets up")
        workers.append(Worker(task, core))
    found: list[list[tuple[FloatArray, FloatArray, FloatArray]]] = [[] for _ in workers]
    spent = [0.0] * len(workers)
    for _ in range(repetitions):
        for at, worker in enumerate(workers):
            if spent[at] > enough:
                continue
            tell(f"{worker.task.sea}, {worker.task.horizon:g} s: {worker.task.name}")
            answer = worker.replay()
            if answer is not None:
                found[at].append(answer)
                spent[at] += float(answer[0].sum())
    for worker in workers:
        worker.stop()
    return [_timing(worker, runs) for worker, runs in zip(workers, found, strict=True)]


def _timing(worker: Worker, runs: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> Timing:
    """Return what became of a task."""
    task = worker.task
    shown = {"name": task.name, "statement": task.statement, "sea": task.sea}
    shown |= {"version": version_of(task.package) or "", "trouble": worker.trouble or ""}
    if not runs:
        return Timing(**shown, horizon=task.horizon, moves=task.moves)
    cpu = 1e6 * np.median([run[0] for run in runs], axis=0)
    wall = 1e6 * np.median([run[1] for run in runs], axis=0)
    moves = runs[0][2]
    off = np.abs(moves - task.reference[: len(cpu)])
    known = off[np.isfinite(off)]
    return Timing(
        **shown,
        horizon=task.horizon,
        moves=task.moves,
        median=float(np.median(cpu)),
        p99=float(np.quantile(cpu, 0.99)),
        largest=float(cpu.max()),
        wall=float(np.median(wall)),
        error=float(known.max()) if len(known) else math.nan,
        usual_error=float(np.median(known)) if len(known) else math.nan,
        failed=int((np.isnan(moves) | (off > OFF)).sum()),
        questions=len(cpu),
        repetitions=len(runs),
    )
