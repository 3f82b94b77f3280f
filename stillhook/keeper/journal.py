"""What was written into a store, line by line: a crash leaves at most one half line at the end.

Each line is JSON with a check sum of its own and is on the disk before anything else happens.  The
first says whose journal it is; then each piece of the store has a line "begin" before it is written
and one "end" with the check sum of its content after.  So a piece whose last line is "begin" was
cut short and is computed again, and one that is not as its last "end" says was spoilt by somebody.
"""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from models.basics import InputError

from .kept_lines import lock, put


class Journal:
    """A journal on disk; a context manager that closes the file.

    Parameters
    ----------
    path
        The file; it is made if there is none.
    identity
        Of the store that it belongs to.

    Raises
    ------
    InputError
        If it belongs to another store, is spoilt, is being written by another process, or cannot
        be written.
    """

    def __init__(self, path: Path, identity: str) -> None:
        self.path = path
        self.sums: dict[int, int] = {}
        self.torn: set[int] = set()
        try:
            self._file: BinaryIO = open(path, "a+b")  # noqa: SIM115
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        try:
            lock(self._file, self.path.parent, "sweep")
            self._read(identity)
        except BaseException:
            self._file.close()
            raise

    def begin(self, piece: int) -> None:
        """Say that a piece is about to be written."""
        put(self._file, self.path, json.dumps({"begin": piece}))
        self.torn.add(piece)

    def end(self, piece: int, check_sum: int) -> None:
        """Say that a piece is written, and what the check sum of its content is."""
        put(self._file, self.path, json.dumps({"end": piece, "sum": check_sum}))
        self.torn.discard(piece)
        self.sums[piece] = check_sum

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Journal:
        """Return the journal."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def _read(self, identity: str) -> None:
        self._file.seek(0)
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            start = b'{"crc": '
            rest = data[whole:]
            if not (rest.startswith(start) or start.startswith(rest)):
                raise self._spoilt(data[:whole].count(b"\n") + 1)
            self._file.truncate(whole)
        lines = data[:whole].splitlines()
        if not lines:
            put(self._file, self.path, json.dumps({"sweep": identity}))
            return
        for number, line in enumerate(lines, 1):
            content = self._content(line, number)
            if number == 1:
                if content.get("sweep") != identity:
                    raise InputError(
                        f"{self.path}: is the journal of another sweep than the results beside "
                        "it; take another folder"
                    )
            elif "begin" in content:
                self.torn.add(int(content["begin"]))
            elif "end" in content:
                self.torn.discard(int(content["end"]))
                self.sums[int(content["end"])] = int(content["sum"])
            else:
                raise self._spoilt(number)

    def _content(self, line: bytes, number: int) -> dict[str, Any]:
        try:
            read = json.loads(line)
            content = read["of"]
            sound = isinstance(content, dict)
            sound = sound and zlib.crc32(json.dumps(content).encode()) == read["crc"]
        except (ValueError, KeyError, TypeError):
            sound, content = False, {}
        if not sound:
            raise self._spoilt(number)
        return dict(content)

    def _spoilt(self, number: int) -> InputError:
        return InputError(
            f"{self.path}: line {number} is not as it was written: the journal is spoilt; take "
            "another folder"
        )
