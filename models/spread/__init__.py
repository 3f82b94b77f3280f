"""Spreads: the numbers of a case that vary, their distributions, and the samples drawn.

    Spread (distributions by dotted path) + case -> rows of numbers -> changes of the case

A row depends on its own index and the seed alone (a Latin hypercube: on the number of rows as
well), so that a sweep gives the same numbers in chunks of any size, on any engine, in any order.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .distributions import Distribution as Distribution
    from .distributions import LogNormal as LogNormal
    from .distributions import Normal as Normal
    from .distributions import Samples as Samples
    from .distributions import Triangular as Triangular
    from .distributions import Uniform as Uniform
    from .fields import ALIASES as ALIASES
    from .fields import DRAG as DRAG
    from .fields import GAINS as GAINS
    from .fields import Field as Field
    from .fields import field_of as field_of
    from .sampling import METHODS as METHODS
    from .spread import Spread as Spread
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
