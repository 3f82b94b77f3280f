"""The folder that the page was started in: the one place that it reads from and writes to.

    name --> StartFolder.path (within, or refused) --> case in, design and case out

A name that leads out of the folder is refused, by dots, as an absolute path or through a link; so
is a case file that names a file outside.
"""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from models.basics import InputError, PhysicsWarning, check_file, replace_atomically
from models.case import Case, bundled_cases, load_case
from models.casefile import case_text, read_yaml
from models.vessel.readers import bundled_vessels
from synth.design import Design

from ..designs import design_text, is_design_file

_KINDS = (".yaml", ".yml", ".json", ".toml")
_LARGEST = 20_000_000  # bytes of a case file that is opened from the page
_HEAD = 50_000  # characters of a file that are looked at to tell whether it is one
_MOST = 200  # files that are listed
_REFERENCES = (("vessel", "raos"), ("sea", "file"))  # fields of a case that name another file


@dataclass(frozen=True)
class StartFolder:
    """A folder, and nothing but what is in it."""

    root: Path  #: Absolute, without links.

    @classmethod
    def here(cls) -> StartFolder:
        """Return the folder that the program runs in."""
        return cls(Path.cwd().resolve())

    def path(self, name: str) -> Path:
        """Return the path of a file in the folder, by its name or relative path.

        Raises InputError if it leads out of the folder, or is hidden.
        """
        try:
            found = Path(self.root, name).resolve()
        except (OSError, ValueError, RuntimeError):
            raise InputError(f"{name!r:.80}: is no name of a file") from None
        if not name.strip() or os.path.isabs(name) or not found.is_relative_to(self.root):
            raise InputError(
                f"{name!r:.80}: must be a file in the folder that the page was started in"
            )
        inside = found.relative_to(self.root).parts
        if not inside or any(part.startswith(".") for part in inside):
            raise InputError(f"{name!r:.80}: is hidden, or the folder itself")
        return found

    def cases(self) -> list[str]:
        """Return the case files here and one folder down, by relative path; designs are not."""
        found: list[str] = []
        for pattern in ("*", "*/*"):
            for path in sorted(self.root.glob(pattern)):
                name = path.relative_to(self.root).as_posix()
                if len(found) >= _MOST or path.suffix.lower() not in _KINDS:
                    continue
                try:
                    if self.path(name).is_file() and _is_case(path):
                        found.append(name)
                except (InputError, OSError):
                    continue
        return found

    def open_case(self, name: str) -> tuple[Case, list[str]]:
        """Return a bundled case or one of the folder, with what there is to warn of.

        Raises InputError if there is none, it has errors, or it names a file outside the folder.
        """
        source: str | Path = name
        if name not in {known for known, _ in bundled_cases()}:
            source = self.path(name)
            check_file(source, _LARGEST)
            self._check_references(source)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", PhysicsWarning)
            try:
                case = load_case(source)
            except InputError as error:  # the folder is known: the name is enough
                raise InputError(str(error).replace(f"{self.root}{os.sep}", "")) from error
        return case, [str(w.message) for w in told if issubclass(w.category, PhysicsWarning)]

    def save(self, name: str, case: Case, design: Design, *, replace: bool = False) -> list[Path]:
        """Write a case and a design as NAME-case.yaml and NAME-design.yaml; return their paths.

        Each is there whole or not at all, and both or neither.

        Raises InputError if a name leads out of the folder, a file is there and not to be replaced,
        or it cannot be written.
        """
        if not name.strip() or "/" in name or "\\" in name:
            raise InputError(f"{name!r:.80}: must be a plain name, as in crane-1")
        texts = {
            self.path(f"{name}-case.yaml"): case.to_yaml(),
            self.path(f"{name}-design.yaml"): design_text(design),
        }
        for path in texts:
            if path.exists() and not replace:
                raise InputError(
                    f"{path.name}: is there already; choose another name, or allow replacing it"
                )
        before = {path: path.read_bytes() if path.exists() else None for path in texts}
        try:
            for path, text in texts.items():
                _write(path, text.encode("utf-8"))
        except InputError:
            for path, content in before.items():
                if content is None:
                    path.unlink(missing_ok=True)
                else:
                    _write(path, content)
            raise
        return list(texts)

    def _check_references(self, path: Path) -> None:
        """Refuse a case file that names a file outside the folder, before that is opened."""
        text = case_text(path)
        try:
            if path.suffix.lower() == ".toml":
                data: Any = tomllib.loads(text)
            else:
                data, _ = read_yaml(text, path.name)
        except (tomllib.TOMLDecodeError, InputError):
            return  # `load_case` says what is wrong with it
        for section, key in _REFERENCES:
            fields = data.get(section) if isinstance(data, Mapping) else None
            named = fields.get(key) if isinstance(fields, Mapping) else None
            if not isinstance(named, str) or named in dict(bundled_vessels()):
                continue
            try:
                found = Path(path.parent, Path(named).expanduser()).resolve()
            except (OSError, ValueError, RuntimeError):
                continue
            if not found.is_relative_to(self.root):
                raise InputError(
                    f"{path.name}: {section}.{key}: names {named!r:.80}, which is not in the "
                    "folder that the page was started in"
                )


def _write(path: Path, data: bytes) -> None:
    replace_atomically(path, lambda place: place.write_bytes(data))


def _is_case(path: Path) -> bool:
    """Return whether a file looks like a case: small, with a sea, and no design."""
    if path.stat().st_size > _LARGEST or is_design_file(path):
        return False
    with path.open(encoding="utf-8", errors="replace") as file:
        text = file.read(_HEAD)
    return "sea" in text and "winch" in text and "payload" in text
