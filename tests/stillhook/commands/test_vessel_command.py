"""`stillhook vessel`: what it says of a file, what it writes, how it ends."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vessel_tables import shipx_text, swinging, wamit_text

from models.vessel.readers import read_raos, write_raos
from stillhook.cli import main
from stillhook.commands.working import kept_in
from stillhook.seas import rao_figure

RAOS = swinging()


def test_import_shows_the_file_its_check_and_what_to_do_next(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "swing.re1"
    file.write_text(shipx_text({0.0: RAOS, 5.0: RAOS}))
    out = tmp_path / "out"
    assert main(["vessel", "import", str(file), "--speed", "5", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "ok: in long waves (0.08 rad/s, 9628 m) it heaves with the water" in said
    assert "8, 0.08 to 1.7 rad/s (periods 3.7 to 78.5 s)" in said
    assert "12, 0 to 330 deg, at most 30 deg apart" in said
    assert "ShipX .re1: surge aft, sway starboard" in said
    assert "speed 5 m/s of 0, 5 m/s" in said
    row = next(line for line in said.splitlines() if "90 deg" in line and "roll" in line)
    assert row.split()[-1] == "ok"
    assert "-90 deg" in row
    assert f"--set vessel.raos={out / 'raos.csv'}" in said
    assert {*kept_in(out)} == {"raos.csv", "raos.png", "raos.svg"}
    assert np.allclose(read_raos(out / "raos.csv").values, RAOS.values, rtol=1e-7)


def test_import_writes_netcdf_and_says_one_line_if_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "swing.4", tmp_path / "new" / "swing.nc"
    file.write_text(wamit_text(RAOS, length=90.0))
    words = ["vessel", "import", str(file), "--length", "90", "--out", str(out), "--quiet"]
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("swing: in long waves")
    assert np.allclose(read_raos(out).values, RAOS.values, rtol=1e-7)
    assert (out.parent / "swing.svg").is_file()


@pytest.mark.parametrize("ending", [".4", ".yml"])
def test_import_writes_the_files_of_other_programs(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = write_raos(tmp_path / "swing.csv", RAOS), tmp_path / f"other{ending}"
    assert main(["vessel", "import", str(file), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("swing: in long waves")
    assert np.allclose(read_raos(out).values, RAOS.values, rtol=1e-9)


def test_a_file_that_contradicts_long_waves_ends_with_two_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "swing.csv", tmp_path / "out"
    write_raos(file, replace(RAOS, values=np.conj(RAOS.values)))
    assert main(["vessel", "import", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert "look like lag for lead" in said.err
    assert not out.exists()
    assert main(["vessel", "import", str(file), "--out", str(out), "--no-check"]) == 0
    said = capsys.readouterr()
    assert "DOUBTFUL: in long waves" in said.out
    assert "wrong sign" in said.out


def test_a_table_of_heave_alone_is_not_said_to_turn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "heave.csv"
    file.write_text("Period (s);Heave amp (m/m);Heave phase (deg)\n40;1,0;0\n12;0,8;-10\n")
    words = ["vessel", "import", str(file), "--heading", "180", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "it heaves with the water and has no roll and pitch that could be checked" in said
    assert "no columns for surge, sway, roll, pitch, yaw" in " ".join(said.split())


def test_doubt_and_no_check_are_told_by_the_exit_status(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(1)
    odd = replace(RAOS, values=RAOS.values * np.exp(2j * rng.normal(size=(8, 1, 6))))
    short = replace(RAOS, omega=RAOS.omega[4:], values=RAOS.values[4:])
    for raos, mark in ((odd, "DOUBTFUL: at"), (short, "not checked: the table begins at 0.7")):
        file = write_raos(tmp_path / "swing.csv", raos)
        words = ["vessel", "import", str(file), "--out", str(tmp_path / "out")]
        assert main(words) == 1
        said = capsys.readouterr()
        assert mark in said.out
        assert "warning" in said.err
        if raos is short:
            rows = [line for line in said.out.splitlines() if " heave " in line and " deg " in line]
            assert rows
            assert all(line.split()[-2:] == ["not", "long"] for line in rows)
        assert main([*words, "--no-check"]) == 0
        assert mark in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["lost.4"], "lost.4: no such file\n"),
        (["queen-mary"], "no bundled vessel of this name (there is: osv-83m)"),
        (["osv-83m", "--draught", "deep"], "draught says nothing about a csv file"),
        (["osv-83m", "--origin", "1,2"], "--origin must be 3 numbers"),
    ],
)
def test_what_cannot_be_done_is_one_line(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["vessel", "import", *words]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1


def test_a_file_is_not_overwritten_by_its_own_import(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_raos(tmp_path / "raos.csv", RAOS)
    before = file.read_bytes()
    assert main(["vessel", "import", str(file), "--out", str(file)]) == 2
    assert "is the file itself" in capsys.readouterr().err
    assert main(["vessel", "import", str(file), "--out", str(tmp_path), "--force"]) == 2
    assert "is the file itself" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_list_names_the_bundled_vessels(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["vessel", "list"]) == 0
    assert "osv-83m  offshore" in capsys.readouterr().out


def test_the_command_needs_to_know_what_to_do() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["vessel"])
    assert ended.value.code == 2


def test_the_picture_has_six_amplitudes_and_phases_of_the_usual_headings() -> None:
    raos = swinging(24)
    figure = rao_figure(raos)
    assert len(figure.axes) == 12
    amplitude, phase = figure.axes[2], figure.axes[5]  # heave
    assert amplitude.get_title(loc="left") == "heave"
    labels = [str(line.get_label()) for line in amplitude.lines]
    assert labels == ["0° (following)", "45°", "90° (to port)", "135°", "180° (head)"]
    assert np.allclose(amplitude.lines[4].get_ydata(), np.abs(raos.values[:, 12, 2]))
    roll = figure.axes[6]
    assert np.allclose(roll.lines[2].get_ydata(), np.degrees(np.abs(raos.values[:, 6, 3])))
    assert phase.get_ylim() == (-180.0, 180.0)
    # One heading, and a vessel that does not move at all, are pictures too.
    still = replace(RAOS, heading=RAOS.heading[:1], values=0.0 * RAOS.values[:, :1])
    assert len(rao_figure(still).axes) == 12
