"""Sensors and telemetry, as sections of the case file.

The payload's acceleration, velocity and displacement are measured at the payload and sent up;
the design sees them through a low-pass filter and a delay.  Motion reference unit, motor encoder
and load cell are carried as data of the vessel: payload feedback does not use them.
"""

from __future__ import annotations

from typing import Annotated, Literal

from .quantity import Quantity
from .section import Section

__all__ = ["MRU", "Encoder", "LoadCell", "PayloadSensor", "Sensors", "Telemetry"]

_BANDWIDTH_LOW, _BANDWIDTH_HIGH = 0.1, 1e5


class PayloadSensor(Section):
    """Acceleration, velocity and displacement of the payload."""

    bandwidth: Annotated[
        float | Literal["perfect"],
        Quantity("frequency", _BANDWIDTH_LOW, _BANDWIDTH_HIGH, word="perfect"),
    ] = "perfect"
    """Bandwidth of the second-order Butterworth low-pass on all three signals; `perfect` for
    none."""


class Telemetry(Section):
    """The link from the payload to the winch."""

    delay: Annotated[float, Quantity("time", 0.0, 60.0)] = 0.0
    """Delay from the payload's motion to the drive's command."""
    bandwidth: Annotated[float, Quantity("frequency", _BANDWIDTH_LOW, _BANDWIDTH_HIGH)] | None = (
        None
    )
    """Bandwidth of the link (second-order Butterworth low-pass, after the sensor's); not given
    for none."""


class MRU(Section):
    """The motion reference unit at the crane (data of the vessel; not in payload feedback)."""

    heave_filter_period: Annotated[float, Quantity("time", 1.0, 1000.0)] | None = None
    """Cut-off period of the high-pass filter on heave."""
    noise_floor: Annotated[float, Quantity("length", 0.0, 1.0)] = 0.05
    """Heave accuracy for small motions (one standard deviation)."""
    noise_fraction: Annotated[float, Quantity("ratio", 0.0, 1.0)] = 0.05
    """Heave accuracy as a fraction of the motion, for large motions."""
    delay: Annotated[float, Quantity("time", 0.0, 10.0)] = 0.0
    """Delay from the motion to the signal."""


class Encoder(Section):
    """The motor's encoder (data of the winch; not in payload feedback)."""

    counts_per_turn: Annotated[int, Quantity("count", 1, 10**9)]
    """Counts per turn of the motor."""


class LoadCell(Section):
    """The load cell at the rope's upper end (data of the winch; not in payload feedback)."""

    bandwidth: Annotated[float, Quantity("frequency", _BANDWIDTH_LOW, _BANDWIDTH_HIGH)]
    """Bandwidth of the tension signal."""
    noise_fraction: Annotated[float, Quantity("ratio", 0.0, 1.0)] = 0.0
    """Noise as a fraction of the static tension (one standard deviation)."""


class Sensors(Section):
    """What is measured, and how."""

    payload: PayloadSensor = PayloadSensor()
    """Motion sensors at the payload."""
    telemetry: Telemetry = Telemetry()
    """The link from the payload to the winch."""
    mru: MRU | None = None
    """The motion reference unit at the crane; payload feedback does not use it."""
    encoder: Encoder | None = None
    """The motor's encoder; payload feedback does not use it."""
    load_cell: LoadCell | None = None
    """The load cell at the rope's upper end; payload feedback does not use it."""
