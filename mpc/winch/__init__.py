"""The winch as predictive control sees it: sampled model, estimator, regulator, weights.

A case comes in; out go the model of winch, sea and sensors' errors in one state, the Kalman filter
and the regulator that stand on it, and the weights with which both stay robust.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .estimator import WinchEstimator as WinchEstimator
    from .planning import plan_model as plan_model
    from .prediction import PredictionModel as PredictionModel
    from .prediction import prediction_model as prediction_model
    from .prediction import with_noise as with_noise
    from .process_noise import ProcessNoise as ProcessNoise
    from .regulation import regulator as regulator
    from .sampled import SampledWinch as SampledWinch
    from .sampled import command_law as command_law
    from .weights import Weights as Weights
    from .weights import tune_weights as tune_weights
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
