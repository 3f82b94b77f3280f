"""Designs as files: the same design comes back, and a file that is no design is refused."""

from __future__ import annotations

import dataclasses
import os
import re
from pathlib import Path

import numpy as np
import pytest
from designs import infeasible_design, loopless_design, thesis_design, unstable_design

import stillhook as sh
from models import Case, InputError
from stillhook.designs import design_data
from synth.search import Start
from synth.verify import Verification

DESIGNS = {
    "given gains": thesis_design,
    "unstable": unstable_design,
    "nothing found": loopless_design,
    "infeasible": infeasible_design,
}


def differences(one: object, other: object, path: str = "design") -> list[str]:
    """Where two nested results differ, to the last bit."""
    if isinstance(one, Case):
        return [] if one == other else [path]
    if dataclasses.is_dataclass(one) and not isinstance(one, type):
        if type(one) is not type(other):
            return [path]
        names = [field.name for field in dataclasses.fields(one)]
        return [
            found
            for name in names
            for found in differences(getattr(one, name), getattr(other, name), f"{path}.{name}")
        ]
    if isinstance(one, np.ndarray):
        same = isinstance(other, np.ndarray) and np.array_equal(one, other)
        return [] if same else [path]
    if isinstance(one, dict):
        if not isinstance(other, dict) or list(one) != list(other):
            return [path]
        return [f for key in one for f in differences(one[key], other[key], f"{path}[{key}]")]
    if isinstance(one, tuple):
        if not isinstance(other, tuple) or len(one) != len(other):
            return [path]
        pairs = enumerate(zip(one, other, strict=True))
        return [f for i, (a, b) in pairs for f in differences(a, b, f"{path}[{i}]")]
    return [] if type(one) is type(other) and one == other else [path]


def start(cost: float) -> Start:
    values = {
        "begin": np.array([0.1, -2.0, 1e-9]),
        "end": np.array([1.0 / 3.0, 2.0, -4e7]),
        "cost": cost,
        "converged": cost < 1.0,
        "stable": True,
        "message": "Solve_Succeeded: 100 %",
        "iterations": 17,
        "told": cost,
    }
    names = [field.name for field in dataclasses.fields(Start)]
    return Start(**{name: values[name] for name in names})


@pytest.mark.parametrize("make", DESIGNS.values(), ids=DESIGNS.keys())
def test_a_design_comes_back_as_it_was(make, tmp_path):
    design = make()
    path = sh.save_design(design, tmp_path / "design.yaml")
    assert path == tmp_path / "design.yaml"
    assert differences(design, sh.load_design(path)) == []


def test_starts_with_arrays_and_infinite_costs_come_back(tmp_path):
    design = dataclasses.replace(thesis_design(), starts=(start(0.5), start(np.inf)), agreed=1)
    back = sh.load_design(sh.save_design(design, tmp_path / "d.yaml"))
    assert differences(design, back) == []
    with pytest.raises(ValueError, match="read-only"):
        back.starts[0].end[0] = 1.0


def test_alternatives_come_back_on_the_same_case(tmp_path):
    other = dataclasses.replace(thesis_design(), status="another")
    design = dataclasses.replace(thesis_design(), alternatives=(other,))
    path = sh.save_design(design, tmp_path / "d.yaml")
    assert path.read_text(encoding="utf-8").count("winch:") == 1
    assert differences(design, sh.load_design(path)) == []


def test_members_come_back_on_their_own_cases(tmp_path):
    case = thesis_design().case
    member = dataclasses.replace(
        thesis_design(), case=case.replace({"rope.length": 1500.0}), built_for=case
    )
    other = dataclasses.replace(thesis_design(), members=(member,), status="another")
    design = dataclasses.replace(
        thesis_design(), members=(member,), alternatives=(other,), objective="mean", fixed=("a",)
    )
    path = sh.save_design(design, tmp_path / "d.yaml")
    assert path.read_text(encoding="utf-8").count("winch:") == 2
    assert differences(design, sh.load_design(path)) == []
    told = design_data(design)
    assert "case" not in told
    assert told["members"][0]["difference"] == "rope.length 1500"
    assert not {"case", "built_for"} & set(told["alternatives"][0]["members"][0])


