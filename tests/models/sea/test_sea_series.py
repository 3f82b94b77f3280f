"""Seas as time series: files of buoys and hindcasts, their account, directions, steps, bins."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from models import InputError
from models.sea import (
    SeaRecords,
    SeaSeries,
    holds_series,
    read_scatter,
    read_seas,
    read_series,
    relative_heading,
)

DATA = Path(__file__).parents[4] / "shared" / "data"
REAL = pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not here")

STDMET = """\
#YY  MM DD hh mm WDIR WSPD GST  WVHT   DPD   APD MWD   PRES
#yr  mo dy hr mn degT m/s  m/s     m   sec   sec degT   hPa
2019 04 02 02 00 120  2.0   MM   1.5    12    MM  180 1007.7
2019 04 02 01 50 120  2.0   MM    MM    MM    MM   MM 1007.7
2019 04 02 01 00 120  2.0   MM   1.2    11    MM   MM 1007.7
2019 04 02 00 00 120  2.0   MM   1.0    10    MM   90 1007.7
"""
OLD = """\
YY MM DD hh WD   WSPD GST  WVHT  DPD   APD  MWD  BAR
96 01 01 00 120  2.0  3.0  1.00 10.00  6.0   90 1010.0
96 01 01 01 120  2.0  3.0 99.00 99.00  6.0  999 1010.0
96 01 01 02 120  2.0  3.0  2.00 11.00  6.0  999 1010.0
96 01 01 03 120  2.0  3.0  2.00
"""
CSV = """\
time_index,significant_wave_height_0,peak_period_0,mean_wave_direction_0
1995-01-01 01:00:00+00:00,2.5,14.5,15
1995-01-01 02:00:00+00:00,2.0,13.5,350
"""
SEMICOLONS = (
    "time;Hs [m];T_p [s];from [deg]\n1995-01-01T01:00;2,5;14,5;15\n1995-01-01T02:00;2;13,5;350\n"
)


def written(folder: Path, text: str, name: str = "sea.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def grid(folder: Path, names: tuple[str, str, str], time: str, squeeze: bool = False) -> Path:
    """A year's first hours on a grid of two by two, and land at its first point."""
    values = np.arange(3 * 4, dtype=np.float64).reshape(3, 2, 2) / 10.0 + 1.0
    values[:, 0, 0] = np.nan
    dims = (time, "latitude", "longitude")
    height, period, direction = names
    data = xr.Dataset(
        {
            height: (dims, values, {"units": "m"}),
            period: (dims, values + 8.0, {"units": "s"}),
            direction: (dims, 100.0 * values, {"units": "degree"}),
        },
        coords={
            time: np.datetime64("2020-03-01T00", "ns") + np.arange(3).astype("timedelta64[h]"),
            "latitude": [56.0, 55.5],
            "longitude": [358.0, 358.5],
        },
    )
    path = folder / "grid.nc"
    (data.isel(latitude=[1], longitude=[1]) if squeeze else data).to_netcdf(path, engine="h5netcdf")
    return path


def test_standard_meteorology_of_the_last_days(tmp_path: Path) -> None:
    found = read_series(written(tmp_path, STDMET, "46097.txt"))
    assert found.file_format == "NDBC standard meteorology"
    assert [str(t) for t in found.time] == [f"2019-04-02T0{h}:00:00" for h in range(3)]
    np.testing.assert_array_equal(found.significant_height, [1.0, 1.2, 1.5])
    np.testing.assert_array_equal(found.peak_period, [10.0, 11.0, 12.0])
    assert found.direction is not None
    np.testing.assert_allclose(np.degrees(found.direction), [90.0, np.nan, 180.0])
    assert (found.quality.read, found.quality.kept) == (4, 3)
    assert [one.reason for one in found.quality.rejections] == ["no H_s"]
    assert set(found.month) == {4}


def test_standard_meteorology_of_a_year_long_ago(tmp_path: Path) -> None:
    found = read_series(written(tmp_path, OLD, "old.txt"))
    assert [str(t) for t in found.time] == ["1996-01-01T00:00:00", "1996-01-01T02:00:00"]
    assert found.direction is not None
    np.testing.assert_allclose(np.degrees(found.direction), [90.0, np.nan])
    reasons = {one.reason: one.example for one in found.quality.rejections}
    assert reasons == {
        "another number of values than of columns": "line 5",
        "no H_s": "1996-01-01 01:00:00",
    }
    assert found.quality.notes == ("two-digit years, taken as 1970 to 2069",)


@pytest.mark.parametrize("text", [CSV, SEMICOLONS, CSV.replace("_0", "")])
def test_a_hindcast_as_csv(tmp_path: Path, text: str) -> None:
    found = read_series(written(tmp_path, text))
    np.testing.assert_array_equal(found.significant_height, [2.5, 2.0])
    np.testing.assert_array_equal(found.peak_period, [14.5, 13.5])
    assert found.direction is not None
    np.testing.assert_allclose(np.degrees(found.direction), [15.0, 350.0])
    assert str(found.time[0]) == "1995-01-01T01:00:00"


