"""Sensitivity of a design to the numbers of its case, locally and over whole ranges.

A design comes in, with a spread where ranges are meant; elasticities by dual numbers
(`sensitivity`), Sobol's indices (`sobol_indices`) or Morris's effects (`morris_screening`) go out.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .elasticity import Elasticity, Moved, Sensitivity, sensitivity
    from .global_indices import SobolIndices, sobol_indices
    from .screening import Screening, morris_screening
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
