"""Files of spectra that the library `wavespectra` reads: the one door to it.

The library answers a bad file with whatever exception comes first, and prints warnings; here each
becomes one sentence.  It is an extra, because it brings labelled arrays, a regional atlas of
formats and seconds of import with it.
"""

import contextlib
import importlib
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..basics import (
    GZIP,
    FloatArray,
    InputError,
    check_file,
    check_hdf5,
    how_to_install,
    read_bytes,
)
from .quality import RawRecords

FORMATS: dict[str, str] = {
    "ndbc": "NDBC text",
    "ndbc-netcdf": "NDBC NetCDF",
    "spotter": "Spotter JSON or CSV",
    "swan": "SWAN text",
    "swan-netcdf": "SWAN NetCDF",
    "ww3": "WAVEWATCH III NetCDF",
    "ww3-station": "WAVEWATCH III station text",
    "wwm": "WWM NetCDF",
    "era5": "ERA5 NetCDF",
    "wavespectra": "wavespectra NetCDF",
    "wavespectra-json": "wavespectra JSON",
    "triaxys": "TRIAXYS text",
    "datawell": "Datawell spt",
    "octopus": "Octopus text",
    "obscape": "Obscape CSV",
    "awac": "Nortek AWAC text",
    "funwave": "FUNWAVE text",
    "xwaves": "XWaves MAT",
}
"""Formats by the names that `read_seas` and `stillhook sea --read-as` take."""

_READERS: dict[str, tuple[str, dict[str, Any]]] = {
    "spotter": ("read_spotter", {"dd": None}),  # its own directions are moments, not an axis
    "swan": ("read_swan", {"as_site": True}),
    "ww3-station": ("read_ww3_station", {}),
    "wavespectra-json": ("read_json", {}),
    "triaxys": ("read_triaxys", {}),
    "datawell": ("read_datawell", {"dd": None}),
    "octopus": ("read_octopus", {}),
    "obscape": ("read_obscape", {}),
    "awac": ("read_awac", {}),
    "funwave": ("read_funwave", {}),
    "xwaves": ("read_xwaves", {}),
    "ndbc-netcdf": ("from_ndbc", {"directional": False}),
    "era5": ("from_era5", {}),
    "ww3": ("from_ww3", {}),
    "swan-netcdf": ("from_ncswan", {}),
    "wwm": ("from_wwm", {}),
}
"""The library's function and its options by our name of the format: `read_` takes a path, `from_` a
data set."""

_MOST_VALUES = 3e8  # densities of one file: 2.4 GB


def read_with_library(path: str, name: str) -> RawRecords:
    """Read a file of one format of :data:`FORMATS`, or `netcdf` to find out which one it is.

    Raises InputError if the extra `waves` is not installed, or the file cannot be read.
    """
    try:
        importlib.import_module("wavespectra")
    except ImportError:
        shown = FORMATS.get(name, "NetCDF")
        raise InputError(
            f"{path}: reading {shown} needs the library wavespectra: {how_to_install('waves')}"
        ) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what is read, the quality control tells
        try:
            with _unpacked(path) as plain:
                if _READERS.get(name, ("", {}))[0].startswith("read_"):
                    return _raw(_read(name, plain), name)
                return _netcdf(plain, name)
        except InputError as error:
            words = str(error).removeprefix(f"{path}: ")
        except (Exception, SystemExit) as error:  # the library has no family of its own
            words = (
                f"cannot be read as {FORMATS.get(name, 'NetCDF')}; it is cut off, damaged or "
                f"something else ({type(error).__name__}: {_short(error)})"
            )
        # Out here nothing holds on to the library's frames: a file it left open is closed while
        # the warnings about that are still off.
        raise InputError(f"{path}: {words}")


@contextlib.contextmanager
def _unpacked(path: str) -> Iterator[str]:
    """Yield the path of the file, or of an unpacked copy of one that is packed with gzip."""
    check_file(path)
    with open(path, "rb") as file:
        packed = file.read(2) == GZIP
    if not packed:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="stillhook-") as folder:
        copy = Path(folder, Path(path).name.removesuffix(".gz"))
        copy.write_bytes(read_bytes(path))
        yield str(copy)


def _read(name: str, source: Any) -> Any:
    """Return what the library makes of a path or a data set."""
    function, options = _READERS[name]
    module = function.partition("_")[2]
    found = getattr(importlib.import_module(f"wavespectra.input.{module}"), function)
    return found(source, **options)


def _netcdf(path: str, name: str) -> RawRecords:
    import xarray as xr

    check_hdf5(path)
    with xr.open_dataset(path) as dataset:
        name = _kind_of(dataset, name)
        size = max((int(one.size) for one in dataset.data_vars.values()), default=0)
        if size > _MOST_VALUES:
            raise InputError(
                f"holds {size:.3g} values; at most {_MOST_VALUES:.0e} are read at once: cut out "
                "the place or the years that matter"
            )
        loaded = dataset.load()
        if name in _READERS:
            found = _read(name, loaded)
            if name == "ndbc-netcdf" and "mean_wave_dir" in loaded:
                bearing = loaded["mean_wave_dir"]
                ours = {"frequency": "freq", "latitude": "lat", "longitude": "lon"}
                found["dmf"] = bearing.rename({k: v for k, v in ours.items() if k in bearing.dims})
            return _raw(found, name)
        return _raw(loaded, name)


