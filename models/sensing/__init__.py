"""Sensors and telemetry between the plant and a controller, and the controller's protocol.

A case's sensors come in; what a controller is shown, once in a sample, goes out: as a recursion in
the simulation (`SensorModel`) and as a linear plant with noises for synthesis (`sensed_plant`).
Any object that keeps to `Controller` may then answer with a command.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .control import HEARD as HEARD
    from .control import Controller as Controller
    from .control import Measurement as Measurement
    from .control import Recursion as Recursion
    from .control import holds_brake as holds_brake
    from .control import recursion_of as recursion_of
    from .mru import Bias as Bias
    from .mru import MruModel as MruModel
    from .mru import MruState as MruState
    from .mru import check_biases as check_biases
    from .plant import MEASURED as MEASURED
    from .plant import SAMPLE_TIME as SAMPLE_TIME
    from .plant import sensed_plant as sensed_plant
    from .plant import sensed_spectra as sensed_spectra
    from .plant import with_sensors as with_sensors
    from .sensing import NOISE as NOISE
    from .sensing import SensorModel as SensorModel
    from .telemetry import Late as Late
    from .telemetry import TelemetrySchedule as TelemetrySchedule
    from .telemetry import check_late as check_late
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
