"""Predictive control with the linear plant, as one quadratic programme a sample."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .condensed import WATCHED as WATCHED
    from .condensed import Condensed as Condensed
    from .condensed import condense as condense
    from .condensed import path_of_sea as path_of_sea
    from .condensed import sea_at_end as sea_at_end
    from .linear import LinearMPC as LinearMPC
    from .products import Products as Products
    from .winch_mpc import WinchMPC as WinchMPC
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
