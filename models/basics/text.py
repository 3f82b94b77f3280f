"""Text files of seas, plain or packed with gzip, read with our words when they cannot be."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

from .checks import InputError
from .files import reason

_LARGEST = 500_000_000  # bytes: what still fits in memory several times over
GZIP = b"\x1f\x8b"
"""How a file that is packed with gzip begins."""


def read_bytes(path: str | Path) -> bytes:
    """Return the contents of a file, unpacked where it is packed with gzip.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, is too large or is cut off.
    """
    place = Path(path)
    try:
        if place.stat().st_size > _LARGEST:
            raise InputError(f"{path}: must be at most {_LARGEST // 10**6} MB")
        raw = place.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; a file is wanted") from None
    except (OSError, ValueError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read: {why}") from None
    if not raw.startswith(GZIP):
        return raw
    try:
        with gzip.open(place) as file:
            unpacked = file.read(_LARGEST + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: the gzip packing is broken: {error}") from None
    if len(unpacked) > _LARGEST:
        raise InputError(f"{path}: must be at most {_LARGEST // 10**6} MB when unpacked")
    return unpacked


def read_text(path: str | Path) -> str:
    """Return the contents of a text file in UTF-8 or ASCII.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.
    """
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not a text file (byte {error.start})") from None
    if "\0" in text:
        raise InputError(f"{path}: is not a text file (it holds a zero byte)")
    return text
