"""What matters most: how a design's figures answer to every number of its case.

Locally and exactly: from the numbers of a case to slopes of the plant's matrices, of the spectra
and of the law, and from those, by the gradient of the spectral integral, to elasticities.  Over
ranges: from a sweep to Sobol indices, and Morris screening.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .elasticity import sensitivity as sensitivity
    from .global_indices import SobolIndices as SobolIndices
    from .global_indices import sobol_indices as sobol_indices
    from .results import Elasticity as Elasticity
    from .results import Moved as Moved
    from .results import Sensitivity as Sensitivity
    from .screening import Screening as Screening
    from .screening import morris_screening as morris_screening
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
