"""Predictive control with the nonlinear plant."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .nonlinear import NonlinearMPC as NonlinearMPC
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
