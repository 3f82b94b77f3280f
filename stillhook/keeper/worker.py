"""A process that runs cells for a comparison: tasks in on its standard input, answers out.

    stillhook.keeper.pool --(length, pickle)--> serve --> Bench.do --(length, pickle)--> back

It is started by `stillhook.keeper.pool` with the path of its parent and nothing else: neither the
parent's memory nor its main script, so that it works the same on every system, from a script
without a main guard, from a notebook and from the command line.
"""

from __future__ import annotations

import os
import pickle
import signal
import struct
import sys
import warnings
from dataclasses import dataclass, field
from typing import IO, Any

_LENGTH = struct.Struct(">Q")


@dataclass(frozen=True, kw_only=True)
class Task:
    """Something to do.

    Attributes
    ----------
    kind
        "design", "run" or "trace".
    name
        The contender, or the design that is wanted.
    height
        Significant height [m].
    seed
        Seed of the run; -1 for a design.
    law
        The design that the contender is made of, as plain data; None if it needs none.
    moment
        What to show the traces around [s].
    """

    kind: str
    name: str
    height: float
    seed: int = -1
    law: Any = field(default=None, compare=False)
    moment: float = 0.0

    @property
    def group(self) -> tuple[str, float]:
        """What is prepared once for several tasks."""
        return self.name, self.height


@dataclass(frozen=True, kw_only=True)
class Refused:
    """An answer that says why there is none, and whether it holds for every seed."""

    reason: str
    always: bool = False


class Bench:
    """Does tasks, one after the other, and keeps what it prepared for the one before.

    Parameters
    ----------
    question
        A `stillhook.comparison.cell.Question`.
    contenders
        The contenders by name.
    """

    def __init__(self, question: Any, contenders: dict[str, Any]) -> None:
        self._question, self._contenders = question, contenders
        self._at: tuple[str, float] | None = None
        self._prepared: Any = None

    def do(self, task: Task, progress: Any = None) -> Any:
        """Return the answer to a task: a `Law`, a `Cell`, a `Trace`, or `Refused`."""
        from models.basics import PhysicsWarning, StillhookError

        from ..comparison import prepare
        from ..controllers import Law, design_law

        with warnings.catch_warnings():  # told once, where the case was read
            warnings.simplefilter("ignore", PhysicsWarning)
            try:
                if task.kind == "design":
                    case = self._question.known(task.height)
                    return design_law(task.name, case, self._question.starts, progress)
                if self._at != task.group:
                    law = None if task.law is None else Law(**task.law)
                    self._at, self._prepared = None, None
                    contender = self._contenders[task.name]
                    self._prepared = prepare(self._question, contender, task.height, law)
                    self._at = task.group
            except StillhookError as error:
                return Refused(reason=str(error), always=True)
            try:
                if task.kind == "trace":
                    return self._prepared.trace(task.seed, task.moment, progress)
                return self._prepared.run(task.seed, progress)
            except Exception as error:  # what a controller of the user's own may do
                self._at = None
                known = isinstance(error, StillhookError)
                return Refused(reason=str(error) if known else f"{type(error).__name__}: {error}")


def send(stream: IO[bytes], content: object) -> None:
    """Write something to a stream."""
    data = pickle.dumps(content)
    stream.write(_LENGTH.pack(len(data)) + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read what was written with `send`.

    Raises
    ------
    EOFError
        If the other end is gone.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return pickle.loads(data)


def serve() -> None:
    """Answer tasks until there are no more; the first message is what the bench needs."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a controller prints must not come among the answers
    tasks = sys.stdin.buffer
    try:
        setup = receive(tasks)
        # A sweep brings a bench of its own (`stillhook.sweeps.time_cases`).
        bench = setup.bench() if hasattr(setup, "bench") else Bench(*setup)
        while True:
            send(answers, bench.do(receive(tasks)))
    except (EOFError, BrokenPipeError):
        return
