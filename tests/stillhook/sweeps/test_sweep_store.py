"""Sweeps on disk: gone on with after a SIGKILL, and refused where anybody could doubt them."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
import zlib
from pathlib import Path

import numpy as np
import pytest
import sweep_pilots

import stillhook as sh
from models.basics import InputError
from models.spread import Uniform
from stillhook.keeper import Journal, question_in
from stillhook.sweeps import resume_sweep, sweep
from stillhook.sweeps import store as stores
from stillhook.sweeps.export import write_result
from stillhook.sweeps.store import JOURNAL, RESULT
from stillhook.sweeps.time_cases import TimeQuestion

CASE = sh.load_case("thesis-1975").replace({"sea.significant_height": 0.3})
SPREAD = {"payload.mass": Uniform("20 %"), "payload.drag_coefficient": Uniform("50 %")}
HOW = {"case": CASE, "samples": 20, "mode": "time", "duration": 10.0, "seed": 2, "engine": "serial"}


def same(one, other):
    assert set(one.variables) == set(other.variables)
    return [
        name
        for name in one.variables
        if not np.array_equal(one[name], other[name], equal_nan=one[name].dtype.kind == "f")
    ]


def stopping(after):
    def stop(what, done, total):
        if done >= after:
            raise KeyboardInterrupt

    return stop


@pytest.fixture(scope="module")
def whole():
    return sweep("feedback", SPREAD, **HOW)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A store with 18 of 20 cases."""
    folder = tmp_path_factory.mktemp("sweep") / "s"
    found = sweep("feedback", SPREAD, store=folder, progress=stopping(18), **HOW)
    assert found.attrs["complete"] == 0
    return folder


@pytest.fixture
def half(stopped, tmp_path):
    return Path(shutil.copytree(stopped, tmp_path / "s"))


def test_a_store_goes_on_where_it_was(half, whole):
    counted = []
    found = resume_sweep(half, engine="serial", progress=lambda w, done, n: counted.append(done))
    assert counted[0] == 18
    assert same(found, whole) == []
    again = sweep("feedback", SPREAD, store=half, progress=stopping(21), **HOW)  # nothing to do
    assert same(again, whole) == []


def test_another_engine_may_go_on(half, whole):
    assert same(resume_sweep(half, engine="processes", jobs=2), whole) == []


def test_any_tool_opens_it(half, whole):
    import xarray as xr

    resume_sweep(half, engine="serial")
    with xr.open_dataset(half / RESULT) as there:
        assert same(there.load(), whole) == []
        assert there["payload_rms"].attrs["units"] == "m"
        header = json.loads(there.attrs[stores.ATTRIBUTE])
    assert header["case"] == CASE.to_dict()
    assert header["controller"] == {"name": "feedback", "kind": "name", "identity": "feedback"}
    assert header["versions"]["stillhook"] == sh.__version__
    assert header["seed"] == 2
    assert header["spread"]["vary"]["payload.drag_coefficient"] == {
        "uniform": {"low": 0.525, "high": 1.5750000000000002}
    }


@pytest.mark.parametrize("rest", [b"{", b'{"crc": 12345, "of": {"ke'])
def test_half_a_line_at_the_end_of_the_journal_is_no_harm(half, whole, rest):
    with (half / JOURNAL).open("ab") as file:
        file.write(rest)
    assert same(resume_sweep(half, engine="serial"), whole) == []


