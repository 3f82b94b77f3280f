"""Processes of this machine as a pool, each with one thread of linear algebra.

    Processes.submit --(length, pickle)--> serve, in a process of its own --(length, pickle)--> wait

A process is started with the path of its parent and nothing else: neither the parent's memory nor
its main script, so that it works the same on every system, from a script without a main guard,
from a notebook and from the command line.  It starts isolated (``-I``), and of the path it has the
folders that are named in full: a ``json.py`` beside somebody's case files is not run.  Each has one
thread here that hands it a task and waits for the answer, so that it is known which task a process
died of.  The processes have a session of their own: Ctrl-C reaches the parent alone, which ends
them.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Hashable, Iterable
from typing import IO, Any

from typing_extensions import override

from models.basics import InputError

from .pool import Bench, Died, Pool, Task, usable_cores

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from stillhook.keeper.processes import serve; serve()"
)
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_LENGTH = struct.Struct(">Q")


class _Process:
    """A process and the thread that talks to it."""

    def __init__(self, bench: bytes, answers: queue.Queue[tuple[_Process, Task, Any]]) -> None:
        self.last: Hashable = None
        self._answers = answers
        self._tasks: queue.Queue[tuple[Task, bytes] | None] = queue.Queue()
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-c", _START, json.dumps(full_paths(sys.path))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **dict.fromkeys(_THREADS, "1")},
            start_new_session=True,
        )
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
        while (given := self._tasks.get()) is not None:
            task, packed = given
            try:
                if fresh:
                    _send(into, self._bench)
                    fresh = False
                _send(into, packed)
                answer = _receive(out)
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


def full_paths(paths: Iterable[str]) -> list[str]:
    """Return the folders that are named in full: not the current one, nor what starts from it."""
    return [path for path in paths if os.path.isabs(path)]


def serve() -> None:
    """Answer tasks until there are no more; the first message is the bench."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a controller prints must not come among the answers
    tasks = sys.stdin.buffer
    with contextlib.suppress(EOFError, BrokenPipeError):
        bench = _receive(tasks)
        while True:
            _send(answers, pickle.dumps(bench.do(_receive(tasks))))


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


def _send(stream: IO[bytes], data: bytes) -> None:
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def _receive(stream: IO[bytes]) -> Any:
    """Read what was pickled and written with `_send`.

    Raises EOFError if the other end is gone.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)
