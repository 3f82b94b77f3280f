"""Sensors and telemetry, as sections of the case file.

The payload's acceleration, velocity and displacement are measured at the payload and sent up;
the design sees them through a low-pass filter, the hold between readings and a delay, and with
their noise.  Bias, resolution, jitter and lost messages are for the simulation, as are motion
reference unit, motor encoder and load cell: payload feedback does not use those, feed-forward and
constant tension do.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import model_validator

from ..basics import LONGEST_DELAY
from ..casefile import Quantity, Section

_BANDWIDTH_LOW, _BANDWIDTH_HIGH = 0.1, 1e5
_SEEN = 1e4  # of what sees the payload [rad/s]: all that moves is slower by a hundred times
_Rate = Annotated[float, Quantity("frequency", _BANDWIDTH_LOW, _BANDWIDTH_HIGH)]
_Latency = Annotated[float, Quantity("time", 0.0, LONGEST_DELAY)]


class PayloadSensor(Section):
    """Acceleration, velocity and displacement of the payload."""

    bandwidth: Annotated[
        float | Literal["perfect"],
        Quantity("frequency", _BANDWIDTH_LOW, _SEEN, word="perfect"),
    ] = "perfect"
    """Bandwidth of the second-order Butterworth low-pass on all three signals; `perfect` for
    none."""
    noise_enters: Literal["before-filter", "after-filter"] = "before-filter"
    """Where the noise enters: `before-filter` for noise of the element, which passes the low-pass
    of sensor and link as the signal does; `after-filter` for noise of the samples, white up to
    half the controller's rate whatever that is."""
    acceleration_noise: Annotated[float, Quantity("acceleration noise", 0.0, 10.0)] = 0.0
    """Noise of the acceleration (one-sided amplitude density, white)."""
    velocity_noise: Annotated[float, Quantity("velocity noise", 0.0, 10.0)] = 0.0
    """Noise of the velocity (one-sided amplitude density, white)."""
    displacement_noise: Annotated[float, Quantity("displacement noise", 0.0, 10.0)] = 0.0
    """Noise of the displacement (one-sided amplitude density, white)."""
    acceleration_bias: Annotated[float, Quantity("acceleration", -10.0, 10.0)] = 0.0
    """What the acceleration shows too much, at all times."""
    velocity_bias: Annotated[float, Quantity("speed", -10.0, 10.0)] = 0.0
    """What the velocity shows too much, at all times."""
    displacement_bias: Annotated[float, Quantity("length", -100.0, 100.0)] = 0.0
    """What the displacement shows too much, at all times."""
    acceleration_resolution: Annotated[float, Quantity("acceleration", 0.0, 10.0)] = 0.0
    """Step in which the acceleration is sent; 0 for none."""
    velocity_resolution: Annotated[float, Quantity("speed", 0.0, 10.0)] = 0.0
    """Step in which the velocity is sent; 0 for none."""
    displacement_resolution: Annotated[float, Quantity("length", 0.0, 10.0)] = 0.0
    """Step in which the displacement is sent; 0 for none."""
    acceleration_rate: _Rate | None = None
    """How often the acceleration is read (5 Hz: five readings a second), each held until the next;
    not given: as often as the controller listens.  Noise of readings is independent from one to
    the next."""
    velocity_rate: _Rate | None = None
    """How often the velocity is read, as the acceleration."""
    displacement_rate: _Rate | None = None
    """How often the displacement is read, as the acceleration."""
    acceleration_latency: _Latency = 0.0
    """Time from a reading of the acceleration to its being sent, on top of the telemetry's
    delay."""
    velocity_latency: _Latency = 0.0
    """Time from a reading of the velocity to its being sent."""
    displacement_latency: _Latency = 0.0
    """Time from a reading of the displacement to its being sent."""

    def noisy(self, name: str) -> bool:
        """Return whether a signal, `acceleration` or another, has noise."""
        return float(getattr(self, f"{name}_noise")) > 0.0

    def rate(self, name: str) -> float | None:
        """Return the readings per second of a signal, `acceleration` or another; None if many."""
        found: float | None = getattr(self, f"{name}_rate")
        return None if found is None else found / (2.0 * math.pi)

    def latency(self, name: str) -> float:
        """Return the time from a reading of a signal to its being sent [s]."""
        return float(getattr(self, f"{name}_latency"))