def test_a_case_whose_line_was_cut_short_is_computed_again(half, whole):
    data = (half / JOURNAL).read_bytes()
    (half / JOURNAL).write_bytes(data[:-7])
    counted = []
    found = resume_sweep(half, engine="serial", progress=lambda w, done, n: counted.append(done))
    assert counted[0] == 17
    assert same(found, whole) == []


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda s: (s / JOURNAL).write_bytes(b"what is this\n"),
            "is not a sweep that this version",
        ),
        (lambda s: swap(s / JOURNAL, b'"key": 0', b'"key": 1'), "line 2 is not as it was written"),
        (lambda s: swap(s / JOURNAL, b'"seed": 2', b'"seed": 3'), "line 1 is not as it was"),
        (lambda s: swap(s / JOURNAL, b'"crc": ', b'"crc": 1'), "line 1 is not as it was"),
        (lambda s: append(s / JOURNAL, b"half a thought"), "line 20 is not as it was written"),
        (lambda s: append(s / JOURNAL, line({"key": 99, "values": {}})), "there is no case 99"),
        (lambda s: append(s / JOURNAL, line({"key": 3, "values": {}})), "line 20 is no result"),
        (lambda s: (s / JOURNAL).write_bytes(nested(3000)), "line 1 is not as it was written"),
        (lambda s: append(s / JOURNAL, nested(3000)), "line 20 is not as it was written"),
        (  # as older versions began a journal
            lambda s: (s / JOURNAL).write_bytes(line({"sweep": "0123456789abcdef"})),
            "is not a sweep that this version of Stillhook has written; remove it, or take",
        ),
    ],
)
def test_a_spoilt_journal_is_refused(half, spoil, message):
    spoil(half)
    with pytest.raises(InputError, match=message):
        resume_sweep(half, engine="serial")


def swap(path, old, new):
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new, 1))


def append(path, data):
    with path.open("ab") as file:
        file.write(data)


def nested(depth):
    return checked(b'{"key": ' + b"[" * depth + b"]" * depth + b"}")


def line(content):
    return checked(json.dumps(content).encode())


def checked(text):
    return b'{"crc": %d, "of": %b}\n' % (zlib.crc32(text), text)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("seed", 98.5, "its question is spoilt"),
        ("seed", -1, "seed must be at least 0"),
        ("samples", "many", "its question is spoilt"),
        ("samples", 10**12, "samples must be in"),
        ("metrics", [""], "there is no metric ''"),
        ("duration", None, "its question is spoilt"),
        ("options", 3, "its question is spoilt"),
    ],
)
def test_a_question_of_other_kinds_of_values_is_refused(half, field, value, message):
    first, *rest = (half / JOURNAL).read_bytes().splitlines(keepends=True)
    content = json.loads(first)["of"]
    content["question"][field] = value
    (half / JOURNAL).write_bytes(line(content) + b"".join(rest))
    with pytest.raises(InputError, match=message):
        resume_sweep(half, engine="serial")


def test_numbers_come_back_to_the_bit(tmp_path):
    values = {"a": 0.1 + 0.2, "b": math.nan, "c": -math.inf, "d": 5e-324, "e": None, "f": "x"}
    with Journal(tmp_path / "j", "study", {"n": math.inf}, lambda key, found: None) as journal:
        journal.add(["run", 3], values)
    kept = []
    Journal(tmp_path / "j", "study", {"n": math.inf}, lambda *line: kept.append(line)).close()
    ((key, found),) = kept
    assert key == ["run", 3]
    assert math.isnan(found.pop("b"))
    assert found == {name: value for name, value in values.items() if name != "b"}
    assert question_in(tmp_path / "j", "study") == {"n": math.inf}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 3}, "seed is 2, not 3"),
        ({"samples": 21}, "samples is 20, not 21"),
        ({"duration": 11.0}, "duration is 10.0, not 11.0"),
        ({"case": CASE.replace({"rope.length": 1900.0})}, "case.rope.length is 2000.0, not 1900.0"),
        ({"metrics": ["payload_rms"]}, "metrics is"),
        ({"masses": 2}, "masses is not given, not 2"),
    ],
)
def test_a_store_that_answers_another_question_is_refused(half, change, message):
    with pytest.raises(InputError, match=f"holds another sweep: .*{message}.*take another folder"):
        sweep("feedback", SPREAD, store=half, **{**HOW, **change})


