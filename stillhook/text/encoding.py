"""Standard output and error in encodings other than UTF-8, which pipes on Windows have.

A result that is there must not be lost because a pipe has no character for a bar or for a name:
what cannot be written is written in ASCII, character for character where that can be.
"""

import codecs
import json
import re
import sys
import unicodedata
from io import TextIOWrapper

_ERRORS = "stillhook-ascii"
_USUAL = ("strict", "surrogateescape", "backslashreplace")  # what the user did not ask for
#: What Unicode does not take apart into ASCII; one for one in what tables and bars are made of.
_ASCII = {
    **dict(
        zip(
            "█▓▒░▶◀├└│─━•·–—−‘’“”…×⁄μωΩøØłŁđ",  # noqa: RUF001
            "##:.><|`|--*.---''\"\"~x/uwOoOlLd",
            strict=True,
        )
    ),
    **{"ß": "ss", "æ": "ae", "Æ": "AE", "œ": "oe", "Œ": "OE", "≤": "<=", "≥": ">=", "°": "deg"},
}


def take_any_text() -> None:
    """Let standard output and error take any text, unless they are told how in the environment."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors in _USUAL:
            stream.reconfigure(errors=_ERRORS)


def as_written(text: str, encoding: str) -> str:
    """Return a text as it comes out in an encoding, for what is laid out by its length."""
    return text.encode(encoding, _ERRORS).decode(encoding)


def write_json(text: str) -> None:
    """Write JSON to standard output; where that is not UTF-8 with escapes, that are JSON too."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    utf = codecs.lookup(encoding).name.startswith("utf")
    odd = r"[\ud800-\udfff]" if utf else r"[^\x00-\x7f]"
    sys.stdout.write(re.sub(odd, lambda found: json.dumps(found[0])[1:-1], text))


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Return what stands for the characters that cannot be encoded, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_plain, error.object[error.start : error.end])), error.end


def _plain(character: str) -> str:
    if "\udc80" <= character <= "\udcff":  # a byte of a file's name that is no text
        return f"\\x{ord(character) - 0xDC00:02x}"
    if character in _ASCII:
        return _ASCII[character]
    # Letters without their accents, digits and signs that are others in other clothes.
    parts = [c for c in unicodedata.normalize("NFKD", character) if not unicodedata.combining(c)]
    return "".join(c if c.isascii() else _ASCII.get(c, "?") for c in parts)


codecs.register_error(_ERRORS, _in_ascii)
