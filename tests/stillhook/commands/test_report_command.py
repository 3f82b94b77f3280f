"""`stillhook report`: one command, one document, and a sentence for whatever is wrong."""

from __future__ import annotations

import json
import re
import shlex

import pytest

from models import InputError

REPORT = ("report", "thesis-1975", "--no-bound")
ALL = "comparison,operability,sweep,sensitivity,robustness,failures,simulation"


@pytest.fixture(autouse=True)
def nothing_drawn(monkeypatch):
    """Draw nothing: that takes seconds, and is not what is asked."""
    from stillhook.report import document

    def nothing(drawing):
        raise InputError("nothing to draw")

    monkeypatch.setattr(document, "inline_svg", nothing)


def told(tmp_path, folder="out/thesis-1975-report"):
    return json.loads((tmp_path / folder / "report.json").read_text())["results"]


def test_the_command_runs_what_is_missing_and_says_what_the_document_has(run, tmp_path):
    found = run(*REPORT, "--without", "comparison,robustness,sweep,failures", "--seeds", "1")
    assert found.status == 1, found.err  # the thesis's own gains break M_s
    assert "with      operability, sensitivity, runs, held" in found.out
    names = "case.yaml, design.yaml, report.json, report.html, tables, report.pdf"
    assert f"Written to out/thesis-1975-report: {names}\n" in found.out
    results = told(tmp_path)
    assert results["operation"]["design"]["seeds"] == [0]
    assert results["failures"] is None
    assert results["reports"]["operability"]["sections"]
    assert results["reports"]["bound"]["sections"] == [{"title": "", "items": []}]


def test_what_the_title_block_is_given_stands_in_the_document(run, tmp_path):
    words = ["--client", "A & B", "--author", "N. N.", "--date", "2026-11-27"]
    words += ["--revision", "A; 2026-11-01; for comment; NN"]
    words += ["--revision", "B; 2026-11-27; for use"]
    assert run(*REPORT, "--without", ALL, *words).status == 1
    told_of = told(tmp_path)["identification"]
    assert (told_of["client"], told_of["author"]) == ("A & B", "N. N.")
    assert [row["mark"] for row in told_of["revisions"]] == ["A", "B"]
    assert told_of["date"] == "2026-11-27"
    page = (tmp_path / "out/thesis-1975-report/report.html").read_text()
    for shown in ("A &amp; B", "N. N.", "for comment", "for use"):
        assert f">{shown}</data>" in page


def test_a_requirement_is_held_against_the_design(run, tmp_path):
    assert run(*REPORT, "--without", ALL, "--payload-rms", "5 mm").status == 1
    (one,) = told(tmp_path)["requirement"]
    assert one["bound"] == 0.005
    assert not one["kept"]


def test_the_commands_to_go_on_with_work(run, tmp_path):
    found = run(*REPORT, "--without", ALL)
    following = [
        shlex.split(line)[1:]
        for line in found.out.splitlines()
        if re.match(r" +stillhook report", line)
    ]
    (requirement,) = following
    assert "--payload-rms" in requirement
    assert run(*requirement).status == 1
    assert told(tmp_path)["requirement"]


def test_without_typst_the_sentence_says_how_to_have_it(run, tmp_path, monkeypatch):
    import stillhook.report
    from stillhook.report import write

    monkeypatch.setattr(write, "can_typeset", lambda: False)
    monkeypatch.setattr(stillhook.report, "can_typeset", lambda: False, raising=False)
    found = run(*REPORT, "--without", ALL)
    assert "it needs typst: run `make report`" in found.out.replace("\n  ", " ")
    assert not (tmp_path / "out/thesis-1975-report/report.pdf").exists()


def test_without_figures_it_has_none(run, tmp_path, monkeypatch):
    from stillhook.report import document

    monkeypatch.setattr(document, "inline_svg", lambda drawing: pytest.fail("drawn"))
    assert run(*REPORT, "--without", ALL, "--no-figures").status == 1
    assert "<figure>" not in (tmp_path / "out/thesis-1975-report/report.html").read_text()


def test_as_json_it_is_the_verdict_and_the_files(run):
    found = run(*REPORT, "--without", ALL, "--json")
    data = json.loads(found.out)
    assert data["ok"] is False
    assert [name for name in data["written"] if name.endswith("report.html")]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--without nonsense", "report: --without: there is no 'nonsense'; comparison, "),
        ("--date yesterday", "report: date must be as in 2026-11-28, got 'yesterday'"),
        ("--revision A", "report: a revision must be 'MARK; DATE; TEXT"),
        ("--seas example", "report: --seas needs --duration, the planned time, as in 12h"),
        ("--duration 12h", "report: --duration is for weather windows; give --seas FILE, too"),
        (
            "--seas example --duration 12h --without operability",
            "report: --seas needs the study of operability; take it out of --without",
        ),
        ("--payload-rms '5 kg'", "operability: payload_rms: "),
        ("--seeds 0", "report: --seeds must be in [1, 1000]"),
        ("--gains a=1 --design no.yaml", "report: give --design, or --structure and --gains"),
        ("--design no.yaml", "no.yaml: no such design file"),
        ("--out /", "/: is the root of the file system; name a folder for the results"),
    ],
)
def test_what_is_wrong_is_one_sentence_before_anything_is_run(run, tmp_path, words, message):
    found = run(*REPORT, *shlex.split(words))
    assert found.status == 2
    assert found.err.startswith(message)
    assert found.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_folder_of_another_case_is_kept(run, tmp_path):
    assert run(*REPORT, "--without", ALL, "--out", "here").status == 1
    before = (tmp_path / "here/report.html").read_bytes()
    other = (*REPORT, "--without", ALL, "--out", "here", "--set", "rope.length=1500")
    found = run(*other)
    assert found.status == 2
    assert found.err.startswith("here: holds the report of another case (thesis-1975, ")
    assert "--force" in found.err
    assert (tmp_path / "here/report.html").read_bytes() == before
    assert run(*other, "--force").status == 1
    assert told(tmp_path, "here")["system"]["rope"]["stiffness"] != 0.0


@pytest.mark.parametrize("study", ["compare", "simulate", "failure_modes"])
def test_ctrl_c_writes_no_half_report(run, tmp_path, monkeypatch, study):
    import stillhook as sh

    class Stopped(list):
        complete, status = False, "interrupted"

    def stopped(*_, **__):
        return Stopped([Stopped()])

    monkeypatch.setattr(sh, study, stopped, raising=False)
    kept = {"compare": "comparison", "simulate": "simulation", "failure_modes": "failures"}[study]
    rest = ",".join(name for name in ALL.split(",") if name != kept)
    found = run(*REPORT, "--without", rest)
    assert found.status == 130
    assert "no report was written" in found.err
    assert not (tmp_path / "out/thesis-1975-report/report.html").exists()