def test_a_store_of_other_code_is_refused(half, monkeypatch):
    own = stores.versions(TimeQuestion)
    for name, what in (("code", "Stillhook's own code"), ("scipy", "scipy")):
        monkeypatch.setattr(stores, "versions", lambda entry, n=name: {**own, n: "0123456789"})
        with pytest.raises(InputError, match=f"another version of {what}"):
            resume_sweep(half)
    monkeypatch.setattr(stores, "versions", lambda entry: {**own, "python": "3.99"})
    resume_sweep(half, engine="serial")


def test_what_is_no_store_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no sweep to go on with"):
        resume_sweep(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / JOURNAL).write_text("mine")
    with pytest.raises(InputError, match="is not a sweep that this version of Stillhook has"):
        resume_sweep(tmp_path / "a")
    with pytest.raises(InputError, match="is not a sweep that this version of Stillhook has"):
        sweep("feedback", SPREAD, store=tmp_path / "a", **HOW)
    assert (tmp_path / "a" / JOURNAL).read_text() == "mine"
    os.mkfifo(tmp_path / "pipe.jsonl")
    with pytest.raises(InputError, match="is a device or a pipe; a file is wanted"):
        resume_sweep(tmp_path / "pipe.nc")
    with pytest.raises(InputError, match="is a device or a pipe; a file is wanted"):
        sweep("feedback", SPREAD, store=tmp_path / "pipe.nc", **HOW)
    (tmp_path / "c").write_text("a file")
    with pytest.raises(InputError, match="a file is there"):
        sweep("feedback", SPREAD, store=tmp_path / "c", **HOW)


def test_two_drivers_of_one_store_are_kept_apart(half):
    asked = question_in(half / JOURNAL, "sweep")
    with (
        Journal(half / JOURNAL, "sweep", asked, lambda key, values: None),
        pytest.raises(InputError, match="another process writes this sweep"),
    ):
        resume_sweep(half)


def test_a_controller_in_python_is_gone_on_with_by_the_same_call(tmp_path):
    who = ("linear", sweep_pilots.linear)
    sweep(who, SPREAD, store=tmp_path / "s", progress=stopping(3), **HOW)
    with pytest.raises(InputError, match="was given as Python code, which is not kept: go on with"):
        resume_sweep(tmp_path / "s")
    counted = []
    sweep(who, SPREAD, store=tmp_path / "s", progress=lambda w, d, n: counted.append(d), **HOW)
    assert counted[0] == 3
    with pytest.raises(InputError, match=r"controller\.identity"):
        sweep(("linear", sweep_pilots.told), SPREAD, store=tmp_path / "s", **HOW)


@pytest.mark.ci
def test_a_design_is_gone_on_with_from_the_store_alone(tmp_path):
    gains = {name: getattr(CASE.gains, name) for name in ("A", "a", "a1", "a2")}
    design = sh.evaluate_gains(CASE, {**gains, "a2": 90.0})
    how = {**HOW, "case": None}
    there = sweep(design, SPREAD, **how)
    sweep(design, SPREAD, store=tmp_path / "s", progress=stopping(5), **how)
    assert same(resume_sweep(tmp_path / "s", engine="serial"), there) == []


@pytest.mark.ci
def test_a_file_has_its_journal_beside_it(tmp_path, whole):
    import xarray as xr

    path = tmp_path / "s.nc"
    sweep("feedback", SPREAD, store=path, progress=stopping(7), **HOW)
    counted = []
    found = sweep("feedback", SPREAD, store=path, progress=lambda w, d, n: counted.append(d), **HOW)
    assert counted[0] == 7
    assert same(found, whole) == []
    assert {each.name for each in tmp_path.iterdir()} == {"s.nc", "s.jsonl"}
    with xr.open_dataset(path) as there:
        assert same(there.load(), whole) == []
    with pytest.raises(InputError, match="seed is 2, not 4"):
        sweep("feedback", SPREAD, store=path, **{**HOW, "seed": 4})
    assert same(resume_sweep(path, engine="serial"), whole) == []
    (tmp_path / "s.jsonl").unlink()  # as older versions left it
    with pytest.raises(InputError, match=r"s.nc: is there, but not its journal s.jsonl"):
        sweep("feedback", SPREAD, store=path, **HOW)


