"""Metrics of a sweep: names, units, and the outputs of the plant that they need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, InputError
from models.casefile import suggestion

DEFAULT = ("payload_rms", "torque_rms", "speed_rms", "max_sensitivity")


@dataclass(frozen=True, kw_only=True)
class Metric:
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


def _listed(*metrics: Metric) -> Mapping[str, Metric]:
    return {m.name: m for m in metrics}


METRICS: Mapping[str, Metric] = _listed(
    Metric(
        name="payload_rms",
        unit="m",
        long_name="standard deviation of the payload's motion",
        output="payload.displacement",
    ),
    Metric(
        name="velocity_rms",
        unit="m/s",
        long_name="standard deviation of the payload's velocity",
        output="payload.velocity",
    ),
    Metric(
        name="torque_rms",
        unit="N m",
        long_name="standard deviation of the motor's torque",
        output="motor.torque",
    ),
    Metric(
        name="speed_rms",
        unit="rad/s",
        long_name="standard deviation of the motor's speed",
        output="motor.speed",
    ),
    Metric(
        name="haul_rms",
        unit="m",
        long_name="standard deviation of the drum's haul",
        output="drum.haul",
    ),
    Metric(
        name="tension_rms",
        unit="N",
        long_name="standard deviation of the rope's tension at the drum",
        output="rope.tension",
    ),
    Metric(
        name="current_rms",
        unit="",
        long_name="standard deviation of the motor's current (of an AC motor: its torque)",
        output="motor.current",
    ),
    Metric(
        name="command_rms",
        unit="",
        long_name="standard deviation of the drive's command",
        output="drive.command",
    ),
    Metric(
        name="voltage_rms",
        unit="V",
        long_name="standard deviation of the armature's voltage",
        output="motor.voltage",
    ),
    Metric(
        name="torque_peak",
        unit="N m",
        long_name="most probable largest torque in the exposure time, static torque included",
        output="motor.torque",
        kind="peak",
    ),
    Metric(
        name="speed_peak",
        unit="rad/s",
        long_name="most probable largest speed of the motor in the exposure time",
        output="motor.speed",
        kind="peak",
    ),
    Metric(
        name="tension_peak",
        unit="N",
        long_name="most probable largest tension at the drum in the exposure time",
        output="rope.tension",
        kind="peak",
    ),
    Metric(
        name="tension_least",
        unit="N",
        long_name="most probable smallest tension at the drum in the exposure time",
        output="rope.tension",
        kind="least",
    ),
    Metric(
        name="payload_period",
        unit="s",
        long_name="mean zero-crossing period of the payload's motion",
        output="payload.displacement",
        kind="period",
    ),
    Metric(
        name="max_sensitivity",
        unit="1",
        long_name="largest sensitivity M_s of the loop",
        kind="loop",
    ),
    Metric(
        name="drag",
        unit="N s/m",
        long_name="linear drag coefficient that agrees with the response",
        kind="static",
    ),
    Metric(
        name="static_torque",
        unit="N m",
        long_name="motor torque that hauls the load at rest, gear losses included",
        kind="static",
    ),
    Metric(
        name="static_tension", unit="N", long_name="rope tension at the drum at rest", kind="static"
    ),
)
"""Every metric by its name; `stable` is always there."""


def chosen_metrics(names: Sequence[str] | None, *, dc: bool) -> tuple[Metric, ...]:
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
    metrics: Sequence[Metric],
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
