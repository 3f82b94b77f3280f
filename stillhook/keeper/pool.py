"""Processes that share the runs of a comparison, and what to do when one of them dies.

    tasks --> Pool.submit --> a process of `stillhook.keeper.worker` each --> Pool.wait --> answers

Each process has one thread here that hands it a task and waits for the answer, so that it is
known which task a process died of.  The processes have a session of their own: Ctrl-C reaches the
parent alone, which ends them.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from .worker import Task, receive, send

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from stillhook.keeper.worker import serve; serve()"
)
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, kw_only=True)
class Died:
    """An answer that never came: the process that worked on it is gone."""

    reason: str


class _Process:
    """A process and the thread that talks to it."""

    def __init__(self, setup: object, answers: queue.Queue[tuple[_Process, Task, Any]]) -> None:
        self.last: tuple[str, float] | None = None
        self._answers = answers
        self._tasks: queue.Queue[Task | None] = queue.Queue()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **dict.fromkeys(_THREADS, "1")},
            start_new_session=True,
        )
        self._setup = setup
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    def give(self, task: Task) -> None:
        self.last = task.group
        self._tasks.put(task)

    def end(self) -> None:
        """End the process now, whatever it does."""
        self._tasks.put(None)
        self._process.kill()
        self._process.wait()
        self._thread.join()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        self._said.close()

    def _talk(self) -> None:
        into, out = self._process.stdin, self._process.stdout
        assert into is not None
        assert out is not None
        fresh = True
        while (task := self._tasks.get()) is not None:
            try:
                if fresh:
                    send(into, self._setup)
                    fresh = False
                send(into, task)
                answer = receive(out)
            except (EOFError, OSError, ValueError):
                answer = Died(reason=self._obituary())
            self._answers.put((self, task, answer))
            if isinstance(answer, Died):
                return

    def _obituary(self) -> str:
        """Return what the process died of."""
        code = self._process.wait()
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"its process was ended by {signal.Signals(-code).name}"
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        said = f": {lines[-1].strip()}" if lines else ""
        return f"its process ended with status {code}{said}"


class Pool:
    """Processes that do tasks; a context manager that ends them all.

    Parameters
    ----------
    jobs
        How many.
    question, contenders
        What `stillhook.keeper.worker.Bench` needs.
    """

    def __init__(self, jobs: int, question: object, contenders: Mapping[str, object]) -> None:
        self._begin(jobs, (question, dict(contenders)))

    @classmethod
    def of(cls, jobs: int, setup: object) -> Pool:
        """Return processes for another kind of work: `setup.bench()` is what does the tasks."""
        pool = cls.__new__(cls)
        pool._begin(jobs, setup)
        return pool

    def _begin(self, jobs: int, setup: object) -> None:
        self._setup = setup
        self._answers: queue.Queue[tuple[_Process, Task, Any]] = queue.Queue()
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()
        for _ in range(jobs):
            self._idle.append(_Process(self._setup, self._answers))

    @property
    def idle(self) -> int:
        """How many processes have nothing to do."""
        return len(self._idle)

    @property
    def busy(self) -> int:
        """How many tasks are being done."""
        return len(self._busy)

    @property
    def lasts(self) -> list[tuple[str, float] | None]:
        """What each idle process has prepared."""
        return [process.last for process in self._idle]

    @property
    def pids(self) -> list[int]:
        """The processes' numbers."""
        return [process.pid for process in (*self._idle, *self._busy)]

    def submit(self, task: Task) -> None:
        """Give a task to an idle process, best to one that has prepared it already."""
        best = next((p for p in self._idle if p.last == task.group), None)
        process = best or next((p for p in self._idle if p.last is None), self._idle[0])
        self._idle.remove(process)
        self._busy.add(process)
        process.give(task)

    def wait(self, timeout: float) -> tuple[Task, Any] | None:
        """Return a task and its answer, or `Died`; None if there is none in time [s]."""
        try:
            process, task, answer = self._answers.get(timeout=timeout)
        except queue.Empty:
            return None
        self._busy.discard(process)
        if isinstance(answer, Died):
            process.end()
            process = _Process(self._setup, self._answers)
        self._idle.append(process)
        return task, answer

    def __enter__(self) -> Pool:
        """Return the pool."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End the processes."""
        for process in (*self._idle, *self._busy):
            process.end()
        self._idle, self._busy = [], set()