def _kind_of(dataset: Any, asked: str) -> str:
    """Tell the format of a NetCDF file by its variables; a format asked for has to be that."""
    names = {str(name) for name in (*dataset.variables, *dataset.dims)}
    alike: set[str] = set()
    if names & {"spectral_wave_density", "waveEnergyDensity"}:
        alike = {"ndbc-netcdf"}
    elif "d2fd" in names:
        alike = {"era5"}
    elif "efth" in names:
        alike = {"wavespectra"} if "freq" in names else {"ww3"}
    elif "AC" in names:
        alike = {"wwm"}
    elif names & {"density", "energy"} and names & {"frequency", "freq"}:
        alike = {"swan-netcdf"}
    if asked in alike or (asked == "netcdf" and alike):
        return alike.pop()
    held = ", ".join(sorted(names)[:12])
    if alike:
        raise InputError(f"is {FORMATS[alike.pop()]}, not {FORMATS[asked]}; it has {held:.120}")
    raise InputError(
        f"is NetCDF but holds no wave spectra that are known here; it has {held!r:.120}"
    )


def _raw(dataset: Any, name: str) -> RawRecords:
    """Turn the library's labelled arrays into ours: every place and time is a record."""
    efth = dataset["efth"]
    if "freq" not in efth.dims:
        raise InputError(f"holds no frequencies, only {', '.join(map(str, efth.dims))}")
    notes = []
    efth = efth.sortby("freq")
    direction = None
    spectral = ["freq", *(["dir"] if "dir" in efth.dims else [])]
    other = [str(dim) for dim in efth.dims if dim not in spectral]
    if efth.size > _MOST_VALUES:
        raise InputError(f"holds {efth.size:.3g} values; at most {_MOST_VALUES:.0e} are read")
    whole = efth.transpose(*other, *spectral)
    values = np.asarray(whole.values, dtype=np.float64)
    frequency = np.asarray(efth["freq"].values, dtype=np.float64)
    if "dir" in spectral:
        degrees = np.asarray(efth["dir"].values, dtype=np.float64)
        values, direction = _over_directions(values, degrees, frequency)
        notes.append("directional spectra, summed over directions")
    shape = values.shape[:-1]
    count = int(np.prod(shape)) if shape else 1
    density = values.reshape(count, values.shape[-1])
    if direction is not None:
        direction = direction.reshape(count)
    elif "dmf" in dataset and set(dataset["dmf"].dims) == {*other, "freq"}:
        bearing = dataset["dmf"].sortby("freq").transpose(*other, "freq")
        by_frequency = bearing.values.reshape(count, -1)
        direction = _mean_direction(density, by_frequency, frequency)
    time = np.full(count, "NaT", dtype="datetime64[s]")
    if "time" in efth.coords:
        column = whole["time"]
        spread = column.broadcast_like(whole.isel(dict.fromkeys(spectral, 0)))
        time = spread.transpose(*other).values.reshape(count).astype("datetime64[s]")
    places = [dim for dim in other if dim != "time"]
    place: tuple[str, ...] = ()
    if any(whole.sizes[dim] > 1 for dim in places):
        index = np.indices(shape).reshape(len(shape), count)
        at = [other.index(dim) for dim in places]
        place = tuple(", ".join(f"{other[k]} {index[k, i]}" for k in at) for i in range(count))
        notes.append(f"records of {int(np.prod([whole.sizes[dim] for dim in places]))} places")
    return RawRecords(
        file_format=FORMATS[name],
        time=time,
        frequency=frequency,
        density=density,
        direction=direction,
        place=place,
        notes=tuple(notes),
    )


def _over_directions(
    values: FloatArray, degrees: FloatArray, frequency: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sum (..., k, d) over directions [deg]; return densities and the mean direction [deg]."""
    if degrees.size == 1:
        return values[..., 0], np.full(values.shape[:-2], np.nan)
    gaps = np.diff(np.sort(np.mod(degrees, 360.0)))
    width = 360.0 / degrees.size
    if np.any(np.abs(gaps - width) > 0.02 * width):
        width = float(np.median(gaps))
        if np.any(np.abs(gaps - width) > 0.02 * width):
            raise InputError("holds directions that are not evenly spaced")
    total = values.sum(axis=-1) * width
    angle = np.radians(degrees)
    return total, _bearing(values @ np.sin(angle), values @ np.cos(angle), frequency)


def _mean_direction(
    density: FloatArray, degrees: npt.ArrayLike, frequency: FloatArray
) -> FloatArray:
    """Return the mean direction of spectra with a direction at each frequency [deg]."""
    angle = np.radians(np.asarray(degrees, dtype=np.float64))
    east, north = density * np.sin(angle), density * np.cos(angle)
    return _bearing(np.nan_to_num(east), np.nan_to_num(north), frequency)


def _bearing(east: FloatArray, north: FloatArray, frequency: FloatArray) -> FloatArray:
    """Return the direction of the components' integrals over frequency [deg]."""
    angle = np.arctan2(
        np.trapezoid(east, frequency, axis=-1), np.trapezoid(north, frequency, axis=-1)
    )
    return np.asarray(np.mod(np.degrees(angle), 360.0))


def _short(error: BaseException) -> str:
    text = " ".join(str(error).split()) or "no reason given"
    return text if len(text) <= 120 else f"{text[:117]}..."
