"""The results of a sweep on disk, so that a driver that was killed goes on where it was.

    CaseResult --> put --> pieces of result.zarr + journal.jsonl --> open --> what is there already

A folder holds ``result.zarr``, which any tool that reads Zarr opens, and a journal of what was
written into it.  A piece (some tens to thousands of cases) is written when its cases are done, or
after half a minute with those that are; what a crash cut short is computed again.  The store says
in its attributes what question it answers; one that answers another, or was computed by other
code, or is not as it was written, is refused: nobody can say what else is wrong with it.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time as clock
import uuid
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from models.basics import BoolArray, InputError

from ..keeper import Journal
from ..text import OutputFolder
from .header import ATTRIBUTE, differences, read_header
from .time_metrics import STATUS

if TYPE_CHECKING:
    import xarray as xr


RESULT, JOURNAL = "result.zarr", "journal.jsonl"
_IDENTITY = "stillhook_store"
_OFTEN = 30.0  # between two writes of pieces that are not full [s]


def piece_of(samples: int) -> int:
    """Return how many cases make a piece: about a hundred pieces, 16 to 4096 cases each."""
    return int(min(4096, max(16, -(-samples // 100))))


class Store:
    """Results on disk; a context manager that writes what is left and closes.

    Parameters
    ----------
    folder
        The folder; it is made if there is none.
    template
        The result with nothing in it yet: coordinates, variables along "case", attributes with
        the header.

    Raises
    ------
    InputError
        If the folder holds another sweep, something that is none, or one that is spoilt; if
        another process writes it; or it cannot be written.
    """

    def __init__(self, folder: str | Path, template: xr.Dataset) -> None:
        self.folder = OutputFolder.prepare(folder).path
        self._path = self.folder / RESULT
        self._template = template
        self._names = tuple(str(name) for name in template.data_vars)
        self._n = template.sizes["case"]
        self._piece = piece_of(self._n)
        self._values = {name: template[name].to_numpy().copy() for name in self._names}
        self._dirty: set[int] = set()
        self._written = clock.monotonic()
        identity = self._open() if self._path.exists() else self._create()
        self._journal = Journal(self.folder / JOURNAL, identity)
        try:
            self._load()
        except BaseException:
            self._journal.close()
            raise

    @property
    def done(self) -> BoolArray:
        """Which cases are there (n,)."""
        return np.asarray(self._values["status"] != STATUS["not run"])

    def put(self, index: int, row: Mapping[str, float]) -> None:
        """Keep the numbers of a case, by variable."""
        for name, value in row.items():
            self._values[name][index] = value
        piece = index // self._piece
        self._dirty.add(piece)
        if (self._values["status"][self._span(piece)] != STATUS["not run"]).all():
            self._write(piece)
        elif clock.monotonic() - self._written > _OFTEN:
            self.flush()

    def flush(self) -> None:
        """Write everything that is not on disk yet."""
        for piece in sorted(self._dirty):
            self._write(piece)
        self._written = clock.monotonic()

    def dataset(self) -> xr.Dataset:
        """Return the results so far."""
        return self._template.assign(
            {
                name: (self._template[name].dims, values.copy(), self._template[name].attrs)
                for name, values in self._values.items()
            }
        )

    def close(self) -> None:
        """Write what is left, and let go of the folder."""
        try:
            self.flush()
        finally:
            self._journal.close()

    def __enter__(self) -> Store:
        """Return the store."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Write what is left, and let go of the folder."""
        self.close()

    def _span(self, piece: int) -> slice:
        return slice(piece * self._piece, min((piece + 1) * self._piece, self._n))

    def _create(self) -> str:
        """Write the empty store under another name, then rename it: it is there whole or not."""
        journal = self.folder / JOURNAL
        if journal.exists():
            raise InputError(
                f"{journal}: is there, but {RESULT} beside it is not; take another folder"
            )
        identity = uuid.uuid4().hex
        for left in self.folder.glob(f".{RESULT}.*.tmp"):  # by one that was killed at once
            shutil.rmtree(left, ignore_errors=True)
        temporary = self.folder / f".{RESULT}.{os.getpid()}.tmp"
        started = self._template.assign_attrs({_IDENTITY: identity})
        encoding = {name: {"chunks": (self._piece,)} for name in self._names}
        try:
            started.to_zarr(
                temporary, mode="w", consolidated=False, zarr_format=3, encoding=encoding
            )
            os.rename(temporary, self._path)
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written: {error.strerror}") from error
        finally:
            with contextlib.suppress(OSError):
                shutil.rmtree(temporary, ignore_errors=True)
        return identity

    def _open(self) -> str:
        """Check that the store there answers the same question; return whose it is."""
        there = read_header(self._path)
        asked = json.loads(self._template.attrs[ATTRIBUTE])
        changed = differences(there, asked)
        if changed:
            raise InputError(
                f"{self._path}: holds another sweep: {'; '.join(changed)}; take another folder, "
                "or remove it"
            )
        return str(self._group().attrs.get(_IDENTITY, ""))

    def _load(self) -> None:
        """Take the pieces that are as they were written."""
        group = self._group()
        try:
            same = all(
                np.array_equal(np.asarray(group[str(name)][:]), coordinate.to_numpy())
                for name, coordinate in self._template.coords.items()
            )
            found = {name: np.asarray(group[name][:]) for name in self._names}
        except Exception as error:  # whatever a reader makes of broken files
            raise self._spoilt(f"{type(error).__name__}: {error}") from error
        if not same:
            raise self._spoilt("the values that were varied are not those of its own question")
        if any(values.shape != (self._n,) for values in found.values()):
            raise self._spoilt("its variables do not have the length of its own question")
        for piece, wanted in self._journal.sums.items():
            if piece in self._journal.torn:
                continue  # it was being written when the driver ended
            span = self._span(piece)
            part = {name: found[name][span] for name in self._names}
            if _check_sum(part) != wanted:
                first, last = span.start, span.stop - 1
                raise self._spoilt(f"cases {first} to {last} are not as they were written")
            for name, values in part.items():
                self._values[name][span] = values

    def _write(self, piece: int) -> None:
        span = self._span(piece)
        part = {name: values[span] for name, values in self._values.items()}
        group = self._group()
        self._journal.begin(piece)
        try:
            for name, values in part.items():
                group[name][span] = values
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written: {error.strerror}") from error
        self._journal.end(piece, _check_sum(part))
        self._dirty.discard(piece)

    def _group(self) -> Any:
        import zarr

        try:
            return zarr.open_group(self._path, mode="r+")
        except Exception as error:
            raise self._spoilt(f"{type(error).__name__}: {error}") from error

    def _spoilt(self, why: str) -> InputError:
        return InputError(f"{self._path}: is spoilt: {why}; take another folder, or remove it")


def _check_sum(part: Mapping[str, npt.NDArray[Any]]) -> int:
    """Return the check sum of a piece, the same on every machine."""
    total = 0
    for name in sorted(part):
        little = np.ascontiguousarray(part[name]).astype(part[name].dtype.newbyteorder("<"))
        total = zlib.crc32(name.encode() + b"\0" + little.tobytes(), total)
    return total
