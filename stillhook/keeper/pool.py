"""Pools of workers that do tasks, and what follows when one dies (`Pool`, `Alone`).

    tasks --> Pool.submit --> a worker's bench --> Pool.wait --> answers

A pool is begun with a *bench* that does tasks (`Bench.do`), of which every worker gets a copy.  A
task whose worker was killed is done once more, by another worker; one that kills two is answered
with `Died`.
"""

import os
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeVar

from typing_extensions import override

from models.basics import StillhookError

POLL = 0.2  #: Time between two looks at Ctrl-C [s].

_RETRIES = 1  # of a task whose worker was killed


class Task(Protocol):
    """Something to do; it can be hashed and pickled."""

    @property
    def group(self) -> Hashable:
        """What is prepared once for several tasks; None if nothing is."""


class Bench(Protocol):
    """Does tasks, one after the other; before the first one it can be pickled."""

    def do(self, task: Any, progress: Any = None, /) -> Any:
        """Return the answer to a task; `progress` is called with how far it is."""


T = TypeVar("T", bound=Task)


@dataclass(frozen=True, kw_only=True)
class Died:
    """An answer that never came: the worker is gone, and so was another before it."""

    reason: str


class Pool(ABC):
    """Does tasks; a context manager, once begun, that ends the work.

    It has a name, for results, and so many `jobs`, its workers.
    """

    name: str
    jobs: int

    def begin(self, bench: Bench, count: int) -> Self:
        """Start the workers for as many tasks as there are; return the pool."""
        self._deaths = Counter[Hashable]()
        self._start(bench, count)
        return self

    @property
    @abstractmethod
    def idle(self) -> int:
        """How many tasks could be taken at once."""

    @property
    @abstractmethod
    def busy(self) -> int:
        """How many tasks are under way."""

    @property
    def lasts(self) -> list[Hashable]:
        """The group of tasks that each idle worker has prepared, where it can be chosen."""
        return []

    @abstractmethod
    def submit(self, task: Task) -> None:
        """Take a task; only while `idle`."""

    def wait(self, timeout: float) -> tuple[Any, Any] | None:
        """Return a task and its answer, or `Died`; None if there is none in time [s]."""
        found = self._answer(timeout)
        if found is None or not isinstance(found[1], Died):
            return found
        task, died = found
        self._deaths[task] += 1
        if self._deaths[task] <= _RETRIES:
            self.submit(task)
            return None
        return task, Died(reason=f"{died.reason}, twice")

    def answers(self, tasks: Iterator[T]) -> Iterator[tuple[T, Any] | None]:
        """Yield tasks with their answers as they come; None now and then, to look at a clock.

        Tasks are taken from the iterator as there is room: a million of them burden nobody.
        """
        ahead = next(tasks, None)
        while ahead is not None or self.busy:
            while ahead is not None and self.idle:
                self.submit(ahead)
                ahead = next(tasks, None)
            yield self.wait(POLL)

    @abstractmethod
    def _start(self, bench: Bench, count: int) -> None:
        """Start the workers."""

    @abstractmethod
    def _answer(self, timeout: float) -> tuple[Any, Any] | None:
        """Return a task and its answer, or of what its worker died; None if there is none."""

    @abstractmethod
    def end(self) -> None:
        """End the work now, whatever is under way."""

    def __enter__(self) -> Self:
        """Return the pool."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the work."""
        self.end()


class Alone(Pool):
    """One task after the other in this process: for what cannot leave it.

    `progress` is called with whatever a task says of how far it is; it may raise KeyboardInterrupt.
    """

    name, jobs = "serial", 1

    def __init__(self, progress: Callable[..., None] | None = None) -> None:
        self._progress = progress

    @property
    @override
    def idle(self) -> int:
        return 1 - len(self._tasks)

    @property
    @override
    def busy(self) -> int:
        return len(self._tasks)

    @override
    def submit(self, task: Task) -> None:
        self._tasks.append(task)

    @override
    def end(self) -> None:
        self._tasks.clear()

    @override
    def _start(self, bench: Bench, count: int) -> None:
        self._bench, self._tasks = bench, deque[Task]()

    @override
    def _answer(self, timeout: float) -> tuple[Any, Any] | None:
        task = self._tasks.popleft()
        return task, self._bench.do(task, self._progress)


def failure(error: Exception) -> str:
    """Return what a task failed of, which may be anything where the user's own code is called."""
    return str(error) if isinstance(error, StillhookError) else f"{type(error).__name__}: {error}"


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1
