"""`stillhook bound` from the command line."""

from __future__ import annotations

import re

import pytest

from models import load_case
from stillhook.cli import main
from synth.bound import bound_for


@pytest.mark.ci
def test_the_bound_is_that_of_python(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bound", "thesis-1975", "--quiet"]) == 0
    told = capsys.readouterr().out
    value = float(re.search(r"better than ([\d.e+-]+) mm", told).group(1))
    assert value == pytest.approx(1e3 * bound_for(load_case("thesis-1975")).free.value, rel=5e-3)


@pytest.mark.ci
def test_fewer_sensors_do_no_better(capsys: pytest.CaptureFixture[str]) -> None:
    values = []
    for sensors in ([], ["--sensors", "payload.displacement"]):
        assert main(["bound", "thesis-1975", *sensors]) == 0
        told = capsys.readouterr().out
        assert "stillhook structures thesis-1975" in told
        values.append(float(re.search(r"better than ([\d.e+-]+) mm", told).group(1)))
    assert values[1] > values[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sensors", "payload.colour"], "payload.colour"),
        (["--sensors", ","], "--sensors: must be names"),
        (["--faint", "0"], "bound: --faint must be"),
        (["--masses", "0"], "masses must be"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bound", "thesis-1975", *arguments]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1
