"""`stillhook compare`: what it prints and writes, and how it ends, whatever it is given."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from designs import thesis_design

import stillhook as sh
from stillhook.comparison.bench import CellBench
from stillhook.comparison.store import STORE
from stillhook.controllers import CONTENDERS
from stillhook.designs import save_design

CALM = ("compare", "thesis-1975", "--set", "sea.significant_height=0.5")
SHORT = ("--seeds", "2", "--duration", "30 s", "--jobs", "1")
WHO = ("--controllers", "none,feed-forward")


def test_a_comparison_ends_well_and_fills_its_folder(run):
    ending = run(*CALM, *WHO, *SHORT, "--hs", "0.4,0.6", "--out", "here")
    assert (ending.status, ending.err) == (0, "")
    assert max(map(len, ending.out.partition("\nWritten to")[0].splitlines())) <= 80
    assert "\x1b" not in ending.out
    for text in (
        "thesis-1975: 2 contenders, H_s 0.4, 0.6 m, 2 seeds of 30 s",
        "H_s 0.4 m",
        "H_s 0.6 m: the best linear law is feed-forward, ",
        "Written to here: case.yaml, table.csv, runs.csv, summary.json, summary.md, figures",
    ):
        assert text in ending.out, text
    names = {path.name for path in Path("here").iterdir()}
    assert {STORE, "summary.md", "heights.svg", "worst.png"} <= names
    assert "traces.csv" not in names
    content = json.loads(Path("here/summary.json").read_text(encoding="utf-8"))
    assert content["seeds"] == [0, 1]
    assert content["question"]["duration"] == 30.0
    assert sh.load_case("here/case.yaml").sea.significant_height == 0.5


def test_the_same_command_again_computes_nothing(run, monkeypatch):
    words = (*CALM, *WHO, *SHORT, "--no-figures", "--out", "here")
    first = run(*words)
    tables = Path("here/table.csv").read_bytes(), Path("here/runs.csv").read_bytes()
    monkeypatch.setattr(CellBench, "do", lambda *given: pytest.fail("computed again"))
    again = run(*words)
    assert (again.status, again.out) == (0, first.out)
    assert (Path("here/table.csv").read_bytes(), Path("here/runs.csv").read_bytes()) == tables


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--controllers", "none,feed-backward"), "there is no controller 'feed-backward'; there"),
        (("--hs", "1.25,high"), "--hs must be numbers with commas between"),
        (("--hs", "-1"), "heights"),
        (("--seeds", "0"), "--seeds"),
        (("--duration", "soon"), "compare: duration must be a time"),
        (("--mismatch", "pay=+30%"), "there is no 'pay'; there are payload"),
        (("--controllers", "none,none"), "must have names that differ"),
        (("--controllers", "nothing.yaml"), "nothing.yaml"),
        (("--jobs", "0"), "jobs"),
        (("--design", "nothing.yaml"), "nothing.yaml"),
        (("--controllers", "none", "--all"), "give --controllers or --all, not both"),
        (("--controllers", "none", "--design", "mine.yaml"), "mine.yaml"),
        (("--settle", "30 s", "--duration", "30 s"), "settle"),
    ],
)
def test_a_wrong_question_is_one_sentence_and_leaves_nothing_behind(run, words, told):
    ending = run(*CALM, *words, "--out", "deep/here")
    assert ending.status == 2
    assert told in ending.err
    assert ending.out == ""
    assert len(ending.err.strip().splitlines()) == 1
    assert not Path("deep").exists()


def test_a_folder_with_another_comparison_is_refused(run):
    assert run(*CALM, *WHO, *SHORT, "--no-figures", "--out", "here").status == 0
    kept = Path("here", STORE).read_bytes()
    ending = run(*CALM, *WHO, *SHORT, "--no-figures", "--mismatch", "E=-30%", "--out", "here")
    assert ending.status == 2
    assert "holds another comparison: mismatch.E is not given, not -30%" in ending.err
    assert Path("here", STORE).read_bytes() == kept


def test_a_design_file_takes_part_under_its_name(run):
    save_design(thesis_design(), "mine.yaml")
    ending = run(*CALM, *SHORT, "--controllers", "thesis,mine.yaml", "--no-figures", "--out", "o")
    assert ending.status == 0
    rows = json.loads(Path("o/summary.json").read_text(encoding="utf-8"))["table"]
    assert [row["contender"] for row in rows] == ["thesis", "mine"]
    assert rows[0]["payload rms"] == rows[1]["payload rms"]


def test_time_traces_come_on_request(run):
    words = (*CALM, *WHO, *SHORT, "--no-figures", "--out", "here")
    assert run(*words, "--traces").status == 0
    assert Path("here/traces.csv").read_text(encoding="utf-8").startswith("contender,time [s],")
    assert run(*words).status == 0
    assert not Path("here/traces.csv").exists()


def test_on_a_terminal_the_first_seed_of_each_is_told_as_it_comes(run, monkeypatch):
    from stillhook.commands.study import compare

    class Terminal:
        is_terminal = True

    real = compare.console
    monkeypatch.setattr(compare, "console", lambda stderr=False: Terminal if stderr else real())
    ending = run(*CALM, *WHO, *SHORT, "--no-figures", "--out", "here")
    none, forward = ending.err.splitlines()
    assert none.startswith("  H_s 0.5 m: none, ")
    assert forward.startswith("  H_s 0.5 m: feed-forward, ")
    assert forward.endswith(" of the hook's motion (first seed)")


def test_who_may_take_part_can_be_read(run):
    ending = run("compare", "thesis-1975", "--list")
    assert ending.status == 0
    for name, each in CONTENDERS.items():
        assert name in ending.out
        assert each.what.split(",")[0] in " ".join(ending.out.split())


def test_nobody_who_can_take_part_is_not_ok(run):
    ending = run("compare", "subsea-crane", *SHORT, "--controllers", "thesis", "--out", "here")
    assert ending.status == 1
    assert "the case subsea-crane has no gains in use" in ending.out


@pytest.mark.ci
def test_ctrl_c_keeps_what_is_there_and_the_same_command_goes_on(tmp_path):
    words = [sys.executable, "-m", "stillhook", *CALM, *WHO, "--no-figures", "--out", "here"]
    words += ["--seeds", "200", "--duration", "1 h", "--jobs", "2"]
    process = subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    store = tmp_path / "here" / STORE
    deadline = time.monotonic() + 60.0
    while not (store.exists() and store.read_bytes().count(b"\n") > 3):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.05)
    workers = children(process.pid)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "thesis-1975: 2 contenders" in out
    assert "stillhook: interrupted; " in err
    assert "kept in here; the same command goes on" in err
    lines = store.read_bytes().count(b"\n")
    runs = json.loads((tmp_path / "here/summary.json").read_text(encoding="utf-8"))["runs"]
    assert len(runs) == lines - 1
    assert workers
    assert not any(os.path.exists(f"/proc/{pid}") for pid in workers)


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
            found += [int(entry.name)] if parent == pid else []
    return found
