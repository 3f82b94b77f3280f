"""A damaged HDF5 file ends in a sentence, even where the HDF5 library would not end at all."""

from __future__ import annotations

import time

import h5py
import numpy as np
import pytest

from models.basics import InputError, check_hdf5, hdf5_check


@pytest.fixture
def path(tmp_path):
    place = tmp_path / "a.nc"
    with h5py.File(place, "w") as file:
        file.attrs["title"] = "a file"
        file.create_dataset("sea/efth", data=np.arange(2000.0).reshape(100, 20), compression=1)
        file.create_dataset("one", data=3.0)
        file.create_dataset("empty", data=h5py.Empty("f"))
    return place


def test_a_whole_file_passes(path):
    check_hdf5(path)


def test_other_files_and_none_are_left_to_others(tmp_path):
    (tmp_path / "text").write_text("CDF")
    check_hdf5(tmp_path / "text")
    check_hdf5(tmp_path / "none")


@pytest.mark.parametrize("share", [0.1, 0.6, 0.98])
def test_a_file_that_is_cut_off(path, share):
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])
    with pytest.raises(InputError, match=r"a\.nc: is a damaged HDF5 file \(OSError: .*truncated"):
        check_hdf5(path)


def test_damaged_data_are_found_too(path):
    raw = path.read_bytes()
    at = raw.index(b"\x78\x01")  # where a compressed chunk begins
    path.write_bytes(raw[: at + 4] + bytes(60) + raw[at + 64 :])
    with pytest.raises(InputError, match="is a damaged HDF5 file"):
        check_hdf5(path)


def test_a_loop_without_end_is_ended(path, monkeypatch):
    monkeypatch.setattr(hdf5_check, "_READ_THROUGH", "while True: pass")
    monkeypatch.setattr(hdf5_check, "_SECONDS", 1.0)
    begin = time.perf_counter()
    with pytest.raises(InputError, match=r"reading it does not end \(1 s\)"):
        check_hdf5(path)
    assert time.perf_counter() - begin < 8.0


def test_a_library_that_breaks_down(path, monkeypatch):
    monkeypatch.setattr(hdf5_check, "_READ_THROUGH", "import os; os.abort()")
    with pytest.raises(InputError, match="the HDF5 library broke down"):
        check_hdf5(path)
