"""Processes of this machine as a pool, each with one thread of linear algebra.

    Processes.submit --(`channel`)--> serve, in a process of its own --(`channel`)--> wait

Each has one thread here that hands it a task and waits for the answer, so that it is known which
task a process died of.
"""

from __future__ import annotations

import pickle
import queue
import tempfile
import threading
from collections.abc import Hashable
from contextlib import suppress
from typing import Any

from typing_extensions import override

from models.basics import InputError

from .channel import close, how_it_ended, receive, send, served, started
from .pool import Bench, Died, Pool, Task, usable_cores


class _Process:
    """A process and the thread that talks to it."""

    def __init__(self, bench: bytes, answers: queue.Queue[tuple[_Process, Task, Any]]) -> None:
        self.last: Hashable = None
        self._answers = answers
        self._tasks: queue.Queue[tuple[Task, bytes] | None] = queue.Queue()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = started(__name__, self._said)
        self._bench = bench
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        return self._process.pid

    def give(self, task: Task, packed: bytes) -> None:
        self.last = task.group
        self._tasks.put((task, packed))

    def end(self) -> None:
        """End the process now, whatever it does."""
        self._tasks.put(None)
        self._process.kill()
        self._process.wait()
        self._thread.join()
        close(self._process)
        self._said.close()

    def _talk(self) -> None:
        into, out = self._process.stdin, self._process.stdout
        assert into is not None
        assert out is not None
        fresh = True
        while (given := self._tasks.get()) is not None:
            task, packed = given
            try:
                if fresh:
                    send(into, self._bench)
                    fresh = False
                send(into, packed)
                answer = receive(out)
            except (EOFError, OSError, ValueError):
                answer = Died(reason=self._obituary())
            self._answers.put((self, task, answer))
            if isinstance(answer, Died):
                return

    def _obituary(self) -> str:
        """Return what the process died of."""
        code = self._process.wait()
        how = f"its process {how_it_ended(code)}"
        if code < 0:
            return how
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return f"{how}: {lines[-1].strip()}" if lines else how


class Processes(Pool):
    """So many processes on this machine, by default one for each core that this process may use."""

    name = "processes"

    def __init__(self, jobs: int | None = None) -> None:
        self.jobs = usable_cores() if jobs is None else jobs
        self._answers: queue.Queue[tuple[_Process, Task, Any]] = queue.Queue()
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()

    @property
    @override
    def idle(self) -> int:
        return len(self._idle)

    @property
    @override
    def busy(self) -> int:
        return len(self._busy)

    @property
    @override
    def lasts(self) -> list[Hashable]:
        return [process.last for process in self._idle if process.last is not None]

    @property
    def pids(self) -> list[int]:
        """The processes' numbers."""
        return [process.pid for process in (*self._idle, *self._busy)]

    @override
    def submit(self, task: Task) -> None:
        """Give a task to an idle process, best to one that has prepared its group already.

        Raises InputError if the task cannot be sent to another process.
        """
        packed = _packed(task)
        best = next((p for p in self._idle if p.last == task.group), None)
        process = best or next((p for p in self._idle if p.last is None), self._idle[0])
        self._idle.remove(process)
        self._busy.add(process)
        process.give(task, packed)

    @override
    def end(self) -> None:
        for process in (*self._idle, *self._busy):
            process.end()
        self._idle, self._busy = [], set()

    @override
    def _start(self, bench: Bench, count: int) -> None:
        self._bench, self._answers = _packed(bench), queue.Queue()
        self._idle = [_Process(self._bench, self._answers) for _ in range(min(self.jobs, count))]

    @override
    def _answer(self, timeout: float) -> tuple[Any, Any] | None:
        try:
            process, task, answer = self._answers.get(timeout=timeout)
        except queue.Empty:
            return None
        self._busy.discard(process)
        if isinstance(answer, Died):
            process.end()
            process = _Process(self._bench, self._answers)
        self._idle.append(process)
        return task, answer


def serve() -> None:
    """Answer tasks until there are no more; the first message is the bench."""
    tasks, answers = served()
    with suppress(EOFError, BrokenPipeError):
        bench = receive(tasks)
        while True:
            send(answers, pickle.dumps(bench.do(receive(tasks))))


def _packed(content: object) -> bytes:
    """Return what is sent to a process; here, as nobody would hear of a thread that fails.

    Raises InputError if it cannot be pickled: a function of a script or a notebook, an open file.
    """
    try:
        return pickle.dumps(content)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"jobs: the work cannot be sent to other processes, take one job: {error}"
        ) from error
