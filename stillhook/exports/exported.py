"""One export before it is written: its files, how it was proved, and how it is built and run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, eq=False)
class Exported:
    """What goes into one folder, all of it made before anything is written."""

    kind: str  #: As it is asked for: ``c``, ``fmu``, ..; its folder is called so.
    title: str  #: What it is, a heading.
    files: Mapping[str, str | bytes]  #: Content by path within the folder, without the README.
    about: str  #: What it is, how it is built and run: Markdown of the README.
    #: What was compared with what, and what was found: a sentence with its numbers.
    proof: str
    proved: bool = True  #: Whether the comparison was made, and kept its tolerance.
