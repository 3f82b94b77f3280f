"""Controllers in time: designs, sampled, and the laws that the industry uses.

A case comes in, with gains or a design where there is feedback; a controller that steps with the
simulation goes out.  `operated` puts the operator's interface about any controller.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .brake import BrakeOn
    from .constant_tension import ConstantTension
    from .feed_forward import VelocityFeedForward
    from .interface import STOPPING, highest_command, operated
    from .linear_feedback import FADE, LinearFeedback
    from .touch_down import touching_down
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
