"""The winch as predictive control sees it: sampled model, estimator, regulator, weights.

A case comes in; out go the model of winch, sea and sensors' errors in one state, the Kalman filter
and the regulator that stand on it, and the weights with which both stay robust.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .estimator import WinchEstimator
    from .gate import SignalGate
    from .inertia import MotorInertia
    from .planning import plan_model
    from .prediction import PredictionModel, ProcessNoise, prediction_model, with_noise
    from .regulation import feedback_row, regulator
    from .sampled import SampledWinch, by_command, command_law, sampled_winch
    from .weights import Weights, tune_weights
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
