"""Forecasts of the hook's motion."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .autoregressive import AdaptiveAR as AdaptiveAR
    from .forecast import Forecast as Forecast
    from .forecast import Predictor as Predictor
    from .preview import PerfectPreview as PerfectPreview
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
