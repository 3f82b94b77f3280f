"""`stillhook motion`: what it prints, what it writes, how it ends."""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import pytest
from barge import barge_case

import stillhook as sh
from models.hook import HookMotion
from stillhook.cli import main
from stillhook.commands.working import kept_in


def table(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "motion.csv").read_text().splitlines()))


@pytest.fixture
def crane(tmp_path):
    path = tmp_path / "crane.yaml"
    path.write_text(barge_case(tmp_path).to_yaml())
    return str(path)


def test_a_vessel_over_headings_periods_and_sides(tmp_path, capsys, crane):
    words = ["motion", crane, "--headings", "90,150,210", "--tp", "7..9"]
    assert main([*words, "--fractile", "0.95", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "hook at x -25 m, y 14 m (port), 150 deg (bow sea from starboard)" in said
    assert "95 % below" in said
    assert "this winch can 2.24 m/s" in said
    assert max(len(line.rstrip()) for line in said.split("Written")[0].splitlines()) <= 80
    names = {*kept_in(tmp_path / "out")}
    assert names == {
        "case.yaml", "motion.csv", "motion.svg", "motion.png", "spectra.svg", "spectra.png",
    }  # fmt: skip
    rows = table(tmp_path / "out")
    assert len(rows) == 2 * 3 * 3
    # The place of least motion is a command that can be run, and is what it says.
    again = re.search(r"stillhook motion (.*vessel\.heading=(\d+) deg.*)", said)
    assert again is not None
    out = str(tmp_path / "again")
    assert main(["motion", *shlex.split(again[1]), "--out", out, "--quiet", "--tp", "9"]) == 0
    best = sh.load_case(f"{out}/case.yaml")
    speeds = [float(r["velocity_rms"]) for r in rows if r["peak_period"] == "9"]
    assert HookMotion.from_case(best).velocity.rms == pytest.approx(min(speeds), rel=1e-4)


def test_a_table_over_periods_only(tmp_path, capsys):
    words = ["motion", "landing", "--set", "sea.significant_height=5"]
    assert main([*words, "--tp", "6,12", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "over the peak period only: heave_rao holds for one hook in one heading" in said
    assert "too steep" in said
    assert {"motion.png", "spectra.png"} <= {path.name for path in tmp_path.iterdir()}


def test_quiet_says_the_case_only(tmp_path, capsys):
    assert main(["motion", "thesis-1975", "--tp", "8", "--quiet", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "displacement" in said
    assert "Next:" not in said


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ["--tp", "abc"],
            "--tp: must be numbers A,B,.. or LOW..HIGH[/STEP], at most 400, got 'abc'",
        ),
        (
            ["--tp", "9..6"],
            "--tp: must be numbers A,B,.. or LOW..HIGH[/STEP], at most 400, got '9..6'",
        ),
        (["--tp", "0.1"], "--tp: must be in [1, 40], got 0.1"),
        (["--headings", "nan"], "--headings: must be numbers A,B,.."),
        (["--fractile", "1"], "fractile must be in (0, 1), got 1.0"),
        (["--headings", "90"], "--headings: thesis-1975 has vessel.heave_rao"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, capsys, words, sentence):
    assert main(["motion", "thesis-1975", *words, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert len(told.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_crane_is_told_with_its_angles(tmp_path, capsys):
    case = barge_case(tmp_path)
    crane = {
        "x": -25.0, "y": 4.0, "z": 10.0, "slew": "90 deg", "boom_length": 20.0,
        "boom_angle": "60 deg",
    }  # fmt: skip
    path = tmp_path / "crane.yaml"
    path.write_text(case.replace({"vessel.crane": crane}).to_yaml())
    # From starboard the port side is the one that moves less, so ask with waves from port.
    words = ["motion", str(path), "--headings", "270", "--tp", "9", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "--set vessel.crane.y=-4 --set vessel.crane.slew=-1.5708" in said


def test_check_tells_the_vessel_and_the_hook(capsys, crane):
    assert main(["check", crane]) == 0
    said = capsys.readouterr().out
    assert "barge  hook at x -25 m, y 14 m (port)" in said
    assert "150 deg  bow sea from starboard" in said
