"""Line numbers of the keys in a TOML file.

The standard library reads TOML but does not say where a value stood.  This scanner walks over a
text that has been read without error and notes the line of each key and list entry; it only has
to know where values end, not what they mean.
"""

from __future__ import annotations

import re
import tomllib

Path = tuple[str | int, ...]

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_SCALAR = re.compile(r"[^,\]}#\n]+")
_QUOTES = ('"""', "'''", '"', "'")


def toml_lines(text: str) -> dict[Path, int]:
    """Return the line of each key path in a valid TOML text, counted from 1.

    Parameters
    ----------
    text
        TOML that `tomllib` accepts.

    Returns
    -------
    dict
        Line by path; list entries have their index in the path, `("winch", "layers", 0)`.
    """
    scanner = _Scanner(text)
    scanner.scan()
    return scanner.lines


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text.replace("\r\n", "\n")
        self.at = 0
        self.lines: dict[Path, int] = {(): 1}
        self.counts: dict[Path, int] = {}  # entries so far of each array of tables

    def scan(self) -> None:
        """Go through the whole text: table headers, and the pairs below each."""
        table: Path = ()
        while self._skip(newlines=True):
            if self._take("[["):
                path = self._resolved(self._key())
                index = self.counts.get(path, 0)
                self.counts[path] = index + 1
                self._note(path)
                table = (*path, index)
                self._note(table)
                self._take("]]")
            elif self._take("["):
                table = self._resolved(self._key())
                self._note(table)
                self._take("]")
            else:
                self._pair(table)

    def _pair(self, table: Path) -> None:
        line = self._line()
        path = table
        for name in self._key():
            path = (*path, name)
            self.lines.setdefault(path, line)
        self._take("=")
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip(newlines=False)
        quote = next((q for q in _QUOTES if self.text.startswith(q, self.at)), "")
        if quote:
            self._string(quote)
        elif self._take("["):
            index = 0
            while self._skip(newlines=True) and not self._take("]"):
                if self._take(","):
                    continue
                self._note((*path, index))
                self._value((*path, index))
                index += 1
        elif self._take("{"):
            while self._skip(newlines=True) and not self._take("}"):
                if not self._take(","):
                    self._pair(path)
        else:
            match = _SCALAR.match(self.text, self.at)
            self.at = match.end() if match else self.at + 1

    def _key(self) -> list[str]:
        """Read a dotted key; its parts may be quoted."""
        parts = []
        while True:
            self._skip(newlines=False)
            start = self.at
            bare = _BARE_KEY.match(self.text, self.at)
            if bare:
                self.at = bare.end()
                parts.append(bare.group())
            else:
                self._string(self.text[self.at])
                parts.append(str(tomllib.loads(f"k = {self.text[start : self.at]}")["k"]))
            self._skip(newlines=False)
            if not self._take("."):
                return parts

    def _string(self, quote: str) -> None:
        self.at += len(quote)
        while self.at < len(self.text) and not self.text.startswith(quote, self.at):
            self.at += 2 if quote[0] == '"' and self.text[self.at] == "\\" else 1
        self.at += len(quote)
        # A long string may end in up to two quotes of its own: `"""a "quote""""`.
        while len(quote) == 3 and self.text.startswith(quote[0], self.at):
            self.at += 1

    def _skip(self, *, newlines: bool) -> bool:
        """Skip blanks and comments, and say whether anything is left."""
        blanks = " \t\n" if newlines else " \t"
        while self.at < len(self.text):
            if self.text[self.at] in blanks:
                self.at += 1
            elif newlines and self.text[self.at] == "#":
                end = self.text.find("\n", self.at)
                self.at = len(self.text) if end < 0 else end
            else:
                return True
        return False

    def _take(self, token: str) -> bool:
        if not self.text.startswith(token, self.at):
            return False
        self.at += len(token)
        return True

    def _resolved(self, key: list[str]) -> Path:
        """Put the index of the current entry behind each name that is an array of tables."""
        path: Path = ()
        for position, name in enumerate(key):
            path = (*path, name)
            if path in self.counts and position < len(key) - 1:
                path = (*path, self.counts[path] - 1)
        return path

    def _note(self, path: Path) -> None:
        for end in range(1, len(path) + 1):
            self.lines.setdefault(path[:end], self._line())

    def _line(self) -> int:
        return self.text.count("\n", 0, self.at) + 1
