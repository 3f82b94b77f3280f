"""Cache on disk of solved records, by the question that they answer.

Only the solver's answer is kept.  Whoever takes it out derives every number from it anew, its
certificate included, so that an entry that is corrupt, foreign or out of date is found out and
never believed.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from models.basics import FloatArray, InputError, reason, replace_atomically

from .problem import RecordSolution

FORMAT = 1  # of the entries; to be raised whenever the programme's meaning changes
_ARRAYS = ("start", "inputs", "window_prices", "tension_prices")


def fingerprint(options: Mapping[str, Any], *arrays: FloatArray) -> str:
    """Return a digest of everything that an answer hangs on."""
    text = json.dumps({"format": FORMAT, **options}, sort_keys=True, default=repr)
    digest = hashlib.sha256(text.encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    return digest.hexdigest()[:40]


def store_solution(folder: str | Path, key: str, solution: RecordSolution, drag: float) -> Path:
    """Write an entry, whole or not at all.

    Raises
    ------
    InputError
        If the folder cannot be made or written to.
    """
    path = _path(folder, key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path.parent}: cannot be made: {reason(error)}") from error
    values: dict[str, Any] = {name: getattr(solution, name) for name in _ARRAYS}
    about = {
        "content": _content(solution),
        "key": key,
        "format": FORMAT,
        "drag": drag,
        "iterations": solution.iterations,
    }
    values["about"] = np.array(json.dumps(about))

    def write(place: Path) -> None:
        with place.open("wb") as file:
            np.savez(file, **values)

    return replace_atomically(path, write)


def stored_solution(
    folder: str | Path, key: str, shapes: Mapping[str, tuple[int, ...]]
) -> tuple[RecordSolution, float] | None:
    """Return an entry and its drag, or None where there is none to trust.

    Parameters
    ----------
    folder, key
        Where, and the fingerprint.
    shapes
        Of the arrays, as the problem has them.

    Warns
    -----
    RuntimeWarning
        If there is an entry that cannot be read or is not what its name says.
    """
    path = _path(folder, key)
    if not path.exists():
        return None
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            arrays = {name: np.array(data[name], dtype=np.float64) for name in _ARRAYS}
        if about["key"] != key or about["format"] != FORMAT:
            raise ValueError("it is the answer to something else")
        for name, array in arrays.items():
            if array.shape != shapes[name] or not np.isfinite(array).all():
                raise ValueError(f"its {name} are not what the record asks for")
        solution = RecordSolution(iterations=int(about["iterations"]), **arrays)
        drag = float(about["drag"])
        if about["content"] != _content(solution) or not 0.0 <= drag < math.inf:
            raise ValueError("it was changed after it was written")
        return solution, drag
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        distrust(path, str(error))
        return None


def distrust(path: Path, why: str) -> None:
    """Warn of an entry that is put aside."""
    warnings.warn(
        f"{path}: not believed ({why}); the record is solved again", RuntimeWarning, stacklevel=2
    )


def _path(folder: str | Path, key: str) -> Path:
    return Path(folder) / f"clairvoyant-{key}.npz"


def _content(solution: RecordSolution) -> str:
    return fingerprint({}, *(getattr(solution, name) for name in _ARRAYS))
