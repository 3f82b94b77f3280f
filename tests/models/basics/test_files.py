from __future__ import annotations

import gzip
import os
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from models.basics import (
    InputError,
    cache_folder,
    read_bytes,
    read_text,
    replace_atomically,
    write_text_atomically,
)


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


def test_what_has_no_size_is_not_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for place in ("/dev/zero", "/dev/full", pipe):
        with pytest.raises(InputError, match=r": is a device or a pipe; a file is wanted$"):
            read_bytes(place)
        with pytest.raises(InputError, match="cannot be written: is a device or a pipe"):
            write_text_atomically(place, "text")
    assert pipe.is_fifo()
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        read_bytes(tmp_path / ("a" * 300))


def test_a_file_is_read_up_to_a_size(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"x" * 2_000)
    assert len(read_bytes(path, 2_000)) == 2_000
    with pytest.raises(InputError, match=r"must be at most 0\.001 MB, got 0\.002 MB"):
        read_text(path, 1_000)
    path.write_bytes(gzip.compress(b"x" * 2_000))
    with pytest.raises(InputError, match=r"must be at most 0\.001 MB when unpacked"):
        read_text(path, 1_000)


#: Two facets, and a header that begins as a text file in the same format does.
STL = b"solid hull".ljust(80) + (2).to_bytes(4, "little") + bytes(100)


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (b"PK\x03\x04\x14\x00xl/workbook.xml\x00", "an Excel workbook (.xlsx): save the sheet as"),
        (b"PK\x03\x04\x14\x00word/document.xml\x00", "a Word document"),
        (b"PK\x03\x04\x14\x00a.txt", "an archive (.zip)"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Office file"),
        (b"\x89PNG\r\n\x1a\n", "a picture (PNG)"),
        (b"\xff\xd8\xff\xe0\x00\x10JFIF", "a picture (JPEG)"),
        (b"%PDF-1.7\n", "a PDF document"),
        ("a: 1\n".encode("utf-16"), "a text in UTF-16: save it as UTF-8"),
        (b"\x89HDF\r\n\x1a\n", "an HDF5 or NetCDF file"),
        (b"MATLAB 5.0 MAT-file", "a MATLAB file"),
        (STL, "a binary STL file: meshes of hulls go to `stillhook vessel hull --mesh`"),
    ],
)
def test_a_binary_is_named_for_what_it_is(content: bytes, name: str, tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(f"case.yaml: is no text file, but {name}")):
        read_text(path)


def test_two_may_write_one_file_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    together = threading.Barrier(2)

    def write(text: str) -> Path:
        def fill(place: Path) -> None:
            place.write_text(text)
            together.wait(10.0)  # both have written before either renames

        return replace_atomically(path, fill)

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(write, ["one", "two"])) == [path, path]
    assert path.read_text() in {"one", "two"}
    assert [item.name for item in tmp_path.iterdir()] == ["a.txt"]
