"""Alpha factor: what part of a limiting H_s may be forecast, as forecasts are uncertain.

    a number, or the user's table: H_s, T_POP, forecast level -> alpha -> limit times alpha

No standard's table is part of this program: the user's file says where its numbers come from, and
the output repeats it.
"""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.basics import FloatArray, InputError, check_range, read_text

_NAMES = {
    "height": ("hs", "significantheight", "significantwaveheight", "designhs", "h"),
    "planned": ("tpop", "duration", "plannedtime", "plannedoperationperiod"),
    "level": ("level", "forecastlevel", "weatherforecastlevel"),
    "alpha": ("alpha", "alphafactor", "a"),
}
_HOUR = 3600.0


@dataclass(frozen=True, kw_only=True)
class Alpha:
    """Alpha over the limiting H_s, for one planned time and forecast level.

    Examples
    --------
    >>> half = Alpha(heights=(1.0, 3.0), factors=(0.6, 0.8))
    >>> half(np.array([0.5, 2.0, 9.0])).round(3).tolist()
    [0.6, 0.7, 0.8]
    """

    heights: tuple[float, ...] = (1.0,)  #: H_s, ascending [m].
    factors: tuple[float, ...] = (1.0,)  #: Alpha at each, above 0 and at most 1 [-].
    text: str = "none: 1"  #: What it is, and where it comes from.

    def __call__(self, limit: FloatArray) -> FloatArray:
        """Return alpha at limiting heights [m]: linear in between, the end's beyond the ends."""
        return np.asarray(np.interp(limit, self.heights, self.factors))

    def beyond(self, limit: FloatArray) -> float:
        """Return which part of the limiting heights lies beyond the ends of a table [-]."""
        known = limit[np.isfinite(limit)]
        if len(self.heights) < 2 or not known.size:
            return 0.0
        outside = (known < self.heights[0]) | (known > self.heights[-1])
        return float(np.mean(outside))


def alpha_factor(given: float | str | Path, planned: float, level: str | None = None) -> Alpha:
    """Return alpha as it is given: a number above 0 and at most 1, or the user's table of it.

    The table is CSV with columns ``H_s [m]``, ``T_POP [h]``, perhaps ``level``, and ``alpha``, and
    says in two lines before them ``# source: ...`` and ``# edition: ...``.  Of the planned times
    the shortest that is not below `planned` [s] counts; between heights it is linear.

    Raises InputError if a number is out of range, the table does not say its source and edition,
    lacks a column, does not reach the planned time, or has several levels and none is named.
    """
    try:
        number = float(given)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return _from_table(Path(given), planned, level)  # type: ignore[arg-type]
    value = check_range("operability", "alpha", number, low=0.0, high=1.0, open_low=True)
    if level is not None:
        raise InputError(
            f"operability: forecast_level is for a table of alpha, not for the number {value:g}"
        )
    text = "none: 1" if value == 1.0 else f"{value:g}, a number given by the user"
    return Alpha(factors=(value,), text=text)


def _from_table(path: Path, planned: float, level: str | None) -> Alpha:
    text = read_text(path)
    said = {
        match.group(1).lower(): match.group(2).strip()
        for match in re.finditer(r"^\s*#\s*(source|edition)\s*:\s*(\S.*)$", text, re.M | re.I)
    }
    for name in ("source", "edition"):
        if name not in said:
            raise InputError(
                f"{path}: must say where its numbers come from, in a line '# {name}: ...'"
            )
    rows = _rows(str(path), text)
    levels = sorted({row[2] for row in rows})
    if level is None and len(levels) > 1:
        raise InputError(f"{path}: forecast level must be one of {', '.join(levels)}; got none")
    if level is not None and level not in levels:
        raise InputError(
            f"{path}: forecast level must be one of {', '.join(filter(None, levels)) or 'none'}; "
            f"got {level!r}"
        )
    mine = [row for row in rows if level is None or row[2] == level]
    times = sorted({row[1] for row in mine})
    reached = next((t for t in times if t >= planned * (1.0 - 1e-9)), None)
    if reached is None:
        raise InputError(
            f"{path}: T_POP must be at most {times[-1] / _HOUR:g} h, got {planned / _HOUR:g} h"
        )
    pairs = sorted((row[0], row[3]) for row in mine if row[1] == reached)
    heights = [height for height, _ in pairs]
    if len(set(heights)) < len(heights):
        raise InputError(f"{path}: has two rows for one H_s, T_POP and level")
    words = f"{path.name}, source: {said['source']}, edition: {said['edition']}"
    level_words = f", forecast level {level or levels[0]}" if (level or levels[0]) else ""
    return Alpha(
        heights=tuple(heights),
        factors=tuple(factor for _, factor in pairs),
        text=f"{words}; rows of T_POP up to {reached / _HOUR:g} h{level_words}",
    )


def _rows(owner: str, text: str) -> list[tuple[float, float, str, float]]:
    """Return the rows of a table: H_s [m], T_POP [s], level, alpha."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip(" \t,;") and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise InputError(f"{owner}: must have a header and rows")
    separator = max(",;\t", key=lines[0][1].count)
    cells = list(csv.reader(io.StringIO("\n".join(line for _, line in lines)), delimiter=separator))
    at: dict[str, int] = {}
    for index, head in enumerate(cells[0]):
        plain = re.sub(r"[^a-z]", "", re.sub(r"[\[(].*", "", head).lower())
        for ours, theirs in _NAMES.items():
            if plain in theirs:
                at.setdefault(ours, index)
    for name, shown in (("height", "H_s [m]"), ("planned", "T_POP [h]"), ("alpha", "alpha")):
        if name not in at:
            raise InputError(f"{owner}: must have the columns H_s [m], T_POP [h], alpha and "
                             f"perhaps level; {shown} is missing")  # fmt: skip
    found = []
    for (number, _), row in zip(lines[1:], cells[1:], strict=True):
        where = f"{owner}:{number}"
        if len(row) <= max(at.values()):
            raise InputError(f"{where}: must have {len(cells[0])} columns, got {len(row)}")
        height = check_range(where, "H_s", row[at["height"]], low=0.0, high=30.0, unit="m")
        hours = check_range(
            where, "T_POP", row[at["planned"]], low=0.0, high=math.inf, unit="h", open_low=True
        )
        alpha = check_range(where, "alpha", row[at["alpha"]], low=0.0, high=1.0, open_low=True)
        level = row[at["level"]].strip() if "level" in at else ""
        found.append((height, hours * _HOUR, level, alpha))
    return found
