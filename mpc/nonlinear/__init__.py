"""Predictive control with the nonlinear plant, as one Gauss-Newton step a sample.

The winch's recipe of `mpc.linear` comes in, with quadratic drag, slack rope and layers of
the drum as forces beside the linear plant; a controller with the `step` protocol goes out.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .nonlinear import NonlinearMPC
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
