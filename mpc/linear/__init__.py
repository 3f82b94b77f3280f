"""Predictive control with the linear plant, as one quadratic programme a sample.

A case comes in, a controller with the `step` protocol goes out: what the sensors show becomes an
estimate, this with a forecast the gradient of a programme, and its first move a drive command.
`WinchMPC` is what linear and nonlinear control share.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .clipped import ClippedMPC
    from .linear import LinearMPC
    from .products import Products
    from .winch_mpc import WinchMPC, WinchOptions
    from .winch_programme import WATCHED, by_chi, path_of_sea, sea_at_end, winch_signals
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
