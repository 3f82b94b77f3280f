from __future__ import annotations

from pathlib import Path

import pytest

from models.vessel.readers import read_raos
from stillhook.cli import main

BOX = ["vessel", "hull", "--shape", "box", "--length", "40", "--beam", "10", "--draught", "3"]
SMALL = ["--panels", "40", "--count", "5", "--heading-step", "45", "--frequencies", "0.3..1.5"]


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("STILLHOOK_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def test_a_box_becomes_a_vessel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("capytaine")
    assert main([*BOX, *SMALL, "--gm", "1.2", "--name", "pontoon"]) == 0
    text = capsys.readouterr().out
    for words in ("displacement", "1230 t", "GM", "natural period of roll", "Long waves", "Next:"):
        assert words in text
    found = read_raos(tmp_path / "out" / "pontoon" / "raos.nc")
    assert found.name == "pontoon"
    assert found.heading.size == 8
    made = next(note for note in found.notes if note.startswith("made by: "))
    for name in ("raos.svg", "raos.png", "hull.svg", "hull.png"):
        assert (tmp_path / "out" / "pontoon" / name).stat().st_size > 5000
    # What differs from the defaults, in the order of the help.
    assert made == (
        "made by: stillhook vessel hull --shape box --length 40 --beam 10 --draught 3 --gm 1.2 "
        "--frequencies 0.3..1.5 --count 5 --heading-step 45 --panels 40 --name pontoon"
    )


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([*BOX[:-2], "--gm", "1"], "--draught missing"),
        (BOX, "got neither"),
        ([*BOX, "--gm", "1", "--kg", "2"], "got both"),
        ([*BOX, "--gm", "1", "--radii", "3,4"], "--radii must be 3 numbers"),
        ([*BOX, "--gm", "1", "--frequencies", "2..1"], "--frequencies"),
        ([*BOX, "--gm", "1", "--count", "2"], "--count must be in [4, 400]"),
        ([*BOX, "--gm", "1", "--heading-step", "7"], "must divide the circle"),
        ([*BOX, "--gm", "1", "--depth", "2"], "depth must be at least"),
        ([*BOX, "--gm", "1", "--threads", "0"], "--threads must be in"),
        (["vessel", "hull", "--mesh", "none.stl", "--gm", "1"], "no such file"),
        (["vessel", "hull", "--mesh", "a.stl", "--length", "1"], "not with --mesh"),
        (
            [
                "vessel",
                "hull",
                "--length",
                "80",
                "--beam",
                "18",
                "--draught",
                "6",
                "--block",
                "0.2",
            ],
            "block must be in",
        ),
    ],
)
def test_bad_input_is_told_in_one_line(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    error = capsys.readouterr().err
    assert told in error
    assert "Traceback" not in error
