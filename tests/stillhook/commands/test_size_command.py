"""`stillhook size` and `stillhook worth`: what they write, what they say, how they end."""

from __future__ import annotations

from pathlib import Path

import pytest

import stillhook as sh
from stillhook.cli import main
from stillhook.designs import load_design

pytestmark = pytest.mark.ci  # whole optimisations in fixtures

CALM = ["--set", "sea.significant_height=1"]


def test_size_writes_the_curve_the_case_and_the_design(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = ["size", "thesis-1975", "--target", "150 mm", "--hs", "1 m", "--gear", "22..30"]
    assert main([*words, "--points", "3", "--starts", "2", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "the smallest motor has" in said
    assert "up to H_s 0.9" in said
    assert f"stillhook worth {out / 'sized.yaml'}" in said
    names = {path.name for path in out.iterdir()}
    assert {"size.csv", "size.svg", "size.png", "sized.yaml", "design.yaml"} <= names
    sized = sh.load_case(str(out / "sized.yaml"))
    assert sized.limits.drive == "enforce"
    assert load_design(out / "design.yaml").verify().ok
    # A target that cannot be met leaves nothing of the earlier run behind.
    words[3] = "1 mm"
    assert main([*words, "--points", "3", "--starts", "2", "--out", str(out), "--quiet"]) == 1
    assert "no motor" in capsys.readouterr().out
    assert not (out / "sized.yaml").exists()


def test_co_design_keeps_the_motor_and_writes_the_best_gear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["size", "thesis-1975", *CALM, "--set", "limits.drive=enforce", "--co-design"]
    words += ["--gear", "30..40", "--starts", "2", "--out", str(tmp_path)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "the best gear is 32." in said
    sized = sh.load_case(str(tmp_path / "sized.yaml"))
    assert sized.winch.drive.torque_peak == sh.load_case("thesis-1975").winch.drive.torque_peak
    assert 32.0 < sized.winch.gearbox.ratio < 33.0
    assert (tmp_path / "gears.csv").read_text().startswith("gear,radius,payload_rms")


def test_worth_says_what_to_buy_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["worth", "thesis-1975", "--set", "sensors.telemetry.delay=50 ms", "--starts", "2"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "buy first: telemetry delay" in said
    assert "mm per 10.0 ms" in said
    assert {"worth.csv", "worth.svg", "worth.png"} <= {path.name for path in tmp_path.iterdir()}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["size", "thesis-1975"], "--target"),
        (["size", "thesis-1975", "--target", "1 m", "--co-design"], "--target"),
        (["size", "thesis-1975", "--target", "20 kg"], "target"),
        (["size", "thesis-1975", "--target", "20 mm", "--gear", "30"], "--gear"),
        (["size", "thesis-1975", "--target", "20 mm", "--radius", "1..2"], "--radius"),
        (["size", "thesis-1975", "--target", "20 mm", "--structure", "nix"], "nix"),
        (["size", "thesis-1975", "--target", "20 mm", "--motors", "none.csv"], "none.csv"),
        (["worth", "thesis-1975", "--structure", "nix"], "nix"),
        (["worth", "thesis-1975", "--starts", "0"], "--starts"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_status_2(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert "\n" not in error
