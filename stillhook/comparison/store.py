"""The results of a comparison on disk, one line each, so that it can go on where it stopped.

    Cell, Law --> Store.add --> cells.jsonl --> Store.open --> what is there already

The first line says what question the others answer; a store that answers another one is refused.
A line is written at once and has a check sum.  A line that a crash cut short can only be the last
one, and is dropped; anything else that does not read as it was written is refused, because nobody
can say what else is wrong with it.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from models.basics import InputError

from ..controllers import Contender, Law
from ..keeper import code_digest, difference, lock, put
from .cell import Cell, Question

STORE = "cells.jsonl"
"""Name of the file in the folder of a comparison."""

_FORMAT = 1
_ENTRY = "stillhook.comparison.bench"  # whose code the results hang on


def question_of(question: Question) -> dict[str, Any]:
    """Return what a store has to answer, as plain data."""
    from .._version import __version__

    return {
        "stillhook_comparison": _FORMAT,
        "version": __version__,
        "case": question.case.to_dict(),
        "duration": question.duration,
        "settle": question.settle,
        "mismatch": {str(k): v for k, v in question.mismatch.changes.items()},
        "masses": question.masses,
        "compiled": question.compiled,
        "design at": question.design_at,
        "starts": question.starts,
    }


class Store:
    """Results on disk; a context manager that closes the file.

    Parameters
    ----------
    path
        The file; it is made if there is none.
    question
        What is asked.

    Raises
    ------
    InputError
        If the file is not a comparison's, is spoilt, answers another question, is being written
        by another process, or cannot be written.
    """

    def __init__(self, path: str | Path, question: Question) -> None:
        self.path = Path(path)
        self._cells: dict[tuple[str, str, float, int], Cell] = {}
        self._laws: dict[tuple[str, str, float], Law] = {}
        asked = json.loads(_text(question_of(question)))
        try:
            self._file: BinaryIO = open(self.path, "a+b")  # noqa: SIM115
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror}") from error
        try:
            lock(self._file, self.path, "comparison")
            self._read(asked)
        except BaseException:
            self._file.close()
            raise

    def cell(self, contender: Contender, law: Law | None, height: float, seed: int) -> Cell | None:
        """Return the result of a run, if there is one that still holds."""
        return self._cells.get((contender.name, _identity(contender, law), height, seed))

    def law(self, needs: str, height: float) -> Law | None:
        """Return a design, if there is one that still holds."""
        return self._laws.get((needs, code_digest(_ENTRY), height))

    def add_cell(self, contender: Contender, law: Law | None, cell: Cell) -> None:
        """Keep the result of a run."""
        identity = _identity(contender, law)
        put(self._file, self.path, _text({"kind": "run", "identity": identity, **cell.to_dict()}))
        self._cells[contender.name, identity, cell.height, cell.seed] = cell

    def add_law(self, needs: str, height: float, law: Law) -> None:
        """Keep a design."""
        identity = code_digest(_ENTRY)
        content = {"kind": "design", "identity": identity, "name": needs, "height": height}
        put(self._file, self.path, _text({**content, "law": law.to_dict()}))
        self._laws[needs, identity, height] = law

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Store:
        """Return the store."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def _read(self, asked: Mapping[str, Any]) -> None:
        self._file.seek(0)
        data = self._file.read()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            self._drop(data[whole:], whole)
        lines = data[:whole].splitlines()
        if not lines:
            put(self._file, self.path, _text(asked))
            return
        header = self._content(lines[0], 1)
        if header.get("stillhook_comparison") != _FORMAT:
            raise self._foreign()
        other = [difference(key, header.get(key), asked[key]) for key in asked]
        changed = [text for text in other if text]
        if changed:
            raise InputError(
                f"{self.path}: holds another comparison: {'; '.join(changed)}; take another "
                "folder, or remove the file"
            )
        for number, line in enumerate(lines[1:], 2):
            self._take(self._content(line, number), number)

    def _drop(self, rest: bytes, whole: int) -> None:
        """Drop a last line without an end, if it is the beginning of one of ours."""
        start = b'{"crc": '
        if not (rest.startswith(start) or start.startswith(rest)):
            raise self._foreign()
        self._file.truncate(whole)

    def _content(self, line: bytes, number: int) -> dict[str, Any]:
        try:
            read = json.loads(line)
            content, crc = read["of"], read["crc"]
            sound = isinstance(content, dict) and zlib.crc32(_text(content).encode()) == crc
        except (ValueError, KeyError, TypeError):
            if number == 1:
                raise self._foreign() from None
            sound, content = False, {}
        if not sound:
            raise InputError(
                f"{self.path}: line {number} is not as it was written: the file is spoilt; remove "
                "it, or take another folder"
            )
        return dict(content)

    def _take(self, content: dict[str, Any], number: int) -> None:
        kind, identity = content.pop("kind", ""), content.pop("identity", "")
        try:
            if kind == "run":
                cell = Cell(**_numbers(content))
                self._cells[cell.contender, identity, cell.height, cell.seed] = cell
            elif kind == "design":
                law = Law(**content["law"])
                self._laws[content["name"], identity, float(content["height"])] = law
            else:
                raise KeyError(kind)
        except (TypeError, KeyError) as error:
            raise InputError(f"{self.path}: line {number} is no result ({error})") from None

    def _foreign(self) -> InputError:
        return InputError(
            f"{self.path}: is not a comparison that this version of Stillhook has written; remove "
            "it, or take another folder"
        )


def _identity(contender: Contender, law: Law | None) -> str:
    """Return what a result hangs on besides the question: the contender, its law, the code."""
    return ".".join([contender.identity, "" if law is None else law.digest, code_digest(_ENTRY)])


def _text(content: Mapping[str, Any]) -> str:
    """Return plain data as one line of JSON, NaN and infinity as texts."""
    return json.dumps(_plain(content), allow_nan=False, ensure_ascii=True)


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return f"float:{value}"
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value if value is None or isinstance(value, str | int | float | bool) else str(value)


def _numbers(value: Any) -> Any:
    """Return what `_plain` was given."""
    if isinstance(value, str) and value.startswith("float:"):
        return float(value[6:])
    if isinstance(value, dict):
        return {key: _numbers(each) for key, each in value.items()}
    return value
