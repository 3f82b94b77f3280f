"""The same command gives the same numbers to the bit, whoever computes them and however."""

from __future__ import annotations

import csv
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ci

#: Each command with the table that it writes.
COMMANDS = {
    "sweep thesis-1975 --mode time --samples 4 --duration '10 s'": "cases.csv",
    "compare thesis-1975 --controllers none,feed-forward --seeds 2 --duration '15 s'": "runs.csv",
}

#: Those that `make pythons` has set up.
OTHERS = sorted(Path(__file__).parents[3].glob(".venv-3.*/bin/python"))
#: What a clock has measured.
CLOCKS = {"wall", "step median", "step p99", "step max"}


def rows(
    line: str, how: str, folder: Path, python: Path | None = None, **environment: str
) -> list[dict[str, str]]:
    """Run a command, and return the rows of its table without what a clock has measured.

    By default in this Python; another has its own packages.
    """
    if python is None:
        environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    folder.mkdir(exist_ok=True)
    words = [*shlex.split(f"{line} {how}"), "--no-figures", "--quiet", "--out", "out"]
    done = subprocess.run(
        [python or sys.executable, "-m", "stillhook", *words],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode in (0, 1), done.stderr
    with open(folder / "out" / COMMANDS[line], encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    return [{name: cell for name, cell in row.items() if name not in CLOCKS} for row in found]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The rows of each command from one process, with a compiler if there is one."""
    return {line: rows(line, "--jobs 1", tmp_path_factory.mktemp("alone")) for line in COMMANDS}


@pytest.mark.parametrize("line", COMMANDS)
def test_there_is_something_to_compare(alone, line):
    assert len(alone[line]) >= 4
    assert len(alone[line][0]) > 10


@pytest.mark.parametrize("line", COMMANDS)
def test_two_processes_give_the_same(alone, line, tmp_path):
    assert rows(line, "--jobs 2", tmp_path) == alone[line]


@pytest.mark.parametrize("line", COMMANDS)
def test_without_a_compiler_the_numbers_are_the_same(alone, line, tmp_path):
    assert rows(line, "--jobs 2", tmp_path, STILLHOOK_COMPILE="0") == alone[line]


@pytest.mark.parametrize("line", COMMANDS)
def test_another_python_gives_the_same(alone, line, tmp_path):
    if not OTHERS:
        pytest.skip("no other Python is set up: make pythons")
    for python in OTHERS:
        assert rows(line, "--jobs 1", tmp_path / python.parts[-3], python) == alone[line], python


@pytest.mark.slow  # a cluster takes its time to start
def test_a_cluster_gives_the_same(alone, tmp_path):
    pytest.importorskip("distributed")
    line = next(line for line in COMMANDS if line.startswith("sweep"))
    assert rows(line, "--cluster local:2", tmp_path) == alone[line]
