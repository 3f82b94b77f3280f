"""What matters most: how a design's figures answer to every number of its case.

Locally and exactly: from the numbers of a case to slopes of the plant's matrices, of the spectra
and of the law, and from those, by the gradient of the spectral integral, to elasticities.  Over
ranges: from a sweep to Sobol indices, and Morris screening.
"""

from __future__ import annotations

from .elasticity import sensitivity
from .results import Elasticity, Sensitivity

__all__ = ["Elasticity", "Sensitivity", "sensitivity"]
