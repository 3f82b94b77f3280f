"""Which code made a result: a digest of the toolkit's own, and the versions of what it stands on.

A store of results is only gone on with by the code that began it (`stillhook.sweeps.store`), and a
cluster's workers must have the driver's (`stillhook.keeper.cluster`): other code may give other
numbers, and a table of both would be worth nothing.
"""

from __future__ import annotations

import hashlib
import platform
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

_CODE = (
    "models/**/*.py",
    "synth/**/*.py",
    "mpc/**/*.py",
    "stillhook/runs/series.py",
    "stillhook/controllers/makers.py",
    "stillhook/sweeps/pilots.py",
    "stillhook/sweeps/t*.py",  # time_cases, time_metrics, trim
)
_NUMERICAL = ("numpy", "scipy", "casadi")


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Return a digest of the code that the numbers of a sweep hang on."""
    home = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted({path for pattern in _CODE for path in home.glob(pattern)}):
        name = path.relative_to(home).as_posix()
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def versions() -> dict[str, str]:
    """Return the versions of Stillhook, Python and the libraries that make the numbers."""
    from .._version import __version__

    found = {"stillhook": __version__, "code": code_digest()}
    found |= {name: version(name) for name in _NUMERICAL}
    return {**found, "python": platform.python_version()}
