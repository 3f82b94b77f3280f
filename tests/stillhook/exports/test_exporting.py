"""`sh.export`: what is asked for is written, whole, each folder with its README."""

from __future__ import annotations

from pathlib import Path

import pytest
from former_cases import load_case
from laws_in_c import needs_compiler

import stillhook as sh
from models.basics import InputError
from stillhook.exports import KINDS, SIGNALS, asked_kinds, exporting
from stillhook.exports.readme import SAFETY

CASE = load_case("subsea-crane")


@needs_compiler
def test_every_kind_has_a_folder_with_a_readme_and_a_proof(tmp_path: Path) -> None:
    pytest.importorskip("fmpy", reason="fmpy, the extra `export`, is not installed")
    told: list[str] = []
    found = sh.export(
        CASE,
        tmp_path,
        list(KINDS),
        controller="feed-forward",
        communication_step=0.01,
        duration=60.0,
        progress=lambda what, done, total: told.append(what),
    )
    assert [one.kind for one in found.exported] == list(KINDS)
    assert found.proved
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} == set(KINDS)
    for one in found.exported:
        text = (tmp_path / one.kind / "README.md").read_text(encoding="utf-8")
        assert SAFETY in text
        assert one.proof in text
        assert one.proof.endswith(".")
        law = one.kind in ("c", "fmu", "st", "mat", "json")
        assert ("`mru.heave_rate`" in text and CASE.digest in text) == law or one.kind == "plant"
    assert "margins with a command 10.0 ms later (a parallel master)" in dict(found.facts)
    assert set(found.written) == {p for p in tmp_path.rglob("*") if p.is_file()} - {
        tmp_path / ".stillhook"
    }
    assert told[0] == "controller"
    assert told[-1] == "writing"


def test_kinds_are_a_list_or_a_text() -> None:
    assert asked_kinds("c, st,c") == ("c", "st")
    assert asked_kinds(["mat"]) == ("mat",)
    for wrong in ("c,pdf", [], ["C"], ""):
        with pytest.raises(InputError, match="export: --to: "):
            asked_kinds(wrong)


def test_nothing_is_written_unless_all_could_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise InputError("export: st: no")

    monkeypatch.setattr(exporting, "as_structured_text", refused)
    with pytest.raises(InputError, match="export: st: no"):
        sh.export(CASE, tmp_path / "out", "c,st", controller="feed-forward")
    assert [p for p in (tmp_path / "out").rglob("*") if p.name != ".stillhook"] == []


def test_the_plant_alone_needs_no_controller(tmp_path: Path) -> None:
    pytest.importorskip("fmpy", reason="fmpy, the extra `export`, is not installed")
    found = sh.export(CASE, tmp_path, "plant")
    assert found.law is None
    assert (tmp_path / "plant" / "subsea_crane_plant.fmu").exists()


def test_a_sample_time_that_breaks_the_margins_is_one_sentence(tmp_path: Path) -> None:
    design = sh.evaluate_gains(load_case("thesis-1975"), {"A": 200, "a": 50, "a1": 100, "a2": 100})
    with pytest.raises(InputError, match=r"export: at a sample time of 0.4 s .*the longest"):
        sh.export(design, tmp_path, "c", sample_time=0.4)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"to": "dll"}, "there is no 'dll'; c, fmu, st"),
        ({"duration": 10.0}, "duration must be in"),
        ({"communication_step": 0.0}, "communication_step must be"),
        ({"controller": None}, "say which controller is meant"),
    ],
)
def test_what_is_wrong_is_one_sentence(
    tmp_path: Path, wrong: dict[str, object], message: str
) -> None:
    asked = {"to": "c", "controller": "feed-forward"} | wrong
    with pytest.raises(InputError, match=message):
        sh.export(CASE, tmp_path, **asked)  # type: ignore[arg-type]


def test_a_controller_alone_cannot_be_the_plant(tmp_path: Path) -> None:
    law = sh.VelocityFeedForward(CASE)
    with pytest.raises(InputError, match="say which case the controller is for"):
        sh.export(law, tmp_path, "plant")
    with pytest.raises(InputError, match="say which case the controller is for"):
        sh.export(law, tmp_path, "c")
    assert sh.export(law, tmp_path, "c", case=CASE).law is not None


def test_the_page_lists_the_signals_as_they_are() -> None:
    page = (Path(__file__).parents[3] / "docs" / "export.md").read_text(encoding="utf-8")
    for signal in SIGNALS:
        unit = signal.unit or "command"
        assert f"| `{signal.name}`: {signal.meaning} | {unit} | {signal.missing} |" in page
    for kind in KINDS:
        assert f"`{kind}`" in page
