"""RAOs as NetCDF: the project's own file, labelled for xarray and others.

Dimensions omega [rad/s], heading [rad] and mode; two variables, the real and the imaginary part;
everything else an attribute.  Reads back to the last digit.  The NetCDF files of Capytaine are
another matter, see :mod:`models.vessel.readers.capytaine_file`.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...basics import InputError, check_range, replace_atomically
from ..assemble import decoded
from ..raos import MODES, VesselRaos

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "Stillhook RAOs, version 1"

_VARIABLES = ("omega", "heading", "mode", "rao_real", "rao_imag")


def to_dataset(raos: VesselRaos) -> xr.Dataset:
    """Return a table as a labelled data set."""
    import xarray as xr

    dims = ("omega", "heading", "mode")
    about = {"units": "m/m for surge, sway and heave, rad/m for roll, pitch and yaw"}
    return xr.Dataset(
        {
            "rao_real": (dims, raos.values.real, {"long_name": "motion per wave, real", **about}),
            "rao_imag": (
                dims,
                raos.values.imag,
                {"long_name": "motion per wave, imaginary", **about},
            ),
        },
        coords={
            "omega": ("omega", raos.omega, {"units": "rad/s", "long_name": "wave frequency"}),
            "heading": (
                "heading",
                raos.heading,
                {
                    "units": "rad",
                    "long_name": "where the waves travel towards, from the bow to port",
                },
            ),
            "mode": ("mode", list(MODES)),
        },
        attrs={
            "format": FORMAT,
            "name": raos.name,
            "source": raos.source,
            "origin": list(raos.origin),
            "phase_origin": list(raos.phase_origin),
            "depth": raos.depth,
            "speed": raos.speed,
            "notes": json.dumps(list(raos.notes)),
            "convention": "z up, x forward, y to port; time factor exp(+i omega t)",
        },
    )


def write_netcdf(path: str | Path, raos: VesselRaos) -> Path:
    """Write a table; an interrupted run leaves the old file or the new one."""
    data = to_dataset(raos)
    return replace_atomically(path, lambda place: data.to_netcdf(place, engine="h5netcdf"))


def parse_netcdf(owner: str, data: bytes) -> VesselRaos:
    """Return the table of a file that :func:`write_netcdf` made.

    It is read as the HDF5 file that it is, without the layers that label data sets: they are slow
    to import, and complain on their own when a damaged file cannot be opened.

    Raises InputError if it is another file.
    """
    import h5py  # type: ignore[import-untyped]

    with h5py.File(io.BytesIO(data), "r") as file:
        attrs = {key: file.attrs[key] for key in file.attrs}
        columns = {key: np.asarray(file[key][()]) for key in _VARIABLES}
    modes = [decoded(mode) for mode in columns["mode"].ravel()]
    if decoded(attrs.get("format", "")) != FORMAT or modes != list(MODES):
        raise InputError(f"{owner}: this is no NetCDF file of RAOs that Stillhook wrote")
    real, imag = (np.asarray(columns[key], dtype=np.float64) for key in ("rao_real", "rao_imag"))
    x, y, z = np.ravel(attrs["origin"]).tolist()
    px, py = np.ravel(attrs["phase_origin"]).tolist()
    return VesselRaos(
        name=decoded(attrs["name"]),
        omega=np.asarray(columns["omega"], dtype=np.float64),
        heading=np.asarray(columns["heading"], dtype=np.float64),
        values=real + 1j * imag,
        origin=(x, y, z),
        phase_origin=(px, py),
        depth=float(np.ravel(attrs["depth"])[0]),
        speed=check_range(owner, "speed", np.ravel(attrs["speed"])[0]),
        source=decoded(attrs["source"]),
        notes=tuple(str(note) for note in json.loads(decoded(attrs["notes"]))),
    )


def is_ours(data: bytes) -> bool:
    """Say whether an HDF5 file says that it is the project's own."""
    import h5py

    with h5py.File(io.BytesIO(data), "r") as found:
        return decoded(found.attrs.get("format", "")) == FORMAT
