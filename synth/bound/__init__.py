"""Lower bounds on the payload's motion under any linear controller (LQG duality).

A plant with spectra, weights and rms limits comes in, and a `Bound` with its multipliers and the
LQG controller next to it goes out; a case or a design, and out comes the `BestPossible`: the bound,
and the best controller found within an M_s.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .bound import Bound, lqg_bound
    from .case import BestPossible, bound_for, exact_sensors, high_order_for
    from .high_order import HighOrder
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
