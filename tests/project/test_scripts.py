"""Scripts of the benchmarks and of the docs: each says what it is for, and every study has one."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    path
    for folder in ("benchmarks", "docs/make")
    for path in (ROOT / folder).glob("*.py")
    if "__main__" in path.read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def stored():
    spec = importlib.util.spec_from_file_location("stored", ROOT / "docs" / "make" / "stored.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_stored_study_names_its_script(stored):
    found = {path.name for path in (ROOT / "docs" / "data").glob("*.csv")}
    assert found == set(stored.SCRIPTS)
    assert all((ROOT / script).exists() for script in stored.SCRIPTS.values())


def test_a_quick_run_leaves_the_docs_alone(stored):
    assert stored.docs_folder(False) == ROOT / "docs"
    assert stored.docs_folder(True) == ROOT / "out" / "quick"


def test_a_study_says_which_code_made_it(stored, tmp_path):
    path = tmp_path / "saturation.csv"
    stored.write_rows(path, ("a", "b"), [{"a": 1, "b": 2}], "SI units.")
    assert stored.read_rows(path) == [{"a": "1", "b": "2"}]
    assert stored.older_than_their_code(tmp_path) == []
    first, _, rest = path.read_text(encoding="utf-8").partition("\n")
    code = first.split("code ")[1].split(".")[0]
    path.write_text(f"{first.replace(code, 'abc')}\n{rest}", encoding="utf-8")
    (message,) = stored.older_than_their_code(tmp_path)
    assert message.startswith("saturation.csv: made by code abc, docs/make/saturation.py is ")
    path.write_text(rest, encoding="utf-8")
    (message,) = stored.older_than_their_code(tmp_path)
    assert message.startswith("saturation.csv: does not say which code made it")


def test_a_study_that_goes_on_says_which_of_its_rows_are_old(stored, tmp_path):
    code = stored.digest_of(stored.SCRIPTS["holds.csv"])
    rows = [{"a": 1, "code": code}, {"a": 2, "code": "abc"}]
    stored.write_rows(tmp_path / "holds.csv", ("a", "code"), rows)
    (message,) = stored.older_than_their_code(tmp_path)
    assert message == "holds.csv: 1 of 2 rows made by other code than today's"
    stored.write_rows(tmp_path / "holds.csv", ("a", "code"), rows[:1])
    assert stored.older_than_their_code(tmp_path) == []


@pytest.mark.ci
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_explains_itself(script):
    run = subprocess.run(
        [sys.executable, str(script), "--help"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert "--quick" in run.stdout
