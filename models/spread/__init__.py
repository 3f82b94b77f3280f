"""What may vary about a case, how it is distributed, and how samples are drawn.

    Spread (distributions by dotted path) + case -> rows of numbers -> changes of the case

A row depends on its own index and the seed alone (a Latin hypercube: on the number of rows as
well), so that a sweep gives the same numbers in chunks of any size, on any engine, in any order.
"""

from __future__ import annotations

from .distributions import Distribution, LogNormal, Normal, Samples, Triangular, Uniform
from .sampling import METHODS
from .spread import Spread

__all__ = [
    "METHODS",
    "Distribution",
    "LogNormal",
    "Normal",
    "Samples",
    "Spread",
    "Triangular",
    "Uniform",
]
