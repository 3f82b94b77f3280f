"""One thread that answers the newest question, while older ones are passed over.

    ask(q1), ask(q2), ask(q3) --> work(q1), work(q3) --> answer(..)

A slider that is dragged asks faster than can be answered; what counts is where it stands.  The
work runs beside the event loop, so that the page never waits for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Generic, TypeVar

Q = TypeVar("Q")
A = TypeVar("A")


class Latest(Generic[Q, A]):
    """Answers questions in a thread, the newest one next.

    `work` makes the answer, `answer` takes it on the event loop with the question, and `failed`
    takes what went wrong; a failure of one question is no failure of the next.
    """

    def __init__(
        self,
        executor: Executor,
        work: Callable[[Q], A],
        answer: Callable[[Q, A], None],
        failed: Callable[[Q, Exception], None],
    ) -> None:
        self._executor = executor
        self._work, self._answer, self._failed = work, answer, failed
        self._next: list[Q] = []
        self._task: asyncio.Task[None] | None = None
        self._ended = False

    @property
    def busy(self) -> bool:
        """Whether a question is being answered."""
        return self._task is not None and not self._task.done()

    def ask(self, question: Q) -> None:
        """Ask, from the event loop; a question that still waits is forgotten."""
        if self._ended:
            return
        self._next = [question]
        if not self.busy:
            self._task = asyncio.get_running_loop().create_task(self._run())

    def end(self) -> None:
        """Answer nothing more."""
        self._ended, self._next = True, []

    async def idle(self) -> None:
        """Wait until there is nothing left to answer."""
        while self._task is not None and not self._task.done():
            await asyncio.shield(self._task)

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        while self._next:
            question = self._next.pop()
            try:
                found = await loop.run_in_executor(self._executor, self._work, question)
            except Exception as error:
                if not self._ended:
                    self._failed(question, error)
                continue
            if not self._ended:
                self._answer(question, found)
