"""`stillhook export`: from a design or a case to folders, and what is said of them."""

from __future__ import annotations

import json
import shlex

import pytest
from laws_in_c import needs_compiler

import stillhook as sh
from models import InputError


@needs_compiler
def test_a_design_is_exported_and_what_was_checked_is_said(run, tmp_path):
    design = sh.evaluate_gains(sh.load_case("thesis-1975-rope"), structure="payload-feedback",
                               gains={"A": 1, "a": 30, "a1": 200, "a2": 60})  # fmt: skip
    sh.save_design(design, tmp_path / "mine.yaml")
    ending = run("export", "mine.yaml", "--to", "c,st", "--name", "Hold It")
    assert ending.status == 0
    place = tmp_path / "out" / "thesis-1975-rope-export"
    assert (place / "c" / "hold_it.h").exists()
    assert (place / "st" / "hold_it.st").exists()
    assert "exported, each compared with the simulation" in ending.out
    assert "No export is a safety function" in ending.out
    assert "margins as sampled every 5.00 ms" in ending.out
    assert "Written to out/thesis-1975-rope-export: c, st" in ending.out
    assert "make -C out/thesis-1975-rope-export/c check" in ending.out


@needs_compiler
def test_a_case_is_exported_with_a_controller(run, tmp_path):
    ending = run("export", "subsea-crane", "--controller", "feed-forward", "--sample-time", "10 ms",
                 "--set", "sea.significant_height=1", "--out", "there", "--json")  # fmt: skip
    told = json.loads(ending.out)
    assert told["ok"] is True
    assert len(told["written"]) == 7
    assert (tmp_path / "there" / "c" / "feed_forward.c").exists()
    assert "10.0 ms" in (tmp_path / "there" / "c" / "README.md").read_text()


def test_without_a_compiler_it_is_not_ok(run, monkeypatch):
    monkeypatch.setenv("STILLHOOK_COMPILE", "0")
    ending = run("export", "subsea-crane", "--controller", "constant-tension", "--quiet")
    assert ending.status == 1
    assert "not everything could be compared with the simulation" in ending.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("subsea-crane --to exe", "there is no 'exe'"),
        ("nowhere.yaml", "nowhere.yaml"),
        ("subsea-crane --controller mpc-ar", "can be stepped from Python alone"),
        ("subsea-crane --controller feed-forward --sample-time 20", "sample-time"),
        ("subsea-crane --controller feed-forward --ramp -1", "ramp"),
        ("mine.yaml --set sea.significant_height=1", "--set is for a case; mine.yaml is a design"),
        ("mine.yaml --controller mpc", "--controller is for a case"),
    ],
)
def test_what_is_wrong_is_one_sentence(run, tmp_path, words, message):
    (tmp_path / "mine.yaml").write_text("# mine\nstillhook_design: 2\n")
    ending = run("export", *shlex.split(words))
    assert ending.status == 2
    assert message in ending.err
    assert len(ending.err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_design_without_a_controller_is_told(tmp_path):
    case = sh.load_case("thesis-1975")
    design = sh.evaluate_gains(case, case.gains)
    from dataclasses import replace

    with pytest.raises(InputError, match="the design has no controller"):
        sh.export(replace(design, parameters={}), tmp_path)