def test_a_file_of_gains_of_the_first_format_is_read():
    back = sh.load_design(Path(__file__).parent / "format_1_gains.yaml")
    new = thesis_design()
    assert (back.structure, back.parameters) == (new.structure, new.parameters)
    # It was made when no limit on tension was there but a stated one, at the drum, before losses
    # switched, and with its noise behind the filter.
    before = {
        "limits.tension_ends": "drum",
        "winch.losses": "hauling",
        "sensors.payload.noise_enters": "after-filter",
    }
    assert back.case == new.case.replace(before)
    assert back.payload_rms == pytest.approx(new.payload_rms, rel=1e-9)
    since = {"rope.tension.least", "rope.lower_tension.least"}
    assert back.limits.keys() == new.limits.keys() - since
    assert back.shares == {}
    assert back.verify().ok


def test_a_file_of_a_structure_of_the_first_format_is_read():
    back = sh.load_design(Path(__file__).parent / "format_1_structure.yaml")
    assert back.structure == "payload-feedback-rolloff"
    assert back.parameters["A"] == 200.0
    assert back.parameters["a"] == 13.83496938452475
    assert back.feasible
    assert back.shares == {"payload.displacement": {"hook.heave": back.payload_rms}}
    assert back.case.sensors.telemetry.delay == 0.025
    assert back.starts == ()
    assert back.ok


def test_the_comparison_used_here_sees_a_last_digit():
    design = thesis_design()
    other = dataclasses.replace(design, payload_rms=np.nextafter(design.payload_rms, 1.0))
    assert differences(design, other) == ["design.payload_rms"]


def test_a_loaded_design_proves_itself(tmp_path):
    back = sh.load_design(sh.save_design(thesis_design(), tmp_path / "d.yaml"))
    assert isinstance(back.verification, Verification)
    assert back.verify().ok


def test_its_case_section_is_a_case_file(tmp_path):
    path = sh.save_design(thesis_design(), tmp_path / "d.yaml")
    text = path.read_text(encoding="utf-8")
    section = re.sub(r"(?m)^  ", "", text[text.index("\ncase:\n") + 7 :])
    (tmp_path / "case.yaml").write_text(section, encoding="utf-8")
    assert sh.load_case(tmp_path / "case.yaml") == thesis_design().case


def test_an_interrupted_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "d.yaml"
    sh.save_design(thesis_design(), path)
    before = path.read_bytes()

    def interrupted(source, target):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sh.save_design(unstable_design(), path)
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["d.yaml"]


