"""The command line in a scratch folder, for the tests of all commands."""

from __future__ import annotations

import pytest
from endings import Ending

from stillhook import cli


@pytest.fixture(autouse=True)
def no_designs(tmp_path, monkeypatch):
    """Keep the designs that are found apart from those of other tests, and of whoever runs them."""
    monkeypatch.setattr("stillhook.designs.kept_design.cache_folder", lambda: tmp_path / ".cache")


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run the command line in a scratch folder, in this process."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> Ending:
        try:
            status = cli.main(words)
        except SystemExit as stop:
            status = int(stop.code or 0)
        seen = capsys.readouterr()
        return Ending(status=status, out=seen.out, err=seen.err)

    return call
