"""Controllers in time: designs, and the laws that the industry uses."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .brake_on import BrakeOn as BrakeOn
    from .constant_tension import ConstantTension as ConstantTension
    from .controllers import CONTROLLERS as CONTROLLERS
    from .controllers import controller_named as controller_named
    from .feed_forward import VelocityFeedForward as VelocityFeedForward
    from .linear_feedback import LinearFeedback as LinearFeedback
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