def test_times_with_a_zone_become_utc_and_units_si(tmp_path: Path) -> None:
    text = "time,Hs [cm],Tz [s]\n2020-01-01T02:00+02:00,150,7.7\n2020-01-01T03:00+02:00,150,7.7\n"
    found = read_series(written(tmp_path, text))
    assert str(found.time[0]) == "2020-01-01T00:00:00"
    assert found.significant_height[0] == pytest.approx(1.5)
    # T_z of a JONSWAP spectrum of gamma 3.3, as the note says.
    assert found.peak_period[0] == pytest.approx(7.7 / 0.7777, rel=1e-4)
    assert "T_z made T_p by a JONSWAP spectrum of gamma 3.3" in found.quality.notes
    assert found.direction is None


@pytest.mark.parametrize(
    ("names", "time"),
    [(("swh", "pp1d", "mwd"), "valid_time"), (("VHM0", "VTPK", "VMDR"), "time")],
)
def test_grids_of_era5_and_copernicus(
    tmp_path: Path, names: tuple[str, str, str], time: str
) -> None:
    path = grid(tmp_path, names, time)
    with pytest.raises(InputError, match=r"place must be LAT,LON .*latitude 55.5 to 56; long"):
        read_series(path)
    # Longitudes go round: 358.4 is -1.6.
    found = read_series(path, place="55.4,-1.6")
    assert found.quality.notes == ("the grid point 55.5, 358.5",)
    np.testing.assert_allclose(found.significant_height, [1.3, 1.7, 2.1])
    np.testing.assert_allclose(found.peak_period, [9.3, 9.7, 10.1])
    assert found.direction is not None
    np.testing.assert_allclose(np.degrees(found.direction), [130.0, 170.0, 210.0])
    with pytest.raises(InputError, match="no record is left"):  # land
        read_series(path, place="56,358")
    with pytest.raises(InputError, match="place 40,-2 is not on the grid"):
        read_series(path, place="40,-2")
    with pytest.raises(InputError, match="place must be LAT,LON in degrees, got '55'"):
        read_series(path, place="55")
    alone = read_series(grid(tmp_path, names, time, squeeze=True))
    np.testing.assert_array_equal(alone.significant_height, found.significant_height)


def test_our_own_records_come_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stillhook.cli import main

    monkeypatch.chdir(tmp_path)
    written(tmp_path, STDMET, "46097.txt")
    assert main(["sea", "46097.txt", "--out", "first", "--no-figures"]) == 0
    first, again = read_series("46097.txt"), read_series("first/records.csv")
    for name in ("time", "significant_height", "peak_period", "direction"):
        np.testing.assert_allclose(
            getattr(again, name).astype(np.float64), getattr(first, name).astype(np.float64)
        )
    assert read_scatter("first/scatter.csv").mean_significant_height > 0.0
    # Two places in one file: one is chosen.
    rows = (tmp_path / "first" / "records.csv").read_text().splitlines()
    both = [rows[0]] + [row.replace(",,", f",{p},", 1) for p in ("A", "B") for row in rows[1:]]
    written(tmp_path, "\n".join(both) + "\n", "two.csv")
    with pytest.raises(InputError, match="place must be one of A, B; none was named"):
        read_series("two.csv")
    assert len(read_series("two.csv", place="B")) == len(first)


def test_spectra_are_a_series_too(tmp_path: Path) -> None:
    text = "#YY MM DD hh mm .05 .10 .15 .20\n2020 01 01 00 00 0.1 5.0 2.0 1.0\n"
    path = written(tmp_path, text, "spectra.txt")
    assert not holds_series(path)
    found, spectra = read_series(path), read_seas(path)
    np.testing.assert_array_equal(found.significant_height, spectra.significant_height)
    np.testing.assert_array_equal(found.peak_period, spectra.peak_period)
    assert holds_series(written(tmp_path, STDMET, "met.txt"))
    nameless = SeaRecords.from_arrays([0.05, 0.1, 0.2], [[0.0, 5.0, 1.0]])
    with pytest.raises(InputError, match="has no times"):
        nameless.series()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("a,b\n1,2\n", "must be NDBC standard meteorology, CSV or NetCDF with time"),
        ("time,Hs\n2020-01-01,1\n", "must have a peak period .* beside the significant height"),
        ("time,Hs,Tp\n01.02.2020,1,7\n", "times must be written as 2019-04-02 13:50, .*'01.02"),
        ("time,Hs,Tp\n2020-01-01,x,7\n", "no record is left after quality control: 1 records"),
        ("time,Hs [s],Tp\n2020-01-01,1,7\n", r"unit of Hs \[s\] must be one of m, .*got 's'"),
        ("time,Hs_0,Tp_0,Hs_1,Tp_1\n2020-01-01,1,7,1,7\n", "place must be one of 0, 1; none"),
        ("time,Hs,Tp\n2020-01-01,1,7\n2020-01-01,1,7,8,9\n", "is not a table with a header"),
    ],
)
def test_bad_files_are_told_in_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_series(written(tmp_path, text))


