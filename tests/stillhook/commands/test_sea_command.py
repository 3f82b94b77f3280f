"""`stillhook sea`: what it says of a file and of a case, what it writes, how it ends."""

from __future__ import annotations

import csv
import shlex
from pathlib import Path

import numpy as np
import pytest

import stillhook as sh
from models.sea import read_scatter, read_seas
from stillhook.cli import main
from stillhook.commands.working import kept_in

FREQUENCIES = np.linspace(0.04, 0.4, 19)


@pytest.fixture
def buoy(tmp_path: Path) -> Path:
    rng = np.random.default_rng(2)
    lines = ["#YY MM DD hh mm " + " ".join(f"{f:.4f}" for f in FREQUENCIES)]
    for day in range(1, 29):
        peak = rng.uniform(0.07, 0.18)
        shape = (peak / FREQUENCIES) ** 5 * np.exp(1.25 - 1.25 * (peak / FREQUENCIES) ** 4)
        row = rng.uniform(0.5, 4.0) * (0.1 / peak) ** 4 * shape if day != 9 else np.full(19, 999.0)
        lines.append(f"2021 02 {day:02d} 12 00 " + " ".join(f"{s:.3f}" for s in row))
    path = tmp_path / "my buoy.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_file_of_records(buoy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["sea", str(buoy), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "NDBC text" in " ".join(said.split())
    assert "rejected: all values missing 1 line 10" in " ".join(said.split())
    records = read_seas(buoy)
    assert len(records) == 27
    highest = int(np.argmax(records.significant_height))
    assert f"Record {highest}, {str(records.time[highest]).replace('T', ' ')} UTC" in said
    site = read_scatter(out / "scatter.csv")
    assert site.occurrence.sum() == pytest.approx(1.0)
    assert site.mean_significant_height == pytest.approx(
        float(np.mean(records.significant_height)), abs=0.25
    )
    with open(out / "records.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 27
    assert float(rows[highest]["significant_height [m]"]) == pytest.approx(
        records.significant_height[highest], rel=1e-3
    )
    names = {*kept_in(out)}
    assert names == {
        "records.csv", "scatter.csv", "scatter.svg", "scatter.png", "spectrum.svg", "spectrum.png",
    }  # fmt: skip
    # What it tells to go on with is a sea that a case takes.
    (line,) = (line for line in said.splitlines() if "stillhook optimise" in line)
    words = shlex.split(line)
    from stillhook.commands.given import parse_changes

    case = sh.load_case("subsea-crane").replace(parse_changes(words[words.index("--set") + 1 :]))
    assert case.sea.record == highest
    # The tail above the last frequency is on top of what the buoy measured.
    measured = records.significant_height[highest]
    assert measured < case.sea.significant_height < 1.02 * measured


def test_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["sea", "subsea-crane", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("subsea-crane\njonswap, H_s 2.00 m\n")
    assert "2.00 m" in said
    assert {*kept_in(out)} == {"spectrum.svg", "spectrum.png"}
    assert main(["sea", "subsea-crane", "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.txt"], "none.txt: no such file"),
        (["{buoy}", "--record", "27"], "record must be in [0, 26]"),
        (["{buoy}", "--read-as", "grib"], "the format must be one of ndbc,"),
        (["{buoy}", "--height-step", "0"], "--height-step must be in [0.01, 20], got 0.0"),
        (["subsea-crane", "--record", "3"], "--record and --read-as are for a file of spectra"),
    ],
)
def test_bad_input_is_exit_status_2(
    words: list[str], message: str, buoy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word.format(buoy=buoy) for word in words]
    assert main(["sea", *given, "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err


def test_quiet_is_the_account_alone(
    buoy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sea", str(buoy), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith("28 records read, 1 rejected, 27 kept")
    assert said[1] == "  1 x all values missing (first: line 10)"
