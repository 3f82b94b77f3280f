"""Predictive control of any linear plant: what becomes of it over a horizon, as a programme.

A sampled plant, its regulator and the blocks of its moves come in; the condensed quadratic
programme, the solver that is kept warm from one sample to the next, and the gains and covariances
of a Kalman filter go out.  Nothing here knows of a winch.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .condensed import Condensed as Condensed
    from .condensed import condense as condense
    from .holds import hermite_hold as hermite_hold
    from .holds import hermite_within as hermite_within
    from .holds import noisy_hold as noisy_hold
    from .holds import root_of as root_of
    from .horizon import Horizon as Horizon
    from .horizon import default_blocking as default_blocking
    from .horizon import free_outputs as free_outputs
    from .kalman import corrected as corrected
    from .kalman import end_of_record as end_of_record
    from .kalman import kalman_gain as kalman_gain
    from .kalman import prediction_covariance as prediction_covariance
    from .qp import QPSolution as QPSolution
    from .qp import SoftQP as SoftQP
    from .qp import kkt_residual as kkt_residual
    from .regulator import LQRegulator as LQRegulator
    from .regulator import lq_regulator as lq_regulator
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
