"""Progress of long computations: who hears of it where the caller names nobody.

    @shows_progress("tuning the weights")
    def tune_weights(case, *, progress=None): ...

The rooms here draw nothing.  Whoever can (`stillhook.text.watching`, where a person looks at a
terminal or a notebook) says so with `show_by_default`, and hears of each call that has no
``progress`` of its own.  Calls within a call speak to the same listener: there is one bar at a
time.  A call with a ``progress`` of its own is heard there alone, whatever it calls.
"""

import functools
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from typing import Any, ParamSpec, TypeVar

Told = Callable[[str, float, float], None]  #: Hears (stage, done, total).
#: Begins to show what a call that does WHAT tells, until it ends; None shows nothing.
Show = Callable[[str], AbstractContextManager[Told]]

_P = ParamSpec("_P")
_R = TypeVar("_R")

# What a program shows is a matter of the whole process, as its warnings and its log are.
_default: list[Show] = []
_listener: ContextVar[Told | None] = ContextVar("listener", default=None)


def show_by_default(show: Show | None) -> None:
    """Let calls that name no listener be shown by this; None for not at all."""
    _default[:] = [] if show is None else [show]


@contextmanager
def unshown() -> Iterator[None]:
    """Show nothing by default within a block: somebody shows the whole of it."""
    with _heard(_nobody):
        yield


def shows_progress(what: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Mark a function as one that takes seconds; `what` it does then, as in "searching".

    It may have an argument ``progress``, by keyword, and call it as progress(stage, done, total),
    progress(done, total) or progress(share).  One without is shown with the time that it takes.
    """

    def mark(function: Callable[_P, _R]) -> Callable[_P, _R]:
        code = function.__code__
        tells = "progress" in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

        @functools.wraps(function)
        def shown(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            if kwargs.get("progress") is not None:
                # Within a call that is shown it is that call that is told, and all may be.
                with _heard(_listener.get() or _nobody):
                    return function(*args, **kwargs)
            with _listening(what) as told:
                if tells and told is not None:
                    kwargs["progress"] = _in_any_form(what, told)
                return function(*args, **kwargs)

        return shown

    return mark


@contextmanager
def _listening(what: str) -> Iterator[Told | None]:
    """Yield who is told of a call: who hears already, else a new listener, else None."""
    hears = _listener.get()
    if hears is not None:
        yield None if hears is _nobody else hears
    elif _default and _in_front():
        with _default[0](what) as told, _heard(told):
            yield told
    else:
        yield None


@contextmanager
def _heard(told: Told) -> Iterator[None]:
    """Let what is called within a block speak to a listener."""
    before = _listener.set(told)
    try:
        yield
    finally:
        _listener.reset(before)


def _in_front() -> bool:
    """Return whether this is what the user started: no worker, and no thread of a server."""
    import multiprocessing  # here, as the face has to be quick

    main = threading.current_thread() is threading.main_thread()
    return main and multiprocessing.parent_process() is None


def _in_any_form(what: str, told: Told) -> Callable[..., None]:
    """Return a `progress` that may be called with a share, with two numbers, or with all."""

    def progress(*far: Any) -> None:
        if len(far) == 1:
            told(what, round(100.0 * far[0]), 100)
        elif len(far) == 2:
            told(what, *far)
        else:
            told(*far)

    return progress


def _nobody(stage: str, done: float, total: float) -> None:
    """Hear nothing."""
