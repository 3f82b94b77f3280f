"""Files that only grow: a line for each result, with a check sum, written by one process at a time.

The comparison's store and the sweeps' journal keep what was computed in such files and refuse a
file that answers another question; this is what both need for that.
"""

from __future__ import annotations

import os
import zlib
from pathlib import Path
from typing import BinaryIO

from models.basics import InputError


def lock(file: BinaryIO, place: Path, what: str) -> None:
    """Keep other processes out; the system lets go when this one ends, however it does.

    Parameters
    ----------
    file
        The open file.
    place, what
        What to name in the message, and what the file keeps.

    Raises
    ------
    InputError
        If another process has it.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise InputError(
            f"{place}: another process writes this {what}; wait for it, or take another folder"
        ) from None


def put(file: BinaryIO, path: Path, text: str) -> None:
    """Append a JSON text with its check sum, and see that it is on the disk.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    try:
        file.write(f'{{"crc": {zlib.crc32(text.encode())}, "of": {text}}}\n'.encode())
        file.flush()
        os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def difference(key: str, there: object, asked: object) -> str:
    """Return how an entry of a file differs from what is asked; empty if it does not."""
    if there == asked:
        return ""
    if isinstance(there, dict) and isinstance(asked, dict):
        for name in sorted({*there, *asked}):
            text = difference(f"{key}.{name}", there.get(name), asked.get(name))
            if text:
                return text
    return f"{key} is {_short(there)}, not {_short(asked)}"


def _short(value: object) -> str:
    text = "not given" if value is None or value == {} else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
