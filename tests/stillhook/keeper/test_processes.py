"""Pools of processes: what cannot leave this process is told, and nobody waits for it."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from dataclasses import dataclass
from multiprocessing import spawn
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
    # As at a prompt and in a notebook, where `multiprocessing` hands the folder itself on.
    path = ["", ".", *sys.path]
    monkeypatch.setattr(sys, "path", path.copy())
    monkeypatch.setattr("multiprocessing.process.ORIGINAL_DIR", str(planted))
    with _isolated():
        child = subprocess.run([sys.executable, "-c", "import json"], capture_output=True)
        handed = spawn.get_preparation_data("worker")["sys_path"]
        assert os.environ["PYTHONPATH"] == str(planted / "full")
        sys.path.append("/put/there/meanwhile")
    assert child.returncode == 0
    assert not (planted / "was-run").exists()
    assert handed == path[2:]
    assert sys.path == [*path, "/put/there/meanwhile"]
    assert os.environ["PYTHONPATH"] == os.pathsep.join(["", ".", str(planted / "full")])
    assert "PYTHONSAFEPATH" not in os.environ


NOTEBOOK = """
import sys, warnings
from models.spread import Uniform
import stillhook as sh
import distributed

if __name__ == "__main__":  # workers of a cluster run the script that started them
    warnings.simplefilter("ignore")
    sys.path.insert(0, "")
    case = sh.load_case("thesis-1975")
    spread = {"payload.mass": Uniform("1 %")}
    how = {"mode": "time", "samples": 2, "duration": 2.0, "engine": "local:2"}
    print(sh.sweep("none", spread, case=case, **how).attrs["engine"])
"""


@pytest.mark.slow  # a cluster takes its time to start
def test_a_clusters_workers_run_nothing_of_a_notebooks_folder(
    planted: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    pytest.importorskip("distributed")
    for name in ("distributed", "numpy", "pickle"):
        (planted / f"{name}.py").write_text((planted / "json.py").read_text())
    script = tmp_path_factory.mktemp("elsewhere") / "notebook.py"
    script.write_text(NOTEBOOK)
    done = subprocess.run(
        [sys.executable, str(script)], cwd=planted, capture_output=True, text=True, timeout=300
    )
    assert not (planted / "was-run").exists()
    assert (done.returncode, done.stdout) == (0, "cluster\n"), done.stderr
