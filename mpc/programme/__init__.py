"""Predictive control of any linear plant: what becomes of it over a horizon, as a programme.

A sampled plant, its regulator and the blocks of its moves come in; the condensed quadratic
programme, the solver that is kept warm from one sample to the next, and the gains and covariances
of a Kalman filter go out.  Nothing here knows of a winch.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .condensed import Condensed, Constraint, Question
    from .controller import PredictiveController
    from .filter import KalmanFilter, ages, late_row, remember
    from .horizon import Horizon, Signals, default_blocking, free_outputs, sampled
    from .kalman import (
        Mask,
        SampledFilter,
        corrected,
        end_of_record,
        kalman_gain,
        prediction_covariance,
    )
    from .programme import Plan, Programme
    from .qp import QPSolution, SoftQP, kkt_residual
    from .regulator import LQRegulator, lq_regulator
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
