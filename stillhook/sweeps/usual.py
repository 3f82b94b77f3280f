"""The usual spreads: plant data that are never known exactly, and faults.

    case, mode --> usual_spread --> Spread;  name --> fault_spread --> Spread

The usual one is that of ``stillhook margins``, with a later telemetry: how far a payload's mass,
the rope's stiffness, the drag and the link are off in practice.
"""

from collections.abc import Mapping
from types import MappingProxyType

from models.basics import pick
from models.case import Case
from models.spread import Distribution, Spread, Uniform

_LATER = 0.02  # how much later the telemetry may be [s]


def usual_spread(case: Case, mode: str) -> Spread:
    """Return mass +-30 %, stiffness +-20 %, drag +-50 % and a delay of up to 20 ms more.

    In the mode "frequency" drag is the design's linear coefficient, in "time" the drag coefficient
    of the payload.
    """
    delay = float(case.sensors.telemetry.delay)
    drag = "drag" if mode == "frequency" else "payload.drag_coefficient"
    return Spread(
        {
            "payload.mass": Uniform("30 %"),
            "rope.axial_stiffness": Uniform("20 %"),
            drag: Uniform("50 %"),
            "sensors.telemetry.delay": Uniform(delay, delay + _LATER),
        }
    )


FAULT_SPREADS: Mapping[str, Mapping[str, Distribution]] = MappingProxyType(
    {
        "dropouts": {
            "sensors.telemetry.dropout": Uniform(0.0, 0.5),
            "sensors.telemetry.dropout_length": Uniform(0.0, 1.0),
        },
        "outages": {"fault.telemetry_outage": Uniform(0.0, 20.0)},
        "stuck": {"fault.stuck_readings": Uniform(0.0, 60.0)},
        "spikes": {"fault.mru_spike": Uniform(-3.0, 3.0)},
        "delay-jumps": {
            "fault.delay_step": Uniform(0.0, 0.3),
            "fault.lasting": Uniform(10.0, 120.0),
        },
        "sensor-bias": {
            "sensors.payload.acceleration_bias": Uniform(-0.05, 0.05),
            "sensors.payload.velocity_bias": Uniform(-0.02, 0.02),
            "sensors.payload.displacement_bias": Uniform(-0.1, 0.1),
        },
        "mru-bias": {
            "fault.mru_heave_bias": Uniform(-0.2, 0.2),
            "fault.mru_rate_bias": Uniform(-0.05, 0.05),
        },
        "limit-cuts": {
            "fault.torque_limit": Uniform(0.5, 1.0),
            "fault.power_limit": Uniform(0.3, 1.0),
        },
    }
)
"""What fails, by name, and how far: up to half of the messages lost, in runs of up to a second; no
message for up to 20 s; payload sensors that stand still for up to a minute, and a heave that is off
by up to 3 m for 0.05 s of every 2 s; messages up to 0.3 s later for a while; payload sensors that
show 5 mg, 2 cm/s or 10 cm too much; a reference unit that shows 20 cm or 5 cm/s too much for a
minute; a drive with half of its torque or a third of its power for a minute."""


def fault_spread(*names: str) -> Spread:
    """Return the spread of one or several kinds of faults, by names of `FAULT_SPREADS`.

    Raises InputError if a name is unknown.

    Examples
    --------
    >>> fault_spread("outages", "limit-cuts").paths
    ('fault.telemetry_outage', 'fault.torque_limit', 'fault.power_limit')
    """
    pick("faults", "kind", tuple(FAULT_SPREADS), names)
    together: dict[str, Distribution] = {}
    for name in names:
        together |= FAULT_SPREADS[name]
    return Spread(together)
