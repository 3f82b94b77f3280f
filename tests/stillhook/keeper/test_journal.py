"""Journals that others have a hand in: removed, written by two, or full of anything."""

from __future__ import annotations

import itertools
import json
import shutil
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from touched_files import touched

from models.basics import InputError
from stillhook.keeper import Journal, journal, question_in

QUESTION = {
    "case": {"name": "a", "depth": 3.0},
    "seed": 2,
    "versions": {"code": "1", "python": "3"},
}
HEAD = {"stillhook": "sweep", "format": journal.FORMAT, "question": QUESTION}
ROW = {"key": 0, "values": {"a": 0.5, "b": "float:nan", "c": None}}
ANY = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def checked(content: object) -> bytes:
    text = json.dumps(content, default=str).encode()
    return b'{"crc": %d, "of": %b}\n' % (zlib.crc32(text), text)


def taken(path: Path) -> list[tuple[Any, Any]] | None:
    """Return what a journal holds, or None where it is refused with its name."""
    found: list[tuple[Any, Any]] = []
    said = ""
    try:
        Journal(path, "sweep", QUESTION, lambda key, values: found.append((key, values))).close()
    except InputError as error:
        said = str(error)
    assert not said or str(path) in said
    return None if said else found


@ANY
@given(head=touched(HEAD), row=touched(ROW))
def test_a_journal_of_any_content_is_read_or_refused(head: Any, row: Any, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(checked(head) + checked(ROW))
    taken(path)
    said = ""
    try:
        assert isinstance(question_in(path, "sweep"), dict)
    except InputError as error:
        said = str(error)
    assert not said or str(path) in said
    path.write_bytes(checked(HEAD) + checked(row) + checked(ROW))
    taken(path)


@ANY
@given(noise=st.binary(max_size=200), at=st.integers(0, 400))
def test_a_journal_of_any_bytes_is_read_or_refused(noise: bytes, at: int, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    whole = checked(HEAD) + checked(ROW)
    path.write_bytes(whole[:at] + noise + whole[at:])
    taken(path)
    path.write_bytes(noise)
    taken(path)


def test_a_question_that_is_no_section_is_spoilt(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    path.write_bytes(checked({**HEAD, "question": None}))
    with pytest.raises(InputError, match=r"journal\.jsonl: line 1 is not as it was written"):
        question_in(path, "sweep")
    assert taken(path) is None


@pytest.mark.parametrize("again", [False, True])
def test_a_folder_that_is_removed_in_mid_run_is_told(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal, "_SYNC", -1.0)  # look at every line
    folder = tmp_path / "out"
    folder.mkdir()
    kept = Journal(folder / "journal.jsonl", "sweep", QUESTION, lambda *_: None)
    kept.add(0, {"a": 1.0})
    shutil.rmtree(folder)
    if again:  # another run has begun in the same place
        folder.mkdir()
        (folder / "journal.jsonl").write_bytes(checked(HEAD))
    with pytest.raises(InputError, match=r"journal\.jsonl: was removed while it was written"):
        kept.add(1, {"a": 2.0})
    with pytest.raises(InputError, match="was removed while it was written"):
        kept.close()
    if again:
        assert (folder / "journal.jsonl").read_bytes() == checked(HEAD)


def test_two_writers_are_kept_apart(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path, "sweep", QUESTION, lambda *_: None) as first:
        first.add(0, {"a": 1.0})
        with pytest.raises(InputError, match="another process writes this sweep"):
            Journal(path, "sweep", QUESTION, lambda *_: None)
    assert taken(path) == [(0, {"a": 1.0})]


def test_a_clock_that_jumps_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = itertools.cycle([1e9, -1e9, 0.0, 2e9, 1.0])
    for name in ("time", "monotonic"):  # even that of the system, after a sleep
        monkeypatch.setattr(journal.clock, name, lambda: next(times))
    path = tmp_path / "journal.jsonl"
    with Journal(path, "sweep", QUESTION, lambda *_: None) as kept:
        kept.add(0, {"a": 1.0})
        kept.add(1, {"a": 2.0})
    assert taken(path) == [(0, {"a": 1.0}), (1, {"a": 2.0})]
