"""Questions that come faster than answers: the newest one counts, and a failure ends nothing."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

from stillhook.page.latest import Latest


def asked(script, work):
    """Run a script with a `Latest`; return what was answered and what failed."""
    answered, failed = [], []

    async def main():
        with ThreadPoolExecutor(1) as executor:
            latest = Latest(
                executor,
                work,
                lambda q, a: answered.append((q, a)),
                lambda q, e: failed.append((q, str(e))),
            )
            await script(latest)
            await latest.idle()

    asyncio.run(main())
    return answered, failed


def test_the_newest_question_is_answered_and_older_ones_passed_over():
    go = threading.Event()

    def work(question):
        go.wait(5.0)
        return -question

    async def script(latest):
        latest.ask(1)
        await asyncio.sleep(0.05)
        for question in (2, 3, 4):
            latest.ask(question)
        assert latest.busy
        go.set()

    assert asked(script, work) == ([(1, -1), (4, -4)], [])


def test_the_event_loop_goes_on_while_a_question_is_answered():
    go, ticks = threading.Event(), []

    async def script(latest):
        latest.ask(1)
        for _ in range(5):
            ticks.append(latest.busy)
            await asyncio.sleep(0)
        go.set()

    answered, _ = asked(script, lambda q: go.wait(5.0))
    assert answered == [(1, True)]
    assert ticks == [True] * 5


def test_a_failure_is_no_failure_of_the_next_question():
    async def script(latest):
        latest.ask(0)
        await latest.idle()
        latest.ask(2)

    assert asked(script, lambda q: 1 // q) == (
        [(2, 0)],
        [(0, "integer division or modulo by zero")],
    )


def test_after_the_end_nothing_is_answered():
    go = threading.Event()

    async def script(latest):
        latest.ask(1)
        await asyncio.sleep(0.02)
        latest.ask(2)
        latest.end()
        go.set()
        latest.ask(3)

    assert asked(script, lambda q: go.wait(5.0)) == ([], [])
