"""The folder that results go to: made, tried, and written file by file, each whole or not at all.

A long computation is worth nothing if its result cannot be kept, so the folder is made and
written to before the computation begins.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from models.basics import InputError, replace_atomically

from .table import Drawing


@dataclass(frozen=True)
class OutputFolder:
    """A folder that can be written to, and what has been."""

    path: Path  #: The folder; it is made with its parents by `prepare`.
    #: Endings of the files of a figure; none for no figures.
    kinds: tuple[str, ...] = ("svg", "png")
    #: The files that were written, in their order.
    written: list[Path] = field(default_factory=list)

    @classmethod
    def prepare(
        cls, path: str | Path | OutputFolder, kinds: tuple[str, ...] = ("svg", "png")
    ) -> OutputFolder:
        """Return the folder, made if need be and known to be writable; one that is, as it is.

        Raises InputError if it cannot be made, or no file can be written into it.
        """
        if isinstance(path, OutputFolder):
            return path
        folder = Path(path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            known: dict[type[OSError], str] = {
                FileExistsError: "a file is there",
                NotADirectoryError: "part of the path is a file",
            }
            reason = known.get(type(error), error.strerror or error)
            raise InputError(f"{folder}: the output folder cannot be made: {reason}") from error
        probe = folder / f".{os.getpid()}.probe"
        replace_atomically(probe, lambda place: place.write_bytes(b"")).unlink(missing_ok=True)
        return cls(folder, kinds)

    def at(self, name: str) -> Path:
        """Return where a file goes, with the folder made that its name may begin with.

        Raises InputError if that folder cannot be made.
        """
        path = self.path / name
        if not path.parent.is_dir():
            self.prepare(path.parent)
        return path

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a file under a temporary name, then rename it; return its path.

        Raises InputError if it cannot be written.
        """
        data = content.encode("utf-8") if isinstance(content, str) else content
        path = replace_atomically(self.at(name), lambda place: place.write_bytes(data))
        self.keep(path)
        return path

    def keep(self, *paths: Path) -> None:
        """Count files that somebody else has written here among those written, each once."""
        self.written.extend(path for path in paths if path not in self.written)

    def draw(
        self,
        drawings: Sequence[Drawing],
        *,
        kinds: Sequence[str] | None = None,
        progress: Callable[[str, int, int], None] | None = None,
    ) -> list[Path]:
        """Draw figures and write them, by default in the folder's kinds; return their files.

        Where there is nothing to draw a file of that name that an earlier run left is removed.
        `progress` is called as progress("figures", done, total).

        Raises InputError if a file cannot be written.
        """
        from . import style

        written: list[Path] = []
        kinds = self.kinds if kinds is None else kinds
        if not kinds:
            return []
        for done, drawing in enumerate(drawings):
            if progress is not None:
                progress("figures", done, len(drawings))
            try:
                figure = drawing.draw()
            except InputError:  # a run that was cut short, say, has nothing to show
                self.discard(*pictures(drawing.name))
                continue
            for kind in kinds:
                written.append(self.write(f"{drawing.name}.{kind}", style.picture(figure, kind)))
        return written

    def discard(self, *patterns: str) -> None:
        """Remove files of an earlier run by their names, with `*` for any, unless written anew."""
        for path in (found for pattern in patterns for found in self.path.glob(pattern)):
            if path not in self.written:
                with contextlib.suppress(OSError):
                    path.unlink(missing_ok=True)


def pictures(*names: str) -> list[str]:
    """Return the files of figures, of every kind."""
    return [f"{name}.{kind}" for name in names for kind in ("svg", "png")]


def folder_name(text: str) -> str:
    """Return a case's name as the name of a folder.

    Examples
    --------
    >>> folder_name("subsea-crane"), folder_name("Crane 2/B: 50 t"), folder_name("..")
    ('subsea-crane', 'Crane-2-B-50-t', 'case')
    """
    return re.sub(r"[^\w.-]+", "-", text).strip("-.") or "case"
