"""The commit beside the version: from a checkout, a worktree, packed references, an installer."""

from __future__ import annotations

import json
from importlib import metadata
from types import SimpleNamespace

import pytest

from stillhook._version import commit

MADE = "38cccb82" + "0" * 32


@pytest.fixture
def checkout(tmp_path):
    git = tmp_path / ".git"
    (git / "refs/heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    return tmp_path


def test_of_a_branch(checkout):
    (checkout / ".git/refs/heads/main").write_text(f"{MADE}\n")
    assert commit(checkout) == "38cccb82"


def test_of_a_commit_alone(checkout):
    (checkout / ".git/HEAD").write_text(f"{MADE}\n")
    assert commit(checkout) == "38cccb82"


def test_of_a_branch_that_is_packed(checkout):
    other = "1" * 40
    packed = f"# pack-refs with: peeled\n{other} refs/remotes/heads/main\n{MADE} refs/heads/main\n"
    (checkout / ".git/packed-refs").write_text(packed)
    assert commit(checkout) == "38cccb82"


def test_of_a_worktree(checkout, tmp_path):
    (checkout / ".git/refs/heads/work").write_text(f"{MADE}\n")
    kept = checkout / ".git/worktrees/work"
    kept.mkdir(parents=True)
    (kept / "HEAD").write_text("ref: refs/heads/work\n")
    (kept / "commondir").write_text("../..\n")
    work = tmp_path / "work"
    work.mkdir()
    (work / ".git").write_text(f"gitdir: {kept}\n")
    assert commit(work) == "38cccb82"


@pytest.mark.parametrize("head", ["ref: refs/heads/none\n", "nonsense\n", "", "\xff"])
def test_none_of_what_is_no_checkout_as_we_know_it(checkout, head):
    (checkout / ".git/HEAD").write_text(head, encoding="latin-1")
    assert commit(checkout) is None


def test_of_what_was_installed_from_a_repository(tmp_path, monkeypatch):
    told = {"url": "https://example.org", "vcs_info": {"vcs": "git", "commit_id": MADE}}

    def installed(place, text):
        monkeypatch.setattr(
            metadata,
            "distribution",
            lambda name: SimpleNamespace(read_text=lambda file: text, locate_file=lambda p: place),
        )

    installed(tmp_path, json.dumps(told))
    assert commit(tmp_path) == "38cccb82"
    installed(tmp_path / "elsewhere", json.dumps(told))  # the code here is a copy
    assert commit(tmp_path) is None
    installed(tmp_path, json.dumps({"url": "file:///wheel", "archive_info": {}}))
    assert commit(tmp_path) is None
    installed(tmp_path, None)
    assert commit(tmp_path) is None
    installed(tmp_path, "no json")
    assert commit(tmp_path) is None


def test_none_where_nothing_is_installed(tmp_path, monkeypatch):
    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    assert commit(tmp_path) is None
