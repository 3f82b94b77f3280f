"""The folder that results go to: made, tried, and written file by file, each whole or not at all.

A long computation is worth nothing if its result cannot be kept, so the folder is made and
written to before the computation begins.  A folder lists what was written into it, so that the next
run knows its own files from those of other people, among which it does not write unasked.
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

LIST = ".stillhook"  #: File with the names of those that were written into a folder.

_HOMES = ("/home", "/Users", "C:/Users")
_NOBODYS = re.compile(r"\.DS_Store|Thumbs\.db|desktop\.ini|\..*\.(tmp|probe)")
_NAMED = 3  # files that are named


@dataclass(frozen=True)
class OutputFolder:
    """A folder that can be written to, and what has been."""

    path: Path  #: The folder; it is made with its parents by `prepare`.
    #: Endings of the files of a figure; none for no figures.
    kinds: tuple[str, ...] = ("svg", "png")
    #: Whether it lists what is written into it; one that a file's name led to does not.
    listing: bool = True
    #: The files that were written, in their order.
    written: list[Path] = field(default_factory=list)

    @classmethod
    def prepare(
        cls,
        path: str | Path | OutputFolder,
        kinds: tuple[str, ...] = ("svg", "png"),
        *,
        listing: bool = True,
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
        except UnicodeEncodeError as error:
            raise InputError(
                f"{folder}: the output folder cannot be made: names of files are in "
                f"{error.encoding} here; name another with --out, or set PYTHONUTF8=1"
            ) from error
        probe = folder / f".{os.getpid()}.probe"
        replace_atomically(probe, lambda place: place.write_bytes(b"")).unlink(missing_ok=True)
        return cls(folder, kinds, listing)

    def at(self, name: str) -> Path:
        """Return where a file goes, listed, with the folder made that its name may begin with.

        Raises InputError if that folder cannot be made.
        """
        path = self.path / name
        self.claim(path)
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
        self.claim(*paths)

    def claim(self, *paths: Path) -> None:
        """List files before they are written, so that they are known though a run is killed.

        A folder that somebody has removed since it was prepared is made again: what was computed
        meanwhile is worth more than their order.

        Raises InputError if that cannot be written.
        """
        if not self.path.is_dir():
            self.prepare(self.path)
        if not self.listing:
            return
        tops = dict.fromkeys(path.relative_to(self.path).parts[0] for path in paths)
        listed = _listed(self.path)
        try:
            with open(self.path / LIST, "a", encoding="utf-8", newline="\n") as file:
                file.writelines(f"{name}\n" for name in tops if name not in listed)
        except OSError as error:
            raise InputError(f"{self.path / LIST}: cannot be written: {error.strerror}") from error

    def draw(
        self,
        drawings: Sequence[Drawing],
        *,
        progress: Callable[[str, int, int], None] | None = None,
    ) -> list[Path]:
        """Draw figures and write them in the folder's kinds; return their files.

        Where there is nothing to draw a file of that name that an earlier run left is removed.
        `progress` is called as progress("figures", done, total).

        Raises InputError if a file cannot be written.
        """
        from .images import picture

        written: list[Path] = []
        if not self.kinds:
            return []
        for done, drawing in enumerate(drawings):
            if progress is not None:
                progress("figures", done, len(drawings))
            try:
                figure = drawing.draw()
            except InputError:  # a run that was cut short, say, has nothing to show
                self.discard(*pictures(drawing.name))
                continue
            for kind in self.kinds:
                image = picture(figure, kind, name=drawing.name, caption=drawing.caption)
                written.append(self.write(f"{drawing.name}.{kind}", image))
        return written

    def discard(self, *patterns: str) -> None:
        """Remove files of an earlier run by their names, with `*` for any, unless written anew."""
        listed = _listed(self.path)
        for path in [found for pattern in patterns for found in self.path.glob(pattern)]:
            ours = path.relative_to(self.path).parts[0] in listed
            if ours and path not in self.written:
                with contextlib.suppress(OSError):
                    path.unlink(missing_ok=True)


def check_own(path: Path) -> None:
    """Check that results can go to a folder: that it is new or empty, or holds nothing but theirs.

    Raises InputError if it is the root of a disk or a home folder, or holds files that are not
    listed as Stillhook's.
    """
    place = path.resolve()
    if place == Path(place.anchor):
        raise InputError(f"{path}: is the root of the file system; name a folder for the results")
    homes = [Path("/root")]
    with contextlib.suppress(RuntimeError):  # a user without one
        homes.append(Path.home().resolve())
    if place in homes or place.parent.as_posix() in _HOMES:
        raise InputError(f"{path}: is a home folder; name a folder in it, or say --force")
    others = _others(place)
    if others:
        more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
        raise InputError(
            f"{path}: holds what Stillhook has not written ({', '.join(others[:_NAMED])}{more}); "
            "name a new folder, or say --force to write among it"
        )


def _others(folder: Path) -> list[str]:
    """Return the names of what is in a folder and not Stillhook's; empty folders are nobody's."""
    try:
        found = sorted(folder.iterdir())
    except OSError:  # there is none yet, or whoever makes it says what is wrong
        return []
    listed = _listed(folder) | {LIST}
    return [
        path.name
        for path in found
        if path.name not in listed
        and not _NOBODYS.fullmatch(path.name)
        and not (path.is_dir() and ((path / LIST).is_file() or _is_empty(path)))
    ]


def _is_empty(folder: Path) -> bool:
    try:
        return next(folder.iterdir(), None) is None
    except OSError:
        return False


def _listed(folder: Path) -> set[str]:
    """Return the names that a folder lists."""
    try:
        return {*(folder / LIST).read_text(encoding="utf-8").splitlines()}
    except (OSError, UnicodeDecodeError):
        return set()


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
