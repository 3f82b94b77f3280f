"""A run written to files and read again, and what a full disk leaves behind."""

from __future__ import annotations

import json
import os

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pyarrow import parquet

from models import load_case
from models.basics import InputError, StillhookError, replace_atomically
from models.casefile import read_yaml
from models.run import (
    Accumulator,
    Event,
    Run,
    Timings,
    to_xarray,
    write_csv,
    write_netcdf,
    write_parquet,
)

SIGNALS = ("hook.heave", "payload.displacement", "drive.saturated")
UNITS = {"hook.heave": "m", "payload.displacement": "m"}
CASE = load_case("thesis-1975")


def run(values=None, **changes) -> Run:
    rng = np.random.default_rng(2)
    rows = rng.standard_normal((5000, 3)) if values is None else values
    gather = Accumulator(SIGNALS, 0.1, units=UNITS, lock_limit=100.0)
    gather.update(np.nan_to_num(rows, posinf=1.0, neginf=1.0))
    given = {
        "case": CASE,
        "controller": "linear",
        "scenario": "hold",
        "seed": 7,
        "sample_time": 0.1,
        "step": 0.01,
        "duration": 500.0,
        "compiled": True,
        "signals": SIGNALS,
        "units": UNITS,
        "time": 0.1 * np.arange(len(rows)),
        "values": rows,
        "statistics": gather.result(),
        "events": (Event(time=3.5, kind="telemetry", text="telemetry gone for 10 s"),),
        "status": "interrupted",
        "message": "stopped by Ctrl-C at 499.9 s: the écart is known",
        "timings": Timings.of(wall_seconds=1.0, steps=50_000, duration=500.0),
    }
    return Run(**(given | changes))


def read_csv(path):
    # pandas 2 reads quickly and loses a digit unless it is asked not to.
    frame = pd.read_csv(path, float_precision="round_trip")
    return frame.rename(columns=lambda head: head.partition(" [")[0])


def read_netcdf(path):
    return xr.load_dataset(path, engine="scipy")


WRITERS = {
    "csv": (write_csv, read_csv),
    "parquet": (write_parquet, pd.read_parquet),
    "nc": (write_netcdf, read_netcdf),
}


def test_xarray_has_signals_units_and_where_they_came_from():
    r = run()
    data = to_xarray(r)
    assert list(data.data_vars) == list(SIGNALS)
    assert dict(data.sizes) == {"time": 5000}
    assert data["time"].attrs["units"] == "s"
    for name in SIGNALS:
        np.testing.assert_array_equal(data[name], r[name])
        assert data[name].attrs["units"] == r.units[name]
    assert load_case_text(data.attrs["case"]) == CASE
    assert (data.attrs["seed"], data.attrs["controller"]) == (7, "linear")
    assert data.attrs["status"] == "interrupted"
    assert json.loads(data.attrs["events"]) == [[3.5, "telemetry", "telemetry gone for 10 s"]]
    said = json.loads(data.attrs["statistics"])
    assert said["payload rms"] == r.statistics.value("payload rms")
    assert said["lost lock at"] is None
    assert {"stillhook", "numpy", "casadi"} <= set(json.loads(data.attrs["versions"]))


def load_case_text(text: str):
    data, _ = read_yaml(text, "attributes")
    return type(CASE).from_dict(data)


@pytest.mark.parametrize("kind", WRITERS)
def test_what_is_written_reads_back_the_same(kind, tmp_path):
    write, read = WRITERS[kind]
    r = run()
    path = write(r, tmp_path / f"run.{kind}")
    assert [item.name for item in tmp_path.iterdir()] == [f"run.{kind}"]
    back = read(path)
    assert list(back) == (["time"] if kind != "nc" else []) + list(SIGNALS)
    for name in ("time", *SIGNALS):
        np.testing.assert_array_equal(back[name], to_xarray(r)[name])


def test_units_and_where_a_run_came_from_stand_in_its_files(tmp_path):
    r = run()
    data = to_xarray(r)
    back = read_netcdf(write_netcdf(r, tmp_path / "run.nc"))
    assert back.equals(data)
    schema = parquet.read_schema(write_parquet(r, tmp_path / "run.parquet"))
    for name in ("time", *SIGNALS):
        assert back[name].attrs == data[name].attrs
        assert schema.field(name).metadata[b"units"].decode() == data[name].attrs["units"]
    assert back.attrs == json.loads(schema.metadata[b"stillhook"]) == data.attrs


