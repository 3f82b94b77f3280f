"""A process for what takes longer: one job at a time, with progress, a cancel, and an end.

    Worker.run(job) --(length, pickle)--> serve, in a process of its own
                    <--("progress" | "done" | "failed", ...)--

A job is cancelled by ending its process, which always works; the next job starts another.  A
process that dies of itself, or is killed, is told as such and the page lives on.  It is started
isolated (``-I``), as those of `stillhook.keeper` are: a ``json.py`` beside the case files is not
run.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from typing import IO, Any

from models.basics import StillhookError

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from stillhook.page.worker import serve; serve()"
)
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_LENGTH = struct.Struct(">Q")

Told = Callable[[str, int, int], None]  #: Takes stage, done and total.


class WorkerDiedError(StillhookError):
    """The process ended before its job did."""


class CancelledError(StillhookError):
    """The job was cancelled."""


class Worker:
    """One process, started with the first job and kept for the next."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.busy = False  #: Whether it has a job.
        self._ends = 0  # how often it was ended: a job that begins to start when it is has no say

    @property
    def pid(self) -> int | None:
        """Number of the process, if there is one."""
        return None if self._process is None else self._process.pid

    async def run(self, name: str, *arguments: Any, told: Told | None = None) -> Any:
        """Do a job of `stillhook.page.jobs` and return what it returns.

        `told` is called on the event loop with stage, done and total.

        Raises InputError and other errors as the job; `CancelledError`, `WorkerDiedError`.
        """
        assert not self.busy
        self.busy = True
        loop = asyncio.get_running_loop()

        def tell(stage: str, done: int, total: int) -> None:
            if told is not None:
                loop.call_soon_threadsafe(told, stage, done, total)

        try:
            job = name, arguments
            return await loop.run_in_executor(None, self._talk, job, tell, self._ends)
        except asyncio.CancelledError:
            self.end()  # else a thread would go on listening to it
            raise
        finally:
            self.busy = False

    def cancel(self) -> None:
        """End the job that is being done, if there is one."""
        if self.busy:
            self.end()

    def end(self) -> None:
        """End the process now, whatever it does."""
        self._ends += 1
        self._drop()

    def _drop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            threading.Thread(target=_buried, args=(process,), daemon=True).start()

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self._drop()
        if self._process is None:
            import json

            paths = [path for path in sys.path if os.path.isabs(path)]
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-c", _START, json.dumps(paths)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **dict.fromkeys(_THREADS, "1")},
                start_new_session=True,
            )
        return self._process

    def _talk(self, job: tuple[str, tuple[Any, ...]], tell: Told, ends: int) -> Any:
        process = self._started()
        if self._ends != ends:
            self._drop()
            raise CancelledError("cancelled")
        into, out = process.stdin, process.stdout
        assert into is not None
        assert out is not None
        try:
            _send(into, pickle.dumps(job))
            kind, content = _receive(out)
            while kind == "progress":
                tell(*content)
                kind, content = _receive(out)
        except (EOFError, BrokenPipeError, ValueError, OSError):
            if self._process is not process:  # it was ended here
                raise CancelledError("cancelled") from None
            code = process.wait()
            why = f"ended with status {code}"
            if code < 0:
                with contextlib.suppress(ValueError):
                    why = f"was ended by {signal.Signals(-code).name}"
            raise WorkerDiedError(f"the worker process {why}; try again") from None
        if kind == "failed":
            raise content
        return content


def _buried(process: subprocess.Popen[bytes]) -> None:
    """Wait for a process that was ended, and close what led to it."""
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):
                stream.close()


def serve() -> None:
    """Do jobs until the other end is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the page decides what Ctrl-C means
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever somebody prints must not come among the answers
    warnings.simplefilter("ignore")  # the page has told what there was to warn of
    from .jobs import JOBS

    def tell(stage: str, done: int, total: int) -> None:
        _send(answers, pickle.dumps(("progress", (stage, done, total))))

    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            name, arguments = _receive(sys.stdin.buffer)
            try:
                found = "done", JOBS[name](*arguments, tell)
                packed = pickle.dumps(found)
            except Exception as error:
                packed = _failure(error)
            _send(answers, packed)


def _failure(error: Exception) -> bytes:
    """Return an error as it is sent: itself, or its words where it cannot be."""
    with contextlib.suppress(Exception):
        packed = pickle.dumps(("failed", error))
        pickle.loads(packed)
        return packed
    return pickle.dumps(("failed", StillhookError(f"{type(error).__name__}: {error}")))


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
