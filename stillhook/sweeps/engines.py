"""Where cases are run: in this process, in a pool of processes, on a cluster.

    engine.run(question, tasks) --> (task, CaseResult) ..., as they are done; None now and then

Every engine runs `TimeBench.do`, one case at a time on one BLAS thread, so that the numbers do not
depend on the engine.  A case whose process was killed is run again; one that kills its process
twice is told as "died".  The driver (`stillhook.sweeps.time_sweep`) keeps what comes.
"""

from __future__ import annotations

import itertools
import os
import sys
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Generator, Iterator

from typing_extensions import override

from models.basics import InputError, check_range

from ..keeper import Died, Pool
from .time_cases import CaseResult, CaseTask, TimeQuestion

Answers = Generator[tuple[CaseTask, CaseResult] | None, None, None]

RETRIES = 1
"""How often a case is run again whose process was killed."""

_POLL = 0.2  # between two looks at Ctrl-C [s]


class Engine(ABC):
    """Runs cases."""

    name: str
    jobs: int

    @abstractmethod
    def run(self, question: TimeQuestion, tasks: Iterator[CaseTask], count: int) -> Answers:
        """Run cases in any order.

        Parameters
        ----------
        question
            What every case is asked.
        tasks
            The cases; as many are taken as are under way.
        count
            How many there are.

        Yields
        ------
        (CaseTask, CaseResult) or None
            A case that is done; None several times a second, so that the driver may look at its
            clock.  Closing the iterator ends the work.
        """


class Todo:
    """Cases still to be done, one ahead of an iterator, and those that have to be done again."""

    def __init__(self, tasks: Iterator[CaseTask]) -> None:
        self._tasks = tasks
        self._ahead = deque(itertools.islice(tasks, 1))

    def __bool__(self) -> bool:
        return bool(self._ahead)

    def take(self) -> CaseTask:
        """Return the next."""
        task = self._ahead.popleft()
        if not self._ahead:
            self._ahead.extend(itertools.islice(self._tasks, 1))
        return task

    def put_back(self, task: CaseTask) -> None:
        """Let a case be the next again."""
        self._ahead.appendleft(task)


class Serial(Engine):
    """One case after the other in this process: for controllers that cannot leave it."""

    name, jobs = "serial", 1

    @override
    def run(self, question: TimeQuestion, tasks: Iterator[CaseTask], count: int) -> Answers:
        del count
        bench = question.bench()
        for task in tasks:
            yield task, bench.do(task)


class Processes(Engine):
    """Processes on this machine, those of `sh.compare`: spawned, with one BLAS thread each.

    Parameters
    ----------
    jobs
        How many; by default one for each core that this process may use.
    """

    name = "processes"

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = usable_cores() if jobs is None else jobs
        check_range("sweep", "jobs", self.jobs, low=1, high=512)
        self.pids: tuple[int, ...] = ()

    @override
    def run(self, question: TimeQuestion, tasks: Iterator[CaseTask], count: int) -> Answers:
        todo, deaths = Todo(tasks), Counter[int]()
        if not todo:
            return
        with Pool.of(min(self.jobs, count), question) as pool:
            while todo or pool.busy:
                while pool.idle and todo:
                    pool.submit(todo.take())
                self.pids = tuple(pool.pids)
                answered = pool.wait(_POLL)
                if answered is None:
                    yield None
                    continue
                task, answer = answered
                assert isinstance(task, CaseTask)
                if isinstance(answer, Died):
                    deaths[task.index] += 1
                    if deaths[task.index] <= RETRIES:
                        todo.put_back(task)
                        continue
                    answer = died(question, task, answer.reason)
                yield task, answer


def died(question: TimeQuestion, task: CaseTask, reason: str) -> CaseResult:
    """Return the result of a case whose process was killed once too often."""
    values = dict.fromkeys(question.metrics, float("nan"))
    return CaseResult(index=task.index, status="died", message=f"{reason}, twice", values=values)


def engine_of(
    wanted: str | Engine | None, question: TimeQuestion, jobs: int | None = None
) -> Engine:
    """Return the engine that is meant.

    Parameters
    ----------
    wanted
        "serial", "processes", an address of a dask scheduler such as ``tcp://10.0.0.1:8786``,
        ``local:4`` for a dask cluster of four processes here, or an engine; by default processes.
    question
        What is asked; a controller that cannot be sent anywhere is run in this process.
    jobs
        Number of processes.

    Raises
    ------
    InputError
        If there is no such engine, or the controller cannot be sent to it.
    """
    stays = not question.pilot.portable
    if isinstance(wanted, Engine):
        found = wanted
    elif wanted is None or wanted == "processes":
        here = stays or jobs == 1 or not sys.executable
        found = Serial() if here and wanted is None else Processes(jobs)
    elif wanted == "serial":
        found = Serial()
    elif ":" in wanted:
        from .cluster import Cluster

        found = Cluster(wanted)
    else:
        raise InputError(
            "sweep: engine must be serial, processes, local:N or the address of a dask scheduler "
            f"such as tcp://10.0.0.1:8786; got {wanted!r}"
        )
    if stays and not isinstance(found, Serial):
        raise InputError(
            f"sweep: the controller {question.pilot.name} cannot be sent to another process "
            '(it was made at a prompt or in a script); put it in a module, or take engine="serial"'
        )
    return found


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1
