"""`Ending`: what a command of the command line ended with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ending:
    status: int
    out: str
    err: str
