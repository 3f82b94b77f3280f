"""`Case`: one vessel, one sea, one rope, one payload, one winch, and the limits of a design.

A case is the frozen image of a case file.  It is made through one door, `Case.from_dict`, which
checks everything and words every error for the user; `replace` changes fields by their dotted paths
and goes through the same door again.  Of implausible figures its user is told once: by `load_case`,
and by the `replace` that brings them in.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

from pydantic import PrivateAttr, ValidationError

from ..basics import InputError, PhysicsWarning, read_bytes
from ..casefile import (
    FOLDER,
    Path,
    describe,
    message_line,
    plain,
    replaced,
    yaml_text,
)
from .contents import Contents
from .plausibility import Finding, contradictions, remarks

#: What a design's M_s may be of its limit where the rope is damped least.
_SENSITIVITY = 1.25
_MOST = 100.0  # that a case may allow
#: What a stored case meant that lacks a field of a section.
_BEFORE: Mapping[tuple[str, ...], Any] = {
    ("limits", "tension_ends"): "drum",
    ("winch", "losses"): "hauling",
    ("rope", "damping_law"): "kelvin-voigt",
    ("sensors", "payload", "noise_enters"): "after-filter",
}


#: Fields that name other files, by their sections; what is in a list goes without its number.
FILES = (("vessel", "raos"), ("sea", "file"), ("sea", "parts", "file"))


class Case(Contents):
    """A case: all that a design needs to know, checked and frozen."""

    _source: str = PrivateAttr(default="")
    _quiet: bool = PrivateAttr(default=False)

    def _faults(self) -> list[Finding]:
        return contradictions(self)

    @classmethod
    def from_dict(
        cls,
        data: Mapping[str, Any],
        *,
        source: str = "case",
        lines: Mapping[Path, int] | None = None,
        folder: str | PathLike[str] | None = None,
    ) -> Case:
        """Make a case from the contents of a case file.

        Parameters
        ----------
        data
            Sections and fields, as in the file: quantities in SI or as text with a unit.
        source
            Name of the file, for the messages.
        lines
            Line number of each path in the file, where known.
        folder
            Folder that relative paths of files in the case start from; the working directory if
            left out.

        Raises
        ------
        InputError
            One line for each error, all at once.
        """
        try:
            context = {FOLDER: None if folder is None else FilePath(folder)}
            case = cls.model_validate(data, context=context)
        except ValidationError as error:
            raise InputError(describe(error, cls, source=source, lines=lines)) from error
        case._source = source
        return case

    @classmethod
    def from_stored(
        cls,
        data: Mapping[str, Any],
        *,
        source: str = "case",
        lines: Mapping[Path, int] | None = None,
    ) -> Case:
        """Make a case from one that was stored with a result; arguments as of :meth:`from_dict`.

        What it lacks, as newer versions brought it, has the meaning that it had when it was
        stored, so that what the result claims still holds.
        """
        tree = dict(data)
        for (*sections, field), value in _BEFORE.items():
            at = tree
            for section in sections:
                if not isinstance(at.get(section), Mapping):
                    break
                at[section] = at = dict(at[section])
            else:
                at.setdefault(field, value)
        return cls.from_dict(tree, source=source, lines=lines)

    def replace(self, changes: Mapping[str, Any]) -> Case:
        """Return a case with some fields changed, checked like a file.

        Of implausible figures that this case did not have, its user is warned.

        Parameters
        ----------
        changes
            New values by dotted path: `{"limits.max_sensitivity": 2.0}`.  A value may be a
            number in SI, a text with a unit, or a whole section as a dict; None takes the field
            back to its default; an entry of a list is addressed by its index
            (`vessel.heave_rao.amplitude.3`).  Where a section offers alternatives
            (`rope.modulus` or `rope.axial_stiffness`), setting one drops the other.

        Raises
        ------
        InputError
            If a path is unknown, or the changed case is not valid.

        Examples
        --------
        >>> from models import load_case
        >>> case = load_case("thesis-1975").replace({"rope.length": "1000 m"})
        >>> round(case.rope.stiffness)
        160000
        """
        case = self._changed(changes)
        if not self._quiet:
            known = {path for path, _ in remarks(self)}
            for path, text in remarks(case):
                if path not in known:
                    message = message_line(self.label, 0, tuple(path.split(".")), text)
                    warnings.warn(message, PhysicsWarning, stacklevel=2)
        return case

    def variant(self, changes: Mapping[str, Any]) -> Case:
        """Return :meth:`replace`, for the cases of a study that nobody has asked for one by one.

        Of these nobody is warned, nor of what is made of them: they are quiet.
        """
        case = self._changed(changes) if changes else self.model_copy()
        case._quiet = True
        return case

    @property
    def with_least_damping(self) -> Case | None:
        """The case with the least damping of its rope that a design must hold at.

        There M_s may be 1.25 times its limit.  None where the case's own damping is the least.
        """
        least = self.rope.least_damping_ratio
        if least >= self.rope.damping_ratio:
            return None
        sensitivity = _SENSITIVITY * self.limits.max_sensitivity
        return self.variant(
            {"rope.damping_ratio": least, "limits.max_sensitivity": min(sensitivity, _MOST)}
        )

    def _changed(self, changes: Mapping[str, Any]) -> Case:
        tree = replaced(self.to_dict(), Case, changes, self.label)
        case = Case.from_dict(tree, source=self.label)
        case._quiet = self._quiet
        return case

    @property
    def quiet(self) -> bool:
        """Whether this is a :meth:`variant`, or was made of one."""
        return self._quiet

    @property
    def source(self) -> str:
        """Name of the file or bundled case that this came from."""
        return self._source

    @property
    def label(self) -> str:
        """What messages call the case: its source, or its name where it has none."""
        return self._source or self.name

    def to_dict(self) -> dict[str, Any]:
        """Return the case as plain dicts, lists, texts and SI numbers, without empty fields."""
        tree: dict[str, Any] = plain(self)
        return tree

    def to_yaml(self) -> str:
        """Return the case as YAML text in SI; reading it gives an equal case."""
        return yaml_text(self.to_dict())

    def __eq__(self, other: object) -> bool:
        """Whether the contents agree, wherever the two cases came from."""
        return isinstance(other, Case) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(_canonical(self.to_dict()))

    @property
    def digest(self) -> str:
        """SHA-256 of the contents, 64 hexadecimal digits.

        Equal cases have the same one, wherever they came from and whatever computes it; a changed
        field makes another.  It is that of `to_dict` as JSON in ASCII with sorted keys and without
        spaces, floats with the fewest digits that tell them apart, zero without a sign.  A file
        that the case names counts by what stands in it, and not by where it lies.  A version of
        Stillhook that knows further fields has another digest.

        Raises InputError if such a file can no longer be read.
        """
        tree = _with_contents(self.to_dict())
        return hashlib.sha256(_canonical(tree).encode("ascii")).hexdigest()


def _with_contents(tree: Any, path: tuple[str, ...] = ()) -> Any:
    """Return plain data with the hash of a file's contents for each file that it names."""
    if isinstance(tree, dict):
        return {key: _with_contents(item, (*path, key)) for key, item in tree.items()}
    if isinstance(tree, list):
        return [_with_contents(item, path) for item in tree]
    if path in FILES and FilePath(tree).is_absolute():  # and not the name of bundled data
        return f"sha256:{hashlib.sha256(read_bytes(tree)).hexdigest()}"
    return tree


def _canonical(tree: Any) -> str:
    """Return plain data as the one JSON text that says the same."""
    return json.dumps(_unsigned(tree), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _unsigned(tree: Any) -> Any:
    """Return plain data with zeros of one kind: -0.0 equals 0.0, and its text does not."""
    if isinstance(tree, dict):
        return {key: _unsigned(item) for key, item in tree.items()}
    if isinstance(tree, list):
        return [_unsigned(item) for item in tree]
    return tree + 0.0 if isinstance(tree, float) else tree