@settings(max_examples=25)
@given(
    values=hnp.arrays(np.float64, st.tuples(st.integers(1, 5), st.just(3)), elements=st.floats()),
    kind=st.sampled_from(sorted(WRITERS)),
)
def test_no_number_loses_a_digit(values, kind, tmp_path_factory):
    write, read = WRITERS[kind]
    path = write(run(values), tmp_path_factory.mktemp("run") / f"run.{kind}")
    back = np.column_stack([read(path)[name] for name in SIGNALS])
    np.testing.assert_array_equal(back, values)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_run_that_stopped_at_once_is_a_file_too(kind, tmp_path):
    write, read = WRITERS[kind]
    back = read(write(run(np.zeros((0, 3))), tmp_path / f"run.{kind}"))
    assert len(back["time"]) == 0
    assert set(SIGNALS) <= set(back)


def test_a_csv_has_names_and_units_at_its_head(tmp_path):
    r = run()
    frame = pd.read_csv(write_csv(r, tmp_path / "run.csv"), float_precision="round_trip")
    assert list(frame.columns) == [
        "time [s]",
        "hook.heave [m]",
        "payload.displacement [m]",
        "drive.saturated",
    ]
    np.testing.assert_allclose(frame["hook.heave [m]"], r["hook.heave"], rtol=1e-15)


def test_a_long_seed_survives_netcdf(tmp_path):
    back = read_netcdf(write_netcdf(run(seed=2**63), tmp_path / "run.nc"))
    assert int(back.attrs["seed"]) == 2**63


class FullDisk:
    """A stand-in for a disk that is full after some bytes."""

    def __call__(self, *_, **__):
        raise OSError(28, "No space left on device")


# Where each writer's bytes go through, so that the disk is full half-way.
def half_full(kind, monkeypatch):
    import pyarrow.parquet
    import scipy.io

    if kind == "csv":
        from models.run import files as run_files

        lines = run_files._csv_lines

        def some(r):
            for number, line in enumerate(lines(r)):
                if number == 4500:
                    FullDisk()()
                yield line

        monkeypatch.setattr(run_files, "_csv_lines", some)
    elif kind == "parquet":

        def write(table, place):
            place.write_bytes(b"PAR1 and then")
            FullDisk()()

        monkeypatch.setattr(pyarrow.parquet, "write_table", write)
    else:

        def full(self):
            self.fp.write(b"CDF")
            FullDisk()()

        monkeypatch.setattr(scipy.io.netcdf_file, "_write_numrecs", full, raising=True)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("before", [None, b"the old one"])
def test_a_full_disk_is_told_and_leaves_the_old_file(kind, before, tmp_path, monkeypatch):
    path = tmp_path / f"run.{kind}"
    if before is not None:
        path.write_bytes(before)
    r = run()
    half_full(kind, monkeypatch)
    with pytest.raises(StillhookError) as caught:
        WRITERS[kind][0](r, path)
    assert str(caught.value) == f"{path}: cannot be written: No space left on device"
    assert [p.read_bytes() for p in tmp_path.iterdir()] == ([] if before is None else [before])


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device of Linux")
@pytest.mark.parametrize("kind", WRITERS)
def test_a_disk_that_really_is_full_is_told(kind, tmp_path, monkeypatch):
    from pathlib import Path

    # The temporary file is a door to the device that is always full.
    named = Path.with_name

    def to_full(self, name):
        door = named(self, name)
        if name.endswith(".tmp"):
            door.symlink_to("/dev/full")
        return door

    monkeypatch.setattr(Path, "with_name", to_full)
    with pytest.raises(StillhookError, match=r"run\.\w+: cannot be written: No space left"):
        WRITERS[kind][0](run(), tmp_path / f"run.{kind}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", WRITERS)
def test_a_missing_folder_is_told(kind, tmp_path):
    with pytest.raises(InputError, match=rf"none/run\.{kind}: cannot be written: No such file"):
        WRITERS[kind][0](run(), tmp_path / "none" / f"run.{kind}")


def test_any_error_while_writing_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")

    def write(place):
        place.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replace_atomically(path, write)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["file"]