class Telemetry(Section):
    """The link from the payload to the winch."""

    delay: Annotated[float, Quantity("time", 0.0, LONGEST_DELAY)] = 0.0
    """Delay from the payload's motion to the drive's command."""
    bandwidth: Annotated[float, Quantity("frequency", _BANDWIDTH_LOW, _SEEN)] | None = None
    """Bandwidth of the link (second-order Butterworth low-pass, after the sensor's); not given
    for none."""
    jitter: Annotated[float, Quantity("time", 0.0, LONGEST_DELAY)] = 0.0
    """Largest extra delay of a message: each is late by anything between 0 and this, all equally
    likely."""
    dropout: Annotated[float, Quantity("ratio", 0.0, 1.0, open_high=True)] = 0.0
    """Share of the messages that are lost."""
    dropout_length: Annotated[float, Quantity("time", 0.0, 3600.0)] = 0.0
    """Mean length of a run of lost messages; 0 where each is lost by itself."""


class MRU(Section):
    """The motion reference unit at the crane; payload feedback does not use it.

    Its error is stated in one of two ways: as makers do (`gain_error`, `phase_error`, `drift`,
    `noise`), or as one noise in the band of the waves (`noise_floor`, `noise_fraction`).
    """

    heave_filter_period: Annotated[float, Quantity("time", 1.0, 1000.0)] | None = None
    """Cut-off period of the high-pass filter on heave, whose gain and phase are known."""
    gain_error: Annotated[float, Quantity("ratio", 0.0, 0.5)] = 0.0
    """Gain error of the heave, of either sign and the same throughout a run; beside what the heave
    filter does."""
    phase_error: Annotated[float, Quantity("angle", 0.0, 0.5)] = 0.0
    """Phase error of the heave, of either sign and the same throughout a run; beside what the heave
    filter and the delay do."""
    drift: Annotated[float, Quantity("length", 0.0, 10.0)] = 0.0
    """Slow error of the heave (one standard deviation)."""
    drift_period: Annotated[float, Quantity("time", 10.0, 1000.0)] = 200.0
    """Period above which the drift lies (second-order Butterworth low-pass)."""
    noise: Annotated[float, Quantity("displacement noise", 0.0, 1.0)] = 0.0
    """Noise of the heave (one-sided amplitude density, white up to `bandwidth`)."""
    bandwidth: Annotated[float, Quantity("frequency", 1.0, 1000.0)] = 20.0 * math.pi
    """Bandwidth of the unit's output, which its noise passes (second-order Butterworth
    low-pass)."""
    noise_floor: Annotated[float, Quantity("length", 0.0, 1.0)] = 0.05
    """Heave accuracy for small motions (one standard deviation), read as noise in the band of the
    waves; 0 where the error is stated as makers do."""
    noise_fraction: Annotated[float, Quantity("ratio", 0.0, 1.0)] = 0.05
    """Heave accuracy as a fraction of the motion, for large motions, read like `noise_floor`; 0
    where the error is stated as makers do."""
    noise_bandwidth: Annotated[float, Quantity("frequency", 0.001, 1000.0)] = 1.0
    """Frequency up to which the error of `noise_floor` and `noise_fraction` reaches (second-order
    Butterworth low-pass)."""
    delay: Annotated[float, Quantity("time", 0.0, 10.0)] = 0.0
    """Delay from the motion to the signal."""

    @model_validator(mode="before")
    @classmethod
    def _one_kind(cls, data: Any) -> Any:
        """Take the error for zero that is not given, where the other kind is."""
        if isinstance(data, dict) and any(name in data for name in _STATED):
            return {"noise_floor": 0.0, "noise_fraction": 0.0, **data}
        return data

    def _faults(self) -> Iterator[tuple[str, str]]:
        stated = [name for name in _STATED if getattr(self, name) > 0.0]
        in_band = [name for name in ("noise_floor", "noise_fraction") if getattr(self, name) > 0.0]
        if stated and in_band:
            text = (
                f"must be 0 where {' or '.join(in_band)} is above 0: the error is stated either as "
                f"makers do or as noise in the band of the waves, got both"
            )
            yield (stated[0], text)

    @property
    def coherent(self) -> float:
        """Root mean square of gain and phase error over their signs, a share of the heave."""
        return float(np.hypot(self.gain_error, self.phase_error))


_STATED = ("gain_error", "phase_error", "drift", "noise")


class Encoder(Section):
    """The motor's encoder; payload feedback does not use it."""

    counts_per_turn: Annotated[int, Quantity("count", 1, 10**9)]
    """Counts per turn of the motor."""


class LoadCell(Section):
    """The load cell at the rope's upper end; payload feedback does not use it."""

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
    """The motion reference unit at the crane, for feed-forward and the simulation; payload
    feedback does not use it. Not given: a perfect one."""
    encoder: Encoder | None = None
    """The motor's encoder, for the simulation; payload feedback does not use it. Not given: a
    perfect one."""
    load_cell: LoadCell | None = None
    """The load cell at the rope's upper end, for constant tension and the simulation; payload
    feedback does not use it. Not given: a perfect one."""
