"""Journals: append-only files of results, a checked line each (`Journal`).

    question; key, values --> Journal.add --> lines on disk --> Journal --> take(key, values)

The first line says what question the others answer, by which code; a journal that answers another
one, or that other code wrote, is refused.  A line has a check sum and is written at once.  One that
a crash cut short can only be the last, and is dropped; anything else that does not read as it was
written is refused, because nobody can say what else is wrong with it.
"""

from __future__ import annotations

import json
import math
import os
import re
import time as clock
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from models.basics import InputError, check_file

FORMAT = 2  #: Version of what stands in a line.

_BEGIN = b'{"crc": '
_LINE = re.compile(rb'\{"crc": (\d+), "of": (\{.*\})\}\n')
_LARGEST = 20_000_000_000  # bytes
_SYNC = 1.0  # a power failure may cost as much of the work [s]; a killed process costs none
_TOLD = "python"  # is told in the question, and may differ

Take = Callable[[Any, Any], None]


class Journal:
    """A journal of a "sweep" or a "comparison" on disk; a context manager that closes the file.

    The file is made if there is none.  The question that its results answer is plain data;
    "versions" are those of `versions`.  `take` is called with key and values of every result that
    is there.

    Raises InputError if the file is not such a journal, is spoilt, answers another question, was
    written by other code or is being written by another process, or cannot be written.
    """

    def __init__(self, path: Path, what: str, question: Mapping[str, Any], take: Take) -> None:
        self.path, self._what = path, what
        try:
            if path.exists():
                check_file(path, _LARGEST)
            self._file: BinaryIO = open(path, "a+b")  # noqa: SIM115
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror}") from error
        self._synced = -math.inf
        try:
            self._lock()
            self._file.seek(0)
            whole = 0
            for number, line in enumerate(self._file, 1):
                if not line.endswith(b"\n"):  # a crash cut it short: the last, and one of ours
                    if not (line.startswith(_BEGIN) or _BEGIN.startswith(line)):
                        raise _foreign(path, what) if number == 1 else _spoilt(path, number)
                    self._file.truncate(whole)
                    break
                self._read(number, line, question, take)
                whole += len(line)
            if not whole:
                self._put({"stillhook": what, "format": FORMAT, "question": question})
        except BaseException:
            self._file.close()
            raise

    def add(self, key: object, values: object) -> None:
        """Keep a result; what is not finite is written as a text, and read back as it was.

        Raises InputError if it cannot be written.
        """
        self._put({"key": key, "values": values})

    def close(self) -> None:
        """Close the file, all of it on the disk."""
        try:
            self._sync()
        finally:
            self._file.close()

    def __enter__(self) -> Journal:
        """Return the journal."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the file."""
        self.close()

    def _read(self, number: int, line: bytes, question: Mapping[str, Any], take: Take) -> None:
        content = _content(line)
        if number == 1:
            changed = differences(_question(self.path, self._what, line), _plain(question))
            if changed:
                raise InputError(
                    f"{self.path}: holds another {self._what}: {'; '.join(changed)}; take another "
                    "folder, or remove the file"
                )
            return
        if content is None:
            raise _spoilt(self.path, number)
        try:
            take(_numbers(content["key"]), _numbers(content["values"]))
        except (TypeError, KeyError, ValueError, IndexError) as error:
            raise InputError(f"{self.path}: line {number} is no result ({error})") from None

    def _put(self, content: Mapping[str, Any]) -> None:
        text = json.dumps(_plain(content), allow_nan=False).encode()
        try:
            self._file.write(b'{"crc": %d, "of": %b}\n' % (zlib.crc32(text), text))
            self._file.flush()
        except OSError as error:
            raise self._unwritten(error) from error
        if clock.monotonic() - self._synced > _SYNC:
            self._sync()

    def _sync(self) -> None:
        try:
            os.fsync(self._file.fileno())
            # A file that was removed takes everything without a word, and is gone with the run.
            there = os.path.exists(self.path) and os.path.samestat(
                os.stat(self.path), os.fstat(self._file.fileno())
            )
        except OSError as error:
            raise self._unwritten(error) from error
        if not there:
            raise InputError(
                f"{self.path}: was removed while it was written; nothing more can be kept there"
            )
        self._synced = clock.monotonic()

    def _lock(self) -> None:
        """Keep other processes out; the system lets go when this one ends, however it does."""
        try:
            import fcntl
        except ImportError:  # Windows
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"{self.path}: another process writes this {self._what}; wait for it, or take "
                "another folder"
            ) from None

    def _unwritten(self, error: OSError) -> InputError:
        return InputError(f"{self.path}: cannot be written: {error.strerror}")


