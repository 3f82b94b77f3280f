"""Readers of measured seas: their numbers, their quality control, and damaged files."""

from __future__ import annotations

import gzip
import math
import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from models.basics import InputError
from models.sea import SeaRecords, read_seas
from models.sea.library_files import FORMATS
from models.sea.quality import sift

DATA = Path(__file__).parents[4] / "shared" / "data" / "wavespectra"
REAL = pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not here")
FILES = ["41010.data_spec", "41010.spec", "spotter_20180214.json", "swanfile.spec", "ww3file.nc"]

FREQUENCY = np.array([0.04, 0.06, 0.08, 0.10, 0.15, 0.20, 0.30])
STORM = [0.1, 12.0, 350.0, 420.5, 60.0, 9.9, 0.9]
SWELL = [0.0, 2.0, 5.5, 1.0, 0.3, 0.1, 0.1]


def ndbc(
    rows, *, header="#YY  MM DD hh mm", frequencies="  .04 .0600 .0800 .1000 .1500 .2000 .3000"
):
    lines = [header + frequencies]
    lines += [f"{when}  " + "  ".join(f"{v:.2f}" for v in values) for when, values in rows]
    return "\n".join(lines) + "\n"


HOURS = [("2020 01 01 00 00", SWELL), ("2020 01 01 01 00", STORM)]