@pytest.mark.parametrize("ending", ["csv", "parquet", "nc", "zarr"])
def test_a_result_is_written_for_other_tools(ending, whole, tmp_path):
    import pandas as pd
    import xarray as xr

    path = write_result(whole, tmp_path / f"r.{ending}")
    write_result(whole, path)  # over the old one
    if ending in ("csv", "parquet"):
        table = (
            pd.read_csv(path, float_precision="round_trip")
            if ending == "csv"
            else pd.read_parquet(path)
        )
        assert list(table.columns[:5]) == [
            "case",
            "seed",
            "payload.mass",
            "payload.drag_coefficient",
            "status",
        ]
        assert np.array_equal(table["payload_rms"], whole["payload_rms"])
        return
    opened = xr.open_zarr(path, consolidated=False) if ending == "zarr" else xr.open_dataset(path)
    with opened as there:
        assert same(there.load(), whole) == []
        assert there["payload.mass"].attrs["units"] == "kg"


def test_a_result_of_another_kind_is_refused(whole, tmp_path):
    with pytest.raises(InputError, match=r"\.xlsx"):
        write_result(whole, tmp_path / "r.xlsx")
    with pytest.raises(InputError, match="there is no folder"):
        write_result(whole, tmp_path / "none" / "r.csv")


def command(folder, *words):
    changes = ["--set", "sea.significant_height=0.3"]
    ranges = ["--vary", "payload.mass=20 %", "--vary", "payload.drag_coefficient=50 %"]
    how = ["--mode", "time", "--duration", "10 s", "--seed", "2", "--no-figures", "--quiet"]
    case = ["thesis-1975", *changes, *ranges, *how, "--controller", "feedback"]
    return [sys.executable, "-m", "stillhook", "sweep", *case, "--out", str(folder), *words]


@pytest.mark.slow  # two interpreters, one of them killed
def test_a_driver_that_is_killed_goes_on_to_the_identical_result(tmp_path):
    how = {**HOW, "samples": 100}
    wanted = sweep("feedback", SPREAD, **how)
    folder = tmp_path / "s"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    driver = subprocess.Popen(command(folder, "--samples", "100", "--jobs", "2"), env=environment)
    try:
        until = time.monotonic() + 120.0
        while not sweep_pilots.writes(folder / JOURNAL) and time.monotonic() < until:
            assert driver.poll() is None
            time.sleep(0.005)
    finally:
        driver.send_signal(signal.SIGKILL)
        driver.wait()
    assert 0 < (folder / JOURNAL).read_text().count('"key"') < 100
    counted = []
    found = resume_sweep(folder, jobs=2, progress=lambda w, done, n: counted.append(done))
    assert 0 < counted[0] < 100
    assert same(found, wanted) == []
    assert found.attrs["complete"] == 1


def test_the_command_resumes_what_the_command_left(tmp_path):
    from stillhook.cli import main

    folder = tmp_path / "s"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        first = command(folder, "--samples", "6", "--jobs", "1")
        assert main(first[3:]) == 0
        before = {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
        assert main(["sweep", "--resume", str(folder), "--quiet", "--no-figures"]) == 0
    after = {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
    assert set(before) == set(after)
    assert {"worst.yaml", "cases.csv", "cases.parquet", "summary.json", "spread.yaml"} <= set(after)
    for name in ("worst.yaml", "cases.csv", "spread.yaml", JOURNAL):
        assert before[name] == after[name], name
    assert sh.load_case(folder / "worst.yaml").name.startswith("thesis-1975 (")


def test_a_full_disk_is_told(tmp_path, monkeypatch):
    from stillhook.keeper import journal

    def full(*names):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(journal.os, "fsync", full)
    with pytest.raises(InputError, match=r"journal.jsonl: cannot be written: No space left"):
        sweep("feedback", SPREAD, store=tmp_path / "s", **HOW)


def test_zarr_is_an_extra(tmp_path, whole, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(InputError, match=r"needs zarr: run `make zarr`"):
        write_result(whole, tmp_path / "r.zarr")
