"""Ctrl-C in a command that has something to lose: asked once it stops in order, twice at once."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

Stop = Callable[[], bool]
"""Whether the user has asked to stop."""


@contextlib.contextmanager
def stoppable() -> Iterator[Stop]:
    """Remember the first Ctrl-C instead of raising, so that what runs can end and be kept.

    The computation asks between two steps.  A second Ctrl-C raises KeyboardInterrupt as always.

    Yields
    ------
    Stop
        To be asked.
    """
    asked = False

    def remember(number: int, frame: object) -> None:
        nonlocal asked
        del number, frame
        if asked:
            raise KeyboardInterrupt
        asked = True

    if threading.current_thread() is not threading.main_thread():
        yield lambda: asked  # only the main thread may handle signals
        return
    before = signal.signal(signal.SIGINT, remember)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)
