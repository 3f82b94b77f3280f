"""Rig: rope, payload, drum, winch, sensors and limits, as sections of the case file.

Data of a case file come in; what follows from one section by itself (stiffness, virtual mass, the
drum's radius, inertia at the shaft) goes out.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .limits import GainBounds as GainBounds
    from .limits import Gains as Gains
    from .limits import Limits as Limits
    from .payload import Payload as Payload
    from .rope import Rope as Rope
    from .sensors import MRU as MRU
    from .sensors import Encoder as Encoder
    from .sensors import LoadCell as LoadCell
    from .sensors import PayloadSensor as PayloadSensor
    from .sensors import Sensors as Sensors
    from .sensors import Telemetry as Telemetry
    from .winch import ACMotor as ACMotor
    from .winch import DCMotor as DCMotor
    from .winch import Drive as Drive
    from .winch import Winch as Winch
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