def question_in(path: Path, what: str) -> dict[str, Any]:
    """Return the question that a journal answers.

    Raises InputError if there is no journal, or it is none of this version's.
    """
    try:
        if path.exists():
            check_file(path, _LARGEST)
        with open(path, "rb") as file:
            line = file.readline()
    except OSError:
        raise InputError(f"{path}: there is no {what} to go on with") from None
    return dict(_numbers(_question(path, what, line)))


def differences(there: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    """Return in words where two questions differ; of each entry the first place."""
    found = []
    for key in asked:
        if key == "versions":
            found += _other_code(there.get(key, {}), asked[key])
        elif text := _difference(key, there.get(key), asked[key]):
            found.append(text)
    return found


def _question(path: Path, what: str, line: bytes) -> dict[str, Any]:
    """Return the question of a first line, not finite numbers still as texts."""
    content = _content(line)
    if content is None and _LINE.fullmatch(line):
        raise _spoilt(path, 1)
    if content is None or content.get("stillhook") != what or content.get("format") != FORMAT:
        raise _foreign(path, what)
    if not isinstance(content.get("question"), dict):
        raise _spoilt(path, 1)
    return dict(content["question"])


def _content(line: bytes) -> dict[str, Any] | None:
    """Return what a line says; None if it is not as it was written."""
    match = _LINE.fullmatch(line)
    if match is None or zlib.crc32(match[2]) != int(match[1]):
        return None
    try:
        content: dict[str, Any] = json.loads(match[2])
    except (ValueError, RecursionError):  # a good check sum, but no text of ours
        return None
    return content


def _spoilt(path: Path, number: int) -> InputError:
    return InputError(
        f"{path}: line {number} is not as it was written: the file is spoilt; remove it, or take "
        "another folder"
    )


def _foreign(path: Path, what: str) -> InputError:
    return InputError(
        f"{path}: is not a {what} that this version of Stillhook has written; remove it, or take "
        "another folder"
    )


def _other_code(there: object, asked: Mapping[str, str]) -> list[str]:
    for name, version in asked.items():
        own = there.get(name) if isinstance(there, Mapping) else None
        if name != _TOLD and own != version:
            what = "Stillhook's own code" if name == "code" else name
            return [
                f"it was computed with another version of {what} ({own}, now {version}), and the "
                "numbers may not belong together"
            ]
    return []


def _difference(key: str, there: object, asked: object) -> str:
    if there == asked:
        return ""
    if isinstance(there, dict) and isinstance(asked, dict):
        for name in sorted({*there, *asked}):
            text = _difference(f"{key}.{name}", there.get(name), asked.get(name))
            if text:
                return text
    return f"{key} is {_short(there)}, not {_short(asked)}"


def _short(value: object) -> str:
    text = "not given" if value is None or value == {} else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _plain(value: Any) -> Any:
    """Return what JSON can hold: numbers that are not finite, and all else, as texts."""
    if isinstance(value, float) and not math.isfinite(value):
        return f"float:{value}"
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value if value is None or isinstance(value, str | int | float) else str(value)


def _numbers(value: Any) -> Any:
    """Return what `_plain` was given."""
    if isinstance(value, str) and value.startswith("float:"):
        return float(value[6:])
    if isinstance(value, dict):
        return {key: _numbers(each) for key, each in value.items()}
    return [_numbers(each) for each in value] if isinstance(value, list) else value
