"""Pools of processes: what cannot leave this process is told, and nobody waits for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from models.basics import InputError
from stillhook.keeper import Processes


@dataclass(frozen=True)
class Call:
    """A task that calls a function."""

    function: Any
    group: None = None


class Caller:
    """A bench that does such tasks."""

    def __init__(self, kept: object = None) -> None:
        self.kept = kept

    def do(self, task: Call, progress: Any = None, /) -> object:
        return task.function()


def test_a_task_that_cannot_be_sent_is_told_at_once() -> None:
    with (
        Processes(1).begin(Caller(), 1) as pool,
        pytest.raises(InputError, match="cannot be sent to other processes, take one job"),
    ):
        next(pool.answers(iter([Call(lambda: 1)])))


def test_a_bench_that_cannot_be_sent_is_told_at_once() -> None:
    with pytest.raises(InputError, match="cannot be sent to other processes"):
        Processes(1).begin(Caller(lambda: 1), 1)
