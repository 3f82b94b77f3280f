"""The quadratic programme and the sampling that predictive control stands on."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .holds import hermite_hold as hermite_hold
    from .holds import noisy_hold as noisy_hold
    from .holds import root_of as root_of
    from .qp import SoftQP as SoftQP
    from .qp import Solved as Solved
    from .qp import kkt_residual as kkt_residual
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
