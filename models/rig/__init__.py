"""Rig: rope, crane, rigging, payload, drum, winch, sensors, limits: sections of the case file.

Data of a case file come in; what follows from one section by itself (stiffness, virtual mass, the
drum's radius, inertia at the shaft) goes out.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .crane import Crane, Rigging
    from .limits import GainBounds, Gains, Limits
    from .payload import Payload, energy_equivalent
    from .rope import Rope
    from .sensors import MRU, Encoder, LoadCell, PayloadSensor, Sensors, Telemetry
    from .winch import ACMotor, DCMotor, Drive, Winch
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
