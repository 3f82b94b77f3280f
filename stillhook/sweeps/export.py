"""Files of the result of a sweep for other tools (`write_result`): CSV, Parquet, NetCDF, Zarr.

xarray.Dataset --> write_result --> by the ending of the file's name
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from models.basics import InputError, how_to_install, pick, replace_atomically

if TYPE_CHECKING:
    import pandas as pd  # type: ignore[import-untyped]
    import xarray as xr

ENDINGS = (".csv", ".parquet", ".nc", ".zarr")


def table_of(result: xr.Dataset) -> pd.DataFrame:
    """Return a result as a table: a row for each case, units in ``attrs["units"]``."""
    named = result.reset_coords()
    one = [str(n) for n, v in named.data_vars.items() if v.dims == ("case",)]
    frame = named[one].to_dataframe().reset_index()
    varied = [str(name) for name in result.coords if str(name) != "case"]
    rest = [name for name in frame.columns if name not in ("case", *varied)]
    frame = frame[["case", *varied, *rest]]
    frame.attrs["units"] = {str(n): named[n].attrs.get("units", "1") for n in frame.columns}
    return frame


def check_writable(path: str | Path) -> Path:
    """Return the path of a result, of a kind that is known and in a folder that is there.

    Raises InputError if it is not.
    """
    place = Path(path)
    pick("sweep", "ending of a result", ENDINGS, (place.suffix,))
    if not place.parent.is_dir():
        raise InputError(f"{place}: cannot be written: there is no folder {place.parent}")
    return place


def write_result(result: xr.Dataset, path: str | Path) -> Path:
    """Write a result, whole or not at all.

    The path ends in ``.csv``, ``.parquet``, ``.nc`` or ``.zarr``.  A table has a first line with
    the names; units are in the metadata of Parquet, NetCDF and Zarr.

    Raises InputError if the ending is another, it cannot be written, or zarr is not installed.
    """
    place = check_writable(path)
    if place.suffix == ".csv":
        return replace_atomically(place, lambda new: table_of(result).to_csv(new, index=False))
    if place.suffix == ".parquet":
        return replace_atomically(place, lambda new: table_of(result).to_parquet(new, index=False))
    if place.suffix == ".nc":
        return replace_atomically(place, lambda new: result.to_netcdf(new, engine="h5netcdf"))
    return _zarr(result, place)


def _zarr(result: xr.Dataset, place: Path) -> Path:
    try:
        import zarr  # noqa: F401
    except ImportError:
        raise InputError(f"{place}: needs zarr: {how_to_install('zarr')}") from None

    def write(new: Path) -> None:
        try:
            result.to_zarr(new, mode="w", consolidated=False, zarr_format=3)
        except BaseException:
            shutil.rmtree(new, ignore_errors=True)
            raise
        if place.is_dir():
            shutil.rmtree(place)

    return replace_atomically(place, write)
