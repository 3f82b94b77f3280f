"""Plain data with something wrong in it, for files that nobody has written on purpose."""

from __future__ import annotations

import copy
import datetime
import math
from typing import Any

from hypothesis import strategies as st

#: What may stand where something else should: of every kind, and at every end of its range.
TOUCHY = st.sampled_from(
    [
        None, True, False, 0, -1, 1, 2, 10**30, -(10**400), 0.0, -0.0, 1e-320, 1e308, -1e308,
        math.nan, math.inf, -math.inf, "", " ", "nan", "1e999", "3 m", "3 furlongs", "-", "[",
        "x" * 500, "\x85", "\U0001f6a2", "a.b.c", "..", "0", [], [[]], [None], [1, "2"], {},
        {"": 1}, {"a": {"b": []}}, {"__class__": 1}, datetime.date(2024, 1, 1),
    ]
)  # fmt: skip


def places(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of every value in a tree, sections and lists too."""
    found = [path]
    if isinstance(tree, dict):
        for key, value in tree.items():
            found += places(value, (*path, key))
    elif isinstance(tree, list):
        for index, value in enumerate(tree[:3]):
            found += places(value, (*path, index))
    return found


@st.composite
def touched(draw: st.DrawFn, tree: Any) -> Any:
    """Draw a tree with one to three values replaced, taken away, moved or added."""
    result = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        path = draw(st.sampled_from(places(result)))
        if not path:
            if draw(st.integers(0, 9)) == 0:
                return copy.deepcopy(draw(TOUCHY))
            continue
        holder = result
        for key in path[:-1]:
            holder = holder[key]
        change = draw(st.sampled_from(["replace", "replace", "remove", "move", "add"]))
        if change == "remove":
            del holder[path[-1]]
        elif change == "move":
            other = result
            for key in (source := draw(st.sampled_from(places(result)))):
                other = other[key]
            if path[: len(source)] != source:  # a tree within itself has no end
                holder[path[-1]] = copy.deepcopy(other)
        elif change == "add" and isinstance(holder, dict):
            holder[draw(st.sampled_from(["", "x", "name", 3, None, "a.b"]))] = copy.deepcopy(
                draw(TOUCHY)
            )
        else:
            holder[path[-1]] = copy.deepcopy(draw(TOUCHY))
    return result
