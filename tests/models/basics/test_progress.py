"""Who hears of a long computation, where the caller names nobody and where it does."""

from __future__ import annotations

import contextlib
import inspect
import threading

import pytest

from models.basics import show_by_default, shows_progress, unshown


@pytest.fixture
def heard():
    """What is shown by default: ("open", what), what is told, ("close", what)."""
    said = []

    @contextlib.contextmanager
    def show(what):
        said.append(("open", what))
        try:
            yield lambda *far: said.append(far)
        finally:
            said.append(("close", what))

    show_by_default(show)
    yield said
    show_by_default(None)


@shows_progress("inside")
def inside(*, progress=None):
    """Tell a share."""
    if progress is not None:
        progress(0.256)


@shows_progress("outside")
def outside(count, *, progress=None):
    """Tell a count, and call another that tells."""
    if progress is not None:
        progress(1, count)
    inside()
    return count


@shows_progress("mute")
def mute(count):
    """Tell nothing."""
    return count


@shows_progress("stages")
def stages(*, progress=None):
    progress("polish", 1, 2)
    raise ValueError("no end")


def test_a_call_that_names_nobody_is_shown_and_calls_within_it_by_the_same(heard):
    assert outside(3) == 3
    told = [("open", "outside"), ("outside", 1, 3), ("inside", 26, 100), ("close", "outside")]
    assert heard == told
    assert outside(3, progress=None) == 3
    assert heard == 2 * told


def test_a_call_that_names_somebody_is_heard_there_alone(heard):
    mine = []
    outside(3, progress=lambda *far: mine.append(far))
    assert (mine, heard) == ([(1, 3)], [])


def test_a_call_within_one_that_is_shown_may_be_handed_its_listener(heard):
    @shows_progress("whole")
    def whole(*, progress=None):
        outside(3, progress=lambda done, total: progress(f"{done} of {total}", done, total))

    whole()
    assert heard == [("open", "whole"), ("1 of 3", 1, 3), ("inside", 26, 100), ("close", "whole")]


def test_a_call_without_an_argument_for_it_is_shown_by_its_time(heard):
    assert mute(4) == mute(count=4) == 4
    assert heard == 2 * [("open", "mute"), ("close", "mute")]


def test_what_is_shown_ends_with_an_error(heard):
    with pytest.raises(ValueError, match="no end"):
        stages()
    assert heard == [("open", "stages"), ("polish", 1, 2), ("close", "stages")]
    inside()  # and another call is shown by itself again
    assert heard[3:] == [("open", "inside"), ("inside", 26, 100), ("close", "inside")]


def test_nothing_is_shown_where_somebody_shows_the_whole(heard):
    with unshown():
        outside(3)
    assert heard == []


def test_a_thread_that_is_not_the_users_shows_nothing(heard):
    server = threading.Thread(target=outside, args=(3,))
    server.start()
    server.join()
    assert heard == []


def test_a_worker_shows_nothing(heard, monkeypatch):
    monkeypatch.setattr("multiprocessing.parent_process", lambda: object())
    outside(3)
    assert heard == []


def test_nothing_is_called_where_nobody_shows():
    show_by_default(None)
    assert outside(3) == 3


def test_a_function_that_is_marked_looks_as_it_did():
    assert [*inspect.signature(outside).parameters] == ["count", "progress"]
    assert outside.__doc__.startswith("Tell a count")
