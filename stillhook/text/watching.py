"""Progress in Python: the command line's bar, where a person watches a script or a notebook.

    sh.LinearMPC(case)   # on a terminal: tuning the weights ━━━━━━━━ 44/100 0:00:02

`models.basics.progress` says which calls are shown.  A bar comes after half a second, so that what
is quick leaves no flicker behind, and goes with the call.  Into pipes and files nothing is written.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import TYPE_CHECKING

from models.basics import show_by_default

from .terminal import SWITCH, progress

if TYPE_CHECKING:
    from rich.console import Console

_PATIENCE = 0.5  # [s]
_COLUMNS = 80  # of a notebook's cell


def show_progress(shown: bool | None = True) -> None:
    """Say whether calls that take seconds show a progress bar on standard error.

    By default they do where standard error is a terminal or a notebook's, and nowhere else.  The
    environment variable ``STILLHOOK_PROGRESS`` says it before Python is started: 0 for not at all,
    the bars of the command line included, 1 for everywhere.  A call with a ``progress`` of its own
    shows nothing.

    Parameters
    ----------
    shown
        False for not at all; True for everywhere, as in the console of an editor that is no
        terminal; None for the default again.

    Examples
    --------
    >>> import stillhook as sh
    >>> sh.show_progress(False)
    >>> sh.show_progress(None)
    """
    show_by_default(None if shown is False else _everywhere if shown else where_watched)


@contextmanager
def where_watched(what: str) -> Iterator[Callable[[str, float, float], None]]:
    """Show a call where somebody watches, or where the environment variable says so."""
    wanted = os.environ.get(SWITCH)
    if wanted != "1" and (wanted == "0" or not (_notebook() or _terminal())):
        yield _unheard
        return
    with _everywhere(what) as told:
        yield told


@contextmanager
def _everywhere(what: str) -> Iterator[Callable[[str, float, float], None]]:
    """Show a call if it takes longer than a moment."""
    bar = _Bar(lambda: progress(shown=True, out=_console(), first=what))
    later = threading.Timer(_PATIENCE, bar.open)
    later.daemon = True
    later.start()
    try:
        yield bar.told
    finally:
        later.cancel()
        bar.close()


class _Bar:
    """A bar that is opened by a clock and closed by whoever ends, whichever comes first."""

    def __init__(
        self, make: Callable[[], AbstractContextManager[Callable[[str, float, float], None]]]
    ) -> None:
        self._make = make
        self._lock, self._closing, self._closed = threading.Lock(), ExitStack(), False
        self._tell: Callable[[str, float, float], None] = _unheard
        self._last: tuple[str, float, float] | None = None

    def told(self, stage: str, done: float, total: float) -> None:
        """Take how far it is."""
        self._last = stage, done, total
        self._tell(stage, done, total)

    def open(self) -> None:
        """Show the bar, unless all is over."""
        with self._lock:
            if not self._closed:
                self._tell = self._closing.enter_context(self._make())
                if self._last is not None:
                    self._tell(*self._last)

    def close(self) -> None:
        """Take the bar away."""
        with self._lock:
            self._closed = True
            self._closing.close()


def _console() -> Console:
    """Return a console that draws on standard error, whatever that is."""
    from rich.console import Console

    # A notebook's is no terminal and yet goes back to the beginning of a line; its widgets would
    # need a package more.
    width = _COLUMNS if _notebook() else None
    return Console(
        stderr=True, force_terminal=True, force_jupyter=False, width=width, highlight=False
    )


def _terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def _notebook() -> bool:
    return type(sys.stderr).__module__.startswith("ipykernel.")


def _unheard(stage: str, done: float, total: float) -> None:
    """Hear nothing."""
