"""The best design of a case: searched for once, kept in the cache folder."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest
from designs import thesis_design

from models import load_case
from stillhook.cli import main
from stillhook.designs import best_design, kept_design, load_design

CASE = thesis_design().case


@pytest.fixture
def searches(tmp_path, monkeypatch):
    """Return the cases that were searched for; designs are kept in the scratch folder."""
    asked = []

    def found(case, structure, **rest):
        asked.append(case)
        return replace(thesis_design(), case=case)

    monkeypatch.setattr("synth.optimise_gains", found)
    monkeypatch.setattr(kept_design, "cache_folder", lambda: tmp_path)
    return asked


def test_a_design_is_found_once_and_is_the_same_again(searches, tmp_path):
    first, again = best_design(CASE), best_design(CASE)
    assert len(searches) == 1
    assert again.case is CASE
    assert again.parameters == first.parameters
    assert again.payload_rms == first.payload_rms
    assert len(list((tmp_path / "designs").iterdir())) == 1


def test_a_file_that_is_not_whole_is_found_anew(searches, tmp_path):
    best_design(CASE)
    (place,) = (tmp_path / "designs").iterdir()
    whole = place.read_bytes()
    place.write_bytes(whole[: len(whole) // 2])
    best_design(CASE)
    assert len(searches) == 2
    assert place.read_bytes() == whole


def test_other_code_finds_anew(searches, monkeypatch):
    best_design(CASE)
    monkeypatch.setattr(kept_design, "versions", lambda entry: {"code": "other"})
    best_design(CASE)
    assert len(searches) == 2


def test_designs_long_unused_are_removed(searches, tmp_path, monkeypatch):
    monkeypatch.setattr(kept_design, "KEPT", 2)
    cases = [CASE.replace({"sea.significant_height": h}) for h in (1.0, 2.0, 3.0)]
    for age, case in zip((300, 200), cases, strict=False):
        before = set((tmp_path / "designs").glob("*"))
        best_design(case)
        (new,) = set((tmp_path / "designs").glob("*")) - before
        os.utime(new, (new.stat().st_mtime - age,) * 2)
    best_design(cases[0])  # used again: now the second is the oldest
    best_design(cases[2])
    best_design(cases[0])
    assert len(searches) == 3
    best_design(cases[1])
    assert len(searches) == 4


def test_a_cache_that_cannot_be_written_only_costs_time(searches, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setattr(kept_design, "cache_folder", lambda: tmp_path / "file")
    assert best_design(CASE).ok == thesis_design().ok
    assert best_design(CASE).case is CASE
    assert len(searches) == 2


def test_what_optimise_found_is_not_searched_for_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STILLHOOK_CACHE", str(tmp_path / "cache"))
    line = [
        "optimise",
        "thesis-1975",
        "--structure",
        "payload-feedback",
        "--no-figures",
        "--no-bound",
    ]
    main([*line, "--out", str(tmp_path / "out")])
    written = load_design(tmp_path / "out" / "design.yaml")

    def nothing(*_, **__):
        raise AssertionError("searched again")

    monkeypatch.setattr("synth.optimise_gains", nothing)
    again = best_design(load_case("thesis-1975"), "payload-feedback")
    assert again.parameters == written.parameters
