"""Pools of processes: what cannot leave this process is told, and nobody waits for it."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from models.basics import InputError
from stillhook.keeper import Died, Processes
from stillhook.keeper.cluster import _isolated


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


MODULE = "def where():\n    return __file__\n"


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with modules that tell when they are run."""
    for name in ("json", "struct", "sitecustomize"):
        text = f"open({str(tmp_path / 'was-run')!r}, 'a').write({name!r})\nraise ImportError\n"
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("entry", ["", ".", "../{name}"])
def test_what_lies_in_the_current_folder_is_not_run(
    planted: Path, monkeypatch: pytest.MonkeyPatch, entry: str
) -> None:
    relative = entry.format(name=planted.name)
    monkeypatch.setattr(sys, "path", [relative, *sys.path])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([relative, os.environ.get("PYTHONPATH", "")]))
    with Processes(1).begin(Caller(), 1) as pool:
        found = [each for each in pool.answers(iter([Call(os.getpid)])) if each is not None]
    assert found[0][1] not in (None, os.getpid())
    assert not isinstance(found[0][1], Died)
    assert not (planted / "was-run").exists()


def test_folders_that_the_path_names_in_full_are_found_by_every_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pilot_of_a_checkout.py").write_text(MODULE)
    monkeypatch.syspath_prepend(str(tmp_path))
    function = importlib.import_module("pilot_of_a_checkout").where
    with Processes(1).begin(Caller(), 1) as pool:
        found = [each for each in pool.answers(iter([Call(function)])) if each is not None]
    assert found[0][1] == str(tmp_path / "pilot_of_a_checkout.py")


def test_a_cluster_starts_nothing_of_the_current_folder(
    planted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", ".", str(planted / "full")]))
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    with _isolated():
        child = subprocess.run([sys.executable, "-c", "import json"], capture_output=True)
        assert os.environ["PYTHONPATH"] == str(planted / "full")
    assert child.returncode == 0
    assert not (planted / "was-run").exists()
    assert os.environ["PYTHONPATH"] == os.pathsep.join(["", ".", str(planted / "full")])
    assert "PYTHONSAFEPATH" not in os.environ
