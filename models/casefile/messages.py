"""Error sentences of a case file: place, field, and what is wrong there.

Each error is one line, `file:line: field.path: must be ..., got ...`; unknown keys get a
suggestion.
"""

import difflib
from collections.abc import Mapping, Sequence

Path = tuple[str | int, ...]  #: Way to a field: keys, and indices of lists.


def message_line(source: str, line: int, path: Path, text: str) -> str:
    """Return `source:line: path: text`, without what is not known (line 0, empty path)."""
    place = f"{source}:{line}" if line else source
    return f"{place}: {path_text(path)}: {text}" if path else f"{place}: {text}"


def line_of(path: Path, lines: Mapping[Path, int] | None) -> int:
    """Return the line of a path or of the section that should hold it; 0 if none is known."""
    if not lines:
        return 0
    for end in range(len(path), 0, -1):
        if path[:end] in lines:
            return lines[path[:end]]
    return lines.get((), 0)


def path_text(path: Sequence[str | int]) -> str:
    """Return a path as text: `vessel.heave_rao.omega[3]`; what steers a terminal is escaped."""
    text = ""
    for item in path:
        text += f"[{item}]" if isinstance(item, int) else f".{item}" if text else str(item)
    return text if text.isprintable() else repr(text)[1:-1]


def suggestion(key: object, known: Sequence[str]) -> str:
    """Return `did you mean 'x'?`, or the list of what is known if nothing is near."""
    near = difflib.get_close_matches(str(key), known, n=1, cutoff=0.6)
    if near:
        return f"did you mean {near[0]!r}?"
    return f"known here: {', '.join(known)}"
