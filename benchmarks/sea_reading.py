"""How fast files of wave spectra are read: `python benchmarks/sea_reading.py [--out FILE]`.

Each file is read in a process of its own: once with all imports, as a user's first command does it,
and then again, best of five, with the cache emptied before each.  The files are those of
`../shared/data/wavespectra`, where they are, and two that are made here: a year of an NDBC buoy and
a year of a hindcast.  Reading must take less than a second but for the imports; exit code 1 if not.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import subprocess
import sys
import tempfile
import time as clock
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
REAL = ROOT.parent / "shared" / "data" / "wavespectra"
NAMES = ("41010.data_spec", "spotter_20180214.json", "swanfile.spec", "ww3file.nc")
LIMIT = 1.0  # s


def year_of_a_buoy(folder: Path) -> Path:
    """Write 8760 hourly records of 47 frequencies, one in a hundred missing."""
    rng = np.random.default_rng(1)
    frequency = np.linspace(0.02, 0.485, 47)
    hours = np.arange("2015-01-01T00", "2016-01-01T00", dtype="datetime64[h]")
    lines = ["#YY  MM DD hh mm " + " ".join(f"{f:.4f}" for f in frequency)]
    for index, hour in enumerate(hours.astype(str)):
        row = rng.uniform(0.0, 6.0, 47) if index % 100 else np.full(47, 999.0)
        when = f"{hour[:4]} {hour[5:7]} {hour[8:10]} {hour[11:13]} 00"
        lines.append(f"{when} " + " ".join(f"{value:.2f}" for value in row))
    path = folder / "year-of-a-buoy.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def year_of_a_hindcast(folder: Path) -> Path:
    """Write 2920 three-hourly directional spectra, 30 frequencies by 24 directions, as NetCDF."""
    import xarray as xr

    rng = np.random.default_rng(2)
    times = np.arange("2015-01-01", "2016-01-01", np.timedelta64(3, "h"), dtype="datetime64[ns]")
    values = rng.uniform(0.0, 0.05, (times.size, 30, 24)).astype(np.float32)
    dataset = xr.Dataset(
        {"efth": (("time", "freq", "dir"), values)},
        {"time": times, "freq": 0.035 * 1.1 ** np.arange(30), "dir": np.arange(0.0, 360.0, 15.0)},
    )
    path = folder / "year-of-a-hindcast.nc"
    dataset.to_netcdf(path, engine="h5netcdf")
    return path


def measure(path: Path) -> tuple[int, str, float, float]:
    """Return records, format, and the times of the first reading and of a later one [s]."""
    found = subprocess.run(
        [sys.executable, __file__, "--one", str(path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    count, form, first, later = found.stdout.strip().split("|")
    return int(count), form, float(first), float(later)


def one(path: str) -> None:
    """Read one file and print what `measure` wants."""
    begin = clock.perf_counter()
    from models.sea import records

    found = records.read_seas(path)
    first = clock.perf_counter() - begin
    times = []
    for _ in range(5):
        records._read.cache_clear()
        begin = clock.perf_counter()
        records.read_seas(path)
        times.append(clock.perf_counter() - begin)
    print(f"{len(found)}|{found.file_format}|{first:.4f}|{min(times):.4f}")


def main() -> int:
    """Measure, print, write; return 1 if a file takes too long."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--quick", action="store_true", help="two files only")
    parser.add_argument("--write", action="store_true", help="renew docs/data/sea_reading.csv")
    arguments = parser.parse_args()
    if arguments.one:
        one(arguments.one)
        return 0
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        files = [REAL / name for name in NAMES if (REAL / name).exists()]
        files = files[:2] if arguments.quick else files
        files += (
            []
            if arguments.quick
            else [year_of_a_buoy(Path(folder)), year_of_a_hindcast(Path(folder))]
        )
        for path in files:
            count, form, first, later = measure(path)
            size = path.stat().st_size / 1e6
            rows.append((path.name, form, f"{size:.2f}", count, f"{first:.2f}", f"{later:.3f}"))
            print(
                "{:24} {:24} {:>6} MB {:6} records  first {:>5} s  then {:>6} s".format(*rows[-1])
            )
    if arguments.write and not arguments.quick:
        sys.path.insert(0, str(ROOT / "docs" / "make"))
        from stored import write_rows

        columns = ("file", "format", "size_mb", "records", "first_s", "later_s")
        told = (dict(zip(columns, row, strict=True)) for row in rows)
        write_rows(ROOT / "docs" / "data" / "sea_reading.csv", columns, told)
    return int(any(float(row[-1]) > LIMIT for row in rows))


if __name__ == "__main__":
    sys.exit(main())
