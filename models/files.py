"""Writing files so that nobody ever sees half of one."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from .checks import InputError

__all__ = ["write_text_atomically"]


def write_text_atomically(path: str | Path, text: str) -> Path:
    """Write a text file under a temporary name beside it, then rename.

    An interrupted run leaves the old file or the new one, and nothing between.

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
        If the folder does not exist or cannot be written to.
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        os.replace(temporary, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return target
