"""Atomic writing of files, and the cache folder."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from pathlib import Path

from .checks import InputError


def replace_atomically(path: str | Path, write: Callable[[Path], object]) -> Path:
    """Let `write` write a file under a temporary name beside it, then rename.

    An interrupted run, or a full disk, leaves the old file or the new one, and nothing between.

    Parameters
    ----------
    path
        The file to write; its folder must exist.
    write
        Called once with the temporary path, which it has to write and close.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the folder does not exist, cannot be written to, or is full.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        write(temporary)
        os.replace(temporary, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return target


def reason(error: OSError) -> str:
    """Return what the system says, whatever a library between us and it made of that.

    Examples
    --------
    >>> reason(OSError(28, "Error writing bytes to file. Detail: [errno 28] ..."))
    'No space left on device'
    """
    return str(error) if error.errno is None else os.strerror(error.errno)


def write_text_atomically(path: str | Path, text: str) -> Path:
    """Write a text file under a temporary name beside it, then rename.

    Parameters
    ----------
    path
        The file to write; its folder must exist.
    text
        What to write, as UTF-8.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the folder does not exist, cannot be written to, or is full.
    """
    return replace_atomically(
        path, lambda place: place.write_text(text, encoding="utf-8", newline="\n")
    )


def cache_folder() -> Path:
    """Return the folder of what is kept from one run to the next; it need not exist yet.

    ``$STILLHOOK_CACHE`` if set; else the system's usual place for a user's cache.
    """
    given = os.environ.get("STILLHOOK_CACHE")
    if given:
        return Path(given).expanduser()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        given = os.environ.get("XDG_CACHE_HOME", "")
        base = Path(given) if os.path.isabs(given) else Path.home() / ".cache"
    return base / "stillhook"
