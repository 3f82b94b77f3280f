"""A cache of hydrodynamic coefficients: the same hull in the same waves is never solved twice.

A file per computation in the user's cache folder, under a digest of everything that the numbers
depend on: panels, frequencies, headings, point, depth, density, lid, and the versions of the
packages.  Mass and damping of roll are not among them, so that another loading of the same hull
costs nothing.  A file that is damaged or of another make is computed again, and one that cannot
be written is done without.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np

from ...basics import GRAVITY, FloatArray, InputError, cache_folder, replace_atomically
from .bem import Progress, solve_hull, versions
from .hull import Hull
from .hydrodynamics import Hydrodynamics

KEPT = 64
"""Computations kept; the ones longest unused go first."""

_ARRAYS = ("omega", "heading", "added_mass", "damping", "excitation")
_FORMAT = 3  # goes up when what is computed from the same inputs changes


def cached_hydrodynamics(
    hull: Hull,
    *,
    omega: FloatArray,
    heading: FloatArray,
    depth: float = math.inf,
    density: float,
    lid: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
    cache: bool = True,
) -> tuple[Hydrodynamics, bool]:
    """Return the coefficients of :func:`models.vessel.hull.bem.solve_hull`, and if they were kept.

    Parameters
    ----------
    hull, omega, heading, depth, density, lid, threads, progress
        As there.
    cache
        Whether to look into the cache and to add to it.
    """
    folder = cache_folder() / "hulls"
    inputs = {"depth": float(depth), "density": float(density), "lid": bool(lid)}
    name = f"{_digest(hull, omega, heading, inputs)}.npz"
    if cache:
        found = _read(folder / name)
        if found is not None:
            with contextlib.suppress(OSError):
                os.utime(folder / name)
            return found, True
    solved = solve_hull(
        hull,
        omega=omega,
        heading=heading,
        depth=depth,
        density=density,
        lid=lid,
        threads=threads,
        progress=progress,
    )
    if cache:
        with contextlib.suppress(OSError, InputError):
            folder.mkdir(parents=True, exist_ok=True)
            replace_atomically(folder / name, lambda place: _write(place, solved))
            _tidy(folder)
    return solved, False


def _digest(hull: Hull, omega: FloatArray, heading: FloatArray, inputs: Mapping[str, float]) -> str:
    """Return the digest of everything that the coefficients depend on."""
    words = json.dumps(
        {
            "format": _FORMAT,
            "hull": hull.digest,
            "point": [0.0, 0.0, 0.0],
            "gravity": GRAVITY,
            **inputs,
            "versions": versions(),
        },
        sort_keys=True,
    )
    found = hashlib.sha256(words.encode())
    for array in (omega, heading):
        found.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    return found.hexdigest()[:40]


def _write(place: Path, solved: Hydrodynamics) -> None:
    with place.open("wb") as file:  # by an open file: numpy would add its own ending to the name
        np.savez_compressed(file, **{f.name: getattr(solved, f.name) for f in fields(solved)})


def _read(place: Path) -> Hydrodynamics | None:
    """Return what is in a file of the cache, or nothing if it is not whole."""
    try:
        with place.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            x, y, z = file["point"].tolist()
            return Hydrodynamics(
                **{name: file[name] for name in _ARRAYS},
                point=(x, y, z),
                depth=float(file["depth"]),
                density=float(file["density"]),
            )
    except (OSError, ValueError, LookupError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _tidy(folder: Path) -> None:
    """Remove the computations longest unused."""
    kept = sorted(folder.glob("*.npz"), key=lambda p: p.stat().st_mtime, reverse=True)
    for path in kept[KEPT:]:
        with contextlib.suppress(OSError):
            path.unlink()
