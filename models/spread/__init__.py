"""Spreads: the numbers of a case that vary, their distributions, and the samples drawn.

    Spread (distributions by dotted path) + case -> rows of numbers -> changes of the case

A row depends on its own index and the seed alone (a Latin hypercube: on the number of rows as
well), so that a sweep gives the same numbers in chunks of any size, on any engine, in any order.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .distributions import Distribution, LogNormal, Normal, Samples, Triangular, Uniform
    from .fields import ALIASES, DRAG, GAINS, Field, field_of
    from .sampling import METHODS
    from .spread import Spread, with_payload
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
