"""A Capytaine NetCDF as arrays with known axes, whatever order and names they came in.

Capytaine's files differ from version to version: the frequency axis may be omega, freq, period,
wavelength or wavenumber; complex numbers are pairs along an axis `complex`; degrees of freedom
stand in any order, with or without the name of their body; water depth, density and speed are
axes or single numbers.  Here all that is settled, and nothing is computed yet.
"""

import io
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ...basics import GRAVITY, FloatArray, InputError, wave_frequency
from ..assemble import decoded

LARGEST = 20_000_000
"""Most numbers in a variable that is read; Capytaine's files have some ten thousand."""

_FREQUENCIES = ("omega", "freq", "period", "wavenumber", "wavelength")
_DOFS = ("influenced_dof", "radiating_dof")
_SINGLES = {"water_depth": "m", "rho": "kg/m3", "g": "m/s2", "forward_speed": "m/s"}


class CapytaineData:
    """An open dataset, read whole into memory from its bytes; messages call it `owner`.

    HDF5 is known to be readable by :func:`models.basics.hdf5_check.check_hdf5`; `chosen` is the
    value to take where the file holds several water depths or forward speeds.

    Raises InputError if it is no NetCDF, is damaged, or is not one of Capytaine's.
    """

    def __init__(
        self, owner: str, data: bytes, chosen: Mapping[str, float | None] | None = None
    ) -> None:
        self.owner = owner
        dataset = _opened(owner, data)
        known = {"added_mass", "radiation_damping", "RAO", "rao", "diffraction_force"}
        if not known & {str(v) for v in dataset.variables}:
            raise InputError(
                f"{owner}: this NetCDF is not one of Capytaine's: none of its variables is "
                f"{', '.join(sorted(known))}; it has {_listed(dataset.variables)}"
            )
        told = str(dataset.attrs.get("incoming_waves_convention", "Nemoh"))
        if told.lower() != "nemoh":
            raise InputError(
                f"{owner}: incoming_waves_convention must be Nemoh, e^(-i omega t), got {told!r}"
            )
        self.version = str(dataset.attrs.get("capytaine_version", "of unknown version"))
        for name, unit in _SINGLES.items():
            dataset = self._single(dataset, name, unit, (chosen or {}).get(name))
        self._dataset = dataset
        self._axis, self.omega = self._frequencies()

    def _single(self, dataset: Any, name: str, unit: str, chosen: float | None) -> Any:
        """Return the dataset with one value along an axis that may have several."""
        if name not in dataset.dims:
            return dataset
        size = int(dataset.sizes[name])
        if size == 1:
            return dataset.isel({name: 0})
        if name not in dataset.coords:
            raise InputError(f"{self.owner}: the axis {name} has no values")
        values = np.asarray(dataset[name].values, dtype=np.float64)
        told = ", ".join(f"{v:g}" for v in values[:12])
        if chosen is None:
            raise InputError(
                f"{self.owner}: the file holds {size} values of {name} ({told} {unit}); say which"
            )
        near = np.flatnonzero(np.isclose(values, chosen, rtol=1e-6, atol=1e-9) | (values == chosen))
        if not near.size:
            raise InputError(
                f"{self.owner}: {name} must be one of {told} {unit}, got {chosen:g} {unit}"
            )
        return dataset.isel({name: int(near[0])})

    def number(self, name: str) -> float | None:
        """Return a single number, such as `water_depth`, or nothing where it is not told."""
        if name not in self._dataset.variables:
            return None
        try:
            value = np.asarray(self._dataset[name].values, dtype=np.float64)
        except (TypeError, ValueError):
            value = np.array([math.nan])
        if value.size != 1 or np.isnan(value).any():
            raise InputError(f"{self.owner}: {name} must be a number, got {_short(value)}")
        return float(value.reshape(-1)[0])

    def place(self, name: str) -> tuple[float, float, float] | None:
        """Return a point, such as `rotation_center`, or nothing where it is not told."""
        if name not in self._dataset.variables:
            return None
        try:
            value = np.asarray(self._dataset[name].values, dtype=np.float64).reshape(-1)
        except (TypeError, ValueError):
            return None
        if value.size != 3 or not np.all(np.isfinite(value)):
            return None  # of several bodies, or of one without
        return float(value[0]), float(value[1]), float(value[2])

    def has(self, name: str) -> bool:
        """Return whether there is such a variable."""
        return name in self._dataset.variables

    def names(self) -> str:
        """Return the variables, for a message."""
        return _listed(self._dataset.variables)

    @cached_property
    def dofs(self) -> tuple[str, ...]:
        """The degrees of freedom, in the order that every table has them."""
        return self._along(next((a for a in _DOFS if a in self._dataset.coords), _DOFS[0]))

    def _along(self, axis: str) -> tuple[str, ...]:
        if axis not in self._dataset.coords:
            raise InputError(f"{self.owner}: there is no coordinate {axis}: {self.names()}")
        found = tuple(decoded(v) for v in np.atleast_1d(self._dataset[axis].values))
        if len(set(found)) != len(found):
            raise InputError(f"{self.owner}: {axis} names a degree of freedom twice: {found}")
        return found

    def headings(self) -> FloatArray:
        """Return the wave directions in the file's order (h,) [rad]."""
        if "wave_direction" not in self._dataset.coords:
            raise InputError(f"{self.owner}: there is no coordinate wave_direction: {self.names()}")
        found = self._floats(
            "wave_direction", np.atleast_1d(self._dataset["wave_direction"].values)
        )
        if not np.all(np.isfinite(found)) or np.any(np.abs(found) > 4.0 * math.pi):
            raise InputError(
                f"{self.owner}: wave_direction must be in radians, from -4 pi to 4 pi, got "
                f"{_short(found)}"
            )
        return found

    def table(self, name: str, axes: Sequence[str]) -> npt.NDArray[Any]:
        """Return a variable with its axes in a given order, degrees of freedom as in `dofs`.

        Of the wanted axes `frequency` stands for the file's own, `dof` for that of the motions.

        Raises InputError if the variable or an axis is missing, or has another axis beside those.
        """
        if not self.has(name):
            raise InputError(f"{self.owner}: the variable {name} is missing; it has {self.names()}")
        array = self._dataset[name]
        pairs = "complex" in array.dims
        own = next((axis for axis in reversed(_DOFS) if axis in array.dims), _DOFS[0])
        wanted = [{"frequency": self._axis, "dof": own}.get(axis, axis) for axis in axes]
        for axis in wanted:
            if axis not in array.dims and axis in array.coords:
                array = array.expand_dims(axis)
        allowed = {*wanted, "complex"}
        if not set(wanted) <= set(array.dims) or not set(array.dims) <= allowed:
            raise InputError(
                f"{self.owner}: {name} must have the axes {', '.join(wanted)}, got "
                f"{', '.join(str(d) for d in array.dims) or 'none'}"
            )
        for axis in _DOFS:
            if axis in wanted:
                order = self._along(axis)
                missing = [d for d in self.dofs if d not in order]
                if missing:
                    raise InputError(
                        f"{self.owner}: {name} lacks {', '.join(missing)} along {axis}, which has "
                        f"{', '.join(order)}"
                    )
                array = array.isel({axis: [order.index(d) for d in self.dofs]})
        array = array.transpose(*wanted, *(["complex"] if pairs else []))
        values = np.asarray(array.values)
        if pairs:
            values = self._paired(name, values)
        if values.dtype.kind not in "fciu":
            raise InputError(f"{self.owner}: {name} must be numbers, got {values.dtype}")
        return values.astype(np.complex128 if values.dtype.kind == "c" else np.float64)

    def _paired(self, name: str, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return complex numbers from pairs along the last axis."""
        labels = [decoded(v) for v in np.atleast_1d(self._dataset["complex"].values)]
        if sorted(labels) != ["im", "re"] or values.dtype.kind not in "fiu":
            raise InputError(f"{self.owner}: {name} must be pairs of re and im, got {labels}")
        real, imaginary = labels.index("re"), labels.index("im")
        return np.asarray(values[..., real] + 1j * values[..., imaginary])

    def _frequencies(self) -> tuple[str, FloatArray]:
        """Return the name of the frequency axis, and its values in the file's order [rad/s]."""
        d = self._dataset
        axis = next((name for name in _FREQUENCIES if name in d.dims), None)
        if axis is None:
            axis = "omega"
            if "omega" not in d.coords:
                raise InputError(
                    f"{self.owner}: there is no axis of frequencies: none of "
                    f"{', '.join(_FREQUENCIES)}"
                )
        if "omega" in d.variables and d["omega"].dims in ((axis,), ()):
            return axis, self._floats("omega", np.atleast_1d(d["omega"].values))
        if axis not in d.coords:
            raise InputError(f"{self.owner}: the axis {axis} has no values")
        values = self._floats(axis, d[axis].values)
        with np.errstate(divide="ignore", invalid="ignore"):
            if axis == "freq":
                return axis, 2.0 * math.pi * values
            if axis == "period":
                return axis, 2.0 * math.pi / values
            k = values if axis == "wavenumber" else 2.0 * math.pi / values
            depth = self.number("water_depth")
            depth = math.inf if depth is None else depth
            gravity = self.number("g") or GRAVITY
            return axis, math.sqrt(gravity / GRAVITY) * wave_frequency(k, depth)

    def _floats(self, name: str, values: Any) -> FloatArray:
        array = np.asarray(values)
        if array.dtype.kind not in "fiu" or array.ndim != 1:
            raise InputError(f"{self.owner}: {name} must be a row of numbers, got {_short(array)}")
        return array.astype(np.float64)


def _opened(owner: str, data: bytes) -> Any:
    """Return an xarray dataset in memory."""
    import xarray as xr

    if data[:4] == b"\x89HDF":
        engine = "h5netcdf"
    elif data[:3] == b"CDF":
        engine = "scipy"
    else:
        raise InputError(f"{owner}: this is no NetCDF file: it begins with {data[:8]!r}")
    with xr.open_dataset(io.BytesIO(data), engine=engine) as lazy:
        largest = max((int(v.size) for v in lazy.variables.values()), default=0)
        if largest > LARGEST:
            raise InputError(
                f"{owner}: a variable may have at most {LARGEST:g} numbers, got {largest:g}"
            )
        return lazy.load()


def _listed(names: Any) -> str:
    found = [str(n) for n in names]
    return ", ".join(found[:24]) + (", ..." if len(found) > 24 else "")


def _short(values: Any) -> str:
    text = " ".join(str(values).split())
    return text if len(text) < 80 else text[:77] + "..."
