"""A process for what takes longer: one job at a time, with progress, a cancel, and an end.

    Worker.run(job) --(length, pickle)--> serve, in a process of its own
                    <--("progress" | "done" | "failed", ...)--

A job is cancelled by ending its process, which always works; the next job starts another.  A
process that dies of itself, or is killed, is told as such and the page lives on.  It is one of
those that `stillhook.keeper` starts.
"""

from __future__ import annotations

import asyncio
import contextlib
import pickle
import subprocess
import threading
import warnings
from collections.abc import Callable
from typing import Any

from models.basics import StillhookError

from ..keeper import close, how_it_ended, receive, send, served, started

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
            self._process = started(__name__, subprocess.DEVNULL)
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
            send(into, pickle.dumps(job))
            kind, content = receive(out)
            while kind == "progress":
                tell(*content)
                kind, content = receive(out)
        except (EOFError, BrokenPipeError, ValueError, OSError):
            if self._process is not process:  # it was ended here
                raise CancelledError("cancelled") from None
            why = how_it_ended(process.wait())
            raise WorkerDiedError(f"the worker process {why}; try again") from None
        if kind == "failed":
            raise content
        return content


def _buried(process: subprocess.Popen[bytes]) -> None:
    """Wait for a process that was ended, and close what led to it."""
    process.wait()
    close(process)


def serve() -> None:
    """Do jobs until the other end is gone."""
    jobs, answers = served()
    warnings.simplefilter("ignore")  # the page has told what there was to warn of
    from .jobs import JOBS

    def tell(stage: str, done: int, total: int) -> None:
        send(answers, pickle.dumps(("progress", (stage, done, total))))

    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            name, arguments = receive(jobs)
            try:
                found = "done", JOBS[name](*arguments, tell)
                packed = pickle.dumps(found)
            except Exception as error:
                packed = _failure(error)
            send(answers, packed)


def _failure(error: Exception) -> bytes:
    """Return an error as it is sent: itself, or its words where it cannot be."""
    with contextlib.suppress(Exception):
        packed = pickle.dumps(("failed", error))
        pickle.loads(packed)
        return packed
    return pickle.dumps(("failed", StillhookError(f"{type(error).__name__}: {error}")))
