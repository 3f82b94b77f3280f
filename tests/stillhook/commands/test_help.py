"""The help: contents by what somebody wants to do, and examples that run."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import time
from importlib import import_module

import pytest

from stillhook import cli
from stillhook.cli import COMMANDS, CONTENTS, build_parser

ROOMS = {name: room for name, room, _ in COMMANDS}

#: Examples that end with 1 as they should: the thesis's own gains break a limit.
NOT_OK = {
    "stillhook evaluate thesis-1975",
    "stillhook evaluate thesis-1975 --gains A=200,a=30,a1=60,a2=60 --no-bound",
    "stillhook margins thesis-1975 --off payload.mass=0.5 --off 'delay=20 ms'",
    "stillhook report thesis-1975 --without comparison,operability,failures",
    "stillhook sweep thesis-1975 --samples 1000",
    "stillhook sweep thesis-1975 --mode time --samples 4 --duration '1 min'",
}
#: Those that take over three seconds.
SECONDS = {
    "stillhook optimise thesis-1975 --structure payload-feedback --starts 4",
    "stillhook structures thesis-1975 --structures payload-feedback,low-order-2",
    "stillhook robust thesis-1975 --vary payload.mass=30t..40t --starts 2",
    "stillhook simulate thesis-1975 --duration '2 min'",
    "stillhook simulate thesis-1975 --controller none,mpc --duration '2 min'",
    "stillhook compare thesis-1975 --controllers none,thesis,mpc --seeds 2",
    "stillhook report thesis-1975 --without comparison,operability,failures",
    "stillhook sweep thesis-1975 --samples 1000",
    "stillhook size thesis-1975 --target '150 mm' --hs '1 m' --points 3 --starts 1",
    "stillhook pareto thesis-1975 --points 4",
    "stillhook vessel hull --length 80 --beam 18 --draught 6 --kg 6 --panels 150",
}
#: And minutes.
MINUTES = {
    "stillhook optimise subsea-crane",
}
#: It serves until it is stopped.
ENDLESS = "page"


def examples_of(name):
    if not ROOMS[name]:
        return cli._EXAMPLES[name]
    module = f"stillhook.commands.{ROOMS[name]}.{name.replace(' ', '_')}"
    return getattr(import_module(module), "EXAMPLES", ())


EXAMPLES = {line: name for name in ROOMS for line, _ in examples_of(name)}


def marked(line):
    mark = [pytest.mark.slow] if line in MINUTES else [pytest.mark.ci] if line in SECONDS else []
    return pytest.param(line, marks=mark)


def help_of(capsys, *words):
    with pytest.raises(SystemExit) as end:
        cli.main([*words, "--help"])
    assert end.value.code == 0
    return capsys.readouterr().out


def test_the_contents_are_one_line_a_command_in_80_columns(capsys):
    text = help_of(capsys)
    assert max(map(len, text.splitlines())) <= 80
    lines = text.splitlines()
    columns = set()
    for heading, rows in CONTENTS:
        at = lines.index(f"{heading}:")
        told = [row for row in rows if row[1]]
        for line, (name, _, help) in zip(lines[at + 1 :], told, strict=False):
            assert line.split() == [*name.split(), *help.split()]
            columns.add(line.index(help))
        assert lines[at + 1 + len(told)] == ""
    assert len(columns) == 1


def test_every_command_stands_in_the_contents_once():
    names = [name for name, *_ in COMMANDS]
    assert len({*names}) == len(names) > 25
    parts = build_parser()._subparsers._group_actions[0].choices
    assert {name.split()[0] for name in names} == {*parts}


def test_the_help_imports_nothing_heavy_and_is_quick():
    program = (
        "import sys; from stillhook.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'rich', 'scipy', 'models.case') if m in sys.modules])"
    )
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"
    assert time.monotonic() - began < 3.0  # 0.1 s alone on the machine


@pytest.mark.parametrize("name", ROOMS)
def test_every_command_has_examples_that_its_parser_takes(capsys, name):
    rows = examples_of(name)
    assert 1 <= len(rows) <= 3
    text = help_of(capsys, *name.split())
    shown = text.partition("examples:\n")[2]
    assert shown == "".join(f"  # {comment}\n  {line}\n" for line, comment in rows)
    for line, comment in rows:
        assert len(line) <= 78
        assert len(comment) <= 76
        words = shlex.split(line)
        assert words[0] == "stillhook"
        assert words[1 : 1 + len(name.split())] == name.split() or not ROOMS[name]
        build_parser(words[1:]).parse_args(words[1:])


@pytest.mark.parametrize("line", [marked(x) for x, name in EXAMPLES.items() if name != ENDLESS])
def test_an_example_runs(run, line):
    if "hull" in line:
        pytest.importorskip("capytaine")
    ending = run(*shlex.split(line)[1:])
    assert ending.err == ""
    assert ending.status == (1 if line in NOT_OK else 0)
    assert ending.out


def test_what_is_said_of_examples_is_of_those_that_there_are():
    assert (NOT_OK | SECONDS | MINUTES) - {*EXAMPLES} == set()


def test_a_command_in_no_group_is_not_known(run):
    ending = run("nonsense")
    assert ending.status == 2
    assert "invalid choice: 'nonsense'" in ending.err


def test_the_version_tells_the_commit(run):
    text = run("--version").out
    assert re.fullmatch(r"stillhook \d+\.\d+\.\d+( \(commit [0-9a-f]{8}\))?\n", text)
    assert ("commit" in text) == os.path.exists(
        os.path.join(os.path.dirname(cli.__file__), "../.git")
    )


def test_the_progress_of_a_command_is_its_own(monkeypatch, tmp_path):
    """What a command calls shows no bar beside the command's, also where it is quiet."""
    from models.basics import show_by_default, shows_progress

    shown = []

    @contextlib.contextmanager
    def show(what):
        shown.append(what)
        yield lambda stage, done, total: None

    @shows_progress("searching")
    def search(arguments):
        return 0

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("stillhook.commands.world.cases.run", search)
    show_by_default(show)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            assert cli.main(["cases"]) == 0
        assert shown == []
        search(None)
        assert shown == ["searching"]
    finally:
        show_by_default(None)
