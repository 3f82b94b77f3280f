"""What every command takes: --json, --quiet, --no-figures and --format."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from stillhook.cli import COMMANDS, build_parser, main

GAINS = "A=1,a=16,a1=44,a2=6.4"
CALM = ("subsea-crane", "--set", "sea.significant_height=1")
# What the gains were made for.
CALM += ("--set", "rope.damping_law=kelvin-voigt")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def told(capsys, *words: str) -> dict:
    """Run a command with --json and return what it printed, which is nothing else."""
    capsys.readouterr()
    status = main([*words, "--json"])
    out = capsys.readouterr().out
    data = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert data.get("ok") is not False or status == 1
    return data


@pytest.mark.parametrize(
    "words",
    [
        ("cases",),
        ("scenarios",),
        ("scenarios", "landing"),
        ("vessel", "list"),
        ("check", "thesis-1975"),
        ("evaluate", *CALM, "--gains", GAINS, "--no-bound"),
        ("bound", "thesis-1975"),
        ("margins", "thesis-1975", "--draws", "10"),
        ("compare", "thesis-1975", "--list"),
    ],
    ids=" ".join,
)
def test_json_is_one_object_and_nothing_else(capsys, words):
    data = told(capsys, *words)
    assert set(data) >= {"name", "about", "ok", "status", "sections", "written"}
    for section in data["sections"]:
        assert set(section) == {"title", "items"}


def test_json_holds_the_rows_of_a_table_by_the_names_of_its_columns(capsys):
    data = told(capsys, "cases")
    (table,) = data["sections"][0]["items"]
    names = [column["name"] for column in table["columns"]]
    assert all(list(row) == names for row in table["rows"])
    assert "subsea-crane" in {row["name"] for row in table["rows"]}


def test_json_wins_over_quiet(capsys):
    assert told(capsys, "check", "thesis-1975", "--quiet")["sections"]


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("cases", "thesis-1975"),
        ("scenarios", "landing"),
        ("vessel list", "osv-83m"),
        ("compare thesis-1975 --list", "clairvoyant"),
    ],
)
def test_a_list_is_told_quietly_too(capsys, command, name):
    assert main([*command.split(), "--quiet"]) == 0
    out = capsys.readouterr().out
    assert name in out
    assert "Next:" not in out


def test_json_of_runs_holds_every_controller(capsys):
    words = ("simulate", *CALM, "--controller", "feed-forward,none", "--duration", "30 s")
    data = told(capsys, *words, "--no-figures", "--traces", "none", "--out", "here")
    assert set(data["controllers"]) == {"feed-forward", "none"}


@pytest.mark.parametrize(
    ("asked", "endings"),
    [((), {".svg", ".png"}), (("--format", "svg"), {".svg"}), (("--no-figures",), set())],
    ids=["both", "svg", "none"],
)
@pytest.mark.parametrize("command", ["evaluate --no-bound", "sweep --samples 16"])
def test_figures_are_drawn_as_asked(command, asked, endings):
    name, *words = command.split()
    main([name, *CALM, *words, "--gains", GAINS, "--quiet", "--out", "here", *asked])
    drawn = {path.suffix for path in Path("here").iterdir()} & {".svg", ".png", ".pdf"}
    assert drawn == endings


def test_every_command_declares_its_arguments():
    text = build_parser().format_help()
    assert all(re.search(rf"^  {name}  ", text, re.M) for name, room, _ in COMMANDS if room)


@pytest.mark.parametrize("name", [name for name, module, _ in COMMANDS if module])
def test_every_command_takes_what_all_take(capsys, name):
    with pytest.raises(SystemExit) as end:
        main([*name.split(), "--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    for flag in ("--quiet", "--json", "--no-figures", "--format"):
        assert flag in out


def test_only_the_command_that_is_asked_for_is_imported():
    code = (
        "import sys; from stillhook.cli import build_parser; build_parser(['cases']);"
        "print([m for m in sys.modules if m.startswith('stillhook.commands.')])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert "stillhook.commands.world.cases" in run.stdout
    assert "optimise" not in run.stdout
    assert "sweep" not in run.stdout


def test_json_of_a_design_holds_its_fields(capsys):
    result = told(capsys, "evaluate", *CALM, "--gains", GAINS, "--no-bound")["result"]
    assert result["parameters"] == {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}
    assert result["payload_rms"] > 0.0
    assert "case" not in result