WRONG = {
    "no gains": (r"(?ms)^parameters:.*?(?=^units)", "", r"d\.yaml:3: parameters: is missing"),
    "a gain missing": (
        r"(?m)^  a2: .*\n",
        "",
        r"d\.yaml:\d+: parameters\.a2: is missing; it must be",
    ),
    "another structure": (
        r"(?m)^structure: .*$",
        "structure: magic",
        r"structures: there is no structure 'magic'",
    ),
    "a gain that is text": (
        r"(?m)^  a1: .*$",
        "  a1: many",
        r"d\.yaml:\d+: parameters\.a1: must be a number, got 'many'",
    ),
    "not a number": (
        r"(?m)^payload_rms: .*$",
        "payload_rms: .nan",
        r"d\.yaml:\d+: payload_rms: must be a number, got nan",
    ),
    "a flag that is a number": (
        r"(?m)^ok: .*$",
        "ok: 1",
        r"d\.yaml:\d+: ok: must be true or false, got 1",
    ),
    "a fraction of a mass": (
        r"(?m)^masses: .*$",
        "masses: 1.5",
        r"d\.yaml:\d+: masses: must be a whole number, got 1\.5",
    ),
    "unknown key": (
        r"(?m)^masses: ",
        "colour: red\nmasses: ",
        r"d\.yaml:\d+: colour: unknown key; ",
    ),
    "section that is none": (
        r"(?ms)^margins:.*?(?=^limits)",
        "margins: 3\n",
        r"d\.yaml:\d+: margins: must be a section with keys of its own, got 3",
    ),
    "list that is none": (
        r"(?m)^  crossovers: .*$",
        "  crossovers: 3.0",
        r"d\.yaml:\d+: margins\.crossovers: must be a list, got 3\.0",
    ),
    "entry of a list": (
        r"(?m)^  crossovers: .*$",
        "  crossovers: [3.0, x]",
        r"d\.yaml:\d+: margins\.crossovers\[1\]: must be a number, got 'x'",
    ),
    "a figure of a limit": (
        r"(?m)^    bound: 5940\.0$",
        "    bound:",
        r"d\.yaml:\d+: limits\.motor\.torque\.continuous\.bound: must be a number, got nothing",
    ),
    "its case": (
        r"(?m)^    significant_height: .*$",
        "    significant_height: -1",
        r"d\.yaml:\d+: sea\.significant_height: must be a length in \[0.001, 30\] m, got -1",
    ),
    "another format": (
        r"(?m)^stillhook_design: 2$",
        "stillhook_design: 3",
        r"d\.yaml:3: stillhook_design: must be 1 or 2, the format that this version reads, got 3",
    ),
    "cut off": (r"(?s)\n  winch:.*", "\n", r"d\.yaml:\d+: winch: is missing"),
    "not YAML": (r"(?m)^ok: ", "ok: [", r"d\.yaml:\d+: is not YAML: "),
}


@pytest.mark.parametrize(("pattern", "replacement", "message"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_named(pattern, replacement, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sh.save_design(thesis_design(), "d.yaml")
    text = (tmp_path / "d.yaml").read_text(encoding="utf-8")
    changed, count = re.subn(pattern, replacement, text, count=1)
    assert count == 1
    (tmp_path / "d.yaml").write_text(changed, encoding="utf-8")
    with pytest.raises(InputError, match=f"^{message}"):
        sh.load_design("d.yaml")


def test_files_that_are_no_designs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"^none\.yaml: no such design file$"):
        sh.load_design("none.yaml")
    (tmp_path / "case.yaml").write_text(sh.load_case("thesis-1975").to_yaml())
    message = r"^case\.yaml: is not a design file: it has no key `stillhook_design`$"
    with pytest.raises(InputError, match=message):
        sh.load_design("case.yaml")
    (tmp_path / "empty.yaml").touch()
    with pytest.raises(InputError, match="is not a design file"):
        sh.load_design("empty.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"^binary\.yaml: is no text file, but a text in UTF-16"):
        sh.load_design("binary.yaml")
    with pytest.raises(InputError, match="no such design file"):
        sh.load_design("a" * 300)
    os.mkfifo("pipe")
    with pytest.raises(InputError, match="pipe: is a device or a pipe; a file is wanted"):
        sh.load_design("pipe")
    (tmp_path / "binary.yaml").write_bytes(b"a: \xe9")
    with pytest.raises(InputError, match=r"^binary\.yaml: is not a text file \(byte 3\)"):
        sh.load_design("binary.yaml")
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match=r"^out: is a folder; a design file is wanted$"):
        sh.load_design("out")
    sh.save_design(thesis_design(), tmp_path / "out" / "design.yaml")
    with pytest.raises(InputError, match=r"did you mean out/design\.yaml\?$"):
        sh.load_design("out")


def test_a_file_cannot_be_saved_into_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"d\.yaml: cannot be written: No such file"):
        sh.save_design(thesis_design(), tmp_path / "none" / "d.yaml")
