"""The C that is exported: built as its README says, and the same commands."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from former_cases import load_case
from laws_in_c import needs_compiler

import stillhook as sh
from models.basics import SolverError
from models.sensing import HEARD, STATUSES
from stillhook.exports.c_code import as_c
from stillhook.exports.exported import Exported
from stillhook.exports.facts import facts_of
from stillhook.exports.law import Law, law_of
from stillhook.exports.readme import SAFETY, readme
from stillhook.exports.recording import Recording, record

CASE = load_case("subsea-crane")


@cache
def exported(kind: str = "feed-forward") -> tuple[Law, Recording, Exported]:
    law = law_of(CASE, controller=kind)
    recording = record(law)
    return law, recording, as_c(law, recording)


def written(one: Exported, folder: Path) -> Path:
    for path, content in one.files.items():
        place = folder / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


@needs_compiler
def test_make_check_builds_it_and_finds_the_same_commands(tmp_path: Path) -> None:
    _, recording, one = exported()
    folder = written(one, tmp_path)
    said = subprocess.run(
        ["make", "-C", str(folder), "check"], capture_output=True, text=True, check=True
    ).stdout
    assert f"samples {len(recording.commands)}" in said
    assert re.search(r"largest difference 0 of the command's range", said)
    assert "statuses that differ 0" in said
    assert one.proved
    assert "3001 samples: the same commands to the last bit, and the same statuses" in one.proof


@needs_compiler
def test_other_flags_stay_within_the_tolerance(tmp_path: Path) -> None:
    folder = written(exported()[2], tmp_path)
    for flags in ("-O3 -march=native -ffp-contract=fast", "-O0", "-std=c11 -O1"):
        subprocess.run(
            ["make", "-B", "-C", str(folder), "check", f"CFLAGS={flags}"],
            capture_output=True,
            check=True,
        )


@needs_compiler
@pytest.mark.parametrize("spoilt", ["command", "status", "row"])
def test_the_replay_finds_what_is_not_the_same(tmp_path: Path, spoilt: str) -> None:
    folder = written(exported()[2], tmp_path)
    vector = folder / "vector.csv"
    lines = vector.read_text().splitlines()
    cells = lines[500].split(",")
    if spoilt == "command":
        cells[-2] = repr(float(cells[-2]) + 1e-6)
    elif spoilt == "status":
        cells[-1] = "3"
    else:
        cells = cells[:9]
    lines[500] = ",".join(cells)
    vector.write_text("\n".join(lines) + "\n")
    answer = subprocess.run(
        ["make", "-C", str(folder), "check"], capture_output=True, text=True, check=False
    )
    assert answer.returncode == 2  # of make
    wanted = "row 501 has no number in column 10" if spoilt == "row" else "at sample 499"
    if spoilt != "status":
        assert wanted in answer.stdout + answer.stderr
    else:
        assert "statuses that differ 1" in answer.stdout


@needs_compiler
def test_an_export_that_does_something_else_is_not_written() -> None:
    law, recording, _ = exported()
    commands = recording.commands.copy()
    commands[77] += 1e-3
    with pytest.raises(SolverError, match="export: c: the replay finds other commands"):
        as_c(law, replace(recording, commands=commands))


def test_without_a_compiler_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    law, recording, _ = exported()
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    one = as_c(law, recording)
    assert not one.proved
    assert one.proof == "It was not compiled: there is no C compiler on the machine that wrote it."


def test_the_header_tells_what_it_is() -> None:
    case = load_case("thesis-1975")
    design = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    law = law_of(design)
    one = as_c(law, record(law))
    header = str(one.files["payload_feedback.h"])
    for part in (
        "It is no safety function",
        case.digest,
        "A = 200.0",
        "a1 = 100.0 ",
        "motor torque, peak",
        "sample time: 5.00 ms",
    ):
        assert part in header
    for i, name in enumerate(HEARD):
        assert f"PAYLOAD_FEEDBACK_{name.replace('.', '_').upper()} = {i}," in header
    for i, name in enumerate(STATUSES):
        assert f"PAYLOAD_FEEDBACK_IS_{name.upper()} = {i}" in header


def test_the_readme_has_all_that_somebody_else_needs() -> None:
    law, recording, one = exported()
    text = readme(one, law=law, recording=recording, facts=facts_of(law))
    assert text.startswith(f"# C99\n\n{SAFETY}")
    for part in (
        "make check",
        "## How it was checked",
        "`vector.csv` holds 3001 samples, one every 20 ms",
        "42 s: the operator disables the controller for 2 s",
        "hauling in",
        CASE.digest,
    ):
        assert part in text
    for name in HEARD:
        assert f"`{name}`" in text
    assert "`mru.heave_rate` |" in text
    assert "`payload.velocity` *" in text
    for name in STATUSES:
        assert f"| {name} |" in text
