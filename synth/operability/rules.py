"""The wave heights at which work stops by rule of thumb: the 1975 thesis, Table 2.

The table is of wave heights, "average maximum waves", not of H_s, and knows no period.  It is read
here as the mean of the highest tenth of the waves, H_1/10 = 1.27 H_s in a Rayleigh sea
(Longuet-Higgins, J. Marine Res. 11, 1952): another reading moves all its figures by one factor.
"""

from __future__ import annotations

from dataclasses import dataclass

HIGHEST_TENTH = 1.27
"""H_1/10 over H_s [-]."""


@dataclass(frozen=True, kw_only=True)
class Rule:
    """One operation of the table.

    Attributes
    ----------
    operation
        What is done.
    safe, marginal
        Wave heights up to which it is safe, and up to which it is marginal [m].
    """

    operation: str
    safe: float
    marginal: float

    @property
    def safe_significant(self) -> float:
        """H_s up to which it is safe [m]."""
        return self.safe / HIGHEST_TENTH

    @property
    def marginal_significant(self) -> float:
        """H_s up to which it is at least marginal [m]."""
        return self.marginal / HIGHEST_TENTH


RULES = (
    Rule(operation="crew boat 20-30 m, crew transfer at a platform", safe=0.9, marginal=1.5),
    Rule(operation="supervisor's boat 10-16 m, personnel transfer", safe=0.6, marginal=1.2),
    Rule(operation="cargo vessel at a platform", safe=0.9, marginal=1.2),
    Rule(operation="cargo vessel at floating equipment", safe=1.2, marginal=1.5),
    Rule(operation="buoy laying, small derrick barge", safe=0.6, marginal=0.9),
    Rule(operation="platform building, ship-mounted derrick", safe=1.2, marginal=1.8),
    Rule(operation="platform building, large derrick barge", safe=0.9, marginal=1.5),
)
"""The operations of the table."""
