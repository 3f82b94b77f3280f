"""Forecasts of the hook's motion from what the reference unit has shown.

Heave and heave rate come in, one sample after the other; mean and standard deviation of the motion
over the next seconds go out.  A predictor learns the record on line or, for reference, has read it.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .autoregressive import AdaptiveAR
    from .bank import SeaBank
    from .forecast import Forecast, Predictor, fused
    from .preview import PerfectPreview
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
