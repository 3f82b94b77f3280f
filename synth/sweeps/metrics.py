"""Metrics of a sweep: names, units, and the outputs of the plant that they need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, InputError
from models.casefile import suggestion

DEFAULT = ("payload_rms", "torque_rms", "speed_rms", "max_sensitivity")


@dataclass(frozen=True, kw_only=True)
class FrequencyMetric:
    """One number of a case.

    Attributes
    ----------
    name, unit, long_name
        For the dataset.
    output
        The plant's output it is about, if any.
    kind
        ``rms``, ``peak`` (most probable in the exposure time, static value included), ``least``,
        ``period`` (mean zero-crossing), ``loop`` or ``static``.
    """

    name: str
    unit: str
    long_name: str
    output: str = ""
    kind: str = "rms"


# name, unit, output, kind, words
_ROWS = (
    ("payload_rms", "m", "payload.displacement", "rms",
     "standard deviation of the payload's motion"),
    ("velocity_rms", "m/s", "payload.velocity", "rms",
     "standard deviation of the payload's velocity"),
    ("torque_rms", "N m", "motor.torque", "rms", "standard deviation of the motor's torque"),
    ("speed_rms", "rad/s", "motor.speed", "rms", "standard deviation of the motor's speed"),
    ("haul_rms", "m", "drum.haul", "rms", "standard deviation of the drum's haul"),
    ("tension_rms", "N", "rope.tension", "rms",
     "standard deviation of the rope's tension at the drum"),
    ("current_rms", "", "motor.current", "rms",
     "standard deviation of the motor's current (of an AC motor: its torque)"),
    ("command_rms", "", "drive.command", "rms", "standard deviation of the drive's command"),
    ("voltage_rms", "V", "motor.voltage", "rms", "standard deviation of the armature's voltage"),
    ("torque_peak", "N m", "motor.torque", "peak",
     "most probable largest torque in the exposure time, static torque included"),
    ("speed_peak", "rad/s", "motor.speed", "peak",
     "most probable largest speed of the motor in the exposure time"),
    ("tension_peak", "N", "rope.tension", "peak",
     "most probable largest tension at the drum in the exposure time"),
    ("tension_least", "N", "rope.tension", "least",
     "most probable smallest tension at the drum in the exposure time"),
    ("payload_period", "s", "payload.displacement", "period",
     "mean zero-crossing period of the payload's motion"),
    ("max_sensitivity", "1", "", "loop", "largest sensitivity M_s of the loop"),
    ("drag", "N s/m", "", "static", "linear drag coefficient that agrees with the response"),
    ("static_torque", "N m", "", "static",
     "motor torque that hauls the load at rest, gear losses included"),
    ("static_tension", "N", "", "static", "rope tension at the drum at rest"),
)  # fmt: skip

METRICS: Mapping[str, FrequencyMetric] = {
    name: FrequencyMetric(name=name, unit=unit, output=output, kind=kind, long_name=words)
    for name, unit, output, kind, words in _ROWS
}
"""Every metric by its name; `stable` is always there."""


def chosen_metrics(names: Sequence[str] | None, *, dc: bool) -> tuple[FrequencyMetric, ...]:
    """Return the metrics of a sweep.

    Raises
    ------
    InputError
        If a name is unknown, or the motor has none of it.
    """
    wanted = DEFAULT if names is None else tuple(dict.fromkeys(n for n in names if n != "stable"))
    for name in wanted:
        if name not in METRICS:
            raise InputError(f"sweep: metric {name!r} is unknown; {suggestion(name, [*METRICS])}")
        if name == "voltage_rms" and not dc:
            raise InputError("sweep: voltage_rms is of a DC motor; an AC motor has command_rms")
    return tuple(METRICS[name] for name in wanted)


def finished(
    metrics: Sequence[FrequencyMetric],
    *,
    moments: Mapping[tuple[str, int], FloatArray],
    drag: FloatArray,
    max_sensitivity: FloatArray,
    tension: FloatArray,
    arm: FloatArray,
    exposure: float,
    count: int,
) -> dict[str, FloatArray]:
    """Return metrics, (n,) each, from moments by (output, order).

    Parameters
    ----------
    metrics, moments, drag, max_sensitivity
        What is wanted, and what it is made of.
    tension, arm
        Rope tension at rest [N], and motor torque per tension when hauling [m].
    exposure
        Time for which most probable extremes are taken [s].
    count
        Number of cases.
    """
    static = {"motor.torque": tension * arm, "rope.tension": tension}
    alone = {
        "max_sensitivity": max_sensitivity,
        "drag": drag,
        "static_torque": tension * arm,
        "static_tension": tension,
    }
    found = {}
    for metric in metrics:
        if not metric.output:
            found[metric.name] = np.broadcast_to(alone[metric.name], (count,))
            continue
        variance = moments[metric.output, 0]
        with np.errstate(all="ignore"):
            sigma = np.sqrt(variance)
            if metric.kind == "rms":
                found[metric.name] = sigma
                continue
            period = 2.0 * np.pi * np.sqrt(variance / moments[metric.output, 2])
            # The most probable maximum of a Gaussian signal (Rice 1945), as
            # `models.basics.metrics`.
            factor = np.sqrt(2.0 * np.log(np.maximum(exposure / period, np.exp(0.5))))
        rest = static.get(metric.output, np.zeros(1))
        found[metric.name] = {
            "peak": np.abs(rest) + factor * sigma,
            "least": rest - factor * sigma,
            "period": period,
        }[metric.kind]
    return found