def written(folder, text, name="buoy.txt"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def by_hand(values):
    return 4.0 * math.sqrt(np.trapezoid(values, FREQUENCY))


class TestNdbc:
    def test_storms_are_not_missing(self, tmp_path):
        records = read_seas(written(tmp_path, ndbc(HOURS)))
        assert len(records) == 2
        assert records.quality.rejected == 0
        found = records.significant_height
        np.testing.assert_allclose(found, [by_hand(SWELL), by_hand(STORM)], rtol=1e-12)
        # Between its bins, nowhere more than half a bin from the highest.
        for period, row in zip(records.peak_period, (SWELL, STORM), strict=True):
            top = int(np.argmax(row))
            near = slice(top - 1, top + 2)
            fit = np.polyfit(FREQUENCY[near] - FREQUENCY[top], np.array(row)[near], 2)
            assert 1.0 / period == pytest.approx(FREQUENCY[top] - 0.5 * fit[1] / fit[0], rel=1e-9)
            low, high = 0.5 * (FREQUENCY[top - 1 : top + 1] + FREQUENCY[top : top + 2])
            assert low <= 1.0 / period <= high
        np.testing.assert_allclose(records.omega, 2.0 * math.pi * FREQUENCY, rtol=1e-12)
        assert str(records.time[1]) == "2020-01-01T01:00:00"
        sea = records.sea(1, beyond="zero")
        assert sea.significant_height == pytest.approx(by_hand(STORM), rel=1e-12)
        assert 2.0 * math.pi / sea.statistics.mean_period == pytest.approx(
            sea.statistics.m1 / sea.statistics.m0
        )

    @pytest.mark.parametrize(
        ("header", "whens", "first"),
        [
            ("#YY  MM DD hh mm", ("2020 01 01 00 00", "2020 01 01 01 00"), "2020-01-01T00:00:00"),
            ("YYYY MM DD hh", ("1999 01 01 00", "1999 01 01 01"), "1999-01-01T00:00:00"),
            ("YY MM DD hh", ("96 01 01 00", "96 01 01 01"), "1996-01-01T00:00:00"),
            ("YY MM DD hh mm", ("69 12 31 23 30", "69 12 31 23 50"), "2069-12-31T23:30:00"),
            ("yyyy,mm,dd,hh,mm,", ("2004,1,1,0,30,", "2004,1,1,1,30,"), "2004-01-01T00:30:00"),
        ],
    )
    def test_headers_of_all_times(self, tmp_path, header, whens, first):
        frequencies = " .04 .0600 .0800 .1000 .1500 .2000 .3000"
        if "," in header:
            frequencies = frequencies.strip().replace(" ", ",")
        text = ndbc(
            [(when, values) for when, (_, values) in zip(whens, HOURS, strict=True)],
            header=header,
            frequencies=frequencies,
        )
        records = read_seas(written(tmp_path, text))
        assert len(records) == 2
        assert str(records.time[0]) == first
        assert records.significant_height[1] == pytest.approx(by_hand(STORM), rel=1e-12)
        two_digits = len(whens[0].split()[0].split(",")[0]) == 2
        assert bool(records.quality.notes) == two_digits

    def test_packed_with_gzip(self, tmp_path):
        path = tmp_path / "buoy.txt.gz"
        path.write_bytes(gzip.compress(ndbc(HOURS).encode()))
        assert len(read_seas(path)) == 2
        path.write_bytes(gzip.compress(ndbc(HOURS).encode())[:-20])
        with pytest.raises(InputError, match="the gzip packing is broken"):
            read_seas(path)

    def test_what_is_rejected_is_counted_with_its_reason(self, tmp_path):
        n = len(FREQUENCY)
        rows = [
            *HOURS,
            ("2020 01 01 02 00", [999.0] * n),  # line 4
            ("2020 01 01 03 00", [99.0] * n),
            ("2020 01 01 04 00", [99.0, *SWELL[1:]]),  # a density like any other
            ("2020 01 01 05 00", [*SWELL[:-1], 999.0]),
            ("2020 01 01 06 00", [*SWELL[:-1], 9999.0]),
            ("2020 01 01 07 00", [0.0] * n),
            ("2020 01 01 08 00", [-0.1, *SWELL[1:]]),
            ("2020 13 01 09 00", SWELL),
            ("2020 01 01 10 00", SWELL[:-2]),
            ("2020 01 01 00 00", STORM),
            ("2020 01 01 11 00", [990.0] * n),
        ]
        records = read_seas(written(tmp_path, ndbc(rows)))
        quality = records.quality
        assert (quality.read, quality.rejected, quality.kept) == (13, 10, 3)
        told = {one.reason: (one.count, one.example) for one in quality.rejections}
        assert told == {
            "no date": (1, "line 11"),
            "another number of values than of frequencies": (1, "line 12"),
            "all values missing": (2, "line 4"),
            "some values missing": (2, "line 7"),
            "negative density": (1, "line 10"),
            "no energy": (1, "line 9"),
            "H_s above 30 m": (1, "line 14"),
            "same time and place again": (1, "line 13"),
        }
        assert [str(t)[11:13] for t in records.time] == ["00", "01", "04"]
        assert "13 records read, 10 rejected, 3 kept" in str(quality)

    def test_a_frequency_that_was_never_measured_is_left_out(self, tmp_path):
        rows = [(when, [999.0, *values[1:]]) for when, values in HOURS]
        records = read_seas(written(tmp_path, ndbc(rows)))
        assert len(records) == 2
        assert records.omega.size == len(FREQUENCY) - 1
        assert records.quality.notes == ("1 frequencies without any value left out (0.04 Hz)",)

    def test_real_time_files_keep_to_one_set_of_frequencies(self, tmp_path):
        def row(hour, pairs):
            told = " ".join(f"{s:.3f} ({f:.3f})" for f, s in pairs)
            return f"2020 06 08 {hour:02d} 50 0.225 {told}"

        pairs = list(zip(FREQUENCY, SWELL, strict=True))
        text = "#YY  MM DD hh mm Sep_Freq  < spec_1 (freq_1) spec_2 (freq_2) ... >\n"
        text += "\n".join([row(3, pairs), row(2, pairs), row(1, pairs[:-1])]) + "\n"
        records = read_seas(written(tmp_path, text, "x.data_spec"))
        assert [str(t)[11:13] for t in records.time] == ["02", "03"]  # newest first in the file
        assert records.significant_height == pytest.approx(by_hand(SWELL))
        (one,) = records.quality.rejections
        assert one.reason == "other frequencies than the rest of the file"
        wrong = text.replace("spec_", "alpha1_")
        with pytest.raises(InputError, match=r"spectral densities \(spec_1\), got alpha1"):
            read_seas(written(tmp_path, wrong, "x.swdir"))

    @REAL
    def test_agrees_with_wavespectra_on_a_file_without_gaps(self):
        wavespectra = pytest.importorskip("wavespectra")
        path = DATA / "41010.data_spec"
        ours, theirs = read_seas(path), wavespectra.read_ndbc_ascii(str(path))
        per_radian = theirs.efth.values[:, :, 0] / (2.0 * math.pi)
        np.testing.assert_allclose(ours.density, per_radian, rtol=1e-6)
        np.testing.assert_array_equal(ours.time, theirs.time.values.astype("datetime64[s]"))

    @REAL
    def test_a_file_of_summaries_is_no_file_of_spectra(self):
        with pytest.raises(InputError, match=r"got 'WVHT SwH SwP .*: this is no file of spectra"):
            read_seas(DATA / "41010.spec")


@pytest.fixture(scope="module")
def xr():
    pytest.importorskip("wavespectra")
    import xarray

    return xarray


DIRECTIONS = np.arange(0.0, 360.0, 30.0)


def directional(one_sided):
    """Spread a spectrum [m^2/Hz] over directions about 90 deg, per degree."""
    shape = np.maximum(np.cos(np.radians(DIRECTIONS - 90.0)), 0.0) ** 2
    return np.asarray(one_sided)[..., None] * shape / (shape.sum() * 30.0)


class TestLibrary:
    times = np.array(["2021-02-01", "2021-02-02", "2021-03-01"], dtype="datetime64[ns]")
    table = np.array([SWELL, STORM, SWELL])

    def check(self, path, name, *, direction=True, rejected=0):
        records = read_seas(path)
        assert records.file_format == FORMATS[name]
        assert records.quality.rejected == rejected
        found = sorted(records.significant_height)
        expected = sorted(by_hand(values) for values in (SWELL, STORM))
        np.testing.assert_allclose([found[0], found[-1]], expected, rtol=1e-5)
        if direction:
            np.testing.assert_allclose(np.degrees(records.direction), 90.0, atol=1e-3)
        asked = read_seas(path, file_format=name)
        np.testing.assert_array_equal(asked.density, records.density)
        return records

    def test_wavespectra_netcdf(self, tmp_path, xr):
        dims = ("time", "site", "freq", "dir")
        values = directional(self.table)[:, None].repeat(2, axis=1)
        values[1, 1] = np.nan
        dataset = xr.Dataset(
            {"efth": (dims, values)},
            {"time": self.times, "site": [1, 2], "freq": FREQUENCY, "dir": DIRECTIONS},
        )
        path = tmp_path / "own.nc"
        dataset.to_netcdf(path, engine="h5netcdf")
        records = self.check(path, "wavespectra", rejected=1)
        assert records.place == ("site 0", "site 1", "site 0", "site 0", "site 1")
        assert records.quality.rejections[0].example.startswith("2021-02-02")
        scatter = records.scatter(vessel_heading=math.radians(270.0))
        np.testing.assert_allclose(np.cos(scatter.heading), 1.0)  # from the east, bow to the west
        assert sorted(set(scatter.month.tolist())) == [2, 3]

    def test_era5(self, tmp_path, xr):
        count = 7
        frequency = 0.03453 * 1.1 ** np.arange(count)
        sea = np.array([[2.0, 8.0, 20.0, 9.0, 3.0, 1.0, 0.3]])
        land = np.full((1, count, 12), np.nan)
        spread = directional(sea) * 180.0 / math.pi  # per radian
        # ERA5's directions are where the waves go to, from 7.5 deg on.
        values = np.concatenate([np.roll(spread, 6, axis=-1), land])[:, :, :, None]
        with np.errstate(divide="ignore"):
            logs = np.where(values > 0.0, np.log10(values), np.nan)
        dataset = xr.Dataset(
            {"d2fd": (("time", "frequency", "direction", "longitude"), logs)},
            {"time": self.times[:2], "frequency": np.arange(1, count + 1),
             "direction": np.arange(1, 13), "longitude": [3.0]},
        )  # fmt: skip
        path = tmp_path / "era5.nc"
        dataset.to_netcdf(path, engine="h5netcdf")
        records = read_seas(path)
        assert records.file_format == "ERA5 NetCDF"
        assert len(records) == 1
        expected = 4.0 * math.sqrt(np.trapezoid(sea[0], frequency))
        assert records.significant_height[0] == pytest.approx(expected, rel=1e-6)
        (land_told,) = records.quality.rejections
        assert land_told.reason == "no energy"

    def test_ndbc_netcdf_with_gaps(self, tmp_path, xr):
        table = self.table.copy()
        table[2] = np.nan
        dims = ("time", "frequency", "latitude", "longitude")
        dataset = xr.Dataset(
            {
                "spectral_wave_density": (dims, table[:, :, None, None]),
                "mean_wave_dir": (dims, np.full((3, 7, 1, 1), 90.0)),
            },
            {"time": self.times, "frequency": FREQUENCY, "latitude": [30.0], "longitude": [-78.0]},
        )
        path = tmp_path / "ndbc.nc"
        dataset.to_netcdf(path, engine="scipy")
        records = self.check(path, "ndbc-netcdf", rejected=1)
        assert records.quality.rejections[0].reason == "all values missing"

    def test_what_is_no_file_of_spectra_is_named(self, tmp_path):
        path = tmp_path / "seas.csv"
        path.write_bytes(b"PK\x03\x04\x14\x00xl/workbook.xml\x00")
        with pytest.raises(InputError, match="is no file of wave spectra, but an Excel workbook"):
            read_seas(path)
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(InputError, match="is a device or a pipe; a file is wanted"):
            read_seas(tmp_path / "pipe", file_format="swan")

    def test_another_netcdf(self, tmp_path, xr):
        path = tmp_path / "other.nc"
        xr.Dataset({"temperature": ("x", [1.0, 2.0])}).to_netcdf(path, engine="scipy")
        with pytest.raises(InputError, match="no wave spectra that are known here; it has 'temp"):
            read_seas(path)

    @REAL
    @pytest.mark.usefixtures("xr")
    def test_the_wrong_format_is_refused(self):
        with pytest.raises(InputError, match="is WAVEWATCH III NetCDF, not ERA5 NetCDF"):
            read_seas(DATA / "ww3file.nc", file_format="era5")
        with pytest.raises(InputError, match="cannot be read as SWAN text; it is cut off, damaged"):
            read_seas(DATA / "spotter_20180214.json", file_format="swan")
        with pytest.raises(InputError, match=r"the format must be one of ndbc, .*; got 'grib'"):
            read_seas(DATA / "ww3file.nc", file_format="grib")

    @REAL
    @pytest.mark.usefixtures("xr")
    @pytest.mark.parametrize(
        ("name", "reader", "count"),
        [("swanfile.spec", "read_swan", 5), ("ww3file.nc", "read_ww3", 18)],
    )
    def test_real_files_have_the_librarys_heights_and_directions(self, name, reader, count):
        import wavespectra

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = getattr(wavespectra, reader)(str(DATA / name))
            heights = theirs.spec.hs(tail=False).values.ravel()
            bearings = theirs.spec.dm().values.ravel()
        records = read_seas(DATA / name)
        assert len(records) == count
        # The library's rule is another (rectangles), and so is its order of places.
        np.testing.assert_allclose(np.sort(records.significant_height), np.sort(heights), rtol=0.02)
        ours = np.sort(np.degrees(records.direction))
        np.testing.assert_allclose(ours, np.sort(np.mod(bearings, 360.0)), atol=2.0)

    @REAL
    @pytest.mark.usefixtures("xr")
    def test_spotter_agrees_with_the_heights_in_its_own_file(self):
        import json

        waves = json.loads((DATA / "spotter_20180214.json").read_text())["data"]["waves"]
        records = read_seas(DATA / "spotter_20180214.json")
        told = [wave["significantWaveHeight"] for wave in waves]
        np.testing.assert_allclose(records.significant_height, told, rtol=0.01)
        # It tells the bin of the peak, and we what is between the bins.
        peaks = 1.0 / np.array([wave["peakPeriod"] for wave in waves])
        away = np.abs(1.0 / records.peak_period - peaks)
        assert np.all(away <= 0.51 * np.diff(records.omega).max() / (2.0 * math.pi))

    def test_without_the_library(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "wavespectra", None)
        path = written(tmp_path, "SWAN   1\n", "x.spec")
        with pytest.raises(InputError, match=r"run `make waves`"):
            read_seas(path)
        assert len(read_seas(written(tmp_path, ndbc(HOURS)))) == 2


class TestAnyFile:
    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("", "is empty; a file of wave spectra is wanted"),
            ("hello\n", "of no format that is known here; its first line is 'hello'"),
            ("#YY MM DD hh mm .1 .2\n", "the header must give frequencies in Hz, got '.1 .2'"),
            ("#YY MM DD hh mm .1 .2 .3\n", "has a header but no records"),
            ("#YY MM DD hh mm .1 .2 .3\n1 2 3\n", "holds no record: 1 x "),
            ("#YY MM DD hh mm .1 .2 .2\n2020 1 1 0 0 1 2 3\n", "must be strictly ascending"),
            ("#YY MM DD hh mm 1 2 30\n2020 1 1 0 0 1 2 3\n", r"in \[0, 9.5\] Hz, got 30"),
            (
                "#YY MM DD hh mm .1 .2 .3\n2020 1 1 0 0 0 0 0\n",
                "no record is left after quality control: 1 records read, 1 rejected",
            ),
        ],
    )
    def test_told_in_a_sentence(self, tmp_path, text, message):
        with pytest.raises(InputError, match=message):
            read_seas(written(tmp_path, text))

    def test_no_file(self, tmp_path):
        with pytest.raises(InputError, match="no such file"):
            read_seas(tmp_path / "none")
        with pytest.raises(InputError, match="is a folder"):
            read_seas(tmp_path)
        with pytest.raises(InputError, match="cannot be read: embedded null byte"):
            read_seas("a\0b")

    def test_no_such_record(self):
        records = SeaRecords.from_arrays(FREQUENCY, [SWELL])
        with pytest.raises(InputError, match=r"record must be in \[0, 0\] in records, got 1"):
            records.sea(1)
        with pytest.raises(InputError, match="has no directions for a vessel_heading"):
            records.scatter(vessel_heading=0.0)
        assert records.scatter().month is None

    def test_nothing_is_rejected_twice(self):
        rng = np.random.default_rng(5)
        omega = np.linspace(0.2, 3.0, 8)
        density = rng.uniform(-0.2, 3.0, (300, 8))
        density[rng.uniform(size=density.shape) < 0.05] = np.nan
        density[rng.uniform(size=300) < 0.1] = 0.0
        same = [int(i) for i in rng.integers(0, 200, 300)]
        keep, rejections = sift(omega, density, [str(i) for i in range(300)], same)
        assert keep.sum() + sum(one.count for one in rejections) == 300
        assert np.all(np.isfinite(density[keep]))
        assert np.all(density[keep] >= 0.0)
        kept = [same[i] for i in np.flatnonzero(keep)]
        assert len(kept) == len(set(kept))

    @REAL
    @pytest.mark.usefixtures("xr")
    @pytest.mark.parametrize("name", FILES)
    def test_damaged_files_are_told_in_our_words(self, tmp_path, name):
        whole = (DATA / name).read_bytes()
        rng = np.random.default_rng(len(name))
        ended = 0
        for index in range(60):
            path = tmp_path / f"{index}-{name}"
            path.write_bytes(damaged(whole, index % 6, rng))
            try:
                records = read_seas(path)
            except InputError as error:
                assert str(path) in str(error)  # noqa: PT017
                ended += 1
                continue
            assert np.all(np.isfinite(records.significant_height))
            assert np.all(records.significant_height <= 30.0)
            records.scatter()
            records.sea(0)
        assert ended > 5


def damaged(whole, how, rng):
    raw = bytearray(whole)
    n = len(raw)
    if how == 0:  # cut off
        return bytes(raw[: rng.integers(0, n)])
    if how == 1:  # some bytes changed
        for at in rng.integers(0, n, 20):
            raw[at] = rng.integers(0, 256)
        return bytes(raw)
    if how == 2:  # lines in another order
        lines = bytes(raw).split(b"\n")
        rng.shuffle(lines)
        return b"\n".join(lines)
    if how == 3:  # a piece taken out
        a, b = sorted(rng.integers(0, n, 2))
        return bytes(raw[:a] + raw[b:])
    if how == 4:  # a true beginning, then noise
        return bytes(raw[: rng.integers(0, 200)]) + rng.bytes(2000)
    for at in rng.integers(0, min(n, 600), 5):  # a changed header
        raw[at] = rng.integers(0, 256)
    return bytes(raw)