def test_what_is_no_sea_is_counted() -> None:
    time = np.datetime64("2020-01-01T00") + np.array([3, 0, 1, 1, 2, 4, 5]).astype("timedelta64[h]")
    height = [1.0, 2.0, 1.5, 1.6, 0.0, 31.0, 2.0]
    period = [8.0, 8.0, 8.0, 8.0, 8.0, 8.0, 70.0]
    found = SeaSeries.from_arrays(time, height, period)
    np.testing.assert_array_equal(found.significant_height, [2.0, 1.5, 1.0])
    reasons = {one.reason: one.count for one in found.quality.rejections}
    assert reasons == {
        "no waves (H_s 0)": 1,
        "H_s above 30 m": 1,
        "T_p not in 0 to 60 s": 1,
        "same time again": 1,
    }
    with pytest.raises(InputError, match="peak_period must have one value for each of the 7 times"):
        SeaSeries.from_arrays(time, height, period[:3])


def test_a_record_stands_until_the_next_and_no_further_than_three_hours() -> None:
    hours = np.array([0, 1, 2, 5, 9, 10])
    time = np.datetime64("2020-01-01T00") + hours.astype("timedelta64[h]")
    series = SeaSeries.from_arrays(time, np.ones(6), np.full(6, 8.0))
    np.testing.assert_array_equal(series.spans / 3600.0, [1.0, 1.0, 3.0, 1.0, 1.0, 1.0])


@settings(max_examples=60, deadline=None)
@given(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
def test_waves_on_the_bow_are_head_seas_wherever_they_come_from(bow: float, turn: float) -> None:
    assert math.cos(float(relative_heading(bow, np.array(bow)))) == pytest.approx(-1.0)
    # From starboard they travel to port: 90 deg.
    starboard = float(relative_heading(bow, np.array(bow + 0.5 * math.pi)))
    assert math.sin(starboard) == pytest.approx(1.0)
    # The vessel and the sea turned together are the same.
    one, other = (float(relative_heading(bow + t, np.array(1.0 + t))) for t in (0.0, turn))
    assert math.cos(one - other) == pytest.approx(1.0)


def test_periods_in_bins_leave_no_class_empty() -> None:
    rng = np.random.default_rng(1)
    true = rng.uniform(0.045, 0.12, 5000)  # frequencies, evenly distributed
    bins = 0.0475 + 0.005 * np.round((true - 0.0475) / 0.005)
    time = np.datetime64("2020-01-01T00") + np.arange(5000).astype("timedelta64[h]")
    edges = np.arange(9.0, 22.0)
    expected = (1.0 / edges[:-1] - 1.0 / edges[1:]) / (0.12 - 0.045)
    series = SeaSeries.from_arrays(time, np.ones(5000), 1.0 / bins)
    _, periods, table = series.scatter(height_step=2.0).matrix(2.0, 1.0)
    found = dict(zip(periods[:-1], table.sum(axis=0), strict=True))
    shares = np.array([found[e] for e in edges[:-1]])
    assert np.all(shares > 0.0)
    np.testing.assert_allclose(shares, expected, rtol=0.15)
    # Without the spreading some class is empty: what this test is for.
    plain = np.histogram(1.0 / bins, edges)[0]
    assert plain.min() == 0
    # Every record stays whole.
    assert series.scatter().occurrence.sum() == pytest.approx(1.0)
    assert series.scatter().total == 5000


@REAL
def test_a_real_buoy_and_a_real_hindcast() -> None:
    buoy = read_series(DATA / "mhkit" / "46097_stdmet.txt")
    assert (len(buoy), buoy.quality.read, buoy.usual_step) == (1082, 6490, 3600.0)
    assert buoy.significant_height.max() == 5.7
    year = read_series(DATA / "mhkit" / "hindcast_multiparam.csv")
    assert (len(year), str(year.time[-1])) == (8748, "1995-12-31T23:00:00")
    assert float(year.significant_height[0]) == 2.4843662
    assert year.direction is not None
    assert math.degrees(float(year.direction[0])) == pytest.approx(15.084534)
    for series in (buoy, year):
        _, _, table = series.scatter().matrix()
        inside = table.sum(axis=0)
        assert np.all(inside[: int(np.flatnonzero(inside)[-1]) + 1] > 0.0)
