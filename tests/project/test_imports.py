"""What imports what: lazily at the front door, one way between the packages."""

from __future__ import annotations

import ast
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("stillhook", "models", "synth", "mpc")
FILES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
HEAVY = {
    "casadi",
    "control",
    "cvxpy",
    "matplotlib",
    "numpy",
    "pandas",
    "pydantic",
    "rich",
    "ruamel",
    "scipy",
    "waveresponse",
    "xarray",
}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_by(*arguments: str) -> set[str]:
    """Every module that a fresh interpreter imports when it runs `python *arguments`."""
    run = subprocess.run(
        [sys.executable, "-X", "importtime", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    lines = [line for line in run.stderr.splitlines() if line.startswith("import time:")]
    return {line.rsplit("|", 1)[1].strip() for line in lines}


def test_help_imports_nothing_heavy():
    seen = imported_by("-m", "stillhook", "--help")
    assert "stillhook.cli" in seen
    assert {name.partition(".")[0] for name in seen} & HEAVY == set()


def test_importing_stillhook_imports_nothing_heavy():
    seen = imported_by("-c", "import stillhook")
    assert "stillhook" in seen
    assert {name.partition(".")[0] for name in seen} & HEAVY == set()


def test_the_import_log_shows_heavy_modules():
    # The two tests above mean something only if the log would have shown them.
    assert "numpy" in imported_by("-c", "import numpy")


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_module_imports_and_says_what_it_is_for(path):
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if path.name == "__main__.py":
        return  # importing it runs the program
    module = importlib.import_module(module_name(path))
    assert Path(module.__file__ or "") == path
    missing = [name for name in getattr(module, "__all__", ()) if not hasattr(module, name)]
    assert missing == []


def lint_imports(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [
            sys.executable,
            "-c",
            "from importlinter.cli import lint_imports_command; lint_imports_command()",
            "--config",
            str(ROOT / "pyproject.toml"),
            "--no-cache",
        ],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_the_contracts_hold():
    run = lint_imports(ROOT)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "8 kept, 0 broken" in run.stdout


@pytest.mark.parametrize(
    ("file", "text", "broken"),
    [
        ("synth/loop/one.py", "import models.sea", None),
        ("stillhook/runs/one.py", "import mpc.winch", None),
        ("models/sea/one.py", "import synth.loop", "models.sea.one -> synth.loop"),
        ("synth/loop/one.py", "import mpc.winch", "synth.loop.one -> mpc.winch"),
        ("mpc/floor/one.py", "import stillhook.text", "mpc.floor.one -> stillhook.text"),
        ("synth/verify/one.py", "import synth.loop", "synth.verify.one -> synth.loop"),
        ("models/sea/one.py", "import models.plant", "models.sea.one -> models.plant"),
        ("mpc/winch/one.py", "def f():\n    import mpc.linear", "mpc.winch.one -> mpc.linear"),
        ("synth/odd/__init__.py", "", "not listed as layers"),
    ],
)
def test_a_contract_bites(tmp_path, file, text, broken):
    skeleton(tmp_path)
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(f"{text}\n")
    run = lint_imports(tmp_path)
    assert (run.returncode == 0) is (broken is None), run.stdout + run.stderr
    assert broken is None or broken in run.stdout


@pytest.mark.parametrize("package", PACKAGES)
def test_a_circle_for_types_alone_is_found(tmp_path, package):
    skeleton(tmp_path)
    room = next(path for path in sorted((tmp_path / package).iterdir()) if path.is_dir())
    (room / "one.py").write_text("from . import two\n")
    text = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from . import one\n"
    (room / "two.py").write_text(text)
    run = lint_imports(tmp_path)
    assert run.returncode == 1
    assert f"No cycles are allowed in {package}.{room.name}" in run.stdout


def skeleton(folder: Path) -> None:
    """Make the four packages with their rooms, all empty."""
    for path in [*FILES, *(ROOT / "stillhook").glob("*.py")]:
        if path.name == "__init__.py" or path.parent == ROOT / "stillhook":
            empty = folder / path.relative_to(ROOT)
            empty.parent.mkdir(parents=True, exist_ok=True)
            empty.touch()


ROOMS = sorted(path.parent for path in FILES if path.name == "__init__.py")


@pytest.mark.parametrize("folder", ROOMS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_room_is_one_subject_with_a_face(folder):
    files = [path for path in folder.glob("*.py") if path.name != "__init__.py"]
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in folder.glob("*.py"))
    assert len(files) <= 16
    assert lines <= 4500
    stray = [
        path.name
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name) and node.id == "__all__"
    ]
    assert stray == []  # only a face says what others may use


def test_no_private_name_is_taken_from_another_file():
    taken = [
        f"{module_name(path)}: {name.name}"
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.level or node.module in PACKAGES)
        for name in node.names
        if name.name.startswith("_") and not name.name.startswith("__")
    ]
    assert taken == []


SHADOWS = {
    "file": (Path("models.py"), "models.py"),
    "package": (Path("synth", "__init__.py"), str(Path("synth", "__init__.py"))),
}


@pytest.mark.parametrize("kind", SHADOWS)
@pytest.mark.parametrize("statement", ["import stillhook", "from stillhook import cli"])
def test_a_shadowed_package_is_named(tmp_path, kind, statement):
    path, named = SHADOWS[kind]
    (tmp_path / path).parent.mkdir(exist_ok=True)
    (tmp_path / path).write_text("raise SystemExit('the check must not run this file')\n")
    run = subprocess.run(
        [sys.executable, "-c", statement],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert last.startswith(f"ImportError: `import {path.parts[0].removesuffix('.py')}` finds ")
    assert str(tmp_path / named) in last
    assert "rename that file or folder" in last


def test_a_folder_without_code_shadows_nothing(tmp_path):
    # Python prefers a real package further down its path, so neither may the check complain.
    (tmp_path / "mpc").mkdir()
    run = subprocess.run(
        [sys.executable, "-c", "import stillhook"], cwd=tmp_path, timeout=60, check=False
    )
    assert run.returncode == 0


def test_a_missing_package_is_named(tmp_path):
    home = tmp_path / "site"
    (home / "stillhook").mkdir(parents=True)
    shutil.copy(ROOT / "stillhook" / "_distribution.py", home / "stillhook")
    script = "import runpy; runpy.run_path('stillhook/_distribution.py')['check_siblings']()"
    run = subprocess.run(
        [sys.executable, "-I", "-S", "-c", script],  # no site-packages: nothing else is found
        cwd=home,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 1
    message = f"`models` is missing from {home}: install stillhook again."
    assert message in run.stderr.strip().splitlines()[-1]
