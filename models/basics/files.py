"""Files: read whole, plain or packed with gzip; written atomically; and the cache folder."""

import contextlib
import gzip
import os
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

from .checks import InputError

_LARGEST = 500_000_000  # bytes: what still fits in memory several times over
GZIP = b"\x1f\x8b"  #: How a file that is packed with gzip begins.


def file_stamp(path: str | Path) -> tuple[int, int]:
    """Return when a file was changed [ns] and its size, as a key for what was read from it.

    Zeros where there is no such file: whoever reads it says what is wrong.
    """
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return 0, 0
    return found.st_mtime_ns, found.st_size


def read_bytes(path: str | Path) -> bytes:
    """Return the contents of a file, unpacked where it is packed with gzip.

    Raises InputError if there is no such file, it is a folder, is too large or is cut off.
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

    Raises InputError if it cannot be read, or is no text.
    """
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not a text file (byte {error.start})") from None
    if "\0" in text:
        raise InputError(f"{path}: is not a text file (it holds a zero byte)")
    return text


def replace_atomically(path: str | Path, write: Callable[[Path], object]) -> Path:
    """Let `write` write a file under a temporary name beside it and close it, then rename.

    An interrupted run, or a full disk, leaves the old file or the new one, and nothing between.
    The folder of the file must exist.

    Raises InputError if the folder does not exist, cannot be written to, or is full.
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
    """Write a text as UTF-8 by :func:`replace_atomically`, and return the file written."""
    return replace_atomically(
        path, lambda place: place.write_text(text, encoding="utf-8", newline="\n")
    )


def keep_latest(folder: Path, pattern: str, count: int) -> None:
    """Remove the files of a folder that were longest unused, beyond so many."""
    with contextlib.suppress(OSError):
        found = sorted(folder.glob(pattern), key=lambda path: path.stat().st_mtime)
        for path in found[:-count]:
            path.unlink()


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
