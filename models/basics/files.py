"""Files: read whole, plain or packed with gzip; written atomically; and the cache folder."""

import contextlib
import gzip
import os
import stat
import sys
import threading
import zlib
from collections.abc import Callable
from pathlib import Path

from .checks import InputError

_LARGEST = 500_000_000  # bytes: what still fits in memory several times over
GZIP = b"\x1f\x8b"  #: How a file that is packed with gzip begins.

# How files begin that people have beside the right one, and what they are called.
_BINARIES = (
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"GIF8", "a picture (GIF)"),
    (b"II*\x00", "a picture (TIFF)"),
    (b"MM\x00*", "a picture (TIFF)"),
    (b"%PDF", "a PDF document"),
    (b"\xd0\xcf\x11\xe0", "an old Office file (.xls, .doc): save the table as CSV"),
    (b"{\\rtf", "a text with formatting (.rtf): save it as plain text"),
    (b"\xff\xfe", "a text in UTF-16: save it as UTF-8"),
    (b"\xfe\xff", "a text in UTF-16: save it as UTF-8"),
    (b"\x89HDF", "an HDF5 or NetCDF file"),
    (b"CDF", "a NetCDF file"),
    (b"MATLAB", "a MATLAB file (.mat)"),
    (b"\x93NUMPY", "an array of numpy (.npy)"),
    (b"SQLite format 3", "a database (SQLite)"),
    (b"PAR1", "a table in Parquet"),
    (b"Rar!", "an archive (.rar): unpack it"),
    (b"7z\xbc\xaf", "an archive (.7z): unpack it"),
    (b"BZh", "packed with bzip2: unpack it"),
    (b"\xfd7zXZ", "packed with xz: unpack it"),
    (b"\x7fELF", "a program"),
)
_ZIP = b"PK\x03\x04"
_ZIPPED = (
    (b"xl/", "an Excel workbook (.xlsx): save the sheet as CSV"),
    (b"word/", "a Word document (.docx): save it as plain text"),
    (b"opendocument.spreadsheet", "a spreadsheet (.ods): save the sheet as CSV"),
    (b".npy", "arrays of numpy (.npz)"),
)


def file_stamp(path: str | Path) -> tuple[int, int]:
    """Return when a file was changed [ns] and its size, as a key for what was read from it.

    Zeros where there is no such file: whoever reads it says what is wrong.
    """
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return 0, 0
    return found.st_mtime_ns, found.st_size


def check_file(path: str | Path, largest: int = _LARGEST) -> None:
    """Check that a path is a regular file of so many bytes at most, before anybody opens it.

    A device or a pipe has no size and may have no end.

    Raises InputError if it is something else, larger, or not there.
    """
    try:
        found = Path(path).stat()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read: {why}") from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path}: is a folder; a file is wanted")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path}: is a device or a pipe; a file is wanted")
    if found.st_size > largest:
        raise InputError(
            f"{path}: must be at most {largest / 1e6:g} MB, got {found.st_size / 1e6:.3g} MB"
        )


def read_bytes(path: str | Path, largest: int = _LARGEST) -> bytes:
    """Return the contents of a file, unpacked where it is packed with gzip.

    Raises InputError if there is no such file, it is no regular one, has more bytes than `largest`,
    packed or unpacked, or is cut off.
    """
    check_file(path, largest)
    place = Path(path)
    try:
        raw = place.read_bytes()
    except (OSError, ValueError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read: {why}") from None
    if not raw.startswith(GZIP):
        return raw
    try:
        with gzip.open(place) as file:
            unpacked = file.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: the gzip packing is broken: {error}") from None
    if len(unpacked) > largest:
        raise InputError(f"{path}: must be at most {largest / 1e6:g} MB when unpacked")
    return unpacked


def binary_name(data: bytes) -> str:
    """Return what a file is that holds no text, by how it begins; nothing if that is not known.

    Examples
    --------
    >>> binary_name(b"%PDF-1.7 ..."), binary_name(b"sea: {}")
    ('a PDF document', '')
    """
    if stl_facets(data):
        return "a binary STL file: meshes of hulls go to `stillhook vessel hull --mesh`"
    if data.startswith(_ZIP):
        return next(
            (name for mark, name in _ZIPPED if mark in data), "an archive (.zip): unpack it"
        )
    return next((name for mark, name in _BINARIES if data.startswith(mark)), "")


def stl_facets(data: bytes) -> int:
    """Return how many facets a binary STL file has, 0 for what is none.

    Its header is anything, so that only the count tells it, which must fit the length.
    """
    count = int.from_bytes(data[80:84], "little")
    return count if len(data) == 84 + 50 * count else 0


def read_text(path: str | Path, largest: int = _LARGEST) -> str:
    """Return the contents of a text file in UTF-8 or ASCII, of so many bytes at most.

    Raises InputError if it cannot be read, or is no text.
    """
    raw = read_bytes(path, largest)
    name = binary_name(raw)
    if name:
        raise InputError(f"{path}: is no text file, but {name}")
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

    Raises InputError if the folder does not exist, cannot be written to, or is full, or there is a
    device or a pipe of that name.
    """
    target = Path(path)
    if os.path.exists(target) and not (os.path.isfile(target) or os.path.isdir(target)):
        raise InputError(f"{target}: cannot be written: is a device or a pipe")
    own = f"{os.getpid()}-{threading.get_ident()}"  # two may write the same file at once
    temporary = target.with_name(f".{target.name}.{own}.tmp")
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
