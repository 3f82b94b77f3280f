"""Dotted paths: a case as plain data, and changing fields of it by path."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..basics import InputError
from .messages import path_text, suggestion
from .section import TAGS, Section, discriminator, sections_of


def plain(value: Any) -> Any:
    """Return sections as dicts without empty fields, and sequences as lists.

    A default that a factory made follows from the other fields: it is left out too.
    """
    if isinstance(value, Section):
        given = value.model_fields_set
        fields = type(value).model_fields.items()
        names = (name for name, f in fields if f.default_factory is None or name in given)
        items = ((name, getattr(value, name)) for name in names)
        return {name: plain(item) for name, item in items if item is not None}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def replaced(
    tree: dict[str, Any], model: type[Section], changes: Mapping[str, Any], source: str
) -> dict[str, Any]:
    """Return `tree`, a section of a class `model` as plain data, with the `changes` in it.

    They are by dotted path; `tree` is used up.  Messages name the `source`.

    Raises InputError if paths are unknown; one line for each.
    """
    given = {tuple(part for part in re.split(r"[.\[\]]+", path) if part) for path in changes}
    wrong = []
    # Sections before their fields, and the key that selects among alternatives before the
    # others: the order in which the changes were written down does not matter.
    for path in sorted(changes, key=lambda p: (p.count("."), p.rpartition(".")[2] not in TAGS)):
        keys = [part for part in re.split(r"[.\[\]]+", path) if part]
        try:
            _set(_Place(tree, (model,), ()), keys, plain(changes[path]), given)
        except InputError as error:
            wrong.append(f"{source}: cannot replace {path!r}: {error}")
    if wrong:
        raise InputError("\n".join(wrong))
    return tree


class _Place:
    """Where a walk down a tree has come to: the data, the classes it may be of, the path."""

    def __init__(
        self, tree: Any, members: tuple[type[Section], ...], path: tuple[str | int, ...]
    ) -> None:
        self.tree, self.members, self.path = tree, members, path

    @property
    def model(self) -> type[Section]:
        """The class that the section's tag selects."""
        for member in self.members:
            tag = discriminator(member)
            if tag is None or self.tree.get(tag[0]) == tag[1]:
                return member
        return self.members[0]

    @property
    def known(self) -> tuple[str, ...]:
        """The keys that may be set; of a section that forgets nothing, those of all its kinds."""
        kinds = (self.model,) if self.model.forgets else self.members
        return tuple(dict.fromkeys(key for kind in kinds for key in kind.model_fields))


def _set(place: _Place, keys: Sequence[str], value: Any, given: set[tuple[str, ...]]) -> None:
    """Walk down to the last key and set it; the section classes say which keys exist."""
    if not keys:
        raise InputError("the path is empty")
    for key in keys[:-1]:
        place = _down(place, key)
    key = keys[-1]
    if isinstance(place.tree, list):
        place.tree[_index(place, key)] = value
    elif not place.members:  # free texts, as in `sources`
        place.tree[key] = value
    else:
        _check_key(place, key)
        _assign(place, key, value, given)


def _down(place: _Place, key: str) -> _Place:
    if isinstance(place.tree, list):
        index = _index(place, key)
        below: Any = place.tree[index]
        members = place.members
        step: str | int = index
    else:
        _check_key(place, key)
        field = place.model.model_fields.get(key)
        members = sections_of(field.annotation) if field is not None else ()
        step = key
        below = place.tree.get(key)
        if below is None and members:
            below = place.tree[key] = {}
    path = (*place.path, step)
    if not isinstance(below, dict | list):
        raise InputError(f"{path_text(path)} has no fields of its own")
    return _Place(below, members, path)


def _check_key(place: _Place, key: str) -> None:
    known = place.known if place.members else ()
    if key not in known:
        raise InputError(f"{path_text((*place.path, key))} is unknown; {suggestion(key, known)}")


def _index(place: _Place, key: str) -> int:
    last = len(place.tree) - 1
    if not key.isdigit() or int(key) > last:
        raise InputError(f"{path_text(place.path)} has entries 0 to {last}, got {key!r}")
    return int(key)


def _assign(place: _Place, key: str, value: Any, given: set[tuple[str, ...]]) -> None:
    tree = place.tree
    if value is None:
        tree.pop(key, None)
        return
    tree[key] = value
    for group in place.model.alternatives:
        for other in group:
            full = (*map(str, place.path), other)
            if key in group and other != key and full not in given:
                tree.pop(other, None)
    for name in set(tree) - set(place.known):  # left over from another tag
        del tree[name]
