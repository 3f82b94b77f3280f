"""The results of a small sweep in one NetCDF file, rewritten as a whole now and then.

    CaseResult --> put --> result.nc (under another name, then renamed) --> what is there already

For some thousands of cases; `stillhook.sweeps.store` is for more.  The file is always whole: a
driver that was killed loses what was done since it was last written, half a minute at most.
"""

from __future__ import annotations

import json
import time as clock
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import InputError, replace_atomically

from .header import ATTRIBUTE, FORMAT, differences
from .time_metrics import STATUS

if TYPE_CHECKING:
    import xarray as xr

_SUM = "stillhook_check_sum"
_OFTEN = 30.0  # between two writes [s]


class NetcdfStore:
    """Results in a NetCDF file; a context manager that writes what is left.

    Parameters
    ----------
    path
        The file; it is made if there is none.
    template
        The result with nothing in it yet, as for `Store`.

    Raises
    ------
    InputError
        If the file holds another sweep, something that is none, or is spoilt; or cannot be
        written.
    """

    def __init__(self, path: str | Path, template: xr.Dataset) -> None:
        self._path, self._template = Path(path), template
        self._names = tuple(str(name) for name in template.data_vars)
        self._values = {name: template[name].to_numpy().copy() for name in self._names}
        self._written, self._changed = clock.monotonic(), False
        if self._path.exists():
            self._load()
        else:
            self._changed = True
            self.flush()  # what cannot be written is known before the first case is run

    @property
    def done(self) -> npt.NDArray[np.bool_]:
        """Which cases are there (n,)."""
        return np.asarray(self._values["status"] != STATUS["not run"])

    def put(self, index: int, row: Mapping[str, float]) -> None:
        """Keep the numbers of a case, by variable."""
        for name, value in row.items():
            self._values[name][index] = value
        self._changed = True
        if clock.monotonic() - self._written > _OFTEN:
            self.flush()

    def flush(self) -> None:
        """Write the file, if anything is new."""
        if not self._changed:
            return
        whole = self.dataset().assign_attrs({_SUM: _check_sum(self._values)})
        replace_atomically(self._path, lambda place: whole.to_netcdf(place, engine="h5netcdf"))
        self._written, self._changed = clock.monotonic(), False

    def dataset(self) -> xr.Dataset:
        """Return the results so far."""
        own = self._template
        return own.assign(
            {name: (own[name].dims, v.copy(), own[name].attrs) for name, v in self._values.items()}
        )

    def __enter__(self) -> NetcdfStore:
        """Return the store."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Write what is left."""
        self.flush()

    def _load(self) -> None:
        import xarray as xr

        asked = json.loads(self._template.attrs[ATTRIBUTE])
        try:
            with xr.open_dataset(self._path, engine="h5netcdf") as opened:
                there = opened.load()
            header = json.loads(there.attrs[ATTRIBUTE])
            known = header["format"] == FORMAT
        except Exception as error:  # whatever a reader makes of what is no result
            raise InputError(
                f"{self._path}: is not a sweep that this version of Stillhook has written "
                f"({type(error).__name__}); take another file"
            ) from None
        changed = differences(header, asked) if known else ["its format is another"]
        if changed:
            raise InputError(
                f"{self._path}: holds another sweep: {'; '.join(changed)}; take another file, or "
                "remove it"
            )
        found = {name: there[name].to_numpy() for name in self._names if name in there}
        if len(found) < len(self._names) or _check_sum(found) != there.attrs.get(_SUM):
            raise InputError(
                f"{self._path}: is spoilt: it is not as it was written; take another file, or "
                "remove it"
            )
        for name, values in found.items():
            self._values[name][:] = values


def _check_sum(values: Mapping[str, npt.NDArray[Any]]) -> int:
    total = 0
    for name in sorted(values):
        little = np.ascontiguousarray(values[name], values[name].dtype.newbyteorder("<"))
        total = zlib.crc32(name.encode() + b"\0" + little.tobytes(), total)
    return total
