"""Words and rows that the chapters of a report share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..text import ReportSection, Table, Written, columns, duration
from .sources import Sources

CASE, DESIGN, OWN = "case.yaml", "design.yaml", "report.json"
RESULTS = f"{OWN}#/results"


def rows_table(rows: Sequence[Sequence[Any]], heads: str = "name=; figure=; remark=<") -> Table:
    """Return a table from its headings, as `stillhook.text.columns` reads them, and rows."""
    return Table(columns=columns(heads), rows=rows)


def chapter(title: str, *items: Any) -> ReportSection:
    """Return a chapter; what is None is left out."""
    return ReportSection(title, [item for item in items if item is not None])


def not_part(title: str, what: str) -> ReportSection:
    """Return a chapter that this issue of the document does not have."""
    return ReportSection(title, [f"Not part of this issue of the report: {what}."])


def degrees(angle: float) -> str:
    """Return an angle [rad] in degrees.

    Examples
    --------
    >>> degrees(0.5), degrees(-0.001)
    ('28.6 deg', '-0.1 deg')
    """
    return f"{math.degrees(angle):.1f} deg"


def times(factor: float) -> str:
    """Return a factor, or that it has no end."""
    return "no bound" if math.isinf(factor) else f"x {factor:.3g}"


def exact(value: float) -> str:
    """Return a number with all the digits that it was given with, up to ten.

    Examples
    --------
    >>> exact(0.0165), exact(1.276e8), exact(2.0)
    ('0.0165', '127600000', '2')
    """
    return f"{value:.10g}"


def exposure(s: Sources) -> Written:
    """Return the time for which largest values are taken."""
    return s.cite(f"{RESULTS}/motion/exposure_time", "s", write=duration)


def names_of(signal: str) -> str:
    """Return the name of a signal in words."""
    return signal.replace(".", " ").replace("_", " ")
