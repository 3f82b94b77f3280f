from __future__ import annotations

import sys
from pathlib import Path

import pytest

from models.basics import cache_folder


@pytest.mark.skipif(sys.platform != "linux", reason="the usual places of Linux")
def test_cache_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STILLHOOK_CACHE", "~/here")
    assert cache_folder() == Path.home() / "here"
    monkeypatch.delenv("STILLHOOK_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache_folder() == Path("/somewhere/stillhook")
    for value in ("", "relative"):  # the XDG specification: a relative path is ignored
        monkeypatch.setenv("XDG_CACHE_HOME", value)
        assert cache_folder() == Path.home() / ".cache" / "stillhook"
