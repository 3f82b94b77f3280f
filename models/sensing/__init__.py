"""Sensors and telemetry between the plant and a controller, and the controller's protocol.

A case's sensors come in; what a controller is shown, once in a sample, goes out: as a recursion in
the simulation (`SensorModel`) and as a linear plant with noises for synthesis (`sensed_plant`).
Any object that keeps to `Controller` may then answer with a command.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .control import (
        HEARD,
        STATUSES,
        Controller,
        ControllerAround,
        Measurement,
        Recursion,
        heard_by,
        holds_brake,
        recursion_of,
    )
    from .mru import (
        BIAS,
        Bias,
        MruModel,
        MruState,
        coherent_error,
        error_density,
        low_pass_noise,
        unit_response,
    )
    from .native import (
        FunctionInC,
        NativeLaw,
        WithC,
        checked_prefix,
        function_as_c,
        interface_header,
        native_of,
        numbers,
        recursion_as_c,
    )
    from .plant import (
        DRIFT_BAND,
        ENCODER,
        LOAD,
        MEASURED,
        SAMPLE_TIME,
        SENSORS,
        UnitError,
        aboard,
        sensed_line_at,
        sensed_plant,
        sensed_spectra,
        with_loads,
        with_sensors,
    )
    from .sensing import NOISE, SensorModel
    from .switching import (
        SET_POINT,
        SWITCHING_BAND,
        SWITCHING_TURN,
        SwitchingNoise,
        SwitchingShape,
        density_of,
        velocity_correlation,
    )
    from .telemetry import LATE, Interval, Late, TelemetrySchedule, check_intervals
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
