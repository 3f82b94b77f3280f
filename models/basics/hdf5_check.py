"""A trial reading of HDF5 files (NetCDF 4 is one) in a process of its own.

The HDF5 library trusts what is in a file: a few changed bytes can send it into an endless loop or
end the process, and neither can be caught from inside.  So a file is read through once by a child
process with a time limit, before anybody opens it here.  That costs a few tenths of a second.
"""

import subprocess
import sys
from pathlib import Path

from .checks import InputError

HDF5 = b"\x89HDF\r\n\x1a\n"  #: How an HDF5 file begins.

_SECONDS = 10.0
_BYTES_PER_SECOND = 5e6  # of patience with a large file

# Attributes first: they are what loops.  A part of a large variable would not do: each of its
# chunks can be damaged.
_READ_THROUGH = """
import sys
import h5py
def look(name, item):
    for key in item.attrs:
        item.attrs[key]
    if isinstance(item, h5py.Dataset) and item.shape is not None:
        if item.size > 2_000_000_000:
            raise MemoryError("a variable of %d values" % item.size)
        if not item.shape:
            item[()]
        else:
            rows = max(1, int(2e6 // max(1, item.size // max(1, item.shape[0]))))
            for first in range(0, item.shape[0], rows):
                item[first : first + rows]
try:
    with h5py.File(sys.argv[1], "r") as file:
        look("/", file)
        file.visititems(look)
except Exception as error:
    print(type(error).__name__ + ": " + " ".join(str(error).split())[:120])
    sys.exit(1)
"""


def check_hdf5(path: str | Path) -> None:
    """Read an HDF5 file through in a child process; other files are left alone.

    It has 10 s for that, and 0.2 s more for each MB.

    Raises InputError if the file is damaged, or reading it does not end.
    """
    place = Path(path)
    try:
        with open(place, "rb") as file:
            if file.read(len(HDF5)) != HDF5:
                return
        limit = _SECONDS + place.stat().st_size / _BYTES_PER_SECOND
    except OSError:
        return  # whoever opens it says why it cannot be
    command = [sys.executable, "-I", "-c", _READ_THROUGH, str(place)]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired:
        raise InputError(
            f"{path}: is a damaged HDF5 file: reading it does not end ({limit:.0f} s)"
        ) from None
    if done.returncode != 0:
        told = done.stdout.decode(errors="replace").strip() or "the HDF5 library broke down"
        raise InputError(f"{path}: is a damaged HDF5 file ({told})")
