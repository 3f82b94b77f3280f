"""Sea states with their occurrence: the other half of a family, and scatter tables."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from models.basics import InputError, check_range
from models.case import Case


@dataclass(frozen=True, kw_only=True)
class SeaState:
    """A sea state: H_s [m], T_p [s] (None: the case's own), and its occurrence."""

    significant_height: float
    peak_period: float | None = None
    occurrence: float = 1.0

    def __post_init__(self) -> None:
        check_range("sea state", "occurrence", self.occurrence, low=0.0)

    def changes(self, case: Case) -> dict[str, float]:
        """Return the sea's fields as changes of a case, in the variables of its spectrum."""
        found = {"sea.significant_height": self.significant_height}
        if self.peak_period is None:
            return found
        if case.sea.spectrum == "bretschneider-1975":
            # The 1975 form peaks at 0.9 T_S / 0.54^(1/4), see `models.case.environment.Sea`.
            period = self.peak_period * 0.54**0.25 / 0.9
            return {**found, "sea.significant_period": period}
        return {**found, "sea.peak_period": self.peak_period}

    def __str__(self) -> str:
        """Return the state in a few characters."""
        period = "" if self.peak_period is None else f", T_p {self.peak_period:.3g} s"
        return f"H_s {self.significant_height:.3g} m{period}"


def read_scatter(path: str | Path) -> list[SeaState]:
    """Return the sea states of a scatter table, a CSV file.

    The header names the columns ``significant_height`` [m], ``peak_period`` [s] and
    ``occurrence`` (counts or shares); rows without occurrence are left out.

    Raises
    ------
    InputError
        If the file cannot be read, a column is missing or a figure is not a number.
    """
    wanted = ("significant_height", "peak_period", "occurrence")
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: the scatter table cannot be read: {error}") from error
    states = []
    for line, row in enumerate(rows, start=2):
        try:
            height, period, occurrence = (float(row[name]) for name in wanted)
        except KeyError as missing:
            raise InputError(
                f"{path}: must have the columns {', '.join(wanted)}; {missing} is missing"
            ) from None
        except (TypeError, ValueError):
            raise InputError(
                f"{path}:{line}: must be three numbers, got {list(row.values())}"
            ) from None
        if occurrence > 0.0:
            states.append(
                SeaState(significant_height=height, peak_period=period, occurrence=occurrence)
            )
    if not states:
        raise InputError(f"{path}: must have at least one row with an occurrence above 0")
    return states
