"""Every command: in a folder with planted modules, and printed in every encoding."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from every_command import LINES, RECORD, REPLAY

import stillhook as sh
from stillhook.cli import COMMANDS

pytestmark = pytest.mark.ci

#: Modules that Python, Stillhook or their libraries import; they lie beside the case files.
PLANTED = ("json", "numpy", "stillhook", "models", "sitecustomize", "usercustomize", "pickle")
PLANTED += ("multiprocessing", "struct", "distributed")

ODD = "Kr\u00e4n \u2264 10\u207b\u00b3, \u8d77\u91cd\u673a"


def python(program: str, *words: object, **settings: object) -> subprocess.CompletedProcess[bytes]:
    """Run a program as `stillhook` is run: a script of another folder."""
    with tempfile.TemporaryDirectory() as scripts:
        script = Path(scripts, "script.py")
        script.write_text(program)
        command = [sys.executable, str(script), *map(str, words)]
        return subprocess.run(command, capture_output=True, timeout=900, **settings)  # type: ignore[call-overload]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of case files with modules planted among them, after every command ran in it."""
    for extra in ("capytaine", "distributed", "cloudpickle"):
        pytest.importorskip(extra)
    place = tmp_path_factory.mktemp("planted")
    for name in PLANTED:
        text = f"open({str(place / 'was-run')!r}, 'a').write({name!r} + ' ')\nraise ImportError\n"
        (place / f"{name}.py").write_text(text)
    odd = sh.load_case("thesis-1975").replace({"name": ODD})
    (place / "odd.yaml").write_text(odd.to_yaml(), encoding="utf-8")
    lines = [f"{line} --format svg" for line in LINES]
    done = python(RECORD, place / "said.pickle", *lines, cwd=place)
    assert done.returncode == 0, done.stderr.decode()
    return place


@pytest.fixture(scope="module")
def statuses(folder):
    with open(folder / "said.pickle", "rb") as file:
        found, _ = pickle.load(file)
    return found


def test_every_command_is_tried():
    tried = {name for line in LINES for name, room, _ in COMMANDS if room and line.startswith(name)}
    # The page serves until it is stopped; it has tests of its own.
    assert tried == {name for name, room, _ in COMMANDS if room} - {"page"}


def test_every_command_comes_to_its_end(statuses):
    # 1: the thesis's own gains break a limit.
    ended = dict(zip(LINES, statuses, strict=True))
    assert {line: status for line, status in ended.items() if status not in (0, 1)} == {}


def test_what_lies_beside_the_case_files_is_not_run(folder):
    assert not (folder / "was-run").exists()
    assert not list(folder.glob("__pycache__"))


def test_figures_are_drawn_in_the_format_that_is_asked_for(folder):
    drawn = {path.parent.name for path in folder.glob("out/**/*.svg")}
    assert len(drawn) >= 10
    assert list(folder.glob("out/**/*.png")) == []


@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "latin-1", "cp437", "C", "utf-8"])
def test_what_every_command_prints_is_printed_in_every_encoding(folder, encoding):
    how = {"PYTHONIOENCODING": encoding}
    if encoding == "C":
        how = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    without = {k: v for k, v in os.environ.items() if k not in ("PYTHONIOENCODING", "NO_COLOR")}
    done = python(REPLAY, folder / "said.pickle", cwd=folder, env=without | how)
    assert (done.returncode, done.stderr) == (0, b"")
    text = done.stdout.decode({"C": "ascii"}.get(encoding, encoding))
    # The name of a case: at three widths, of the two commands that have it.
    latin = "Kr\u00e4n <= 10-\u00b3, ???"
    name = {"utf-8": ODD, "cp437": "Kr\u00e4n \u2264 10-3, ???", "cp1252": latin, "latin-1": latin}
    assert text.count(name.get(encoding, "Kran <= 10-3, ???")) >= 2
    bars = {"utf-8": "\u2588\u2588", "cp437": "\u2588\u2588"}
    assert bars.get(encoding, "##") in text
