"""Lower bounds on the payload's motion under any linear controller (LQG duality).

A case, or a plant with spectra, weights and rms limits, comes in; a `Bound` with its multipliers
and the LQG controller next to it goes out, and a design's distance from it.  `verify_bound`
recomputes a bound by other routes, `weighted_rms` puts another controller on its terms.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound import Bound
    from .case import DesignBound, bound_beside, bound_for, exact_sensors
    from .check import verify_bound, weighted_rms
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
