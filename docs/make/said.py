"""Figures in the sentences of the docs: each sentence is made of the numbers of a stored row.

    Saying: page, template, work --> row: numbers, words --> in the page, for the old words

A script lists its sayings and calls `tell`; a new one comes into a page where {{name}} stands.  A
row keeps the words that were put into the page, so that they are found there again, however the
lines are broken; the tests hold page and row to each other.
"""

from __future__ import annotations

import argparse
import math
import re
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stored import DOCS, docs_folder, read_rows, study_parser, write_rows

COLUMNS = ("page", "name", "numbers", "seconds", "words")
_WIDTH = 100
_DIGITS = 8
_STUCK = "\x01"
_GLUE = re.compile(r"(?<=\d) (?=(?:mm|m|ms|s|kN|MW|Hz|rad/s)\b)| (?=[-%+*#>:=|](?:\W|$)|\d+[.)] )")


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How long a saying may take: starts of a search, seeds and seconds of a simulation."""

    starts: int = 8
    seeds: int = 2
    seconds: float = 300.0


QUICK = Effort(starts=1, seeds=1, seconds=40.0)


@dataclass(frozen=True, kw_only=True)
class Saying:
    """Words of a page with fields for numbers, and what finds these numbers.

    A template holds a whole table, or part of a paragraph.
    """

    page: str
    name: str
    template: str
    work: Callable[[Effort], Mapping[str, float]]

    def words(self, numbers: Mapping[str, float]) -> str:
        """Return the words with their numbers, in one line if they are no table."""
        words = self.template.format(**numbers)
        return words if "|" in words else " ".join(words.split())


def digits(value: float, count: int = 3) -> str:
    """Return a number to so many digits, without powers of ten."""
    rounded = float(f"{value:.{count}g}")
    return f"{rounded:#.{max(count, len(f'{abs(rounded):.0f}'))}g}".rstrip(".")


class Number(float):
    """A number that a template writes with three digits, or as many as it says: ``{name:2}``."""

    def __format__(self, wanted: str) -> str:
        if not math.isfinite(self):
            return "infinite" if self > 0.0 else "no number"
        if not wanted or wanted.isdigit():
            return digits(float(self), int(wanted or 3))
        return float.__format__(self, wanted)


def numbers_of(row: Mapping[str, str]) -> dict[str, float]:
    """Return the numbers of a row by name."""
    pairs = (item.partition("=") for item in row["numbers"].split(";"))
    return {name: Number(value) for name, _, value in pairs}


def holds(page: str, words: str) -> bool:
    """Return whether a page has these words, however its lines are broken."""
    return _pattern(words).search(page) is not None


def replaced(page: str, old: str, new: str) -> str:
    """Return a page with other words, in lines of their own paragraph.

    Raises
    ------
    ValueError
        If the page does not have the old words once.
    """
    found = list(_pattern(old).finditer(page))
    if len(found) != 1:
        raise ValueError(f"the page has these words {len(found)} times: {old!r}")
    (there,) = found
    if new.split() == old.split():
        return page
    if "|" in new:
        return page[: there.start()] + new + page[there.end() :]
    changed = page[: there.start()] + new + page[there.end() :]
    # A paragraph ends at an empty line, or where the next item of a list begins.
    head = [m.end() for m in re.finditer(r"\n\s*\n|\n(?=[*:] )", changed[: there.start() + 1])]
    begin = head[-1] if head else 0
    tail = re.compile(r"\n\s*\n|\n(?=[*:] )|\n*\Z").search(changed, there.start() + len(new))
    end = tail.start() if tail is not None else len(changed)
    paragraph = changed[begin:end]
    indent = "  " if paragraph.startswith(("* ", ": ")) else ""
    # A unit stays with its number, and no line begins with what Markdown would take for a mark.
    glued = _GLUE.sub(_STUCK, " ".join(paragraph.split()))
    lines = textwrap.fill(
        glued,
        _WIDTH,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    ).replace(_STUCK, " ")
    return changed[:begin] + lines + changed[end:]


def _pattern(words: str) -> re.Pattern[str]:
    return re.compile(r"(?<!\S)" + r"\s+".join(re.escape(word) for word in words.split()))


def sayings_parser(doc: str | None) -> argparse.ArgumentParser:
    """Return the parser of a script that calls `tell`."""
    parser = study_parser(doc)
    parser.add_argument("--only", default="", help="names of sayings")
    parser.add_argument("--words", action="store_true", help="other words for the stored numbers")
    return parser


def tell(sayings: Sequence[Saying], file: str, given: argparse.Namespace) -> int:
    """Find the numbers of sayings, store them, and put the words into their pages.

    Returns 1 if a page does not have the words that are to be replaced.
    """
    docs = docs_folder(given.quick)
    path = docs / "data" / file
    rows = {row["name"]: row for row in read_rows(path)} if path.exists() else {}
    wanted = given.only.split(",") if given.only else [saying.name for saying in sayings]
    lost = 0
    for saying in sayings:
        if saying.name not in wanted:
            continue
        row = dict(rows[saying.name]) if given.words else _found(saying, given.quick)
        row["words"] = saying.words(numbers_of(row))
        print(f"{saying.name}, {row['seconds']} s: {row['words']}", flush=True)
        old = rows[saying.name]["words"] if saying.name in rows else f"{{{{{saying.name}}}}}"
        rows[saying.name] = row
        made = path.read_text(encoding="utf-8").partition("\n")[0] if given.words else ""
        write_rows(path, COLUMNS, (rows[s.name] for s in sayings if s.name in rows))
        if given.words:  # the numbers are as old as they were
            now = path.read_text(encoding="utf-8").partition("\n")[2]
            path.write_text(f"{made}\n{now}", encoding="utf-8")
        if docs == DOCS:
            page = docs / saying.page
            try:
                text = replaced(page.read_text(encoding="utf-8"), old, row["words"])
            except ValueError as error:
                print(f"{saying.page}: {error}", flush=True)
                lost += 1
            else:
                page.write_text(text, encoding="utf-8")
    return int(lost > 0)


def _found(saying: Saying, quick: bool) -> dict[str, str]:
    """Return the row of a saying without its words."""
    began = time.process_time()
    found = saying.work(QUICK if quick else Effort())
    text = ";".join(f"{name}={value:.{_DIGITS}g}" for name, value in found.items())
    seconds = f"{time.process_time() - began:.3g}"
    return {"page": saying.page, "name": saying.name, "numbers": text, "seconds": seconds}


def stored_sayings(file: str, folder: Path = DOCS / "data") -> list[dict[str, str]]:
    """Return the rows of a script's sayings."""
    return read_rows(folder / file)
