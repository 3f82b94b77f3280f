"""A run in files: xarray, NetCDF, CSV and Parquet, written whole or not at all.

    Run --> to_xarray --> Dataset
    Run --> write_netcdf, write_csv, write_parquet --> file --> xarray, pandas

Every signal is a variable over `time` under its own name, with its unit as the attribute `units`.
The attributes of the data set say where it came from: the case as YAML, the controller, the seed,
the versions, and what happened; a CSV has room for names and units only.  Numbers lose no digit.

NetCDF is version 3 with 64-bit offsets, which SciPy writes: it needs no package beyond those of the
toolkit, and everything that reads NetCDF reads it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..basics import replace_atomically
from .run import Run

if TYPE_CHECKING:
    import xarray

# Rows turned into text at a time: a day's run must not be held as text.
_ROWS_AT_ONCE = 4096

_INT32 = 2**31 - 1

# Under this key the metadata of a Parquet file holds the attributes as JSON.
_METADATA = b"stillhook"


def attributes(run: Run) -> dict[str, str | int | float]:
    """Return where a run came from and what happened in it, as plain numbers and texts.

    `case` is the case file in YAML; `events`, `statistics` (the named quantities, null where there
    is none) and `versions` are JSON.
    """
    quantities = {
        name: q.value if np.isfinite(q.value) else None
        for name, q in run.statistics.quantities.items()
    }
    return {
        "title": f"{run.case.name}, {run.controller}, {run.scenario}, seed {run.seed}",
        "case_name": run.case.name,
        "case": run.case.to_yaml(),
        "controller": run.controller,
        "scenario": run.scenario,
        "seed": run.seed,
        "sample_time": run.sample_time,
        "step": run.step,
        "duration": run.duration,
        "compiled": int(run.compiled),
        "status": run.status,
        "message": run.message,
        "events": json.dumps([[e.time, e.kind, e.text] for e in run.events]),
        "statistics": json.dumps(quantities),
        "versions": json.dumps(_versions()),
    }


def to_xarray(run: Run) -> xarray.Dataset:
    """Return the signals of a run over `time` (time,), each with its `units`, and `attributes`."""
    import xarray

    return xarray.Dataset(
        {name: ("time", run[name], {"units": run.units[name]}) for name in run.signals},
        coords={"time": ("time", run.time, {"units": "s"})},
        attrs=attributes(run),
    )


def write_netcdf(run: Run, path: str | Path) -> Path:
    """Write the signals of a run as NetCDF.

    Raises InputError if the file cannot be written; what stood there before stays.
    """
    data = to_xarray(run)
    # The format has no integers beyond 32 bits; a long seed goes as text.
    data.attrs = {
        key: str(value) if isinstance(value, int) and abs(value) > _INT32 else value
        for key, value in data.attrs.items()
    }
    return replace_atomically(
        path, lambda place: data.to_netcdf(place, engine="scipy", format="NETCDF3_64BIT")
    )


def write_csv(run: Run, path: str | Path) -> Path:
    """Write the signals of a run as CSV: a header of `name [unit]`, then a row for each time.

    Numbers are the shortest texts that read back as the same number.

    Raises InputError if the file cannot be written; what stood there before stays.
    """

    def write(place: Path) -> None:
        with place.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(_csv_lines(run))

    return replace_atomically(path, write)


def write_parquet(run: Run, path: str | Path) -> Path:
    """Write the signals of a run as Parquet, which pandas reads with one column for each signal.

    Units are metadata of the columns (key `units`), the attributes metadata of the file (key
    `stillhook`, JSON).

    Raises InputError if the file cannot be written; what stood there before stays.
    """
    import pyarrow as pa
    from pyarrow import parquet

    columns = [("time", "s", run.time), *((n, run.units[n], run[n]) for n in run.signals)]
    schema = pa.schema(
        [pa.field(name, pa.float64(), metadata={"units": unit}) for name, unit, _ in columns],
        metadata={_METADATA: json.dumps(attributes(run))},
    )
    arrays = [pa.array(np.ascontiguousarray(values)) for _, _, values in columns]
    table = pa.Table.from_arrays(arrays, schema=schema)
    return replace_atomically(path, lambda place: parquet.write_table(table, place))


def _csv_lines(run: Run) -> Iterator[str]:
    heads = [f"{n} [{run.units[n]}]" if run.units[n] else n for n in run.signals]
    yield ",".join(["time [s]", *heads]) + "\n"
    for start in range(0, run.time.size, _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        for row in np.column_stack((run.time[rows], run.values[rows])).tolist():
            yield ",".join(map(repr, row)) + "\n"


def _versions() -> dict[str, str]:
    found = {}
    for name in ("stillhook", "numpy", "scipy", "casadi"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
